"""Error estimates of curved covers against closed forms and against the planar solution with free edges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_reference import press
from fem_reference.closed_form.cylinder import CylinderLayer
from fem_reference.curved_cover import texel_responses
from meshes import Box, Cover, Layer, Material, TexelArray
from meshes.pose import Pose
from meshes.solids import flat_pad, sweep
from meshes.solids.covers import take_meshes
from meshes.solids.swept import cylinder_surface
from tests.exact.spots import SpotLoad, touch_cylinder
from tests.support.rotated_poses import rotated_pose

SIZE = (10e-3, 10e-3)
RUBBER = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49)


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.17e-3, pytest.param(0.4e-3, marks=pytest.mark.bench)])
def test_estimates_of_point_forces_on_a_cylinder_bound_the_error(shift):
    radius, size = 6e-3, 1.98e-3
    texels = TexelArray(
        centres=np.array([[0.0, shift, radius]]), normals=np.array([[0.0, 0, 1]]), texel_size=(size, size),
        pitch=(size, size), rows=1, columns=1, active=np.ones(1, dtype=bool),
    )  # fmt: skip
    surfaces = [(0.96e-3, 3), (0.76e-3, 3), (0.6e-3, 4)]
    meshes = [sweep(cylinder_surface(radius, 2.1, 14e-3, each), 2e-3, layers=layers) for each, layers in surfaces]
    response = texel_responses(meshes, texels, RUBBER)
    half = np.arcsin(size / 2 / radius)
    layer = CylinderLayer(core_radius=radius, thickness=2e-3, material=RUBBER)
    known = touch_cylinder(layer, SpotLoad(force=1.0)).texel_forces([[-half, half, -size / 2, size / 2]])[0]
    error = abs(response.matrix[0, 0] / known - 1)
    assert error < response.error_estimate["peak_texel"]
    assert response.error_estimate["peak_texel"] < 0.05


@pytest.mark.bench  # the slow tests have a ball
@pytest.mark.slow
def test_estimates_of_a_press_bound_the_difference_from_the_planar_solution():
    """Of a box; `tests/fem_reference/curved_cover/test_press.py` presses a ball."""
    indenter, load, at = Box(size=(4e-3, 3e-3, 6e-3)), 0.5, (0.5e-3, 0.33e-3)
    cover = flat_pad(size=SIZE, rows=2)
    ours = press(
        take_meshes(cover.meshes(1.2), RUBBER), cover.texels, indenter, Pose.facing([*at, 5e-3], [0, 0, -1]), load=load
    )
    planar = Cover(layers=(Layer(thickness=2e-3, material=RUBBER),), size=SIZE)
    known = press(planar, cover.texels, indenter, load=load, pose=Pose.planar(at=at))
    difference = np.abs(ours.texel_forces - known.texel_forces).max() / known.texel_forces.max()
    assert difference < ours.error_estimate["peak_texel"] < 0.15
    misplaced = np.abs(ours.texel_forces - known.texel_forces).sum() / (2 * load)
    assert misplaced < ours.error_estimate["misplaced_force"] < 0.04
    assert abs(ours.depth / known.depth - 1) < ours.error_estimate["depth"] < 0.15
    assert abs(ours.contact_area / known.contact_area - 1) < ours.error_estimate["contact_area"]


@pytest.mark.slow
@pytest.mark.bench  # the slow tests have the same box untilted, and a tilted one on the planar cover
def test_a_tilted_box_presses_as_on_the_planar_solution():
    cover, load, tilt, at = flat_pad(size=SIZE, rows=2), 0.2, np.radians(9.9), (-1e-3, 0.1e-3)
    box = Box(size=(8e-3, 3e-3, 6e-3))
    pose = rotated_pose(np.array([*at, 5e-3]), Rotation.from_rotvec([0, tilt, 0]).as_matrix(), (0, 0, -1))
    ours = press(take_meshes(cover.meshes(1.2), RUBBER), cover.texels, box, pose, load=load)
    planar = Cover(layers=(Layer(thickness=2e-3, material=RUBBER),), size=SIZE)
    known = press(planar, cover.texels, box, load=load, pose=Pose.planar(at=at, tilt=(0.0, tilt)))
    misplaced = np.abs(ours.texel_forces - known.texel_forces).sum() / (2 * load)
    assert misplaced < ours.error_estimate["misplaced_force"] + known.error_estimate["peak_texel"] < 0.08
