from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fem_reference import press
from fem_reference.curved_cover.rays import find_touch
from fem_reference.curved_cover.responses import find_top
from fem_reference.errors import PiercedError, UnsupportedError
from meshes import Box, Cover, Layer, Material, Sphere
from meshes.pose import Pose
from meshes.solids import fingertip, flat_pad, phalanx
from meshes.solids.covers import take_meshes
from tests.support.rotated_poses import rotated_pose

NEO = Material(name="neo", model="neo-hookean", parameters={"shear_modulus": 3e5}, poisson_ratio=0.49)
RUBBER = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.45)
COVER = phalanx(length=8e-3, rows=2, columns=3)
MESH = COVER.mesh(2e-3, layers=2)
SOLID = take_meshes([MESH], RUBBER)
BALL = Sphere(radius=5e-3)


def at_angle(angle, y=0.0, distance=2e-2):
    """Pose beside the phalanx that looks at its axis."""
    out = np.array([np.sin(angle), 0, np.cos(angle)])
    return Pose.facing(distance * out + [0, y, 0], -out)


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_a_ball_touches_a_cylinder_where_their_surfaces_meet(angle):
    mesh = COVER.mesh()
    top = find_top(mesh)
    pose = at_angle(angle, y=1e-3)
    assert find_touch(top, BALL, pose) == pytest.approx(12e-3, abs=2e-6)
    beside = Pose.facing([0, 20e-3, 20e-3], [0, 0, -1])
    assert find_touch(top, BALL, beside) == np.inf


@pytest.mark.slow
def test_load_and_depth_control_agree_and_the_base_bears_the_load(full_cells):
    pose = at_angle(0.3, y=0.5e-3)
    loaded = press(SOLID, COVER.texels, BALL, pose, load=0.5)
    driven = press(SOLID, COVER.texels, BALL, pose, depth=loaded.depth)
    assert loaded.total_force == pytest.approx(0.5, rel=1e-6)
    assert driven.total_force == pytest.approx(0.5, rel=1e-5)
    assert -loaded.force @ pose.rotation[:, 2] == pytest.approx(0.5, rel=1e-6)
    np.testing.assert_allclose(loaded.base_force, loaded.force, atol=1e-9)
    np.testing.assert_allclose(loaded.base_moment, loaded.moment, atol=1e-11)
    total = loaded.unmeasured - loaded.texel_forces @ COVER.texels.normals
    np.testing.assert_allclose(total, loaded.base_force, atol=1e-12)
    assert np.isnan(loaded.error_estimate["depth"])


@pytest.mark.slow
def test_mirrored_presses_without_slip_give_mirrored_forces():
    one, other = (
        press(SOLID, COVER.texels, BALL, at_angle(angle, y=0.3e-3), load=0.4, friction=np.inf)
        for angle in (0.35, -0.35)
    )
    np.testing.assert_allclose(
        COVER.texels.image(one.texel_forces)[:, ::-1], COVER.texels.image(other.texel_forces), atol=4e-7
    )
    assert one.texel_forces.argmax() % 3 == 2
    assert one.total_force == pytest.approx(0.4, rel=1e-6)


@pytest.mark.slow
def test_an_oblique_motion_presses_with_the_same_face():
    pose = at_angle(0.0, distance=13e-3)
    straight = press(SOLID, COVER.texels, BALL, pose, depth=0.2e-3)
    turned = rotated_pose(pose.point, pose.rotation, (0.6, 0, -0.8))
    np.testing.assert_allclose(turned.rotation, pose.rotation, atol=1e-12)
    oblique = press(SOLID, COVER.texels, BALL, turned, depth=0.2e-3)
    assert oblique.total_force == pytest.approx(oblique.force @ [0.6, 0, -0.8])
    assert oblique.total_force < straight.total_force
    # Without friction the force is normal to the cover: towards its axis, where the oblique path meets the cylinder.
    shift = np.polynomial.Polynomial([(21e-3 - 3e-3) ** 2 - 13e-3**2, -2 * 0.8 * 18e-3, 1.0]).roots().min() * 0.6
    np.testing.assert_allclose(oblique.force[0] / oblique.force[2], shift / np.sqrt(13e-3**2 - shift**2), rtol=0.2)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({}, ValueError, "either a load or a depth"),
        ({"load": 1.0, "depth": 1e-4}, ValueError, "either a load or a depth"),
        ({"load": -1.0}, ValueError, "load must be positive"),
        pytest.param({"depth": 1.9e-3}, PiercedError, "most of the cover", marks=pytest.mark.slow),
        pytest.param({"load": 1e4}, PiercedError, "most of the cover", marks=pytest.mark.slow),
        ({"load": 1.0, "accuracy": 0.001}, UnsupportedError, "no mesh reaches it"),
        ({"load": 1.0, "pose": Pose(point=(0, 0, 2e-2), direction=(0, 0, 1))}, ValueError, "never touches"),
        ({"load": 1.0, "friction": np.inf, "strain": "finite"}, UnsupportedError, "at small strain only"),
        ({"load": 1.0, "strain": "large"}, ValueError, "strains are small or finite, not 'large'"),
        (
            {"load": 1.0, "strain": "finite", "pose": Pose(point=(0, 0, 12e-3), tilt=(0.1, 0.0))},
            UnsupportedError,
            "along its own axis",
        ),
    ],
)
def test_impossible_presses_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        press(SOLID, COVER.texels, BALL, **{"pose": at_angle(0.0)} | options)


@pytest.mark.slow
def test_a_box_smaller_than_a_facet_finds_its_force():
    found = press(SOLID, COVER.texels, Box(size=(0.5e-3, 0.5e-3, 4e-3)), at_angle(0.0), load=0.1)
    assert found.total_force == pytest.approx(0.1)
    np.testing.assert_allclose(found.base_force, found.force, atol=1e-9)


def test_an_indenter_that_fits_between_the_points_of_the_mesh_is_told_so():
    for angle in (0.013, 0.21):
        with pytest.raises(ValueError, match=r"too small for this mesh.* [12]\.?\d* mm wide"):
            press(SOLID, COVER.texels, Sphere(radius=1e-5), at_angle(angle, y=0.3e-3), load=1e-3)
    with pytest.raises(ValueError, match="never touches"):
        press(SOLID, COVER.texels, Sphere(radius=1e-5), at_angle(0.0, y=7e-3), load=1e-3)


@pytest.mark.slow
def test_a_tilted_box_may_start_inside_a_flat_pad():
    """Its edge lies below the point that it is placed at; a pad, unlike a curved cover, has no height to spare."""
    pad = flat_pad(size=(8e-3, 8e-3), rows=2)
    solid = take_meshes([pad.mesh(1.5e-3, layers=2)], RUBBER)
    box, above = Box(size=(3e-3, 4e-3, 3e-3)), Pose(point=(0, 0, 2e-3), tilt=(0.0, np.pi / 4))
    inside, free = (
        press(solid, pad.texels, box, dataclasses.replace(above, point=(0, 0, z)), load=0.05) for z in (2e-3, 6e-3)
    )
    assert inside.depth == pytest.approx(free.depth, rel=1e-6)
    behind = dataclasses.replace(above, point=(0, 0, -20e-3))
    with pytest.raises(ValueError, match=r"never touches|passes between"):
        press(solid, pad.texels, box, behind, load=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.2e-3, 1e-3])
def test_how_high_a_shape_is_does_not_matter(height):
    """A plate less high than the largest depth passes points on its way to it, one of 0.2 mm those that it presses."""
    low, high = (
        press(SOLID, COVER.texels, Box(size=(4e-3, 4e-3, each)), at_angle(0.0), depth=0.4e-3) for each in (height, 9e-3)
    )
    assert low.total_force == pytest.approx(high.total_force, rel=1e-9)
    np.testing.assert_allclose(low.texel_forces, high.texel_forces, atol=1e-9 * high.total_force)


@pytest.mark.slow
def test_a_deep_press_warns():
    found = press(SOLID, COVER.texels, BALL, at_angle(0.0), depth=0.5e-3)
    assert "strains are not small" in found.warnings[0]


@pytest.mark.slow
def test_a_finer_mesh_is_added_for_an_accuracy_and_what_is_missed_is_stated():
    meshes = [MESH, COVER.mesh(1.7e-3, layers=2)]
    finer = COVER.mesh(1.4e-3, layers=2)
    cover = dataclasses.replace(take_meshes(meshes, RUBBER), refine=lambda _: finer)
    usual, refined = (press(cover, COVER.texels, BALL, at_angle(0.0), load=0.4, accuracy=each) for each in (0.9, 0.008))
    assert usual.mesh is meshes[-1]
    assert refined.mesh is finer
    assert "0.8 % wanted, but the feasible grids reach" in refined.warnings[-1]
    assert not any("wanted" in each for each in usual.warnings)


@pytest.mark.parametrize("load", [pytest.param(2e-3, marks=pytest.mark.slow), 1e-5])
def test_a_contact_narrower_than_the_elements_follows_hertz(load):
    """A contact far narrower than the cover is thick is that of a half space under a cylinder (Johnson 1985, 4.2)."""
    found = press(SOLID, COVER.texels, Sphere(radius=0.5e-3), at_angle(0.0), load=load)
    modulus = 1e6 / (1 - 0.45**2)
    # Equal radii of curvature of ball and cover along and across the cylinder to 6 %: their geometric mean.
    curvature = np.sqrt((1 / 0.5e-3) * (1 / 0.5e-3 + 1 / 8e-3))
    radius = (3 * load / (4 * modulus * curvature)) ** (1 / 3)
    hertz = radius**2 * curvature
    assert found.depth == pytest.approx(hertz * (1 - 0.9 * radius / 2e-3), rel=0.03)
    assert found.contact_area == pytest.approx(np.pi * radius**2, rel=0.06)


@pytest.mark.slow
@pytest.mark.usefixtures("full_cells")
@pytest.mark.parametrize(
    ("indenter", "material", "pad", "options", "limits"),
    [
        (BALL, RUBBER, (14e-3, 1e-3, 0.0), {"load": 0.3}, (0.01, 1.0)),
        (BALL, NEO, (10e-3, 0.0, 0.0), {"load": 2.0, "strain": "finite"}, (0.03, 0.03)),
        # `test_no_slip.py` has a ball that rubs
        pytest.param(
            Box(size=(3e-3, 3e-3, 2e-3)),
            RUBBER,
            (10e-3, 0.4e-3, 0.3e-3),
            {"load": 0.3, "friction": np.inf},
            (0.03, 0.08),
            marks=pytest.mark.bench,
        ),
    ],
    ids=["ball", "ball at finite strain", "box without slip"],
)
def test_a_flat_pad_agrees_with_the_planar_solution(indenter, material, pad, options, limits):
    """Of pads of some width under an indenter at some place, texel forces over the largest one and depths agree."""
    width, *at = pad
    cover = flat_pad(size=(width, width), rows=round(width / 5e-3))
    pose = Pose.facing([*at, 5e-3], [0, 0, -1])
    ours = press(take_meshes(cover.meshes(1.5), material), cover.texels, indenter, pose, **options)
    planar = Cover(layers=(Layer(thickness=2e-3, material=material),), size=(width, width))
    known = press(planar, cover.texels, indenter, Pose.planar(at=at), **(options | {"strain": None}))
    differences = {
        "peak_texel": np.abs(ours.texel_forces - known.texel_forces).max() / known.texel_forces.max(),
        "depth": abs(ours.depth / known.depth - 1),
    }
    for (name, difference), limit in zip(differences.items(), limits, strict=True):
        theirs = 0.0 if "friction" in options else known.error_estimate[name]
        assert difference < min(limit, ours.error_estimate[name] + theirs)


@pytest.mark.slow
@pytest.mark.parametrize("where", ["middle", "edge", "pole", "oblique"])
def test_force_and_moment_balance_on_the_fingertip(where):
    cover = fingertip()
    position, direction = {
        "middle": ([0, -7e-3, 2e-2], [0, 0, -1]),
        "edge": ([2e-2, -13e-3, 2e-3], [-1, 0, 0]),
        "pole": ([0, 2e-2, 1e-3], [0, -1, 0]),
        "oblique": ([1e-2, 1e-2, 1.5e-2], [-1, -1, -1.5]),
    }[where]
    found = press(
        take_meshes([cover.mesh(1.6e-3, layers=2)], RUBBER),
        cover.texels,
        BALL,
        Pose.facing(position, direction),
        load=0.5,
    )
    size = np.linalg.norm(found.force)
    np.testing.assert_allclose(found.base_force, found.force, atol=2e-3 * size)
    np.testing.assert_allclose(found.base_moment, found.moment, atol=2e-3 * size * 8e-3)
    assert np.linalg.norm(found.unmeasured) < size
