"""Pressing covers with free side edges: exact states, the wide cover, symmetry, and finite against small strain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import press, press_path
from fem_reference.indentation import layered
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact.free_edges import SideEdges, find_mirror_planes
from fem_reference.small_strain_contact.frictionless import bound_contact, solve_contact
from meshes import Box, Cover, Layer, Material, Prism, Sphere, TexelArray
from meshes.pose import Pose
from tests.support.coarse_cells import rough_cells
from tests.support.rubber import make_cover

PAD, THICKNESS = (8e-3, 6e-3), 4e-3
BALL = Sphere(radius=4e-3)
PLATE = Box(size=(12e-3, 12e-3, 5e-3))


def pad(bonded, nu=0.45, size=PAD):
    """Thick beside its size, so that few elements do."""
    return bonded(nu, thickness=THICKNESS, size=size)


def sides(cover, indenter, *, at=(0.0, 0.0), yaw=0.0, half=None):
    size = indenter.footprint if half is None else (half, half)
    return SideEdges(cover=cover, indenter=indenter, pose=Pose.planar(at=at, yaw=yaw), half=np.array(size))


def pressed(cover, indenter, *, cells=40, load=1.0, **where):
    surface = surface_compliance(replace(cover, size=None), 40e-3)
    return solve_contact(surface, indenter, cells=cells, load=load, sides=sides(cover, indenter, **where))


@pytest.mark.slow
def test_plate_wider_than_a_pad_without_lateral_strain_squeezes_it_evenly(bonded):
    """Poisson ratio 0: the bonded base does not matter, the stress is even, depth = F h / E A exactly."""
    cover = pad(bonded, 0.0)
    patch = pressed(cover, PLATE, cells=48)
    assert patch.depth == pytest.approx(THICKNESS / (1e6 * PAD[0] * PAD[1]), rel=4e-3)
    assert patch.area == pytest.approx(PAD[0] * PAD[1], rel=1e-3)
    # an even pressure moves the middle of the top by exactly that
    inner = np.hypot(patch.x, patch.y) < 1e-3
    assert patch.force[inner] / np.prod(patch.cell) == pytest.approx(1 / (PAD[0] * PAD[1]), rel=0.02)


@pytest.mark.slow
def test_the_flexibility_that_sides_add_is_positive(bonded):
    """What the sides add is a symmetric, positive semidefinite flexibility for every parity."""
    _, _, table = sides(pad(bonded), BALL, at=(2e-3, 0.0), half=1e-3)._difference
    assert len(table) == 2
    for each in table:
        values = np.linalg.eigvalsh(each)
        assert values[0] > -1e-6 * values[-1]
        assert values[-1] > 0


@pytest.mark.slow
def test_sides_add_displacement_near_the_load_and_reciprocally(bonded):
    """A load near one side moves the top there, not near the opposite side; what it does is reciprocal."""
    edges = sides(pad(bonded), BALL, at=(1e-5, 0.0), half=3.2e-3)
    x, y = np.array([-3e-3, 3e-3, 1e-3]), np.array([0.0, 0.0, 0.0])
    moved = np.array([edges.add_compliance(x, y)(force) for force in np.eye(3)])
    assert moved == pytest.approx(moved.T, rel=1e-6)
    assert moved[0, 0] == pytest.approx(moved[1, 1], rel=0.15)
    assert abs(moved[0, 1]) < 0.2 * moved[0, 0]


@pytest.mark.slow
def test_softer_near_a_side(bonded):
    cover, places = pad(bonded), ((0.0, 0.0), (3.5e-3, 0.0))
    middle, side = (pressed(cover, BALL, at=at, half=1.5e-3, load=0.5, cells=24).depth for at in places)
    wide = solve_contact(surface_compliance(replace(cover, size=None), 40e-3), BALL, cells=24, load=0.5).depth
    assert wide < middle < 1.1 * wide
    assert 1.1 * middle < side < 2 * middle


def test_far_sides_change_nothing(bonded):
    cover = bonded(0.49, size=(60e-3, 60e-3))
    wide = solve_contact(surface_compliance(replace(cover, size=None), 40e-3), BALL, cells=40, load=1.0)
    far = pressed(cover, BALL, at=(3e-3, -2e-3), half=bound_contact(BALL, cover.thickness)[0])
    assert far.depth == wide.depth
    assert np.array_equal(far.force, wide.force)


@pytest.mark.slow
def test_mirrored_pose_mirrors_the_contact(bonded):
    here, there = (pressed(pad(bonded), BALL, at=(x, 0.0), half=1.2e-3, load=0.3, cells=16) for x in (3e-3, -3e-3))
    assert there.depth == pytest.approx(here.depth, rel=1e-9)
    order, mirrored_order = np.lexsort((here.y, here.x)), np.lexsort((there.y, -there.x))
    assert there.force[mirrored_order] == pytest.approx(here.force[order], abs=1e-7 * 0.3)


@pytest.mark.slow
def test_mirrored_pose_mirrors_the_texel_forces(bonded):
    array = TexelArray.grid(2, 3, 2.5e-3)
    with rough_cells():
        here, there = (
            press(pad(bonded), array, BALL, load=0.5, pose=Pose.planar(at=(x, 0.0))) for x in (2.9e-3, -2.9e-3)
        )
    assert array.image(there.texel_forces)[:, ::-1] == pytest.approx(array.image(here.texel_forces), abs=1e-7)


@pytest.mark.slow
def test_quarter_turned_shape_on_a_quarter_turned_cover_presses_alike(bonded):
    bar = Box(size=(3e-3, 2e-3, 5e-3))
    one = pressed(pad(bonded), bar, at=(1e-3, 0.0))
    other = pressed(pad(bonded, size=PAD[::-1]), bar, at=(0.0, 1e-3), yaw=np.pi / 2)
    assert other.depth == pytest.approx(one.depth, rel=1e-6)


def test_symmetry_is_seen_in_the_pose():
    bar = Box(size=(6e-3, 2e-3, 5e-3))
    assert find_mirror_planes(bar, Pose()) == (True, True)
    assert find_mirror_planes(bar, Pose.planar(at=(1e-3, 0.0), yaw=np.pi / 2)) == (False, True)
    assert find_mirror_planes(bar, Pose.planar(yaw=0.3)) == (False, False)
    arrow = Prism(points=((0.0, 6e-3), (-5e-3, -4e-3), (5e-3, -4e-3)))
    for turns, expected in enumerate([(True, False), (False, True), (True, False), (False, True)]):
        assert find_mirror_planes(arrow, Pose.planar(yaw=turns * np.pi / 2)) == expected


def test_pose_there_and_back():
    pose = Pose.planar(at=(1e-3, -2e-3), yaw=0.7)
    x, y = np.random.default_rng(0).normal(size=(2, 50))
    assert np.stack(pose.to_indenter(*pose.to_array(x, y))) == pytest.approx(np.stack([x, y]))


def soft(base="bonded"):
    material = Material(name="soft", model="neo-hookean", parameters={"shear_modulus": 1e6 / 2.9}, poisson_ratio=0.45)
    return Cover(layers=(Layer(thickness=THICKNESS, material=material),), size=PAD, base=base)


@pytest.mark.slow
def test_forces_balance_and_a_large_cover_is_a_wide_one(bonded):
    array = TexelArray.grid(2, 3, 3.4e-3)
    wide = press(bonded(0.45), array, BALL, load=1.0, pose=Pose.planar(at=(1e-3, 0.0)))
    large = press(bonded(0.45, size=(30e-3, 30e-3)), array, BALL, load=1.0, pose=Pose.planar(at=(1e-3, 0.0)))
    assert np.abs(large.texel_forces - wide.texel_forces).max() < 2e-3
    assert large.depth == pytest.approx(wide.depth, rel=1e-3)
    covered = press(bonded(0.45, size=(10.2e-3, 6.8e-3)), array, BALL, load=1.0, pose=Pose.planar(at=(1e-3, 0.0)))
    assert covered.texel_forces.sum() == pytest.approx(1.0, rel=1e-6)
    assert covered.outside == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.bench  # the slow tests have the sum of both effects against both at once, near a side
@pytest.mark.parametrize("at", [(0.0, 0.0), (3.2e-3, 0.0)])
def test_finite_strain_meets_small_strain_at_small_load(bonded, at):
    """Two discretisations: compliance with side edges on cells, and elements with a contact search of their own."""
    array = TexelArray.grid(2, 2, 3.4e-3)
    small = press(pad(bonded), array, BALL, load=2e-3, pose=Pose.planar(at=at))
    finite = press(soft(), array, BALL, load=2e-3, pose=Pose.planar(at=at))
    assert finite.depth == pytest.approx(small.depth, rel=2e-2)
    assert np.abs(finite.texel_forces - small.texel_forces).max() < 4e-3 * 2e-3


@pytest.mark.slow
def test_a_pad_held_on_both_faces_is_two_pads_of_half_the_height(bonded):
    """No slip under a plate that covers all: the middle plane is one of symmetry, as under a smooth plate."""
    array = TexelArray.grid(2, 2, 2.5e-3)
    half = bonded(0.45, thickness=THICKNESS / 2, size=PAD)
    held, smooth, two = (
        press(cover, array, PLATE, depth=0.01 * cover.thickness, friction=friction)
        for cover, friction in ((pad(bonded), np.inf), (pad(bonded), 0.0), (half, 0.0))
    )
    assert held.total_force == pytest.approx(two.total_force, rel=5e-3)
    assert held.texel_forces == pytest.approx(two.texel_forces, rel=0.02)
    assert held.total_force > 1.15 * smooth.total_force
    rubbing = press(pad(bonded), array, PLATE, depth=0.01 * THICKNESS, friction=0.3)
    assert smooth.total_force < rubbing.total_force < held.total_force
    assert rubbing.assumptions["friction"] == "Coulomb, coefficient 0.3"


@pytest.mark.slow
@pytest.mark.bench
def test_sides_far_from_a_ball_on_rubber_are_left_out(monkeypatch):
    """A ball 0.3 of the thickness deep: the wide cover has the force and the texels of the pad in three dimensions."""
    request = {"cover": make_cover(0.45, size=(24e-3, 24e-3)), "array": TexelArray.grid(6, 6, 2e-3), "depth": 0.6e-3}
    wide = press(**request, indenter=BALL)
    assert "too far" in wide.assumptions["sides"]
    finer = press(**request, indenter=BALL, accuracy=0.01)  # grids are added as on a wide cover
    assert max(finer.error_estimate.values()) < max(wide.error_estimate.values())
    monkeypatch.setattr(layered, "_FAR_SIDES", {"bonded": np.inf})
    solid = press(**request, indenter=BALL)
    assert "free" in solid.assumptions["sides"]
    assert wide.total_force == pytest.approx(solid.total_force, rel=1e-3)
    assert wide.texel_forces == pytest.approx(solid.texel_forces, abs=1e-3 * solid.texel_forces.max())
    assert wide.error_estimate["contact_area"] < 0.3 * solid.error_estimate["contact_area"]


@pytest.mark.slow
@pytest.mark.bench
def test_sides_and_finite_strain_superposed_agree_with_both_at_once():
    """A ball near a side: what the two effects change together is inside the stated errors."""
    cover, array = make_cover(0.49, size=(16e-3, 12e-3)), TexelArray.grid(3, 4, 3.4e-3)
    added, solid = (
        press_path(cover, array, Sphere(radius=4e-3), Pose.planar((6.5e-3, 0.0)), loads=[3.0], superposed=superposed)[0]
        for superposed in (True, False)
    )
    assert "added" in added.assumptions["sides"]
    assert "free" in solid.assumptions["sides"]
    stated = {name: added.error_estimate[name] + solid.error_estimate[name] for name in ("depth", "peak_texel")}
    assert added.depth == pytest.approx(solid.depth, rel=stated["depth"])
    assert added.texel_forces.max() == pytest.approx(solid.texel_forces.max(), rel=stated["peak_texel"])
    apart = np.append(added.texel_forces - solid.texel_forces, added.outside - solid.outside)
    assert np.abs(apart).sum() / 2 / 3.0 < 5e-3
