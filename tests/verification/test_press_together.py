"""Several indenters in one contact problem, against single ones and against statics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import point_spread, press
from fem_reference.grid_convergence import pool_errors, texel_convergence
from fem_reference.linear_response.point_spread import superpose
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


def test_results_are_extrapolated_from_two_grids_whose_changes_are_their_errors(bonded, wts):
    """The finer grid of a first solution is the coarser one of a second."""
    cover, texels = bonded(0.45), replace(wts, active=np.arange(wts.count) % 7 != 0)
    bodies = [
        Body(indenter=Box(size=(3e-3,) * 3), load=2.0, at=(0.5e-3, -2e-3), guided=False, centre=(0.2e-3, 0.1e-3)),
        Body(indenter=Sphere(radius=3e-3), load=1.2, at=(-1e-3, 2.7e-3)),
    ]
    coarse, fine = (press_together(cover, texels, bodies, cells=cells) for cells in ((1, 2), (2, 4)))
    spread = point_spread(cover)
    few, many = (superpose(each.contact, spread, texels, Pose()) for each in (coarse, fine))
    forces, change = 2 * many - few, np.abs(many - few)
    assert fine.texel_forces == pytest.approx(forces[:-1], abs=1e-9)
    assert fine.outside == pytest.approx(forces[-1])
    assert fine.texel_forces.sum() + fine.outside == pytest.approx(3.2, rel=1e-4)
    assert (fine.texel_forces[::7] == 0).all()
    peak = many[:-1].argmax()
    areas = [len(each.contact) * (cover.thickness / n) ** 2 for each, n in ((coarse, 2), (fine, 4))]
    assert (coarse.contact_area, fine.contact_area) == pytest.approx(areas)
    assert fine.error_estimate == pytest.approx(
        {
            "misplaced": change[:-1].sum() / 6.4,
            "peak_texel": change[peak] / many[peak],
            "contact_area": abs(areas[1] / areas[0] - 1),
            "depth": abs(fine.depths.max() / coarse.depths.max() - 1),
        }
    )
    # Thrice the change between the grids, pooled over the texels, and the error of the response of the base.
    bases = [superpose(fine.contact, each, texels, Pose()) for each in spread.on_grids]
    errors = 3 * change + texel_convergence(bases, spread.sizes)
    assert fine.texel_errors == pytest.approx(pool_errors(errors[:-1], forces[:-1]))
    assert fine.outside_error == pytest.approx(errors[-1])
    # Each body bears its own weight, at its own place.
    square = fine.contact[:, 1] < -0.5e-3
    for own, body in ((square, bodies[0]), (~square, bodies[1])):
        x, y, force = fine.contact[own].T
        assert force.sum() == pytest.approx(body.load)
        assert [force @ x / body.load, force @ y / body.load] == pytest.approx(body.weight_point, abs=1e-4)
    # The guided body does not tilt; the free one goes down on the side of its weight, and its depth is at its axis.
    assert (fine.slopes[1] == 0).all()
    assert (fine.slopes[0] > 0).all()
    assert (fine.depths > 0).all()


def test_loads_are_checked(bonded, wts):
    with pytest.raises(ValueError, match="positive load"):
        press_together(bonded(0.3), wts, [Body(indenter=SQUARE, load=0.0)])
