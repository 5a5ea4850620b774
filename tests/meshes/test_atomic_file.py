"""Files that are replaced as a whole."""

from __future__ import annotations

import os

import pytest

from meshes import atomic_file

OLD, NEW = b"old" * 100_000, b"new!" * 100_000


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("call", ["open", "write", "fsync", "replace", "close"])
def test_every_call_of_the_system_may_fail(tmp_path, monkeypatch, call):
    """The k-th call fails, for every k: the file holds the old content or the new one, and nothing else is left."""
    path = tmp_path / "file"
    original = getattr(os, call)
    failures, finished = 0, False
    while not finished:
        path.write_bytes(OLD)
        calls = []

        def fail(*arguments, calls=calls, nth=failures, **options):
            calls.append(1)
            if len(calls) == nth + 1:
                if call == "close":
                    original(*arguments)
                raise OSError(28, "No space left on device")
            if call == "write":  # a short write, as nearly full disks and pipes give
                return original(arguments[0], arguments[1][: 1 << 17])
            return original(*arguments, **options)

        with monkeypatch.context() as patch:
            patch.setattr(os, call, fail)
            try:
                atomic_file.replace(path, [NEW])
            except OSError:
                failures += 1
            else:
                finished = True
        assert path.read_bytes() in ((NEW,) if finished else (OLD, NEW))
        assert names(tmp_path) == ["file"]
    assert failures >= {"write": 4, "open": 2, "fsync": 2, "close": 2}.get(call, 1)


def test_an_error_between_two_parts_leaves_the_old_file(tmp_path):
    def parts():
        yield NEW
        raise KeyError("the source of the parts failed")

    path = tmp_path / "file"
    path.write_bytes(OLD)
    with pytest.raises(KeyError):
        atomic_file.replace(path, parts())
    assert path.read_bytes() == OLD
    assert names(tmp_path) == ["file"]


def test_a_sweep_removes_abandoned_files_and_keeps_those_being_written(tmp_path):
    (tmp_path / ".partial-of-another-program").touch()
    handle, mine = atomic_file._create(tmp_path)
    dead_handle, dead = atomic_file._create(tmp_path)
    os.write(dead_handle, b"half")
    os.close(dead_handle)
    assert len(atomic_file.temporary_files(tmp_path)) == 2
    assert atomic_file.sweep(tmp_path) == 1
    assert (mine.exists(), dead.exists()) == (True, False)
    os.close(handle)
    assert atomic_file.sweep(tmp_path) == 1
    assert names(tmp_path) == [".partial-of-another-program"]


def test_without_locks_only_old_temporary_files_are_swept(tmp_path, monkeypatch):
    def unsupported(*_, **__):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(atomic_file, "_lock", unsupported)
    atomic_file.replace(tmp_path / "file", [NEW])
    young, old = (tmp_path / f"{atomic_file.PREFIX}{name}" for name in ("young", "old"))
    young.touch()
    old.touch()
    os.utime(old, (0, 0))
    assert atomic_file.sweep(tmp_path) == 1
    assert (young.exists(), old.exists()) == (True, False)
    assert (tmp_path / "file").read_bytes() == NEW


@pytest.mark.parametrize(
    "make", [os.mkfifo, lambda path: path.symlink_to("else"), lambda path: path.symlink_to("gone")]
)
def test_only_regular_files_are_replaced(tmp_path, make):
    """So `--junit /dev/stdout` and `init --force` do not put a file in the place of a device, a pipe or a link."""
    (tmp_path / "else").write_bytes(OLD)
    make(tmp_path / "file")
    before = (tmp_path / "file").lstat()
    with pytest.raises(OSError, match="which is not replaced; name a file"):
        atomic_file.replace(tmp_path / "file", [NEW])
    assert (tmp_path / "file").lstat() == before
    assert (tmp_path / "else").read_bytes() == OLD
    assert names(tmp_path) == ["else", "file"]
    make(tmp_path / f"{atomic_file.PREFIX}0")
    assert atomic_file.sweep(tmp_path) == 0  # and it does not wait for a pipe
