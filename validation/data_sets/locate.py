"""Finds the data-set file and the folder of its recordings from what the user named."""

from __future__ import annotations

import os
import shlex
from importlib import resources
from pathlib import Path

from meshes.bounded_file import FileLimitError, read_text
from validation.data_sets.data_set import DataSet, build_data_set
from validation.errors import InputError, nearest
from validation.recordings.recording import RecordingError
from validation.schema import read
from validation.schema.data_set import DataSetTables

#: Environment variable that names the folder of recordings.
ENVIRONMENT_VARIABLE = "SOFTCOVER_RECORDINGS"
#: Data sets whose file comes with the package, by name; their recordings do not.
BUILT_IN = ("kiechle-sdh2",)


def find_data_set(recordings: str | Path | None = None, data_set: str | Path | None = None) -> DataSet | None:
    """Find a data set and its recordings.

    Args:
        recordings: A folder with recordings, or a data-set file.  If not given, the folder that the environment
            variable `SOFTCOVER_RECORDINGS` names.
        data_set: A data-set file, or the name of one that comes with the package.  If not given, `recordings` if that
            is a file, else the one file `*.toml` in the folder, else the built-in data set.

    Returns:
        The data set; None if nothing is named.

    Raises:
        InputError: If the data-set file is missing or has faults, or the folder holds no recording of it.
        RecordingError: If the folder does not exist.
        OSError: If the data-set file cannot be read.
    """
    named = Path(recordings) if recordings is not None else None
    variable = os.environ.get(ENVIRONMENT_VARIABLE)
    if named is not None and named.suffix == ".toml":
        if data_set is not None:
            raise InputError(f"--recordings, --data-set: {named} and {data_set} are both data-set files; name one")
        named, data_set = None, named
    if named is None and data_set is None:
        if not variable:
            return None
        named = Path(variable)
    if named is not None and not named.is_dir():
        raise RecordingError(f"{named}: no such folder; expected a folder with recordings, or a data-set file (.toml)")
    source = _find_file(data_set, named)
    tables = read(source, DataSetTables)
    found = [build_data_set(tables, source=source, folder=f) for f in _list_folders(named, source, tables, variable)]
    chosen = next((each for each in found if each.files), found[0])
    if not chosen.files:
        where = " nor ".join(str(each.folder) for each in found)
        missing = f"{source.name}: no recordings of it in {where}; give their folder with --recordings"
        raise InputError(*chosen.problems, missing)
    return chosen


def describe_unused_recordings() -> str | None:
    """Say in a sentence that the folder of the environment variable is not used; None if the variable is not set."""
    folder = os.environ.get(ENVIRONMENT_VARIABLE)
    if not folder:
        return None
    return (
        f"{ENVIRONMENT_VARIABLE} is set and not used: recordings belong to one sensor; to score against them, "
        f"add --recordings {shlex.quote(folder)}"
    )


def _find_file(data_set: str | Path | None, folder: Path | None) -> Path:
    """Return the data-set file that an option names, or that lies in the folder; else the built-in one."""
    if data_set is not None:
        if str(data_set) in BUILT_IN:
            return _built_in(str(data_set))
        path = Path(data_set)
        if not path.is_file():
            raise InputError(f"{path}: no such data-set file; {nearest(str(path), BUILT_IN)}, or a .toml file")
        return path
    if folder is not None:
        files = [path for path in sorted(folder.glob("*.toml")) if _may_be_data_set(path)]
        if len(files) > 1:
            names = ", ".join(path.name for path in files)
            raise InputError(f"{folder}: holds several data-set files ({names}); name one with --data-set")
        if files:
            return files[0]
    return _built_in(BUILT_IN[0])


def _may_be_data_set(path: Path) -> bool:
    """Return whether a file in the folder of recordings has series, or cannot be read, which is then reported."""
    if not path.is_file():
        return False
    try:
        return "series" in read_text(path, most=DataSetTables.MOST_BYTES)
    except FileLimitError:
        return True


def _built_in(name: str) -> Path:
    return Path(str(resources.files("validation.data_sets").joinpath(f"{name}.toml")))


def _list_folders(named: Path | None, source: Path, tables: DataSetTables, variable: str | None) -> list[Path]:
    """List the folders in which recordings are looked for, the first choice first.

    A folder on the command line is the only one.  Otherwise it is the key `path` of the data-set file, or the folder
    of that file; for a built-in data set, or if that folder holds no recording, the folder of the environment variable.
    """
    if named is not None:
        return [named]
    own = source.parent / tables.path if tables.path else source.parent
    others = [Path(variable)] if variable else []
    built_in = source.stem in BUILT_IN and source == _built_in(source.stem)
    if built_in and not others:
        raise RecordingError(
            f"{source.stem}: the recordings are not part of the package ({tables.source}); name their folder with "
            f"--recordings or {ENVIRONMENT_VARIABLE}"
        )
    return others if built_in else [own, *others]
