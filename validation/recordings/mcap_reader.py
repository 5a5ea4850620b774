"""Reads the recordings that `mcap_writer` writes, finished or not, and refuses damaged ones.

Chunks carry checksums, a finished file carries one over all its data, and frames carry running numbers; all are
checked.  A file without its end, left by a killed recorder, is read up to its last whole chunk and says so.
"""

from __future__ import annotations

import hashlib
import io
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import IO, Any

import numpy as np

from meshes import atomic_file
from validation.errors import MissingExtraError
from validation.recordings import labels, ros_messages
from validation.recordings.labels import LabelledRecording
from validation.recordings.mcap_writer import (
    FORCE_TOPIC,
    GAP_TOPIC,
    RAW_TOPIC,
    SETUP_TOPIC,
    TEMPERATURE_TOPIC,
    topic_names,
)
from validation.recordings.recording import RecordingError

MAGIC = b"\x89MCAP0\r\n"
_HEAD = 9
_FOOTER = 0x02
_LARGEST_RECORD = 2**28
_NANO = 1e-9
_PIECE = 2**20


def read(path: str | Path) -> LabelledRecording:
    """Read a recording.

    Args:
        path: An MCAP file that this program wrote.

    Raises:
        RecordingError: If it is no such file or is damaged; nothing of a damaged file is returned.
    """
    place = Path(path)
    content = _Content(place)
    for channel, message in _messages(place, content):
        content.take(channel.topic, message)
    return content.recording()


def read_raw(path: str | Path) -> Iterator[tuple[int, bytes]]:
    """Bytes as they came from the port, with their times, UTC [ns].

    Raises:
        RecordingError: If the file is no recording or is damaged.
    """
    place = Path(path)
    for channel, message in _messages(place, _Content(place)):
        if channel.topic == RAW_TOPIC:
            yield message.log_time, ros_messages.read_octets(message.data)


def is_ours(path: str | Path) -> bool:
    """Whether this program wrote it; false for MCAP files of others.

    Raises:
        RecordingError: If it is no MCAP file or damaged near its start.
    """
    from mcap.records import Channel

    for record in _records(Path(path)):
        if isinstance(record, Channel):
            return bool(record.topic == SETUP_TOPIC and record.message_encoding == "cdr")
    return False


def is_complete(path: str | Path) -> bool:
    """Whether a recording was closed properly.

    Raises:
        RecordingError: If it is no MCAP file.
    """
    return _whole(Path(path))[1]


def recover(path: str | Path) -> bool:
    """Give a recording that was cut off its index and end, so that every MCAP tool reads it.

    The file is replaced in one step.  A complete file is left as it is.

    Returns:
        Whether there was anything to do.

    Raises:
        RecordingError: If it is no recording or is damaged.
    """
    from mcap.records import Channel, Message, Metadata, Schema
    from mcap.writer import Writer

    place = Path(path)
    if is_complete(place):
        return False
    output = io.BytesIO()
    writer: Any = Writer(output, enable_data_crcs=True)
    writer.start(profile="ros2", library="softcover")
    schemas, channels = {0: 0}, {}
    for record in _records(place):
        if isinstance(record, Schema):
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel):
            schema = schemas[record.schema_id]
            channels[record.id] = writer.register_channel(record.topic, record.message_encoding, schema)
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, dict(record.metadata))
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
    writer.finish()
    atomic_file.replace(place, [output.getvalue()])
    atomic_file.sweep(place.parent)
    return True


@dataclass
class _Content:
    """What the messages say, collected."""

    path: Path
    complete: bool = True
    labels_text: str | None = None
    frames: dict[str, list[tuple[int, ros_messages.FrameFields]]] = field(default_factory=lambda: defaultdict(list))
    gaps: list[str] = field(default_factory=list)
    temperatures: list[tuple[int, Any]] = field(default_factory=list)
    forces: list[tuple[int, float]] = field(default_factory=list)

    def take(self, topic: str, message: Any) -> None:  # noqa: ANN401 -- the library is untyped
        """Read one message."""
        if topic == SETUP_TOPIC:
            self.labels_text = ros_messages.read_text(message.data)
        elif topic == GAP_TOPIC:
            self.gaps += ros_messages.read_diagnostics(message.data)
        elif topic == TEMPERATURE_TOPIC:
            self.temperatures.append((message.log_time, ros_messages.read_numbers(message.data)))
        elif topic == FORCE_TOPIC:
            self.forces.append((message.log_time, ros_messages.read_force(message.data)))
        elif topic.endswith("/frame"):
            frames = self.frames[topic]
            if message.sequence != len(frames):
                raise RecordingError(
                    f"{self.path}: damaged: frame {message.sequence} of {topic} follows frame {len(frames) - 1}"
                )
            frames.append((message.log_time, ros_messages.read_frame(message.data)))

    def recording(self) -> LabelledRecording:
        """All of it as one recording."""
        if self.labels_text is None:
            raise RecordingError(f"{self.path}: an MCAP file without the labels of a softcover recording")
        setup, described = labels.from_json(self.labels_text, str(self.path))
        names = topic_names(len(described["arrays"]))
        series = [self.frames[f"/{name}/frame"] for name in names]
        # a recorder killed between two arrays leaves the last frame of some of them only
        count = min(len(frames) for frames in series)
        stamps = np.array([time for time, _ in series[0][:count]], dtype=np.int64)
        # killed before the first frame, a recording still tells its set-up
        start = stamps[0] if count else np.int64(described["clock"]["start_ns"])
        arrays = tuple(
            labels.array_from(entry, [fields.counts for _, fields in frames[:count]])
            for entry, frames in zip(described["arrays"], series, strict=True)
        )
        clocks = [fields for _, fields in series[0][:count]]
        when = np.array([time for time, _ in self.temperatures], dtype=np.int64)
        return LabelledRecording(
            path=self.path,
            sha256=_sha256(self.path),
            serial=str(described["serial"]),
            started=datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=int(start) // 1000),
            times=(stamps - start) * _NANO,
            arrays=arrays,
            temperatures=np.array([degrees for _, degrees in self.temperatures]).reshape(len(when), -1)
            if len(when)
            else np.empty((0, 0)),
            temperature_times=(when - start) * _NANO,
            setup=setup,
            gaps=tuple(self.gaps),
            complete=self.complete,
            host_monotonic=np.array([fields.host_monotonic for fields in clocks], dtype=np.int64),
            ticks=np.array([fields.ticks for fields in clocks], dtype=np.int64),
            forces=np.array([force for _, force in self.forces]),
            force_times=(np.array([time for time, _ in self.forces], dtype=np.int64) - start) * _NANO,
        )


def _messages(path: Path, content: _Content) -> Iterator[tuple[Any, Any]]:
    """Every message with its channel."""
    from mcap.records import Channel, Message

    content.complete = is_complete(path)
    channels: dict[int, Any] = {}
    for record in _records(path):
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            if record.channel_id not in channels:
                raise RecordingError(f"{path}: damaged: a message of an unknown channel")
            yield channels[record.channel_id], record


def _records(path: Path) -> Iterator[Any]:
    """Every record up to the end, or to the last whole record of a file that was cut off."""
    try:
        from mcap.exceptions import EndOfFile
        from mcap.stream_reader import StreamReader
    except ImportError as error:
        raise MissingExtraError("device", "mcap") from error
    size, complete = _whole(path)
    with path.open("rb") as file:
        part = _Part(file, size)
        reader = StreamReader(part, validate_crcs=True, record_size_limit=_LARGEST_RECORD)  # type: ignore[arg-type]
        try:
            yield from reader.records
        except EndOfFile as error:
            if complete or part.left:
                raise RecordingError(f"{path}: damaged near byte {size - part.left}") from error
        except RecordingError:
            raise
        except Exception as error:
            # the library lets many kinds of errors through when bytes are wrong
            raise RecordingError(f"{path}: damaged near byte {size - part.left}: {error}") from error


def _whole(path: Path) -> tuple[int, bool]:
    """How many bytes form whole records, and whether the file ends as it should."""
    if not path.is_file():
        raise RecordingError(f"{path}: no such file; expected a recording")
    end = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path}: not an MCAP file; expected one that `softcover record` or ROS 2 wrote")
        position = len(MAGIC)
        while position + _HEAD <= end:
            file.seek(position)
            head = file.read(_HEAD)
            after = position + _HEAD + int.from_bytes(head[1:], "little")
            if after > end:
                break
            position = after
            if head[0] == _FOOTER:
                file.seek(position)
                complete = file.read() == MAGIC
                return (end if complete else position), complete
    return position, False


class _Part:
    """The first bytes of a file."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        self._file = file
        self.left = size

    def read(self, size: int) -> bytes:
        data = self._file.read(min(size, self.left))
        self.left -= len(data)
        return data


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()
