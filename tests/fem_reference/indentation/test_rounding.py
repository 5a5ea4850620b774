"""Rounded edges: their radius on each grid, walls that are too thin for it, and what a result states."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation.finite_strain import (
    choose_edge_safety,
    choose_fillet,
    choose_solid_fillet,
    choose_solid_grids,
    scale_fillet,
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


@pytest.mark.parametrize(
    ("thickness", "radius", "depth", "expected"),
    [
        (2e-3, 5e-3, 0.0, 0.1e-3), (4e-3, 3e-3, 0.0, 0.15e-3),  # a twentieth of the smaller one
        (2e-3, 5e-3, 0.4e-3, 0.1e-3), (2e-3, 5e-3, 0.6e-3, 0.12e-3),  # from a quarter of the thickness on as the depth
        (2e-3, 5e-3, 1.2e-3, 0.24e-3), (2e-3, 5e-3, 1.9e-3, 0.24e-3),  # up to 0.6 of it
    ],
)  # fmt: skip
def test_the_edge_of_a_disk_is_a_twentieth_of_its_size_and_wider_deep_in_the_cover(thickness, radius, depth, expected):
    assert choose_fillet(thickness, Cylinder(radius=radius), depth) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("thickness", "shape", "expected"),
    [
        (2e-3, Box(size=(8e-3, 6e-3, 4e-3)), 0.4e-3), (4e-3, Box(size=(8e-3, 6e-3, 4e-3)), 0.6e-3),
        (4e-3, Roller(radius=1e-3, length=6e-3), 0.2e-3),
        (3e-3, frame(2e-3), 0.45e-3), (3e-3, frame(0.5e-3), 0.1e-3),  # thickest in the corners, at a sample of 81
    ],
)  # fmt: skip
def test_the_edge_in_three_dimensions_is_a_fifth_of_the_thickness_the_half_width_or_the_wall(
    thickness, shape, expected
):
    assert choose_solid_fillet(thickness, shape) == pytest.approx(expected)


@pytest.mark.parametrize(("wall", "refused"), [(0.15e-3, True), (0.5e-3, False)])
def test_the_thickest_wall_must_reach_a_twentieth_of_the_footprint(wall, refused):
    ring = frame(wall)
    if refused:
        with pytest.raises(ValueError, match="no wall of the indenter's face is wider than about"):
            choose_solid_fillet(2e-3, ring)
    else:
        assert choose_solid_fillet(2e-3, ring) > 0


def test_edges_refined_in_turn_are_three_quarters_and_three_eighths_of_those_refined_at_once():
    box = Box(size=(8e-3, 6e-3, 4e-3))
    found = choose_solid_grids(2e-3, box, in_turn=True)
    assert [(grid.count, grid.fillet) for grid in found] == [
        (2, pytest.approx(0.3e-3)), (2, pytest.approx(0.15e-3)), (3, pytest.approx(0.3e-3)),
    ]  # fmt: skip
    assert scale_fillet(0.1e-3, 8, (2, 4, 6)) == pytest.approx(0.075e-3)


@pytest.mark.parametrize(("length", "told"), [(0.2e-3, False), (0.6e-3, False), (1.2e-3, True), (3e-3, True)])
def test_a_thin_leg_is_lost_where_it_reaches_far_beyond_the_inset_of_its_face(length, told):
    """The inset of 0.5 mm ends 0.4 mm above the root of a leg 0.6 mm wide: the tips lie 1.2 to 6.8 radii away."""
    leg = [(-4e-3, -4e-3), (-0.3e-3, -4e-3), (-0.3e-3, -4e-3 - length), (0.3e-3, -4e-3 - length), (0.3e-3, -4e-3)]
    shape = Prism(points=(*leg, (4e-3, -4e-3), (4e-3, 4e-3), (-4e-3, 4e-3)))
    assert ("left out" in state_rounding(shape, 0.5e-3)["edge"]) == told
    assert "left out" not in state_rounding(Cylinder(radius=0.1e-3), 0.5e-3)["edge"]
