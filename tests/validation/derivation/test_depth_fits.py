"""Depths under a sphere against the finite elements, and the list of open quantities."""

import dataclasses

import pytest

from fem_reference import press
from meshes import Sphere
from validation.derivation.undetermined import list_undetermined


@pytest.mark.slow
def test_depths_are_those_of_the_elements_and_what_they_leave_open_is_said(derivation):
    depth = derivation.depth
    description, ball = derivation.sensor, Sphere(radius=depth.ball_radius)
    pressed = press(description.cover, description.array, ball, load=depth.load[2])
    assert depth.depth[2] == pytest.approx(pressed.depth, rel=3e-3)
    lightest, heaviest = (depth.foundation.estimates[name] for name in ("lightest", "heaviest"))
    assert lightest != pytest.approx(heaviest, rel=0.1)
    assert abs(depth.contact.misses[2]) < 1e-3 < abs(depth.contact.misses[[0, -1]]).min()
    told = " ".join(derivation.undetermined)
    for word in ("Young's modulus", "filter", "nobody measured", "foundation modulus", "g only", "friction"):
        assert word in told
    hard = dataclasses.replace(derivation.sensor.cover, assumed=False)
    assert "nobody measured" not in " ".join(list_undetermined(hard, derivation.fit, None))
