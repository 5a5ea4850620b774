"""Depths under a sphere against the finite elements, and the list of open quantities."""

import dataclasses

import pytest

from fem_reference import press
from fem_reference.closed_form.contact import sphere
from meshes import Sphere
from tests.support.rubber import make_cover
from validation.derivation.contact_range import fit_depth, list_undetermined


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


@pytest.mark.parametrize(
    ("thickness", "contacts"),
    [
        pytest.param(2e-3, [0.5e-3, 1e-3, 1.5e-3, 2e-3, 3e-3], marks=pytest.mark.slow),
        (6e-3, [1.5e-3, 3e-3, 4e-3]),
        pytest.param(9e-3, [1e-3, 2e-3, 4e-3], marks=pytest.mark.slow),
    ],
)
def test_radii_of_the_contact_follow_the_thickness_up_to_80_percent_of_the_sphere(thickness, contacts):
    """Where fewer than three of 1/4, 1/2, 3/4, 1 and 3/2 thicknesses remain, they follow the sphere."""
    cover = make_cover(0.45, "linear-elastic", thickness=thickness)
    found = fit_depth(cover)
    expected = [sphere(cover, 5e-3, contact) for contact in contacts]
    assert found.load == pytest.approx([each.force for each in expected])
    assert found.depth == pytest.approx([each.depth for each in expected], abs=0)
