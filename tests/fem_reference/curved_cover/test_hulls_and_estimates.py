"""Indenters made of hulls and capsules, tops of triangles, and the estimates of the responses of texels."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_reference.curved_cover.penetration import measure_penetration
from fem_reference.curved_cover.rays import find_first_node, find_touch, measure_gaps
from fem_reference.curved_cover.responses import TexelResponses, estimate_error
from meshes import Box, Cylinder, Prism, RoundedTip, Sphere
from meshes.pose import Pose
from tests.fem_reference.curved_cover.test_by_hand import MESH, PAD, TOP, TRIANGLES, make_response

#: A right-angled triangle of 4 mm and 6 mm, 2.4 mm high; its long side is 4 y + 6 x = 24 from the corner.
TRIANGLE = Prism(points=((0.0, 0.0), (4e-3, 0.0), (0.0, 6e-3)))
(HULL,) = TRIANGLE.primitives()
HIGH = max(corner[2] for corner in HULL.vertices)


def clip_to_triangle(point, direction):
    """Distances at which a line enters and leaves the prism, one face after the other (Liang and Barsky 1984)."""
    corner = np.array(HULL.vertices)[:, :2].min(axis=0)
    slant = np.array([6.0, 4.0, 0.0]) / np.hypot(6, 4)
    faces = [
        (np.array([-1.0, 0, 0]), -corner[0]), (np.array([0, -1.0, 0]), -corner[1]),
        (slant, slant[:2] @ corner + 24e-3 / np.hypot(6, 4)),
        (np.array([0, 0, 1.0]), HIGH), (np.array([0, 0, -1.0]), 0.0),
    ]  # fmt: skip
    first, last = -np.inf, np.inf
    for normal, offset in faces:
        speed, room = normal @ direction, offset - normal @ point
        if speed == 0:
            if room < 0:
                return np.inf, -np.inf
        elif speed < 0:
            first = max(first, room / speed)
        else:
            last = min(last, room / speed)
    return first, last


def test_lines_meet_a_prism_where_they_cross_its_faces():
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (300, 3)) * 8e-3
    aims = np.array(HULL.vertices).mean(axis=0) + rng.uniform(-1, 1, (300, 3)) * 4e-3
    directions = aims - points
    directions[:20, :2] = 0.0
    directions[20:40, 2] = 0.0
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for behind in (0.0, 3e-3):
        exact = []
        for line in zip(points, directions, strict=True):
            first, last = clip_to_triangle(*line)
            exact.append(first if first <= last and last >= -behind else np.inf)
        found = measure_gaps(TRIANGLE, points, directions, behind=behind)
        np.testing.assert_allclose(found, exact, atol=1e-12)
        assert 0.2 < np.isfinite(found).mean() < 0.9


def test_points_are_as_deep_in_a_prism_as_below_its_nearest_face():
    """Distances from the five faces; the least counts, negative outside."""
    points = np.random.default_rng(4).uniform(-4e-3, 5e-3, (60, 3))
    corner = np.array(HULL.vertices)[:, :2].min(axis=0)
    x, y, z = (points - [*corner, 0.0]).T
    exact = np.min([x, y, (24e-3 - 6 * x - 4 * y) / np.hypot(6, 4), HIGH - z, z], axis=0)
    assert measure_penetration(TRIANGLE, points) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(
    ("point", "inside"),
    [
        ((0.0, 0.0, 0.4e-3), 0.4e-3),
        ((0.3e-3, -0.4e-3, 1e-3), 0.5e-3),
        ((0.3e-3, -0.4e-3, 5e-3), 0.5e-3),
        ((0.0, 1.5e-3, 3e-3), -0.5e-3),
        ((0.6e-3, 0.0, 0.2e-3), 1e-3 - np.hypot(0.6e-3, 0.8e-3)),
        ((0.0, 0.6e-3, 7.8e-3), 1e-3 - np.hypot(0.6e-3, 0.8e-3)),
    ],
)
def test_a_point_in_a_rod_is_as_deep_as_from_its_axis_or_its_end(point, inside):
    assert measure_penetration(RoundedTip(radius=1e-3), np.array([point]))[0] == pytest.approx(inside, abs=1e-12)


def test_a_prism_is_the_box_with_its_outline():
    """Two routes to one result, below the height of both."""
    points = np.array([(2e-3, 3e-3), (-2e-3, 3e-3), (-2e-3, -3e-3), (2e-3, -3e-3)])
    prism, box = Prism(points=tuple(map(tuple, points))), Box(size=(4e-3, 6e-3, 3e-3))
    rng = np.random.default_rng(5)
    starts = np.column_stack([rng.uniform(-5e-3, 5e-3, (80, 2)), rng.uniform(-4e-3, 0.0, 80)])
    ways = rng.normal(size=(80, 3)) + np.array([0, 0, 2.0])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    one, other = (measure_gaps(each, starts, ways) for each in (prism, box))
    np.testing.assert_allclose(one, other, atol=1e-12)


@pytest.mark.parametrize("at", [(0.0, 0.0), (1.37e-3, -0.61e-3), (-2.9e-3, 1.9e-3)])
@pytest.mark.parametrize("top", [TOP, TRIANGLES], ids=["quadrilaterals", "triangles"])
def test_a_ball_touches_a_flat_top_between_its_nodes(top, at):
    pose = Pose.facing([*at, 11e-3], [0, 0, -1])
    assert find_touch(top, Sphere(radius=0.7e-3), pose) == pytest.approx(9e-3, abs=1e-6)


@pytest.mark.parametrize("top", [TOP, TRIANGLES], ids=["quadrilaterals", "triangles"])
def test_an_oblique_ball_touches_a_flat_top_at_its_lowest_point(top):
    """The middle of the ball ends one radius above the top, along a direction of 30 degrees."""
    turn = Rotation.from_rotvec([0.0, np.radians(30), 0.0]).as_matrix()
    way = turn @ np.array([0, 0, -1.0])
    radius, end = 1.5e-3, np.array([0.33e-3, -0.41e-3, 3.5e-3])
    pose = Pose.facing(end - 7e-3 * way + radius * way, way)
    assert find_touch(top, Sphere(radius=radius), pose) == pytest.approx(7e-3, abs=2e-6)


def test_where_a_needle_passes_between_the_nodes_the_nearest_one_is_taken():
    pose = Pose.facing([0.6e-3, -0.3e-3, 9e-3], [0, 0, -1])
    needle = Cylinder(radius=0.05e-3)
    node = find_first_node(TOP, needle, pose, 7e-3)
    away = np.linalg.norm(TOP.nodes - [0.6e-3, -0.3e-3, 2e-3], axis=1)
    assert away[node] == away.min()


def test_estimates_of_texels_are_those_of_the_forces_under_their_own_points():
    """Influences that converge: the k-th texel feels -3 (k + 1) per newton, times 1 + 0.1 / 4^n on the n-th mesh."""
    count = 3
    meshes = [dataclasses.replace(MESH, cells=np.repeat(MESH.cells, 8**n, axis=0)) for n in range(count)]
    factors = 1 + 0.1 / 4.0 ** np.arange(count)
    grids = []
    for mesh, factor in zip(meshes, factors, strict=True):
        made = make_response()
        grids.append(dataclasses.replace(made, mesh=mesh, influence=-factor * made.influence))
    found = TexelResponses(texels=PAD.texels, layers=(), grids=tuple(grids))
    # Under a force against the normal each texel feels three times its number, wherever the force is.
    own = 3.0 * np.arange(1, 5)
    assert found.matrix == pytest.approx(factors[-1] * np.tile(own, (4, 1)))
    assert found.above == pytest.approx(PAD.texels.centres + np.array([0, 0, 2e-3]))
    assert not found.uncovered.any()
    values = np.array([factor * own for factor in factors])
    expected = estimate_error(values, meshes) / (factors[-1] * own[-1])
    assert found.error_estimate == pytest.approx({"peak_texel": expected, "any_texel": expected})
    # Second order: the error left is a third of the last change, with a safety factor of 1.25.
    assert expected == pytest.approx(1.25 * (factors[1] - factors[2]) / 3 / factors[2], rel=0.05)
    assert np.isnan(estimate_error(values[:1], meshes[:1]))
