"""Contacts on spheres and cylinders against exact solutions, and the same press at many places of a sphere."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fem_reference import press
from fem_reference.closed_form.cylinder import CylinderLayer
from meshes import Box, Sphere, TexelArray
from meshes.pose import Pose
from meshes.solids.covers import take_meshes
from meshes.solids.swept import cylinder_surface, join_grids, sweep
from tests.exact import cylinder_contact
from tests.exact.sphere import SphereLayer
from tests.exact.sphere_contact import press_ball
from tests.support.rubber import make_rubber

CORE, THICKNESS = 6e-3, 2e-3
ARRAY = TexelArray.grid(1, 1, 2e-3, name="pole")
ARRAY = dataclasses.replace(ARRAY, centres=np.array([[0.0, 0.0, CORE]]))


def sphere_mesh(size, layers):
    """Mesh a cube-like part of a spherical cover around the z axis."""
    turn = np.linspace(-1.0, 1.0, 2 * int(np.ceil(2 * CORE / (size * THICKNESS))) + 1)
    first, second = np.meshgrid(np.tan(turn), np.tan(turn))
    out = np.stack([first, second, np.ones_like(first)], axis=-1)
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    return sweep(join_grids([(CORE * out, out)], "sphere", {}), THICKNESS, layers=layers)


MESHES = [sphere_mesh(size, layers) for size, layers in ((0.48, 3), (0.38, 3), (0.3, 4))]


def towards(x, y, turn=0.0, tilt=0.0):
    """Pose outside the sphere above the direction (x, y, 1), turned about it and tilted."""
    out = np.array([x, y, 1.0]) / np.hypot(np.hypot(x, y), 1)
    pose = Pose.facing(20e-3 * out, -out)
    return dataclasses.replace(pose, yaw=pose.yaw + turn, tilt=(0.0, tilt))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "depth", "place", "ratio"),
    [
        (4e-3, 0.2e-3, (0.2, 0.3), 0.49),
        pytest.param(8e-3, 0.4e-3, (0.15, 0.1), 0.45, marks=pytest.mark.bench),
    ],
)
def test_a_ball_on_a_spherical_cover_meets_the_exact_contact(radius, depth, place, ratio):
    material = make_rubber(ratio)
    layer = SphereLayer(core_radius=CORE, thickness=THICKNESS, material=material)
    known = press_ball(layer, radius, depth)
    cover, pose, ball = take_meshes(MESHES, material), towards(*place), Sphere(radius=radius)
    found = press(cover, ARRAY, ball, pose, depth=depth)
    for name, exact, limit in (("total_force", known.force, 0.006), ("contact_area", known.area, 0.015)):
        error = abs(getattr(found, name) / exact - 1)
        assert error < limit
        assert error < found.error_estimate[name] + 0.003  # of the rings


@pytest.mark.slow
def test_a_ball_on_a_cylindrical_cover_meets_the_exact_contact():
    material, depth, ball = make_rubber(0.45), 0.1e-3, Sphere(radius=3e-3)
    sizes = ((0.48, 3), (0.38, 3), (0.3, 4))
    meshes = [
        sweep(cylinder_surface(CORE, 2.1, 14e-3, size * THICKNESS), THICKNESS, layers=layers) for size, layers in sizes
    ]
    layer = CylinderLayer(core_radius=CORE, thickness=THICKNESS, material=material)
    known = cylinder_contact.press_ball(layer, ball.radius, depth, cells=20)
    pose = towards(0.1, 0.0)
    found = press(take_meshes(meshes, material), ARRAY, ball, pose, depth=depth)
    error = abs(found.total_force / known.force - 1)
    assert error < min(0.005, found.error_estimate["total_force"])
    assert abs(found.contact_area / known.area - 1) < found.error_estimate["contact_area"] + 0.01  # of the exact one
    loaded = press(take_meshes(meshes, material), ARRAY, ball, pose, load=known.force)
    assert abs(loaded.depth / depth - 1) < min(0.005, loaded.error_estimate["depth"])


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, pytest.param(np.radians(45), marks=pytest.mark.bench)], ids=["flat", "edge"])
def test_a_box_is_pressed_alike_at_all_places_of_a_sphere(tilt):
    """On one mesh: places, and turns of the elements below the box."""
    cover, box = take_meshes(MESHES[:1], make_rubber(0.49)), Box(size=(4e-3, 4e-3, 6e-3))
    places = [(0, 0), (0.1, -0.07), (-0.25, -0.2)]
    depths = [
        press(cover, ARRAY, box, towards(x, y, turn, tilt), load=0.3).depth
        for (x, y), turn in zip(places, np.linspace(0, 1.5, len(places)), strict=True)
    ]
    assert np.ptp(depths) < 0.01 * np.mean(depths)
