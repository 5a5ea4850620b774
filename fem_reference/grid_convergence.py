"""Estimate the discretisation error from results on three grids (Roache 1994; ASME V&V 20-2009, section 2-4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

#: Safety factors on the estimated error, for results that converge monotonically with an order in the accepted range,
#: and for all others; values of Roache (1994) [-].
_SAFETY, _UNSURE = 1.25, 3.0
#: Relative deviation that rounding may cause in the ratio of the differences between successive grids [-].
_ROUNDING = 1e-9


def grid_convergence(
    values: Sequence[float], sizes: Sequence[float], *, least: float = 1.0, most: float = 4.0
) -> float:
    """Estimate the discretisation error of the result on the finest of three grids.

    The observed order of convergence is limited to the range from `least` to `most`.  The safety factor is 1.25 if the
    values converge monotonically with an order in this range, and 3 otherwise.  If the difference between the two
    finest grids is smaller than order `most` can explain, it is replaced by the difference that the two coarsest grids
    and order `most` predict.

    Args:
        values: The same quantity computed on each grid, coarsest grid first, shape (3,).
        sizes: Element sizes of the grids in the same order, descending.
        least: Smallest order of convergence that is accepted [-].
        most: Largest order of convergence that is accepted [-].

    Returns:
        Estimated absolute error of the last of `values`, in the unit of `values`.

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
        """Predict the coarse over the fine difference of values that converge with `order`, for any element sizes."""
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
