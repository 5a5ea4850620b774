"""Two-point separation against superposed closed-form responses."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference import point_spread
from fem_reference.closed_form import point_response
from validation.derivation.kernel import two_point_separation
from validation.sensor_file import load


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


def test_resolution_on_the_array_is_that_of_two_touches_on_real_texels(derivation):
    """Two touches on the array's own middle row, at every alignment: a texel between reads less than both sides."""
    array, spread = derivation.sensor.array, derivation.point_spread
    apart, row = derivation.result.resolution_on_array, array.centres[array.middle, 1]

    def dips(separation):
        found = []
        for shift in np.arange(8) / 8 * array.pitch[0]:
            touches = np.array([[shift - separation / 2, row], [shift + separation / 2, row]])
            image = array.image(spread.texel_influence(array, touches).sum(axis=0))[array.rows // 2]
            left, right = (round(float(x) / array.pitch[0] + 2.5) for x in touches[:, 0])
            between = image[left + 1 : right]
            found.append(between.size > 0 and between.min() < min(image[left], image[right]) - 1e-3 * image.max())
        return all(found)

    assert dips(apart)
    assert not dips(apart - array.pitch[0] / 4)


def test_resolution_scales_with_the_cover(derivation, thicker):
    assert two_point_separation(thicker) == pytest.approx(1.05 * derivation.result.resolution, rel=0.01)
    assert derivation.result.resolution_on_array >= 2 * derivation.sensor.array.pitch[0] - 1e-9


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
