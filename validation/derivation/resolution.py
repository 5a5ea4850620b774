"""Two-point separation: the smallest distance at which two equal loads can be distinguished from one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

if TYPE_CHECKING:
    from fem_reference.linear_response.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]

#: Positions of the first load within one pitch; loads move in steps of a pitch over this number [-].
_ALIGNMENTS = 8
#: Texels of the long row on each side of its middle: enough for twelve pitches between the loads [-].
_HALF_ROW = 24
#: Smallest depth of a dip that counts, over the largest value: above rounding and interpolation errors [-].
_SMALLEST_DIP = 1e-3


def two_point_separation(spread: PointSpread) -> float:
    """Smallest separation at which the base pressure midway is below that under either load [m].

    Two unit loads at distance s give 2 P(s/2) midway and P(0) + P(s) under each, with P the radial profile.  NaN if no
    separation up to half the profile's radius has a dip.
    """
    radius, pressure = np.asarray(spread.radius), np.asarray(spread.pressure_per_force)
    separation = np.linspace(0, radius[-1] / 2, 4001)[1:]
    under_load = np.interp(0, radius, pressure) + np.interp(separation, radius, pressure)
    dip = under_load - 2 * np.interp(separation / 2, radius, pressure)
    resolved = np.flatnonzero(dip > _SMALLEST_DIP * pressure.max())
    return float(separation[resolved[0]]) if resolved.size else float("nan")


def texel_separation(spread: PointSpread, array: TexelArray) -> float:
    """Smallest separation along x at which a texel between the loads reads less than both peaks [m].

    The texels are those of a long row with the array's pitch and texel size, so that the edges of the array have no
    effect.  The dip must appear at every alignment of the loads with the texels.  The result is NaN if no
    separation fulfils this.
    """
    row = TexelArray.grid(1, 2 * _HALF_ROW + 1, array.pitch, texel_size=array.texel_size)
    step = array.pitch[0] / _ALIGNMENTS
    loads = np.column_stack([np.arange(_ALIGNMENTS) * step, np.zeros(_ALIGNMENTS)])
    single = np.asarray(spread.texel_influence(row, loads))
    for separation in range(1, _ALIGNMENTS * (_HALF_ROW // 2)):
        pairs = (single[shift] + _shifted_response(single, shift + separation) for shift in range(_ALIGNMENTS))
        if all(_has_dip(pair) for pair in pairs):
            return separation * step
    return float("nan")


def _shifted_response(single: FloatArray, steps: int) -> FloatArray:
    """Response of the row to a load that many steps to the right of its middle."""
    texels, alignment = divmod(steps, _ALIGNMENTS)
    return np.concatenate([np.zeros(texels), single[alignment][: single.shape[1] - texels]])


def _has_dip(values: FloatArray) -> bool:
    """Whether a value lies below larger values on both sides."""
    rising = np.maximum.accumulate(values)
    falling = np.maximum.accumulate(values[::-1])[::-1]
    lower_peak = np.minimum(rising, falling)
    # Both peaks must exceed half the maximum: the response to a single load has a shallow ring around it.
    return bool(np.any((lower_peak > values.max() / 2) & (lower_peak - values > _SMALLEST_DIP * values.max())))
