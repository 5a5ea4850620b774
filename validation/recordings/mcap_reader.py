"""Reads the MCAP files that `mcap_writer` writes, complete or truncated, and refuses damaged ones.

The reader checks the checksum of each chunk (group of messages), the checksum over all data of a complete file, and the
sequence numbers of the frames.  A file without its end, as a killed recorder leaves it, is read up to its last complete
chunk, and the recording is marked as not complete.
"""

from __future__ import annotations

import io
import mmap
import zlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

import numpy as np

from meshes import atomic_file
from meshes.bounded_file import format_size
from validation.extras import MissingExtraError
from validation.recordings import ros_messages
from validation.recordings.labels import decode_labels
from validation.recordings.mcap_writer import (
    FORCE_TOPIC,
    GAP_TOPIC,
    SETUP_TOPIC,
    TANGENTIAL_LABEL,
    TEMPERATURE_TOPIC,
    name_topics,
)
from validation.recordings.recording import (
    Budget,
    FloatArray,
    Recording,
    RecordingError,
    SimulatedForces,
    convert_to_utc,
    count_seconds,
    hash_contents,
    open_recorded,
)

if TYPE_CHECKING:
    from mcap.records import Channel, Chunk, McapRecord, Message

#: First and last bytes of every MCAP file.
MAGIC = b"\x89MCAP0\r\n"
#: Number of bytes before the content of an MCAP record: one for the kind of the record, eight for its length.
_RECORD_HEAD_SIZE = 9
#: Code of the kind of the last record (footer) of a complete MCAP file.
_FOOTER = 0x02
#: Largest number of bytes that a chunk may unpack to; the chunks that this program writes hold about 1 MiB.
MOST_CHUNK_BYTES = 2**26
#: Largest memory that unpacking may need besides the result [bytes].
_MOST_WINDOW = 2**27
#: Largest size of a record that is read [bytes].  A damaged length field could otherwise claim all memory; the chunks
#: that this program writes hold about 1 MiB.
_LARGEST_RECORD = 2**27


def read(path: str | Path) -> Recording:
    """Read a recording from an MCAP file that this program wrote.

    Args:
        path: The MCAP file.

    Raises:
        RecordingError: If the file is missing, damaged, or was written by another program.
    """
    path = Path(path)
    collector = _Collector(path, complete=is_complete(path))
    budget = Budget(path, path.stat().st_size)
    for topic, message in _read_messages(path):
        budget.spend_message(topic, len(message.data), (message.log_time, message.publish_time))
        try:
            collector.add(topic, message)
        except RecordingError:
            raise
        except Exception as error:  # the libraries raise many kinds of exceptions on damaged messages
            raise RecordingError(f"{path}: damaged: a message of {topic} cannot be read") from error
    return collector.make_recording()


def is_own_recording(path: str | Path) -> bool:
    """Return whether this program wrote an MCAP file; False for MCAP files of other programs.

    Raises:
        RecordingError: If the file is not an MCAP file or is damaged near its start.
    """
    from mcap.records import Channel

    channels = (record for record in _read_records(Path(path)) if isinstance(record, Channel))
    first = next(channels, None)
    return first is not None and first.topic == SETUP_TOPIC and first.message_encoding == "cdr"


def is_complete(path: str | Path) -> bool:
    """Return whether an MCAP file was closed properly, so that it has its footer.

    Raises:
        RecordingError: If the file is not an MCAP file.
    """
    return _measure(Path(path))[1]


def recover(path: str | Path) -> bool:
    """Add index and footer to the file of a recorder that was killed, so that every MCAP tool can read the file.

    The completed file replaces the old file atomically.  A complete file is not changed.

    Returns:
        Whether the file was incomplete.

    Raises:
        RecordingError: If the file is not an MCAP file or is damaged.
        OSError: If the completed file cannot be written; the old file then remains.
    """
    from mcap.records import Channel, Message, Metadata, Schema
    from mcap.writer import Writer

    path = Path(path)
    if is_complete(path):
        return False
    output = io.BytesIO()
    writer = Writer(output, enable_data_crcs=True)
    writer.start(profile="ros2", library="softcover")
    schemas, channels = {0: 0}, {}
    for record in _read_records(path):
        match record:
            case Schema():
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            case Channel():
                schema = schemas[record.schema_id]
                channels[record.id] = writer.register_channel(record.topic, record.message_encoding, schema)
            case Metadata():
                writer.add_metadata(record.name, dict(record.metadata))
            case Message():
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
    writer.finish()
    atomic_file.replace(path, [output.getvalue()])
    atomic_file.sweep(path.parent)
    return True


@dataclass
class _Collector:
    """Collects the decoded messages of one MCAP file; their times are UTC since 1970 [ns].

    Attributes:
        path: The file.
        complete: Whether the file was closed properly.
        labels_text: Labels of the recording as JSON text; None before they were read.
        frames: Time and content of each frame, by topic.
        gaps: One line for each gap in the stream of frames.
        temperatures: Time and temperatures of all channels [degC] of each reading.
        forces: Time and value [N] of each reading of the force sensor.
        values: Other values of simulated frames, by topic and number of the frame.
        labels: Label of these values, by topic.
    """

    path: Path
    complete: bool
    labels_text: str | None = None
    frames: dict[str, list[tuple[int, ros_messages.FrameMessage]]] = field(default_factory=lambda: defaultdict(list))
    gaps: list[str] = field(default_factory=list)
    temperatures: list[tuple[int, FloatArray]] = field(default_factory=list)
    forces: list[tuple[int, float]] = field(default_factory=list)
    values: dict[str, dict[int, FloatArray]] = field(default_factory=lambda: defaultdict(dict))
    labels: dict[str, str] = field(default_factory=dict)

    def add(self, topic: str, message: Message) -> None:
        """Decode one message and store its content by topic; raise `RecordingError` if a frame before it is missing."""
        if topic == SETUP_TOPIC:
            self.labels_text = str(ros_messages.decode(message.data, ros_messages.TEXT).data)
        elif topic == GAP_TOPIC:
            self.gaps += [
                status.message for status in ros_messages.decode(message.data, ros_messages.DIAGNOSTICS).status
            ]
        elif topic == TEMPERATURE_TOPIC:
            numbers = ros_messages.decode(message.data, ros_messages.NUMBERS)
            self.temperatures.append((message.log_time, np.array(numbers.data, dtype=np.float64)))
        elif topic == FORCE_TOPIC:
            self.forces.append((message.log_time, float(ros_messages.decode_wrench(message.data)[2])))
        elif topic.endswith("/frame"):
            frames = self.frames[topic]
            if message.sequence != len(frames):
                raise RecordingError(
                    f"{self.path}: damaged: frame {message.sequence} of {topic} follows frame {len(frames) - 1}"
                )
            frames.append((message.publish_time, ros_messages.decode_frame(message.data)))
        elif topic.endswith("/wrench"):
            self.values[topic][message.sequence] = ros_messages.decode_wrench(message.data)
        elif topic.endswith(("/pressures", "/tangential")):
            numbers = ros_messages.decode(message.data, ros_messages.NUMBERS)
            self.values[topic][message.sequence] = np.array(numbers.data, dtype=np.float64)
            self.labels[topic] = str(numbers.layout.dim[0].label) if numbers.layout.dim else ""

    def make_recording(self) -> Recording:
        """Make a recording from all messages of the file."""
        if self.labels_text is None:
            raise RecordingError(f"{self.path}: an MCAP file without the labels of a softcover recording")
        labels = decode_labels(self.labels_text, self.path)
        series = [self.frames[f"/{name}/frame"] for name in name_topics(len(labels.arrays))]
        # A recorder that was killed between the frames of two arrays leaves one frame more of the first arrays than of
        # the others; the additional frames are left out.
        count = min(len(frames) for frames in series)
        # In a file without frames, times count from the start of the recording.
        start = series[0][0][0] if count else labels.start
        for array, frames in zip(labels.arrays, series, strict=True):
            if any(frame.counts.size != array.texels.count for _, frame in frames[:count]):
                raise RecordingError(f"{self.path}: damaged: a frame has other texels than {array.texels.name}")
        clocks = [frame for _, frame in series[0][:count]]
        return Recording(
            path=self.path,
            sha256=hash_contents(self.path),
            serial=labels.serial,
            started=convert_to_utc(start),
            times=count_seconds(series[0][:count], start),
            arrays=tuple(
                replace(
                    array,
                    counts=np.array([frame.counts for _, frame in frames[:count]], dtype=np.int32).reshape(
                        count, array.texels.count
                    )
                    - np.int32(array.offset),
                    simulated=self._collect_simulated(name, [frame for _, frame in frames[:count]], array.texels.count),
                )
                for name, array, frames in zip(name_topics(len(series)), labels.arrays, series, strict=True)
            ),
            temperatures=self._stack_temperatures(),
            temperature_times=count_seconds(self.temperatures, start),
            setup=labels.setup,
            gaps=tuple(self.gaps),
            complete=self.complete,
            host_monotonic=np.array([frame.host_monotonic for frame in clocks], dtype=np.int64),
            ticks=np.array([frame.ticks for frame in clocks], dtype=np.int64),
            forces=np.array([force for _, force in self.forces]),
            force_times=count_seconds(self.forces, start),
        )

    def _stack_temperatures(self) -> FloatArray:
        """Stack the temperatures of all readings, shape (readings, channels) [degC]."""
        if len({degrees.size for _, degrees in self.temperatures}) > 1:
            raise RecordingError(f"{self.path}: damaged: the number of temperatures changes")
        return np.array([degrees for _, degrees in self.temperatures] or np.empty((0, 0)))

    def _collect_simulated(
        self, name: str, frames: list[ros_messages.FrameMessage], texels: int
    ) -> SimulatedForces | None:
        """Collect the forces of the frames of one array of n texels; None if no frame has any.

        Args:
            name: First part of the array's topics.
            frames: The frames.
            texels: Number of texels n.
        """
        given = {number: frame.texel_forces for number, frame in enumerate(frames) if frame.texel_forces.size}
        if not given and not any(topic.startswith(f"/{name}/") for topic in self.values):
            return None
        self.values[f"/{name}/frame"] = given
        wrench = self._stack(f"/{name}/wrench", len(frames), 6)
        return SimulatedForces(
            texel_forces=self._stack(f"/{name}/frame", len(frames), texels),
            pressures=self._stack(f"/{name}/pressures", len(frames), texels),
            net_force=wrench[:, :3],
            net_torque=wrench[:, 3:],
            tangential=self._stack(f"/{name}/tangential", len(frames), 2 * texels).reshape(-1, texels, 2),
            tangential_source=self.labels.get(f"/{name}/tangential", "").removeprefix(TANGENTIAL_LABEL),
        )

    def _stack(self, topic: str, frames: int, size: int) -> FloatArray:
        """Stack the values of a topic, shape (frames, size); NaN for frames without values."""
        stacked = np.full((frames, size), np.nan)
        for number, value in self.values.get(topic, {}).items():
            if value.shape != (size,):
                raise RecordingError(f"{self.path}: damaged: {topic} has {value.size} values, not {size}")
            if number < frames:
                stacked[number] = value
        return stacked


def _read_messages(path: Path) -> Iterator[tuple[str, Message]]:
    """Yield topic and content of every message in an MCAP file, in the order of the file."""
    from mcap.records import Channel, Message

    channels: dict[int, Channel] = {}
    for record in _read_records(path):
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            if record.channel_id not in channels:
                raise RecordingError(f"{path}: damaged: a message of an unknown channel")
            yield channels[record.channel_id].topic, record


def _read_records(path: Path) -> Iterator[McapRecord]:
    """Yield every record of an MCAP file, up to the last complete record if the file was not closed properly.

    Raises:
        RecordingError: If the file is missing, not an MCAP file or damaged.
    """
    try:
        from mcap.exceptions import EndOfFile
        from mcap.records import Chunk
        from mcap.stream_reader import StreamReader
    except ImportError as error:
        raise MissingExtraError("mcap") from error
    size, complete = _measure(path)
    budget = Budget(path, size)
    with open_recorded(path) as file, mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) as part:
        # `StreamReader` is declared to need a complete file object, but it only reads from it.
        limits: dict[str, Any] = {"validate_crcs": True, "record_size_limit": _LARGEST_RECORD, "emit_chunks": True}
        reader = StreamReader(cast("IO[bytes]", part), **limits)
        try:
            for record in reader.records:
                if isinstance(record, Chunk):
                    yield from unpack_records(record, budget)
                else:
                    yield record
        except EndOfFile as error:
            if complete or part.tell() < size:
                raise RecordingError(f"{path}: damaged near byte {part.tell()}") from error
        except RecordingError as error:
            if str(error).startswith(str(path)):
                raise
            raise RecordingError(f"{path}: damaged near byte {part.tell()}: {error}") from error
        except Exception as error:
            # The mcap library raises many kinds of exceptions on damaged files.
            raise RecordingError(f"{path}: damaged near byte {part.tell()}; accepted: an intact MCAP file") from error


def _measure(path: Path) -> tuple[int, bool]:
    """Return the number of bytes of an MCAP file that form complete records, and whether the file ends properly."""
    with open_recorded(path) as file:
        end = path.stat().st_size
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path}: not an MCAP file; expected one that `softcover record` or ROS 2 wrote")
        position = len(MAGIC)
        while position + _RECORD_HEAD_SIZE <= end:
            file.seek(position)
            head = file.read(_RECORD_HEAD_SIZE)
            after = position + _RECORD_HEAD_SIZE + int.from_bytes(head[1:], "little")
            if after > end:
                break
            position = after
            if head[0] == _FOOTER:
                file.seek(position)
                complete = file.read() == MAGIC
                return (end if complete else position), complete
    return position, False


def unpack_records(chunk: Chunk, budget: Budget) -> Iterator[McapRecord]:
    """Unpack a chunk and yield the records in it, one after the other.

    Args:
        chunk: The chunk.
        budget: What may still be unpacked from the file.

    Raises:
        RecordingError: If the chunk unpacks to another size than stated or than is accepted, fails its checksum, ends
            in the middle of a record, or exceeds the budget.
    """
    from mcap.stream_reader import breakup_chunk

    budget.spend(size=min(chunk.uncompressed_size, MOST_CHUNK_BYTES), records=1)
    content = _unpack(chunk)
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise RecordingError("a chunk fails its checksum")
    position = 0
    while position < len(content):
        size = int.from_bytes(content[position + 1 : position + _RECORD_HEAD_SIZE], "little")
        end = position + _RECORD_HEAD_SIZE + size
        if end > len(content):
            raise RecordingError("a chunk ends in the middle of a record")
        budget.spend(records=1)
        record = replace(chunk, compression="", uncompressed_crc=0, data=content[position:end])
        yield from breakup_chunk(record)
        position = end


def _unpack(chunk: Chunk) -> bytes:
    """Return the unpacked content of a chunk; never more than one byte beyond the stated size is unpacked."""
    # The libraries that the package mcap unpacks with.
    from mcap.stream_reader import lz4, zstandard  # type: ignore[attr-defined]

    size = chunk.uncompressed_size
    if size > MOST_CHUNK_BYTES:
        raise RecordingError(f"a chunk of {format_size(size)}; at most {format_size(MOST_CHUNK_BYTES)} are accepted")
    match chunk.compression:
        case "":
            content = chunk.data
        case "zstd":
            with zstandard.ZstdDecompressor(max_window_size=_MOST_WINDOW).stream_reader(chunk.data) as stream:
                content = stream.read(size + 1)
        case "lz4":
            content = lz4.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        case _:
            raise RecordingError("a chunk of unknown compression; accepted: none, zstd, lz4")
    if len(content) != size:
        raise RecordingError(f"a chunk does not unpack to the {size} bytes that it states")
    return content
