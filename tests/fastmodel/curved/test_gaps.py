"""Distances along normals from points to rigid bodies."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fastmodel.contact.points import pose_indenter
from fastmodel.pressure.gap import CAPSULE, CYLINDER, BodyShape, PosedBody, Solid
from meshes import Box, Cone, Sphere
from meshes.pose import Pose


def round_body(kind, radius, half):
    size = np.array([radius, half, 0.0])
    solid = Solid(kind=kind, size=size, planes=np.zeros((0, 4)), centre=np.zeros(3), half=np.full(3, radius + half))
    return PosedBody(shape=BodyShape.of([solid]), rotation=np.eye(3)[None], position=np.zeros((1, 3)))


def lines(*pairs):
    points, along = (np.array(each, dtype=float) for each in zip(*pairs, strict=True))
    return points, along / np.linalg.norm(along, axis=1, keepdims=True)


def test_ball_along_and_beside_its_diameter():
    ball = pose_indenter(Sphere(radius=2.0), Pose.from_rotation(np.array([0, 0, 1.0]), np.eye(3)))
    found = ball.measure_gaps(*lines(([0, 0, 0], [0, 0, 1]), ([1, 0, 0], [0, 0, 1]), ([3, 0, 0], [0, 0, 1])))
    np.testing.assert_allclose(found, [1.0, 3 - np.sqrt(3), np.inf], rtol=1e-12)


def test_body_behind_a_point_is_not_met_and_one_around_it_is_negative():
    ball = pose_indenter(Sphere(radius=2.0), Pose.from_rotation(np.array([0, 0, 1.0]), np.eye(3)))
    found = ball.measure_gaps(*lines(([0, 0, 6], [0, 0, 1]), ([0, 0, 1.5], [0, 0, 1])))
    np.testing.assert_allclose(found, [np.inf, -0.5], rtol=1e-12)


def test_turned_box():
    turn = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])
    box = pose_indenter(Box(size=(2.0, 4.0, 6.0)), Pose.from_rotation(np.array([1.0, 0, 0]), turn))
    found = box.measure_gaps(*lines(([0, 0, 0], [1, 0, 0]), ([0, 1.9, 0], [1, 0, 0]), ([0, 0, 1.1], [1, 0, 0])))
    np.testing.assert_allclose(found, [1.0, 1.0, np.inf], rtol=1e-12)


@pytest.mark.parametrize(("kind", "top", "slanted"), [(CYLINDER, 2.0, 2.0), (CAPSULE, 3.0, 2 + np.sqrt(0.75))])
def test_ends_of_cylinder_and_capsule(kind, top, slanted):
    body = round_body(kind, 1.0, 2.0)
    points, along = lines(
        ([0, 0, 5], [0, 0, -1]), ([0.5, 0, 5], [0, 0, -1]), ([5, 0, 0], [-1, 0, 0]), ([5, 0, 2.5], [-1, 0, 0])
    )
    side = 4.0 if kind == CYLINDER else 5 - np.sqrt(0.75)
    expected = [5 - top, 5 - slanted, 4.0, np.inf if kind == CYLINDER else side]
    np.testing.assert_allclose(body.measure_gaps(points, along), expected, rtol=1e-12)


@pytest.mark.parametrize("kind", [CYLINDER, CAPSULE])
def test_oblique_lines_meet_round_bodies_where_mujocos_rays_do(kind):
    random = np.random.default_rng(2)
    along = random.normal(size=(300, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    points = random.uniform(-1.5, 1.5, (300, 3)) * [1, 1, 2] - 9 * along
    name = {CYLINDER: mujoco.mjtGeom.mjGEOM_CYLINDER, CAPSULE: mujoco.mjtGeom.mjGEOM_CAPSULE}[kind]
    size, turn = np.array([1.0, 2.0, 0.0]), np.eye(3).ravel()
    expected = np.array(
        [mujoco.mju_rayGeom(np.zeros(3), turn, size, *line, name) for line in zip(points, along, strict=True)]
    )
    assert 50 < (expected < 0).sum() < 250
    found = round_body(kind, 1.0, 2.0).measure_gaps(points, along)
    np.testing.assert_allclose(found, np.where(expected < 0, np.inf, expected), rtol=1e-9)


def test_hull_of_a_cone_is_met_at_its_tip():
    cone = pose_indenter(Cone(angle=np.pi / 2, radius=1e-3), Pose.from_rotation(np.zeros(3), np.eye(3)))
    found = cone.measure_gaps(*lines(([0, 0, -1e-3], [0, 0, 1]), ([0.5e-3, 0, -1e-3], [0, 0, 1])))
    np.testing.assert_allclose(found, [1e-3, 1.5e-3], rtol=2e-2)
