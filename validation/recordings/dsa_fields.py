"""What the elements of a `.dsa` file say: numbers, masks, arrays and the run-length code of a frame."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn, Protocol

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from validation.recordings.recording import BoolArray, RecordedArray

CountArray = npt.NDArray[np.int16]

#: Elements that describe one array; each must be there.
MATRIX_FIELDS = (
    "cells_x",
    "cells_y",
    "texel_width",
    "texel_height",
    "matrix_center_x",
    "matrix_center_y",
    "matrix_center_z",
    "theta_x",
    "theta_y",
    "theta_z",
    "output_unit",
    "hw_revision",
    "one_wire_uid",
    "fullscale",
    "static_mask",
    "dynamic_mask",
)
_MAX_CELLS = 64
_MAX_FULL_SCALE = int(np.iinfo(np.int16).max)
_DIGITS = 8
_MILLIMETRE = 1e-3
_WHOLE = re.compile(r"[0-9]{1,15}")
_NUMBER = re.compile(r"[+-]?[0-9]{1,15}(\.[0-9]{0,15})?([eE][+-]?[0-9]{1,2})?")


class Fail(Protocol):
    """Refuses the file, naming file and place."""

    def __call__(self, what: str) -> NoReturn:
        """Raise a `RecordingError` that says `what`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Matrix:
    """One array as its element describes it.

    Attributes:
        texels: The array; texels missing by the static mask are not active.
        enabled: The dynamic mask, shape (n,).
        full_scale: Largest count [-].
        unit: Unit of a count, as the file calls it.
        centre: Position in the sensor's drawing [m].
        rotation: Angles about x, y, z [rad].
    """

    texels: TexelArray
    enabled: BoolArray
    full_scale: int
    unit: str
    centre: tuple[float, float, float]
    rotation: tuple[float, float, float]

    @property
    def limits(self) -> CountArray:
        """Largest value that each texel may have: the full scale, or zero where masked, shape (n,)."""
        return np.where(self.texels.active & self.enabled, self.full_scale, 0).astype(np.int16)

    def with_frames(self, counts: CountArray) -> RecordedArray:
        """The array with its frames, shape (frames, n)."""
        return RecordedArray(
            texels=self.texels,
            enabled=self.enabled,
            counts=counts.astype(np.int32),
            full_scale=self.full_scale,
            unit=self.unit,
            centre=self.centre,
            rotation=self.rotation,
        )


def matrix(fields: Mapping[str, str], name: str, fail: Fail) -> Matrix:
    """Read the fields of one `<matrix>`; all of `MATRIX_FIELDS` must be there."""
    columns, rows = (_bounded(fields, cells, _MAX_CELLS, fail) for cells in ("cells_x", "cells_y"))
    width, height = (_length(fields, edge, fail) for edge in ("texel_width", "texel_height"))
    present = _mask(fields, "static_mask", rows, columns, fail)
    if not present.any():
        fail("static_mask leaves no texel; expected at least one")
    x, y, z = (number(fields[f"matrix_center_{axis}"], "matrix_center", fail) * _MILLIMETRE for axis in "xyz")
    a, b, c = (math.radians(number(fields[f"theta_{axis}"], "theta", fail)) for axis in "xyz")
    return Matrix(
        texels=TexelArray.grid(rows, columns, (width, height), active=present, name=name),
        enabled=_mask(fields, "dynamic_mask", rows, columns, fail),
        full_scale=_bounded(fields, "fullscale", _MAX_FULL_SCALE, fail),
        unit=fields["output_unit"].strip(),
        centre=(x, y, z),
        rotation=(a, b, c),
    )


def decode(text: str, limits: CountArray, fail: Fail) -> CountArray:
    """Expand the hexadecimal tokens of one frame to one count per texel.

    Args:
        text: Eight digits per token, spaces and line breaks anywhere.
        limits: Largest value of each texel, shape (n,).
        fail: Refuses the file.

    Returns:
        Counts, shape (n,).
    """
    digits = "".join(text.split())
    try:
        tokens = np.frombuffer(bytes.fromhex(digits), dtype=">f4").astype(np.float64)
    except ValueError:
        fail(f"frame_data is not hexadecimal tokens of {_DIGITS} digits")
    # NaN and infinity fail these comparisons, and sizes are checked before anything is expanded
    if not (np.abs(tokens) <= _MAX_FULL_SCALE).all() or (tokens != np.rint(tokens)).any():
        fail("a token is not a whole number of counts or zeros")
    runs = np.where(tokens < 0, -tokens, 1).astype(np.int64)
    if runs.sum() != len(limits):
        fail(f"tokens add up to {runs.sum()} texels; expected {len(limits)}")
    counts = np.repeat(np.maximum(tokens, 0), runs).astype(np.int16)
    above = np.flatnonzero(counts > limits)
    if above.size:
        fail(f"texel {above[0]} reads {counts[above[0]]}; expected at most {limits[above[0]]} (0 is masked)")
    return counts


def whole(text: str, name: str, fail: Fail) -> int:
    """A whole number that is not negative."""
    if not _WHOLE.fullmatch(text.strip()):
        fail(f"{name} is {text.strip()[:40]!r}; expected a whole number")
    return int(text)


def number(text: str, name: str, fail: Fail) -> float:
    """A finite decimal number."""
    if not _NUMBER.fullmatch(text.strip()):
        fail(f"{name} is {text.strip()[:40]!r}; expected a number")
    return float(text)


def _bounded(fields: Mapping[str, str], name: str, largest: int, fail: Fail) -> int:
    value = whole(fields[name], name, fail)
    if not 1 <= value <= largest:
        fail(f"{name} is {value}; expected 1..{largest}")
    return value


def _length(fields: Mapping[str, str], name: str, fail: Fail) -> float:
    value = number(fields[name], name, fail)
    if value <= 0:
        fail(f"{name} is {value} mm; expected a positive length")
    return value * _MILLIMETRE


def _mask(fields: Mapping[str, str], name: str, rows: int, columns: int, fail: Fail) -> BoolArray:
    lines = fields[name].split()
    if len(lines) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in lines):
        fail(f"{name} is not {rows} lines of {columns} digits 0 or 1")
    return np.array([digit == "1" for line in lines for digit in line])
