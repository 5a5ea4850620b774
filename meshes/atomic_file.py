"""Files that appear whole or not at all, whatever happens to their writer.

A file is written under a temporary name, flushed to the disk and renamed.  While it is being written its writer holds a
lock on it, which the kernel gives back however the writer ends: so a later start can tell what a killed writer left
behind, which it sweeps, from what another process is writing at this moment, which it leaves alone.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import sys
import time
from collections.abc import Iterable
from pathlib import Path

_PREFIX = ".partial-"
#: Windows has no such locks; there an open file can be neither swept nor renamed.
_POSIX = sys.platform != "win32"
#: Where a file system knows no locks, a temporary file this old has no writer any more [s].
_ABANDONED = 86_400.0


def replace(path: Path, parts: Iterable[bytes]) -> None:
    """Write a file so that it is whole, or as it was before.

    Args:
        path: The file; its folder must exist.
        parts: Its content, one after the other.

    Raises:
        OSError: If it cannot be written.
    """
    handle, temporary = _create(path.parent)
    try:
        try:
            for part in parts:
                _write(handle, part)
            os.fsync(handle)
            if _POSIX:  # still locked: between an unlock and the rename another process could sweep it
                os.replace(temporary, path)  # noqa: PTH105 -- tests let each call of `os` fail in turn
        finally:
            os.close(handle)
        if not _POSIX:
            os.replace(temporary, path)  # noqa: PTH105
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    _sync(path.parent)


def leftovers(folder: Path) -> list[Path]:
    """Temporary files in a folder, whether their writers live or not."""
    try:
        with os.scandir(folder) as found:
            return [Path(entry.path) for entry in found if entry.name.startswith(_PREFIX)]
    except OSError:
        return []


def sweep(folder: Path) -> int:
    """Remove what killed writers left in a folder; what is being written stays.

    Returns:
        How many files were removed.
    """
    return sum(_swept(path) for path in leftovers(folder))


def _create(folder: Path) -> tuple[int, Path]:
    """A new temporary file, locked."""
    while True:
        path = folder / f"{_PREFIX}{secrets.token_hex(8)}"
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        with contextlib.suppress(OSError):  # a file system without locks
            _lock(handle, wait=True)
        if path.exists():
            return handle, path
        os.close(handle)  # a sweep came between the creation and the lock


def _write(handle: int, content: bytes) -> None:
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def _sync(folder: Path) -> None:
    """Flush the renaming itself: without it a power cut may bring back the old name."""
    if _POSIX:
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _swept(path: Path) -> bool:
    """Remove one temporary file unless it is being written."""
    with contextlib.suppress(OSError):
        if not _POSIX:
            path.unlink()
            return True
        handle = os.open(path, os.O_RDONLY)
        try:
            if _abandoned(handle):
                path.unlink()  # under the lock: its writer may be about to take it
                return True
        finally:
            os.close(handle)
    return False


def _abandoned(handle: int) -> bool:
    """Whether nobody else holds the lock on a temporary file; this process then does."""
    try:
        _lock(handle, wait=False)
    except BlockingIOError:
        return False
    except OSError:
        return time.time() - os.fstat(handle).st_mtime > _ABANDONED
    return True


def _lock(handle: int, *, wait: bool) -> None:
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
