"""Distances from outlines, and checks of polygons."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes.indenters.polygons import (
    check_polygon,
    compute_distance_from_inset,
    compute_signed_distance,
    find_inside,
)

SQUARE = ((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0))
HOLE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
POINTS = st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=30).map(lambda p: np.array(p).T)


@st.composite
def stars(draw):
    """A polygon around the origin whose corners have different distances from it."""
    radii = draw(st.lists(st.floats(0.3, 2), min_size=4, max_size=20))
    turn = np.arange(len(radii)) * 2 * np.pi / len(radii)
    return tuple((float(r * np.cos(t)), float(r * np.sin(t))) for r, t in zip(radii, turn, strict=True))


def test_signed_distance_of_a_square_with_a_hole():
    x, y = np.array([[0, 0], [1.5, 0], [1.75, 1.75], [3, 0], [5, 6], [1, 0], [0.9, 0.5]]).T
    expected = [-1, 0.5, 0.25, -1, -5, 0, -0.1]
    assert compute_signed_distance([SQUARE, HOLE], x, y) == pytest.approx(expected)


@given(star=stars(), points=POINTS)
def test_points_inside_have_a_positive_distance_and_others_a_negative_one(star, points):
    distance = compute_signed_distance([star], *points)
    clear = np.abs(distance) > 1e-9
    assert np.array_equal(find_inside([star], *points)[clear], distance[clear] > 0)


@given(points=POINTS, inset=st.floats(0.01, 0.4))
def test_the_distance_from_an_inset_square_is_that_from_the_smaller_square(points, inset):
    x, y = points
    dx, dy = np.abs(x) - 2 + inset, np.abs(y) - 2 + inset
    expected = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))
    assert compute_distance_from_inset([SQUARE], inset, x, y) == pytest.approx(expected, abs=1e-6)


@given(star=stars(), points=POINTS, inset=st.floats(0.001, 0.05))
def test_distance_from_an_inset_and_depth_inside_add_up_to_at_least_the_inset(star, points, inset):
    """Beside straight sides they add up to it exactly; arcs of the inset outline are polygons, 0.12 % beside it."""
    depth = compute_signed_distance([star], *points)
    distance = compute_distance_from_inset([star], inset, *points)
    assert (distance + depth >= 0.998 * inset).all()
    assert np.all(distance[depth > 1.002 * inset] == 0)


@given(star=stars(), first=st.integers(0, 30))
def test_simple_polygons_are_accepted_from_any_corner_in_either_order(star, first):
    check_polygon(np.roll(star, first, axis=0))
    check_polygon(star[::-1])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(0, 0), (1, 0)], "three corners or more, not 2"),
        ([(0, 0), (1, 1), (2, 2)], "one line"),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], "sides 1 and 3 of the polygon meet"),
        ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], "sides 1 and 3 of the polygon meet"),
        ([(0, 0), (4, 0), (2, 0), (1, 3)], "sides 1 and 2 of the polygon meet"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], "corners 2 and 3 of the polygon are the same"),
        ([(0, 0), (1, 0), (float("nan"), 1)], "must be numbers"),
    ],
)
def test_polygons_that_are_not_simple_are_refused(points, message):
    with pytest.raises(ValueError, match=message):
        check_polygon([(1e-3 * x, 1e-3 * y) for x, y in points])
