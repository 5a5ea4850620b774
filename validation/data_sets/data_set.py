"""Description of a data set: recordings under known loads, read from a data-set file (TOML).

A fault of the file itself (unknown key, bad quantity) is an error.  A fault of one series, file or split only affects
that series, file or split: it is kept as a line in `DataSet.problems`, and the rest is used.
"""

from __future__ import annotations

import fnmatch
import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from meshes import Indenter, TexelArray
from meshes.bounded_file import FileLimitError, read_text
from validation.calibration.model import Placement
from validation.errors import InputError, nearest
from validation.recordings.importing import open_recording
from validation.recordings.recording import RecordingError
from validation.schema import read
from validation.schema.data_set import (
    FITTED,
    LABELS,
    NO_ZERO,
    REST,
    CommonKeys,
    DataSetTables,
    FileTable,
    SeriesTable,
    SplitTable,
)
from validation.text.indenter import read_indenter

#: First and last time after loading between which frames are averaged, if the file does not state them [s].
DEFAULT_WINDOW = (6.0, 9.0)


@dataclass(frozen=True, kw_only=True)
class DataFile:
    """One recording of a data set, and its options for reading.

    Attributes:
        path: The file.
        name: Name of the recording in tables: its series and the name of the file.
        series: Name of the series.
        load: Load [N], or the word `labels` (of the recording) or `force` (channel of the recording).
        temperature: Temperature that replaces that of the recording [degC]; None to use that of the recording.
        placement: Pose of the indenter.
        array: Index of the pressed array; None for the array with the largest change of counts.
        threshold: Counts that the firmware subtracted [-]; None for the value in the labels of the recording.
        zero: The word `rest`, the word `none`, or the path of a recording at rest.
        window: First and last time after loading between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor, negative ones from the end.
        uses: Permitted uses of the recording: `fit`, `score`.
    """

    path: Path
    name: str
    series: str
    load: float | str = LABELS
    temperature: float | None = None
    placement: Placement
    array: int | None = None
    threshold: float | None = None
    zero: str | Path = REST
    window: tuple[float, float] = DEFAULT_WINDOW
    temperature_channel: int = -1
    uses: tuple[str, ...] = ("fit", "score")


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """Recordings under known loads, and the splits by which models are scored on them.

    Attributes:
        name: Name of the data set.
        source: Publication of the recordings.
        sensor: Sensor file or built-in sensor that made the recordings; empty if the file does not say.
        folder: Folder that the paths of the files are relative to.
        files: The recordings that were found.
        splits: Divisions into fitted and scored recordings.
        required: Requirements on the scores, which replace those of the campaign, by the name of the metric.
        problems: One line per series, file or split that cannot be used.
    """

    name: str
    source: str = ""
    sensor: str = ""
    folder: Path
    files: tuple[DataFile, ...]
    splits: tuple[SplitTable, ...] | None = None
    required: Mapping[str, float] = field(default_factory=dict)
    problems: tuple[str, ...]


def build_data_set(tables: DataSetTables, *, source: Path, folder: Path) -> DataSet:
    """Make a data set from the tables of its file, with the recordings that its patterns find.

    Series without recordings are listed as problems if other series have recordings.  A data set without any recording
    has no files.

    Args:
        tables: Tables of the data-set file.
        source: The data-set file, for its name and for messages.
        folder: Folder that the paths and patterns of the file are relative to.
    """
    problems: list[str] = []
    found = {series.name: _list_files(series, tables, folder, problems) for series in tables.series}
    files = tuple(file for each in found.values() for file in each)
    if files:
        problems += [
            f"{source.name}: series {name!r}: no recordings in {folder}; it is left out"
            for name, each in found.items()
            if not each
        ]
    faults = {table.name: _find_fault_of_split(table, tables.series) for table in tables.split}
    problems += [f"{source.name}: split {name!r}: {fault}; it is left out" for name, fault in faults.items() if fault]
    return DataSet(
        name=tables.name or source.stem,
        source=tables.source,
        sensor=tables.sensor or "",
        folder=folder,
        files=files,
        splits=tuple(each for each in tables.split if not faults[each.name]) if faults else None,
        required=tables.required.list_limits(),
        problems=tuple(problems),
    )


def _find_fault_of_split(table: SplitTable, series: Sequence[SeriesTable]) -> str:
    """Describe the fault of a split that names an unknown series, or one of another use; empty without a fault."""
    uses = {each.name: each.use for each in series}
    for use, side in (("fit", table.fit), ("fit", table.place), ("score", table.score)):
        for selection in side:
            if selection.series not in uses:
                return f"unknown series {selection.series!r}; {nearest(selection.series, uses)}"
            if use not in uses[selection.series]:
                given = list(uses[selection.series])
                return f"series {selection.series!r} has use = {given}, which does not allow {use!r}"
    return ""


def _list_files(series: SeriesTable, tables: DataSetTables, folder: Path, problems: list[str]) -> list[DataFile]:
    """List the recordings of a series in the order of their paths, and add a line to `problems` for each fault."""
    place = f"series {series.name!r}"
    keys = {
        name: common if (own := getattr(series, name)) is None else own
        for name, common in dict(tables).items()
        if name in CommonKeys.model_fields
    }
    if keys["zero"] not in (None, REST, NO_ZERO):
        keys["zero"] = folder / keys["zero"]
    if keys["indenter"] is None:
        problems.append(f"{place}: no indenter; write for example indenter = 'box:size=10mmx10mmx5mm'; it is left out")
        return []
    try:
        indenter = read_indenter(keys["indenter"], place=f"{place}: indenter")
    except InputError as error:
        problems.extend(f"{fault}; it is left out" for fault in error.faults)
        return []
    listed = list(_match_patterns(series, folder, problems)) + [(folder / each.path, each) for each in series.file]
    files: dict[Path, DataFile] = {}
    for path, table in listed:
        if path.exists():
            name = f"{series.name} {path.name if path.is_relative_to(folder) else path}"
            files[path] = _build_file(path, table, series, keys, indenter, name=name)
        else:
            problems.append(f"{place}: {path}: no such file; it is left out")
    return [files[path] for path in (files if series.file else sorted(files))]


def _match_patterns(series: SeriesTable, folder: Path, problems: list[str]) -> Iterable[tuple[Path, None]]:
    place = f"series {series.name!r}: files"
    for pattern in series.files:
        try:
            yield from ((path, None) for path in sorted(folder.glob(pattern)))
        except ValueError as error:
            problems.append(f"{place}: {pattern!r} is not a pattern below {folder}: {error}; it is left out")


def _build_file(
    path: Path, table: FileTable | None, series: SeriesTable, keys: dict[str, Any], indenter: Indenter, *, name: str
) -> DataFile:
    """Describe one recording of a series; the keys of its own table take precedence over those of the series."""
    own = {key: value for key, value in dict(table or {}).items() if value is not None}
    by_name = [load for pattern, load in series.loads.items() if fnmatch.fnmatchcase(path.name, pattern)]
    merged = keys | ({"load": by_name[0]} if by_name else {}) | own
    at, yaw, tilt = merged["at"], merged["yaw"], merged["tilt"]
    placement = series.placement or series.name
    if table is not None:
        moved = {"at", "yaw"} & own.keys() and table.at != FITTED
        placement = table.placement or (f"{placement}, {path.name}" if moved else placement)
    fitted = at is None or at == FITTED
    if yaw is None and not fitted:
        yaw = 0.0
    return DataFile(
        path=path,
        name=name,
        series=series.name,
        load=LABELS if merged["load"] is None else merged["load"],
        temperature=own.get("temperature"),
        placement=Placement(
            name=placement,
            indenter=indenter,
            at=None if fitted else at,
            yaw=None if yaw == FITTED else yaw,
            tilt=None if tilt == FITTED else tilt or (0.0, 0.0),
        ),
        array=merged["array"],
        threshold=merged["threshold"],
        zero=merged["zero"] or REST,
        window=merged["window"] or DEFAULT_WINDOW,
        temperature_channel=-1 if merged["temperature_channel"] is None else merged["temperature_channel"],
        uses=tuple(series.use),
    )


def describe_files(
    paths: Sequence[Path], keys: CommonKeys, sensor: TexelArray | None = None, *, moved: bool = False
) -> DataSet:
    """Describe recordings as a data set of one series, or read the one data-set file among them.

    Args:
        paths: Recordings, or one data-set file.
        keys: Options for recordings; a data-set file states its own.  If they name no indenter, the labels of every
            recording must name one.
        sensor: Array that was recorded, for CSV files that state no layout.
        moved: Whether each recording has its own pose.

    Raises:
        InputError: If a data-set file is given together with other files, or no tool is named.
        RecordingError: If a data set has no recording.
    """
    if any(path.suffix == ".toml" for path in paths):
        if len(paths) > 1:
            raise InputError(f"{paths[0]}: a data-set file stands alone; it names the recordings")
        if (found := find_data_set(paths[0])) is None:
            raise InputError(f"{paths[0]}: no data set")
        return found
    files: list[DataFile] = []
    problems: list[str] = []
    for path in paths:
        try:
            text = keys.indenter or open_recording(path, sensor=sensor).setup.indenter
        except RecordingError as error:
            problems.append(f"{error}; left out")
            continue
        if not text:
            raise InputError(f"{path}: its labels name no tool; give --indenter, such as box:size=10mmx10mmx5mm")
        series = SeriesTable(name="recordings", placement=path.name if moved else "tool")
        indenter = read_indenter(text, place="--indenter")
        files.append(_build_file(path, None, series, dict(keys), indenter, name=path.name))
    return DataSet(name="files", folder=Path(), files=tuple(files), problems=tuple(problems))


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
        missing = f"{source.name}: no recordings of it in {where}; give their folder with --recordings, or "
        missing += "write a data-set file (.toml) beside recordings of yours: docs/recordings.md"
        raise InputError(*chosen.problems, missing)
    return chosen


def describe_unused_recordings() -> str | None:
    """State in a sentence that the folder of the environment variable is not used; None if the variable is not set."""
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
    """Return whether a file in the folder of recordings names series, or cannot be read.

    A file that cannot be read is taken as a data set, so that the user sees the error when it is opened.
    """
    if not path.is_file():
        return False
    try:
        return "series" in read_text(path, most=DataSetTables.MOST_BYTES)
    except FileLimitError:
        return True


def _built_in(name: str) -> Path:
    return Path(str(resources.files("validation.data_sets").joinpath(f"{name}.toml")))


def _list_folders(named: Path | None, source: Path, tables: DataSetTables, variable: str | None) -> list[Path]:
    """List the folders that are searched for recordings, in order of preference.

    A folder on the command line is the only one.  Otherwise it is the key `path` of the data-set file, or the folder of
    that file.  For a built-in data set, or if that folder holds no recording, it is the folder of the environment
    variable.
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
