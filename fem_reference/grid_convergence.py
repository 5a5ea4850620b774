"""Discretisation error from a sequence of grids (Roache 1994; ASME V&V 20-2009, section 2-4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq


def grid_convergence(
    values: Sequence[float], sizes: Sequence[float], *, least: float = 1.0, most: float = 4.0
) -> float:
    """Estimate the error of the finest of three values.

    The observed order is limited to `least`..`most`.  The safety factor is 1.25 where the three values converge
    monotonically with an order inside that range, 3 where they do not.  Where the two finest agree better than any such
    order allows, by chance, what the coarsest and `most` let expect stands for their difference.

    Args:
        values: Results, coarsest grid first, shape (3,).
        sizes: Element sizes of the grids in the same order, descending.
        least: Smallest order believed [-].
        most: Largest order believed [-].

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
    seen = coarse / fine if fine else np.inf

    def shrinks(order: float) -> float:
        """First over second difference of a sequence of an order; with uneven sizes no power of one ratio."""
        h = np.array(sizes) ** order
        return float((h[0] - h[1]) / (h[1] - h[2]))

    inside = monotonic and shrinks(least) <= seen * (1 + 1e-9) and seen <= shrinks(most + 1)
    if seen > shrinks(most + 1):
        fine = coarse / shrinks(most)
    if shrinks(least) < seen < shrinks(most):
        order = float(brentq(lambda p: shrinks(p) - seen, least, most))
    else:
        order = least if seen <= shrinks(least) else most
    return float((1.25 if inside else 3.0) * fine / ((sizes[1] / sizes[2]) ** order - 1))


def extrapolated(values: Sequence[npt.ArrayLike], sizes: Sequence[float]) -> npt.NDArray[np.float64]:
    """Limit of a first-order sequence from its two finest values (Richardson).

    Where a third, coarser value shows that the sequence goes back and forth there is no order to extrapolate by, and
    the finest value stands.

    Args:
        values: Results, finest grid last, two or three of the same shape.
        sizes: Element sizes of the grids in the same order, descending.
    """
    known = np.asarray(values, dtype=float)
    change = np.asarray(known[-1] - known[-2])
    if len(known) > 2:  # noqa: PLR2004 -- coarse, middle, fine
        change = np.where(change * (known[-2] - known[-3]) < 0, 0.0, change)
    return np.asarray(known[-1] + change / (sizes[-2] / sizes[-1] - 1))
