"""Means of scores over cases (scored indentations) with bootstrap intervals, and skill against another model."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from validation.results import Number, Result, result_model

FloatArray = npt.NDArray[np.float64]


@result_model
class Pooled(Result):
    """Mean of a quantity over cases, or another statistic of the cases, with its bootstrap interval.

    Attributes:
        mean: Mean over the cases in which the quantity exists, in the unit of the quantity.
        low: Lower end of the bootstrap interval, same unit.
        high: Upper end of the bootstrap interval, same unit.
        level: Nominal coverage of the interval [-].
        cases: Number of cases over which the mean is taken [-].
    """

    mean: Number
    low: Number
    high: Number
    level: float
    cases: int


def pool(values: Sequence[float] | FloatArray, *, level: float = 0.95, resamples: int = 5000, seed: int = 0) -> Pooled:
    """Compute the mean of a quantity over cases, with a percentile bootstrap interval.

    The bootstrap resamples cases (indentations), never single pixels of an image.

    Args:
        values: One number per case; NaN in cases in which the quantity does not exist.
        level: Nominal coverage of the interval [-].
        resamples: Number of bootstrap resamples [-].
        seed: Seed of the resampling; the same seed gives the same interval [-].
    """
    known = np.asarray(values, dtype=np.float64)
    known = known[~np.isnan(known)]
    if not known.size:
        return Pooled(mean=math.nan, low=math.nan, high=math.nan, level=level, cases=0)
    means = known[_draw_cases(known.size, resamples, seed)].mean(axis=1)
    return _with_interval(float(known.mean()), means, level, known.size)


def skill(
    errors: Sequence[float] | FloatArray,
    comparison: Sequence[float] | FloatArray,
    *,
    level: float = 0.95,
    resamples: int = 5000,
    seed: int = 0,
) -> Pooled:
    """Compute the skill of a model, 1 - mean error / mean error of a comparison model [-], with a bootstrap interval.

    The bootstrap resamples cases, and takes the errors of the two models from the same cases.

    Args:
        errors: Error of the model in each case; NaN in cases in which the error does not exist.
        comparison: Error of the comparison model in the same cases.
        level: Nominal coverage of the interval [-].
        resamples: Number of bootstrap resamples [-].
        seed: Seed of the resampling [-].

    Raises:
        ValueError: If the two sequences differ in length or are not one-dimensional.
    """
    e, c = np.asarray(errors, dtype=np.float64), np.asarray(comparison, dtype=np.float64)
    if e.shape != c.shape or e.ndim != 1:
        raise ValueError(f"skill needs the same cases twice, not shapes {e.shape} and {c.shape}")
    known = ~(np.isnan(e) | np.isnan(c))
    e, c = e[known], c[known]
    if not e.size or c.mean() <= 0:
        return Pooled(mean=math.nan, low=math.nan, high=math.nan, level=level, cases=int(e.size))
    draws = _draw_cases(e.size, resamples, seed)
    below = c[draws].mean(axis=1)
    ratios = 1 - e[draws].mean(axis=1)[below > 0] / below[below > 0]
    return _with_interval(1 - float(e.mean() / c.mean()), ratios, level, e.size)


def _draw_cases(cases: int, resamples: int, seed: int) -> npt.NDArray[np.int64]:
    """Draw the indices of cases for all bootstrap resamples, shape (resamples, cases)."""
    return np.random.default_rng(seed).integers(0, cases, size=(resamples, cases))


def _with_interval(mean: float, resampled: FloatArray, level: float, cases: int) -> Pooled:
    low, high = np.quantile(resampled, [(1 - level) / 2, (1 + level) / 2])
    return Pooled(mean=mean, low=float(low), high=float(high), level=level, cases=cases)
