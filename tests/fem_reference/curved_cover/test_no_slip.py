"""Indenters that do not slip on curved covers."""

import numpy as np
import pytest

from fem_reference import press
from fem_reference.curved_cover.contact import STEPS, StickingPress
from fem_reference.curved_cover.press import build_compliance
from fem_reference.curved_cover.pressure_shapes import GapSampler
from fem_reference.curved_cover.rays import find_touch
from meshes import Box, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad
from meshes.solids.covers import take_meshes
from tests.support.rotated_poses import rotated_pose
from tests.support.rubber import make_rubber

PAD = flat_pad(size=(8e-3, 8e-3), rows=2)
MESH = PAD.mesh(1.6e-3, layers=2)
DOWN = np.array([0.0, 0, -1])
ABOVE = Pose.facing([0.3e-3, 0.2e-3, 5e-3], DOWN)
BALL, BOX = Sphere(radius=5e-3), Box(size=(3e-3, 3e-3, 2e-3))


def begin(indenter, material, direction=DOWN):
    """The path of an indenter on the pad, and its sampler."""
    compliance = build_compliance(MESH, material, vectors=True)
    pose = rotated_pose(ABOVE.point, ABOVE.rotation, direction)
    touch = find_touch(compliance.top, indenter, pose)
    sampler = GapSampler(compliance.top, indenter, pose, touch + 1e-3, 1e-3)
    return StickingPress(compliance, sampler, direction, touch, 1e-3), sampler


def test_a_plate_on_a_pad_without_lateral_contraction_compresses_it_evenly():
    """Force E A d / h, and no shear."""
    material = make_rubber(0.0)
    plate, force = Box(size=(12e-3, 12e-3, 2e-3)), material.youngs_modulus * 64e-6 * 0.1e-3 / 2e-3
    contact = begin(plate, material)[0].to(0.1e-3, "depth")
    assert contact.load == pytest.approx(force, rel=1e-5)
    assert np.abs(contact.shear).max() < 1e-5 * force
    found = press(take_meshes([MESH], material), PAD.texels, plate, ABOVE, depth=0.1e-3, friction=np.inf)
    assert found.total_force == pytest.approx(force, rel=0.15)  # two layers of elements, contact up to the free sides
    assert found.assumptions["friction"] == "no slip"


@pytest.mark.parametrize("direction", [DOWN, np.array([0.6, 0, -0.8])])
def test_hats_below_a_face_move_with_it(direction):
    path, sampler = begin(BOX, make_rubber(0.45), direction)
    contact = path.to(0.1e-3, "depth")
    compliance = build_compliance(MESH, make_rubber(0.45))
    nodal = np.zeros_like(compliance.solid.nodes)
    nodal[compliance.top.index] = contact.nodal
    moved = compliance.solid.solve_fully(nodal)[0][compliance.top.index]
    gaps, held = sampler.at(contact.travel), contact.forces > 0
    whole = held & ~gaps.is_cut  # others may slide
    assert whole.sum() >= 4
    mean = (gaps.spread.T @ moved)[whole]
    np.testing.assert_allclose(mean, np.tile(0.1e-3 * direction, (whole.sum(), 1)), atol=1e-4 * 0.1e-3)
    assert np.abs(contact.shear[~held]).max() == 0
    assert contact.load == pytest.approx((contact.nodal @ direction).sum())


def test_an_oblique_motion_drags_the_cover_along_and_the_base_bears_it():
    direction = np.array([0.6, 0, -0.8])
    material = make_rubber(0.45)
    pose = rotated_pose(ABOVE.point, ABOVE.rotation, direction)
    found, smooth = (
        press(take_meshes([MESH], material), PAD.texels, BALL, pose, depth=0.2e-3, friction=friction)
        for friction in (np.inf, 0.0)
    )
    assert found.force[0] > 0.2 * np.linalg.norm(found.force)
    assert abs(smooth.force[0]) < 0.01 * np.linalg.norm(smooth.force)
    np.testing.assert_allclose(found.base_force, found.force, atol=1e-9 * found.total_force)
    np.testing.assert_allclose(found.base_moment, found.moment, atol=1e-9 * found.total_force * 8e-3)


def test_a_thin_rubber_cover_is_stiffer_without_slip():
    """Twice and more under a face wider than the cover is thick: at most four times (thin incompressible layer)."""
    material, face = make_rubber(0.499), Box(size=(6e-3, 6e-3, 2e-3))
    loads = [
        press(take_meshes([MESH], material), PAD.texels, face, ABOVE, depth=0.05e-3, friction=friction).total_force
        for friction in (0.0, np.inf)
    ]
    assert 1.3 < loads[1] / loads[0] < 4


def test_half_the_steps_differ_by_more_than_many_more():
    path, _ = begin(BALL, make_rubber(0.0))
    exact, fine, rough = (path.to(0.3e-3, "depth", steps) for steps in (3 * STEPS, STEPS, STEPS // 2))
    assert abs(fine.load / exact.load - 1) < abs(fine.load / rough.load - 1) < 0.01
