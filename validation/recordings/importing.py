"""Opens recordings of every known format, adds labels and forces to them, and saves them as MCAP."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshes import TexelArray
from meshes.array import MOST_TEXELS
from validation.recordings import bags, dsa, mcap_reader, tables
from validation.recordings.mcap_writer import LARGEST_COUNT, Clocks, RecordingWriter, StorageError
from validation.recordings.recording import NANOSECOND, PITCH_ASSUMED, Recording, RecordingError, Setup, limit_time

#: List of the formats that `open_recording` accepts, for error messages.
ACCEPTED = "accepted: .dsa, .csv, .mcap, .bag (ROS 1), a folder with a ROS 2 recording"
#: Optional Python module that reads a file, by the ending of its name; files with other endings need no module.
_MODULES = {".mcap": "mcap", ".bag": "rosbags", ".db3": "rosbags"}
#: Smallest first time of a file of forces for which its times count as times since 1970 [s]; smaller times count from
#: the first frame.  As a time since 1970, the value is a date in 1973, before any recording.  As a duration, it is
#: three years.
_EPOCH_TIMES = 1e8
#: Longest accepted time without readings of the force sensor at the start or the end of a recording [s].
_UNCOVERED_TIME = 0.5
#: Latest time since 1970 that a ROS message can state, 19 January 2038 [s].
_LATEST = 2**31 - 1


def open_recording(
    path: str | Path,
    *,
    topic: str | None = None,
    rows: int | None = None,
    columns: int | None = None,
    sensor: TexelArray | None = None,
    axis: str | None = None,
) -> Recording:
    """Read a recording of any known format.

    Args:
        path: The file or folder.
        topic: ROS topic with the tactile frames, for recordings (bags) of other programs.
        rows: Number of texels along y, for files that do not state the number [-].
        columns: Number of texels along x, for files that do not state the number [-].
        sensor: Array that was recorded, for files that state no layout or pitch.
        axis: Axis that is read from CSV files with three columns per texel.

    Raises:
        RecordingError: If the recording is missing, damaged or of an unknown format.
    """
    path = Path(path)
    for name, number in (("rows", rows), ("columns", columns)):
        if number is not None and not 1 <= number <= MOST_TEXELS:
            raise RecordingError(f"--{name}: accepted: 1..{MOST_TEXELS}, not {number}")
    if not path.exists():
        raise RecordingError(f"{path}: no such file; {ACCEPTED}")
    kind = path.suffix.lower()
    if topic is not None and kind in {".dsa", ".csv"}:
        raise RecordingError(f"--topic: {path} has no topics; leave the option out")
    if axis is not None and kind != ".csv":
        raise RecordingError(f"--axis: {path} has one count per texel; leave the option out")
    with limit_time(path):
        match kind:
            case ".dsa":
                found = dsa.read(path)
            case ".csv":
                found = tables.read(path, rows=rows, columns=columns, sensor=sensor, axis=axis)
            case ".mcap" if topic is None and mcap_reader.is_own_recording(path):
                found = mcap_reader.read(path)
            case suffix if suffix in {".mcap", ".bag", ".db3"} or path.is_dir():
                found = bags.read(path, topic=topic, rows=rows, columns=columns)
            case _:
                raise RecordingError(f"{path}: not a recording; {ACCEPTED}")
    return found if sensor is None else _take_pitch(found, sensor)


def _take_pitch(recording: Recording, sensor: TexelArray) -> Recording:
    """Give arrays of a recording that states no pitch, and have as many rows and columns as a sensor, its texels."""
    if PITCH_ASSUMED not in recording.setup.other:
        return recording
    arrays = tuple(
        replace(each, texels=replace(sensor, name=each.texels.name))
        if (each.texels.rows, each.texels.columns) == (sensor.rows, sensor.columns)
        else each
        for each in recording.arrays
    )
    other = {key: value for key, value in recording.setup.other.items() if key != PITCH_ASSUMED}
    return replace(recording, arrays=arrays, setup=replace(recording.setup, other=other))


def list_modules(paths: Iterable[str | Path]) -> tuple[str, ...]:
    """List the optional modules that read recordings, from the endings of their names, without duplicates."""
    return tuple(dict.fromkeys(_MODULES[end] for path in paths if (end := Path(path).suffix.lower()) in _MODULES))


def relabel(recording: Recording, setup: Setup) -> Recording:
    """Return a copy of a recording with indenter, load and note from `setup`, where `setup` gives them."""
    old = recording.setup
    merged = replace(
        old,
        indenter=setup.indenter or old.indenter,
        load=old.load if setup.load is None else setup.load,
        note=setup.note or old.note,
    )
    return replace(recording, setup=merged)


def add_forces(recording: Recording, path: str | Path, *, delay: float = 0.0) -> Recording:
    """Return a copy of a recording with the readings of a force sensor from a separate file.

    Args:
        recording: The recording.
        path: CSV file with the columns `time` [s] and `force` [N], or a ROS bag with wrench messages, of which the z
            component is used.  Times count from 1970, or from the first frame.
        delay: Time on the clock of the force sensor minus time on the clock of the recording [s].

    Raises:
        RecordingError: If the file cannot be read, or the times of its readings do not cover those of the frames.
    """
    path = Path(path)
    with limit_time(path):
        times, forces = tables.read_forces(path) if path.suffix.lower() == ".csv" else bags.read_forces(path)
    if times[0] > _EPOCH_TIMES:
        times = times - recording.started.timestamp()
    times = times - delay
    if times[0] > _UNCOVERED_TIME or times[-1] < recording.seconds - _UNCOVERED_TIME:
        raise RecordingError(
            f"{path}: forces from {times[0]:.2f} s to {times[-1]:.2f} s do not cover the frames, "
            f"0 s to {recording.seconds:.2f} s after the first one; correct the clock with `--force-delay`"
        )
    return replace(recording, forces=forces, force_times=times)


def save(recording: Recording, path: str | Path) -> int:
    """Write a recording as an MCAP file from which `open_recording` reads the same values.

    Negative counts are stored with an offset, which the file states.

    Args:
        recording: The recording.
        path: The file; it must not exist.

    Returns:
        Number of frames written.

    Raises:
        RecordingError: If the counts span more than 16 bits, or a time does not fit the stamps of ROS.
        StorageError: If the file exists or cannot be written.
    """
    start = _find_start(recording)
    host_monotonic, ticks = (
        clock if clock.size else np.zeros(len(recording.times), dtype=np.int64)
        for clock in (recording.host_monotonic, recording.ticks)
    )
    arrays = [replace(array, offset=max(0, -int(array.counts.min(initial=0)))) for array in recording.arrays]
    for array in arrays:
        least, most = -array.offset, int(array.counts.max(initial=0))
        if most - least > LARGEST_COUNT:
            raise RecordingError(
                f"{recording.path}: counts from {least} to {most} do not fit an MCAP file, which has 16 bits"
            )
    with (
        _remove_rest(Path(path)),
        RecordingWriter(path, arrays=arrays, setup=recording.setup, serial=recording.serial, start=start) as writer,
    ):
        for gap in recording.gaps:
            writer.add_gap(start, gap)
        for time, degrees in zip(recording.temperature_times, recording.temperatures, strict=True):
            writer.add_temperatures(start + _count_nanoseconds(time), degrees)
        for time, force in zip(recording.force_times, recording.forces, strict=True):
            writer.add_force(start + _count_nanoseconds(time), float(force))
        for number, time in enumerate(recording.times):
            clocks = Clocks(start + _count_nanoseconds(time), int(host_monotonic[number]), int(ticks[number]))
            for index, array in enumerate(recording.arrays):
                if array.simulated is None:
                    writer.add_frame(index, clocks, array.counts[number])
                else:
                    writer.add_simulated_frame(index, clocks, array.make_frame(number, float(time)))
        return writer.frames


@contextlib.contextmanager
def _remove_rest(path: Path) -> Iterator[None]:
    """Remove an unfinished file: unlike those that are recorded, its frames still stand in another file."""
    existed = path.exists()
    try:
        yield
    except BaseException as error:
        if existed:
            raise
        path.unlink(missing_ok=True)
        if isinstance(error, StorageError) and isinstance(error.__cause__, OSError):
            raise StorageError(
                error.__cause__.errno, f"cannot be written: {error.__cause__.strerror}", str(path)
            ) from None
        raise


def _find_start(recording: Recording) -> int:
    """Return the time of the first frame such that no reading lies before 1970 [ns].

    Raises:
        RecordingError: If a time does not fit the stamps of messages.
    """
    every = np.concatenate([recording.times, recording.force_times, recording.temperature_times, [0.0]])
    earliest, latest = float(every.min()), float(every.max())
    # The start is rounded up to whole microseconds; rounded down, the earliest reading could lie before 1970.
    start = max(round(recording.started.timestamp() * 1_000_000), math.ceil(-earliest * 1_000_000))
    last = start * 1e-6 + latest
    if not 0 <= last <= _LATEST:
        raise RecordingError(
            f"{recording.path}: times up to {last:.4g} s do not fit an MCAP file, which ends at {_LATEST} s; "
            "write seconds since 1970 or since the first frame"
        )
    return start * 1000


def _count_nanoseconds(seconds: np.float64) -> int:
    return round(float(seconds) / NANOSECOND)
