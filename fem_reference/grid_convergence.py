"""Discretisation error from a sequence of grids (Roache 1994; ASME V&V 20-2009, section 2-4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from meshes.array_types import FloatArray

#: Safety factors where the grids converge as expected, and where they do not (Roache 1994) [-].
_SAFETY, _UNSURE = 1.25, 3.0
#: Relative deviation of a ratio of differences that rounding may cause [-].
_ROUNDING = 1e-9


def grid_convergence(
    values: Sequence[float], sizes: Sequence[float], *, least: float = 1.0, most: float = 4.0
) -> float:
    """Estimate the error of the finest of three values.

    The observed order of convergence is limited to the range from `least` to `most`.  The safety factor is 1.25 if the
    values converge monotonically with an order in this range, and 3 otherwise.  If the two finest grids agree better
    than order `most` can explain, the difference predicted from the coarse pair and `most` replaces theirs.

    Args:
        values: Results, coarsest grid first, shape (3,).
        sizes: Element sizes of the grids in the same order, descending.
        least: Smallest order that is accepted [-].
        most: Largest order that is accepted [-].

    Returns:
        Estimated absolute error of the last value, in its unit.

    Raises:
        ValueError: If there are not three grids of descending size.
    """
    if len(values) != 3 or len(sizes) != 3 or not sizes[0] > sizes[1] > sizes[2] > 0:  # noqa: PLR2004
        raise ValueError("grid_convergence needs three values on grids of descending size")
    coarse, fine = abs(values[1] - values[0]), abs(values[2] - values[1])
    if fine == 0 and coarse == 0:
        return 0.0
    monotonic = (values[1] - values[0]) * (values[2] - values[1]) > 0
    ratio = coarse / fine if fine else np.inf

    def predict_ratio(order: float) -> float:
        """First difference over the second of a sequence of the given order, also for uneven ratios of the sizes."""
        h = np.array(sizes) ** order
        return float((h[0] - h[1]) / (h[1] - h[2]))

    inside = monotonic and predict_ratio(least) <= ratio * (1 + _ROUNDING) and ratio <= predict_ratio(most + 1)
    if ratio > predict_ratio(most + 1):
        fine = coarse / predict_ratio(most)
    if predict_ratio(least) < ratio < predict_ratio(most):
        order = float(brentq(lambda p: predict_ratio(p) - ratio, least, most))
    else:
        order = least if ratio <= predict_ratio(least) else most
    return float((_SAFETY if inside else _UNSURE) * fine / ((sizes[1] / sizes[2]) ** order - 1))


def extrapolate(values: Sequence[npt.ArrayLike], sizes: Sequence[float]) -> FloatArray:
    """Extrapolate a first-order sequence to its limit from the two finest values (Richardson).

    If a third, coarser value shows that the sequence is not monotonic, the finest value is returned.

    Args:
        values: Results, finest grid last, two or three of the same shape.
        sizes: Element sizes of the grids in the same order, descending.
    """
    known = np.asarray(values, dtype=float)
    change = np.asarray(known[-1] - known[-2])
    if len(known) > 2:  # noqa: PLR2004 -- coarse, middle, fine
        change = np.where(change * (known[-2] - known[-3]) < 0, 0.0, change)
    return np.asarray(known[-1] + change / (sizes[-2] / sizes[-1] - 1))
