import json
import shutil

import pytest

from validation.recordings.series import find_recordings_folder

FOUND = find_recordings_folder()


RECORDINGS = None if FOUND is None else FOUND.absolute()


@pytest.mark.skipif(RECORDINGS is None, reason="no recordings here")
def test_recordings_of_another_array_are_refused(softcover):
    status, _, err = softcover("validate", "wts-0614-34", "--recordings", RECORDINGS)
    assert status == 2
    assert "is not wts-0614-34" in err
    assert "sdh2-distal" in err


@pytest.mark.skipif(RECORDINGS is None, reason="no recordings here")
def test_a_truncated_recording_is_named(softcover, tmp_path):
    shutil.copytree(next(RECORDINGS.rglob("room")), tmp_path / "data" / "room")
    for path in tmp_path.rglob("*"):
        path.chmod(0o755)
    damaged = tmp_path / "data" / "room" / "C1.dsa"
    damaged.write_bytes(damaged.read_bytes()[:9000])
    status, _, err = softcover("validate", "sdh2-distal", "--recordings", tmp_path / "data")
    assert status == 2
    assert "C1.dsa: truncated" in err
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


@pytest.mark.slow
def test_demo_writes_report_scores_and_parameters(softcover, tmp_path):
    recordings = [] if RECORDINGS is None else ["--recordings", RECORDINGS]
    status, out, err = softcover("demo", "--json", *recordings)
    assert status == 0
    page = (tmp_path / "softcover-report" / "index.html").read_text()
    assert ("Light weights to heavy ones" in page) == bool(recordings)
    assert json.loads(out)["campaign"]["skill"]["zeros"]["mean"] > 0.4
    assert "softcover-report/index.html" in err
    names = {path.name for path in (tmp_path / "softcover-report").iterdir()}
    assert names >= {"index.html", "scores.json", "parameters.toml", "cover.npz", "plotly.min.js"}
