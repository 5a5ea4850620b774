"""Reads tactile frames and forces from ROS 1 and ROS 2 recordings (bags) of other programs.

Messages with frames are recognised by their layout.  Accepted are images (mono8, mono16); messages with rows, columns
and data under any of the names that public tactile drivers use; lists of such messages (`tactile_matrix` of the SDH-2
driver); and multi-arrays with two dimensions.  The z component of a wrench is the reading of a force sensor.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from meshes.array import MOST_TEXELS
from meshes.bounded_file import LIMITS, format_size
from validation.extras import MissingExtraError
from validation.recordings import recording
from validation.recordings.recording import NANOSECOND, Budget, CountArray, FloatArray, Recording, RecordingError, Setup

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

#: Names of the message fields in which public tactile drivers give the number of rows.  If a message has several of
#: them, the first in the list is used.
_ROW_NAMES = ("rows", "cells_y", "height")
#: Names of the message fields that give the number of columns, in order of preference.
_COLUMN_NAMES = ("columns", "cols", "cells_x", "width")
#: Names of the message fields that give the counts, in order of preference.
_COUNT_NAMES = ("counts", "data", "tactile_array", "values")
#: numpy type of a pixel by the encoding of a ROS image message.
_PIXEL_TYPES = {"mono8": "u1", "8UC1": "u1", "mono16": "u2", "16UC1": "u2"}


@dataclass(frozen=True, kw_only=True)
class _Limits:
    """Limits on the content of a bag of another program, and on the memory to read it.

    Attributes:
        size: Size of a bag with all its files [bytes].
        metadata: Size of the metadata in YAML, which is parsed slowly [bytes].
        memory: Memory that reading a bag may add, besides a multiple of its size [bytes].
        memory_ratio: Memory that reading a bag may add for each byte of the bag [-].
    """

    size: int = 2**32
    metadata: int = 2**18
    memory: int = 400 * 2**20
    memory_ratio: int = 4


_LIMITS = _Limits()


class _ArrayFrame(NamedTuple):
    """One frame of one texel array: its name, numbers of rows and columns, and counts, shape (rows * columns,) [-]."""

    array: str
    shape: tuple[int, int]
    counts: CountArray


def read(
    path: str | Path, *, topic: str | None = None, rows: int | None = None, columns: int | None = None
) -> Recording:
    """Read the frames and forces of a bag: a ROS 1 `.bag` file, a ROS 2 folder or a ROS 2 `.mcap` file.

    Args:
        path: The file or folder.
        topic: Topic with the tactile frames; not needed if only one topic has tactile frames.
        rows: Number of texels along y, for messages that do not state the number [-].
        columns: Number of texels along x, for messages that do not state the number [-].

    Raises:
        RecordingError: If the bag cannot be read, or if no topic or several topics hold tactile frames.
    """
    path = Path(path)
    frames: dict[str, list[tuple[int, _ArrayFrame]]] = defaultdict(list)
    forces: list[tuple[int, float]] = []
    with _open_bag(path) as messages:
        for name, time, message in messages:
            force = _find_force(message)
            if force is not None:
                forces.append((time, force))
                continue
            for frame in _find_frames(path, name, message, rows, columns) if topic in (None, name) else ():
                frames[frame.array].append((time, frame))
                first = frames[frame.array][0][1].shape
                if first != frame.shape:
                    raise RecordingError(
                        f"{path}: {frame.array}: the array changes from {first[0]} x {first[1]} to "
                        f"{frame.shape[0]} x {frame.shape[1]} texels; expected the same size in all frames"
                    )
            if len(frames) > recording.MOST_ARRAYS:
                raise RecordingError(f"{path}: holds frames of more than {recording.MOST_ARRAYS} arrays")
    if not frames:
        raise RecordingError(
            f"{path}: no tactile frames{f' on {topic}' if topic else ''}; known are images and grids of at most "
            f"{MOST_TEXELS} texels"
        )
    topics = {name if name.count("/") == 1 else name.rsplit("/", 1)[0] for name in frames}
    if len(set(map(len, frames.values()))) > 1 or (len(frames) > 1 and len(topics) > 1):
        raise RecordingError(f"{path}: frames on several topics; name one of {', '.join(sorted(frames))}")
    series = {name: sorted(each, key=lambda frame: frame[0]) for name, each in frames.items()}
    times = [time for time, _ in next(iter(series.values()))]
    digest = recording.hash_contents(path)
    return Recording(
        path=path,
        sha256=digest,
        started=recording.convert_to_utc(times[0]),
        times=recording.count_seconds(times, times[0]),
        arrays=tuple(
            recording.make_array(*each[0][1].shape, np.array([frame.counts for _, frame in each]), name=name)
            for name, each in series.items()
        ),
        setup=Setup(
            source=path.name,
            source_sha256=digest,
            note=f"from {', '.join(series)}",
            other=dict(recording.PITCH_LABEL),
        ),
        forces=np.array([force for _, force in forces]),
        force_times=recording.count_seconds([time for time, _ in forces], times[0]),
    )


def read_forces(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Read the z components of all wrench messages in a bag as readings of a force sensor.

    Returns:
        Times since 1970 [s] and forces [N], each of shape (readings,).

    Raises:
        RecordingError: If the bag cannot be read or holds no wrench messages.
    """
    with _open_bag(Path(path)) as messages:
        found = [(time * NANOSECOND, _find_force(message)) for _, time, message in messages]
    forces = np.array(sorted(reading for reading in found if reading[1] is not None), dtype=np.float64)
    if not forces.size:
        raise RecordingError(f"{path}: no forces; expected a topic of wrenches")
    return forces[:, 0], forces[:, 1]


@contextlib.contextmanager
def _open_bag(path: Path) -> Iterator[Iterator[tuple[str, int, object]]]:
    """Yield the messages of a bag in order of time: topic, time [ns] and content, without messages of unknown type.

    Exceptions of the library, also those caused by unusual types of messages, become a `RecordingError`.

    Raises:
        RecordingError: If the bag is missing, damaged or larger than is accepted.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError("rosbags") from error
    if not path.exists():
        raise RecordingError(f"{path}: no such file; expected a ROS bag")
    size = _measure_bag(path)
    if path.is_dir() and not (path / "metadata.yaml").exists():
        raise RecordingError(f"{path}: no recording of ROS 2, which is a folder with metadata.yaml")
    budget = Budget(path, size)
    try:
        with _limit_memory(path, size), AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            yield _read_messages(reader, budget)
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or 'cannot be read'}; expected a ROS bag") from error
    except Exception as error:
        # The rosbags library raises many kinds of exceptions on damaged files.
        raise RecordingError(f"{path}: not a ROS bag, or damaged; accepted: an intact bag of ROS 1 or ROS 2") from error


def _read_messages(reader: AnyReader, budget: Budget) -> Iterator[tuple[str, int, object]]:
    known = [connection for connection in reader.connections if connection.msgtype in reader.typestore.types]
    for connection, received, data in reader.messages(connections=known):
        message = reader.deserialize(data, connection.msgtype)
        # The time of a message is the stamp of its header, or the time of reception if the header has no stamp.
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        time = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) if stamp and stamp.sec else received
        budget.spend(records=1)
        budget.spend_message(connection.topic, len(data), (received, time))
        yield connection.topic, time, message


def _find_force(message: object) -> float | None:
    """Return the z component of the force if the message is a wrench [N]; None for any other message."""
    force = getattr(getattr(getattr(message, "wrench", message), "force", None), "z", None)
    return None if force is None else float(force)


def _find_frames(
    path: Path, name: str, message: object, rows: int | None, columns: int | None
) -> Iterator[_ArrayFrame]:
    """Yield the tactile frames in a message; none for a message of unknown layout.

    Args:
        path: The bag, for error messages.
        name: Topic of the message, from which the names of the arrays are made.
        message: The message.
        rows: Number of texels along y, for messages that do not state the number [-].
        columns: Number of texels along x, for messages that do not state the number [-].

    Raises:
        RecordingError: If values are not whole numbers of 0 or more, or if an image has the wrong number of bytes.
    """
    encoding, parts = getattr(message, "encoding", None), getattr(message, "tactile_matrix", None)
    if encoding is not None:
        yield from _read_image(path, name, message) if encoding in _PIXEL_TYPES else ()
        return
    if parts is not None:
        if len(parts) > recording.MOST_ARRAYS:
            most = recording.MOST_ARRAYS
            raise RecordingError(f"{path}: {name}: holds {len(parts)} arrays; at most {most} are accepted")
        for number, part in enumerate(parts):
            yield from _find_frames(path, f"{name}/{getattr(part, 'matrix_id', number)}", part, rows, columns)
        return
    values, shape = _find_attribute(message, _COUNT_NAMES), _find_shape(message) or (rows or 0, columns or 0)
    texels = shape[0] * shape[1] if min(shape) > 0 else 0
    if not isinstance(values, np.ndarray) or not 1 <= texels <= MOST_TEXELS or values.size != texels:
        return
    if not np.isfinite(values).all() or (values < 0).any() or (values != np.round(values)).any():
        raise RecordingError(f"{path}: {name}: values are no counts; expected whole numbers of 0 or more")
    if values.max() > recording.MOST_FULL_SCALE:
        most = recording.MOST_FULL_SCALE
        raise RecordingError(f"{path}: {name}: a count of {values.max()}; at most {most} are accepted")
    yield _ArrayFrame(name, shape, values.astype(np.int32))


def _find_shape(message: object) -> tuple[int, int] | None:
    """Return the numbers of rows and columns that a message states; None if it states none."""
    rows, columns = _find_attribute(message, _ROW_NAMES), _find_attribute(message, _COLUMN_NAMES)
    if isinstance(rows, int) and isinstance(columns, int):
        return rows, columns
    sides = [int(dimension.size) for dimension in getattr(getattr(message, "layout", None), "dim", ())]
    return (sides[0], sides[1]) if len(sides) == 2 else None  # noqa: PLR2004 -- rows and columns


def _find_attribute(message: object, names: Sequence[str]) -> object:
    """Return the value of the first of `names` that is a field of the message; None if there is no such field."""
    return next((getattr(message, name) for name in names if hasattr(message, name)), None)


def _read_image(path: Path, name: str, message: Any) -> Iterator[_ArrayFrame]:  # noqa: ANN401 -- a type made at run time
    pixel = np.dtype(_PIXEL_TYPES[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    rows, columns, step = int(message.height), int(message.width), int(message.step)
    if rows * columns > MOST_TEXELS:  # An image of this size comes from a camera.
        return
    if step < columns * pixel.itemsize or len(message.data) != rows * step:
        raise RecordingError(
            f"{path}: {name}: an image of {rows} x {columns} pixels has {len(message.data)} bytes; "
            f"expected {rows} rows of {step} bytes"
        )
    lines = np.asarray(message.data).reshape(rows, step)[:, : columns * pixel.itemsize]
    yield _ArrayFrame(name, (rows, columns), np.ascontiguousarray(lines).view(pixel).astype(np.int32).ravel())


def _measure_bag(path: Path) -> int:
    """Return the size of a bag of another program with all its files [bytes].

    Raises:
        RecordingError: If the bag is missing, too large, or holds something else than regular files.
    """
    try:
        found = list(itertools.islice(path.iterdir(), recording.LIMITS.files + 1)) if path.is_dir() else [path]
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}; expected a ROS bag") from error
    sizes = {}
    for file in found:
        if file == path or not file.is_dir():
            with recording.open_recorded(file) as opened:
                sizes[file.name] = os.fstat(opened.fileno()).st_size
    metadata = path / "metadata.yaml"
    too_slow = sizes.get(metadata.name, 0) > _LIMITS.metadata
    if len(found) > recording.LIMITS.files or sum(sizes.values()) > _LIMITS.size or too_slow:
        raise RecordingError(
            f"{path}: too large; accepted: {format_size(_LIMITS.size)} in {recording.LIMITS.files} files, "
            f"metadata.yaml of {format_size(_LIMITS.metadata)}"
        )
    if metadata.name in sizes:
        # The time that the parser of YAML needs grows with the square of the depth of brackets.
        brackets = re.findall(r"[][{}]", metadata.read_text("utf-8", errors="replace"))
        depths = itertools.accumulate(1 if bracket in "[{" else -1 for bracket in brackets)
        if max(depths, default=0) > LIMITS.depth:
            raise RecordingError(f"{metadata}: has brackets more than {LIMITS.depth} deep")
    return sum(sizes.values())


@contextlib.contextmanager
def _limit_memory(path: Path, size: int) -> Iterator[None]:
    """Limit the additional memory of this process, and the size of files that it writes, while a bag is read.

    The limits are enforced by the operating system, so that they hold for content unpacked by any library.  They count
    for all threads.  They are set on Linux only.

    Args:
        path: The bag, for the error message.
        size: Size of the bag [bytes].

    Raises:
        RecordingError: If reading the bag needs more memory than the limit.
    """
    most = _LIMITS.memory + _LIMITS.memory_ratio * size
    try:
        import resource

        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    except (ImportError, OSError):
        yield
        return
    wanted = {resource.RLIMIT_AS: used + most, resource.RLIMIT_FSIZE: most}
    before = {kind: resource.getrlimit(kind) for kind in wanted}
    try:
        for kind, limits in before.items():
            lowest = min((wanted[kind], *(each for each in limits if each != resource.RLIM_INFINITY)))
            resource.setrlimit(kind, (lowest, limits[1]))
        yield
    except (MemoryError, OSError) as error:
        if isinstance(error, OSError) and error.errno != errno.EFBIG:
            raise
        raise RecordingError(f"{path}: unpacks to more than the {format_size(most)} accepted for its size") from None
    finally:
        for kind, limits in before.items():
            resource.setrlimit(kind, limits)
