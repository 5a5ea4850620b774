"""Paths and names that cannot exist are bad input of one line, in every command that takes a path or a name."""

import os

import pytest

from tests.support.words import split_command
from validation.cli import main
from validation.sensor_file import read_template

#: Commands by the path or name that they take; `{}` stands for it.
READERS = """
derive {}
derive WTS --material {}
press {} BALL
press {} BALL --model fast
press WTS --indenter {} --load 1N
press WTS --indenter mesh:path={},unit=mm --load 1N
press WTS BALL --method {}
view {} BALL --json
validate {}
validate WTS --recordings {}
demo --recordings {}
regress {}
regress WTS --baseline {}
export {}
export WTS --format {}
replay {}
import {}
import recording.csv --rows 1 --columns 2 --force {}
calibrate {}
emulate --show {} --seconds 0.1
emulate --show WTS --indenter {} --seconds 0.1
store {}
materials {}
materials --hardness {}
datasheet {}
{}
"""
WRITERS = """
derive WTS --out {}
press WTS BALL --out {}
press WTS BALL --curve 2 --out {}
validate WTS --out {}
demo --out {}
regress WTS --update --baseline {}
regress WTS --baseline recording.csv --junit {}
materials dragon-skin-30 --out {}.csv
export WTS --out {}
record loop:// --out {}
import recording.csv --rows 1 --columns 2 --out {}
replay recording.csv --csv {}
emulate {} --seconds 0.1
init {}
record {}
doctor --port {}
"""
#: Texts that name no file on any machine.
IMPOSSIBLE = ("n" * 100_000, "/".join(["a" * 200] * 40), "a\0b", "a\ud800b")
#: Texts that no file, sensor or other thing has in the folder of the test.
MISSING = ("file/below", "a\nb", "a\udcffb", "\x1b[31mx", "folder", "loop", "nobody")


@pytest.fixture
def refuse(softcover, tmp_path, monkeypatch, without_reference):
    """Run a command with each text, and expect exit status 2, no output and one line that names the text."""
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", str(tmp_path))
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "recording.csv").write_text("time,t0,t1\n0,1,2\n0.01,1,2\n")
    before = sorted(tmp_path.iterdir())

    def run(command, texts):
        for text in texts:
            status, out, err = softcover(*(word.replace("{}", text) for word in split_command(command)))
            lines = err.splitlines()
            assert (status, out) == (2, ""), (text[:40], status, err[-300:])
            assert len([line for line in lines if not line.startswith("softcover: see")]) == 1, err[-300:]
            assert lines[0].startswith("softcover: "), err[-300:]
            assert lines[0].isprintable()
            assert len(lines[0]) < 2500
            assert sorted(tmp_path.iterdir()) == before, text[:40]

    return run


@pytest.mark.parametrize("command", READERS.strip().splitlines())
def test_what_is_read_must_exist(refuse, command):
    refuse(command, (*IMPOSSIBLE, *MISSING))


@pytest.mark.parametrize("command", WRITERS.strip().splitlines())
def test_what_is_written_must_be_possible(refuse, command):
    refuse(command, (*IMPOSSIBLE, "file/below"))


@pytest.mark.parametrize("name", ["a\nb", os.fsdecode(b"a\xffb")])
def test_names_that_a_file_system_allows_are_used(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(["init", name])
    assert left.value.code == 0
    assert (tmp_path / name).read_text() == read_template()
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(" ")[0] for line in lines] == ["wrote", "next:"]
    assert all(line.isprintable() for line in lines)
