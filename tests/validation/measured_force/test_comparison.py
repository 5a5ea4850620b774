"""The fit of the moduli and the uncertainty of the comparison, on made-up curves and data."""

import math

import numpy as np
import pytest

from meshes import Cover, Layer, Material
from tests.support.measured_force import make_measurement
from validation.measured_force.comparison import Curve, Row, Variation, compare_forces, fit_scale, interpolate_force

DEPTH = np.array([0.25e-3, 0.5e-3, 0.75e-3, 1e-3, 1.5e-3, 2e-3])
FITTED = np.array([True, True, True, True, False, False])
NONE = np.zeros(len(DEPTH))


def rise(exponent):
    """Forces of 5 N at 1 mm that rise with a power of the depth."""
    return 5 * (DEPTH / 1e-3) ** exponent


def measure(forces, *, depth=DEPTH, fitted=FITTED, **uncertainty):
    rubber = Material(name="gel", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.495)
    cover = Cover(layers=(Layer(thickness=4e-3, material=rubber),))
    return make_measurement(depth, forces, fitted, cover=cover, uncertainty=uncertainty)


def curves(error=NONE, **varied):
    """Frictionless forces rise with the depth to the power 2, those without slip to the power 2.5."""
    return {
        "frictionless": Curve(force=rise(2.0), error=error, varied=varied),
        "no slip": Curve(force=rise(2.5), error=error, varied=varied),
    }


def test_the_known_factor_is_recovered():
    comparison = compare_forces(measure(0.7 * rise(2.0)), curves())
    frictionless, no_slip, _ = comparison.rows
    assert frictionless.scale == pytest.approx(0.7, rel=1e-12)
    assert np.abs(frictionless.error).max() < 1e-12
    assert no_slip.error[-1] > 0.1 * comparison.force[-1]


@pytest.mark.slow
@pytest.mark.parametrize("stated", [pytest.param(True, marks=pytest.mark.slow), False])
def test_the_interval_covers_the_known_factor(stated):
    random, covered = np.random.default_rng(5), 0
    for _ in range(150):
        force = 0.7 * rise(2.0)
        # A stated uncertainty is absolute; the fit weighs relative errors, so small forces scatter more.
        force = (
            force + random.normal(0, 0.02, len(force)) if stated else force * np.exp(random.normal(0, 0.05, len(force)))
        )
        row = compare_forces(measure(force, force=0.02 if stated else None), curves()).rows[0]
        covered += row.interval[0] <= 0.7 <= row.interval[1]
    assert 0.9 <= covered / 150 <= 0.99


@pytest.mark.slow
def test_errors_of_scored_points_are_within_their_uncertainty_as_often_as_stated():
    random, inside = np.random.default_rng(7), 0
    for _ in range(150):
        force = 0.7 * rise(2.0) + random.normal(0, 0.05, len(DEPTH))
        row = compare_forces(measure(force, force=0.05), curves()).rows[0]
        inside += abs(row.error[-1]) < row.u_val[-1]
    assert 0.60 <= inside / 150 <= 0.76  # 68 % of a normal distribution


def test_an_error_of_the_zero_of_depth_is_within_its_uncertainty():
    wrong = 0.03e-3
    force = 0.7 * 5 * ((DEPTH + wrong) / 1e-3) ** 2
    row = compare_forces(measure(force, force=1e-6, zero=wrong), curves()).rows[0]
    assert np.abs(row.error[-1]) == pytest.approx(row.u_val[-1], rel=0.15)
    assert row.zero_shift == pytest.approx(wrong, rel=1e-3)
    assert row.misfit[1] < 1e-3 * row.misfit[0]


def test_only_what_the_fit_does_not_absorb_counts_as_input():
    """A factor on all forces is absorbed by the moduli; a higher power of the depth is not."""
    varied = {
        "factor": Variation(one=rise(2.0), other=1.3 * rise(2.0), width=2.0),
        "power": Variation(one=rise(1.9), other=rise(2.1), width=2.0),
    }
    row = compare_forces(measure(rise(2.0)), curves(**varied)).rows[0]
    assert row.inputs["factor"][-1] < 1e-9
    middle = np.exp(np.log(DEPTH[FITTED]).mean())
    expected = rise(2.0)[-1] * np.sinh(0.1 * np.log(DEPTH[-1] / middle))
    assert row.inputs["power"][-1] == pytest.approx(expected, rel=1e-9)
    # The interval of the moduli holds both.
    assert row.interval[1] > math.exp(1.96 * math.log(1.3) / 2)


def test_parts_add_up():
    row = compare_forces(measure(rise(2.0), force=0.1), curves(error=NONE + 0.02)).rows[0]
    total = row.numerical**2 + sum(part**2 for part in row.inputs.values()) + 0.1**2
    np.testing.assert_allclose(row.u_val**2, total)
    np.testing.assert_allclose(row.numerical, row.predicted * np.hypot(0.02, 0.02 / 2))
    told = row.as_json()
    np.testing.assert_allclose(told["u_val"], row.u_val)
    assert Row.from_json(told) == row


def test_friction_between_the_bounds_holds_half_their_range():
    one, other, between = compare_forces(measure(rise(2.2), force=0.01), curves()).rows
    half = np.abs(one.predicted - other.predicted) / 2
    np.testing.assert_allclose(between.inputs["friction"], half / math.sqrt(3))
    assert abs(between.error[-1]) < 2 * between.u_val[-1]


@pytest.mark.parametrize(
    ("power", "words"),
    [(2.0, "allow frictionless, and not"), (2.5, "allow no slip, and not"), (3.0, "neither bound"), (2.25, "neither")],
)
def test_the_verdict_names_the_bound_of_the_data(power, words):
    verdict = compare_forces(measure(rise(power), force=0.005), curves()).verdict
    assert words in verdict[0]
    assert any("outside both bounds" in sentence for sentence in verdict) == (power == 3.0)


def test_both_bounds_are_allowed_where_the_data_scatter_more():
    assert "both bounds" in compare_forces(measure(rise(2.2), force=2.0), curves()).verdict[0]


def test_what_is_not_stated_is_said():
    assert "force and zero of depth is not stated" in compare_forces(measure(rise(2.0)), curves()).verdict[-1]
    stated = measure(rise(2.0), force=0.1, zero=1e-5)
    assert not any("not stated" in sentence for sentence in compare_forces(stated, curves()).verdict)


def test_one_fitted_point_of_unknown_uncertainty_has_no_interval():
    only = np.arange(len(DEPTH)) == 1
    row = compare_forces(measure(rise(2.0), fitted=only), curves()).rows[0]
    assert row.interval is None
    assert row.scale == pytest.approx(1.0)
    assert compare_forces(measure(rise(2.0), fitted=only, force=0.1), curves()).rows[0].interval is not None


def test_repeats_at_one_depth_count_each():
    depth = np.array([1e-3, 1e-3, 2e-3])
    force = np.array([4.0, 6.25, 20.0])
    given = measure(force, depth=depth, fitted=np.array([True, True, False]))
    assert fit_scale(given, np.array([5.0, 5.0, 20.0])) == pytest.approx(1.0)
    assert interpolate_force(depth, np.array([5.0, 5.0, 20.0]))(np.array([1.5e-3])) == pytest.approx([11.25])


def test_beyond_the_measured_depths_the_force_goes_on_as_a_power():
    depth = np.array([0.5, 1.0, 1.5, 2.0]) * 1e-3
    rise = interpolate_force(depth, np.array([1.0, 3.0, 9.0, 11.0]))
    for end, inwards in ((depth[0], 1.001), (depth[-1], 0.999)):
        power = np.log(rise(inwards * end) / rise(end)) / np.log(inwards)
        assert rise(end / inwards**50) == pytest.approx(rise(end) * inwards ** (-50 * power), rel=1e-3)
