"""Ends of the command line from outside: Ctrl-C before the first line of a command, and a full disk."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from meshes import atomic_file

#: Sends the signal of Ctrl-C when Python looks for a module of the given name.
INTERRUPTED = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
from validation.cli import main
main(["materials"])
"""


@pytest.mark.parametrize("module", ["cyclopts", pytest.param("rich.table", marks=pytest.mark.slow)])
def test_ctrl_c_while_modules_are_loaded_is_status_130(module):
    code = INTERRUPTED.format(module=module)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert done.returncode == 130
    assert done.stderr == "softcover: interrupted\n"


def full(*_arguments, **_options):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("words", [["init", "sensor.toml"], ["export", "wts-0614-34", "--out", "out"]])
def test_a_full_disk_is_named_with_the_file(softcover, monkeypatch, words):
    monkeypatch.setattr(atomic_file, "_write", full)
    status, _, err = softcover(*words)
    assert status == 3
    assert words[-1] in err
    assert "No space left on device" in err
    assert len(err.splitlines()) == 1


def run_hostile(words, **changes):
    environment = {**os.environ, **{name: value for name, value in changes.items() if value is not None}}
    for name in (name for name, value in changes.items() if value is None):
        environment.pop(name, None)
    code = "from validation.cli import main; main()"
    return subprocess.run(  # noqa: S603 -- ours
        [sys.executable, "-c", code, *words], capture_output=True, check=False, env=environment, encoding="latin-1"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"LC_ALL": "C", "PYTHONIOENCODING": "ascii"},
        {"PYTHONIOENCODING": "latin-1", "NO_COLOR": "1"},
        {"HOME": None, "SOFTCOVER_STORE": None, "COLUMNS": "30"},
        {"COLUMNS": "no number", "TERM": "dumb"},
    ],
    ids=str,
)
def test_no_surroundings_lose_a_result(changes):
    done = run_hostile(["materials", "dragon-skin-30"], **changes)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "669" in done.stdout
    assert ("+-50 %" in done.stdout) == ("LC_ALL" in changes)


def test_a_file_that_cannot_be_written_is_told_before_the_work(softcover, without_reference):
    for words in (["regress", "wts-0614-34", "--update", "--baseline"], ["datasheet", "wts-0614-34", "--out"]):
        status, out, err = softcover(*words, "/proc/none.md")
        assert (status, out) == (3, "")
        assert err.startswith("softcover: /proc/none.md: cannot be written: ")
        assert len(err.splitlines()) == 1


def test_a_picture_is_written_completely_or_not_at_all(softcover, monkeypatch, tmp_path):
    monkeypatch.setattr(atomic_file, "_write", full)
    status, _, err = softcover("materials", "tpu", "--out", "tpu.png")
    assert status == 3
    assert "tpu.png" in err
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_named_when_a_library_writes(softcover, monkeypatch, tmp_path):
    """Errors of open files do not hold a path: the output folder is named."""
    monkeypatch.setattr("validation.output_folder._write_manifest", full)
    status, _, err = softcover("export", "wts-0614-34", "--out", "out")
    assert (status, err) == (3, f"softcover: {tmp_path / 'out'}: No space left on device\n")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_behind_standard_output_is_named():
    code = "from validation.cli import main; main(['store', 'list'])"
    with Path("/dev/full").open("w") as device:
        ended = subprocess.run(  # noqa: S603 -- own code
            [sys.executable, "-c", code], stdout=device, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (ended.returncode, ended.stderr) == (3, "softcover: standard output: No space left on device\n")
