"""Means of quantities over cases, with intervals that are honest for few cases.

A case is an indentation of a campaign or a load of a recording.  The interval is Student's t, widened on the side of
the longer tail by the skewness of the cases: the first term of the Edgeworth expansion of the t statistic (N. J.
Johnson, J. Am. Stat. Assoc. 73, 1978, 536-544).  From 3 to 17 cases its nominal 95 % cover 95 % to 97 % of normal draws
and 93 % to 95 % of log-normal draws of sigma 0.5; of log-normal draws of sigma 1 only 87 % to 91 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import stdtrit

from meshes.array_types import FloatArray
from validation.results import Number, Result, result_model

#: Smallest number of cases with an interval [-].
FEWEST_OF_INTERVAL = 3
#: Smallest number of cases that decide a requirement or rank two models [-].
FEWEST = 5


@result_model
class Pooled(Result):
    """Mean of a quantity over cases, with its confidence interval.

    Attributes:
        mean: Mean over the cases in which the quantity exists, in the unit of the quantity.
        low: Lower end of the interval, same unit; NaN without an interval.
        high: Upper end of the interval, same unit; NaN without an interval.
        level: Nominal coverage of the interval [-].
        cases: Number of cases over which the mean is taken [-].
    """

    mean: Number
    low: Number
    high: Number
    level: float
    cases: int

    @property
    def few(self) -> bool:
        """Whether the cases are too few to decide a requirement or to rank two models."""
        return self.cases < FEWEST

    def describe(self, form: str = "{:.3g}", *, factor: float = 1.0, unit: str = "") -> str:
        """Describe the interval in words, or the reason why there is none.

        Args:
            form: Format of a number.
            factor: Factor to the printed unit [-].
            unit: The printed unit.
        """
        if not self.cases:
            return "no case"
        if not math.isnan(self.low):
            ends = (form.format(factor * end) for end in (self.low, self.high))
            return f"{100 * self.level:g} % interval {' to '.join(ends)} {unit}".strip()
        one = f"{self.cases} cases" if self.cases > 1 else "1 case"
        return f"{one}, no interval" if self.cases < FEWEST_OF_INTERVAL else f"the same in all {one}"


def pool(values: Sequence[float] | FloatArray, *, level: float = 0.95) -> Pooled:
    """Compute the mean of a quantity over cases, with its interval.

    With the mean m, the standard deviation s, the skewness g and the quantile q of Student's t, the interval is
    m -+ q s / sqrt(n), and one end is moved outward by abs(g) s (1 + 2 q^2) / (6 n).  There is no interval below three
    cases, nor where all cases have the same value.

    Args:
        values: One number per case; NaN in cases in which the quantity does not exist.
        level: Nominal coverage of the interval [-].
    """
    known = np.asarray(values, dtype=np.float64)
    known = known[~np.isnan(known)]
    count = int(known.size)
    mean = float(known.mean()) if count else math.nan
    low = high = math.nan
    apart = known - mean
    variance = float((apart**2).sum() / max(count - 1, 1))
    # Differences by rounding are no scatter.
    if count >= FEWEST_OF_INTERVAL and math.sqrt(variance) > max(1e-12 * float(np.abs(known).max()), 1e-100):
        third = float((apart**3).sum() * count / ((count - 1) * (count - 2)))
        quantile = float(stdtrit(count - 1, (1 + level) / 2))
        half = quantile * math.sqrt(variance / count)
        skewed = third / variance * (1 + 2 * quantile**2) / (6 * count)
        low, high = mean - half + min(skewed, 0.0), mean + half + max(skewed, 0.0)
    return Pooled(mean=mean, low=low, high=high, level=level, cases=count)


def skill(
    errors: Sequence[float] | FloatArray, comparison: Sequence[float] | FloatArray, *, level: float = 0.95
) -> Pooled:
    """Compute the skill of a model, 1 - mean error / mean error of a comparison model [-], with its interval.

    The interval is that of the mean of the paired values that the ratio of means has to first order in each case.

    Args:
        errors: Error of the model in each case; NaN in cases in which the error does not exist.
        comparison: Error of the comparison model in the same cases.
        level: Nominal coverage of the interval [-].

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
    ratio = e.mean() / c.mean()
    return pool(1 - ratio - (e - ratio * c) / c.mean(), level=level)
