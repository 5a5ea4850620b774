"""What a sensor does that its characteristic does not say: noise, drift and spread between recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2
from scipy.stats import t as student

from validation.calibration.curve_fit import FittedCurve, Observations
from validation.recordings.recording import Recording

FloatArray = npt.NDArray[np.float64]

#: A load counts as on when the sum of counts passes this share of its final value [-].
_ON = 0.5
#: The final value is the median over this last part of a recording [s].
_LAST = 2.0
#: Drift is told between these ages of a load, each averaged over twice the half window [s].
_DRIFT, _HALF_WINDOW = (2.0, 12.0), 0.5
_LEAST_RECORDINGS = 3


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number with its interval.

    Attributes:
        value: The estimate.
        low: Lower end of the interval.
        high: Upper end of the interval.
        unit: Its unit.
        fitted_on: What it comes from.
    """

    value: float
    low: float
    high: float
    unit: str
    fitted_on: str


def behaviour(
    recordings: Sequence[Recording],
    parts: Sequence[Observations],
    line: FittedCurve,
    *,
    array: int,
    texels: npt.NDArray[np.intp],
    confidence: float,
) -> dict[str, Estimate]:
    """Noise, drift and the spread between recordings of one load, as far as the recordings tell."""
    found: dict[str, Estimate] = {}
    ceiling, parts = _knee(line), _at_one_temperature(parts, line)
    noise = [_noise(each.arrays[array].counts[:, texels], ceiling) for each in recordings]
    drift = [_drift(each, array, texels) for each in recordings]
    for name, measured, unit in (("noise", noise, "counts"), ("drift", drift, "share, 2 s to 12 s")):
        values = [value for value in measured if np.isfinite(value)]
        if len(values) >= _LEAST_RECORDINGS:
            half = student.ppf(0.5 + confidence / 2, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
            found[name] = estimate(float(np.mean(values)), float(half), unit, f"{len(values)} recordings")
    repeated = _repeatability(parts, texels, confidence)
    return found if repeated is None else {**found, "hysteresis": repeated}


def _at_one_temperature(parts: Sequence[Observations], line: FittedCurve) -> list[Observations]:
    """Take the effect of the temperature out, so that it is not taken for hysteresis."""
    if not line.form.temperature:
        return list(parts)
    slope = float(line.values[line.form.names(1).index("temperature")])
    return [
        replace(part, counts=part.counts / (1 + slope * (part.temperatures - line.reference))[:, None])
        for part in parts
    ]


def _noise(counts: npt.NDArray[np.int32], ceiling: float) -> float:
    """Standard deviation from frame to frame, of texels between zero and saturation in every frame."""
    steady = counts[len(counts) // 2 :]
    live = steady[:, (steady > 0).all(axis=0) & (steady < ceiling).all(axis=0)].astype(np.float64)
    return float(np.sqrt(np.mean(np.diff(live, axis=0) ** 2) / 2)) if live.size else np.nan


def _knee(line: FittedCurve) -> float:
    """Counts above which the line bends into saturation."""
    if not line.form.saturation:
        return math.inf
    values = dict(zip(line.form.names(1), line.values.tolist(), strict=False))
    return float(values["output_max"] - abs(values["saturation_band"]))


def _drift(recording: Recording, array: int, texels: npt.NDArray[np.intp]) -> float:
    counts = recording.arrays[array].counts[:, texels].astype(np.float64)
    age = recording.times - load_on(recording, counts)
    early, late = (counts[np.abs(age - moment) < _HALF_WINDOW].sum(axis=1) for moment in _DRIFT)
    return float(late.mean() / early.mean() - 1) if len(early) and len(late) and early.any() else np.nan


def _repeatability(parts: Sequence[Observations], texels: npt.NDArray[np.intp], confidence: float) -> Estimate | None:
    """Relative standard deviation between recordings of one load, pooled over loads."""
    totals: dict[float, list[float]] = {}
    for part in parts:
        if len(part.loads) == 1:
            totals.setdefault(float(part.loads[0]), []).append(float(part.counts[0, texels].sum()))
    repeats = [np.array(values) for values in totals.values() if len(values) > 1 and min(values) > 0]
    freedom = sum(len(values) - 1 for values in repeats)
    if not freedom:
        return None
    square = sum(float(np.sum((values / values.mean() - 1) ** 2)) for values in repeats)
    low, high = (np.sqrt(square / chi2.ppf(0.5 + side * confidence / 2, freedom)) for side in (1, -1))
    on = f"{len(repeats)} loads with {freedom + len(repeats)} recordings"
    return Estimate(
        value=float(np.sqrt(square / freedom)), low=float(low), high=float(high), unit="share", fitted_on=on
    )


def load_on(recording: Recording, counts: FloatArray) -> float:
    """When the load came on, after the first frame; counts of shape (frames, n) [s]."""
    total = counts.sum(axis=1)
    final = float(np.median(total[recording.times >= recording.times[-1] - _LAST]))
    above = np.flatnonzero(total < _ON * final)
    return float(recording.times[min(above[-1] + 1, len(total) - 1)]) if len(above) else 0.0


def estimate(value: float, half: float, unit: str, fitted_on: str) -> Estimate:
    """A number with an interval of the same width on both sides."""
    return Estimate(value=value, low=value - half, high=value + half, unit=unit, fitted_on=fitted_on)
