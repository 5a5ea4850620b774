"""The fast model of the fingertip against the reference on finer meshes, from several sides."""

from __future__ import annotations

import numpy as np
import pytest

from fastmodel.contact.points import press_points as press_fast
from fem_reference import press
from meshes import Box, Material, Sphere
from meshes.pose import Pose
from meshes.solids import fingertip
from meshes.solids.covers import take_meshes
from validation.derivation.cover_points import choose_mesh, derive_points

RUBBER = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49)
COVER = fingertip()
PRESSES = [
    (Sphere(radius=6e-3), [0, -3, 2], [-1, 0.1, -0.5], 0.4),
    (Box(size=(12e-3, 12e-3, 5e-3)), [0, -4, 0], [0, -0.3, -1], 1.0),
    (Sphere(radius=0.7e-3), [0.3, -5, 0], [0.1, 0, -1], 0.02),
]


@pytest.mark.slow
@pytest.mark.bench
def test_the_fast_model_misplaces_little_of_the_load():
    meshes = COVER.meshes(1.25)
    fast, finest = derive_points(choose_mesh(meshes), COVER.texels, RUBBER), meshes[-1]
    misplaced = []
    for shape, at, direction, load in PRESSES:
        pose = Pose.facing(1e-3 * np.array(at) - 25e-3 * np.array(direction), direction)
        known = press(take_meshes([finest], RUBBER), COVER.texels, shape, pose, load=load)
        found = press_fast(fast, shape, pose, load=load)
        misplaced.append(np.abs(found.texel_forces - known.texel_forces).sum() / (2 * load))
    assert np.median(misplaced) < 0.005
    assert max(misplaced) < 0.015
