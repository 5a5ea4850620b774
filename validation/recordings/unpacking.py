"""Opens the files of recordings, and unpacks bzip2 files and chunks (groups of messages) of MCAP files in limits.

Bags of other programs are unpacked by the library rosbags, which has no limits of its own; `bag_limits` lets the
operating system hold it within limits.
"""

from __future__ import annotations

import bz2
import contextlib
import dataclasses
import itertools
import os
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING

from meshes.bounded_file import LIMITS, FileLimitError, format_size, open_regular, read_text
from validation.recordings.recording import RecordingError

if TYPE_CHECKING:
    from mcap.records import Chunk, McapRecord

#: Largest number of bytes that a chunk may unpack to; the chunks that this program writes hold about 1 MiB.
MOST_CHUNK_BYTES = 2**26
#: Largest amount of messages that is collected: this many bytes, and this many times the size of the file.  Frames of
#: an idle sensor unpack to 30 times their size in the file.
_MOST_COLLECTED, _MOST_RATIO = 2**28, 64
#: Memory that a collected message takes besides its data [bytes].
_MESSAGE_BYTES = 300
#: Latest time of a message, in the year 2262, the largest that 64 bits hold [ns since 1970].
_LATEST = 2**63 - 1
#: Largest size of a bag of another program with all its files, number of its files, and size of its metadata in YAML,
#: which is parsed slowly [bytes].
_MOST_BAG, _MOST_BAG_FILES, _MOST_METADATA = 2**32, 1000, 2**18
#: Memory that reading such a bag may add: this many bytes, and this many times the size of the bag [bytes], [-].
_BAG_MEMORY, _BAG_RATIO = 400 * 2**20, 4
#: Number of bytes before the content of an MCAP record: one for the kind of the record, eight for its length.
_RECORD_HEAD_SIZE = 9
#: Largest memory that unpacking may need besides the result [bytes].
_MOST_WINDOW = 2**27
#: Largest number of bytes that are read from the file, or unpacked, at a time, which bounds the memory in use.
PIECE_BYTES = 2**16


def open_recorded(path: Path) -> IO[bytes]:
    """Open the file of a recording; it must be a regular file.

    Raises:
        RecordingError: If the file is missing, cannot be read or is no regular file.
    """
    try:
        return open_regular(path)
    except (FileNotFoundError, IsADirectoryError):
        raise RecordingError(f"{path}: no such file; expected a recording") from None
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}; expected a recording") from error
    except FileLimitError as error:
        raise RecordingError(f"{path}: {error}") from None


class MessageBudget:
    """Bounds the messages that are collected from a recording, by their times, number and bytes."""

    def __init__(self, path: Path, size: int) -> None:
        """Begin with the messages that a recording of a given size may hold [bytes]."""
        self._path, self._left = path, _MOST_COLLECTED + _MOST_RATIO * size

    def spend(self, topic: str, size: int, times: tuple[int, ...]) -> None:
        """Count a message.

        Args:
            topic: Topic of the message.
            size: Size of its data [bytes].
            times: Its times [ns since 1970].

        Raises:
            RecordingError: If the messages are more than a recording of its size holds, or a time is impossible.
        """
        self._left -= size + _MESSAGE_BYTES
        if self._left < 0:
            raise RecordingError(f"{self._path}: holds far more messages than a recording of its size")
        if not 0 <= min(times) <= max(times) <= _LATEST:
            raise RecordingError(f"{self._path}: damaged: a message of {topic} has no possible time")


def measure_bag(path: Path) -> int:
    """Return the size of a bag of another program with all its files [bytes].

    Raises:
        RecordingError: If it is missing, too large, or holds something else than regular files.
    """
    try:
        found = list(itertools.islice(path.iterdir(), _MOST_BAG_FILES + 1)) if path.is_dir() else [path]
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}; expected a ROS bag") from error
    sizes = {}
    for file in found:
        if file == path or not file.is_dir():
            with open_recorded(file) as opened:
                sizes[file] = os.fstat(opened.fileno()).st_size
    metadata = sizes.get(path / "metadata.yaml", 0)
    if len(found) > _MOST_BAG_FILES or sum(sizes.values()) > _MOST_BAG or metadata > _MOST_METADATA:
        raise RecordingError(
            f"{path}: too large; accepted: {format_size(_MOST_BAG)} in {_MOST_BAG_FILES} files, metadata.yaml of "
            f"{format_size(_MOST_METADATA)}"
        )
    if metadata:
        _check_depth(path / "metadata.yaml")
    return sum(sizes.values())


def _check_depth(path: Path) -> None:
    """Refuse a YAML file with deep brackets, whose parsing time grows with the square of the depth."""
    try:
        text = read_text(path, most=_MOST_METADATA)
    except FileLimitError as error:
        raise RecordingError(f"{path}: {error}") from None
    steps = (1 if bracket in "[{" else -1 for bracket in re.findall(r"[][{}]", text))
    if max(itertools.accumulate(steps), default=0) > LIMITS.depth:
        raise RecordingError(f"{path}: has brackets more than {LIMITS.depth} deep")


def unpack_records(chunk: Chunk) -> Iterator[McapRecord]:
    """Unpack a chunk and yield the records in it, one after the other.

    Raises:
        RecordingError: If the chunk unpacks to another size than stated or than is accepted, fails its checksum, or
            ends in the middle of a record.
    """
    from mcap.stream_reader import breakup_chunk

    content = _unpack(chunk)
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise RecordingError("a chunk fails its checksum")
    position = 0
    while position < len(content):
        size = int.from_bytes(content[position + 1 : position + _RECORD_HEAD_SIZE], "little")
        end = position + _RECORD_HEAD_SIZE + size
        if end > len(content):
            raise RecordingError("a chunk ends in the middle of a record")
        record = dataclasses.replace(chunk, compression="", uncompressed_crc=0, data=content[position:end])
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


def unpack_bzip2(path: Path, *, limit: int) -> Iterator[bytes]:
    """Yield the unpacked bytes of a file in pieces of at most `PIECE_BYTES`.

    Args:
        path: The bzip2 file.
        limit: Largest number of unpacked bytes that is accepted; a larger file is refused.

    Raises:
        RecordingError: If the file is missing, is not a bzip2 file, is damaged, truncated or too large, or if other
            bytes follow the bzip2 stream.
    """
    decompressor = bz2.BZ2Decompressor()
    total = 0
    for packed in _read_pieces(path):
        if decompressor.eof:
            raise RecordingError(f"{path}: bytes follow the end of the bzip2 stream; expected none")
        for piece in _decompress(decompressor, packed, path):
            total += len(piece)
            if total > limit:
                raise RecordingError(f"{path}: unpacks to more than the {limit} bytes accepted")
            yield piece
    if not decompressor.eof:
        raise RecordingError(
            f"{path}: truncated: the bzip2 stream stops after {total} unpacked bytes; expected a complete file"
        )
    if decompressor.unused_data:
        raise RecordingError(f"{path}: bytes follow the end of the bzip2 stream; expected none")


def _read_pieces(path: Path) -> Iterator[bytes]:
    with open_recorded(path) as file:
        while piece := file.read(PIECE_BYTES):
            yield piece


def _decompress(decompressor: bz2.BZ2Decompressor, packed: bytes, path: Path) -> Iterator[bytes]:
    while True:
        try:
            piece = decompressor.decompress(packed, max_length=PIECE_BYTES)
        except OSError as error:
            raise RecordingError(f"{path}: damaged, or no bzip2 file; expected an intact one") from error
        if piece:
            yield piece
        if decompressor.eof or decompressor.needs_input:
            return
        packed = b""


@contextlib.contextmanager
def bag_limits(path: Path, size: int) -> Iterator[None]:
    """Limit what this process may add to its memory, and the size of files that it writes, while a bag is read.

    The limits are those of the operating system, so they hold whatever a library unpacks; they count for all threads.
    They are set on Linux only.

    Args:
        path: The bag, for the error message.
        size: Its size [bytes].

    Raises:
        RecordingError: If the bag unpacks to more.
    """
    most = _BAG_MEMORY + _BAG_RATIO * size
    try:
        import resource

        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    except (ImportError, OSError):
        yield
        return
    before = {kind: resource.getrlimit(kind) for kind in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE)}
    wanted = {resource.RLIMIT_AS: used + most, resource.RLIMIT_FSIZE: most}
    try:
        for kind, (soft, hard) in before.items():
            lowest = min((each for each in (soft, hard) if each != resource.RLIM_INFINITY), default=wanted[kind])
            resource.setrlimit(kind, (min(wanted[kind], lowest), hard))
        yield
    except MemoryError:
        raise RecordingError(f"{path}: unpacks to more than the {format_size(most)} accepted for its size") from None
    finally:
        for kind, limits in before.items():
            resource.setrlimit(kind, limits)
