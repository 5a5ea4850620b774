"""The store on real file systems that are full or read-only, in a mount namespace of the test's own."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOUNT = 'mount -t tmpfs -o "size=$1" none "$2" && shift 2 && exec "$@"'


def in_small_disk(size, folder, script, *words):
    """Run a Python script in a process that sees a file system of `size` at `folder`; what it printed, line by line."""
    unshare = shutil.which("unshare")
    if unshare is None:
        pytest.skip("needs unshare")
    folder.mkdir(exist_ok=True)
    shell = [unshare, "--map-root-user", "--mount", "sh", "-c", MOUNT, "sh", size, str(folder)]
    if subprocess.run([*shell, "true"], capture_output=True, check=False).returncode:  # noqa: S603 -- no stranger's words
        pytest.skip("mounting is not permitted")
    done = subprocess.run(  # noqa: S603 -- this test's own script
        [*shell, sys.executable, "-c", script, str(folder), *words],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


LIBRARY = """
import os, subprocess, sys
import numpy as np
from fem_reference import result_store
folder = sys.argv[1]
os.environ["SOFTCOVER_STORE"] = folder
rng = np.random.default_rng(0)
def fetch(number, count=4000):
    wanted = np.random.default_rng(number).random(count)
    found = result_store.fetch("test", {"number": number}, lambda: {"a": wanted})
    assert (found["a"] == wanted).all()
"""


def test_a_full_disk_keeps_what_was_stored_and_tears_nothing(tmp_path):
    """32 kB each on a disk of 300 kB: some are stored, the others computed; removing a file makes room again."""
    out, err = in_small_disk(
        "300k",
        tmp_path / "disk",
        LIBRARY
        + """
for number in range(30):
    fetch(number)
    assert result_store.count_partial_files() == 0
kept = result_store.verify()
assert not any(entry.problem for entry in kept)
assert 5 <= len(kept) < 10, len(kept)
with open(folder + "/rest", "wb", buffering=0) as file:
    try:
        while file.write(b"x"):
            pass
    except OSError:
        pass
fetch(100, 10)
assert len(result_store.entries()) == len(kept)
os.remove(folder + "/rest")
result_store.remove(kept[0])
fetch(200)
assert len(result_store.verify()) == len(kept)
assert not any(entry.problem for entry in result_store.verify())
""",
    )
    assert out == ""
    (line,) = err.splitlines()
    assert "is not written (No space left on device): results are not kept" in line


def test_a_read_only_disk_is_read_and_told_in_a_line(tmp_path):
    out, err = in_small_disk(
        "1m",
        tmp_path / "disk",
        LIBRARY
        + """
fetch(1)
open(folder + "/.softcover-partial-left", "w").close()
subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
result_store.fetch("test", {"number": 1}, lambda: 1 / 0)
fetch(2)
fetch(3)
assert len(result_store.verify()) == 1
assert result_store.sweep_leftovers() == 0
""",
    )
    assert out == ""
    (line,) = err.splitlines()
    assert "is not written (Read-only file system): results are not kept" in line
