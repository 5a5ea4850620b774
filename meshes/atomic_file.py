"""Files that are replaced as a whole: a reader finds the old content or the new one, never a part.

A file is written under a temporary name, flushed to the disk and renamed.  The writer holds a lock on the temporary
file until it is renamed, and the operating system releases the lock when the writer ends, in whatever way.  A later
`sweep` therefore removes the temporary files of writers that were killed and keeps those that are still being written.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import sys
import time
from collections.abc import Iterable
from pathlib import Path

#: Start of the names of temporary files.
PREFIX = ".softcover-partial-"
#: Age from which `sweep` removes a temporary file on a file system without locks, where no writer can be seen [s].
_ABANDONED_AFTER = 86_400.0
#: Whether files can be locked; Windows cannot, but there an open file can be neither removed nor renamed.
_HAS_LOCKS = sys.platform != "win32"


def replace(path: Path, parts: Iterable[bytes]) -> None:
    """Write a file at once; if that fails, the file stays as it was.

    Args:
        path: The file; its folder must exist.
        parts: Its content, in pieces that follow one another.

    Raises:
        OSError: If it cannot be written.
    """
    with contextlib.ExitStack() as cleanup:
        handle, temporary = _create(path.parent)
        cleanup.callback(_remove, temporary)
        with contextlib.ExitStack() as closing:
            closing.callback(os.close, handle)
            for part in parts:
                _write(handle, part)
            os.fsync(handle)
            if not _HAS_LOCKS:
                closing.close()
            # Renamed while still locked: between an unlock and the rename another process could sweep the file.
            os.replace(temporary, path)  # noqa: PTH105 -- tests let each call of `os` fail in turn
    flush(path.parent)


def flush(path: Path) -> None:
    """Have the system write a file, or the names in a folder, from its memory to the disk; no effect on Windows.

    Raises:
        OSError: If that fails.
    """
    if _HAS_LOCKS:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def temporary_files(folder: Path) -> list[Path]:
    """List the temporary files in a folder, both abandoned ones and those that are being written."""
    return list(folder.glob(f"{PREFIX}*"))


def sweep(folder: Path) -> int:
    """Remove the temporary files of killed writers from a folder; those that are being written stay.

    Returns:
        Number of files removed.
    """
    return sum(_remove_abandoned(path) for path in temporary_files(folder))


def _create(folder: Path) -> tuple[int, Path]:
    """Create a temporary file and lock it: its handle and path."""
    while True:
        path = folder / f"{PREFIX}{secrets.token_hex(8)}"
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        with contextlib.suppress(OSError):  # a file system without locks
            _lock(handle, wait=True)
        if path.exists():
            return handle, path
        os.close(handle)  # another process swept the file before it was locked


def _write(handle: int, content: bytes) -> None:
    """Write all of the content; one call of the system may write less."""
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


def _remove_abandoned(path: Path) -> bool:
    """Remove a temporary file unless it is being written; whether it was removed."""
    with contextlib.suppress(OSError):
        if not _HAS_LOCKS:
            path.unlink()
            return True
        handle = os.open(path, os.O_RDONLY)
        try:
            if _is_abandoned(handle):
                path.unlink()  # while locked, so that its writer, about to lock it, then finds it gone
                return True
        finally:
            os.close(handle)
    return False


def _is_abandoned(handle: int) -> bool:
    """Try to lock a temporary file: whether no other process holds the lock."""
    try:
        _lock(handle, wait=False)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return time.time() - os.fstat(handle).st_mtime > _ABANDONED_AFTER
    return True


def _lock(handle: int, *, wait: bool) -> None:
    """Lock a file for this process alone.

    Raises:
        BlockingIOError: If another process holds the lock and `wait` is false.
        OSError: If the file system has no locks.
    """
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
