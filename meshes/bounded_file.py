"""Reading of files from strangers: regular files only, at most a given number of bytes, as data that is never run.

The other readers of this project take their bytes, TOML tables and JSON values from here, so that the limits on size
and depth hold everywhere.
"""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import IO, Any

#: Largest accepted depth of tables and lists in each other in a TOML or JSON text [-].
MOST_DEPTH = 32
#: Largest accepted size of a whole number in a TOML or JSON text; TOML itself asks for 64 bits [bits].
_MOST_BITS = 64
#: Largest accepted number of dots in one line of a TOML text, without those in numbers [-].  The time to read a key of
#: n parts, `a.b.c = 1`, grows with the square of n.
_MOST_DOTS = 100
#: A decimal number in a line of TOML, between blanks, brackets or commas.
_DECIMAL = re.compile(r"(?<![^\s,\[=])[+-]?[0-9][0-9_]{0,30}\.[0-9_]{1,40}(?:[eE][+-]?[0-9]{1,5})?(?![^\s,\]}#])")


class FileLimitError(ValueError):
    """A file is larger, deeper or of another type than is accepted; the message does not name the file."""


def open_regular(path: Path) -> IO[bytes]:
    """Open a regular file for reading; a pipe or a device is refused and never waited for.

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
        path: The file.
        most: Largest number of bytes that is accepted.

    Raises:
        OSError: If the file does not exist or cannot be read.
        FileLimitError: If it is no regular file, or larger.
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
        path: The file.
        most: Largest number of bytes that is accepted.

    Raises:
        OSError: If the file does not exist or cannot be read.
        FileLimitError: If it is no regular file, larger, or no text in UTF-8.
    """
    try:
        return read_bytes(path, most=most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileLimitError(f"is not text in UTF-8 (byte {error.start})") from None


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises:
        FileLimitError: If it is no TOML, or deeper than `MOST_DEPTH`, or holds numbers that are too long.
    """
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") > _MOST_DOTS and line.count(".") - len(_DECIMAL.findall(line)) > _MOST_DOTS:
            raise FileLimitError(f"line {number} has more than {_MOST_DOTS} dots besides those in numbers")
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileLimitError(f"not readable as TOML: {_reason(error)}") from None
    check_values(tables)
    return tables


def parse_json(text: str | bytes) -> Any:  # noqa: ANN401 -- JSON
    """Parse a JSON text.

    Raises:
        FileLimitError: If it is no JSON, or deeper than `MOST_DEPTH`, or holds numbers that are too long.
    """
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileLimitError(f"not readable as JSON: {_reason(error)}") from None
    check_values(values)
    return values


def check_values(values: Any) -> None:  # noqa: ANN401 -- TOML or JSON
    """Check the depth of parsed values, and the length of whole numbers in them.

    Raises:
        FileLimitError: If tables and lists are deeper than `MOST_DEPTH`, or a whole number has more than 64 bits.
    """
    level = [values]
    for _ in range(MOST_DEPTH):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                inner.extend(value.values())
            elif isinstance(value, list):
                inner.extend(value)
            elif isinstance(value, int) and value.bit_length() > _MOST_BITS:
                raise FileLimitError(f"holds a whole number of more than {_MOST_BITS} bits")
        level = inner
        if not level:
            return
    raise FileLimitError(f"has tables or lists more than {MOST_DEPTH} deep")


def format_size(count: int) -> str:
    """Format a number of bytes for a message."""
    return f"{count / 2**20:.4g} MiB" if count >= 2**20 else f"{count} bytes"


def _reason(error: Exception) -> str:
    return f"tables or lists more than {MOST_DEPTH} deep" if isinstance(error, RecursionError) else str(error)
