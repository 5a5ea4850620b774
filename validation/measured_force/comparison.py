"""Fit the moduli of a cover to some measured forces, and compare the finite elements with the others.

Stress is proportional to the moduli, so one factor on all moduli multiplies every force.  The factor minimises the
squared relative errors (in logarithms) at the fitted points.  The comparison follows ASME V&V 20-2009: the error E is
the prediction S minus the measured D, and its standard uncertainty u_val combines those of the finite elements (u_num),
of the inputs (u_input) and of the measurement (u_D).  If abs(E) < u_val, the comparison cannot resolve an error of the
model.  The factor is fitted again for each varied input, so that only what the fit does not absorb counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from meshes import Cover, Indenter, Layer, Sphere, TexelArray
from meshes.array_types import FloatArray
from validation.errors import nearest
from validation.results import Array, Result, result_model
from validation.schema import read
from validation.schema.measured_force import Measurement

#: Measurements that come with the package, by the name on the command line, and their files.
BUILT_IN = {"gelsight-mini": "gelsight-mini.toml"}
#: Names of the two bounds of friction, and their coefficients [-].
BOUNDS: Mapping[str, float] = {"frictionless": 0.0, "no slip": math.inf}
#: Name of the row in which friction may lie anywhere between its bounds.
BETWEEN = "in between"


@dataclass(frozen=True, kw_only=True)
class ComparisonNumbers:
    """Constants of the comparison with measured forces.

    Attributes:
        probability: Probability of the interval of the fitted factor [-].
        coverage: Number of standard uncertainties that a normal distribution has within that probability [-].
        allowed: Number of standard uncertainties up to which an error is allowed, at about 95 % [-].
        uniform: Half of the width of a uniform distribution over its standard deviation [-].
        largest_shift: Largest error of the zero of depth that is considered as an explanation, over the smallest depth
            [-].
    """

    probability: float = 0.95
    coverage: float = 1.96
    allowed: float = 2.0
    uniform: float = math.sqrt(3)
    largest_shift: float = 0.5


NUMBERS = ComparisonNumbers()


def read_measured_force(path: str | Path) -> Measurement:
    """Read a file of measured forces, or take a built-in one.

    Args:
        path: Path of a file, or a name in `BUILT_IN`.

    Raises:
        InputError: With one line per fault: the place in the file, what is wrong, and what would be accepted.
        OSError: If the file exists and cannot be read.
    """
    name = str(path)
    hint = f"or built-in measurement; {nearest(name, BUILT_IN)}, or a TOML file"
    file = resources.files("validation.measured_force").joinpath(BUILT_IN[name]) if name in BUILT_IN else path
    return read(Path(str(file)), Measurement, hint=hint)


def replace_dome(measurement: Measurement) -> Indenter:
    """Return the ball whose gap to a flat top is that of the measured ball to the domed top.

    The curvatures of ball and top add (Hertz).  The indenter is unchanged if the top is flat.
    """
    ball: Indenter = measurement.indenter
    top = measurement.top_radius
    if top is None or not isinstance(ball, Sphere):
        return ball
    return Sphere(radius=1 / (1 / ball.radius + 1 / top))


def shift_poisson_ratio(cover: Cover, sign: int) -> Cover:
    """Move the Poisson ratio of every layer by its spread, at equal shear modulus, within 0..0.5."""

    def shift(layer: Layer) -> Layer:
        material = layer.material
        ratio = float(np.clip(material.poisson_ratio + sign * material.poisson_spread, 0, 0.5))
        if material.small_strain_only:
            moduli = {"youngs_modulus": 2 * material.shear_modulus * (1 + ratio)}
            return replace(layer, material=replace(material, poisson_ratio=ratio, parameters=moduli))
        return replace(layer, material=material.with_poisson_ratio(ratio))

    return replace(cover, layers=tuple(map(shift, cover.layers)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Variation:
    """Forces at n depths at the two ends of the range of one uncertain input.

    Attributes:
        one: Forces at one end, shape (n,) [N].
        other: Forces at the other end, shape (n,) [N].
        width: Width of the range in standard uncertainties [-].
    """

    one: FloatArray
    other: FloatArray
    width: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """Forces at n depths at the moduli of the file.

    Attributes:
        force: Forces, shape (n,) [N].
        error: Estimated relative errors of the finite elements, shape (n,) [-].
        varied: Forces with one uncertain input changed, by the name of the input.
    """

    force: FloatArray
    error: FloatArray
    varied: Mapping[str, Variation]


def solve_curves(measurement: Measurement, progress: Callable[[str], None] | None = None) -> dict[str, Curve]:
    """Solve the indentation at every measured depth for both bounds of friction and for each varied input.

    The force on a wide, flat cover is multiplied by the effect of the free sides.  The effect is the ratio of the
    frictionless forces on the cover of limited size and on a wide one.  A domed top is replaced by a ball of the same
    gap.  Both are approximations, so the whole effect of each is one half-width of its range.

    Args:
        measurement: Indenter, cover and depths.
        progress: Called with a line of text before each solution.

    Raises:
        IncompletePathError: If the finite elements stop before the largest depth.
    """
    wide = replace(measurement.cover, size=None)
    domed, flat = replace_dome(measurement), measurement.indenter
    depths, places = np.unique(measurement.depth, return_inverse=True)

    def solve(name: str, cover: Cover, indenter: Indenter, friction: float) -> tuple[FloatArray, FloatArray]:
        """Solve the force of an indenter over depth by finite elements.

        Returns:
            Forces [N] and their estimated relative errors [-] at the n measured depths, shape (n,) each.
        """
        from fem_reference.indentation.press import press_path

        if progress is not None:
            progress(name)
        # The force does not depend on the texels.
        array = TexelArray.grid(1, 1, pitch=depths[0])
        path = press_path(cover, array, indenter, depths=depths.tolist(), friction=friction)
        force, error = np.array([(each.total_force, each.error_estimate["total_force"]) for each in path]).T
        return force[places], error[places]

    sides, sides_error = np.ones(len(places)), np.zeros(len(places))
    if measurement.cover.size is not None:
        bounded, sides_error = solve("free sides", measurement.cover, flat, 0.0)
        sides = bounded / solve("wide cover", wide, flat, 0.0)[0]
    curves = {}
    for bound, friction in BOUNDS.items():
        force, error = solve(bound, wide, domed, friction)
        varied = {}
        if any(layer.material.poisson_spread for layer in wide.layers):
            low, high = (
                solve(f"{bound}, {end} Poisson ratio", shift_poisson_ratio(wide, sign), domed, friction)[0]
                for end, sign in (("low", -1), ("high", 1))
            )
            varied["Poisson ratio"] = Variation(one=sides * low, other=sides * high, width=2 * NUMBERS.uniform)
        if domed is not flat:
            on_flat = solve(f"{bound}, flat top", wide, flat, friction)[0]
            varied["dome"] = Variation(one=sides * force, other=sides * on_flat, width=NUMBERS.uniform)
        if measurement.cover.size is not None:
            varied["sides"] = Variation(one=sides * force, other=force, width=NUMBERS.uniform)
        curves[bound] = Curve(force=sides * force, error=np.hypot(error, sides_error), varied=varied)
    return curves


@result_model
class Row(Result):
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

    computed = (("u_input", "u_input"), ("u_val", "u_val"))

    name: str
    scale: float
    interval: tuple[float, float] | None
    predicted: Array
    error: Array
    numerical: Array
    inputs: Mapping[str, Array]
    measured: Array
    zero_shift: float | None = None
    misfit: tuple[float, float] | None = None

    @property
    def u_input(self) -> FloatArray:
        """Standard uncertainty of the prediction due to all inputs, shape (n,) [N]."""
        return np.asarray(np.sqrt(sum((part**2 for part in self.inputs.values()), start=np.zeros(len(self.error)))))

    @property
    def u_val(self) -> FloatArray:
        """Standard uncertainty of the error, shape (n,) [N]."""
        return np.asarray(np.sqrt(self.numerical**2 + self.u_input**2 + self.measured**2))


@result_model
class ForceComparison(Result):
    """Comparison of the finite elements with a measurement, at both bounds of friction and between them.

    Attributes:
        name: Name of the measurement.
        source: Origin of the data.
        depth: Approaches from first touch, ascending, shape (n,) [m].
        force: Measured normal forces, shape (n,) [N].
        fitted: Whether the moduli are fitted to each point; the others are scored, n entries.
        shear_moduli: Shear modulus of each layer as given, before the fitted factor [Pa].
        rows: Frictionless, no slip, and `BETWEEN`.
        verdict: Sentences about what the data allow.
    """

    name: str
    source: str
    depth: Array
    force: Array
    fitted: tuple[bool, ...]
    shear_moduli: tuple[float, ...]
    rows: tuple[Row, ...]
    verdict: tuple[str, ...]


def compare_measurement(measurement: Measurement, progress: Callable[[str], None] | None = None) -> ForceComparison:
    """Solve all curves of a measurement and compare; see `solve_curves` and `compare_forces`."""
    return compare_forces(measurement, solve_curves(measurement, progress))


def compare_forces(measurement: Measurement, curves: Mapping[str, Curve]) -> ForceComparison:
    """Fit the moduli and compare the finite elements with a measurement.

    Args:
        measurement: The measurement.
        curves: Forces of the finite elements for each of `BOUNDS`, from `solve_curves`.
    """
    rows = [_compare_bound(measurement, bound, curves[bound]) for bound in BOUNDS]
    rows.append(_combine_bounds(measurement, rows))
    return ForceComparison(
        name=measurement.name,
        source=measurement.source,
        depth=measurement.depth,
        force=measurement.force,
        fitted=tuple(measurement.fitted.tolist()),
        shear_moduli=tuple(layer.material.shear_modulus for layer in measurement.cover.layers),
        rows=tuple(rows),
        verdict=_judge(measurement, rows),
    )


def fit_scale(measurement: Measurement, force: FloatArray) -> float:
    """Return the factor on forces that fits them to the fitted points of a measurement [-]."""
    use = measurement.fitted
    return float(np.exp(np.mean(np.log(measurement.force[use] / force[use]))))


def _compare_bound(measurement: Measurement, name: str, curve: Curve) -> Row:
    """Compare the finite elements at one bound of friction with a measurement."""
    use, count = measurement.fitted, int(measurement.fitted.sum())
    scale = fit_scale(measurement, curve.force)
    predicted = scale * curve.force
    varied = dict(curve.varied)
    if shift := measurement.uncertainty.zero:
        rise = interpolate_force(measurement.depth, curve.force)
        one, other = (rise(measurement.depth + sign * shift) for sign in (-1, 1))
        varied["zero of depth"] = Variation(one=one, other=other, width=2.0)
    inputs, of_scale = {}, []
    for key, each in varied.items():
        one_scale, other_scale = (fit_scale(measurement, force) for force in (each.one, each.other))
        inputs[key] = np.abs(other_scale * each.other - one_scale * each.one) / each.width
        of_scale.append(abs(np.log(other_scale) - np.log(one_scale)) / each.width)
    spread, coverage = _estimate_scatter(measurement, curve.force)
    if spread is not None:
        inputs["fitted moduli"] = predicted * spread / np.sqrt(count)
    half = (
        None
        if spread is None
        else np.hypot(coverage * spread / np.sqrt(count), NUMBERS.coverage * np.linalg.norm(of_scale))
    )
    zero_shift, misfit = _fit_zero(measurement, curve.force)
    noise = measurement.uncertainty.force or 0.0
    return Row(
        name=name,
        scale=scale,
        interval=None if half is None else (float(scale * np.exp(-half)), float(scale * np.exp(half))),
        predicted=predicted,
        error=predicted - measurement.force,
        numerical=predicted * np.hypot(curve.error, np.linalg.norm(curve.error[use]) / count),
        inputs=inputs,
        measured=np.full(len(predicted), noise),
        zero_shift=zero_shift,
        misfit=misfit,
    )


def interpolate_force(depth: FloatArray, force: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Interpolate the logarithm of the force over that of the depth by a cubic spline, beyond its ends by a line.

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
    if measurement.uncertainty.force is not None:
        return np.linalg.norm(measurement.uncertainty.force / measurement.force[use]) / np.sqrt(count), NUMBERS.coverage
    if count == 1:
        return None, 0.0
    residual = np.log(measurement.force[use] / force[use])
    return float(np.std(residual, ddof=1)), float(student.ppf((1 + NUMBERS.probability) / 2, count - 1))


def _fit_zero(measurement: Measurement, force: FloatArray) -> tuple[float, tuple[float, float]]:
    """Find the error of the zero of depth with which a curve fits all points best, and the misfit without and with it.

    Returns:
        Shift of the depths [m], and the root mean square of the relative errors without and with the shift [-].
    """
    depth, rise = measurement.depth, interpolate_force(measurement.depth, force)

    def measure_misfit(shift: float) -> float:
        return float(np.std(np.log(measurement.force / rise(depth + shift))))

    most = NUMBERS.largest_shift * depth[0]
    shift = float(minimize_scalar(measure_misfit, bounds=(-most, most), method="bounded", options={"xatol": 1e-9}).x)
    return shift, (measure_misfit(0.0), measure_misfit(shift))


def _combine_bounds(measurement: Measurement, rows: Sequence[Row]) -> Row:
    """Make the row for friction anywhere between its bounds: mean prediction, with half the range as uncertainty."""
    one, other = rows
    predicted = (one.predicted + other.predicted) / 2
    inputs = {key: np.maximum(one.inputs[key], other.inputs[key]) for key in one.inputs}
    inputs["friction"] = np.abs(one.predicted - other.predicted) / 2 / NUMBERS.uniform
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
    allowed = [row.name for row in bounds if (np.abs(row.error) <= NUMBERS.allowed * row.u_val)[scored].all()]
    closest = min(bounds, key=lambda row: float(np.abs(row.error / measurement.force)[scored].max()))
    if len(allowed) == len(bounds):
        out = ["The data allow both bounds of friction: every error is within 2 u_val."]
    elif allowed:
        out = [f"The data allow {allowed[0]}, and not the other bound: its error exceeds 2 u_val."]
    else:
        out = [f"The data allow neither bound of friction: both errors exceed 2 u_val; {closest.name} is nearer."]
    errors = np.array([row.error for row in bounds])
    far = np.abs(errors) > NUMBERS.allowed * np.array([row.u_val for row in bounds])
    beyond = scored & far.all(axis=0) & ((errors > 0).all(axis=0) | (errors < 0).all(axis=0))
    if beyond.any():
        at = ", ".join(f"{1e3 * depth:.3g} mm" for depth in measurement.depth[beyond])
        out.append(f"At {at}, the measured force lies more than 2 u_val outside both bounds: no friction explains it.")
    if closest.misfit is not None and closest.zero_shift is not None:
        before, after = (f"{100 * value:.2g} %" for value in closest.misfit)
        when = "before" if closest.zero_shift > 0 else "after"
        out.append(
            f"For {closest.name}, a contact that began {1e3 * abs(closest.zero_shift):.2g} mm {when} the stated zero "
            f"of depth would change the misfit of all points from {before} to {after}."
        )
    stated = {"force": measurement.uncertainty.force, "zero of depth": measurement.uncertainty.zero}
    if missing := [name for name, value in stated.items() if value is None]:
        out.append(f"The uncertainty of {' and '.join(missing)} is not stated and counts as zero: u_val is too small.")
    return tuple(out)
