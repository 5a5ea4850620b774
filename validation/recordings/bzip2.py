"""Unpack a bzip2 file in pieces of bounded size, accepting exactly one whole stream."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator
from pathlib import Path

from validation.recordings.recording import RecordingError

_CHUNK = 2**16


def unpacked(path: Path, *, limit: int, seen: Callable[[bytes], object]) -> Iterator[bytes]:
    """Yield the unpacked bytes of a file, at most 64 KiB at a time.

    Args:
        path: The file.
        limit: Most bytes that the file may unpack to.
        seen: Called with every piece of the packed file (to hash it).

    Raises:
        RecordingError: If the file is missing, no bzip2 stream, damaged, truncated, too large or followed by
            other bytes.
    """
    unpacker = bz2.BZ2Decompressor()
    total = 0
    for chunk in _chunks(path):
        seen(chunk)
        if unpacker.eof:
            raise RecordingError(f"{path}: bytes follow the end of the bzip2 stream; expected none")
        for piece in _pieces(unpacker, chunk, path):
            total += len(piece)
            if total > limit:
                raise RecordingError(f"{path}: unpacks to more than the {limit} bytes accepted")
            yield piece
    if not unpacker.eof:
        raise RecordingError(f"{path}: truncated: the bzip2 stream stops after {total} unpacked bytes")
    if unpacker.unused_data:
        raise RecordingError(f"{path}: bytes follow the end of the bzip2 stream; expected none")


def _pieces(unpacker: bz2.BZ2Decompressor, chunk: bytes, path: Path) -> Iterator[bytes]:
    data = chunk
    while True:
        try:
            piece = unpacker.decompress(data, max_length=_CHUNK)
        except OSError as error:
            raise RecordingError(f"{path}: damaged, or no bzip2 file; expected an intact one") from error
        if piece:
            yield piece
        if unpacker.eof or unpacker.needs_input:
            return
        data = b""


def _chunks(path: Path) -> Iterator[bytes]:
    if not path.is_file():
        raise RecordingError(f"{path}: no such file; expected a recording")
    try:
        file = path.open("rb")
    except PermissionError as error:
        raise RecordingError(f"{path}: may not be read; expected a readable recording") from error
    with file:
        while chunk := file.read(_CHUNK):
            yield chunk
