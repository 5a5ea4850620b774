"""Distances along lines to convex solids, against the rays of MuJoCo."""

import mujoco
import numpy as np
import pytest

from fem_reference.curved_cover.rays import measure_gaps
from meshes import Box, Cylinder, LetterH, Roller, RoundedTip, Sphere

KINDS = {"sphere": "SPHERE", "cylinder": "CYLINDER", "capsule": "CAPSULE", "box": "BOX"}
INDENTERS = (
    Sphere(radius=5e-3),
    RoundedTip(),
    Cylinder(radius=4e-3),
    Box(size=(10e-3, 6e-3, 5e-3)),
    Roller(radius=4e-3, length=12e-3),
    LetterH(size=(12e-3, 16e-3), bar=4e-3),
)


def shoot(primitive, point, direction):
    """Distance to a solid by MuJoCo, infinite where it is missed."""
    turn, size = np.zeros(9), np.zeros(3)
    mujoco.mju_quat2Mat(turn, np.array(primitive.quaternion))
    size[: len(primitive.size)] = primitive.size
    kind = getattr(mujoco.mjtGeom, f"mjGEOM_{KINDS[primitive.kind]}")
    found = mujoco.mju_rayGeom(np.array(primitive.position), turn, size, point, direction, kind)
    return found if found >= 0 else np.inf


@pytest.mark.parametrize("indenter", INDENTERS, ids=lambda each: type(each).__name__)
def test_oblique_lines_from_outside_meet_the_indenter_where_mujocos_rays_do(indenter):
    random = np.random.default_rng(1)
    directions = random.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    aims = random.uniform(-1, 1, (400, 3)) * [10e-3, 10e-3, 15e-3] + [0, 0, 5e-3]
    points = aims - 0.1 * directions
    primitives = indenter.primitives()
    expected = [min(shoot(each, *line) for each in primitives) for line in zip(points, directions, strict=True)]
    found = measure_gaps(indenter, points, directions)
    assert np.isfinite(found).any()
    assert np.isinf(found).any()
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    behind = measure_gaps(indenter, points, -directions)
    assert np.isinf(behind).all()
    met = np.isfinite(found)
    inside = points[met] + (found[met] + 1e-6)[:, None] * directions[met]
    np.testing.assert_allclose(measure_gaps(indenter, inside, directions[met]), -1e-6, atol=1e-9)


def test_lines_along_axes_and_faces_meet_or_miss():
    down = np.array([[0.0, 0.0, -1.0]])
    for indenter, radius in ((Cylinder(radius=4e-3), 4e-3), (Box(size=(8e-3, 8e-3, 5e-3)), 4e-3)):
        top = max(each.position[2] + each.size[-1] for each in indenter.primitives())
        for place, gap in ((0.99 * radius, 0.1 - top), (1.01 * radius, np.inf)):
            assert measure_gaps(indenter, np.array([[place, 0.0, 0.1]]), down) == pytest.approx(gap)
