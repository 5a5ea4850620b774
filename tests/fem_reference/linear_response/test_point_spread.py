"""Point spread function of a wide cover: reciprocity, mirror images, and uniform pressure on oblong texels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fem_reference import point_spread
from meshes import TexelArray

ARRAY = TexelArray.grid(4, 3, (3.0e-3, 2.5e-3), texel_size=(2.6e-3, 2.2e-3))
PLACES = st.tuples(st.floats(-9e-3, 9e-3), st.floats(-9e-3, 9e-3))
# The fixture is solved once for all examples.
SHARED = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def spread(bonded):
    return point_spread(bonded(0.45))


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


def test_uniform_pressure_is_the_mean_of_point_loads(spread):
    centre = ARRAY.centres[ARRAY.middle, :2]
    x, y = np.meshgrid(*((np.arange(41) + 0.5) / 41 - 0.5,) * 2)
    places = centre + np.column_stack([x.ravel() * 2.6e-3, y.ravel() * 2.2e-3])
    mean = spread.texel_influence(ARRAY, places).mean(axis=0)
    assert spread.texel_response(ARRAY, "uniform") == pytest.approx(mean, abs=2e-4)
