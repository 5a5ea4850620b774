"""Estimate the discretisation error from results on three grids (Roache 1994; ASME V&V 20-2009, section 2-4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from meshes.array_types import FloatArray

#: Safety factor on the estimated error of results that converge monotonically with an order in the accepted range;
#: value of Roache (1994) [-].
_SAFETY = 1.25
#: Safety factor on the estimated error of all other results; value of Roache (1994) [-].
_UNSURE = 3.0
#: Relative deviation that rounding may cause in the ratio of the differences between successive grids [-].
_ROUNDING = 1e-9


def grid_convergence(
    values: Sequence[float], sizes: Sequence[float], *, least: float = 1.0, most: float = 4.0
) -> float:
    """Estimate the discretisation error of the result on the finest of three grids.

    The observed order of convergence is limited to the range from `least` to `most`.  The safety factor is 1.25 if the
    values converge monotonically with an order in this range, and 3 otherwise.  The difference between the two finest
    grids may be smaller than order `most` can explain.  It is then replaced by the difference predicted from the two
    coarsest grids and order `most`.

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

    inside = (
        monotonic
        and _predict_ratio(least, sizes) <= ratio * (1 + _ROUNDING)
        and ratio <= _predict_ratio(most + 1, sizes)
    )
    if ratio > _predict_ratio(most + 1, sizes):
        fine = coarse / _predict_ratio(most, sizes)
    order = _find_order(ratio, sizes, least, most)
    return float((_SAFETY if inside else _UNSURE) * fine / ((sizes[1] / sizes[2]) ** order - 1))


def field_convergence(values: npt.ArrayLike, sizes: Sequence[float], *, least: float = 1.0, most: float = 4.0) -> float:
    """Estimate the largest discretisation error of many values of one kind on the finest of two or three grids.

    The difference between two grids is the largest difference over all values.  It does not vanish by chance, unlike
    the difference of a single value that does not converge monotonically.  One order and the safety factor 1.25
    therefore apply to all values.  On two grids the order is `least`.  On three grids, the difference between the two
    finest ones is at least the value predicted from the coarser pair and order `most`.

    Args:
        values: The values on each grid, coarsest first, shape (2, ...) or (3, ...).
        sizes: Element sizes of the grids in the same order, descending.
        least: Smallest order of convergence that is accepted [-].
        most: Largest order of convergence that is accepted [-].

    Returns:
        Estimated absolute error of the finest values, in their unit.

    Raises:
        ValueError: If there are not two or three grids of descending size.
    """
    each = np.asarray(values, dtype=float)
    if len(each) != len(sizes) or len(each) not in {2, 3} or not (np.diff(sizes) < 0).all():
        raise ValueError("field_convergence needs values on two or three grids of descending size")
    differences = np.abs(np.diff(each.reshape(len(each), -1), axis=0)).max(axis=1)
    fine, order = float(differences[-1]), least
    if len(each) == 3 and differences[0] > 0:  # noqa: PLR2004
        fine = max(fine, float(differences[0]) / _predict_ratio(most, sizes))
        order = _find_order(float(differences[0]) / fine, sizes, least, most)
    return float(_SAFETY * fine / ((sizes[-2] / sizes[-1]) ** order - 1))


def texel_convergence(
    values: npt.ArrayLike, sizes: Sequence[float], *, least: float = 1.0, most: float = 4.0
) -> FloatArray:
    """Estimate the discretisation error of every texel force on the finest of three grids.

    The sums of the absolute differences between the grids give one order, safety factor and error for all texels
    together, by `grid_convergence`.  Each texel gets its part of this error: the larger one of its shares of the two
    sums.

    Args:
        values: Forces on n texels on each grid, coarsest first, shape (3, n).
        sizes: Element sizes of the grids in the same order, descending.
        least: Smallest order of convergence that is accepted [-].
        most: Largest order of convergence that is accepted [-].

    Returns:
        Estimated absolute errors of the finest values, shape (n,), in their unit.

    Raises:
        ValueError: As for `grid_convergence`.
    """
    table = np.asarray(values, dtype=float)
    change = np.abs(np.diff(table, axis=0))
    sums = change.sum(axis=1)
    whole = grid_convergence([0.0, *sums.cumsum()], sizes, least=least, most=most)
    return np.asarray(whole * (change / np.maximum(sums, np.finfo(float).tiny)[:, None]).max(axis=0))


def pool_errors(errors: FloatArray, values: FloatArray) -> FloatArray:
    """Raise the errors of n values to at least the mean relative error of all, so that none vanishes by chance.

    The mean relative error is the sum of the errors over the sum of the magnitudes of the values.

    Args:
        errors: Absolute errors, shape (n,), in the unit of the values.
        values: Values, shape (n,).
    """
    size = np.abs(values)
    mean = float(errors.sum()) / max(float(size.sum()), np.finfo(float).tiny)
    return np.asarray(np.maximum(errors, mean * size))


def _predict_ratio(order: float, sizes: Sequence[float]) -> float:
    """Predict the ratio of successive differences between three grids, for values that converge with an order.

    Args:
        order: Order of convergence [-].
        sizes: Element sizes of the three grids, descending.

    Returns:
        Difference between the two coarser grids over that between the two finer grids [-].
    """
    h = np.array(sizes) ** order
    return float((h[0] - h[1]) / (h[1] - h[2]))


def _find_order(ratio: float, sizes: Sequence[float], least: float, most: float) -> float:
    """Find the order of convergence that explains the ratio of successive differences between three grids.

    Args:
        ratio: Difference between the two coarser grids over that between the two finer grids [-].
        sizes: Element sizes of the three grids, descending.
        least: Smallest order that is returned [-].
        most: Largest order that is returned [-].
    """
    if _predict_ratio(least, sizes) < ratio < _predict_ratio(most, sizes):
        return float(brentq(lambda p: _predict_ratio(p, sizes) - ratio, least, most))
    return least if ratio <= _predict_ratio(least, sizes) else most
