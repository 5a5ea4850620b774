"""Two-point separation: how far apart two equal touches must be to show a dip between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

if TYPE_CHECKING:
    from fem_reference.linear_response.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]

#: Alignments of the first touch within one pitch, and how many texels the imagined row has on each side.
_ALIGNMENTS = 8
_HALF_ROW = 24


def two_point_separation(spread: PointSpread) -> float:
    """Smallest separation at which the base pressure midway is below that under either load [m].

    Two loads at distance s give 2 P(s/2) midway and P(0) + P(s) under each, with P the radial profile.
    """
    radius, pressure = np.asarray(spread.radius), np.asarray(spread.pressure_per_force)
    separation = np.linspace(0, radius[-1] / 2, 4001)[1:]
    dip = np.interp(0, radius, pressure) + np.interp(separation, radius, pressure)
    dip = dip - 2 * np.interp(separation / 2, radius, pressure)
    resolved = np.flatnonzero(dip > 1e-3 * pressure.max())
    return float(separation[resolved[0]]) if resolved.size else float("nan")


def texel_separation(spread: PointSpread, array: TexelArray) -> float:
    """Smallest separation along x at which some texel between reads less than both neighbours' peaks [m].

    The texels are an imagined long row with the array's pitch and texel size, so that the array's own edges do not
    count; the touches move in eighths of a pitch, and the worst alignment counts.
    """
    row = TexelArray.grid(1, 2 * _HALF_ROW + 1, array.pitch, texel_size=array.texel_size)
    step = array.pitch[0] / _ALIGNMENTS
    shifts = range(_ALIGNMENTS)
    touches = np.column_stack([np.arange(_ALIGNMENTS) * step, np.zeros(_ALIGNMENTS)])
    single = np.asarray(spread.texel_influence(row, touches))
    for separation in range(1, _ALIGNMENTS * (_HALF_ROW // 2)):
        pairs = (single[shift] + _moved(single, shift + separation) for shift in shifts)
        if all(_has_dip(pair) for pair in pairs):
            return separation * step
    return float("nan")


def _moved(single: FloatArray, eighths: int) -> FloatArray:
    """Response to a touch `eighths` of a pitch to the right of the row's centre."""
    whole, part = divmod(eighths, _ALIGNMENTS)
    return np.concatenate([np.zeros(whole), single[part][: single.shape[1] - whole]])


def _has_dip(values: FloatArray) -> bool:
    rising = np.maximum.accumulate(values)
    falling = np.maximum.accumulate(values[::-1])[::-1]
    # Both sides must be touches: the response to a single one has a shallow ring of its own.
    flanked = np.minimum(rising, falling)
    return bool(np.any((flanked > values.max() / 2) & (flanked - values > 1e-3 * values.max())))
