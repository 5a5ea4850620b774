"""Sensitivities of sigma against real finite-element runs."""

import numpy as np
import pytest

from fem_reference import point_spread
from meshes import Cover, Layer, Material
from validation.derivation.kernel import sigma_sensitivities, uncut_sigma
from validation.sensor_file import load


@pytest.fixture(scope="module")
def thicker():
    return point_spread(load("wts-0614-34", thickness="2.1mm").cover)


def test_sensitivity_to_thickness_predicts_a_thicker_cover(derivation, thicker):
    own = derivation.fit.estimates["least-squares-uniform-uncut"][0]
    change = uncut_sigma(thicker, derivation.sensor.array) - own
    assert change == pytest.approx(derivation.result.sensitivity["thickness"] * 1e-4, rel=0.1)


def cover(*layers):
    """Layers from bottom to top: thickness [m], Young's modulus [Pa], Poisson ratio."""
    return Cover(
        layers=tuple(
            Layer(
                thickness=thickness,
                material=Material(
                    name="test", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
                ),
            )
            for thickness, modulus, ratio in layers
        )
    )


def sigma(layers):
    """Of a run of the elements."""
    return uncut_sigma(point_spread(cover(*layers)), load("wts-0614-34").array)


def sensitivity(layers):
    chosen = cover(*layers)
    return sigma_sensitivities(chosen, load("wts-0614-34").array, point_spread(chosen))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.3, 0.49])
def test_sensitivity_to_poisson_ratio_is_that_of_real_runs(ratio):
    low, high = (sigma([(2e-3, 1e6, ratio + step)]) for step in (-0.005, 0.005))
    assert sensitivity([(2e-3, 1e6, ratio)])["poisson_ratio"] == pytest.approx((high - low) / 0.01, rel=0.01)


def test_sensitivity_at_the_end_of_the_range_is_of_second_order():
    """A plain one-sided difference is 5 % off here."""
    end, near = sigma([(2e-3, 1e6, 0.5)]), sigma([(2e-3, 1e6, 0.4995)])
    assert sensitivity([(2e-3, 1e6, 0.5)])["poisson_ratio"] == pytest.approx((end - near) / 0.0005, rel=0.02)


@pytest.mark.slow
def test_sensitivities_of_two_layers_are_those_of_real_runs():
    """One layer at the end of its range and one far from it: neither may be measured by the other's step."""

    def layers(scale=1.0, step=0.0):
        return [(1.5e-3 * scale, 1e6, 0.3 - step), (0.5e-3 * scale, 1e7, 0.5 - step)]

    found = sensitivity(layers())
    thicker, thinner = sigma(layers(1.02)), sigma(layers(0.98))
    assert found["thickness"] == pytest.approx((thicker - thinner) / (0.04 * 2e-3), rel=1e-3)
    assert found["poisson_ratio"] == pytest.approx((sigma(layers()) - sigma(layers(step=0.002))) / 0.002, rel=0.02)


def test_youngs_modulus_drops_out_of_the_point_spread(derivation):
    assert derivation.result.sensitivity["youngs_modulus"] == 0
    stiff, soft = derivation.point_spread, point_spread(cover((2e-3, 1e4, 0.49)))
    assert derivation.sensor.cover.layers[0].material.youngs_modulus > 1e5
    np.testing.assert_allclose(soft.pressure_per_force, stiff.pressure_per_force, rtol=1e-6, atol=1e-6)
    two = [sigma([(1e-3, scale * 1e6, 0.49), (1e-3, scale * 1e7, 0.49)]) for scale in (1, 0.01)]
    assert two[0] == pytest.approx(two[1], rel=1e-6)


def test_of_several_layers_the_ratio_of_moduli_counts(derivation):
    """The test above can fail; two layers of one material are the derivation's single one."""
    alike = uncut_sigma(derivation.point_spread, derivation.sensor.array)
    assert abs(sigma([(1e-3, 1e6, 0.49), (1e-3, 1e7, 0.49)]) - alike) > 0.01
