"""Parses the text in the XML elements of a `.dsa` file: numbers, masks, arrays and run-length encoded frames."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from validation.recordings.recording import BoolArray, RecordedArray

FrameArray = npt.NDArray[np.int16]
#: Function that raises a `RecordingError`: path of the file, place in the file and the given text.
Fail = Callable[[str], NoReturn]

#: Tags of the XML elements that describe one texel array; all are required.
MATRIX_FIELDS = (
    *("cells_x", "cells_y", "texel_width", "texel_height", "static_mask", "dynamic_mask"),
    *("matrix_center_x", "matrix_center_y", "matrix_center_z", "theta_x", "theta_y", "theta_z"),
    *("output_unit", "fullscale", "hw_revision", "one_wire_uid"),
)
#: Largest accepted number of rows, and of columns, of an array [-]; the arrays of an SDH-2 hand have at most 14.
_MOST_CELLS = 64
#: Largest accepted full scale of an array [counts]: counts are stored as signed 16 bit numbers.
_LARGEST_FULL_SCALE = int(np.iinfo(np.int16).max)
#: Number of hexadecimal digits of one token of a frame, an IEEE-754 single-precision number.
_TOKEN_DIGITS = 8
_METRES_PER_MILLIMETRE = 1e-3
#: Patterns of the accepted whole numbers and decimal numbers, which limit the number of digits.
_WHOLE_NUMBER = re.compile(r"[0-9]{1,15}")
_NUMBER = re.compile(r"[+-]?[0-9]{1,15}(\.[0-9]{0,15})?([eE][+-]?[0-9]{1,2})?")


def read_array(fields: Mapping[str, str], name: str, fail: Fail) -> RecordedArray:
    """Read the description of one texel array from a `<matrix>` element.

    Args:
        fields: Text of each child element in `MATRIX_FIELDS`, by tag.
        name: Name that the array gets.
        fail: Function that raises the error for a faulty file.

    Returns:
        The array, without frames.
    """
    columns, rows = (_read_bounded(fields, cells, _MOST_CELLS, fail) for cells in ("cells_x", "cells_y"))
    width, height = (_read_length(fields, edge, fail) for edge in ("texel_width", "texel_height"))
    active = _read_mask(fields, "static_mask", rows, columns, fail)
    if not active.any():
        fail("static_mask leaves no texel; expected at least one")
    x, y, z = (read_number(fields[f"matrix_center_{axis}"], "matrix_center", fail) for axis in "xyz")
    about_x, about_y, about_z = (math.radians(read_number(fields[f"theta_{axis}"], "theta", fail)) for axis in "xyz")
    return RecordedArray(
        texels=TexelArray.grid(rows, columns, (width, height), active=active, name=name),
        enabled=_read_mask(fields, "dynamic_mask", rows, columns, fail),
        counts=np.empty((0, rows * columns), dtype=np.int32),
        full_scale=_read_bounded(fields, "fullscale", _LARGEST_FULL_SCALE, fail),
        unit=fields["output_unit"].strip(),
        centre=(x * _METRES_PER_MILLIMETRE, y * _METRES_PER_MILLIMETRE, z * _METRES_PER_MILLIMETRE),
        rotation=(about_x, about_y, about_z),
    )


def limit_counts(array: RecordedArray) -> FrameArray:
    """Return the largest possible count of each texel, shape (n,) [-]: the full scale, or 0 for a masked texel."""
    return np.where(array.texels.active & array.enabled, array.full_scale, 0).astype(np.int16)


def decode_counts(text: str, limits: FrameArray, fail: Fail) -> FrameArray:
    """Expand the hexadecimal tokens of one frame to one count per texel.

    Args:
        text: The tokens, eight digits each, with spaces and line breaks anywhere.
        limits: Largest possible count of each of the n texels, shape (n,) [-].
        fail: Function that raises the error for a faulty file.

    Returns:
        Counts of the texels, shape (n,) [-].
    """
    digits = "".join(text.split())
    try:
        with np.errstate(invalid="ignore"):  # converting a signalling NaN warns
            tokens = np.frombuffer(bytes.fromhex(digits), dtype=">f4").astype(np.float64)
    except ValueError:
        fail(f"frame_data is not hexadecimal tokens of {_TOKEN_DIGITS} digits")
    # NaN and infinity fail these comparisons.  The number of texels is checked before runs of zeros are expanded, so
    # that a damaged token cannot claim much memory.
    if not (np.abs(tokens) <= _LARGEST_FULL_SCALE).all() or (tokens != np.rint(tokens)).any():
        fail("a token is not a whole number of counts or zeros")
    runs = np.where(tokens < 0, -tokens, 1).astype(np.int64)
    if runs.sum() != len(limits):
        fail(f"tokens add up to {runs.sum()} texels; expected {len(limits)}")
    counts = np.repeat(np.maximum(tokens, 0), runs).astype(np.int16)
    above = np.flatnonzero(counts > limits)
    if above.size:
        fail(f"texel {above[0]} reads {counts[above[0]]}; expected at most {limits[above[0]]} (0 is masked)")
    return counts


def read_whole_number(text: str, name: str, fail: Fail) -> int:
    """Parse a whole number of 0 or more; `name` is the tag of the element, for the error message."""
    if not _WHOLE_NUMBER.fullmatch(text.strip()):
        fail(f"{name} is {text.strip()[:40]!r}; expected a whole number")
    return int(text)


def read_number(text: str, name: str, fail: Fail) -> float:
    """Parse a finite decimal number; `name` is the tag of the element, for the error message."""
    if not _NUMBER.fullmatch(text.strip()):
        fail(f"{name} is {text.strip()[:40]!r}; expected a number")
    return float(text)


def _read_bounded(fields: Mapping[str, str], name: str, largest: int, fail: Fail) -> int:
    """Parse the element `name` as a whole number from 1 to `largest`."""
    value = read_whole_number(fields[name], name, fail)
    if not 1 <= value <= largest:
        fail(f"{name} is {value}; expected 1..{largest}")
    return value


def _read_length(fields: Mapping[str, str], name: str, fail: Fail) -> float:
    """Parse the element `name` as a positive length in millimetres; return the length [m]."""
    value = read_number(fields[name], name, fail)
    if value <= 0:
        fail(f"{name} is {value} mm; expected a positive length")
    return value * _METRES_PER_MILLIMETRE


def _read_mask(fields: Mapping[str, str], name: str, rows: int, columns: int, fail: Fail) -> BoolArray:
    """Parse the element `name` as lines of digits 0 or 1; return the digits as booleans, shape (rows * columns,)."""
    lines = fields[name].split()
    if len(lines) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in lines):
        fail(f"{name} is not {rows} lines of {columns} digits 0 or 1")
    return np.array([digit == "1" for line in lines for digit in line])
