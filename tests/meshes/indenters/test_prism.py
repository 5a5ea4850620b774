"""Prisms of any outline."""

from __future__ import annotations

import numpy as np
import pytest

from meshes import Box, LetterH, Nut, Prism
from tests.support.outlines import HEXAGONS, LETTER, RECTANGLE

PAIRS = {
    "box": (Prism(points=RECTANGLE), Box(size=(10e-3, 6e-3, 5e-3))),
    "h": (Prism(points=LETTER), LetterH(size=(12e-3, 16e-3), bar=4e-3)),
    "nut": (Prism(points=HEXAGONS[0], holes=HEXAGONS[1:]), Nut(across=13e-3, bore=8e-3)),
}


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("order", [1, -1])
def test_a_prism_equals_the_named_shape_of_the_same_outline(name, order):
    prism, shape = PAIRS[name]
    prism = Prism(points=prism.points[::order], holes=prism.holes)
    x, y = (np.random.default_rng(3).uniform(-1.2, 1.2, (5000, 2)) * shape.footprint).T
    np.testing.assert_allclose(prism.signed_distance(x, y), shape.signed_distance(x, y), atol=1e-15)
    np.testing.assert_array_equal(prism.gap(x, y), shape.gap(x, y))
    np.testing.assert_allclose(prism.footprint, shape.footprint)
    assert prism.mirror_symmetry == shape.mirror_symmetry
    assert prism.is_flat


def test_points_on_the_outline_belong_to_the_face():
    square = PAIRS["box"][0]
    x, y = np.array([[5, 3], [5, 0], [-5, -3], [0, 3], [5.001, 0], [0, -3.001]]).T * 1e-3
    assert np.isfinite(square.gap(x, y)).tolist() == [True, True, True, True, False, False]


@pytest.mark.parametrize(
    ("points", "symmetry"),
    [
        ([(-2, -1), (2, -1), (0, 3)], (True, False)),
        ([(-1, -2), (-1, 2), (3, 0)], (False, True)),
        ([(-2, -1), (2, -1), (0.5, 3)], (False, False)),
        ([(-2, -1), (1, -1), (2, -1), (2, 1), (-2, 1)], (True, True)),
        ([(-2, -1), (2, -1), (2, 1), (-2, 1 + 1e-5)], (False, False)),
        ([(-2, -1), (2, -1), (2, 1), (-2, 1 + 1e-7)], (True, True)),
    ],
    ids=["about x = 0", "about y = 0", "skew", "extra corner", "off by 10 nm", "off by rounding"],
)
def test_mirror_symmetry_follows_from_the_outline(points, symmetry):
    assert Prism(points=tuple((1e-3 * x, 1e-3 * y) for x, y in points)).mirror_symmetry == symmetry


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(1, 1), (2, 1), (1, 2)], r"axis, at \(0, 0\), must stand within"),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], "meet"),
    ],
)
def test_an_axis_beside_the_outline_and_an_outline_that_crosses_itself_are_refused(points, message):
    with pytest.raises(ValueError, match=message):
        Prism(points=tuple((1e-3 * x, 1e-3 * y) for x, y in points))
