"""Points of a cover inside a plate or a ball, and the error of the shape, on a pad of known heights."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fem_reference.curved_cover.penetration import check_penetration, shape_error, warn_of_shape
from fem_reference.errors import ConvergenceError
from meshes import Box, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad

MESH = flat_pad(size=(8e-3, 6e-3), rows=2).mesh(2e-3, layers=2)
WHOLE = Box(size=(20e-3, 20e-3, 5e-3))
DOWN = Pose.facing([0, 0, 10e-3], [0, 0, -1])
STILL = np.zeros_like(MESH.nodes)
BEYOND = MESH.nodes[MESH.top][..., 0].mean(axis=1) > 1e-3
PART = dataclasses.replace(MESH, top=MESH.top[~BEYOND], left_out=MESH.top[BEYOND])


@pytest.mark.parametrize("mesh", [MESH, PART], ids=["top", "left out"])
@pytest.mark.parametrize(
    ("depth", "inside"),
    [(0.4e-3, 0.31e-3), (0.4e-3, 0.29e-3), (0.01e-3, 0.061e-3), (0.01e-3, 0.059e-3), (0.09e-3, 0.066e-3)],
)
def test_three_quarters_of_the_depth_or_three_hundredths_of_the_thickness_may_lie_inside(mesh, depth, inside):
    """The top at 2 mm is passed by a plate that began at 10 mm."""
    allowed = max(0.75 * depth, 0.03 * 2e-3)
    if inside <= allowed:
        check_penetration(mesh, STILL, WHOLE, DOWN, travel=8e-3 + inside, depth=depth)
        return
    words = rf"by {1e3 * inside:.2g} mm at \(.*, 2\) mm, more than {1e3 * allowed:.2g} mm: the indenter touches a part"
    with pytest.raises(ConvergenceError, match=words):
        check_penetration(mesh, STILL, WHOLE, DOWN, travel=8e-3 + inside, depth=depth)


def test_the_deepest_point_is_named_in_the_pressed_cover():
    """One node of the top rises by 0.5 mm into a ball whose lowest point is 0.4 mm above the top."""
    corner = int(np.flatnonzero(np.isclose(MESH.nodes, [2e-3, -1e-3, 2e-3], atol=1e-9).all(axis=1))[0])
    moved = STILL.copy()
    moved[corner] = [0.0, 0.0, 0.5e-3]
    ball, pose = Sphere(radius=3e-3), Pose.facing([2e-3, -1e-3, 10e-3], [0, 0, -1])
    with pytest.raises(ConvergenceError, match=r"by 0.1 mm at \(2, -1, 2\) mm, more than 0.06 mm"):
        check_penetration(MESH, moved, ball, pose, travel=7.6e-3, depth=1e-5)
    check_penetration(MESH, moved, ball, pose, travel=7.55e-3, depth=1e-5)
    check_penetration(MESH, -moved, ball, pose, travel=8.05e-3, depth=1e-5)


@pytest.mark.parametrize(("smooth", "share"), [(False, 0.5), (True, 0.1)])
def test_the_shape_is_too_coarse_above_fifteen_percent_of_the_depth(smooth, share):
    mesh = dataclasses.replace(MESH, settings={"geometry_error": 70e-6, "smooth": smooth})
    for part, told in ((0.1499, False), (0.1501, True)):
        depth = share * 70e-6 / part
        assert shape_error(mesh, depth) == pytest.approx(part)
        sentences = warn_of_shape(mesh, depth)
        assert len(sentences) == told
        if told:
            assert "known to 0.07 mm, and the depth to 15% by that" in sentences[0]
