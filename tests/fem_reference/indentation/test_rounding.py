"""Rounded edges: their radius on each grid, walls that are too thin for it, and what a result states."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation.finite_strain import (
    choose_edge_safety,
    choose_solid_fillet,
    choose_solid_grids,
    state_rounding,
)
from meshes import Box, Cylinder, LetterH, Prism, Roller, Sphere
from meshes.pose import Pose
from tests.support.rubber import make_cover

HALF = [(6, 8), (2, 8), (2, 2), (-2, 2), (-2, 8), (-6, 8)]
H = Prism(points=tuple((1e-3 * x, 1e-3 * y) for x, y in [*HALF, *((-x, -y) for x, y in HALF)]))


def frame(wall):
    ring = [tuple((s * a, t * a) for s, t in ((1, 1), (-1, 1), (-1, -1), (1, -1))) for a in (5e-3, 5e-3 - wall)]
    return Prism(points=ring[0], holes=(ring[1],))


@pytest.mark.slow
def test_walls_too_thin_for_a_grid_are_refused_in_words(wts):
    cover = make_cover(0.45)
    with pytest.raises(ValueError, match="too thin beside 10 mm"):
        press(cover, wts, frame(0.05e-3), load=1.0)
    with pytest.raises(ValueError, match="too thin beside 10 mm for the grids of finite strain"):
        choose_solid_fillet(cover.thickness, frame(0.15e-3))


def rounding(shape):
    """What a result says of the shape's edges on a cover of 2 mm."""
    return state_rounding(shape, choose_solid_fillet(2e-3, shape))["edge"]


def test_walls_that_the_rounding_leaves_nothing_of_are_told():
    leg = [(-4e-3, -4e-3), (-0.2e-3, -4e-3), (-0.2e-3, -7e-3), (0.2e-3, -7e-3), (0.2e-3, -4e-3), (4e-3, -4e-3)]
    with_leg = Prism(points=(*leg, (4e-3, 4e-3), (-4e-3, 4e-3)))
    assert "walls thinner than 0.8 mm are left out" in rounding(with_leg)
    for whole in (H, frame(2e-3), LetterH(size=(12e-3, 16e-3), bar=4e-3)):
        assert "left out" not in rounding(whole)


def test_radius_and_elements_are_refined_in_turn_or_at_once():
    box = Box(size=(4e-3, 4e-3, 4e-3))
    first, narrow, fine = choose_solid_grids(2e-3, box, in_turn=True)
    assert (first.count, first.fillet) == (narrow.count, 2 * narrow.fillet) == (2, fine.fillet)
    assert fine.count == 3
    at_once = choose_solid_grids(2e-3, box, in_turn=False)
    assert [grid.count for grid in at_once] == [2, 3, 4]
    assert [grid.count * grid.fillet for grid in at_once] == pytest.approx([4 * choose_solid_fillet(2e-3, box)] * 3)


@pytest.mark.parametrize(
    ("indenter", "friction", "size", "yaw", "expected"),
    [
        (Box(size=(4e-3, 6e-3, 4e-3)), 0.4, (0.02, 0.02), 0.0, 2.0),
        (Box(size=(4e-3, 6e-3, 4e-3)), 0.4, (0.02, 0.02), 0.1, 3.0),
        (Box(size=(4e-3, 6e-3, 4e-3)), 0.0, (0.02, 0.02), 0.0, 0.0),
        (Cylinder(radius=2e-3), np.inf, (0.02, 0.02), 0.0, 3.0),
        (Cylinder(radius=2e-3), np.inf, None, 0.0, 0.0),  # solved in the r-z plane
        (Sphere(radius=2e-3), np.inf, (0.02, 0.02), 0.0, 0.0),
    ],
)
def test_the_effect_of_the_radius_is_part_of_the_error_under_faces_that_rub(indenter, friction, size, yaw, expected):
    cover = make_cover(0.45, size=size)
    path = LoadingPath(cover=cover, indenter=indenter, targets=(1e-4,), control="depth", friction=friction)
    assert choose_edge_safety(path, Pose.planar(yaw=yaw)) == expected


def test_results_state_what_was_rounded():
    assert state_rounding(Sphere(radius=4e-3), 0.1e-3) == {}
    assert state_rounding(Roller(radius=4e-3, length=6e-3), 0.1e-3) == {
        "surface": "facets and edges rounded over 0.1 mm"
    }
    assert "rounded with 0.1 mm on the finest grid" in state_rounding(Cylinder(radius=4e-3), 0.1e-3)["edge"]
