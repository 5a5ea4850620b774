"""Several indenters in one contact problem, against single ones and against statics."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Box, Pose, Sphere

SQUARE = Box(size=(6e-3, 6e-3, 5e-3))


def misplaced(found, reference, load):
    return np.abs(found - reference).sum() / (2 * load)


@pytest.mark.slow
def test_one_body_is_what_press_finds(bonded, wts):
    cover, place = bonded(0.49), (0.7e-3, -1.1e-3)
    alone = press(cover, wts, SQUARE, load=2.0, pose=Pose.planar(at=place))
    found = press_together(cover, wts, [Body(indenter=SQUARE, load=2.0, at=place)])
    assert misplaced(found.texel_forces, alone.texel_forces, 2.0) < 1e-3
    assert found.depths[0] == pytest.approx(alone.depth, rel=0.05)  # its finest grid, not extrapolated
    assert found.texel_forces.sum() + found.outside == pytest.approx(2.0, rel=2e-5)


@pytest.mark.slow
def test_far_bodies_superpose_and_near_ones_sink_deeper(bonded, wts):
    cover = bonded(0.3)
    alone = press_together(cover, wts, [Body(indenter=SQUARE, load=2.0, at=(0.0, -9e-3))])
    both = [Body(indenter=SQUARE, load=load, at=(0.0, y)) for load, y in ((2.0, -9e-3), (1.0, 9e-3))]
    far = press_together(cover, wts, both)
    other = press_together(cover, wts, both[1:])
    assert misplaced(far.texel_forces, alone.texel_forces + other.texel_forces, 3.0) < 1e-3
    near = press_together(cover, wts, [Body(indenter=SQUARE, load=2.0, at=(0.0, y)) for y in (-3.1e-3, 3.1e-3)])
    assert near.depths[0] > 1.02 * far.depths[0]


def test_the_centre_of_pressure_of_a_tilting_body_is_under_its_weight(bonded, wts):
    body = Body(indenter=SQUARE, load=2.0, at=(0.3e-3, 0.4e-3), yaw=0.5, guided=False, centre=(0.8e-3, -0.2e-3))
    found = press_together(bonded(0.45), wts, [body])
    x, y, force = found.contact.T
    c, s = np.cos(0.5), np.sin(0.5)
    expected = np.array([0.3e-3 + 0.8e-3 * c + 0.2e-3 * s, 0.4e-3 + 0.8e-3 * s - 0.2e-3 * c])
    np.testing.assert_allclose([force @ x / 2.0, force @ y / 2.0], expected, atol=1e-8)
    # it sinks towards its weight
    assert found.slopes[0] @ (expected - [0.3e-3, 0.4e-3]) > 0
    upright = press_together(bonded(0.45), wts, [Body(indenter=SQUARE, load=2.0, at=body.at, yaw=0.5)])
    assert not upright.slopes.any()


@pytest.mark.slow
def test_a_ball_that_may_tilt_presses_like_a_guided_one(bonded, wts):
    """Tilting a ball about its centre of pressure changes nothing."""
    guided = press_together(bonded(0.3), wts, [Body(indenter=Sphere(radius=5e-3), load=1.0)])
    free = press_together(bonded(0.3), wts, [Body(indenter=Sphere(radius=5e-3), load=1.0, guided=False)])
    assert misplaced(free.texel_forces, guided.texel_forces, 1.0) < 1e-4


def test_loads_are_checked(bonded, wts):
    with pytest.raises(ValueError, match="positive load"):
        press_together(bonded(0.3), wts, [Body(indenter=SQUARE, load=0.0)])
