"""Tactile frames out of ROS 1 and ROS 2 recordings of other programs, by what their messages look like.

Understood are images (mono8, mono16), messages with rows, columns and data under any of the names that public tactile
drivers use, lists of such (`tactile_matrix` of the SDH-2 driver), and multi-arrays with two dimensions.  A wrench
beside them is taken as a force sensor whose z component counts.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from validation.errors import MissingExtraError
from validation.recordings.labels import LabelledRecording, Setup, plain_array
from validation.recordings.recording import RecordingError

_ROWS, _COLUMNS = ("rows", "cells_y", "height"), ("columns", "cols", "cells_x", "width")
_VALUES = ("counts", "data", "tactile_array", "values")
_DEPTHS = {"mono8": "u1", "8UC1": "u1", "mono16": "u2", "16UC1": "u2"}
_NANO = 1e-9
_SECOND = 1_000_000_000
_GRID = 2


@dataclass(frozen=True)
class _Picture:
    """One frame of one array: name, rows, columns, counts (n,)."""

    name: str
    rows: int
    columns: int
    counts: npt.NDArray[np.int32]


@dataclass
class _Found:
    """What the messages held: per array its shape and frames, and forces, with times [ns]."""

    shapes: dict[str, tuple[int, int]] = field(default_factory=dict)
    frames: dict[str, list[tuple[int, npt.NDArray[np.int32]]]] = field(default_factory=lambda: defaultdict(list))
    forces: list[tuple[int, float]] = field(default_factory=list)


def read(
    path: str | Path, *, topic: str | None = None, rows: int | None = None, columns: int | None = None
) -> LabelledRecording:
    """Read a bag: a ROS 1 `.bag`, a ROS 2 folder or `.mcap`.

    Args:
        path: File or folder.
        topic: Topic with the frames; the only one that has some when not given.
        rows: Texels along y, for messages that do not say so [-].
        columns: Texels along x, for messages that do not say so [-].

    Raises:
        RecordingError: If it cannot be read, holds no tactile frames, or holds several topics of them.
    """
    place = Path(path)
    found = _Found()
    for name, time, message in _messages(place):
        if _is_wrench(message):
            found.forces.append((time, float(getattr(message, "wrench", message).force.z)))
        elif topic is None or name == topic:
            _take(place, found, name, time, _pictures(place, name, message, rows, columns))
    return _recording(place, found, topic)


def read_forces(path: str | Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Read the z components of the wrenches in a bag.

    Returns:
        Times since 1970 [s] and forces [N], shape (readings,).

    Raises:
        RecordingError: If it cannot be read or holds no wrenches.
    """
    place = Path(path)
    found = [
        (time * _NANO, float(getattr(message, "wrench", message).force.z))
        for _, time, message in _messages(place)
        if _is_wrench(message)
    ]
    if not found:
        raise RecordingError(f"{place}: no forces; expected a topic of wrenches")
    times, forces = np.array(sorted(found)).T
    return times, forces


def _messages(place: Path) -> Iterator[tuple[str, int, Any]]:
    """Topic, time [ns] and message, in order of time; messages of unknown layout are left out."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError("device", "rosbags") from error
    if not place.exists():
        raise RecordingError(f"{place}: no such file; expected a ROS bag")
    try:
        with AnyReader([place], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted = [connection for connection in reader.connections if connection.msgtype in reader.typestore.types]
            for connection, stamp, data in reader.messages(connections=wanted):
                message = reader.deserialize(data, connection.msgtype)
                yield connection.topic, _time(message, stamp), message
    except RecordingError:
        raise
    except Exception as error:
        # the library lets many kinds of errors through when bytes are wrong
        raise RecordingError(f"{place}: not a ROS bag, or damaged: {' '.join(str(error).split())}") from error


def _time(message: object, stamp: int) -> int:
    own = getattr(getattr(message, "header", None), "stamp", None)
    if own is None or not own.sec:
        return stamp
    return int(own.sec) * _SECOND + int(own.nanosec)


def _is_wrench(message: object) -> bool:
    return hasattr(getattr(getattr(message, "wrench", message), "force", None), "z")


def _pictures(place: Path, topic: str, message: object, rows: int | None, columns: int | None) -> Sequence[_Picture]:
    encoding = getattr(message, "encoding", None)
    if encoding is not None:
        return [_image(place, topic, message)] if encoding in _DEPTHS else []
    nested = getattr(message, "tactile_matrix", None)
    if nested is not None:
        names = (f"{topic}/{getattr(part, 'matrix_id', number)}" for number, part in enumerate(nested))
        parts = zip(names, nested, strict=True)
        return [picture for name, part in parts for picture in _pictures(place, name, part, rows, columns)]
    values = _first(message, _VALUES)
    shape = _dimensions(message, rows, columns)
    if shape is None or not isinstance(values, np.ndarray) or values.size != shape[0] * shape[1]:
        return []
    return [_Picture(topic, *shape, _whole(place, topic, values))]


def _image(place: Path, topic: str, message: Any) -> _Picture:  # noqa: ANN401 -- types are made at run time
    depth = np.dtype(_DEPTHS[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    rows, columns, step = int(message.height), int(message.width), int(message.step)
    if step < columns * depth.itemsize or len(message.data) != rows * step:
        raise RecordingError(f"{place}: {topic}: an image of {rows} x {columns} pixels with {len(message.data)} bytes")
    lines = np.asarray(message.data).reshape(rows, step)[:, : columns * depth.itemsize]
    return _Picture(topic, rows, columns, np.ascontiguousarray(lines).view(depth).astype(np.int32).ravel())


def _dimensions(message: object, rows: int | None, columns: int | None) -> tuple[int, int] | None:
    own_rows, own_columns = _first(message, _ROWS), _first(message, _COLUMNS)
    if isinstance(own_rows, int) and isinstance(own_columns, int):
        return own_rows, own_columns
    sizes = [int(dimension.size) for dimension in getattr(getattr(message, "layout", None), "dim", ())]
    if len(sizes) == _GRID:
        return sizes[0], sizes[1]
    return (rows, columns) if rows and columns else None


def _first(message: object, names: Sequence[str]) -> object:
    return next((getattr(message, name) for name in names if hasattr(message, name)), None)


def _whole(place: Path, topic: str, values: npt.NDArray[Any]) -> npt.NDArray[np.int32]:
    if not np.isfinite(values).all() or (values < 0).any() or (values != np.round(values)).any():
        raise RecordingError(f"{place}: {topic}: values are no counts; expected whole numbers of 0 or more")
    return values.astype(np.int32)


def _take(place: Path, found: _Found, topic: str, time: int, pictures: Sequence[_Picture]) -> None:
    for picture in pictures:
        shape = (picture.rows, picture.columns)
        if found.shapes.setdefault(picture.name, shape) != shape:
            raise RecordingError(f"{place}: {topic}: the array changes from {found.shapes[picture.name]} to {shape}")
        found.frames[picture.name].append((time, picture.counts))


def _recording(place: Path, found: _Found, topic: str | None) -> LabelledRecording:
    names = list(found.shapes)
    topics = {name if name.count("/") == 1 else name.rsplit("/", 1)[0] for name in names}
    counts = {len(found.frames[name]) for name in names}
    if not names:
        raise RecordingError(f"{place}: no tactile frames{f' on {topic}' if topic else ''}; known are images and grids")
    if len(counts) > 1 or (len(names) > 1 and len(topics) > 1):
        raise RecordingError(f"{place}: frames on several topics; name one of {', '.join(sorted(names))}")
    series = [sorted(found.frames[name], key=lambda frame: frame[0]) for name in names]
    stamps = np.array([time for time, _ in series[0]], dtype=np.int64)
    unknown = np.zeros(len(stamps), dtype=np.int64)
    digest = _sha256(place)
    return LabelledRecording(
        path=place,
        sha256=digest,
        serial="",
        started=datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=int(stamps[0]) // 1000),
        times=(stamps - stamps[0]) * _NANO,
        arrays=tuple(
            plain_array(*found.shapes[name], np.array([counts for _, counts in frames]), name=name)
            for name, frames in zip(names, series, strict=True)
        ),
        temperatures=np.empty((0, 0)),
        temperature_times=np.empty(0),
        setup=Setup(source=place.name, source_sha256=digest, note=f"from {', '.join(names)}"),
        gaps=(),
        complete=True,
        host_monotonic=unknown,
        ticks=unknown,
        forces=np.array([force for _, force in found.forces]),
        force_times=(np.array([time for time, _ in found.forces], dtype=np.int64) - stamps[0]) * _NANO,
    )


def _sha256(place: Path) -> str:
    """Hash of a file, or of the files of a folder in order of their names."""
    digest = hashlib.sha256()
    files = sorted(file for file in place.rglob("*") if file.is_file()) if place.is_dir() else [place]
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()
