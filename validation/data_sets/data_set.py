"""Description of a data set: recordings under known loads, read from a data-set file (TOML).

A fault of the file itself (unknown key, bad quantity) is an error.  A fault of one series, file or split costs that
series, file or split: it is kept as a line in `DataSet.problems`, and the rest is used.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from meshes import Indenter
from validation.calibration.observations import Placement
from validation.errors import InputError, nearest
from validation.schema.data_set import (
    FITTED,
    LABELS,
    CommonKeys,
    DataSetTables,
    FileTable,
    SelectionTable,
    SeriesTable,
    SplitTable,
)
from validation.text.indenter import read_indenter

#: Tolerance of the limits of a selection by load [-].
_SAME_LOAD = 1e-6
#: First and last time after loading between which frames are averaged, if the file does not say [s].
DEFAULT_WINDOW = (6.0, 9.0)


@dataclass(frozen=True, kw_only=True)
class DataFile:
    """One recording of a data set and how to read it.

    Attributes:
        path: The file.
        name: Name of the recording in tables: its series and the name of the file.
        series: Name of the series.
        load: Load [N], or the word `labels` (of the recording) or `force` (channel of the recording).
        temperature: Temperature that replaces that of the recording [degC]; None to use that of the recording.
        placement: Pose of the indenter.
        array: Index of the pressed array; None for the one that is pressed most.
        threshold: Counts that the firmware subtracted; None for what the labels of the recording say [-].
        window: First and last time after loading between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor, negative ones from the end.
        uses: What the recording may be used for: `fit`, `score`.
    """

    path: Path
    name: str
    series: str
    load: float | str
    temperature: float | None
    placement: Placement
    array: int | None
    threshold: float | None
    window: tuple[float, float]
    temperature_channel: int
    uses: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Recordings of one series: those whose load and file name match.

    Attributes:
        series: Name of the series.
        patterns: Patterns of file names, of which one must match; none for all files.
        least: Smallest load [N].
        most: Largest load [N].
    """

    series: str
    patterns: tuple[str, ...] = ()
    least: float = 0.0
    most: float = float("inf")

    def takes(self, file: DataFile, load: float) -> bool:
        """Return whether the selection takes a recording with this load [N]."""
        named = not self.patterns or any(fnmatch.fnmatchcase(file.path.name, each) for each in self.patterns)
        above, below = load >= self.least * (1 - _SAME_LOAD), load <= self.most * (1 + _SAME_LOAD)
        return file.series == self.series and named and above and below


@dataclass(frozen=True, kw_only=True)
class Split:
    """A division of the recordings into fitted and scored ones.

    Attributes:
        name: Short name.
        about: What the split tests.
        fit: Recordings to which electronics, gains and poses are fitted.
        place: Recordings to which only the poses of the scored recordings are fitted.
        score: Recordings that are scored.
    """

    name: str
    about: str
    fit: tuple[Selection, ...]
    place: tuple[Selection, ...]
    score: tuple[Selection, ...]


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """Recordings under known loads, and the splits by which models are scored on them.

    Attributes:
        name: Name of the data set.
        source: Where the recordings were published.
        sensor: Sensor file or built-in sensor that made the recordings; empty if the file does not say.
        folder: Folder that the paths of the files are relative to.
        files: The recordings that were found.
        splits: Divisions into fitted and scored recordings.
        problems: One line per series, file or split that cannot be used.
    """

    name: str
    source: str
    sensor: str
    folder: Path
    files: tuple[DataFile, ...]
    splits: tuple[Split, ...]
    problems: tuple[str, ...]


def build_data_set(tables: DataSetTables, *, source: Path, folder: Path) -> DataSet:
    """Find the recordings of a data set.

    Series without recordings are problems of the data set if others have some; a data set without any has no files.

    Args:
        tables: Tables of the data-set file.
        source: The data-set file, for its name and for messages.
        folder: Folder that the paths and patterns of the file are relative to.
    """
    problems: list[str] = []
    files: list[DataFile] = []
    empty: list[str] = []
    for series in tables.series:
        found = _list_files(series, tables, folder, problems)
        files += found
        if not found:
            empty.append(f"{source.name}: series {series.name!r}: no recordings in {folder}; it is left out")
    if files:
        problems += empty
    splits = []
    for table in tables.split:
        fault = _find_fault_of_split(table, tables.series)
        if fault:
            problems.append(f"{source.name}: split {table.name!r}: {fault}; it is left out")
        else:
            splits.append(_build_split(table))
    return DataSet(
        name=tables.name or source.stem,
        source=tables.source,
        sensor=tables.sensor or "",
        folder=folder,
        files=tuple(files),
        splits=tuple(splits) if tables.split else propose_splits(files),
        problems=tuple(problems),
    )


def propose_splits(files: Sequence[DataFile]) -> tuple[Split, ...]:
    """Return the splits of a data set that names none.

    Series that may only be scored are predicted from those that may be fitted; if there are none, the heavier half of
    the known loads of each series is predicted from the lighter half.
    """
    fitted = list(dict.fromkeys(file.series for file in files if "fit" in file.uses))
    scored = list(dict.fromkeys(file.series for file in files if file.uses == ("score",)))
    if scored:
        about = f"{', '.join(fitted)} to {', '.join(scored)}"
        sides = [tuple(Selection(series=name) for name in side) for side in (fitted, scored)]
        return (Split(name="other series", about=about, fit=sides[0], place=(), score=sides[1]),) if fitted else ()
    splits = []
    for series in fitted:
        loads = sorted({file.load for file in files if file.series == series and not isinstance(file.load, str)})
        if len(loads) > 1:
            half = len(loads) // 2
            light, heavy = (Selection(series=series, most=loads[half - 1]), Selection(series=series, least=loads[half]))
            about = f"{series}: light loads to heavy ones"
            splits.append(Split(name=f"{series} heavier", about=about, fit=(light,), place=(), score=(heavy,)))
    return tuple(splits)


def _build_split(table: SplitTable) -> Split:
    sides = ([_build_selection(each) for each in side] for side in (table.fit, table.place, table.score))
    fit, place, score = (tuple(side) for side in sides)
    return Split(name=table.name, about=table.about or table.name, fit=fit, place=place, score=score)


def _build_selection(table: SelectionTable) -> Selection:
    limits = {name: value for name, value in (("least", table.least), ("most", table.most)) if value is not None}
    return Selection(series=table.series, patterns=tuple(table.files), **limits)


def _find_fault_of_split(table: SplitTable, series: Sequence[SeriesTable]) -> str:
    """Return what is wrong with the series that a split names; empty if nothing is."""
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
    text = series.indenter or tables.indenter
    if text is None:
        problems.append(f"{place}: no indenter; write for example indenter = 'box:size=10mmx10mmx5mm'; it is left out")
        return []
    try:
        indenter = read_indenter(text, place=f"{place}: indenter")
    except InputError as error:
        problems.extend(error.faults)
        return []
    shared = _merge(series, tables)
    listed = list(_match_patterns(series, folder, problems)) + [(folder / each.path, each) for each in series.file]
    files: dict[Path, DataFile] = {}
    for path, table in listed:
        if not path.exists():
            problems.append(f"{place}: {path}: no such file")
            continue
        file = _build_file(path, table, series, shared, indenter)
        files[path] = replace(file, name=f"{series.name} {_name_below(path, folder)}")
    return [files[path] for path in sorted(files)] if not series.file else list(files.values())


def _merge(series: SeriesTable, tables: DataSetTables) -> dict[str, Any]:
    """Return the keys of a series, with those of the whole file where the series has none."""
    own = {name: getattr(series, name) for name in CommonKeys.model_fields}
    return {name: getattr(tables, name) if value is None else value for name, value in own.items()}


def _match_patterns(series: SeriesTable, folder: Path, problems: list[str]) -> Iterable[tuple[Path, None]]:
    for pattern in series.files:
        if ".." in Path(pattern).parts:
            problems.append(
                f"series {series.name!r}: files: {pattern!r} leads out of {folder}; name that folder as `path`"
            )
            continue
        try:
            yield from ((path, None) for path in sorted(folder.glob(pattern)))
        except (ValueError, NotImplementedError) as error:
            problems.append(f"series {series.name!r}: files: {pattern!r} is not a pattern below {folder}: {error}")


def _name_below(path: Path, folder: Path) -> str:
    """Return the name of a file, with the folders that distinguish it from others of the data set left out."""
    return path.name if path.is_relative_to(folder) else str(path)


def _build_file(
    path: Path, table: FileTable | None, series: SeriesTable, shared: dict[str, Any], indenter: Indenter
) -> DataFile:
    """Describe one recording of a series; the keys of its own table come before those of the series."""
    by_name = next((load for key, load in series.loads.items() if fnmatch.fnmatchcase(path.name, key)), None)
    load = by_name if by_name is not None else shared["load"]
    at, yaw, name = shared["at"], shared["yaw"], series.placement or series.name
    if table is not None:
        load = table.load if table.load is not None else load
        moved = table.at is not None or table.yaw is not None
        at, yaw = (table.at if table.at is not None else at), (table.yaw if table.yaw is not None else yaw)
        name = table.placement or (f"{name}, {path.name}" if moved and table.at != FITTED else name)
    fitted = at is None or at == FITTED
    if yaw is None:
        yaw = FITTED if fitted else 0.0
    return DataFile(
        path=path,
        name="",
        series=series.name,
        load=LABELS if load is None else load,
        temperature=None if table is None else table.temperature,
        placement=Placement(
            name=name,
            indenter=indenter,
            at=None if fitted or isinstance(at, str) else at,
            yaw=None if isinstance(yaw, str) else yaw,
            tilt=None if shared["tilt"] == FITTED else shared["tilt"] or (0.0, 0.0),
        ),
        array=shared["array"],
        threshold=shared["threshold"],
        window=shared["window"] or DEFAULT_WINDOW,
        temperature_channel=-1 if shared["temperature_channel"] is None else shared["temperature_channel"],
        uses=tuple(series.use),
    )
