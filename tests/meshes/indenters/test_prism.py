"""Polygon prisms: the same as the built-in shapes, and made of convex parts that tile them."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from meshes import Box, LetterH, Nut, Prism
from meshes.indenters.convex_parts import split_into_convex_parts
from meshes.indenters.nut import match_hexagon
from meshes.indenters.polygons import compute_area, compute_signed_distance, make_hexagon

H = tuple((x * 1e-3, y * 1e-3) for x, y in [(6, 8), (2, 8), (2, 2), (-2, 2), (-2, 8), (-6, 8)])
H += tuple((-x, -y) for x, y in H)
NUT = (tuple(make_hexagon(13e-3)), tuple(make_hexagon(match_hexagon(8e-3))))
PAIRS = {
    "box": (Prism(points=((5e-3, 3e-3), (-5e-3, 3e-3), (-5e-3, -3e-3), (5e-3, -3e-3))), Box(size=(10e-3, 6e-3, 5e-3))),
    "h": (Prism(points=H), LetterH(size=(12e-3, 16e-3), bar=4e-3)),
    "nut": (Prism(points=NUT[0], holes=NUT[1:]), Nut(across=13e-3, bore=8e-3)),
}


def star(rng):
    """A polygon around the origin, more or less spiky."""
    count = rng.integers(5, 25)
    turn = (np.arange(count) + rng.uniform(0, 0.9, count)) * 2 * np.pi / count
    return tuple(zip(*(rng.uniform(0.2, 1, count) * [np.cos(turn), np.sin(turn)]), strict=True))


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("order", [1, -1])
def test_a_polygon_is_the_shape_it_outlines(name, order):
    prism, shape = PAIRS[name]
    prism = Prism(points=prism.points[::order], holes=prism.holes)
    x, y = (np.random.default_rng(3).uniform(-1.2, 1.2, (5000, 2)) * shape.footprint).T
    np.testing.assert_allclose(prism.signed_distance(x, y), shape.signed_distance(x, y), atol=1e-15)
    np.testing.assert_array_equal(prism.gap(x, y), shape.gap(x, y))
    np.testing.assert_allclose(prism.footprint, shape.footprint)


def test_points_on_the_outline_belong_to_it():
    square = PAIRS["box"][0]
    x, y = np.array([[5, 3], [5, 0], [-5, -3], [0, 3], [5.001, 0], [0, -3.001]]).T * 1e-3
    assert np.isfinite(square.gap(x, y)).tolist() == [True, True, True, True, False, False]


@pytest.mark.parametrize(("name", "count"), [("box", 1), ("h", 3), ("nut", 6)])
@pytest.mark.parametrize("turn", [0, 0.3])
def test_few_parts_are_enough(name, count, turn):
    c, s = np.cos(turn), np.sin(turn)
    prism = PAIRS[name][0]
    loops = [[(c * x - s * y, s * x + c * y) for x, y in loop] for loop in (prism.points, *prism.holes)]
    assert len(split_into_convex_parts(loops)) == count


def test_convex_outlines_are_one_part():
    turn = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    parts = split_into_convex_parts([tuple(zip(3 * np.cos(turn), 2 * np.sin(turn), strict=True))])
    assert [len(part) for part in parts] == [96]


@pytest.mark.parametrize("seed", range(12))
def test_parts_are_convex_and_tile_any_polygon(seed):
    rng = np.random.default_rng(seed)
    loop = star(rng)
    parts = split_into_convex_parts([loop])
    x, y = rng.uniform(-1, 1, (2, 2000))
    within = [compute_signed_distance([part], x, y) >= 0 for part in parts]
    np.testing.assert_array_equal(np.sum(within, axis=0), compute_signed_distance([loop], x, y) >= 0)
    assert sum(compute_area(part) for part in parts) == pytest.approx(abs(compute_area(loop)), rel=1e-9)
    for part in parts:
        ahead = np.roll(part, -1, axis=0) - part
        turn = ahead[:, 0] * np.roll(ahead[:, 1], -1) - ahead[:, 1] * np.roll(ahead[:, 0], -1)
        assert turn.min() > -1e-6


@pytest.mark.parametrize("noise", [2e-10, 5e-8, 1e-6])
def test_corners_that_are_nearly_level_do_not_mislead(noise):
    """Slabs between such corners are so thin that the direction of their sides says little."""
    for seed in range(5):
        wobble = np.random.default_rng(seed).normal(0, noise, (2, 6, 2))
        loops = [list(zip(*(np.array(loop) + each).T, strict=True)) for loop, each in zip(NUT, wobble, strict=True)]
        parts = split_into_convex_parts(loops)
        assert sum(compute_area(part) for part in parts) == pytest.approx(
            compute_area(loops[0]) - compute_area(loops[1]), rel=1e-5
        )


def test_a_round_hole_stays_open_however_many_sides_it_has():
    """Each turn is too small to count; all together they are not."""
    turn = np.linspace(0, 2 * np.pi, 800, endpoint=False)
    hole = list(zip(0.015 * np.cos(turn), 0.015 * np.sin(turn), strict=True))
    square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    filled = sum(ConvexHull(part).volume for part in split_into_convex_parts([square, hole])) - (1 - compute_area(hole))
    assert abs(filled) < 1e-7


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
        ([(1, 1), (2, 1), (1, 2)], "axis, at \\(0, 0\\), must stand within"),
    ],
)
def test_bad_polygons_are_refused(points, message):
    with pytest.raises(ValueError, match=message):
        Prism(points=tuple((1e-3 * x, 1e-3 * y) for x, y in points))
