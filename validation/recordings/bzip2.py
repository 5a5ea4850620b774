"""Unpacks a bzip2 file in pieces of bounded size.  The file must hold exactly one complete bzip2 stream."""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from pathlib import Path

from validation.recordings.recording import RecordingError

#: Largest number of bytes that are read from the file, or unpacked, at a time, which bounds the memory in use.
PIECE_BYTES = 2**16


def unpack(path: Path, *, limit: int) -> Iterator[bytes]:
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
    if not path.is_file():
        raise RecordingError(f"{path}: no such file; expected a recording")
    try:
        file = path.open("rb")
    except PermissionError as error:
        raise RecordingError(f"{path}: no permission to read it; expected a readable recording") from error
    with file:
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
