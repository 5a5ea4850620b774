"""Calibrates a real sensor: fits the forward model to recordings under known loads, with confidence intervals.

The share of a load on each texel follows from the cover of the sensor and the pose of the tool, by a contact method of
the fast model or by finite elements.  Fitted are the poses that are not given, a straight line from texel force to
counts with a gain per texel, the saturation if the loads reach it, and temperature coefficients if the data allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import WTS_0614_34
from meshes.array import FloatArray
from validation.calibration.contact import ContactMethod
from validation.calibration.estimates import Estimate, measure_scatter
from validation.calibration.forward_fit import ForwardFit, compute_forces, fit_forward
from validation.calibration.hold_out import HoldOut, score_hold_out
from validation.calibration.identifiability import FEWEST_RECORDINGS, Uncertainty, describe_fit, estimate_uncertainty
from validation.calibration.observations import Observations
from validation.calibration.parameters import Options

#: Smallest force on a texel whose gain is reported, over the largest force on any texel in the same image [-].  The
#: counts of texels with smaller forces are dominated by noise and by the dead zone.
_LEAST_SHARE = 0.15
#: Largest credible saturation count: fitted `output_max` over the largest recorded count [-].  A larger fitted value
#: describes a slight curvature of the characteristic, not a saturation.
_LARGEST_EXTRAPOLATION = 1.3
#: Increase of twice the log likelihood, over the penalty of the Bayesian information criterion, from which a fit with
#: saturation is preferred [-].
_EVIDENCE = 10.0
#: Degree of the polynomial characteristic, as in the 2015 report [-].
_DEGREE = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Result of a calibration.

    Attributes:
        fit: The fitted forward model.
        estimates: Parameters of the line, dead force, temperature coefficients, saturation, noise, creep and scatter
            between repeats, by name.
        gains: Gain of every texel of the array, of mean 1 over `texels`, shape (n,); 1 for other texels [-].
        gain_intervals: Half width of the interval of each gain, shape (n,); NaN for texels without one [-].
        texels: Indices of the texels whose gains are determined.
        poses: Position [m], yaw and tilt [rad] of each placement, with half widths, by name: pairs of shape (5,).
        polynomial: Coefficients c0..c5 of the polynomial characteristic [counts/N^k]; None with fewer than seven loads.
        hold_out: Score on recordings that were left out of a second fit; None with too few recordings.
        notes: Sentences on what the recordings determine.
        report_line: Sensitivity [1/N] and offset [-] of the straight line in the 2015 report, for comparison.
        confidence: Confidence level of the intervals, 0..1 [-].
    """

    fit: ForwardFit
    estimates: Mapping[str, Estimate]
    gains: FloatArray
    gain_intervals: FloatArray
    texels: npt.NDArray[np.intp]
    poses: Mapping[str, tuple[FloatArray, FloatArray]]
    polynomial: FloatArray | None
    hold_out: HoldOut | None
    notes: tuple[str, ...]
    report_line: tuple[float, float] = (WTS_0614_34.sensitivity, WTS_0614_34.offset)
    confidence: float = 0.95

    @property
    def threshold(self) -> float:
        """Counts that the firmware subtracts [-]."""
        return float(self.fit.observations.thresholds[0])

    def as_json(self) -> dict[str, Any]:
        """Return all results by name, as numbers, text, arrays and nested dicts."""
        sensitivity, offset = self.report_line
        return {
            "confidence": self.confidence,
            "method": self.fit.method.name,
            "estimates": {name: vars(estimate) for name, estimate in self.estimates.items()},
            "gains": self.gains,
            "gain_half_widths": self.gain_intervals,
            "texels": self.texels,
            "poses": {
                name: dict(zip(("x_m", "y_m", "yaw_rad", "tilt_x_rad", "tilt_y_rad"), pairs, strict=True))
                for name, values in self.poses.items()
                for pairs in [np.column_stack(values).tolist()]
            },
            "residual_rms_counts": self.fit.rms,
            "polynomial": self.polynomial,
            "hold_out": None if self.hold_out is None else self.hold_out.as_json(),
            "notes": list(self.notes),
            "report_line": {"sensitivity": sensitivity, "offset": offset},
        }


def calibrate(
    observations: Observations,
    method: ContactMethod,
    *,
    noise: Sequence[float] = (),
    full_scale: float | None = None,
    heights: bool = False,
    confidence: float = 0.95,
) -> Calibration:
    """Estimate poses, characteristic, gains, noise and creep of a sensor from images under known loads.

    Args:
        observations: Mean images under known loads, in one or several placements.
        method: Contact method that gives the texel forces.
        noise: Standard deviation of a texel's counts in each image; not estimated when not given [counts].
        full_scale: Largest count of the converter, for the score on left-out recordings; the largest recorded count
            when not given [-].
        heights: Whether a seating height is fitted for each texel.
        confidence: Confidence level of the intervals, 0..1 [-].

    Raises:
        ValueError: If there are too few recordings or loads, or several thresholds.
    """
    _check(observations)
    options = Options(heights=heights)
    fit = _choose_fit(method, observations, options)
    uncertainty = estimate_uncertainty(fit, confidence=confidence)
    texels = _find_pressed(fit)
    scaling = _Scaling(fit, texels)
    gains, widths = scaling.list_gains(uncertainty)
    return Calibration(
        fit=fit,
        estimates={**scaling.list_estimates(uncertainty), **measure_scatter(fit, noise, confidence)},
        gains=gains,
        gain_intervals=widths,
        texels=texels,
        poses=_list_poses(fit, uncertainty),
        polynomial=_fit_polynomial(fit, scaling.mean),
        hold_out=score_hold_out(fit, full_scale or float(observations.counts.max())),
        notes=(*describe_fit(fit), *_tell_method_error(method)),
        confidence=confidence,
    )


def _tell_method_error(method: ContactMethod) -> list[str]:
    """State that the intervals leave out the error of the contact method, if it has one."""
    if not method.gain_error:
        return []
    return [
        (
            f"the intervals leave out the error of the contact method ({method.name}), which reaches "
            f"{method.gain_error:.0%} of a single gain; on wide covers --method reference has no such error"
        )
    ]


def _check(observations: Observations) -> None:
    """Check that the images can determine a line.

    Raises:
        ValueError: If they cannot.
    """
    recordings = len(set(observations.groups))
    loads = len(np.unique(observations.loads))
    if recordings < FEWEST_RECORDINGS or loads < 2:  # noqa: PLR2004 -- a line
        raise ValueError(
            f"{recordings} recordings with {loads} loads cannot determine a line; at least {FEWEST_RECORDINGS} "
            "recordings and 2 loads are needed"
        )
    thresholds = sorted(set(observations.thresholds.tolist()))
    if len(thresholds) > 1:
        raise ValueError(f"the recordings have several thresholds: {thresholds}; calibrate each on its own")


def _choose_fit(method: ContactMethod, observations: Observations, options: Options) -> ForwardFit:
    """Fit without and with saturation; return the fit with saturation only if it is far more likely."""
    straight = fit_forward(method, observations, options)
    bent = fit_forward(method, observations, replace(options, output_max=None), start=None)
    size = int(observations.measured.sum())
    gain = 2 * size * np.log(max(straight.rms, 1e-9) / max(bent.rms, 1e-9))
    credible = bent.curve.output_max < _LARGEST_EXTRAPOLATION * float(observations.counts.max())
    return bent if credible and gain > _EVIDENCE + 2 * np.log(size) else straight


def _find_pressed(fit: ForwardFit) -> npt.NDArray[np.intp]:
    """Return the indices of the fitted texels that carry a fair share of the force in at least one image."""
    forces = compute_forces(fit.method, fit.observations, fit.poses)
    share = forces / np.maximum(forces.max(axis=1, keepdims=True), 1e-12)
    pressed = np.flatnonzero((share > _LEAST_SHARE).any(axis=0))
    return np.intersect1d(pressed, fit.layout.gain_texels)


class _Scaling:
    """Scales sensitivity and gains so that the gains of the pressed texels have the mean 1."""

    def __init__(self, fit: ForwardFit, texels: npt.NDArray[np.intp]) -> None:
        self._fit, self._texels = fit, texels
        chosen = np.isin(fit.layout.gain_texels, texels)
        self._places = fit.layout.gains[chosen]
        self._values = fit.curve.gains[texels]
        self.mean = float(self._values.mean()) if len(texels) else 1.0

    def _gradient_of_mean(self) -> FloatArray:
        """Derivatives of ln(mean gain), shape (p,)."""
        gradient = np.zeros(len(self._fit.vector))
        if len(self._texels):
            gradient[self._places] = self._values / (len(self._texels) * self.mean)
        return gradient

    def list_gains(self, uncertainty: Uncertainty) -> tuple[FloatArray, FloatArray]:
        """Return gain and half width of its interval for each texel of the array, two arrays of shape (n,)."""
        count = self._fit.observations.counts.shape[1]
        gains, widths = np.ones(count), np.full(count, np.nan)
        shift = self._gradient_of_mean()
        for texel, place, value in zip(self._texels, self._places, self._values / self.mean, strict=True):
            gradient = -shift
            gradient[place] += 1.0
            gains[texel], widths[texel] = value, uncertainty.half_width(value * gradient)
        return gains, widths

    def list_estimates(self, uncertainty: Uncertainty) -> dict[str, Estimate]:
        """Return the parameters that all texels share, with their intervals."""
        fit, curve, names = self._fit, self._fit.curve, self._fit.layout.names
        seen = fit.observations
        threshold = float(seen.thresholds[0])
        recordings = len(set(seen.groups))
        fitted_on = f"{recordings} recordings, {seen.loads.min():.3g}..{seen.loads.max():.3g} N"

        def unit(name: str) -> FloatArray:
            return np.array([float(each == name) for each in names])

        slope = curve.sensitivity * self.mean
        relative = unit("ln_sensitivity") + self._gradient_of_mean()
        offset = self.mean * (threshold - curve.sensitivity * curve.dead_force)
        offset_gradient = offset * self._gradient_of_mean() - slope * (
            curve.dead_force * unit("ln_sensitivity") + unit("dead_force")
        )
        dead = (threshold - offset) / slope
        rows = [
            ("offset", offset, offset_gradient, "counts"),
            ("sensitivity", slope, slope * relative, "counts/N"),
            ("dead_force", dead, -offset_gradient / slope - dead * relative, "N"),
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


def _list_poses(fit: ForwardFit, uncertainty: Uncertainty) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return each placement's pose and the half widths of its parts, 0 for those that were given."""
    poses = {name: (pose.vector, np.zeros(5)) for name, pose in fit.poses.items()}
    for number, (name, part) in enumerate(fit.layout.pose_parts):
        gradient = np.zeros(len(fit.vector))
        gradient[number] = 1.0
        poses[name][1][part] = uncertainty.half_width(gradient)
    return poses


def _fit_polynomial(fit: ForwardFit, mean: float) -> FloatArray | None:
    """Fit the polynomial of degree 5 from texel force to counts, with the gains of the line and below saturation.

    Returns:
        Coefficients of ascending powers, shape (6,) [counts/N^k]; None for fewer than seven loads.
    """
    seen, curve = fit.observations, fit.curve
    if len(np.unique(seen.loads)) < _DEGREE + 2:
        return None
    forces = compute_forces(fit.method, seen, fit.poses)
    ceiling = curve.output_max - curve.saturation_band if np.isfinite(curve.output_max) else np.inf
    lit = seen.measured & (seen.counts > 0) & (seen.counts < ceiling)
    signal = (seen.counts + seen.thresholds[:, None]) / (curve.gains / mean)
    return np.asarray(np.polynomial.Polynomial.fit(forces[lit], signal[lit], _DEGREE).convert().coef)
