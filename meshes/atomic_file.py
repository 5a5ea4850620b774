"""Replacement of whole files: a reader finds the old content of a file or the new content, never a part of it.

Only regular files are replaced.  A link such as `/dev/stdout`, a device or a pipe stays as it is.

A file is written under a temporary name, flushed to the disk and renamed.  The writer holds a lock on the temporary
file until it is renamed, and the operating system releases the lock when the writer ends, in whatever way.  A later
`sweep` therefore removes the temporary files of writers that were killed and keeps those that are still being written.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

#: Start of the names of temporary files.
PREFIX = ".softcover-partial-"
#: Age from which `sweep` removes a temporary file on a file system without locks [s]: one day.  Without locks nothing
#: shows whether a file is still being written, and no file takes a day to write.
_ABANDONED_AFTER = 86_400.0
#: Whether this module locks temporary files.  Locks are not needed on Windows, which refuses to remove an open file.
_HAS_LOCKS = sys.platform != "win32"


def replace(path: Path, parts: Iterable[bytes]) -> None:
    """Replace the whole content of a file in one step; if writing fails, the file keeps its old content.

    Args:
        path: Path of the file; its folder must exist.
        parts: New content of the file, in consecutive pieces.

    Raises:
        OSError: If the file cannot be written, or the path names something else than a regular file.
    """
    try:
        _refuse_special(path)
        _replace(path, parts)
    except OSError as error:  # The error names the user's file instead of the temporary one.
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _refuse_special(path: Path) -> None:
    """Raise `OSError` if a path names a folder, a link, a device or a pipe."""
    try:
        kind = path.lstat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, "is a folder; name a file")
    if not stat.S_ISREG(kind):
        what = "a link" if stat.S_ISLNK(kind) else "a device or a pipe"
        raise OSError(errno.EINVAL, f"is {what}, which is not replaced; name a file")


def _replace(path: Path, parts: Iterable[bytes]) -> None:
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
            # The temporary file is renamed while it is locked.  If it were unlocked first, `sweep` in another process
            # could remove it before it is renamed.
            os.replace(temporary, path)  # noqa: PTH105 -- tests let each call of `os` fail in turn
    flush(path.parent)


def flush(path: Path) -> None:
    """Write the cached content of a file, or the list of names of a folder, to the disk; do nothing on Windows.

    Raises:
        OSError: If the file or folder cannot be opened or written to the disk.
    """
    if _HAS_LOCKS:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def temporary_files(folder: Path) -> list[Path]:
    """List the temporary files in a folder: abandoned ones and those that are being written."""
    # A file may be renamed or removed by its writer while the folder is listed.
    return [path for path in folder.glob(f"{PREFIX}*") if path.is_file() and not path.is_symlink()]


def sweep(folder: Path) -> int:
    """Remove from a folder the temporary files of killed writers; files that are being written stay.

    Returns:
        Number of files removed.
    """
    return sum(_remove_abandoned(path) for path in temporary_files(folder))


def _create(folder: Path) -> tuple[int, Path]:
    """Create a locked temporary file in a folder; return the file's handle and path."""
    while True:
        path = folder / f"{PREFIX}{secrets.token_hex(8)}"
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        with contextlib.suppress(OSError):  # A file system without locks raises an error; the file stays unlocked.
            _lock(handle, wait=True)
        if path.exists():
            return handle, path
        os.close(handle)  # Another process removed the file in `sweep` before it was locked; the loop makes a new file.


def _write(handle: int, content: bytes) -> None:
    """Write all of the content to an open file; one call of `os.write` may write only a part."""
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


def _remove_abandoned(path: Path) -> bool:
    """Remove a temporary file unless another process is writing it; return whether the file was removed."""
    with contextlib.suppress(OSError):
        if not _HAS_LOCKS:
            path.unlink()
            return True
        handle = os.open(path, os.O_RDONLY)
        try:
            if _is_abandoned(handle):
                # Remove the file while this process holds its lock: a writer that waits for the lock then finds that
                # the file is gone, and creates another one.
                path.unlink()
                return True
        finally:
            os.close(handle)
    return False


@contextlib.contextmanager
def hold_lock(path: Path) -> Iterator[None]:
    """Let one process at a time run the body of a `with` statement; without locks of files, all run it at once.

    Args:
        path: File that the processes lock; it is created where it is missing, and stays.
    """
    with path.open("a") as file:
        with contextlib.suppress(OSError):
            _lock(file.fileno(), wait=True)
        yield


def _is_abandoned(handle: int) -> bool:
    """Return whether no other process holds the lock of a temporary file; if so, lock the file.

    On a file system without locks, return whether the file is older than `_ABANDONED_AFTER`.
    """
    try:
        _lock(handle, wait=False)
    except BlockingIOError:
        return False
    except OSError:  # The file system has no locks, so only the age of a file shows whether its writer has ended.
        return time.time() - os.fstat(handle).st_mtime > _ABANDONED_AFTER
    return True


def _lock(handle: int, *, wait: bool) -> None:
    """Lock an open file for this process alone; do nothing on Windows.

    Args:
        handle: Handle of the open file.
        wait: Whether to wait until another process releases its lock.

    Raises:
        BlockingIOError: If another process holds the lock and `wait` is false.
        OSError: If the file system has no locks.
    """
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
