"""Indenters that rub on curved covers, or do not slip."""

import numpy as np
import pytest

from fem_reference import press
from meshes import Box, Cover, Layer, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad
from meshes.solids.covers import take_meshes
from tests.support.rotated_poses import rotated_pose
from tests.support.rubber import make_rubber

pytestmark = pytest.mark.slow

PAD = flat_pad(size=(8e-3, 8e-3), rows=2)
MESH = PAD.mesh(2e-3, layers=2)
DOWN = np.array([0.0, 0, -1])
ABOVE = Pose.facing([0.3e-3, 0.2e-3, 5e-3], DOWN)
BALL = Sphere(radius=5e-3)


def test_a_plate_on_a_pad_without_lateral_contraction_compresses_it_evenly():
    """Force E A d / h."""
    material = make_rubber(0.0)
    plate, force = Box(size=(12e-3, 12e-3, 2e-3)), material.youngs_modulus * 64e-6 * 0.1e-3 / 2e-3
    found = press(take_meshes([MESH], material), PAD.texels, plate, ABOVE, depth=0.1e-3, friction=np.inf)
    assert found.total_force == pytest.approx(force, rel=0.15)  # two layers of elements, contact up to the free sides
    assert found.assumptions["friction"] == "no slip"


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
    np.testing.assert_allclose(found.contact_forces.sum(axis=0), found.force, atol=1e-9 * found.total_force)


def test_a_thin_rubber_cover_is_stiffer_without_slip():
    """Twice and more under a face wider than the cover is thick: at most four times (thin incompressible layer)."""
    material, face = make_rubber(0.499), Box(size=(6e-3, 6e-3, 2e-3))
    loads = [
        press(take_meshes([MESH], material), PAD.texels, face, ABOVE, depth=0.05e-3, friction=friction).total_force
        for friction in (0.0, np.inf)
    ]
    assert 1.3 < loads[1] / loads[0] < 4


def test_friction_carries_a_part_of_the_shear_without_slip():
    """Forces in Coulomb's cone, and a total force between those without friction and without slip."""
    loads, material = [], make_rubber(0.3)
    for friction in (0.0, 0.1, np.inf):
        found = press(take_meshes([MESH], material), PAD.texels, BALL, ABOVE, depth=0.1e-3, friction=friction)
        loads.append(found.total_force)
        across = np.linalg.norm(found.contact_forces[:, :2], axis=1)
        assert (across <= friction * -found.contact_forces[:, 2] * (1 + 1e-3) + 1e-12).all()
    assert loads[0] < loads[1] < loads[2]


@pytest.mark.usefixtures("full_cells")
@pytest.mark.bench
def test_a_ball_on_a_wide_pad_rubs_as_on_a_flat_cover():
    """The compliance of the flat cover is that of waves, without a mesh of the cover."""
    pad, material, at = flat_pad(size=(14e-3, 14e-3), rows=2), make_rubber(0.0, "linear-elastic"), (0.3e-3, 0.2e-3)
    load, friction = 0.02, 0.2
    flat = Cover(layers=(Layer(thickness=2e-3, material=material),))
    pose = Pose.facing([*at, 5e-3], DOWN)
    ours = press(take_meshes(pad.meshes(1.4), material), pad.texels, BALL, pose, load=load, friction=friction)
    known = press(flat, pad.texels, BALL, Pose.planar(at=at), load=load, friction=friction)
    assert abs(ours.depth / known.depth - 1) < ours.error_estimate["depth"] + known.error_estimate["depth"] < 0.02
    # The free sides of the pad change texel forces by 0.5 % at a Poisson ratio of 0.49, without friction too.
    ours_smooth = press(take_meshes(pad.meshes(1.4), material), pad.texels, BALL, pose, load=load)
    smooth = press(flat, pad.texels, BALL, Pose.planar(at=at), load=load)
    effects = ours.texel_forces - ours_smooth.texel_forces, known.texel_forces - smooth.texel_forces
    peak = np.abs(effects[0] - effects[1]).max() / known.texel_forces.max()
    assert peak < ours.error_estimate["peak_texel"] + known.error_estimate["peak_texel"] < 0.03
    area = abs(ours.contact_area / known.contact_area - 1)
    assert area < ours.error_estimate["contact_area"] + known.error_estimate["contact_area"]
