"""Calibrates a real sensor: fits the forward model to images under known loads, with confidence intervals.

The share of a load on each texel follows from the cover of the sensor and the pose of the tool, by a contact method of
the fast model or by finite elements.  The fitted parameters are the poses that are not given, a straight line from
texel force to counts with a gain per texel, the saturation if the loads reach it, and temperature coefficients if the
data allow.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import tomli_w
from pydantic import Field

from fastmodel import METHODS
from fastmodel.signal.creep import MOST_CREEP
from fastmodel.signal.electronics import TEXEL_FORCE, WTS_0614_34, grey_levels
from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.calibration.forward_fit import ForwardFit, Options, compute_forces, fit_forward
from validation.calibration.model import (
    CREEP_START,
    REFERENCE,
    BoolArray,
    ContactMethod,
    Observations,
    make_fast_method,
    make_reference_method,
)
from validation.calibration.point_load import PointLoadCalibration, calibrate_point_load
from validation.calibration.thickness import describe_thickness, profile_thickness, widen
from validation.calibration.uncertainty import (
    CONFIDENCE,
    FEWEST_RECORDINGS,
    Estimate,
    Uncertainty,
    describe_fit,
    estimate_uncertainty,
    measure_scatter,
)
from validation.data_sets.data_set import describe_files
from validation.data_sets.images import Image, observe, read_images
from validation.data_sets.nulls import LINE
from validation.errors import InputError, check_choice
from validation.extras import require
from validation.metrics import score_images
from validation.output_folder import write_text
from validation.parameters import find_parameters
from validation.recordings.importing import list_modules
from validation.render.figure import COLUMN, PAGE, draw_texels, open_figure
from validation.render.image import Scale
from validation.results import Array, Indices, Result, result_model
from validation.schema import read_raw
from validation.schema.data_set import CommonKeys
from validation.schema.sensor import SensorTables
from validation.sensor_file import BUILT_IN, SensorDescription, parse


@dataclass(frozen=True, kw_only=True)
class CalibrationNumbers:
    """Limits and settings of a calibration.

    Attributes:
        least_share: Smallest force on a texel whose gain is reported, over the largest force on any texel in the same
            image [-].  The counts of texels with smaller forces are dominated by noise and by the dead zone.
        largest_extrapolation: Largest credible saturation count over the largest recorded count [-].  A larger fitted
            value describes a slight curvature of the characteristic, not a saturation.
        evidence: Increase of twice the log likelihood, over the penalty of the Bayesian information criterion, above
            which a fit with saturation is preferred [-].
        degree: Degree of the polynomial characteristic, as in the 2015 report [-].
        every: Number n; every n-th recording of a placement is left out of the second fit [-].
        fewest_left: Smallest number of recordings that must remain in the second fit [-].
        fewest_loads: Smallest number of different loads to which a straight line is fitted [-].
    """

    least_share: float = 0.15
    largest_extrapolation: float = 1.3
    evidence: float = 10.0
    degree: int = 5
    every: int = 3
    fewest_left: int = 3
    fewest_loads: int = 2


NUMBERS = CalibrationNumbers()
#: Keys of the table `[electronics]` of a sensor file that a calibrated characteristic replaces.
_CHARACTERISTIC = ("sensitivity", "offset", "characteristic")


@result_model
class HoldOut(Result):
    """Predictions of recordings that were left out of a second fit, by the forward model and by a line for each texel.

    Attributes:
        recordings: Names of the left-out recordings.
        image_changed_percent: Mean absolute difference between recorded and predicted grey levels over 255, mean over
            images [%].
        line_per_texel_percent: Mean absolute difference of grey levels over 255 if each texel is predicted by a
            straight line in the load, fitted for each placement of the indenter [%]; None if the recordings that remain
            with a placement have fewer than two loads.
        loads: Loads of the k left-out images, shape (k,) [N].
        recorded: Recorded counts, shape (k, n) [-].
        predicted: Counts predicted by the forward model, shape (k, n) [-].
    """

    recordings: tuple[str, ...]
    image_changed_percent: float
    line_per_texel_percent: float | None
    loads: Array = Field(default_factory=lambda: np.empty(0), exclude=True)
    recorded: Array = Field(default_factory=lambda: np.empty(0), exclude=True)
    predicted: Array = Field(default_factory=lambda: np.empty(0), exclude=True)

    def __str__(self) -> str:
        """Return in words the score of the forward model, and that of a line per texel."""
        line = self.line_per_texel_percent
        return f"image changed {self.image_changed_percent:.2f} %" + (
            "" if line is None else f", line per texel {line:.2f} %"
        )


@result_model
class Calibration(Result):
    """Result of a calibration; n is the number of texels.

    Attributes:
        confidence: Confidence level of the intervals, 0..1 [-].
        method: Name of the contact method.
        threshold: Counts that the firmware subtracts [-].
        estimates: Parameters of the line, dead force, temperature coefficients, saturation, noise, creep and scatter
            between repeats, by name; `cover_thickness` if it was examined, whose range the intervals of line, dead
            force, temperature coefficients and saturation then contain.
        gains: Gain of every texel of the array, shape (n,) [-]; the mean over `texels` is 1, and other texels have 1.
        gain_half_widths: Half width of the interval of each gain, shape (n,) [-]; NaN for texels without a fitted gain.
        texels: Indices of the texels whose gains are determined.
        poses: Value and half width of the interval of each part of a pose, by the names of the placement and of the
            part (`x_m`, `y_m`, `yaw_rad`, `tilt_x_rad`, `tilt_y_rad`).  The half width is 0 for given parts.
        residual_rms_counts: Root mean square of predicted minus recorded counts [counts].
        polynomial: Coefficients c0..c5 of the polynomial characteristic [counts/N^k]; None with fewer than seven loads.
        hold_out: Score on recordings that were left out of a second fit; None with too few recordings.
        notes: Sentences on which parameters the recordings determine.
        report_line: `sensitivity` [1/N] and `offset` [-] of the straight line in the 2015 report, for comparison.
        left_out: One sentence for each recording that could not be used, whose counts were turned or drift, or whose
            label is in doubt.
        reference_age: Time under load at which the line and the polynomial hold [s].
        touches: Place, load and radius of a circle with the area of the face for each of m images, shape (m, 4) [m, m,
            N, m]; the radius is NaN under a face that is not flat.
    """

    confidence: float
    method: str
    threshold: float
    estimates: dict[str, Estimate]
    gains: Array
    gain_half_widths: Array
    texels: Indices
    poses: dict[str, dict[str, tuple[float, float]]]
    residual_rms_counts: float
    polynomial: Array | None
    hold_out: HoldOut | None
    notes: tuple[str, ...]
    report_line: dict[str, float] = Field(
        default_factory=lambda: {"sensitivity": WTS_0614_34.sensitivity, "offset": WTS_0614_34.offset}
    )
    left_out: tuple[str, ...] = ()
    reference_age: float = CREEP_START
    touches: Array = Field(default_factory=lambda: np.empty((0, 4)), exclude=True)

    def electronics(self, *, polynomial: bool = False) -> dict[str, Any]:
        """Return keys and values for the table `[electronics]` of a sensor file.

        With creep the characteristic is that of a load that was put down 2 s ago, where the creep of
        `fastmodel.signal.creep` is one.

        Args:
            polynomial: Whether to take the polynomial of degree 5 instead of the straight line.

        Raises:
            InputError: If the polynomial is requested and was not fitted.
        """
        found = {name: estimate.value for name, estimate in self.estimates.items()}
        creep = round(min(max(found.get("creep", 0.0), 0.0), MOST_CREEP), 4)
        grown = 1 + creep * math.log(self.reference_age / CREEP_START)
        sensitivity = found["sensitivity"] / grown
        table: dict[str, Any] = {
            "threshold": self.threshold,
            "gains": [round(gain, 5) for gain in self.gains.tolist()],
            "calibrated": TEXEL_FORCE,
        }
        if not polynomial:
            table |= {"sensitivity": f"{sensitivity:.6g} 1/N", "offset": round(found["offset"], 3)}
        elif self.polynomial is None:
            raise InputError("a polynomial of degree 5 needs recordings under at least 7 loads; there were fewer")
        else:
            table["characteristic"] = (self.polynomial / grown ** np.arange(len(self.polynomial))).tolist()
        if "output_max" in found:
            table["output_max"] = round(found["output_max"])
            table["saturation_band"] = round(found["saturation_band"], 1)
        if "noise" in found:
            table["noise"] = f"{found['noise'] / sensitivity:.4g} N"
        if creep > 0:
            table["creep"] = creep
        return table

    def write_files(
        self, sensor: SensorDescription, *, out: str | Path | None, picture: str | Path | None, polynomial: bool
    ) -> None:
        """Write a sensor file with the calibrated electronics, and a picture of left-out recordings, where named."""
        if out is not None:
            write_sensor(self, sensor.source, out, polynomial=polynomial)
        if picture is not None and self.hold_out is not None:
            draw_hold_out(self.hold_out, sensor.array, Path(picture))


def calibrate(
    observations: Observations,
    method: ContactMethod,
    *,
    noise: Sequence[float] = (),
    full_scale: float | None = None,
    heights: bool = False,
    profile: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Estimate poses, characteristic, gains, noise and creep of a sensor from images under known loads.

    Args:
        observations: Mean images under known loads, in one or several placements.
        method: Contact method that gives the texel forces.
        noise: Standard deviation of a texel's counts in each image; not estimated when not given [counts].
        full_scale: Largest count of the converter, for the score on left-out recordings; the largest recorded count
            when not given [-].
        heights: Whether a seating height is fitted for each texel.
        profile: Whether the thickness of the cover is examined by fits on thinner and thicker covers.
        progress: Called with the name of each stage.

    Raises:
        InputError: If `profile` is requested of a contact method that holds for one cover.
        ValueError: If there are too few recordings or loads, or several thresholds.
    """
    recordings, loads = len(set(observations.groups)), len(np.unique(observations.loads))
    if recordings < FEWEST_RECORDINGS or loads < NUMBERS.fewest_loads:
        raise ValueError(
            f"{recordings} recordings with {loads} loads cannot determine a line; at least {FEWEST_RECORDINGS} "
            f"recordings and {NUMBERS.fewest_loads} loads are needed"
        )
    thresholds = sorted(set(observations.thresholds.tolist()))
    if len(thresholds) > 1:
        raise ValueError(f"the recordings have several thresholds: {thresholds}; calibrate each on its own")
    say = progress or (lambda _text: None)
    fit = fit_characteristic(method, observations, Options(heights=heights), say)
    say("intervals, and a fit without every third recording")
    uncertainty = estimate_uncertainty(fit)
    # The gains of the pressed texels are scaled to the mean 1; the sensitivity absorbs their mean.
    texels = _find_pressed(fit)
    places = fit.layout.gains[np.isin(fit.layout.gain_texels, texels)]
    values, mean = fit.curve.gains[texels], _find_mean_gain(fit, texels)
    # Derivatives of the logarithm of the mean gain with respect to the fitted parameters.
    of_mean = np.zeros(len(fit.vector))
    of_mean[places] = values / (max(len(texels), 1) * mean)
    gains, widths = np.ones(method.array.count), np.full(method.array.count, np.nan)
    for texel, place, gain in zip(texels, places, values / mean, strict=True):
        gradient = -of_mean
        gradient[place] += 1.0
        gains[texel], widths[texel] = gain, uncertainty.half_width(gain * gradient)
    estimates = _list_estimates(fit, mean, of_mean, uncertainty)
    about_cover = "the thickness of the cover was assumed and not questioned"
    if profile:
        thickness, fits = profile_thickness(fit, say)
        means = {factor: _find_mean_gain(each, texels) for factor, each in fits.items()}
        others = {factor: _list_estimates(each, means[factor], of_mean, uncertainty) for factor, each in fits.items()}
        ends = thickness.low / (1e3 * method.thickness), thickness.high / (1e3 * method.thickness)
        estimates = {**widen(estimates, others, ends), "cover_thickness": thickness}
        about_cover = describe_thickness(thickness, method.thickness)
    left_out_error = (
        f"the intervals leave out the error of the contact method ({method.name}), which reaches "
        f"{method.gain_error:.0%} of a single gain; on wide covers --method reference has no such error"
    )
    return Calibration(
        confidence=CONFIDENCE,
        method=method.name,
        threshold=thresholds[0],
        estimates={**estimates, **measure_scatter(fit, noise)},
        gains=gains,
        gain_half_widths=widths,
        texels=texels,
        poses=_list_poses(fit, uncertainty),
        residual_rms_counts=fit.rms,
        polynomial=_fit_polynomial(fit, mean),
        hold_out=score_hold_out(fit, full_scale or observations.largest_count),
        notes=(*describe_fit(fit), *([left_out_error] * (method.gain_error > 0)), about_cover),
        reference_age=fit.curve.reference_age,
        touches=_list_touches(fit),
    )


def _list_touches(fit: ForwardFit) -> FloatArray:
    """List place, load and radius of each image, shape (m, 4) [m, m, N, m]."""
    seen = fit.observations
    rows = []
    for load, each in zip(seen.loads, seen.placements, strict=True):
        pose = each.pose or fit.poses[each.name]
        radius = math.sqrt(math.prod(each.indenter.footprint) * 4 / math.pi) if each.indenter.is_flat else math.nan
        rows.append([pose.x, pose.y, load, radius])
    return np.array(rows)


def fit_characteristic(
    method: ContactMethod, observations: Observations, options: Options, say: Callable[[str], object] = str
) -> ForwardFit:
    """Fit without and with saturation, saying so; return the latter fit only if it is much more likely."""
    say(f"fit of a line to {len(observations.loads)} images: {method.name}")
    straight = fit_forward(method, observations, options)
    say("fit with saturation")
    bent = fit_forward(method, observations, replace(options, output_max=None))
    size = int(observations.measured.sum())
    gain = 2 * size * np.log(max(straight.rms, 1e-9) / max(bent.rms, 1e-9))
    credible = bent.curve.output_max < NUMBERS.largest_extrapolation * observations.largest_count
    return bent if credible and gain > NUMBERS.evidence + 2 * np.log(size) else straight


def _find_pressed(fit: ForwardFit) -> npt.NDArray[np.intp]:
    """Return the indices of the fitted texels that carry at least `least_share` of the largest force in an image."""
    forces = compute_forces(fit.method, fit.observations, fit.poses)
    share = forces / np.maximum(forces.max(axis=1, keepdims=True), 1e-12)
    return np.intersect1d(np.flatnonzero((share > NUMBERS.least_share).any(axis=0)), fit.layout.gain_texels)


def _find_mean_gain(fit: ForwardFit, texels: npt.NDArray[np.intp]) -> float:
    """Return the mean fitted gain of texels; 1 without texels [-]."""
    return float(fit.curve.gains[texels].mean()) if len(texels) else 1.0


def _list_estimates(fit: ForwardFit, mean: float, of_mean: FloatArray, uncertainty: Uncertainty) -> dict[str, Estimate]:
    """Return the parameters that all texels share, with their intervals.

    Args:
        fit: The fit.
        mean: Mean of the fitted gains, which the sensitivity absorbs [-].
        of_mean: Derivatives of the logarithm of `mean` with respect to the p parameters, shape (p,).
        uncertainty: Covariance of the parameters.
    """
    curve, seen = fit.curve, fit.observations
    threshold = float(seen.thresholds[0])
    fitted_on = f"{len(set(seen.groups))} recordings, {seen.loads.min():.3g}..{seen.loads.max():.3g} N"

    def unit(name: str) -> FloatArray:
        return np.array([float(each.name == name) for each in fit.layout.unknowns])

    slope = curve.sensitivity * mean
    relative = unit("ln_sensitivity") + of_mean
    offset = mean * (threshold - curve.sensitivity * curve.dead_force)
    of_offset = offset * of_mean - slope * (curve.dead_force * unit("ln_sensitivity") + unit("dead_force"))
    dead = (threshold - offset) / slope
    rows = [
        ("offset", offset, of_offset, "counts"),
        ("sensitivity", slope, slope * relative, "counts/N"),
        ("dead_force", dead, -of_offset / slope - dead * relative, "N"),
    ]
    if fit.options.temperature:
        rows.append(("temperature", curve.gain_temperature, unit("gain_temperature"), "1/K"))
        rows.append(("dead_force_temperature", curve.dead_temperature, unit("dead_temperature"), "N/K"))
    if np.isfinite(curve.output_max):
        band = curve.saturation_band
        by_logit = band * (1 - band / curve.output_max) * unit("band_logit")
        rows.append(("output_max", curve.output_max, unit("output_max"), "counts"))
        rows.append(("saturation_band", band, by_logit + band / curve.output_max * unit("output_max"), "counts"))
    return {
        name: Estimate.symmetric(float(value), uncertainty.half_width(gradient), symbol, fitted_on)
        for name, value, gradient, symbol in rows
    }


def _list_poses(fit: ForwardFit, uncertainty: Uncertainty) -> dict[str, dict[str, tuple[float, float]]]:
    """Return value and half width of each part of each placement's pose; the half width of a given part is 0."""
    widths = {name: np.zeros(5) for name in fit.poses}
    for number, each in enumerate(fit.layout.unknowns):
        if each.placement:
            gradient = np.zeros(len(fit.vector))
            gradient[number] = 1.0
            widths[each.placement][each.part] = uncertainty.half_width(gradient)
    return {
        name: {part: (value, width) for (part, value), width in zip(pose.named().items(), widths[name], strict=True)}
        for name, pose in fit.poses.items()
    }


def _fit_polynomial(fit: ForwardFit, mean: float) -> FloatArray | None:
    """Fit a polynomial of degree 5 from the force on a texel to its counts, over all texels and images.

    Counts are divided by the ratio of the texel's gain to the mean gain.  The gains are those that were fitted together
    with a straight characteristic.  Counts at rest and counts in saturation are left out.

    Args:
        fit: The fit of the straight characteristic, with saturation if the data show it.
        mean: Mean of the fitted gains [-].

    Returns:
        Coefficients of powers k = 0..5 of the force, shape (6,) [counts/N^k]; None for fewer than seven loads.
    """
    seen, curve = fit.observations, fit.curve
    if len(np.unique(seen.loads)) < NUMBERS.degree + 2:
        return None
    forces = compute_forces(fit.method, seen, fit.poses)
    ceiling = curve.output_max - curve.saturation_band if np.isfinite(curve.output_max) else np.inf
    lit = seen.lit & (seen.counts < ceiling)
    signal = (seen.counts + seen.thresholds[:, None]) / (curve.gains / mean)
    return np.asarray(np.polynomial.Polynomial.fit(forces[lit], signal[lit], NUMBERS.degree).convert().coef)


def score_hold_out(fit: ForwardFit, full_scale: float) -> HoldOut | None:
    """Leave out every third recording of each placement in the order of loads, fit again, and score the predictions.

    One recording of each placement with a fitted pose remains.

    Args:
        fit: Fit to all recordings, which defines the fitted parameters.
        full_scale: Count that is shown white [-].

    Returns:
        The predictions; None if too few recordings remain.
    """
    seen = fit.observations
    scored = _choose_left_out(seen)
    kept, held = seen.select(~scored), seen.select(scored)
    enough = len(set(kept.groups)) >= NUMBERS.fewest_left and len(np.unique(kept.loads)) >= NUMBERS.fewest_loads
    if not enough or not scored.any():
        return None
    predicted = fit_forward(fit.method, kept, fit.options).predict(held)
    line = _predict_by_line(kept, held)

    def compare(counts: FloatArray) -> float:
        """Return the mean difference of grey levels between the recorded images and given counts [%]."""
        grey = (grey_levels(each, full_scale) for each in (held.counts, counts))
        pairs = zip(*grey, held.measured, strict=True)
        return float(np.mean([score_images(a, b, active=lit).image_changed_percent for a, b, lit in pairs]))

    return HoldOut(
        recordings=tuple(dict.fromkeys(held.groups)),
        image_changed_percent=compare(predicted),
        line_per_texel_percent=None if line is None else compare(line),
        loads=held.loads,
        recorded=held.counts,
        predicted=predicted,
    )


def _choose_left_out(seen: Observations) -> BoolArray:
    """Return whether each of m images belongs to a recording that is left out, shape (m,)."""
    by_placement: dict[str, dict[str, float]] = {}
    count = Counter(placement.name for placement in seen.placements)
    for group, placement, load in zip(seen.groups, seen.placements, seen.loads.tolist(), strict=True):
        alone = placement.pose is not None and count[placement.name] == 1
        recordings = by_placement.setdefault("" if alone else placement.name, {})
        recordings[group] = max(load, recordings.get(group, 0.0))
    out: set[str] = set()
    for number, recordings in enumerate(by_placement.values()):
        # The first omitted recording differs between placements, so that several loads are left out.
        first = (1 + number) % min(NUMBERS.every, len(recordings))
        if len(recordings) > 1:
            out.update(sorted(recordings, key=recordings.__getitem__)[first :: NUMBERS.every])
    return np.array([group in out for group in seen.groups])


def _predict_by_line(kept: Observations, held: Observations) -> FloatArray | None:
    """Predict left-out counts by a straight line in the load per texel and placement, shape (k, n) [-]."""
    line = np.zeros_like(held.counts)
    for name in dict.fromkeys(each.name for each in held.placements):
        rows = np.array([each.name == name for each in held.placements])
        near = kept.select(np.array([each.name == name for each in kept.placements]))
        if len(np.unique(near.loads)) < NUMBERS.fewest_loads:
            return None
        line[rows] = LINE.fit(near, None, np.inf)(held.select(rows))
    return line


def write_sensor(calibration: Calibration, sensor: str | Path, out: str | Path, *, polynomial: bool = False) -> Path:
    """Write a copy of a sensor file with calibrated electronics.

    Args:
        calibration: Result of the calibration.
        sensor: Sensor file that is copied.  It is not changed unless `out` names the same file.
        out: The file to write; an existing file is replaced.
        polynomial: Whether to write the polynomial of degree 5 instead of the straight line.

    Returns:
        Path of the written file.

    Raises:
        InputError: If the sensor file cannot be read or describes another array, or if the polynomial is requested and
            was not fitted.
    """
    source, target = Path(sensor), Path(out)
    try:
        tables = read_raw(source, SensorTables)
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: cannot be read: {error}; accepted: a sensor file (`softcover init`)") from error
    kept = {name: value for name, value in tables.get("electronics", {}).items() if name not in _CHARACTERISTIC}
    tables["electronics"] = {**kept, **calibration.electronics(polynomial=polynomial)}
    # `parse` raises InputError if the sensor file describes another array; no file has been written yet.
    parse(tables, source=source)
    notes = "".join(f"# {name} {each}, from {each.fitted_on}\n" for name, each in calibration.estimates.items())
    head = f"# electronics calibrated; {calibration.confidence:.0%} intervals:\n{notes}\n"
    write_text(target, head + tomli_w.dumps(tables))
    return target


#: Largest number of left-out recordings in a picture [-].
_MOST_DRAWN = 4


def draw_hold_out(hold_out: HoldOut, array: TexelArray, path: Path) -> Path:
    """Draw left-out images, the predicted images and their differences as a picture.

    Args:
        hold_out: Recorded and predicted counts.
        array: The texels.
        path: The file to write; its ending is the format.

    Raises:
        ImportError: If matplotlib is not installed.
    """
    order = np.argsort(hold_out.loads)
    chosen = order[np.unique(np.linspace(0, len(order) - 1, min(_MOST_DRAWN, len(order))).astype(int))]
    recorded, predicted = hold_out.recorded[chosen], hold_out.predicted[chosen]
    counts = Scale(peak=float(max(recorded.max(), predicted.max(), 1.0)), factor=1)
    apart = Scale(peak=float(max(np.abs(predicted - recorded).max(), 1.0)), factor=1, difference=True)
    rows = (
        ("recorded", recorded, counts, "counts"),
        ("predicted", predicted, counts, "counts"),
        ("difference", predicted - recorded, apart, "difference [counts]"),
    )
    with open_figure(path, height=6.5, width=PAGE if len(chosen) > 1 else COLUMN) as figure:
        axes = figure.subplots(len(rows), len(chosen), squeeze=False)
        for line, (name, images, scale, unit) in zip(axes, rows, strict=True):
            for axis, image, load in zip(line, images, hold_out.loads[chosen], strict=True):
                drawn = draw_texels(axis, array, image, scale, title=f"{name}, {load:.3g} N")
            figure.colorbar(drawn, ax=line.tolist(), label=unit)
        figure.suptitle(f"left out: {hold_out}")
    return path


def calibrate_recordings(
    paths: Sequence[Path],
    sensor: SensorDescription,
    keys: CommonKeys,
    *,
    moved: bool = False,
    method: str = "default",
    heights: bool = False,
    profile: bool = False,
    tip: float | None = None,
    texel: int | None = None,
    draws: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Calibration | PointLoadCalibration:
    """Fit the electronics of a sensor to recordings under known loads.

    Args:
        paths: Recordings, or one data-set file, which states tool, pose, threshold and window itself.
        sensor: The sensor; its cover gives the share of each texel.
        keys: Tool, pose, pressed array, threshold and window of the recordings.
        moved: Whether each recording has its own pose.
        method: Contact method: `default`, one of `fastmodel.METHODS`, or `reference` for finite elements.
        heights: Whether a seating height is fitted to each texel.
        profile: Whether the thickness of the cover is examined.
        tip: Radius of a rounded tip on one texel, whose slope is fitted per trial; None for an array [m].
        texel: Index of the texel under the tip.
        draws: Whether the caller will draw left-out recordings.
        progress: Called with the name of each stage.

    Raises:
        InputError: If an option is wrong, or no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
        ConvergenceError: If the finite elements did not converge.
    """
    if keys.threshold is not None and keys.threshold < 0:
        raise InputError(f"--threshold: must be 0 or more, not {keys.threshold:g}")
    check_choice("--method", "contact method", method, ("default", *METHODS, REFERENCE))
    if (tip is None) != (texel is None):
        raise InputError("--tip, --texel: give both to calibrate one texel with a rounded tip, or neither")
    if progress:
        progress("reading recordings")
    images, left_out = _read_images(paths, sensor, keys, moved=moved, method="" if tip else method, draws=draws)
    found: Calibration | PointLoadCalibration
    if tip is not None and texel is not None:
        # Each recording with a force channel is a trial. Recordings under single loads form one trial together.
        names = [image.file.name for image in images]
        trials = names if len(set(names)) < len(names) else ["all recordings"] * len(names)
        found = calibrate_point_load(observe(images), trials, sensor, radius=tip, texel=texel)
    else:
        found = calibrate(
            observe(images),
            choose_method(sensor, method, images, progress),
            noise=[image.noise for image in images],
            full_scale=max(image.full_scale for image in images),
            heights=heights,
            profile=profile,
            progress=progress,
        )
    return replace(found, left_out=left_out)


def _read_images(
    paths: Sequence[Path], sensor: SensorDescription, keys: CommonKeys, *, moved: bool, method: str, draws: bool
) -> tuple[list[Image], tuple[str, ...]]:
    """Read the images that may be fitted, and one sentence for each recording that cannot be used.

    Args:
        paths: Recordings, or one data-set file.
        sensor: The sensor.
        keys: Options for recordings.
        moved: Whether each recording has its own pose.
        method: Contact method; empty for the finite elements under a tip.
        draws: Whether a picture will be drawn.

    Raises:
        InputError: If no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
    """

    def require_modules(files: Sequence[Path]) -> None:
        needed = [*list_modules(files), *(["matplotlib"] if draws else [])]
        # The fast model of a built-in sensor is stored.  By default finite elements compute the contact.
        if method and sensor is BUILT_IN.get(sensor.name):
            require(*needed, useful=() if method in METHODS else ("skfem",))
        else:
            require(*needed, "skfem")

    if not any(path.suffix == ".toml" for path in paths):
        require_modules(paths)
    data_set = describe_files(paths, keys, sensor.array, moved=moved)
    require_modules([file.path for file in data_set.files])
    images, problems = read_images(data_set, sensor.array)
    left_out = (*data_set.problems, *problems)
    images = [image for image in images if "fit" in image.file.uses]
    if not images:
        raise InputError(*left_out, "no recording can be used")
    return images, left_out


def choose_method(
    sensor: SensorDescription,
    method: str,
    images: Sequence[Image],
    progress: Callable[[str], None] | None = None,
) -> ContactMethod:
    """Choose the contact method of a calibration by its name.

    The default is finite elements.  Where these are slow or do not apply, it is the method `cover` (for fitted tilts or
    a cover of finite size) or `foundation` (for a given spread).
    """
    level = all(image.file.placement.tilt is not None for image in images)
    solvable = sensor.spread is None and sensor.cover.size is None and level
    if method == REFERENCE or (method == "default" and solvable):
        stored = sensor is BUILT_IN.get(sensor.name)
        require("skfem", otherwise="compute the contact by the fast model: --method cover" if stored else "")
        return make_reference_method(sensor.layered_cover, sensor.array)
    parameters = find_parameters(sensor, progress)
    if method == "default":
        method = "foundation" if parameters.surface is None else "cover"
    return make_fast_method(parameters, method)
