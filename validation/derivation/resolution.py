"""Two-point separation: the smallest distance at which two equal point loads can be distinguished from one load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

if TYPE_CHECKING:
    from fem_reference.linear_response.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]

#: Number of positions of the first load within one pitch of the texels.  All loads lie at multiples of the pitch over
#: this number [-].
_ALIGNMENTS = 8
#: Number of texels on each side of the middle of the long row of texels on which separations are tried: enough for
#: twelve pitches between the loads [-].
_HALF_ROW = 24
#: Smallest depth of a dip between two peaks that counts as a dip, over the largest value: above errors of rounding and
#: interpolation [-].
_SMALLEST_DIP = 1e-3


def two_point_separation(spread: PointSpread) -> float:
    """Compute the smallest distance of two equal point loads with a dip of pressure at the cover's base between them.

    Two unit loads at distance s cause the pressure 2 P(s/2) midway and P(0) + P(s) under each load, where P is the
    radial profile of pressure at the base under a unit point load.

    Args:
        spread: The point spread function of the cover.

    Returns:
        The distance; NaN if no distance up to half the profile's radius shows a dip [m].
    """
    radius, pressure = np.asarray(spread.radius), np.asarray(spread.pressure_per_force)
    separation = np.linspace(0, radius[-1] / 2, 4001)[1:]
    under_load = np.interp(0, radius, pressure) + np.interp(separation, radius, pressure)
    dip = under_load - 2 * np.interp(separation / 2, radius, pressure)
    resolved = np.flatnonzero(dip > _SMALLEST_DIP * pressure.max())
    return float(separation[resolved[0]]) if resolved.size else float("nan")


def texel_separation(spread: PointSpread, array: TexelArray) -> float:
    """Compute the smallest distance of two equal point loads along x with a dip of texel values between two peaks.

    The texels are those of a long row with the array's pitch and texel size, so that the edges of the array have no
    effect.  The dip must appear at every position of the loads relative to the texels.

    Args:
        spread: The point spread function of the cover.
        array: The array, which gives pitch and texel size.

    Returns:
        The distance, a multiple of an eighth of the pitch; NaN if no distance up to twelve pitches shows the dip [m].
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
    """Return the forces on a row of n texels under a unit point load to the right of the row's middle [-].

    Args:
        single: Forces on the n texels under a unit load at each position within the middle pitch, shape
            (positions, n) [-].
        steps: Distance of the load from the middle of the row, in steps between these positions [-].
    """
    texels, alignment = divmod(steps, _ALIGNMENTS)
    return np.concatenate([np.zeros(texels), single[alignment][: single.shape[1] - texels]])


def _has_dip(values: FloatArray) -> bool:
    """Return whether a sequence of texel values has two peaks with a smaller value between them."""
    rising = np.maximum.accumulate(values)
    falling = np.maximum.accumulate(values[::-1])[::-1]
    lower_peak = np.minimum(rising, falling)
    # The two peaks must exceed half the maximum, because a single load too causes a shallow ring around its peak.
    return bool(np.any((lower_peak > values.max() / 2) & (lower_peak - values > _SMALLEST_DIP * values.max())))
