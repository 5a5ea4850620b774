"""The two files of a parameters folder, `parameters.toml` and `cover.npz`: replaced together, read within limits."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np

from fastmodel.errors import ParametersError
from meshes import atomic_file
from meshes.array_types import FloatArray
from meshes.bounded_file import FileLimitError, parse_toml, read_bytes, unpack_npz

#: Names of the two files in a parameters folder.
TOML_NAME = "parameters.toml"
NPZ_NAME = "cover.npz"
#: Largest accepted size of the TOML file; texels anywhere in space take most of it, ten thousand about 1.5 MiB [bytes].
_MOST_TOML_BYTES = 3 * 2**20
#: Largest accepted size of all tables of the npz file together, besides the operator of n x n numbers [bytes].
_MOST_TABLE_BYTES = 2**27


def replace_pair(folder: Path, packed: bytes, text: bytes) -> None:
    """Replace `parameters.toml` and `cover.npz` such that a reader finds a matching pair at every moment.

    The old TOML file contains the hash of the old npz file, so a copy of the old npz file is kept until the TOML file
    is replaced too.

    Args:
        folder: The parameters folder.
        packed: New content of the npz file.
        text: New content of the TOML file.

    Raises:
        OSError: If the folder cannot be written; the old pair of files can still be read then.
    """
    tables = folder / NPZ_NAME
    if tables.exists() and (old := tables.read_bytes()) != packed:
        atomic_file.replace(_path_of_copy(tables, hashlib.sha256(old).hexdigest()), [old])
    atomic_file.replace(tables, [packed])
    atomic_file.replace(folder / TOML_NAME, [text])
    for copy in tables.parent.glob(f"{tables.stem}.????????????????{tables.suffix}"):
        copy.unlink(missing_ok=True)
    atomic_file.sweep(folder)


def _path_of_copy(tables: Path, sha256: str) -> Path:
    """Return the path of the copy of an old npz file with a given hash; it exists while both files are replaced."""
    return tables.with_name(f"{tables.stem}.{sha256[:16]}{tables.suffix}")


def read_values(path: Path) -> dict[str, Any]:
    """Read the TOML file.

    Raises:
        ParametersError: If it cannot be read, or is no TOML within the limits on size and depth.
    """
    content = _read_bytes(path, _MOST_TOML_BYTES)
    try:
        return parse_toml(content.decode("utf-8-sig"))
    except (FileLimitError, UnicodeDecodeError) as error:
        raise ParametersError(f"{path}: not readable as TOML: {error}") from error


def read_tables(folder: Path, sha256: object, texels: int) -> dict[str, FloatArray]:
    """Read the tables of the npz file.

    Args:
        folder: The parameters folder.
        sha256: Hash of the npz file that the TOML file states.
        texels: Number of texels n, on which the largest accepted size depends.

    Raises:
        ParametersError: If the file cannot be read, has another hash, is damaged or too large.
        ValueError: If the stated hash is none.
    """
    if not isinstance(sha256, str) or not re.fullmatch("[0-9a-f]{64}", sha256):
        raise ValueError("sha256 must be a text of 64 hexadecimal digits")
    path, most = folder / NPZ_NAME, _MOST_TABLE_BYTES + 8 * texels**2
    packed = _read_bytes(path, most)
    if hashlib.sha256(packed).hexdigest() != sha256:
        copy = _path_of_copy(path, sha256)
        if not copy.exists():
            raise ParametersError(f"{path}: does not belong to {TOML_NAME} (sha256 differs); write both anew")
        packed = _read_bytes(copy, most)
    try:
        unpacked = unpack_npz(packed, most=most)
    except FileLimitError as error:
        raise ParametersError(f"{path}: {error}") from error
    return {name: np.asarray(table, dtype=np.float64) for name, table in unpacked.items()}


def _read_bytes(path: Path, most: int) -> bytes:
    """Read a file of at most `most` bytes; raise a `ParametersError` if it cannot be read or is larger."""
    try:
        return read_bytes(path, most=most)
    except FileLimitError as error:
        raise ParametersError(f"{path}: {error}") from error
    except OSError as error:
        message = f"{path}: {error.strerror}; a folder with {TOML_NAME} and {NPZ_NAME} is needed"
        raise ParametersError(message) from error
