"""Presses on a curved cover by the fast model."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import meshes
from fastmodel.contact.points import find_first_contact, pose_indenter, press_points, solve_pressure
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.pressure.solvers import Load
from fastmodel.surface import CoverPoints
from meshes import Box, Sphere
from meshes.pose import Pose

SOFT = 1e-3  # compliance of one point of the foundation [m/N]


def dome(side=25):
    """A foundation of separate springs on the upper half of a ball of 10 mm, with one texel per quarter."""
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-7e-3, 7e-3, side)] * 2))
    normals = np.stack([x, y, np.sqrt(1e-4 - x**2 - y**2)], axis=1) / 10e-3
    quarter = (x >= 0).astype(int) + 2 * (y >= 0)
    return CoverPoints(
        points=10e-3 * normals,
        normals=normals,
        influence=(quarter == np.arange(4)[:, None]).astype(float),
        compliance=SOFT * np.eye(len(x)),
        thickness=2e-3,
    )


def press_down(force):
    up = np.array([0.0, 0, 1])
    return Load.along_free_directions(force * up, np.zeros(3), up[None], rotates=False)


def test_flat_face_on_separate_springs_follows_from_the_travel():
    cover = dome()
    found = press_points(cover, Box(size=(20e-3, 20e-3, 5e-3)), Pose.facing([0, 0, 0.1], [0, 0, -1]), load=2.0)
    up = cover.normals[:, 2]
    touched = found.forces > 0
    level = (cover.points - SOFT * found.forces[:, None] * cover.normals)[touched, 2]
    np.testing.assert_allclose(level, level[0], atol=1e-6 * 2e-3)
    assert found.forces @ up == pytest.approx(2.0, rel=1e-6)
    assert (cover.points[~touched, 2] <= level[0] + 1e-9).all()
    np.testing.assert_allclose(found.force, -found.forces @ cover.normals)


def test_how_high_a_shape_is_does_not_matter():
    """A plate less high than the depth passes the points that it presses down."""
    pose = Pose.facing([0, 0, 0.1], [0, 0, -1])
    low, high = (press_points(dome(), Box(size=(4e-3, 4e-3, height)), pose, load=20.0) for height in (0.2e-3, 9e-3))
    assert SOFT * high.forces.max() > 0.4e-3  # the depth, on separate springs
    np.testing.assert_allclose(low.forces, high.forces, atol=1e-9)


@pytest.mark.parametrize("direction", [(0, 0, -1.0), (-0.6, 0, -0.8), (0.36, -0.48, -0.8)])
def test_load_acts_along_the_direction(direction):
    found = press_points(dome(), Sphere(radius=4e-3), Pose.facing(-0.05 * np.array(direction), direction), load=0.7)
    assert found.force @ direction == pytest.approx(0.7, rel=1e-6)
    assert found.points == (found.forces > 0).sum() > 3


def test_mirrored_press_gives_mirrored_forces():
    cover = dome()
    right, left = (
        press_points(cover, Sphere(radius=4e-3), Pose.facing([s * 2e-3, 0, 0.1], [0, 0, -1]), load=0.5) for s in (1, -1)
    )
    np.testing.assert_allclose(right.texel_forces, left.texel_forces[[1, 0, 3, 2]], rtol=1e-3)


def test_two_bodies_each_carry_their_load():
    cover = dome(41)
    height = np.sqrt(1e-4 - 16e-6) + 0.5e-3
    poses = [Pose.facing([x, 0, height], [0, 0, -1]) for x in (-4e-3, 4e-3)]
    bodies = [pose_indenter(Sphere(radius=2e-3), pose) for pose in poses]
    found = solve_pressure(cover, bodies, [press_down(0.2), press_down(0.4)])
    assert found.settled
    up = found.forces * cover.normals[:, 2]
    assert up[cover.points[:, 0] < 0].sum() == pytest.approx(0.2, rel=1e-6)
    assert up[cover.points[:, 0] > 0].sum() == pytest.approx(0.4, rel=1e-6)


def test_restart_from_the_solution_changes_nothing():
    cover = dome()
    body = pose_indenter(Sphere(radius=6e-3), Pose.facing([1e-3, 0, 10e-3], [0, 0, -1]))
    cold = solve_pressure(cover, [body], [press_down(0.5)])
    warm = solve_pressure(cover, [body], [press_down(0.5)], cold.forces)
    np.testing.assert_allclose(warm.forces, cold.forces, atol=1e-6)


@pytest.mark.parametrize(
    ("radius", "at", "load", "error", "message"),
    [
        (1e-3, (0.1, 0.0), 1.0, MissedArrayError, "never touches"),
        (5e-5, (0.29e-3, 0.29e-3), 1e-3, FastModelError, r"fits between the points .* 0\.5[0-9]* mm apart"),
        (5e-5, (5.54e-3, 0.3e-3), 1e-3, FastModelError, r"fits between the points .* 0\.5[0-9]* mm apart"),
        (1e-3, (0.0, 0.0), -1.0, FastModelError, "load must be positive"),
    ],
)
def test_bad_presses_are_named(radius, at, load, error, message):
    with pytest.raises(error, match=message):
        press_points(dome(), Sphere(radius=radius), Pose.facing([*at, 0.1], [0, 0, -1]), load=load)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"thickness": 0.0}, "thickness must be positive"),
        ({"compliance": np.triu(np.ones((625, 625)))}, "symmetric"),
        ({"compliance": np.zeros((625, 625))}, "positive diagonal"),
        ({"normals": 2 * dome().normals}, "unit vectors"),
        ({"points": np.full((625, 3), np.nan)}, "not finite"),
        ({"influence": np.ones((4, 3))}, "influence"),
        ({"compliance": np.eye(3)}, "compliance"),
    ],
)
def test_bad_covers_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(dome(), **change)


def test_cover_belongs_to_an_array():
    dome().check(meshes.TexelArray.grid(2, 2, 5e-3))
    with pytest.raises(FastModelError, match="4 texels; the array has 6"):
        dome().check(meshes.TexelArray.grid(2, 3, 5e-3))


@pytest.mark.parametrize("length", [0.5, 3.0])
def test_the_length_of_the_direction_does_not_change_what_is_touched_first(length):
    cover, direction = dome(), np.array([0.36, -0.48, -0.8])
    pose = Pose.facing(-0.05 * direction, direction)
    found = [
        find_first_contact(cover, Sphere(radius=4e-3), pose, each, within=1e-3)
        for each in (direction, length * direction)
    ]
    np.testing.assert_array_equal(*found)
    away = np.linalg.norm(np.cross(cover.points, direction), axis=1)
    assert 3 < len(found[0]) < len(cover.points) / 4
    assert away[found[0]].max() < 5e-3
