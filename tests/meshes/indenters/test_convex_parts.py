"""Convex polygons that tile an outline."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from meshes.indenters.polygons import compute_signed_distance, split_into_convex_parts
from tests.support.outlines import HEXAGONS, LETTER, RECTANGLE
from tests.support.polygon_area import compute_area

OUTLINES = {"box": [RECTANGLE], "h": [LETTER], "nut": HEXAGONS}


@pytest.mark.parametrize(("name", "count"), [("box", 1), ("h", 3), ("nut", 6)])
@pytest.mark.parametrize("turn", [0, 0.3])
def test_few_parts_are_enough_in_any_orientation(name, count, turn):
    c, s = np.cos(turn), np.sin(turn)
    rotated = [[(c * x - s * y, s * x + c * y) for x, y in polygon] for polygon in OUTLINES[name]]
    assert len(split_into_convex_parts(rotated)) == count


def is_convex(part, slack):
    ahead = np.roll(part, -1, axis=0) - part
    turn = ahead[:, 0] * np.roll(ahead[:, 1], -1) - ahead[:, 1] * np.roll(ahead[:, 0], -1)
    return turn.min() > -slack


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_parts_of_an_outline_of_another_size_have_the_same_corners(size):
    """A corner cut off by a hundred thousandth of the width stays; one by a ten thousand millionth is rounding."""
    for cut, corners in ((1e-5, 5), (1e-10, 4)):
        outline = size * np.array([(0, 0), (1, 0), (1, 1 - cut), (1 - cut, 1), (0, 1)])
        parts = split_into_convex_parts([outline])
        assert [len(part) for part in parts] == [corners]
        assert compute_area(parts[0]) == pytest.approx(size**2 * (1 - cut**2 / 2), rel=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_parts_are_convex_and_tile_a_spiky_polygon(seed):
    rng = np.random.default_rng(seed)
    count = rng.integers(5, 25)
    turn = (np.arange(count) + rng.uniform(0, 0.9, count)) * 2 * np.pi / count
    star = tuple(zip(*(rng.uniform(0.2, 1, count) * [np.cos(turn), np.sin(turn)]), strict=True))
    parts = split_into_convex_parts([star])
    x, y = rng.uniform(-1, 1, (2, 2000))
    within = [compute_signed_distance([part], x, y) >= 0 for part in parts]
    np.testing.assert_array_equal(np.sum(within, axis=0), compute_signed_distance([star], x, y) >= 0)
    assert sum(compute_area(part) for part in parts) == pytest.approx(abs(compute_area(star)), rel=1e-9)
    assert all(is_convex(part, 1e-6) for part in parts)


@pytest.mark.parametrize("noise", [2e-10, pytest.param(5e-8, marks=pytest.mark.slow), 1e-6])
def test_corners_that_are_nearly_level_do_not_mislead(noise):
    """Slabs between such corners are so thin that the direction of their sides says little."""
    for seed in range(5):
        wobble = np.random.default_rng(seed).normal(0, noise, (2, 6, 2))
        outlines = [(np.array(polygon) + each).tolist() for polygon, each in zip(OUTLINES["nut"], wobble, strict=True)]
        whole = compute_area(outlines[0]) - compute_area(outlines[1])
        parts = split_into_convex_parts(outlines)
        assert sum(compute_area(part) for part in parts) == pytest.approx(whole, rel=1e-5)


@pytest.mark.slow
def test_a_round_hole_stays_open_however_many_sides_it_has():
    """Each turn between two sides is within rounding, but not their sum."""
    turn = np.linspace(0, 2 * np.pi, 800, endpoint=False)
    hole = list(zip(0.015 * np.cos(turn), 0.015 * np.sin(turn), strict=True))
    square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    parts = split_into_convex_parts([square, hole])
    filled = sum(ConvexHull(part).volume for part in parts) - (1 - compute_area(hole))
    assert abs(filled) < 1e-7
