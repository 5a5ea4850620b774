"""Measures noise, drift and repeatability of a sensor from recordings under constant loads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2
from scipy.stats import t as student

from validation.calibration.curve_fit import FittedCurve, Observations
from validation.calibration.loading import find_load_onset
from validation.recordings.recording import FloatArray, Recording

#: Drift is the relative change of the sum of counts between these two times after the load was applied [s].
_DRIFT_AGES = (2.0, 12.0)
#: Half the length of the interval around each of the two times of `_DRIFT_AGES` over which frames are averaged [s].
_HALF_WINDOW = 0.5
#: Smallest number of recordings from which mean and interval of noise and drift are computed [-].
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


def measure_noise_and_drift(
    recordings: Sequence[Recording],
    observations: Sequence[Observations],
    line: FittedCurve,
    *,
    array: int,
    texels: npt.NDArray[np.intp],
    confidence: float,
) -> dict[str, Estimate]:
    """Estimate noise, drift and scatter between recordings of one load, each only if enough recordings allow it.

    Args:
        recordings: The recordings.
        observations: Mean images of each recording.
        line: The fitted characteristic.
        array: Index of the pressed array in the recordings.
        texels: Indices of the n fitted texels, shape (n,).
        confidence: Confidence level of the intervals, 0..1 [-].

    Returns:
        Up to three estimates by name: `noise` is the standard deviation of a texel's counts from frame to frame
        [counts], `drift` the relative change of the sum of counts from 2 s to 12 s after loading [-], and `hysteresis`
        the relative standard deviation between recordings of one load [-].
    """
    found: dict[str, Estimate] = {}
    # Counts above this ceiling lie in the saturation band, where the bend of the characteristic reduces their noise.
    bent = line.form.saturation
    ceiling = line.value("output_max") - abs(line.value("saturation_band")) if bent else math.inf
    noise = [_frame_noise(each.arrays[array].counts[:, texels], ceiling) for each in recordings]
    drift = [_drift(each, each.arrays[array].counts[:, texels].astype(np.float64)) for each in recordings]
    for name, measured, unit in (("noise", noise, "counts"), ("drift", drift, "share, 2 s to 12 s")):
        values = [value for value in measured if np.isfinite(value)]
        if len(values) >= _FEWEST_RECORDINGS:
            quantile = student.ppf(0.5 + confidence / 2, len(values) - 1)
            half = quantile * np.std(values, ddof=1) / np.sqrt(len(values))
            found[name] = Estimate.symmetric(float(np.mean(values)), float(half), unit, f"{len(values)} recordings")
    repeated = _repeatability(_at_one_temperature(observations, line), texels, confidence)
    return found if repeated is None else {**found, "hysteresis": repeated}


def _at_one_temperature(observations: Sequence[Observations], line: FittedCurve) -> list[Observations]:
    """Divide counts by the fitted temperature factor, so that an effect of temperature is not taken for hysteresis."""
    if not line.form.temperature:
        return list(observations)
    slope = line.value("temperature")
    return [
        replace(each, counts=each.counts / (1 + slope * (each.temperatures - line.reference))[:, None])
        for each in observations
    ]


def _frame_noise(counts: npt.NDArray[np.int32], ceiling: float) -> float:
    """Return the standard deviation of counts from frame to frame over the second half of a recording [counts].

    Only texels with counts between zero and `ceiling` in every frame are used; the result is NaN if there are none.
    """
    steady = counts[len(counts) // 2 :]
    live = steady[:, (steady > 0).all(axis=0) & (steady < ceiling).all(axis=0)].astype(np.float64)
    return float(np.sqrt(np.mean(np.diff(live, axis=0) ** 2) / 2)) if live.size else np.nan


def _drift(recording: Recording, counts: FloatArray) -> float:
    """Return the relative change of the sum of counts between the two times of `_DRIFT_AGES` after loading [-].

    The result is NaN if the recording is too short.
    """
    age = recording.times - find_load_onset(recording.times, counts)
    early, late = (counts[np.abs(age - moment) < _HALF_WINDOW].sum(axis=1) for moment in _DRIFT_AGES)
    return float(late.mean() / early.mean() - 1) if len(early) and len(late) and early.any() else np.nan


def _repeatability(
    observations: Sequence[Observations], texels: npt.NDArray[np.intp], confidence: float
) -> Estimate | None:
    """Estimate the relative standard deviation of the sum of counts between recordings of one load, pooled over loads.

    The result is None if no load was recorded more than once.
    """
    totals: dict[float, list[float]] = {}
    for each in observations:
        if len(each.loads) == 1:
            totals.setdefault(float(each.loads[0]), []).append(float(each.counts[0, texels].sum()))
    repeats = [np.array(values) for values in totals.values() if len(values) > 1 and min(values) > 0]
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
