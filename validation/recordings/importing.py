"""Brings recordings of every known format into one labelled form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from validation.recordings import bags, dsa, mcap_reader, tables
from validation.recordings.labels import LabelledRecording, Setup, label
from validation.recordings.mcap_writer import Clocks, RecordingWriter
from validation.recordings.recording import RecordingError

ACCEPTED = "accepted: .dsa, .csv, .mcap, .bag (ROS 1), a folder with a ROS 2 recording"
_NANO = 1e-9


def open_recording(
    path: str | Path, *, topic: str | None = None, rows: int | None = None, columns: int | None = None
) -> LabelledRecording:
    """Read a recording of any known format.

    Args:
        path: File or folder.
        topic: Topic with the frames, for bags of other programs.
        rows: Texels along y, where the file does not say so [-].
        columns: Texels along x, where the file does not say so [-].

    Raises:
        RecordingError: If it is missing, damaged, or of no known format.
    """
    place = Path(path)
    if not place.exists():
        raise RecordingError(f"{place}: no such file; {ACCEPTED}")
    match place.suffix.lower():
        case ".dsa":
            recording = dsa.read(place)
            return label(recording, Setup(source=place.name, source_sha256=recording.sha256))
        case ".csv":
            return tables.read(place, rows=rows, columns=columns)
        case ".mcap" if topic is None and mcap_reader.is_ours(place):
            return mcap_reader.read(place)
        case ".mcap" | ".bag" | ".db3":
            return bags.read(place, topic=topic, rows=rows, columns=columns)
        case _ if place.is_dir():
            return bags.read(place, topic=topic, rows=rows, columns=columns)
        case _:
            raise RecordingError(f"{place}: not a recording; {ACCEPTED}")


def relabel(recording: LabelledRecording, setup: Setup) -> LabelledRecording:
    """Add what a user knows of a recording; what is not given stays."""
    old = recording.setup
    merged = replace(
        old,
        indenter=setup.indenter or old.indenter,
        load=old.load if setup.load is None else setup.load,
        note=setup.note or old.note,
    )
    return replace(recording, setup=merged)


def save(recording: LabelledRecording, path: str | Path) -> int:
    """Write a recording as MCAP, from where `open_recording` reads the same values.

    Args:
        recording: The recording.
        path: The file; it must not exist.

    Returns:
        How many frames were written.

    Raises:
        StorageError: If the file exists or the disk does not take it.
    """
    start = round(recording.started.timestamp() * 1_000_000) * 1000
    with RecordingWriter(
        path, arrays=recording.arrays, setup=recording.setup, serial=recording.serial, start=start
    ) as writer:
        for gap in recording.gaps:
            writer.add_gap(start, gap)
        for time, degrees in zip(recording.temperature_times, recording.temperatures, strict=True):
            writer.add_temperatures(start + _nanoseconds(time), degrees)
        for time, force in zip(recording.force_times, recording.forces, strict=True):
            writer.add_force(start + _nanoseconds(time), float(force))
        for number, time in enumerate(recording.times):
            moment = start + _nanoseconds(time)
            clocks = Clocks(moment, int(recording.host_monotonic[number]), int(recording.ticks[number]))
            for index, array in enumerate(recording.arrays):
                writer.add_frame(index, clocks, array.counts[number])
        return writer.frames


def _nanoseconds(seconds: np.float64) -> int:
    return round(float(seconds) / _NANO)
