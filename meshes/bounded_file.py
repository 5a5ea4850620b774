"""Reading of untrusted files of limited size, as text, TOML, JSON, npz or npy, without executing content.

All other readers of this project take their bytes, tables and arrays from this module, so that the same limits on size
and depth hold for them.
"""

from __future__ import annotations

import errno
import io
import json
import math
import os
import re
import stat
import tomllib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

#: Pattern of a decimal number in a line of TOML, between blanks, brackets or commas.
_DECIMAL = re.compile(r"(?<![^\s,\[=])[+-]?[0-9][0-9_]{0,30}\.[0-9_]{1,40}(?:[eE][+-]?[0-9]{1,5})?(?![^\s,\]}#])")
#: Kinds of numpy types that are accepted: truth values, numbers and texts.
_KINDS = "biufcUS"


@dataclass(frozen=True, kw_only=True)
class ContentLimits:
    """Limits on the content of a file."""

    #: Largest nesting depth of tables and lists in a TOML or JSON text [-].  Files of this project have a depth of 6.
    depth: int = 32
    #: Largest size of an integer in a TOML or JSON text [bits].  The TOML standard requires 64 bits.
    bits: int = 64
    #: Largest number of dots in one line of TOML, apart from decimal points [-].  Dots separate the parts of a key, and
    #: reading a key of n parts takes a time of order n^2.
    dots: int = 100
    #: Most arrays in an npz file, unless a caller accepts more [-]; files of this project have 20.
    arrays: int = 64
    #: Size that is counted for a number of a smaller type [bytes].  Callers may convert numbers to 64 bits.
    number_bytes: int = 8
    #: Largest header of an array, which states its type and shape [bytes].  Headers of plain arrays have 128 bytes.
    head_bytes: int = 4096


LIMITS = ContentLimits()


class FileLimitError(ValueError):
    """A file is too large, nested too deeply or of a type that is not accepted; the message does not name the file."""


def open_regular(path: Path) -> IO[bytes]:
    """Open a regular file for reading.  A pipe or a device is refused without waiting for it.

    Raises:
        OSError: If the file does not exist or cannot be read; the error holds the path.
        FileLimitError: If the path names something else than a regular file, or holds a NUL character.
    """
    if "\0" in str(path):
        raise FileLimitError("has a NUL character in its name; accepted: a file")
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    kind = os.fstat(handle).st_mode
    if stat.S_ISREG(kind):
        return os.fdopen(handle, "rb")
    os.close(handle)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, "is a folder; name a file", str(path))
    raise FileLimitError("is no regular file; accepted: a file, no pipe or device")


def read_bytes(path: Path, *, most: int) -> bytes:
    """Read a regular file.

    Args:
        path: Path of the file.
        most: Largest number of bytes that is accepted.

    Raises:
        OSError: If the file does not exist or cannot be read.
        FileLimitError: If the path names no regular file, or the file is larger than `most`.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > most else file.read(most + 1)
    if size > most or len(content) > most:
        raise FileLimitError(f"has more than the {format_size(most)} accepted")
    return content


def read_text(path: Path, *, most: int) -> str:
    """Read a regular text file in UTF-8, with or without a byte order mark.

    Args:
        path: Path of the file.
        most: Largest number of bytes that is accepted.

    Raises:
        OSError: If the file does not exist or cannot be read.
        FileLimitError: If the path names no regular file, or the file is larger than `most` or not encoded in UTF-8.
    """
    try:
        return read_bytes(path, most=most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileLimitError(f"is not text in UTF-8 (byte {error.start})") from None


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises:
        FileLimitError: If the text is not TOML, is nested deeper than `LIMITS.depth`, or holds numbers that are too
            long.
    """
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") > LIMITS.dots and line.count(".") - len(_DECIMAL.findall(line)) > LIMITS.dots:
            raise FileLimitError(f"line {number} has more than {LIMITS.dots} dots besides those in numbers")
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileLimitError(f"not readable as TOML: {_reason(error)}") from None
    check_values(tables)
    return tables


def parse_json(text: str | bytes) -> Any:  # noqa: ANN401 -- JSON
    """Parse a JSON text.

    Raises:
        FileLimitError: If the text is not JSON, is nested deeper than `LIMITS.depth`, or holds numbers that are too
            long.
    """
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileLimitError(f"not readable as JSON: {_reason(error)}") from None
    check_values(values)
    return values


def check_values(values: Any) -> None:  # noqa: ANN401 -- TOML or JSON
    """Check the nesting depth of parsed values, and the length of integers in them.

    Raises:
        FileLimitError: If tables and lists are nested deeper than `LIMITS.depth`, or an integer has more than 64 bits.
    """
    level = [values]
    for _ in range(LIMITS.depth):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                inner.extend(value.values())
            elif isinstance(value, list):
                inner.extend(value)
            elif isinstance(value, int) and value.bit_length() > LIMITS.bits:
                raise FileLimitError(f"holds a whole number of more than {LIMITS.bits} bits")
        level = inner
        if not level:
            return
    raise FileLimitError(f"has tables or lists more than {LIMITS.depth} deep")


def format_size(count: int) -> str:
    """Format a number of bytes for a message."""
    return f"{count / 2**20:.4g} MiB" if count >= 2**20 else f"{count} bytes"


def _reason(error: Exception) -> str:
    return f"tables or lists more than {LIMITS.depth} deep" if isinstance(error, RecursionError) else str(error)


def pack_npz(arrays: Mapping[str, npt.ArrayLike]) -> bytes:
    """Return the bytes of an npz file of arrays.  They depend only on names and values, not on order or time.

    Args:
        arrays: Arrays by name, of any shape.

    Raises:
        ValueError: If an array holds Python objects.
    """
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, values in sorted(arrays.items()):
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asarray(values, order="C"), allow_pickle=False)
            # A new ZipInfo has a fixed date.  With a name as argument, `ZipFile.writestr` would store the present time.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), content.getbuffer(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def unpack_npz(content: bytes, *, most: int, most_arrays: int = LIMITS.arrays) -> dict[str, npt.NDArray[np.generic]]:
    """Return the arrays in the bytes of an npz file, by name.

    Sizes, types and shapes are checked before memory is allocated for an array.

    Args:
        content: Bytes of the npz file.
        most: Largest accepted size of all arrays together; numbers of less than 8 bytes count as 8 [bytes].
        most_arrays: Largest accepted number of arrays [-].

    Raises:
        FileLimitError: If the bytes are no npz file, are damaged or encrypted, are compressed by a method other than
            deflate, hold more bytes than accepted, or hold Python objects.
    """
    arrays: dict[str, npt.NDArray[np.generic]] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            if len(entries) > most_arrays:
                raise FileLimitError(f"holds {len(entries)} arrays; at most {most_arrays} are accepted")  # noqa: TRY301
            for entry in entries:
                array = _unpack_array(archive, entry, most)
                most -= array.size * max(array.itemsize, LIMITS.number_bytes)
                arrays[entry.filename.removesuffix(".npy")] = array
    except FileLimitError:
        raise
    except Exception as error:  # noqa: BLE001 -- zipfile and numpy raise many kinds of errors on damaged files
        raise FileLimitError(f"not a readable npz file: {error}") from None
    return arrays


def _unpack_array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, most: int) -> npt.NDArray[np.generic]:
    """Unpack one array of at most `most` bytes from an npz file; damaged bytes raise errors of many types."""
    if entry.flag_bits & 1 or entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise FileLimitError("is encrypted or packed by another method than deflate")
    if not entry.filename.endswith(".npy"):
        raise FileLimitError("holds something else than arrays")
    with archive.open(entry) as packed:
        return _read_array(packed, entry.file_size, most)


def unpack_npy(content: bytes, *, most: int) -> npt.NDArray[np.generic]:
    """Return the array in the bytes of an npy file.  Its size, type and shape are checked before memory is allocated.

    Args:
        content: Bytes of the npy file.
        most: Largest accepted size of the array; numbers of less than 8 bytes count as 8 [bytes].

    Raises:
        FileLimitError: If the bytes are no npy file, are damaged, or hold more bytes than accepted or Python objects.
    """
    try:
        return _read_array(io.BytesIO(content), len(content), most)
    except FileLimitError:
        raise
    except Exception as error:  # noqa: BLE001 -- numpy raises many kinds of errors on damaged files
        raise FileLimitError(f"not a readable npy file: {str(error)[:80]}") from None


def _read_array(packed: IO[bytes], total: int, most: int) -> npt.NDArray[np.generic]:
    """Read one array of at most `most` bytes from a file of `total` bytes; damaged bytes raise errors of many types."""
    head = io.BytesIO(packed.read(LIMITS.head_bytes))
    if np.lib.format.read_magic(head) != (1, 0):
        raise FileLimitError("holds an array of another version of the format; accepted: 1.0")
    shape, by_columns, kind = np.lib.format.read_array_header_1_0(head, max_header_size=LIMITS.head_bytes)
    count = math.prod(shape)
    if kind.kind not in _KINDS or kind.hasobject or min(shape, default=0) < 0:
        raise FileLimitError(f"holds an array of type {str(kind)[:40]}; accepted: numbers and texts")
    if count * max(kind.itemsize, LIMITS.number_bytes) > most:
        raise FileLimitError(f"unpacks to more than the {format_size(most)} that are accepted here")
    begun, size = head.read(), count * kind.itemsize
    if total != head.tell() - len(begun) + size:
        raise FileLimitError("holds an array whose size is not that of its shape")
    values = np.frombuffer(begun + packed.read(size), dtype=kind, count=count)
    return values.reshape(shape, order="F" if by_columns else "C").copy(order="K")
