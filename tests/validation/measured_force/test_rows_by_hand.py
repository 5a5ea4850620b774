"""Rows and verdict of a comparison with measured forces against plain formulas, with power laws as curves."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.stats import t as student

from meshes import Cover, Layer, Material, RoundedTip
from tests.support.measured_force import make_measurement
from validation.errors import InputError
from validation.measured_force.comparison import (
    Curve,
    Variation,
    compare_forces,
    fit_scale,
    interpolate_force,
    read_measured_force,
    replace_dome,
    shift_poisson_ratio,
)

DEPTH = np.array([0.3e-3, 0.5e-3, 0.8e-3, 1.1e-3, 1.6e-3, 2e-3])
FITTED = np.array([True, False, True, True, False, False])
ERROR = np.array([0.01, 0.02, 0.03, 0.015, 0.025, 0.04])
SCATTER = np.array([1.05, 0.97, 0.93, 1.08, 1.1, 0.88])


def rise(power, depth=DEPTH):
    """Forces of 4 N at 1 mm that rise with a power of the depth."""
    return 4 * (depth / 1e-3) ** power


def make_cover(*spreads):
    layers = tuple(
        Layer(thickness=2e-3, material=Material(name="gel", model="neo-hookean", poisson_ratio=0.3 + 0.1 * number,
                                                parameters={"shear_modulus": 1e5 * (number + 1)}, poisson_spread=each))
        for number, each in enumerate(spreads)
    )  # fmt: skip
    return Cover(layers=layers)


def measure(forces, *, fitted=FITTED, **uncertainty):
    return make_measurement(
        DEPTH, forces, fitted, cover=make_cover(0.02, 0.05), uncertainty=uncertainty, source="a report"
    )


def vary(power):
    """Forces with two inputs at the ends of their ranges."""
    return {
        "thickness": Variation(one=rise(power + 0.1), other=1.3 * rise(power - 0.15), width=2.0),
        "radius": Variation(one=0.9 * rise(power), other=1.2 * rise(power + 0.05), width=3.4),
    }


CURVES = {
    "frictionless": Curve(force=rise(1.9), error=ERROR, varied=vary(1.9)),
    "no slip": Curve(force=1.4 * rise(2.2), error=2 * ERROR, varied=vary(2.2)),
}


def fit(forces, computed, fitted=FITTED):
    """The geometric mean of the ratios of the fitted points."""
    return np.prod((forces / computed)[fitted]) ** (1 / fitted.sum())


def expect(forces, name, power, first, *, force=None, zero=None):
    """Scale, half width of its logarithm, and standard uncertainties of one bound of friction."""
    curve = CURVES[name]
    scale, count = fit(forces, curve.force), FITTED.sum()
    ends = {key: (each.one, each.other, each.width) for key, each in vary(power).items()}
    if zero:
        ends["zero of depth"] = (*(first * rise(power, DEPTH + sign * zero) for sign in (-1, 1)), 2.0)
    inputs, shifts = {}, []
    for key, (one, other, width) in ends.items():
        low, high = fit(forces, one), fit(forces, other)
        inputs[key] = np.abs(high * other - low * one) / width
        shifts.append(math.log(high / low) / width)
    if force is None:
        spread = np.log(forces / curve.force)[FITTED].std(ddof=1)
        coverage = student.ppf(0.975, count - 1)
    else:
        spread, coverage = np.sqrt(np.mean((force / forces[FITTED]) ** 2)), 1.96
    predicted = scale * curve.force
    inputs["fitted moduli"] = predicted * spread / np.sqrt(count)
    half = math.hypot(coverage * spread / math.sqrt(count), 1.96 * math.hypot(*shifts))
    numerical = predicted * np.sqrt(curve.error**2 + (curve.error[FITTED] ** 2).sum() / count**2)
    return scale, half, predicted, inputs, numerical


@pytest.mark.parametrize("stated", [{}, {"force": 0.3}, {"force": 0.2, "zero": 0.04e-3}, {"zero": 0.05e-3}])
def test_rows_of_both_bounds_and_between_follow_from_the_curves(stated):
    forces = 0.8 * rise(2.0) * SCATTER
    rows = compare_forces(measure(forces, **stated), CURVES).rows
    assert [row.name for row in rows] == ["frictionless", "no slip", "in between"]
    found = []
    for row, power, first in zip(rows, (1.9, 2.2), (1.0, 1.4), strict=False):
        scale, half, predicted, inputs, numerical = expect(forces, row.name, power, first, **stated)
        found.append(inputs)
        assert row.scale == pytest.approx(scale)
        assert row.interval == pytest.approx((scale * math.exp(-half), scale * math.exp(half)))
        np.testing.assert_allclose(row.predicted, predicted)
        np.testing.assert_allclose(row.error, predicted - forces)
        np.testing.assert_allclose(row.numerical, numerical)
        np.testing.assert_allclose(row.measured, stated.get("force", 0.0))
        assert row.inputs.keys() == inputs.keys()
        for key, each in inputs.items():
            np.testing.assert_allclose(row.inputs[key], each, err_msg=key, rtol=1e-6)
        u_input = np.sqrt(sum(each**2 for each in inputs.values()))
        np.testing.assert_allclose(row.u_input, u_input, rtol=1e-6)
        np.testing.assert_allclose(
            row.u_val, np.sqrt(u_input**2 + numerical**2 + stated.get("force", 0.0) ** 2), rtol=1e-6
        )
    one, other, between = rows
    assert between.scale == pytest.approx((one.scale + other.scale) / 2)
    assert between.interval == (
        min(one.interval[0], other.interval[0]), max(one.interval[1], other.interval[1])
    )  # fmt: skip
    np.testing.assert_allclose(between.predicted, (one.predicted + other.predicted) / 2)
    np.testing.assert_allclose(between.error, between.predicted - forces)
    np.testing.assert_allclose(between.numerical, np.maximum(one.numerical, other.numerical))
    np.testing.assert_allclose(between.measured, stated.get("force", 0.0))
    for key in found[0]:
        np.testing.assert_allclose(between.inputs[key], np.maximum(one.inputs[key], other.inputs[key]))
    half = np.abs(one.predicted - other.predicted) / 2
    np.testing.assert_allclose(between.inputs["friction"], half / math.sqrt(3))
    assert (between.zero_shift, between.misfit) == (None, None)


def test_a_comparison_keeps_what_was_measured():
    found = compare_forces(measure(rise(2.0)), CURVES)
    assert (found.name, found.source, found.fitted) == ("made up", "a report", tuple(FITTED.tolist()))
    np.testing.assert_array_equal(found.depth, DEPTH)
    np.testing.assert_array_equal(found.force, rise(2.0))
    assert found.shear_moduli == pytest.approx((1e5, 2e5))


def test_one_fitted_point_has_an_interval_only_with_its_stated_uncertainty():
    only, forces = np.arange(6) == 2, rise(2.0)
    plain = compare_forces(measure(forces, fitted=only), CURVES).rows
    assert [row.interval for row in plain] == [None] * 3
    assert "fitted moduli" not in plain[0].inputs
    stated = compare_forces(measure(forces, fitted=only, force=0.1), CURVES).rows[0]
    moduli = stated.predicted * 0.1 / forces[2]
    np.testing.assert_allclose(stated.inputs["fitted moduli"], moduli)


@pytest.mark.parametrize(
    ("shift", "found"), [(0.1e-3, 0.1e-3), (-0.12e-3, -0.12e-3), (0.4e-3, 0.15e-3), (-0.28e-3, -0.15e-3)]
)
def test_the_error_of_the_zero_is_sought_up_to_half_of_the_smallest_depth(shift, found):
    forces = 0.7 * rise(1.9, DEPTH + shift)
    row = compare_forces(measure(forces), CURVES).rows[0]
    assert row.zero_shift == pytest.approx(found, rel=1e-3)
    before, after = (np.std(np.log(forces / rise(1.9, DEPTH + by))) for by in (0.0, found))
    assert row.misfit == pytest.approx((before, after), rel=1e-3, abs=1e-5)


PLAIN = {
    name: Curve(force=rise(power), error=0 * DEPTH, varied={})
    for name, power in (("frictionless", 2.0), ("no slip", 2.5))
}


@pytest.mark.parametrize(("times", "allowed"), [(1.999, True), (2.001, False), (-1.999, True), (-2.001, False)])
@pytest.mark.parametrize("power", [2.0, 2.5])
def test_errors_of_two_standard_uncertainties_are_allowed_at_scored_points(times, allowed, power):
    """Fitted points are exact for one bound; one scored point is off by a number of standard uncertainties."""
    unit, forces = 0.02, rise(power)
    relative = unit * np.sqrt((forces[FITTED] ** -2.0).mean()) / math.sqrt(3)
    off = np.array([0, 0, 0, 0, times, 0]) * np.sqrt(unit**2 + (forces * relative) ** 2)
    found = compare_forces(measure(forces + off, force=unit, zero=1e-9), PLAIN)
    name = "frictionless" if power == 2.0 else "no slip"
    first = found.verdict[0]
    if allowed:
        assert first == f"The data allow {name}, and not the other bound: its error exceeds 2 u_val."
    else:
        assert first == f"The data allow neither bound of friction: both errors exceed 2 u_val; {name} is nearer."


def test_both_bounds_are_allowed_only_if_every_error_is_within_two_uncertainties():
    loud = compare_forces(measure(rise(2.2), force=3.0, zero=1e-9), PLAIN).verdict
    assert loud[0] == "The data allow both bounds of friction: every error is within 2 u_val."
    assert not any("outside both" in each for each in loud)


@pytest.mark.parametrize(("factor", "beyond"), [(0.6, True), (1.0, False), (1.9, True)])
def test_points_beyond_both_bounds_are_named_by_their_depth(factor, beyond):
    """With a power of 2.25 the data lie between the bounds, unless scored points are far below or above both."""
    forces = rise(2.25) * np.where(FITTED, 1.0, factor)
    verdict = compare_forces(measure(forces, force=1e-3, zero=1e-9), PLAIN).verdict
    said = "At 0.5 mm, 1.6 mm, 2 mm, the measured force lies more than 2 u_val outside both bounds"
    assert (f"{said}: no friction explains it." in verdict) == beyond
    assert any("outside both" in each for each in verdict) == beyond


@pytest.mark.parametrize(("shift", "when"), [(0.05e-3, "before"), (-0.07e-3, "after")])
def test_an_error_of_the_zero_is_said_for_the_nearer_bound(shift, when):
    forces = rise(2.0, DEPTH + shift)
    found = compare_forces(measure(forces, force=1e-3, zero=1e-9), PLAIN)
    (said,) = [each for each in found.verdict if each.startswith("For ")]
    misfit = 100 * np.std(np.log(forces / rise(2.0)))
    assert said.startswith(
        f"For frictionless, a contact that began {1e3 * abs(shift):.2g} mm {when} the stated zero of depth would "
        f"change the misfit of all points from {misfit:.2g} % to "
    )
    assert float(said.split()[-2]) < 0.01


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({}, "The uncertainty of force and zero of depth is not stated"),
        ({"force": 0.1}, "The uncertainty of zero of depth is not stated"),
        ({"zero": 1e-5}, "The uncertainty of force is not stated"),
        ({"force": 0.1, "zero": 1e-5}, None),
    ],
)
def test_uncertainties_that_are_not_stated_are_named(stated, said):
    last = compare_forces(measure(rise(2.0), **stated), PLAIN).verdict[-1]
    assert ("not stated" in last) == (said is not None)
    assert said is None or last == f"{said} and counts as zero: u_val is too small."


def test_a_force_that_is_exact_has_no_scatter_of_fitted_points():
    row = compare_forces(measure(rise(2.0) * SCATTER, force=0.0), PLAIN).rows[0]
    assert not row.inputs["fitted moduli"].any()
    assert row.interval == pytest.approx((row.scale, row.scale))


def test_the_factor_is_the_geometric_mean_of_the_fitted_ratios():
    forces = rise(2.0) * np.array([2.0, 99.0, 3.0, 4.5, 99.0, 99.0])
    assert fit_scale(measure(forces), rise(2.0)) == pytest.approx(27 ** (1 / 3))


@pytest.mark.parametrize("count", [2, 3, 4])
def test_few_points_are_interpolated_by_a_polynomial_of_the_logarithms(count):
    depth, force = DEPTH[:count], np.array([1.0, 2.5, 3.1, 7.0])[:count]
    polynomial = np.polyfit(np.log(depth), np.log(force), count - 1)
    inside = np.linspace(depth[0], depth[-1], 5)
    found = interpolate_force(depth, force)
    assert found(inside) == pytest.approx(np.exp(np.polyval(polynomial, np.log(inside))))
    slopes = np.polyval(np.polyder(polynomial), np.log(depth[[0, -1]]))
    beyond = found(np.array([depth[0] / 2, depth[-1] * 3]))
    assert beyond == pytest.approx([force[0] / 2 ** slopes[0], force[-1] * 3 ** slopes[1]])


def test_more_points_are_interpolated_by_a_cubic_spline_of_the_logarithms():
    force = np.array([1.0, 2.5, 3.1, 7.0, 7.5, 12.0])
    spline = CubicSpline(np.log(DEPTH), np.log(force))
    inside = np.linspace(DEPTH[0], DEPTH[-1], 9)
    assert interpolate_force(DEPTH, force)(inside) == pytest.approx(np.exp(spline(np.log(inside))))


def test_each_layer_moves_by_its_own_spread_at_its_shear_modulus():
    for sign in (-1, 1):
        moved = shift_poisson_ratio(make_cover(0.02, 0.05, 0.4), sign)
        ratios = [layer.material.poisson_ratio for layer in moved.layers]
        assert ratios == pytest.approx([0.3 + 0.02 * sign, 0.4 + 0.05 * sign, 0.1 if sign < 0 else 0.5])
        assert [layer.material.shear_modulus for layer in moved.layers] == pytest.approx([1e5, 2e5, 3e5])


def test_only_a_ball_on_a_dome_is_replaced():
    flat = measure(rise(2.0))
    domed = flat.model_copy(update={"top_radius": 21e-3})
    assert replace_dome(domed).radius == pytest.approx(7e-3 * 21 / 28)
    assert replace_dome(flat) is flat.indenter
    tip = RoundedTip(radius=1e-3)
    assert replace_dome(domed.model_copy(update={"indenter": tip})) is tip


def test_an_unknown_measurement_is_refused_with_the_nearest_name(tmp_path):
    with pytest.raises(InputError, match="did you mean 'gelsight-mini'"):
        read_measured_force("gelsight-min")
