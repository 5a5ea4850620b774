"""Calibrates a real sensor: fits its counts as a function of texel force to recordings under known loads.

Two curves are fitted to the same mean images: a straight line, as in the 2015 report, and a polynomial of degree 5.
Each curve has a gain per texel.  Further results are the saturation (if the loads reach it), the dependence on
temperature (if the temperature varies), noise, drift under a constant load and the scatter between recordings of the
same load.  Every result has a confidence interval and names the data that it was fitted to.  If a force sensor was
recorded together with the frames, its readings are the loads.

The share of the load on each texel must be known: from a tool that presses a single texel, from a model, or from the
assumption of uniform pressure in `flat_shares`.  An error of the shares becomes an error of the gains.
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
from validation.calibration.loading import find_load_onset
from validation.calibration.noise_and_drift import Estimate, measure_noise_and_drift
from validation.metrics import centre_of_pressure
from validation.recordings.recording import FloatArray, Recording, RecordingError

#: Smallest share of the load on a fitted texel, over the largest share of any texel [-].  The counts of texels with
#: smaller shares are dominated by noise and by the dead zone, so these texels are left out.
_LEAST_SHARE = 0.15
#: Number of consecutive frames that are averaged to one image if a force sensor was recorded with the frames [-].
_FRAMES_PER_IMAGE = 10
#: Number of parts into which a recording with a force sensor is divided; each counts as an independent recording [-].
_BLOCKS = 8
#: Smallest range of temperature over all recordings for which a temperature coefficient is fitted [K].  In a smaller
#: range, noise dominates the effect of temperature.
_TEMPERATURE_RANGE = 5.0
#: Largest credible saturation count: fitted `output_max` over the largest recorded count [-].  A larger fitted value
#: describes a slight curvature of the characteristic, not a saturation.
_LARGEST_EXTRAPOLATION = 1.3
#: Degree of the polynomial characteristic, as in the 2015 report [-].
_DEGREE = 5
#: Number of points along each edge of a texel at which `flat_shares` samples the face of the indenter [-].
_SUBDIVISIONS = 12
#: Name in `Calibration.estimates` and unit of each parameter that all texels share, by its name in `CurveForm`.
_PARAMETERS = {
    "c0": ("offset", "counts"),
    "c1": ("sensitivity", "counts/N"),
    "temperature": ("temperature", "1/K"),
    "output_max": ("output_max", "counts"),
    "saturation_band": ("saturation_band", "counts"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Result of a calibration: fitted curves, and estimates with confidence intervals.

    Attributes:
        line: The fitted straight line from texel force to counts, with gains.
        polynomial: The fitted polynomial of degree 5 with gains; None if there are too few different loads.
        estimates: Parameters of the line, dead force, noise, drift and hysteresis, by name.
        gains: Gain of every texel of the array, shape (texels,); 1 for texels that were not fitted [-].
        gain_intervals: Half width of the confidence interval of each gain, shape (texels,); NaN for texels that were
            not fitted [-].
        texels: Indices of the n fitted texels, shape (n,).
        observations: The mean images that the curves were fitted to.
        report_line: Sensitivity [1/N] and offset [-] of the straight line in the 2015 report, for comparison.
        confidence: Confidence level of the intervals, 0..1 [-].
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
        """Return all results by name, as numbers, text, arrays and nested dicts."""
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
    """Estimate characteristic, gains, noise and drift of a sensor from recordings under known loads.

    Args:
        recordings: Recordings with a load in their labels, or with readings of a force sensor.
        shares: Share of the load on each texel of the array, shape (texels,) [-].
        array: Index of the pressed array in the recordings.
        threshold: Counts that the firmware subtracts; taken from the labels of the recordings when not given [-].
        window: First and last time after the load was applied between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor whose readings are used.
        confidence: Confidence level of the intervals, 0..1 [-].

    Raises:
        RecordingError: If a load is unknown, a recording is empty, or the arrays of the recordings differ.
        ValueError: If there are too few recordings or too few different loads.
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
    """Return the share of a load on each texel if the flat face of an indenter presses with uniform pressure.

    Args:
        array: The texels.
        indenter: An indenter with a flat lower face.
        at: Position of the indenter's axis in the array's frame, x and y [m].
        spread: Gaussian kernel by which the cover spreads force to neighbouring texels; no spread when not given.

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
    """Find where an array was pressed: the centre of pressure of its mean image over the second half of all recordings.

    Args:
        recordings: Recordings of one sensor under load.
        array: Index of the pressed array in the recordings.

    Returns:
        Position x, y in the array's frame [m].

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
    """Raise `RecordingError` if a recording has no frames or its array differs from that of the first recording."""
    for each in recordings:
        if not len(each.times):
            raise RecordingError(f"{each.path}: holds no frames; expected a recording under a load")
        if not each.arrays[array].has_layout_of(recordings[0].arrays[array].texels):
            raise RecordingError(
                f"{each.path}: array {array} is not laid out as that of {recordings[0].path}; "
                "expected recordings of one sensor"
            )


def _find_threshold(recordings: Sequence[Recording]) -> float:
    """Return the firmware's threshold from the labels of the recordings [counts]; 0 if no label contains one."""
    labelled = {float(each.setup.device["threshold"]) for each in recordings if "threshold" in each.setup.device}
    if len(labelled) > 1:
        raise RecordingError(f"the recordings have several thresholds: {sorted(labelled)}; calibrate each on its own")
    return labelled.pop() if labelled else 0.0


def _average_frames(
    recording: Recording, array: int, shares: FloatArray, window: tuple[float, float], channel: int
) -> Observations:
    """Average the frames of a recording to one image under its known load.

    If the recording holds readings of a force sensor, the result is a series of images, each under its own load.
    """
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
    """Average every `_FRAMES_PER_IMAGE` frames to one image, with the mean reading of the force sensor as its load.

    The recording is divided into `_BLOCKS` parts, which the fit takes as independent recordings.
    """
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
    """Join the observations of all recordings to one set that holds the fitted texels only."""
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
    """Fit the straight line without and with saturation; return the one with saturation only if it fits much better."""
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
    # Saturation adds two parameters.  Twice the increase of the log likelihood must exceed the penalty of two
    # parameters in the Bayesian information criterion, 2 ln(number of counts), by ten.
    gain = counts.size * np.log(max(straight.residual, 1e-9) / max(bent.residual, 1e-9)) * 2
    credible = bent.value("output_max") < _LARGEST_EXTRAPOLATION * float(counts.max())
    return bent if credible and gain > 10 + 2 * np.log(counts.size) else straight


def _line_estimates(line: FittedCurve, observations: Observations) -> dict[str, Estimate]:
    """Return the parameters of the fitted line and the force below which a texel reads zero, with their intervals."""
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
    """Return gain and half width of its confidence interval for each of the `count` texels of the array, two arrays.

    The fit determines all gains but one; the last gain follows because the mean over the fitted texels is 1.
    """
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
    """Return the parameters of a fitted curve with the half widths of their intervals, by name."""
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
