"""Tilted indenters under `press`: moment of a tilted punch on a half-space, mirrored images, and small tilts."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press
from meshes import Box, Cylinder, Pose, Sphere
from tests.support.coarse_cells import rough_cells
from tests.support.indentations import column_contact
from tests.support.rubber import make_cover

BOX = Box(size=(6e-3, 4e-3, 5e-3))


def find_moment(found):
    return column_contact(found)[:, 2] @ column_contact(found)[:, :2]


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [1.0])
def test_the_moment_of_a_tilted_punch_in_full_contact_is_that_on_a_half_space(wts, degrees):
    """4/3 E* a^3 tilt (Johnson 1985, section 5.1); the raised rim touches while P > 4 E* a^2 tilt."""
    cover = make_cover(0.3, "linear-elastic", thickness=20e-3)
    modulus, radius, tilt, load = 1e6 / (1 - 0.3**2), 0.5e-3, np.radians(degrees), 0.02
    assert load > 4 * modulus * radius**2 * tilt
    found = press(cover, wts, Cylinder(radius=radius), load=load, pose=Pose.planar(tilt=(0.0, tilt)))
    assert find_moment(found) == pytest.approx((4 / 3 * modulus * radius**3 * tilt, 0), rel=0.01, abs=1e-9)
    upright = press(cover, wts, Cylinder(radius=radius), load=load)
    assert found.depth == pytest.approx(upright.depth + radius * tilt, rel=0.005)
    assert found.contact_area == pytest.approx(np.pi * radius**2, rel=0.02)


@pytest.mark.slow
def test_opposite_tilts_mirror_the_image(wts):
    cover = make_cover(0.45, "linear-elastic")
    one, other = (press(cover, wts, BOX, load=1.0, pose=Pose.planar(tilt=(0.0, sign * 0.03))) for sign in (1, -1))
    assert wts.image(other.texel_forces) == pytest.approx(wts.image(one.texel_forces)[:, ::-1], abs=2e-3)
    assert find_moment(one)[0] > 1e-4 > -1e-4 > find_moment(other)[0]


@pytest.mark.slow
def test_a_narrow_contact_beside_the_axis_is_resolved(wts):
    found = press(make_cover(0.45, "linear-elastic"), wts, BOX, load=1.0, pose=Pose.planar(tilt=(0.0, np.radians(10))))
    assert max(found.error_estimate.values()) < 0.02
    assert find_moment(found)[0] > 2e-3


@pytest.mark.slow
def test_yaw_turns_the_tilted_indenter(wts):
    """Tilted about its own x axis by yaw 90 degrees, the lowered side of negative y points to positive x."""
    found = press(
        make_cover(0.45, "linear-elastic"), wts, BOX, load=1.0, pose=Pose.planar(yaw=np.pi / 2, tilt=(0.03, 0.0))
    )
    assert find_moment(found)[0] > 1e-4
    assert abs(find_moment(found)[1]) < 1e-6


@pytest.mark.slow
def test_a_small_tilt_is_nearly_none_and_a_ball_none(wts):
    with rough_cells():
        cover = make_cover(0.45, "linear-elastic")
        upright, tilted = (press(cover, wts, BOX, load=1.0, pose=Pose.planar(tilt=(tilt, 0.0))) for tilt in (0.0, 2e-5))
        assert tilted.texel_forces == pytest.approx(upright.texel_forces, abs=0.01 * upright.texel_forces.max())
        assert tilted.depth == pytest.approx(upright.depth, rel=0.015)
        ball = Sphere(radius=4e-3)
        assert (
            press(cover, wts, ball, load=0.5, pose=Pose.planar(tilt=(0.1, 0.1))).depth
            == press(cover, wts, ball, load=0.5).depth
        )


@pytest.mark.bench  # the slow tests have a box that is not tilted
@pytest.mark.slow
def test_finite_strain_at_a_small_load_tends_to_small_strain(wts):
    tilt = (0.0, 0.03)
    small, finite = (
        press(make_cover(0.45, model), wts, BOX, load=0.1, pose=Pose.planar(tilt=tilt))
        for model in ("linear-elastic", "neo-hookean")
    )
    assert finite.depth == pytest.approx(small.depth, rel=0.05)
    assert finite.texel_forces == pytest.approx(small.texel_forces, abs=0.05 * small.texel_forces.max())
