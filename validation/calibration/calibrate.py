"""Calibration of a real sensor: its counts as a function of force, from recordings under known loads.

Two curves are fitted to the same images: a straight line, as in the 2015 report, and a polynomial of degree 5.  Both
have a gain per texel.  Further results are the saturation (if the loads reach it), the dependence on temperature (if it
varies), noise, drift under a constant load and the spread between recordings of one load.  Every number has an interval
and names the data that it was fitted on.  If a force sensor was recorded with the frames, its readings are the loads.

The share of the load on each texel must be known: from a tool on a single texel, from a model, or by the assumption of
`flat_shares`.  An error of the shares becomes an error of the gains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import WTS_0614_34
from fastmodel.signal.point_spread import Gaussian
from meshes import Indenter, TexelArray
from validation.calibration.curve_fit import CurveForm, FittedCurve, Observations, fit_curve
from validation.calibration.noise_and_drift import Estimate, find_load_onset, measure_noise_and_drift
from validation.metrics import centre_of_pressure
from validation.recordings.recording import FloatArray, Recording, RecordingError

#: Texels with less than this share of the largest are left out: noise and dead zone dominate their counts [-].
_LEAST_SHARE = 0.15
#: Frames in one mean image where a force sensor gives a load for every frame [-].
_FRAMES_PER_IMAGE = 10
#: Blocks of such a recording that count as independent recordings [-].
_BLOCKS = 8
#: Smallest range of temperature for which its effect is fitted: below it, noise dominates [K].
_TEMPERATURE_RANGE = 5.0
#: Largest fitted `output_max` over the largest recorded count: a larger one fits a slight bend, not a saturation [-].
_LARGEST_EXTRAPOLATION = 1.3
#: Degree of the second characteristic, as in the 2015 report [-].
_DEGREE = 5
#: Points along each edge of a texel at which `flat_shares` samples the face of the indenter [-].
_SUBDIVISIONS = 12
#: Units of the parameters that all texels share, and their names in `Calibration.estimates`.
_PARAMETERS = {
    "c0": ("offset", "counts"),
    "c1": ("sensitivity", "counts/N"),
    "temperature": ("temperature", "1/K"),
    "output_max": ("output_max", "counts"),
    "saturation_band": ("saturation_band", "counts"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """The fitted curves and every number with its interval.

    Attributes:
        line: The linear characteristic with gains.
        polynomial: The characteristic of degree 5 with gains; None if there are too few loads.
        estimates: Named numbers of the line with intervals.
        gains: Gain of every texel of the array, 1 where nothing was measured, shape (texels,) [-].
        gain_intervals: Half widths, NaN where nothing was measured, shape (texels,) [-].
        texels: Indices of the fitted texels, shape (n,).
        observations: The data of the fit.
        report_line: Sensitivity [1/N] and offset [-] of the 2015 report's line, for comparison.
        confidence: Confidence of the intervals [-].
    """

    line: FittedCurve
    polynomial: FittedCurve | None
    estimates: Mapping[str, Estimate]
    gains: FloatArray
    gain_intervals: FloatArray
    texels: npt.NDArray[np.intp]
    observations: Observations
    report_line: tuple[float, float] = (WTS_0614_34.sensitivity, WTS_0614_34.offset)
    confidence: float = 0.95

    def as_json(self) -> dict[str, Any]:
        """Every number, by name."""
        sensitivity, offset = self.report_line
        return {
            "confidence": self.confidence,
            "estimates": {name: vars(estimate) for name, estimate in self.estimates.items()},
            "gains": self.gains,
            "gain_half_widths": self.gain_intervals,
            "texels": self.texels,
            "line": _describe_curve(self.line),
            "polynomial": None if self.polynomial is None else _describe_curve(self.polynomial),
            "report_line": {"sensitivity": sensitivity, "offset": offset},
        }


def calibrate(
    recordings: Sequence[Recording],
    *,
    shares: FloatArray,
    array: int = 0,
    threshold: float | None = None,
    window: tuple[float, float] = (6.0, 9.0),
    temperature_channel: int = -1,
    confidence: float = 0.95,
) -> Calibration:
    """Fit characteristic, gains, noise and drift to recordings under known loads.

    Args:
        recordings: Recordings with a load in their labels, or with readings of a force sensor.
        shares: Share of the load on each texel of the array, shape (texels,) [-].
        array: Index of the array in the recordings.
        threshold: Counts that the firmware subtracts; from the labels when not given [-].
        window: Times after the load was applied between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor.
        confidence: Confidence of the intervals, 0..1 [-].

    Raises:
        RecordingError: If a load is unknown, a recording is empty, or the arrays of the recordings differ.
        ValueError: If there are too few recordings or loads.
    """
    _check_alike(recordings, array)
    texels = np.flatnonzero(shares > _LEAST_SHARE * shares.max())
    threshold = _find_threshold(recordings) if threshold is None else threshold
    parts = [_average_frames(each, array, shares, window, temperature_channel) for each in recordings]
    observations = _join_observations(parts, texels)
    line = _fit_line(observations, threshold, confidence)
    gains, half_widths = _gains_of_array(line, texels, len(shares))
    polynomial = None
    if len(np.unique(observations.loads)) >= _DEGREE + 2:
        polynomial = fit_curve(observations, replace(line.form, degree=_DEGREE), confidence=confidence)
    return Calibration(
        line=line,
        polynomial=polynomial,
        estimates={
            **_line_estimates(line, observations),
            **measure_noise_and_drift(recordings, parts, line, array=array, texels=texels, confidence=confidence),
        },
        gains=gains,
        gain_intervals=half_widths,
        texels=texels,
        observations=observations,
        confidence=confidence,
    )


def flat_shares(
    array: TexelArray, indenter: Indenter, *, at: tuple[float, float] = (0.0, 0.0), spread: Gaussian | None = None
) -> FloatArray:
    """Return the share of a load that acts on each texel under a flat face with uniform pressure.

    Args:
        array: The texels.
        indenter: A shape with a flat lower face.
        at: Position of the indenter's axis in the array's frame [m].
        spread: Spread of the force by the cover; without it the force is not spread.

    Returns:
        Shares, shape (texels,) [-].  Their sum is less than 1 if part of the force acts outside the array.

    Raises:
        ValueError: If no part of a flat face lies on the array.
    """
    inner = (np.arange(_SUBDIVISIONS) + 0.5) / _SUBDIVISIONS - 0.5
    x = array.centres[:, 0, None, None] + inner[None, :, None] * array.pitch[0] - at[0]
    y = array.centres[:, 1, None, None] + inner[None, None, :] * array.pitch[1] - at[1]
    under = indenter.gap(*np.broadcast_arrays(x, y)) == 0
    area = (under & array.active[:, None, None]).mean(axis=(1, 2))
    if not area.any():
        raise ValueError("no flat face of the indenter lies on the array; shares must come from a model")
    shares = np.asarray(area / area.sum(), dtype=np.float64)
    return shares if spread is None else np.asarray(spread.operator(array) @ shares)


def find_pressed_position(recordings: Sequence[Recording], array: int) -> tuple[float, float]:
    """Centre of pressure of the mean image over the second half of all recordings, in the array's frame [m].

    Raises:
        RecordingError: If the array reads zero throughout, a recording is empty, or the arrays differ.
    """
    _check_alike(recordings, array)
    texels = recordings[0].arrays[array].texels
    images = [each.arrays[array].counts[len(each.times) // 2 :].mean(axis=0) for each in recordings]
    mean = np.mean(images, axis=0)
    if not mean.any():
        raise RecordingError(f"{recordings[0].path}: array {array} reads zero; name the array that was pressed")
    x, y = centre_of_pressure(mean, texels.centres[:, :2]).tolist()
    return x, y


def _check_alike(recordings: Sequence[Recording], array: int) -> None:
    """Refuse recordings without frames, and recordings of different arrays."""
    for each in recordings:
        if not len(each.times):
            raise RecordingError(f"{each.path}: holds no frames; expected a recording under a load")
        if not each.arrays[array].has_layout_of(recordings[0].arrays[array].texels):
            raise RecordingError(
                f"{each.path}: array {array} is not laid out as that of {recordings[0].path}; "
                "expected recordings of one sensor"
            )


def _find_threshold(recordings: Sequence[Recording]) -> float:
    """The threshold in the labels of the recordings; 0 if no label names one [-]."""
    labelled = {float(each.setup.device["threshold"]) for each in recordings if "threshold" in each.setup.device}
    if len(labelled) > 1:
        raise RecordingError(f"the recordings have several thresholds: {sorted(labelled)}; calibrate each on its own")
    return labelled.pop() if labelled else 0.0


def _average_frames(
    recording: Recording, array: int, shares: FloatArray, window: tuple[float, float], channel: int
) -> Observations:
    """One mean image of a recording with a known load, or many if a force sensor gives the loads."""
    counts = recording.arrays[array].counts.astype(np.float64)
    if counts.shape[1] != len(shares):
        raise RecordingError(f"{recording.path}: array {array} has {counts.shape[1]} texels; expected {len(shares)}")
    temperature = float(np.mean(recording.temperatures[:, channel])) if recording.temperatures.size else np.nan
    if len(recording.forces):
        return _average_with_force_sensor(recording, counts, shares, temperature)
    if recording.setup.load is None:
        raise RecordingError(f"{recording.path}: its load is not known; import it with --load, or a `force` column")
    age = recording.times - find_load_onset(recording.times, counts)
    steady = counts[(age >= window[0]) & (age <= window[1])]
    if not len(steady):
        raise RecordingError(f"{recording.path}: ends before a load is {window[0]:g} s old; name an earlier window")
    return Observations(
        loads=np.array([recording.setup.load]),
        counts=steady.mean(axis=0)[None],
        shares=shares,
        groups=(str(recording.path),),
        temperatures=np.array([temperature]),
    )


def _average_with_force_sensor(
    recording: Recording, counts: FloatArray, shares: FloatArray, temperature: float
) -> Observations:
    """Mean images of a few frames each; blocks of the recording count as independent recordings."""
    loads = np.interp(recording.times, recording.force_times, recording.forces)
    pieces = np.array_split(np.arange(len(loads)), max(1, len(loads) // _FRAMES_PER_IMAGE))
    blocks = np.arange(len(pieces)) * _BLOCKS // len(pieces)
    return Observations(
        loads=np.array([max(loads[piece].mean(), 0.0) for piece in pieces]),
        counts=np.array([counts[piece].mean(axis=0) for piece in pieces]),
        shares=shares,
        groups=tuple(f"{recording.path} part {number}" for number in blocks),
        temperatures=np.full(len(pieces), temperature),
    )


def _join_observations(parts: Sequence[Observations], texels: npt.NDArray[np.intp]) -> Observations:
    """All observations together, of the fitted texels only."""
    if not parts:
        raise ValueError("there are no recordings to calibrate with; name at least three")
    return Observations(
        loads=np.concatenate([part.loads for part in parts]),
        counts=np.concatenate([part.counts[:, texels] for part in parts]),
        shares=parts[0].shares[texels],
        groups=tuple(group for part in parts for group in part.groups),
        temperatures=np.concatenate([part.temperatures for part in parts]),
    )


def _fit_line(observations: Observations, threshold: float, confidence: float) -> FittedCurve:
    """The line without or with saturation: with it only if it explains the images much better."""
    temperatures, counts = observations.temperatures, observations.counts
    form = CurveForm(
        degree=1,
        saturation=False,
        gains=counts.shape[1] > 1,
        temperature=bool(np.isfinite(temperatures).all() and np.ptp(temperatures) > _TEMPERATURE_RANGE),
        threshold=threshold,
    )
    straight = fit_curve(observations, form, confidence=confidence)
    bent = fit_curve(observations, replace(form, saturation=True), confidence=confidence)
    # Twice the gain in log likelihood must exceed the Bayesian information criterion of two parameters by ten.
    gain = counts.size * np.log(max(straight.residual, 1e-9) / max(bent.residual, 1e-9)) * 2
    credible = bent.value("output_max") < _LARGEST_EXTRAPOLATION * float(counts.max())
    return bent if credible and gain > 10 + 2 * np.log(counts.size) else straight


def _line_estimates(line: FittedCurve, observations: Observations) -> dict[str, Estimate]:
    """The parameters of the line, and the force below which it reads zero, with their intervals."""
    loads = observations.loads
    fitted_on = f"{line.recordings} recordings, {loads.min():.3g}..{loads.max():.3g} N"
    estimates = {}
    for parameter, half_width in zip(line.form.shared_names, line.half_widths.tolist(), strict=False):
        name, unit = _PARAMETERS[parameter]
        estimates[name] = Estimate.symmetric(line.value(parameter), half_width, unit, fitted_on)
    slope = line.value("c1")
    dead_force = (line.form.threshold - line.value("c0")) / slope
    gradient = np.zeros(len(line.values))
    gradient[:2] = -1 / slope, -dead_force / slope
    estimates["dead_force"] = Estimate.symmetric(dead_force, line.interval(gradient), "N", fitted_on)
    return estimates


def _gains_of_array(line: FittedCurve, texels: npt.NDArray[np.intp], count: int) -> tuple[FloatArray, FloatArray]:
    """Gains of every texel of the array, and half widths of their intervals; their mean over fitted texels is 1."""
    gains, half_widths = np.ones(count), np.full(count, np.nan)
    if not line.form.gains:
        return gains, half_widths
    free = len(texels) - 1
    gradients = np.zeros((len(texels), len(line.values)))
    gradients[:free, -free:] = np.eye(free)
    gradients[free, -free:] = -1
    gains[texels] = np.append(line.values[-free:], len(texels) - line.values[-free:].sum())
    half_widths[texels] = [line.interval(gradient) for gradient in gradients]
    return gains, half_widths


def _describe_curve(curve: FittedCurve) -> dict[str, Any]:
    return {
        "residual_rms_counts": curve.residual,
        "recordings": curve.recordings,
        "threshold": curve.form.threshold,
        "reference_temperature": curve.reference if curve.form.temperature else None,
        "parameters": {
            name: {"value": curve.value(name), "half_width": half_width}
            for name, half_width in zip(curve.form.shared_names, curve.half_widths.tolist(), strict=False)
        },
    }
