"""Height of the lowest of many triangles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes import read_stl
from meshes.indenters.triangle_mesh import TriangleGap


@st.composite
def soups(draw):
    """Triangles that face down, at random places and heights; they may overlap."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    count = draw(st.integers(1, 40))
    size = draw(st.floats(0.05, 1.5))
    triangles = rng.uniform(-1, 1, (count, 1, 3)) + size * rng.uniform(-1, 1, (count, 3, 3))
    flat = triangles[:, 1:, :2] - triangles[:, :1, :2]
    upward = np.linalg.det(flat) > 0
    triangles[upward] = triangles[upward, ::-1]
    return triangles[np.abs(np.linalg.det(flat)) > 1e-3 * size**2]


SOUPS = soups().filter(len)
POINTS = np.random.default_rng(5).uniform(-1.5, 1.5, (2, 200))


def find_lowest_one_by_one(triangles, x, y):
    """Height of the lowest triangle, without a grid, by barycentric coordinates."""
    lowest = np.full(x.shape, np.inf)
    for a, b, c in triangles:
        matrix = np.column_stack([b - a, c - a])[:2]
        if abs(np.linalg.det(matrix)) > 1e-15:
            u, v = np.linalg.solve(matrix, np.stack([x, y]) - a[:2, None])
            inside = (u >= 0) & (v >= 0) & (u + v <= 1)
            lowest = np.where(inside, np.minimum(lowest, a[2] + u * (b - a)[2] + v * (c - a)[2]), lowest)
    return lowest


@given(triangles=SOUPS)
def test_the_gap_is_the_height_of_the_lowest_of_any_triangles(triangles):
    expected = find_lowest_one_by_one(triangles, *POINTS)
    np.testing.assert_allclose(TriangleGap(triangles).evaluate(*POINTS), expected, atol=1e-9)


@pytest.mark.parametrize("name", ["sphere", "two-balls", "pyramid"])
def test_the_gap_of_a_body_is_that_of_all_its_triangles(write_stl, name):
    body = read_stl(write_stl(name))
    x, y = (np.random.default_rng(1).uniform(-1.2, 1.2, (300, 2)) * body.footprint).T
    np.testing.assert_allclose(body.gap(x, y), find_lowest_one_by_one(body.triangles, x, y), atol=1e-12)
