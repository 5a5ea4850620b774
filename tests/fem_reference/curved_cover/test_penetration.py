"""Nothing of a pressed cover lies inside the indenter, and a shape that is too coarse for a depth is stated."""

import dataclasses

import numpy as np
import pytest

from fem_reference import press
from fem_reference.curved_cover.penetration import check_penetration, measure_penetration, shape_error, warn_of_shape
from fem_reference.errors import ConvergenceError
from meshes import Box, Cylinder, Roller, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad
from meshes.solids.covers import take_meshes
from tests.support.rubber import make_rubber

RUBBER = make_rubber(model="linear-elastic")
PAD = flat_pad(size=(8e-3, 8e-3), rows=2)
MESH = PAD.mesh(2e-3, layers=2)
DOWN = Pose.facing([0, 0, 10e-3], [0, 0, -1])


@pytest.mark.parametrize(
    ("indenter", "point", "inside"),
    [
        (Sphere(radius=3e-3), (0, 0, 1e-3), 1e-3),
        (Sphere(radius=3e-3), (1e-3, 0, -2e-3), 3e-3 - np.hypot(1e-3, 5e-3)),
        (Box(size=(4e-3, 6e-3, 5e-3)), (1.6e-3, 0, 1e-3), 0.4e-3),
        (Box(size=(4e-3, 6e-3, 5e-3)), (0, 2.9e-3, 1e-3), 0.1e-3),
        (Cylinder(radius=3e-3), (2e-3, 0, 0.3e-3), 0.3e-3),
        (Cylinder(radius=3e-3), (2.8e-3, 0, 0.9e-3), 0.2e-3),
        (Roller(radius=3e-3, length=6e-3), (0, 0, 1e-3), 1e-3),
    ],
)
def test_the_depth_of_a_point_in_a_body(indenter, point, inside):
    assert measure_penetration(indenter, np.array([point]))[0] == pytest.approx(inside, abs=1e-12)


@pytest.mark.slow
def test_a_body_that_passes_a_part_that_is_not_touched_is_an_error():
    outside = MESH.nodes[MESH.top][..., 0].mean(axis=1) > 1e-3
    part = dataclasses.replace(MESH, top=MESH.top[~outside], left_out=MESH.top[outside])
    still = np.zeros_like(part.nodes)
    wide, narrow = Box(size=(20e-3, 20e-3, 5e-3)), Box(size=(1.5e-3, 1.5e-3, 5e-3))
    check_penetration(part, still, wide, DOWN, travel=8e-3, depth=0.1e-3)  # just touches
    with pytest.raises(ConvergenceError, match=r"passes through the indenter by 0.3 mm at \(.*\) mm, more than 0.075"):
        check_penetration(part, still, wide, DOWN, travel=8.3e-3, depth=0.1e-3)
    # A cover that yields as a plate presses has no point inside it.
    yields = still + np.array([0, 0, -0.3e-3]) * (MESH.nodes[:, [2]] / 2e-3)
    check_penetration(part, yields, wide, DOWN, travel=8.3e-3, depth=0.3e-3)
    cover = take_meshes((part,), RUBBER)
    with pytest.raises(ConvergenceError, match="left out"):
        press(cover, PAD.texels, Box(size=(20e-3, 20e-3, 5e-3)), DOWN, depth=0.3e-3)
    assert press(cover, PAD.texels, narrow, Pose.facing([-2e-3, 0, 10e-3], [0, 0, -1]), depth=0.1e-3).total_force > 0


@pytest.mark.slow
def test_the_error_of_the_shape_counts_in_the_depth_and_is_said_where_it_is_large():
    known = press(take_meshes((MESH,), RUBBER), PAD.texels, Sphere(radius=6e-3), DOWN, load=0.3)
    for size, told in ((2e-6, False), (0.2e-3, True)):
        mesh = dataclasses.replace(MESH, settings={"geometry_error": size})
        assert shape_error(mesh, known.depth) == pytest.approx(size / 2 / known.depth)
        smooth = dataclasses.replace(MESH, settings={"geometry_error": size, "smooth": True})
        assert shape_error(smooth, known.depth) == pytest.approx(size / 10 / known.depth)
        found = press(take_meshes((mesh,), RUBBER), PAD.texels, Sphere(radius=6e-3), DOWN, load=0.3)
        assert found.depth == pytest.approx(known.depth)
        assert any("the shape of the cover is known to 0.2 mm" in each for each in found.warnings) == told
        assert bool(warn_of_shape(mesh, found.depth)) == told
