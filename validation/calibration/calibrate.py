"""Calibration: what a real sensor does with force, from recordings under known loads.

Two curves are fitted to the same images, the line of the 2015 report's kind and a polynomial of degree 5, each with a
gain per texel; further the saturation (where the loads reach it), the dependence on temperature (where it varies),
noise, drift under a constant load and the spread between recordings of one load.  Every number has an interval and
says what it was fitted on.  Where a force sensor was recorded beside the frames, its readings are the loads.

How a load is shared among texels must be known: from a tool on one texel, from a model, or as an assumption
(`flat_shares`); an error there goes into the gains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import WTS_0614_34
from fastmodel.signal.point_spread import Gaussian
from meshes import Indenter, TexelArray
from validation.calibration.curve_fit import FittedCurve, Form, Observations, fit_curve
from validation.calibration.noise_and_drift import Estimate, behaviour, estimate, load_on
from validation.recordings.recording import Recording, RecordingError

FloatArray = npt.NDArray[np.float64]

#: Texels with less than this share of the largest are left out: noise and dead zone are all they show [-].
_LEAST_SHARE = 0.15
#: Frames that are averaged where a force sensor gives a load for every frame, and blocks of a lone recording [-].
_FRAMES, _BLOCKS = 10, 8
#: Range of temperature from which on its effect is fitted [K].
_WARMTH = 5.0
#: Drift is told between these ages of a load [s].
_DRIFT = (2.0, 12.0)
#: Largest count that is believed, over the largest that was seen [-].
_LARGEST = 1.3
_SUBDIVISIONS = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """What was found.

    Attributes:
        line: The linear characteristic with gains.
        polynomial: The characteristic of degree 5 with gains; None where there are too few loads.
        estimates: Named numbers with intervals, of the line.
        gains: Factor per texel of the array, 1 where nothing was measured, shape (texels,) [-].
        gain_intervals: Half widths, NaN where nothing was measured, shape (texels,) [-].
        texels: Which texels were fitted, shape (n,).
        observations: What was fitted.
        report_line: The 2015 report's own line, sensitivity [1/N] and offset, to compare.
        confidence: Of the intervals [-].
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
    """Fit characteristic, gains and the rest to recordings under known loads.

    Args:
        recordings: Each with a load in its labels, or with a force sensor's readings.
        shares: Share of the load on each texel of the array, shape (texels,) [-].
        array: Which array of the recordings.
        threshold: Counts that the firmware subtracts; as the labels say when not given.
        window: Ages of the load between which frames are averaged [s].
        temperature_channel: Which temperature to use.
        confidence: Of the intervals, 0..1 [-].

    Raises:
        RecordingError: If a load is not known, a recording is empty or arrays differ in their texels.
        ValueError: If there is too little to fit.
    """
    _check_alike(recordings, array)
    texels = np.flatnonzero(shares > _LEAST_SHARE * shares.max())
    threshold = _threshold(recordings) if threshold is None else threshold
    parts = [_observe(each, array, shares, window, temperature_channel) for each in recordings]
    observations = _only(_joined(parts), texels)
    line = _best_line(observations, threshold, confidence)
    fitted_on = f"{line.recordings} recordings, {observations.loads.min():.3g}..{observations.loads.max():.3g} N"
    gains, widths = _gains(line, texels, len(shares))
    return Calibration(
        line=line,
        polynomial=_polynomial(observations, line, confidence),
        estimates={
            **_line_estimates(line, fitted_on),
            **behaviour(recordings, parts, line, array=array, texels=texels, confidence=confidence),
        },
        gains=gains,
        gain_intervals=widths,
        texels=texels,
        observations=observations,
        confidence=confidence,
    )


def flat_shares(
    array: TexelArray, indenter: Indenter, *, at: tuple[float, float] = (0.0, 0.0), spread: Gaussian | None = None
) -> FloatArray:
    """Shares of a load under a flat face if its pressure were uniform: an assumption, not a measurement.

    Args:
        array: The texels.
        indenter: A shape with a flat lower face.
        at: Its axis in the array's frame [m].
        spread: How the cover spreads force; not at all when not given.

    Returns:
        Shape (texels,) [-]; sums to less than 1 where force leaves the array.

    Raises:
        ValueError: If no part of a flat face lies on the array.
    """
    inner = (np.arange(_SUBDIVISIONS) + 0.5) / _SUBDIVISIONS - 0.5
    x = array.centres[:, 0, None, None] + inner[None, :, None] * array.pitch[0] - at[0]
    y = array.centres[:, 1, None, None] + inner[None, None, :] * array.pitch[1] - at[1]
    shape = np.broadcast_shapes(x.shape, y.shape)
    under = indenter.gap(np.broadcast_to(x, shape), np.broadcast_to(y, shape)) == 0
    area = (under & array.active[:, None, None]).mean(axis=(1, 2))
    if not area.any():
        raise ValueError("no flat face of the indenter lies on the array; shares must come from a model")
    shares = np.asarray(area / area.sum(), dtype=np.float64)
    return shares if spread is None else np.asarray(spread.operator(array) @ shares)


def middle(recordings: Sequence[Recording], array: int) -> tuple[float, float]:
    """Centre of pressure of the mean image over the second half of all recordings, in the array's frame [m]."""
    _check_alike(recordings, array)
    texels = recordings[0].arrays[array].texels
    images = [each.arrays[array].counts[len(each.times) // 2 :].mean(axis=0) for each in recordings]
    mean = np.mean(images, axis=0)
    if not mean.any():
        raise RecordingError(f"{recordings[0].path}: array {array} reads nothing; name the array that was pressed")
    x, y = mean @ texels.centres[:, :2] / mean.sum()
    return float(x), float(y)


def _check_alike(recordings: Sequence[Recording], array: int) -> None:
    """Refuse recordings without frames, and those of another array than the first."""
    for each in recordings:
        if not len(each.times):
            raise RecordingError(f"{each.path}: holds no frames; expected a recording under a load")
        if not each.arrays[array].has_layout_of(recordings[0].arrays[array].texels):
            raise RecordingError(
                f"{each.path}: array {array} is not laid out as that of {recordings[0].path}; "
                "expected recordings of one sensor"
            )


def _threshold(recordings: Sequence[Recording]) -> float:
    known = {float(each.setup.device["threshold"]) for each in recordings if "threshold" in each.setup.device}
    if len(known) > 1:
        raise RecordingError(f"the recordings have several thresholds: {sorted(known)}; calibrate each on its own")
    return known.pop() if known else 0.0


def _observe(
    recording: Recording, array: int, shares: FloatArray, window: tuple[float, float], channel: int
) -> Observations:
    """One mean image of a recording with a known load, or many where a force sensor tells the load."""
    counts = recording.arrays[array].counts.astype(np.float64)
    if counts.shape[1] != len(shares):
        raise RecordingError(f"{recording.path}: array {array} has {counts.shape[1]} texels; expected {len(shares)}")
    temperature = float(np.mean(recording.temperatures[:, channel])) if recording.temperatures.size else np.nan
    if len(recording.forces):
        return _under_force_sensor(recording, counts, shares, temperature)
    if recording.setup.load is None:
        raise RecordingError(f"{recording.path}: its load is not known; import it with --load, or a `force` column")
    age = recording.times - load_on(recording, counts)
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


def _under_force_sensor(
    recording: Recording, counts: FloatArray, shares: FloatArray, temperature: float
) -> Observations:
    loads = np.interp(recording.times, recording.force_times, recording.forces)
    pieces = np.array_split(np.arange(len(loads)), max(1, len(loads) // _FRAMES))
    mean_loads = np.array([loads[piece].mean() for piece in pieces])
    block = np.arange(len(pieces)) * _BLOCKS // len(pieces)
    return Observations(
        loads=np.maximum(mean_loads, 0.0),
        counts=np.array([counts[piece].mean(axis=0) for piece in pieces]),
        shares=shares,
        groups=tuple(f"{recording.path} part {number}" for number in block),
        temperatures=np.full(len(pieces), temperature),
    )


def _joined(parts: Sequence[Observations]) -> Observations:
    if not parts:
        raise ValueError("there are no recordings to calibrate with; name at least three")
    return Observations(
        loads=np.concatenate([part.loads for part in parts]),
        counts=np.concatenate([part.counts for part in parts]),
        shares=parts[0].shares,
        groups=tuple(group for part in parts for group in part.groups),
        temperatures=np.concatenate([part.temperatures for part in parts]),
    )


def _only(observations: Observations, texels: npt.NDArray[np.intp]) -> Observations:
    return replace(observations, counts=observations.counts[:, texels], shares=observations.shares[texels])


def _best_line(observations: Observations, threshold: float, confidence: float) -> FittedCurve:
    """With saturation where that explains the images better by far more than its two parameters must."""
    temperatures = observations.temperatures
    warm = bool(np.isfinite(temperatures).all() and np.ptp(temperatures) > _WARMTH)
    form = Form(
        degree=1,
        saturation=False,
        gains=observations.counts.shape[1] > 1,
        temperature=warm,
        threshold=threshold,
    )
    plain = fit_curve(observations, form, confidence=confidence)
    bent = fit_curve(observations, replace(form, saturation=True), confidence=confidence)
    size, top = observations.counts.size, float(observations.counts.max())
    largest = bent.values[bent.form.names(1).index("output_max")]
    gain = size * np.log(max(plain.residual, 1e-9) / max(bent.residual, 1e-9)) * 2
    # a largest count far above all that was seen is no saturation but a line that bends a little
    return bent if gain > 10 + 2 * np.log(size) and largest < _LARGEST * top else plain


def _polynomial(observations: Observations, line: FittedCurve, confidence: float) -> FittedCurve | None:
    """Degree 5 over what is not saturated."""
    degree = 5
    if len(np.unique(observations.loads)) < degree + 2:
        return None
    form = replace(line.form, degree=degree, saturation=line.form.saturation)
    return fit_curve(observations, form, confidence=confidence)


def _line_estimates(line: FittedCurve, fitted_on: str) -> dict[str, Estimate]:
    """Numbers of the line with their intervals."""
    names = line.form.names(1)
    units = {
        "c0": "counts",
        "c1": "counts/N",
        "temperature": "1/K",
        "output_max": "counts",
        "saturation_band": "counts",
    }
    words = {"c0": "offset", "c1": "sensitivity"}
    estimates = {}
    for index, name in enumerate(names):
        half = line.interval(np.eye(len(line.values))[index])
        value = float(line.values[index])
        estimates[words.get(name, name)] = estimate(value, half, units[name], fitted_on)
    offset, slope = line.values[:2]
    dead = (line.form.threshold - offset) / slope
    gradient = np.zeros(len(line.values))
    gradient[:2] = -1 / slope, -dead / slope
    estimates["dead_force"] = estimate(float(dead), line.interval(gradient), "N", fitted_on)
    return estimates


def _gains(line: FittedCurve, texels: npt.NDArray[np.intp], count: int) -> tuple[FloatArray, FloatArray]:
    """Gains and half widths of their intervals, for every texel of the array."""
    gains, widths = np.ones(count), np.full(count, np.nan)
    free = len(texels) - 1
    if not line.form.gains:
        return gains, widths
    selected = np.zeros((len(texels), len(line.values)))
    selected[:free, -free:] = np.eye(free)
    selected[free, -free:] = -1
    gains[texels] = np.append(line.values[-free:], len(texels) - line.values[-free:].sum())
    widths[texels] = [line.interval(row) for row in selected]
    return gains, widths
