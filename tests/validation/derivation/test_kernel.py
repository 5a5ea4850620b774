"""The kernel and its numbers: fit, quadrature, resolution and sensitivities, against exact and real solutions."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference import point_spread
from fem_reference.closed_form import point_response
from meshes import TexelArray
from tests.support.rubber import stack_layers
from validation.derivation.kernel import (
    fit_kernel,
    fitting_grid,
    gauss_points,
    sigma_range,
    sigma_sensitivities,
    texel_separation,
    two_point_separation,
    uncut_sigma,
)
from validation.sensor_file import load


def test_a_regular_grid_is_its_own_fitting_grid_and_another_layout_is_not(wts):
    assert fitting_grid(wts) is wts
    centres = wts.centres.copy()
    centres[0, 0] += 1e-4
    shifted = dataclasses.replace(wts, centres=centres)
    grid = fitting_grid(shifted)
    assert grid is not shifted
    assert (grid.pitch, grid.texel_size) == (shifted.pitch, shifted.texel_size)
    assert grid.rows == grid.columns > 10


def test_the_fit_hardly_depends_on_the_size_of_the_array(derivation):
    wide = fit_kernel(derivation.influence, TexelArray.grid(21, 21, derivation.sensor.array.pitch))
    assert wide.gaussian.sigma_x == pytest.approx(derivation.fit.gaussian.sigma_x, rel=2e-3)
    assert wide.estimates.keys() == derivation.fit.estimates.keys()


def test_uncut_sigma_is_an_estimate_of_the_fit_and_grows_on_a_finer_pitch(derivation):
    array = derivation.sensor.array
    assert uncut_sigma(derivation.influence, array) == pytest.approx(
        derivation.fit.estimates["least-squares-uniform-uncut"][0]
    )
    fine = TexelArray.grid(31, 31, tuple(edge / 2 for edge in array.pitch))
    assert uncut_sigma(derivation.influence, fine) > uncut_sigma(derivation.influence, array)


LENGTHS = st.floats(1e-4, 1.0)


@given(LENGTHS, LENGTHS, st.integers(1, 12), st.data())
def test_polynomials_up_to_twice_the_order_are_averaged_exactly(width, height, order, data):
    i, j = (data.draw(st.integers(0, 2 * order - 1)) for _ in "xy")
    points, weights = gauss_points((width, height), order)
    x, y = 2 * points[:, 0] / width, 2 * points[:, 1] / height
    exact = [0.0 if power % 2 else 1 / (power + 1) for power in (i, j)]
    assert weights.sum() == pytest.approx(1)
    assert weights @ (x**i * y**j) == pytest.approx(exact[0] * exact[1], abs=1e-12)


def test_points_lie_inside_the_rectangle_along_their_own_axis():
    points, _ = gauss_points((4.0, 1.0), 5)
    assert np.ptp(points, axis=0) == pytest.approx((4 * 0.9061798459, 0.9061798459))


@pytest.fixture(scope="module")
def thicker():
    return point_spread(load("wts-0614-34", thickness="2.1mm").cover)


def test_resolution_is_that_of_two_touches_on_the_exact_layer(derivation):
    """Base pressure between two point loads, superposed from the exact solution: a dip beyond the resolution only."""
    for factor, dips in ((0.97, False), (1.03, True)):
        apart = factor * derivation.result.resolution
        place = np.linspace(0, apart, 201)
        pressure = point_response(derivation.sensor.cover, place)
        pressure = pressure + pressure[::-1]
        assert (pressure[100] < pressure[0] - 1e-3 * pressure.max()) == dips


@dataclasses.dataclass
class Spread:
    """The influence of point loads on one texel at the origin, as a function of the distance along x."""

    force: object

    def texel_influence(self, _array, loads):
        return self.force(loads[:, 0])[:, None]


def test_two_gaussian_responses_are_separated_where_rayleighs_share_is_reached():
    """Midway 2 exp(-d2 / 8 s2) is 0.735 of the peak of the sum at d = 2.80 s."""
    sigma = 2.3e-3
    found = texel_separation(Spread(lambda x: np.exp(-((x / sigma) ** 2) / 2)), TexelArray.grid(3, 3, 1.9e-3))
    places = np.linspace(0, found, 4001)
    total = np.exp(-((places / sigma) ** 2) / 2) + np.exp(-(((found - places) / sigma) ** 2) / 2)
    assert total[2000] / total.max() == pytest.approx(0.735, abs=1e-3)
    assert found / sigma == pytest.approx(2.80, abs=0.01)


def test_a_texel_alone_separates_by_its_width():
    """Without spread two loads are separated once no texel holds both; a triangle of half width w needs 1.265 w."""
    array = TexelArray.grid(3, 3, 3.4e-3)
    assert texel_separation(Spread(lambda x: (x <= 1.7e-3) * 1.0), array) == pytest.approx(3.4e-3, rel=0.02)
    triangle = texel_separation(Spread(lambda x: np.maximum(1 - x / 3.4e-3, 0)), array)
    assert triangle == pytest.approx(1.265 * 3.4e-3, rel=1e-3)


@pytest.mark.slow
def test_the_separation_has_a_trend_with_the_thickness(derivation):
    array = derivation.sensor.array
    covers = (stack_layers((thickness, 1e6, 0.49)) for thickness in (0.5e-3, 1e-3, 3e-3, 4e-3))
    found = [texel_separation(point_spread(cover), array) for cover in covers]
    found.insert(2, derivation.result.resolution_on_array)  # 2 mm
    assert (np.diff(found) > 0.1e-3).all()
    assert array.pitch[0] < found[0] < found[-1] < 2 * array.pitch[0]


def test_resolution_scales_with_the_cover(derivation, thicker):
    assert two_point_separation(thicker) == pytest.approx(1.05 * derivation.result.resolution, rel=0.01)


@dataclasses.dataclass
class Profile:
    """A radial profile in the units of its own radius."""

    radius: np.ndarray
    pressure_per_force: np.ndarray


def gaussian_profile(sigma=1.0, peak=1.0):
    radius = sigma * np.linspace(0, 20, 4000)
    return Profile(radius, peak * np.exp(-((radius / sigma) ** 2) / 2))


def test_separation_of_a_gaussian_is_known():
    # For exp(-r2 / 2 s2) the midpoint dips below the loads from 2.35 s or so on (2 e^(-d2/8) = 1 + e^(-d2/2)).
    found = two_point_separation(gaussian_profile())
    assert 2 * np.exp(-(found**2) / 8) == pytest.approx(1 + np.exp(-(found**2) / 2), abs=0.01)


@given(st.floats(1e-4, 10), st.floats(1e-3, 1e6))
def test_separation_grows_with_the_width_and_not_with_the_force(sigma, peak):
    one = two_point_separation(gaussian_profile())
    assert two_point_separation(gaussian_profile(sigma, peak)) == pytest.approx(sigma * one, rel=1e-9)


def test_sensitivity_to_thickness_predicts_a_thicker_cover(derivation, thicker):
    own = derivation.fit.estimates["least-squares-uniform-uncut"][0]
    change = uncut_sigma(thicker, derivation.sensor.array) - own
    assert change == pytest.approx(derivation.result.sensitivity["thickness"] * 1e-4, rel=0.1)


def sigma(layers):
    """Of a run of the elements."""
    return uncut_sigma(point_spread(stack_layers(*layers)), load("wts-0614-34").array)


def sensitivity(layers):
    chosen = stack_layers(*layers)
    return sigma_sensitivities(chosen, load("wts-0614-34").array, point_spread(chosen))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.3, 0.49])
def test_sensitivity_to_poisson_ratio_is_that_of_real_runs(ratio):
    low, high = (sigma([(2e-3, 1e6, ratio + step)]) for step in (-0.005, 0.005))
    assert sensitivity([(2e-3, 1e6, ratio)])["poisson_ratio"] == pytest.approx((high - low) / 0.01, rel=0.01)


@pytest.mark.slow
def test_sensitivity_at_the_end_of_the_range_is_of_second_order():
    """A plain one-sided difference is 5 % off here."""
    end, near = sigma([(2e-3, 1e6, 0.5)]), sigma([(2e-3, 1e6, 0.4995)])
    assert sensitivity([(2e-3, 1e6, 0.5)])["poisson_ratio"] == pytest.approx((end - near) / 0.0005, rel=0.02)


@pytest.mark.slow
def test_the_range_of_sigma_is_that_of_real_runs_with_the_moduli_and_ratios_at_their_ends():
    """The modulus of one layer and the Poisson ratio of the other are uncertain, each with an effect of its own."""
    stacked = stack_layers((1.5e-3, 1e6, 0.45), (0.5e-3, 1e7, 0.4))
    bottom, top = stacked.layers
    stacked = replace(
        stacked,
        layers=(
            replace(bottom, material=replace(bottom.material, poisson_spread=0.1)),  # 0.35..0.5
            replace(top, material=replace(top.material, spread=0.5, spread_above=3.0)),
        ),
    )
    low, high = sigma_range(stacked, load("wts-0614-34").array, point_spread(stacked))
    own = sigma([(1.5e-3, 1e6, 0.45), (0.5e-3, 1e7, 0.4)])
    moduli = [sigma([(1.5e-3, 1e6, 0.45), (0.5e-3, end, 0.4)]) / own - 1 for end in (0.5e7, 4e7)]
    ratios = [sigma([(1.5e-3, 1e6, end), (0.5e-3, 1e7, 0.4)]) / own - 1 for end in (0.35, 0.5)]
    assert max(moduli) > 0.02
    assert min(ratios) < -0.02
    below, above = (np.hypot(end(0, *moduli), end(0, *ratios)) for end in (min, max))
    assert 1 - low == pytest.approx(below, rel=0.02, abs=3e-4)
    assert high - 1 == pytest.approx(above, rel=0.02, abs=3e-4)


@pytest.mark.slow
def test_no_range_is_stated_without_one_of_the_materials():
    stacked = stack_layers((1.5e-3, 1e6, 0.45))
    assert sigma_range(stacked, load("wts-0614-34").array, point_spread(stacked)) is None


@pytest.mark.slow
def test_sensitivities_of_two_layers_are_those_of_real_runs():
    """One layer at the end of its range and one far from it: neither may be measured by the other's step."""

    def layers(scale=1.0, step=0.0):
        return [(1.5e-3 * scale, 1e6, 0.3 - step), (0.5e-3 * scale, 1e7, 0.5 - step)]

    found = sensitivity(layers())
    thicker, thinner = sigma(layers(1.02)), sigma(layers(0.98))
    assert found["thickness"] == pytest.approx((thicker - thinner) / (0.04 * 2e-3), rel=1e-3)
    assert found["poisson_ratio"] == pytest.approx((sigma(layers()) - sigma(layers(step=0.002))) / 0.002, rel=0.02)


@pytest.mark.slow
def test_youngs_modulus_drops_out_of_the_point_spread(derivation):
    assert derivation.result.sensitivity["youngs_modulus"] == 0
    stiff, soft = derivation.point_spread, point_spread(stack_layers((2e-3, 1e4, 0.49)))
    assert derivation.sensor.cover.layers[0].material.youngs_modulus > 1e5
    np.testing.assert_allclose(soft.pressure_per_force, stiff.pressure_per_force, rtol=1e-6, atol=1e-6)
    two = [sigma([(1e-3, scale * 1e6, 0.49), (1e-3, scale * 1e7, 0.49)]) for scale in (1, 0.01)]
    assert two[0] == pytest.approx(two[1], rel=1e-6)


def test_of_several_layers_the_ratio_of_moduli_counts(derivation):
    """The test above can fail; two layers of one material are the derivation's single one."""
    alike = uncut_sigma(derivation.point_spread, derivation.sensor.array)
    assert abs(sigma([(1e-3, 1e6, 0.49), (1e-3, 1e7, 0.49)]) - alike) > 0.01
