"""Writes output folders and text files completely or not at all, so that a killed run leaves no partial result.

Each output folder holds a manifest: the names and hashes of the files that this program wrote into it.  A later run
replaces the folder only if it holds exactly these files.  Files that a user added or changed are therefore never lost.
"""

from __future__ import annotations

import contextlib
import ctypes
import glob
import hashlib
import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from meshes import atomic_file
from meshes.bounded_file import read_bytes
from validation.errors import InputError

#: Name of the manifest in each folder that this program wrote: a JSON object, sha256 by path relative to the folder.
_MANIFEST = ".softcover-output"
#: Largest size of a manifest that is read [bytes].
_MOST_MANIFEST_BYTES = 2**24
#: Name of the previous output in a temporary folder, while `new_folder` replaces it by two renames.
_BEFORE = "before"
#: Argument of Linux' `renameat2` that means "relative to the current folder"; see `man 2 renameat2`.
_AT_FDCWD = -100
#: Argument of Linux' `renameat2` that exchanges two names in one step.
_RENAME_EXCHANGE = 2
#: Age above which a temporary output folder counts as left by a killed run, because no run lasts a day [s].
_STALE_AGE = 24 * 3600.0
#: Largest number of characters of a file name that `make_file_name` makes [-].
_LONGEST_NAME = 64
#: Pattern of names that Windows reserves for devices and does not accept as names of files.
_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def make_file_name(name: str, *, suffix: str) -> str:
    """Make a file name from the name of a sensor, which may be any text.

    Letters A to Z, digits, `_`, `-` and `.` are kept.  Any other run of characters becomes one `-`.  The name neither
    begins nor ends with `-` or `.`, so that it never names another folder or a hidden file.

    Args:
        name: Name of the sensor.
        suffix: Ending of the file name, such as `.xml`.
    """
    kept = re.sub(r"[^A-Za-z0-9_.-]+", "-", name)[:_LONGEST_NAME].strip("-.")
    if not kept or _DEVICE.fullmatch(kept):
        kept = f"sensor-{kept}".rstrip("-")
    return kept + suffix


@contextlib.contextmanager
def new_folder(target: Path, option: str = "--out") -> Iterator[Path]:
    """Provide a temporary folder beside `target`, and rename it to `target` if the `with` block raises no error.

    The temporary folder is made at the start, so that an unwritable location is reported before a long computation.  If
    an error or an interruption stops the replacement, `target` holds the previous output or the new one.  Linux
    exchanges the two in one step.  On other systems a killed run may leave no `target`; the next run restores the
    previous output.

    Args:
        target: Output folder.  An existing folder is replaced if it holds only a previous output of this program.
        option: Option that names the folder; error messages begin with it.

    Yields:
        The temporary folder, to which the caller writes.

    Raises:
        InputError: If `target` is a file or a link, or holds files that this program did not write or that were changed
            later.
        OSError: If the parent folder of `target` cannot be written, or a file in the `with` block.
    """
    target = target.absolute()
    _restore_lost(target)
    _check_replaceable(target, option)
    with contextlib.ExitStack() as cleanup:
        work = _make_work_folder(target)
        cleanup.callback(_discard, work, target)
        fresh = work / target.name
        fresh.mkdir()
        (fresh / _MANIFEST).touch()
        try:
            yield fresh
            _write_manifest(fresh)
            for path in (*fresh.rglob("*"), fresh):
                atomic_file.flush(path)
        except OSError as error:
            if error.filename is None and error.errno is not None:  # for example on a full disk
                raise OSError(error.errno, error.strerror, str(target)) from None
            raise
        _check_replaceable(target, option)  # The folder may have changed, because the computation may have taken hours.
        if not (target.exists() and _exchange(fresh, target)):
            if target.exists():
                target.rename(work / _BEFORE)  # `_discard` moves the folder back if the next line fails.
            fresh.rename(target)
        atomic_file.flush(target.parent)


def optional_folder(target: Path | str | None, option: str = "--out") -> contextlib.AbstractContextManager[Path | None]:
    """Provide a folder as `new_folder` does, or None without a target."""
    return new_folder(Path(target), option) if target else contextlib.nullcontext()


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders in one step; return false if the operating system or the file system cannot do so."""
    rename = getattr(ctypes.CDLL(None), "renameat2", None) if sys.platform == "linux" else None
    if rename is None:
        return False
    return bool(rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0)


def _discard(work: Path, target: Path) -> None:
    """Remove the temporary folder `work`.

    If the output folder `target` is missing, a previous output in `work` is first moved back to `target`.
    """
    before = work / _BEFORE
    if before.exists() and not target.exists():
        before.rename(target)  # If this fails, the temporary folder stays, and the next run tries again.
    shutil.rmtree(work, ignore_errors=True)


def _restore_lost(target: Path) -> None:
    """Restore the previous output of a killed run if the output folder `target` is missing.

    The killed run had moved the previous output to a temporary folder beside `target`.  If there are several such
    temporary folders, the latest is restored.
    """
    if not target.exists() and not target.is_symlink():
        lost = [path for path in _list_work_folders(target) if (path / _BEFORE / _MANIFEST).is_file()]
        if lost:
            _discard(max(lost, key=lambda path: path.stat().st_mtime), target)


def _list_work_folders(target: Path) -> list[Path]:
    """List the temporary folders beside the output folder `target`, of killed runs and of runs in progress."""
    return list(target.parent.glob(f".{glob.escape(target.name)}-*"))


def _make_work_folder(target: Path) -> Path:
    """Make an empty temporary folder beside the output folder `target`; old ones of killed runs are removed first."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(target)
        return Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise OSError(error.errno, f"cannot be written: {error.strerror}", str(target)) from None


def _remove_leftovers(target: Path) -> None:
    """Remove temporary folders beside the output folder `target` that are older than a day.

    Younger ones stay, because another run may still write to them.
    """
    for folder in _list_work_folders(target):
        is_ours = any((folder / name / _MANIFEST).is_file() for name in (target.name, _BEFORE))
        if is_ours and time.time() - folder.stat().st_mtime > _STALE_AGE:
            shutil.rmtree(folder, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file completely or not at all.

    Raises:
        OSError: If the file or its folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    atomic_file.replace(path, [text.encode()])
    atomic_file.sweep(path.parent)


def check_writable(*paths: Path | None) -> None:
    """Check before a long computation that files can be written; None stands for a file that is not wanted.

    Raises:
        OSError: If the folder of a file cannot be written.
    """
    for path in filter(None, paths):
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        try:
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise OSError(error.errno, f"cannot be written: {error.strerror}", str(path)) from None


def _write_manifest(folder: Path) -> None:
    """Write the manifest of a folder: the sha256 of every file in it."""
    hashes = {path.relative_to(folder).as_posix(): _hash(path) for path in _list_files(folder)}
    (folder / _MANIFEST).write_text(json.dumps(hashes, indent=1, sort_keys=True), encoding="utf-8")


def _list_files(folder: Path) -> Iterator[Path]:
    """Yield the files and links in a folder and in all its subfolders, and the empty subfolders; not the manifest.

    The files directly in the folder come first.

    Raises:
        OSError: If a folder cannot be read.
    """
    for place, folders, files in os.walk(folder, onerror=_raise):
        parent = Path(place)
        links = [name for name in folders if (parent / name).is_symlink()]
        yield from (path for name in (*files, *links) if (path := parent / name) != folder / _MANIFEST)
        if not folders and not files and parent != folder:
            yield parent


def _raise(error: OSError) -> None:
    raise error


def _hash(path: Path) -> str:
    """Return the sha256 of a file as text; empty for a link, a folder or a special file such as a pipe."""
    if path.is_symlink() or not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_replaceable(target: Path, option: str) -> None:
    """Check that the output folder `target` is missing, or holds only what this program wrote to it.

    Raises:
        InputError: If it is a file or a link, or its files differ from those in its manifest.
    """
    if target.is_symlink():
        raise InputError(f"{option}: {target} is a link; name a folder")
    if not target.is_dir():
        if target.exists():
            raise InputError(f"{option}: {target} is a file; name a folder")
        return
    hashes = _read_manifest(target)
    for path in _list_files(target):
        name = path.relative_to(target).as_posix()
        if not hashes.get(name) or hashes[name] != _hash(path):
            fault = "was changed after softcover wrote it" if hashes.get(name) else "softcover did not write"
            raise InputError(f"{option}: {target} holds {name}, which {fault}; name a new or an empty folder")


def _read_manifest(folder: Path) -> dict[str, str]:
    """Read the manifest of a folder; empty if there is none, or if an earlier version wrote it."""
    try:
        hashes = json.loads(read_bytes(folder / _MANIFEST, most=_MOST_MANIFEST_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    return hashes if isinstance(hashes, dict) else {}
