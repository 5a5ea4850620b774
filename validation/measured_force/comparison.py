"""Fit the moduli of a cover to some measured forces, and compare the finite elements with the others.

Stress is proportional to the moduli, so one factor on all moduli multiplies every force.  The factor minimises the
squared relative errors (in logarithms) at the fitted points.  The comparison follows ASME V&V 20-2009: the error E is
the prediction S minus the measured D, and its standard uncertainty u_val combines those of the finite elements (u_num),
of the inputs (u_input) and of the measurement (u_D).  If abs(E) < u_val, the comparison cannot resolve an error of the
model.  The factor is fitted again for each varied input, so that only what the fit does not absorb counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from validation.measured_force.case import FloatArray, Measurement
from validation.measured_force.curves import BOUNDS, Curve, solve_curves

#: Name of the row in which friction may lie anywhere between its bounds.
BETWEEN = "in between"
#: Probability of the interval of the fitted factor, and the number of standard uncertainties that a normal distribution
#: has within it [-].
_PROBABILITY, _COVERAGE = 0.95, 1.96
#: Number of standard uncertainties up to which an error is allowed, at about 95 % [-].
_ALLOWED = 2.0
#: Half of the width of a uniform distribution over its standard deviation [-].
_UNIFORM = np.sqrt(3)
#: Largest error of the zero of depth that is considered as an explanation, over the smallest depth [-].
_LARGEST_SHIFT = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Row:
    """Comparison of the finite elements under one assumption on friction with n measured forces.

    Attributes:
        name: A key of `BOUNDS`, or `BETWEEN`.
        scale: Fitted factor on all moduli [-].
        interval: Ends of the 95 % interval of the factor; None for one fitted point of unknown uncertainty [-].
        predicted: Predicted forces S, shape (n,) [N].
        error: E = S - D, shape (n,) [N].
        numerical: u_num, shape (n,) [N].
        inputs: Parts of u_input by the name of the input, shape (n,) each [N].
        measured: u_D, shape (n,) [N].
        zero_shift: Depth at which the force starts to rise, over the stated zero, with which all points fit best; None
            for `BETWEEN` [m].
        misfit: Root mean square of the relative errors over all points if the factor is fitted to all of them, with the
            stated zero and with `zero_shift`; None for `BETWEEN` [-].
    """

    name: str
    scale: float
    interval: tuple[float, float] | None
    predicted: FloatArray
    error: FloatArray
    numerical: FloatArray
    inputs: Mapping[str, FloatArray]
    measured: FloatArray
    zero_shift: float | None = None
    misfit: tuple[float, float] | None = None

    @property
    def u_input(self) -> FloatArray:
        """Standard uncertainty of the prediction due to all inputs, shape (n,) [N]."""
        return _add(list(self.inputs.values()), len(self.error))

    @property
    def u_val(self) -> FloatArray:
        """Standard uncertainty of the error, shape (n,) [N]."""
        return _add([self.numerical, self.u_input, self.measured], len(self.error))

    def as_json(self) -> dict[str, Any]:
        """Return the row as a dictionary of JSON values."""
        own = {name: value for name, value in vars(self).items() if name != "inputs"}
        return {**own, "inputs": dict(self.inputs), "u_input": self.u_input, "u_val": self.u_val}


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceComparison:
    """Comparison of the finite elements with a measurement, at both bounds of friction and between them.

    Attributes:
        measurement: The measurement.
        rows: Frictionless, no slip, and `BETWEEN`.
        verdict: Sentences about what the data allow.
    """

    measurement: Measurement
    rows: Sequence[Row]
    verdict: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return measurement and comparison as a dictionary of JSON values, in SI units."""
        given = self.measurement
        return {
            "name": given.name,
            "source": given.source,
            "depth": given.depth,
            "force": given.force,
            "fitted": given.fitted,
            "shear_moduli": [layer.material.shear_modulus for layer in given.cover.layers],
            "rows": [row.as_json() for row in self.rows],
            "verdict": list(self.verdict),
        }


def compare_forces(measurement: Measurement, curves: Mapping[str, Curve]) -> ForceComparison:
    """Fit the moduli and compare the finite elements with a measurement.

    Args:
        measurement: The measurement.
        curves: Forces of the finite elements for each of `BOUNDS`, from `solve_curves`.
    """
    rows = [_compare_bound(measurement, bound, curves[bound]) for bound in BOUNDS]
    rows.append(_combine_bounds(measurement, rows))
    return ForceComparison(measurement=measurement, rows=tuple(rows), verdict=_judge(measurement, rows))


def fit_scale(measurement: Measurement, force: FloatArray) -> float:
    """Return the factor on forces that fits them to the fitted points of a measurement [-]."""
    use = measurement.fitted
    return float(np.exp(np.mean(np.log(measurement.force[use] / force[use]))))


def _compare_bound(measurement: Measurement, name: str, curve: Curve) -> Row:
    """Compare the finite elements at one bound of friction with a measurement."""
    use, count = measurement.fitted, int(measurement.fitted.sum())
    scale = fit_scale(measurement, curve.force)
    predicted = scale * curve.force

    def fit_again(force: FloatArray) -> tuple[float, FloatArray]:
        """Return the logarithm of the fitted factor, and the prediction."""
        factor = fit_scale(measurement, force)
        return np.log(factor), factor * force

    inputs, of_scale = {}, []
    for key, (one, other, width) in _list_variations(measurement, curve).items():
        (log_one, at_one), (log_other, at_other) = fit_again(one), fit_again(other)
        inputs[key] = np.abs(at_other - at_one) / width
        of_scale.append(abs(log_other - log_one) / width)
    spread, coverage = _estimate_scatter(measurement, curve.force)
    if spread is not None:
        inputs["fitted moduli"] = predicted * spread / np.sqrt(count)
    half = None if spread is None else np.hypot(coverage * spread / np.sqrt(count), _COVERAGE * _norm(of_scale))
    shift, misfit = _fit_zero(measurement, curve.force)
    noise = measurement.force_uncertainty or 0.0
    return Row(
        name=name,
        scale=scale,
        interval=None if half is None else (float(scale * np.exp(-half)), float(scale * np.exp(half))),
        predicted=predicted,
        error=predicted - measurement.force,
        numerical=predicted * np.hypot(curve.error, _norm(curve.error[use]) / count),
        inputs=inputs,
        measured=np.full(len(predicted), noise),
        zero_shift=shift,
        misfit=misfit,
    )


def _list_variations(measurement: Measurement, curve: Curve) -> dict[str, tuple[FloatArray, FloatArray, float]]:
    """Return all variations of a curve, including that of the zero of depth."""
    out = dict(curve.varied)
    if measurement.zero_uncertainty:
        rise = interpolate_force(measurement.depth, curve.force)
        moved = [rise(measurement.depth + sign * measurement.zero_uncertainty) for sign in (-1, 1)]
        out["zero of depth"] = moved[0], moved[1], 2.0
    return out


def interpolate_force(depth: FloatArray, force: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return the force over depth as a spline of at most third degree through the logarithms, beyond its ends a power.

    Args:
        depth: Depths of the known forces, shape (n,), at least two different ones; equal depths have equal forces [m].
        force: Forces at these depths, shape (n,) [N].
    """
    x, first = np.unique(np.log(depth), return_index=True)
    spline = make_interp_spline(x, np.log(force[first]), k=min(3, len(x) - 1))
    slope = spline.derivative()

    def rise(wanted: FloatArray) -> FloatArray:
        inside = np.clip(np.log(wanted), x[0], x[-1])
        return np.asarray(np.exp(spline(inside) + slope(inside) * (np.log(wanted) - inside)))

    return rise


def _estimate_scatter(measurement: Measurement, force: FloatArray) -> tuple[float | None, float]:
    """Estimate the relative standard deviation of one fitted point, and its factor for a 95 % interval.

    A stated uncertainty of the force is taken as it is.  Otherwise the scatter of the fitted points about the model
    counts, with Student's distribution; one point has none.
    """
    use = measurement.fitted
    count = int(use.sum())
    if measurement.force_uncertainty is not None:
        return _norm(measurement.force_uncertainty / measurement.force[use]) / np.sqrt(count), _COVERAGE
    if count == 1:
        return None, 0.0
    residual = np.log(measurement.force[use] / force[use])
    return float(np.std(residual, ddof=1)), float(student.ppf((1 + _PROBABILITY) / 2, count - 1))


def _fit_zero(measurement: Measurement, force: FloatArray) -> tuple[float, tuple[float, float]]:
    """Find the error of the zero of depth with which a curve fits all points best, and the misfit without and with it.

    Returns:
        Shift of the depths [m], and the root mean square of the relative errors without and with the shift [-].
    """
    depth, rise = measurement.depth, interpolate_force(measurement.depth, force)

    def measure_misfit(shift: float) -> float:
        return float(np.std(np.log(measurement.force / rise(depth + shift))))

    most = _LARGEST_SHIFT * depth[0]
    shift = float(minimize_scalar(measure_misfit, bounds=(-most, most), method="bounded", options={"xatol": 1e-9}).x)
    return shift, (measure_misfit(0.0), measure_misfit(shift))


def _combine_bounds(measurement: Measurement, rows: Sequence[Row]) -> Row:
    """Return the row for friction anywhere between its bounds: their mean, with half their range as uncertainty."""
    one, other = rows
    predicted = (one.predicted + other.predicted) / 2
    inputs = {key: np.maximum(one.inputs[key], other.inputs[key]) for key in one.inputs}
    inputs["friction"] = np.abs(one.predicted - other.predicted) / 2 / _UNIFORM
    ends = [row.interval for row in rows if row.interval is not None]
    return Row(
        name=BETWEEN,
        scale=(one.scale + other.scale) / 2,
        interval=(min(low for low, _ in ends), max(high for _, high in ends)) if ends else None,
        predicted=predicted,
        error=predicted - measurement.force,
        numerical=np.maximum(one.numerical, other.numerical),
        inputs=inputs,
        measured=one.measured,
    )


def _judge(measurement: Measurement, rows: Sequence[Row]) -> tuple[str, ...]:
    """State in words which bound of friction the data allow, and what else would explain the difference."""
    scored = ~measurement.fitted
    bounds = [row for row in rows if row.name in BOUNDS]
    allowed = [row.name for row in bounds if (np.abs(row.error) <= _ALLOWED * row.u_val)[scored].all()]
    nearest = min(bounds, key=lambda row: float(np.abs(row.error / measurement.force)[scored].max()))
    if len(allowed) == len(bounds):
        out = ["The data allow both bounds of friction: every error is within 2 u_val."]
    elif allowed:
        out = [f"The data allow {allowed[0]}, and not the other bound: its error exceeds 2 u_val."]
    else:
        out = [f"The data allow neither bound of friction: both errors exceed 2 u_val; {nearest.name} is nearer."]
    errors = np.array([row.error for row in bounds])
    far = np.abs(errors) > _ALLOWED * np.array([row.u_val for row in bounds])
    beyond = scored & far.all(axis=0) & ((errors > 0).all(axis=0) | (errors < 0).all(axis=0))
    if beyond.any():
        at = ", ".join(f"{1e3 * depth:.3g} mm" for depth in measurement.depth[beyond])
        out.append(f"At {at}, the measured force lies more than 2 u_val outside both bounds: no friction explains it.")
    if nearest.misfit is not None and nearest.zero_shift is not None:
        before, after = (f"{100 * value:.2g} %" for value in nearest.misfit)
        when = "before" if nearest.zero_shift > 0 else "after"
        out.append(
            f"For {nearest.name}, a contact that began {1e3 * abs(nearest.zero_shift):.2g} mm {when} the stated zero "
            f"of depth would change the misfit of all points from {before} to {after}."
        )
    if measurement.force_uncertainty is None or measurement.zero_uncertainty is None:
        missing = [
            name
            for name, value in (
                ("force", measurement.force_uncertainty),
                ("zero of depth", measurement.zero_uncertainty),
            )
            if value is None
        ]
        out.append(f"The uncertainty of {' and '.join(missing)} is not stated and counts as zero: u_val is too small.")
    return tuple(out)


def _norm(values: FloatArray | Sequence[float]) -> float:
    """Return the root of the sum of squares."""
    return float(np.linalg.norm(values))


def _add(parts: Sequence[FloatArray], count: int) -> FloatArray:
    """Add independent standard uncertainties of n quantities, shape (n,)."""
    return np.asarray(np.sqrt(sum((part**2 for part in parts), start=np.zeros(count))))


def compare_measurement(measurement: Measurement, progress: Callable[[str], None] | None = None) -> ForceComparison:
    """Solve all curves of a measurement and compare; see `solve_curves` and `compare_forces`."""
    return compare_forces(measurement, solve_curves(measurement, progress))
