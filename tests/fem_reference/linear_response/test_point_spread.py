"""Point spread function of a wide cover: balance, reciprocity, and how it scales."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fem_reference import point_spread
from fem_reference.linear_response.axisymmetric import solve_point_load
from meshes import TexelArray

ARRAY = TexelArray.grid(4, 3, (3.0e-3, 2.5e-3), texel_size=(2.6e-3, 2.2e-3))
PLACES = st.tuples(st.floats(-9e-3, 9e-3), st.floats(-9e-3, 9e-3))
# The fixture is solved once for all examples.
SHARED = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def spread(bonded):
    return point_spread(bonded(0.45))


@SHARED
@given(place=PLACES)
def test_texels_and_the_rest_of_the_base_carry_the_whole_load(spread, place):
    inside, outside = spread.texel_influence(ARRAY, place).sum(), spread.outside(ARRAY, place)[0]
    assert inside + outside == pytest.approx(1, abs=4e-3)


@SHARED
@given(one=st.integers(0, 11), other=st.integers(0, 11))
def test_two_texels_feel_loads_over_one_another_alike(spread, one, other):
    table = spread.texel_influence(ARRAY, ARRAY.centres[[one, other], :2])
    assert table[0, other] == pytest.approx(table[1, one], abs=1e-9)


@SHARED
@given(place=PLACES)
def test_a_mirrored_load_gives_the_mirrored_image(spread, place):
    x, y = place
    here, mirrored, turned = spread.texel_influence(ARRAY, [(x, y), (-x, y), (-x, -y)]).reshape(3, 4, 3)
    assert mirrored == pytest.approx(here[:, ::-1], abs=1e-12)
    assert turned == pytest.approx(here[::-1, ::-1], abs=1e-12)


@settings(max_examples=8, deadline=None)
@given(modulus=st.floats(1e3, 1e9), thickness=st.floats(1e-4, 1e-1))
def test_the_modulus_does_not_change_the_response_and_the_thickness_scales_it(bonded, modulus, thickness):
    unit, found = (
        solve_point_load(bonded(0.45, thickness=h, youngs_modulus=e), elements_per_thickness=4, reach=8 * h)
        for h, e in ((1.0, 1.0), (thickness, modulus))
    )
    assert found.radius == pytest.approx(unit.radius * thickness)
    pressure = unit.pressure_per_force
    assert found.pressure_per_force * thickness**2 == pytest.approx(pressure, abs=1e-8 * pressure.max())
    assert found.reaction == pytest.approx(unit.reaction, abs=1e-9)


def test_masked_texels_carry_nothing(spread):
    active = np.ones(12, dtype=bool)
    active[5] = False
    masked = TexelArray.grid(4, 3, (3.0e-3, 2.5e-3), texel_size=(2.6e-3, 2.2e-3), active=active)
    whole, part = (spread.texel_influence(array, (0.0, 0.0))[0] for array in (ARRAY, masked))
    assert part[5] == 0
    assert part[active] == pytest.approx(whole[active])
    assert spread.outside(masked, (0.0, 0.0))[0] - spread.outside(ARRAY, (0.0, 0.0))[0] == pytest.approx(
        whole[5], abs=4e-3
    )


def test_uniform_pressure_is_the_mean_of_point_loads(spread):
    centre = ARRAY.centres[ARRAY.middle, :2]
    x, y = np.meshgrid(*((np.arange(41) + 0.5) / 41 - 0.5,) * 2)
    places = centre + np.column_stack([x.ravel() * 2.6e-3, y.ravel() * 2.2e-3])
    mean = spread.texel_influence(ARRAY, places).mean(axis=0)
    assert spread.texel_response(ARRAY, "uniform") == pytest.approx(mean, abs=2e-4)


def test_covers_with_free_sides_are_refused(bonded):
    with pytest.raises(ValueError, match="free side edges"):
        point_spread(bonded(0.45, size=(10e-3, 10e-3)))
