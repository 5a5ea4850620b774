"""Writes output folders and text files completely or not at all, so that a killed run leaves no partial result."""

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

#: Name of an empty file that marks each folder that this program wrote.  Only a marked folder may be replaced.
_MARKER = ".softcover-output"
#: Age above which a temporary output folder counts as left by a killed run, because no run lasts a day [s].
_STALE_AGE = 24 * 3600.0


@contextlib.contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """Provide a temporary folder beside `target`, and rename it to `target` if the `with` block raises no error.

    The temporary folder is made at the start, so that an unwritable location is reported before a long computation.

    Args:
        target: The output folder; if it holds an earlier output of this program, that output is replaced.

    Yields:
        The temporary folder, to which the caller writes.

    Raises:
        InputError: If `target` is a file or holds files that this program did not write.
        OSError: If the parent folder of `target` cannot be written.
    """
    target = target.absolute()
    _check_replaceable(target)
    with contextlib.ExitStack() as cleanup:
        work = _make_work_folder(target)
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


def _make_work_folder(target: Path) -> Path:
    """Make an empty temporary folder beside `target`, after old temporary folders of killed runs are removed."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(target)
        return Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise OSError(error.errno, f"cannot be written: {error.strerror}", str(target)) from None


def _remove_leftovers(target: Path) -> None:
    """Remove temporary output folders beside `target` that are older than `_STALE_AGE`; others may still be in use."""
    for folder in target.parent.glob(f".{glob.escape(target.name)}-*"):
        is_ours = (folder / target.name / _MARKER).is_file() or (folder / "before" / _MARKER).is_file()
        if is_ours and time.time() - folder.stat().st_mtime > _STALE_AGE:
            shutil.rmtree(folder, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file completely or not at all.

    Raises:
        OSError: If the file or its folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        atomic_file.replace(path, [text.encode()])
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    atomic_file.sweep(path.parent)


def _check_replaceable(target: Path) -> None:
    """Raise `InputError` if `target` is a file or a folder with files that this program did not write."""
    if target.is_dir():
        if any(target.iterdir()) and not (target / _MARKER).is_file():
            raise InputError(f"--out: {target} holds files that softcover did not write; name a new or an empty folder")
    elif target.exists():
        raise InputError(f"--out: {target} is a file; name a folder")
