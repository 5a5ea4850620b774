"""Output folders and files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import glob
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from meshes import atomic_file
from validation.errors import InputError

#: Marks a folder that this program wrote and may therefore replace.
_MARKER = ".softcover-output"
#: Unfinished folders older than this belong to no living run [s].
_STALE = 24 * 3600.0


@contextlib.contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """Give a temporary folder beside `target` that takes its place when the block ends without an error.

    The folder is made at once, so that an unwritable place is found before any long work.

    Args:
        target: Where the results shall be; an earlier result of this program is replaced.

    Yields:
        The folder to write to.

    Raises:
        InputError: If `target` is a file or holds files that this program did not write.
        OSError: If the place cannot be written.
    """
    target = target.absolute()
    _check_replaceable(target)
    with contextlib.ExitStack() as cleanup:
        work = _work_folder(target)
        cleanup.callback(shutil.rmtree, work, ignore_errors=True)
        fresh = work / target.name
        fresh.mkdir()
        (fresh / _MARKER).touch()
        yield fresh
        for path in (*fresh.rglob("*"), fresh):
            atomic_file.flush(path)
        if target.exists():
            target.rename(work / "before")
        fresh.rename(target)
        atomic_file.flush(target.parent)


def _work_folder(target: Path) -> Path:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _sweep(target)
        return Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise OSError(error.errno, f"cannot be written: {error.strerror}", str(target)) from None


def _sweep(target: Path) -> None:
    """Remove what a killed run left beside `target`; younger leftovers may belong to a run that still goes on."""
    for left in target.parent.glob(f".{glob.escape(target.name)}-*"):
        ours = (left / target.name / _MARKER).is_file() or (left / "before" / _MARKER).is_file()
        if ours and time.time() - left.stat().st_mtime > _STALE:
            shutil.rmtree(left, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file at once: never half of it.

    Raises:
        OSError: If the place cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        atomic_file.replace(path, [text.encode()])
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    atomic_file.sweep(path.parent)


def _check_replaceable(target: Path) -> None:
    if target.is_dir():
        if any(target.iterdir()) and not (target / _MARKER).is_file():
            raise InputError(f"--out: {target} holds files that softcover did not write; name a new or an empty folder")
    elif target.exists():
        raise InputError(f"--out: {target} is a file; name a folder")
