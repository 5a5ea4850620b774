"""Packing of numpy arrays into the bytes of an npz file, and unpacking within limits."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from typing import IO

import numpy as np
import numpy.typing as npt

from meshes.bounded_file import FileLimitError, format_size

#: Largest accepted number of arrays in an npz file, unless a caller accepts more [-].
_MOST_ARRAYS = 64
#: Kinds of numpy types that are accepted: truth values, numbers and texts.
_KINDS = "biufcUS"
#: Size that a number of a smaller type counts as, because callers may convert it [bytes].
_LEAST_BYTES = 8
#: Largest size of the head of an array, which holds its type and shape [bytes].
_MOST_HEAD = 4096


def pack_npz(arrays: Mapping[str, npt.ArrayLike]) -> bytes:
    """Return the bytes of an npz file of arrays; they depend on names and values only, not on order or time of day.

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
            # A ZipInfo made here has a fixed date; given a name, `ZipFile.writestr` would store the present time.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), content.getbuffer(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def unpack_npz(content: bytes, *, most: int, most_arrays: int = _MOST_ARRAYS) -> dict[str, npt.NDArray[np.generic]]:
    """Return the arrays in the bytes of an npz file, by name.

    Sizes, types and shapes are checked before any memory is claimed for an array.

    Args:
        content: The bytes.
        most: Largest accepted size of all arrays together; numbers of less than 8 bytes count as 8 [bytes].
        most_arrays: Largest accepted number of arrays [-].

    Raises:
        FileLimitError: If the bytes are no npz file, or are damaged, encrypted, packed by a method other than deflate,
            or hold more bytes than accepted or Python objects.
    """
    arrays: dict[str, npt.NDArray[np.generic]] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            if len(entries) > most_arrays:
                raise FileLimitError(f"holds {len(entries)} arrays; at most {most_arrays} are accepted")  # noqa: TRY301
            for entry in entries:
                array = _unpack_array(archive, entry, most)
                most -= array.size * max(array.itemsize, _LEAST_BYTES)
                arrays[entry.filename.removesuffix(".npy")] = array
    except FileLimitError:
        raise
    except Exception as error:  # noqa: BLE001 -- zipfile and numpy raise many kinds of errors on damaged files
        raise FileLimitError(f"not a readable npz file: {error}") from None
    return arrays


def _unpack_array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, most: int) -> npt.NDArray[np.generic]:
    """Unpack one array of an npz file, of at most `most` bytes; errors are of many types."""
    if entry.flag_bits & 1 or entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise FileLimitError("is encrypted or packed by another method than deflate")
    if not entry.filename.endswith(".npy"):
        raise FileLimitError("holds something else than arrays")
    with archive.open(entry) as packed:
        return _read_array(packed, entry.file_size, most)


def unpack_npy(content: bytes, *, most: int) -> npt.NDArray[np.generic]:
    """Return the array in the bytes of an npy file; its size, type and shape are checked before memory is claimed.

    Args:
        content: The bytes.
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
    """Read one array of at most `most` bytes from a file of `total` bytes; errors are of many types."""
    head = io.BytesIO(packed.read(_MOST_HEAD))
    if np.lib.format.read_magic(head) != (1, 0):
        raise FileLimitError("holds an array of another version of the format; accepted: 1.0")
    shape, by_columns, kind = np.lib.format.read_array_header_1_0(head, max_header_size=_MOST_HEAD)
    count = math.prod(shape)
    if kind.kind not in _KINDS or kind.hasobject or min(shape, default=0) < 0:
        raise FileLimitError(f"holds an array of type {str(kind)[:40]}; accepted: numbers and texts")
    if count * max(kind.itemsize, _LEAST_BYTES) > most:
        raise FileLimitError(f"unpacks to more than the {format_size(most)} that are accepted here")
    begun, size = head.read(), count * kind.itemsize
    if total != head.tell() - len(begun) + size:
        raise FileLimitError("holds an array whose size is not that of its shape")
    values = np.frombuffer(begun + packed.read(size), dtype=kind, count=count)
    return values.reshape(shape, order="F" if by_columns else "C").copy(order="K")
