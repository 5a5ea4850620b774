"""Presses on a curved cover by the fast model."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import meshes
from fastmodel.contact.points import find_first_contact, pose_indenter, press_points, solve_pressure
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.pressure.solvers import Load
from meshes import Box, LetterH, Sphere
from meshes.pose import Pose
from tests.support.cover_data import make_dome

MODULUS = 1e6  # of contact, E / (1 - nu^2) [Pa]
RADIUS = 10e-3  # of the dome [m]


def dome(side=25):
    return make_dome(side, 7e-3, contact_modulus=MODULUS)


def press_down(force):
    up = np.array([0.0, 0, 1])
    return Load.along_free_directions(force * up, np.zeros(3), up[None], rotates=False)


def hertz(radius, load):
    """Contact radius and approach of a rigid ball on the dome, for small contacts (Johnson 1985, section 4.2)."""
    both = 1 / (1 / RADIUS + 1 / radius)
    touching = np.cbrt(3 * load * both / (4 * MODULUS))
    return touching, touching**2 / both


@pytest.mark.parametrize(("radius", "load"), [(4e-3, 0.01), (4e-3, 0.1), (0.5e-3, 1e-3), (5e-5, 1e-6), (1.0, 0.05)])
@pytest.mark.parametrize("at", [(0.0, 0.0), (0.9e-3, 0.4e-3), (0.31e-3, -1.33e-3)])
def test_balls_obey_hertz_wherever_they_lie_between_the_points(radius, load, at):
    normal = np.array([*at, np.sqrt(RADIUS**2 - at[0] ** 2 - at[1] ** 2)]) / RADIUS
    found = press_points(dome(), Sphere(radius=radius), Pose.facing(0.1 * normal, -normal), load=load)
    touching, approach = hertz(radius, load)
    pressed = found.pressure.forces > 0
    assert found.depth == pytest.approx(approach, rel=0.02)
    away = np.linalg.norm(found.pressure.place - RADIUS * normal, axis=1)
    assert away[pressed].max() == pytest.approx(touching, rel=0.12)  # to a cell
    assert np.average(away**2, weights=found.pressure.forces) == pytest.approx(0.4 * touching**2, rel=0.03)
    np.testing.assert_allclose(found.force, -load * normal, atol=2e-2 * load)


def test_flat_face_touches_up_to_one_height():
    found = press_points(dome(), Box(size=(20e-3, 20e-3, 5e-3)), Pose.facing([0, 0, 0.1], [0, 0, -1]), load=0.1)
    touching, approach = hertz(np.inf, 0.1)
    assert found.depth == pytest.approx(approach, rel=0.02)
    away = np.linalg.norm(found.pressure.place[:, :2], axis=1)
    assert away[found.pressure.forces > 0].max() == pytest.approx(touching, rel=0.1)
    np.testing.assert_allclose(found.force, -found.pressure.forces @ found.pressure.normal)


@pytest.mark.parametrize("tilt", [0.15, 0.3])
def test_an_edge_presses_as_its_mirror_image(tilt):
    """The edge of a tilted box lies between the points, and is turned about the vertical axis."""
    shape, found = Box(size=(3e-3, 3e-3, 6e-3)), []
    for sign in (1, -1):
        pose = Pose(point=(0.3e-3 * sign, 0.2e-3, 30e-3), yaw=0.3 * sign, tilt=(0.0, tilt * sign))
        found.append(press_points(dome(), shape, pose, load=0.2))
    one, other = found
    np.testing.assert_allclose(one.texel_forces, other.texel_forces[[1, 0, 3, 2]], atol=5e-3)
    assert one.depth == pytest.approx(other.depth, rel=1e-2)


def test_how_high_a_shape_is_does_not_matter():
    """A plate less high than the depth passes the points that it presses down."""
    pose = Pose.facing([0, 0, 0.1], [0, 0, -1])
    low, high = (press_points(dome(), Box(size=(4e-3, 4e-3, height)), pose, load=3.0) for height in (0.2e-3, 9e-3))
    assert high.depth > 0.4e-3
    assert low.depth == pytest.approx(high.depth, rel=1e-2)
    np.testing.assert_allclose(low.texel_forces, high.texel_forces, atol=2e-2)


@pytest.mark.parametrize("direction", [(0, 0, -1.0), (-0.6, 0, -0.8), (0.36, -0.48, -0.8)])
def test_load_acts_along_the_direction(direction):
    found = press_points(dome(), Sphere(radius=4e-3), Pose.facing(-0.05 * np.array(direction), direction), load=0.7)
    assert found.force @ direction == pytest.approx(0.7, rel=1e-6)


def test_mirrored_press_gives_mirrored_forces():
    cover = dome()
    right, left = (
        press_points(cover, Sphere(radius=4e-3), Pose.facing([s * 2e-3, 0, 0.1], [0, 0, -1]), load=0.5) for s in (1, -1)
    )
    np.testing.assert_allclose(right.texel_forces, left.texel_forces[[1, 0, 3, 2]], atol=2e-3)


def test_two_bodies_each_carry_their_load_and_sink_with_the_top():
    cover, height = dome(41), np.sqrt(RADIUS**2 - 16e-6)
    touches = [np.array([x, 0, height]) for x in (-4e-3, 4e-3)]
    bodies = [pose_indenter(Sphere(radius=2e-3), Pose.facing(each, [0, 0, -1])) for each in touches]
    loads = [press_down(0.2), press_down(0.4)]
    found = solve_pressure(cover, bodies, loads)
    alone = [solve_pressure(cover, [body], [load])[0] for body, load in zip(bodies, loads, strict=True)]
    for each, single, load, other in zip(found, alone, loads, loads[::-1], strict=True):
        assert each.settled
        up = each.forces * each.normal[:, 2]
        assert up.sum() == pytest.approx(load.force, rel=1e-6)
        # The other force acts along the normal there, at the cosine of which it is larger, and moves the top along z.
        sunk = cover.top_compliance * other.force / (height / RADIUS) ** 2 / 8e-3
        assert each.footprint.travel - single.footprint.travel == pytest.approx(sunk, rel=0.12)


def test_a_restart_from_the_solution_changes_little():
    cover = dome()
    body = pose_indenter(Sphere(radius=6e-3), Pose.facing([1e-3, 0, 10e-3], [0, 0, -1]))
    cold = solve_pressure(cover, [body], [press_down(0.5)])[0]
    warm = solve_pressure(cover, [body], [press_down(0.5)], [cold.footprint])[0]
    assert warm.footprint.travel == pytest.approx(cold.footprint.travel, rel=2e-3)
    np.testing.assert_allclose(
        warm.build_influence(cover) @ warm.forces, cold.build_influence(cover) @ cold.forces, atol=1e-3
    )


@pytest.mark.parametrize(
    ("at", "load", "error", "message"),
    [((0.1, 0.0), 1.0, MissedArrayError, "never touches"), ((0.0, 0.0), -1.0, FastModelError, "load must be positive")],
)
def test_bad_presses_are_named(at, load, error, message):
    with pytest.raises(error, match=message):
        press_points(dome(), Sphere(radius=1e-3), Pose.facing([*at, 0.1], [0, 0, -1]), load=load)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"heights": np.zeros(625)}, "heights of a cover must be positive"),
        ({"thickness": 0.0}, "thickness of a cover must be positive"),
        ({"layer_step": 0.0}, "layer_step of a cover must be positive"),
        ({"remainder": np.triu(np.ones((625, 625)))}, "symmetric"),
        ({"normals": 2 * dome().normals}, "unit vectors"),
        ({"points": np.full((625, 3), np.nan)}, "not finite"),
        ({"influence": np.ones((4, 3))}, "influence"),
        ({"remainder": np.eye(3)}, "remainder"),
        ({"shares": np.full((625, 1), 0.5)}, "sum to 1"),
        ({"shared": np.full((625, 1), 625)}, "indices from 0 to 624"),
        ({"facets": np.array([[0, 1, 625]])}, "indices from 0 to 624"),
        ({"facets": np.zeros((0, 3))}, "facets of a cover must hold"),
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


@pytest.mark.parametrize("indenter", [Sphere(radius=5e-5), LetterH(size=(0.2e-3, 0.3e-3), bar=0.05e-3)])
def test_a_body_between_the_points_reaches_the_next_one_first(indenter):
    pose = Pose.facing([0.31e-3, -0.42e-3, 0.05], [0, 0, -1])
    cover = dome()
    (first,) = find_first_contact(cover, indenter, pose, pose.towards, within=1e-3)
    beside = np.linalg.norm(cover.points[:, :2] - pose.position[:2], axis=1)
    assert beside[first] == beside.min()
