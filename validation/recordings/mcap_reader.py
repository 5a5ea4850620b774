"""Reads the MCAP files that `mcap_writer` writes, complete or truncated, and refuses damaged ones.

The reader checks the checksum of each chunk (group of messages), the checksum over all data of a complete file, and the
sequence numbers of the frames.  A killed recorder leaves a file without an end.  Such a file is read up to its last
complete chunk, and the recording is marked as not complete.
"""

from __future__ import annotations

import io
import mmap
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

import numpy as np

from meshes import atomic_file
from meshes.bounded_file import format_size
from validation.extras import MissingExtraError
from validation.recordings import mcap_writer, recording
from validation.recordings.recording import Budget, FloatArray, Recording, RecordingError, SimulatedForces

if TYPE_CHECKING:
    from mcap.records import Chunk, McapRecord, Message

#: First and last bytes of every MCAP file.
MAGIC = b"\x89MCAP0\r\n"
#: Number of bytes before the content of an MCAP record: one for the kind of the record, eight for its length.
_RECORD_HEAD_SIZE = 9
#: Code of the kind of the last record (footer) of a complete MCAP file.
_FOOTER = 0x02
#: Largest number of bytes that a chunk may unpack to.  Chunks written by this program hold about 1 MiB.
MOST_CHUNK_BYTES = 2**26
#: Largest memory that unpacking a chunk may need besides the unpacked bytes [bytes].
_MOST_WINDOW = 2**27
#: Largest size of a record that is read [bytes].  A damaged length field could otherwise allocate all memory.  Chunks
#: written by this program hold about 1 MiB.
_LARGEST_RECORD = 2**27


@dataclass(frozen=True, slots=True)
class _Received:
    """A message of a recording: its content, its number in its topic, and its times, UTC since 1970 [ns]."""

    content: Any
    number: int
    logged: int
    published: int


#: Messages by topic.
_Messages = dict[str, list[_Received]]


def read(path: str | Path) -> Recording:
    """Read a recording from an MCAP file that this program wrote.

    Args:
        path: The MCAP file.

    Raises:
        RecordingError: If the file is missing, damaged, or was written by another program.
    """
    path = Path(path)
    complete = is_complete(path)
    budget, messages = Budget(path, path.stat().st_size), defaultdict[str, list[_Received]](list)
    for topic, message in _read_messages(path):
        budget.spend_message(topic, len(message.data), (message.log_time, message.publish_time))
        kind, before = mcap_writer.find_kind(topic), messages[topic]
        if kind is None or topic == mcap_writer.RAW_TOPIC or topic.endswith("/image"):
            continue
        if topic.endswith("/frame") and message.sequence != len(before):
            raise RecordingError(
                f"{path}: damaged: frame {message.sequence} of {topic} follows frame {len(before) - 1}"
            )
        try:
            content = mcap_writer.load_types().deserialize_cdr(message.data, kind)
        except Exception as error:  # The libraries raise many kinds of exceptions on damaged messages.
            raise RecordingError(f"{path}: damaged: a message of {topic} cannot be read") from error
        before.append(_Received(content, message.sequence, message.log_time, message.publish_time))
    return _make_recording(path, messages, complete=complete)


def is_own_recording(path: str | Path) -> bool:
    """Return whether this program wrote an MCAP file; False for MCAP files of other programs.

    Raises:
        RecordingError: If the file is not an MCAP file or is damaged near its start.
    """
    from mcap.records import Channel

    channels = (record for record in _read_records(Path(path)) if isinstance(record, Channel))
    first = next(channels, None)
    return first is not None and first.topic == mcap_writer.SETUP_TOPIC and first.message_encoding == "cdr"


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


def _make_recording(path: Path, messages: _Messages, *, complete: bool) -> Recording:
    """Make a recording from all messages of an MCAP file that this program wrote."""
    if not messages[mcap_writer.SETUP_TOPIC]:
        raise RecordingError(f"{path}: an MCAP file without the labels of a softcover recording")
    labels, arrays = mcap_writer.decode_labels(str(messages[mcap_writer.SETUP_TOPIC][-1].content.data), path)
    names = mcap_writer.name_topics(len(arrays))
    series = [messages[f"/{name}/frame"] for name in names]
    # A recorder that was killed between the frames of two arrays leaves one more frame of the first arrays.  The
    # additional frames are left out.
    count = min(len(frames) for frames in series)
    clocks = series[0][:count]
    # In a file without frames, times count from the start of the recording.
    start = clocks[0].published if count else labels.clock.start_ns
    recorded = []
    for name, array, frames in zip(names, arrays, series, strict=True):
        counts = [each.content.counts for each in frames[:count]]
        if any(each.size != array.texels.count for each in counts):
            raise RecordingError(f"{path}: damaged: a frame has other texels than {array.texels.name}")
        stacked = np.array(counts, dtype=np.int32).reshape(count, array.texels.count) - np.int32(array.offset)
        forces = _collect_forces(path, messages, name, count, array.texels.count)
        recorded.append(replace(array, counts=stacked, simulated=forces))
    warm, pushed = messages[mcap_writer.TEMPERATURE_TOPIC], messages[mcap_writer.FORCE_TOPIC]
    temperatures = [np.array(each.content.data, dtype=np.float64) for each in warm]
    if len({degrees.size for degrees in temperatures}) > 1:
        raise RecordingError(f"{path}: damaged: the number of temperatures changes")
    return Recording(
        path=path,
        sha256=recording.hash_contents(path),
        serial=labels.serial,
        started=recording.convert_to_utc(start),
        times=recording.count_seconds([each.published for each in clocks], start),
        arrays=tuple(recorded),
        temperatures=np.array(temperatures or np.empty((0, 0))),
        temperature_times=recording.count_seconds([each.logged for each in warm], start),
        setup=labels.setup,
        gaps=tuple(status.message for gap in messages[mcap_writer.GAP_TOPIC] for status in gap.content.status),
        complete=complete,
        host_monotonic=np.array([each.content.host_monotonic for each in clocks], dtype=np.int64),
        ticks=np.array([each.content.device_ticks for each in clocks], dtype=np.int64),
        forces=np.array([each.content.wrench.force.z for each in pushed], dtype=np.float64),
        force_times=recording.count_seconds([each.logged for each in pushed], start),
    )


def _collect_forces(path: Path, messages: _Messages, name: str, frames: int, texels: int) -> SimulatedForces | None:
    """Collect the forces of the frames of one array of n texels; None if no frame has any.

    Args:
        path: The file, for error messages.
        messages: All messages.
        name: First part of the array's topics.
        frames: Number of frames.
        texels: Number of texels n.
    """

    def stack(end: str, size: int, read_values: Callable[[Any], Any]) -> FloatArray:
        """Stack the values of a topic, shape (frames, size); NaN for frames without values."""
        stacked, topic = np.full((frames, size), np.nan), f"/{name}/{end}"
        for each in messages[topic]:
            values = np.asarray(read_values(each.content), dtype=np.float64)
            if end == "frame" and not values.size:
                continue
            if values.shape != (size,):
                raise RecordingError(f"{path}: damaged: {topic} has {values.size} values, not {size}")
            if each.number < frames:
                stacked[each.number] = values
        return stacked

    texel_forces = stack("frame", texels, lambda frame: frame.texel_forces)
    ends = ("pressures", "wrench", "tangential")
    if np.isnan(texel_forces).all() and not any(messages[f"/{name}/{end}"] for end in ends):
        return None
    dimensions = [each.content.layout.dim for each in messages[f"/{name}/tangential"][-1:]]
    label = str(dimensions[0][0].label) if dimensions and dimensions[0] else ""
    return SimulatedForces(
        texel_forces=texel_forces,
        pressures=stack("pressures", texels, lambda message: message.data),
        net_force=stack("wrench", 3, lambda message: [getattr(message.wrench.force, axis) for axis in "xyz"]),
        net_torque=stack("wrench", 3, lambda message: [getattr(message.wrench.torque, axis) for axis in "xyz"]),
        tangential=stack("tangential", 2 * texels, lambda message: message.data).reshape(-1, texels, 2),
        tangential_source=label.removeprefix(mcap_writer.TANGENTIAL_LABEL),
    )


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
    with recording.open_recorded(path) as file, mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) as part:
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
    with recording.open_recorded(path) as file:
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
        budget: Limits on the content unpacked from the file.

    Raises:
        RecordingError: If the chunk unpacks to a size other than stated or larger than accepted, fails its checksum,
            ends in the middle of a record, or exceeds the budget.
    """
    from mcap.stream_reader import breakup_chunk

    budget.spend(size=min(chunk.uncompressed_size, MOST_CHUNK_BYTES), records=1)
    content = _unpack(chunk)
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise RecordingError("a chunk fails its checksum")
    position = 0
    while position < len(content):
        position += _RECORD_HEAD_SIZE + int.from_bytes(content[position + 1 : position + _RECORD_HEAD_SIZE], "little")
        if position > len(content):
            raise RecordingError("a chunk ends in the middle of a record")
        budget.spend(records=1)
    yield from breakup_chunk(replace(chunk, compression="", data=content))


def _unpack(chunk: Chunk) -> bytes:
    """Return the unpacked content of a chunk; never more than one byte beyond the stated size is unpacked."""
    # The package mcap unpacks chunks with these two libraries.
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
