"""Changes of the response under stretch, against the Hankel transform written out with made-up responses."""

from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.linear_response.axisymmetric import point_spread
from fem_reference.linear_response.membrane_tension import Stretch, StretchedResponse
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import membrane_length
from tests.support.rubber import make_cover, stack_layers

STRETCH = Stretch(tension=300.0, length=0.4e-3)
K = np.linspace(50.0, 4000.0, 23)
RADIUS = np.linspace(0.0, 6e-3, 12)
#: Base pressure and depth of waves of unit pressure: a made-up cover.
BASE, COMPLIANCE = np.exp(-1e-3 * K), 1e-9 / (1 + 1e-3 * K)


@pytest.fixture
def response():
    hankel = np.random.default_rng(4).uniform(-1, 1, (len(RADIUS), len(K)))
    waves = SimpleNamespace(base=BASE, compliance=COMPLIANCE)
    return StretchedResponse(radius=RADIUS, wave_number=K, waves=waves, hankel=hankel)


def keep():
    """Share of each wave that the stretch leaves: 1 / (1 + T k^2 C + (k l)^2)."""
    return 1 / (1 + 300.0 * K**2 * COMPLIANCE + (0.4e-3 * K) ** 2)


def spread(response, contact_radius):
    x = K * contact_radius
    hertz = 3 * (np.sin(x) - x * np.cos(x)) / x**3 if contact_radius else 1.0
    return response.hankel @ (hertz * BASE * keep())


@pytest.mark.parametrize("contact_radius", [0.0, 1.3e-3])
def test_a_contact_of_any_size_is_spread_by_what_the_stretch_leaves(response, contact_radius):
    found = response.spread_over_contact(STRETCH, contact_radius)
    np.testing.assert_allclose(found, spread(response, contact_radius), rtol=1e-6, atol=1e-7)


def test_the_size_of_the_contact_is_removed_by_the_difference_of_a_point_and_hertz(response):
    pressed = PointSpread(radius=RADIUS, pressure_per_force=np.cos(200 * RADIUS), reaction=1.0, thickness=2e-3)
    found = response.remove_contact(pressed, 1.3e-3, STRETCH)
    expected = pressed.pressure(RADIUS) + spread(response, 0.0) - spread(response, 1.3e-3)
    np.testing.assert_allclose(found.pressure_per_force, expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(found.radius, RADIUS)


def test_the_compliance_of_the_top_loses_what_the_stretch_takes_away():
    from fem_reference.linear_response.surface_compliance import surface_compliance

    cover = make_cover(0.45, "linear-elastic")
    surface = surface_compliance(cover, 6e-3)
    response = StretchedResponse.prepare(cover, RADIUS)
    found = response.stretch_compliance(surface, STRETCH)
    k, compliance = response.wave_number, response.waves.compliance
    resistance = 300.0 * k**2 * compliance + (0.4e-3 * k) ** 2
    taken = response.hankel @ (compliance * resistance / (1 + resistance))
    np.testing.assert_allclose(found.regular(RADIUS), surface.regular(RADIUS) - taken, rtol=1e-9)
    assert taken[0] > 0.1 * abs(surface.regular(RADIUS[:1])[0])


@pytest.mark.slow
def test_without_stretch_the_transform_gives_the_point_spread_of_the_cover():
    cover = make_cover(0.3, "linear-elastic")
    radius = np.linspace(0.0, 8e-3, 300)
    response = StretchedResponse.prepare(cover, radius)
    assert response.hankel.shape == (300, len(response.wave_number))
    found = response.spread_over_contact(Stretch(tension=0.0, length=0.0), 0.0)
    expected = point_spread(cover).pressure(radius)
    np.testing.assert_allclose(found, expected, atol=5e-3 * expected.max())


def test_shear_lag_of_a_film_on_rubber():
    soft, stiff = (2e-3, 3e6, 0.5), (50e-6, 4e9, 0.3)
    length = np.sqrt(4e9 * 50e-6 / (1 - 0.09) * 2e-3 / 1e6)
    assert membrane_length(stack_layers(soft, stiff)) == pytest.approx(length)
    assert membrane_length(stack_layers(soft)) == 0.0
    # the longest of the interfaces counts
    both = np.sqrt((4e9 * 50e-6 / 0.91 + 3e6 * 2e-3 / 0.75) * 2e-3 / 1e6)
    assert membrane_length(stack_layers(soft, stiff, soft)) == pytest.approx(max(both, length))
