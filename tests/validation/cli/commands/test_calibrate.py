import json

import pytest

from tests.support.calibration import make_recording
from validation.cli.entry import main
from validation.recordings import tables


def test_calibrate_prints_one_json_object_and_refuses_a_reversed_window(tmp_path, capsys):
    files = []
    for number, load in enumerate((1.0, 2.0, 3.0, 5.0, 8.0)):
        recording = make_recording(number, load)
        tables.write(recording, tmp_path / f"{number}.csv")
        files.append(str(tmp_path / f"{number}.csv"))
    with pytest.raises(SystemExit) as caught:
        main(["calibrate", *files, "--indenter", "box:size=6.8mmx6.8mmx5mm", "--at", "0mm,0mm", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert caught.value.code == 0
    assert told["estimates"]["sensitivity"]["unit"] == "counts/N"
    assert told["report_line"]["sensitivity"] == 2665.7
    with pytest.raises(SystemExit) as caught:
        main(["calibrate", files[0], "--indenter", "box:size=6.8mmx6.8mmx5mm", "--window", "9:6"])
    assert caught.value.code == 2
    assert "the earlier time first" in capsys.readouterr().err
