"""Describes recordings that are named on the command line as a data set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from meshes import TexelArray
from validation.calibration.observations import Placement
from validation.data_sets.data_set import DataFile, DataSet
from validation.data_sets.locate import find_data_set
from validation.errors import InputError
from validation.recordings.importing import open_recording
from validation.recordings.recording import RecordingError
from validation.schema.data_set import LABELS
from validation.text.indenter import read_indenter, read_position, read_yaw


@dataclass(frozen=True, kw_only=True)
class Keys:
    """Options that hold for all recordings on the command line.

    Attributes:
        indenter: The tool; empty to take it from the labels of each recording.
        at: Position of its axis as text; None to fit it.
        yaw: Its yaw as text; None for 0 if `at` is given, else to fit it.
        moved: Whether each recording has a pose of its own.
        array: Index of the pressed array; None for the one that is pressed most.
        threshold: Counts that the firmware subtracted; None for what the labels say [-].
        window: First and last time after loading between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor.
    """

    indenter: str
    at: str | None
    yaw: str | None
    moved: bool
    array: int | None
    threshold: float | None
    window: tuple[float, float]
    temperature_channel: int


def describe_files(paths: Sequence[Path], keys: Keys, sensor: TexelArray | None = None) -> DataSet:
    """Describe recordings as a data set of one series, or read the one data-set file among them.

    Args:
        paths: Recordings, or one data-set file.
        keys: Options for recordings; a data-set file states its own.
        sensor: Array that was recorded, for CSV files that state no layout.

    Raises:
        InputError: If a data-set file stands beside other files, or no tool is named.
        RecordingError: If a data set has no recording.
    """
    if any(path.suffix == ".toml" for path in paths):
        if len(paths) > 1:
            raise InputError(f"{paths[0]}: a data-set file stands alone; it names the recordings")
        found = find_data_set(paths[0])
        if found is None:
            raise InputError(f"{paths[0]}: no data set")
        return found
    files: list[DataFile] = []
    problems: list[str] = []
    for path in paths:
        try:
            files.append(_describe_file(path, keys, sensor))
        except RecordingError as error:
            problems.append(f"{error}; left out")
    return DataSet(
        name="files",
        source="",
        sensor="",
        folder=Path(),
        files=tuple(files),
        splits=(),
        problems=tuple(problems),
    )


def _describe_file(path: Path, keys: Keys, sensor: TexelArray | None) -> DataFile:
    text = keys.indenter
    if not text:
        text = open_recording(path, sensor=sensor).setup.indenter
        if not text:
            raise InputError(f"{path}: its labels name no tool; give --indenter, such as box:size=10mmx10mmx5mm")
    at = None if keys.at is None else read_position(keys.at)
    yaw = 0.0 if at is not None else None
    name = path.name if keys.moved else "tool"
    return DataFile(
        path=path,
        name=path.name,
        series="recordings",
        load=LABELS,
        temperature=None,
        placement=Placement(
            name=name,
            indenter=read_indenter(text, place="--indenter"),
            at=at,
            yaw=yaw if keys.yaw is None else read_yaw(keys.yaw),
        ),
        array=keys.array,
        threshold=keys.threshold,
        window=keys.window,
        temperature_channel=keys.temperature_channel,
        uses=("fit", "score"),
    )
