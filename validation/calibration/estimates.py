"""Estimated quantities with confidence intervals, and noise, creep and scatter between recordings of one load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from meshes.array import FloatArray
from validation.calibration.forward_fit import ForwardFit

#: Smallest number of recordings from which mean and interval of noise and creep are computed [-].
_FEWEST_RECORDINGS = 3


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """An estimated quantity with its confidence interval.

    Attributes:
        value: The estimate.
        low: Lower end of the interval.
        high: Upper end of the interval.
        unit: Unit of `value`, `low` and `high`.
        fitted_on: Description of the data that the estimate was computed from.
    """

    value: float
    low: float
    high: float
    unit: str
    fitted_on: str

    @classmethod
    def symmetric(cls, value: float, half_width: float, unit: str, fitted_on: str) -> Estimate:
        """Make an estimate whose interval is `value - half_width` to `value + half_width`."""
        return cls(value=value, low=value - half_width, high=value + half_width, unit=unit, fitted_on=fitted_on)


def estimate_mean(values: Sequence[float] | FloatArray, unit: str, confidence: float) -> Estimate | None:
    """Estimate a mean with Student's interval from independent values, NaN left out; None for fewer than three."""
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) < _FEWEST_RECORDINGS:
        return None
    half = student.ppf(0.5 + confidence / 2, len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known))
    return Estimate.symmetric(float(known.mean()), float(half), unit, f"{len(known)} recordings")


def measure_scatter(fit: ForwardFit, noise: Sequence[float], confidence: float) -> dict[str, Estimate]:
    """Estimate noise, creep and scatter between recordings of one load, each only if enough recordings allow it.

    Args:
        fit: The fitted forward model.
        noise: Standard deviation of a texel's counts in each image [counts].
        confidence: Confidence level of the intervals, 0..1 [-].

    Returns:
        Up to three estimates by name: `noise` is the standard deviation of a texel's counts from frame to frame
        [counts], `creep` the relative growth of counts per unit of ln(time) [-], and `hysteresis` the relative standard
        deviation between recordings of one load in one placement, with temperature allowed for [-].
    """
    found = {
        "noise": estimate_mean(noise, "counts", confidence),
        "creep": estimate_mean(fit.observations.creep, "per ln(time)", confidence),
        "hysteresis": _measure_repeatability(fit, confidence),
    }
    return {name: estimate for name, estimate in found.items() if estimate is not None}


def _measure_repeatability(fit: ForwardFit, confidence: float) -> Estimate | None:
    """Estimate the relative standard deviation of the sum of counts between recordings of one load and placement.

    Sums are divided by the predicted sum, so that temperature and age do not count.  None without repeats.
    """
    seen = fit.observations
    ratios: dict[tuple[str, float], list[float]] = {}
    predicted = np.where(seen.measured, fit.predict(seen), 0.0).sum(axis=1)
    recorded = np.where(seen.measured, seen.counts, 0.0).sum(axis=1)
    steady = [seen.groups.count(group) == 1 for group in seen.groups]
    for number, placement in enumerate(seen.placements):
        if steady[number] and recorded[number] > 0 and predicted[number] > 0:
            key = placement.name, float(seen.loads[number])
            ratios.setdefault(key, []).append(float(recorded[number] / predicted[number]))
    repeats = [np.array(values) for values in ratios.values() if len(values) > 1]
    freedom = sum(len(values) - 1 for values in repeats)
    if not freedom:
        return None
    square = sum(float(np.sum((values / values.mean() - 1) ** 2)) for values in repeats)
    low, high = (np.sqrt(square / chi2.ppf(0.5 + side * confidence / 2, freedom)) for side in (1, -1))
    return Estimate(
        value=float(np.sqrt(square / freedom)),
        low=float(low),
        high=float(high),
        unit="share",
        fitted_on=f"{len(repeats)} loads with {freedom + len(repeats)} recordings",
    )
