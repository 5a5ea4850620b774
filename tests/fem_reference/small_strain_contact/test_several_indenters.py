"""Geometry of the bodies that are pressed together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.small_strain_contact.several_indenters import Body
from meshes import Box

PLACES = st.tuples(st.floats(-1e-2, 1e-2), st.floats(-1e-2, 1e-2))


@given(at=PLACES, yaw=st.floats(-7, 7), centre=PLACES)
def test_corners_and_weight_turn_about_the_axis(at, yaw, centre):
    body = Body(indenter=Box(size=(4e-3, 6e-3, 5e-3)), load=1.0, at=at, yaw=yaw, centre=centre)
    turn = np.exp(1j * yaw)
    corners = {complex(a * 2e-3, b * 3e-3) * turn + complex(*at) for a in (1, -1) for b in (1, -1)}
    found = body.corners @ [1, 1j]
    # A yaw within 1e-9 of a right angle counts as one.
    assert all(np.abs(found - corner).min() < 1e-10 for corner in corners)
    assert complex(*body.weight_point) == pytest.approx(complex(*centre) * turn + complex(*at), abs=1e-10)
