"""Cells under an indenter: faces are measured, edges fall on edges of cells, thin walls and covers get more cells."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.small_strain_contact.frictionless import CellGrid, Face, choose_counts
from meshes import Box, Cylinder, Nut, Prism

L = Prism(points=((0, 0), (8e-3, 0), (8e-3, 2e-3), (3e-3, 2e-3), (3e-3, 9e-3), (0, 9e-3)))
THICK = 1.0


def measure(shape):
    return Face.measure(shape.gap, np.zeros(2), np.array(shape.footprint))


@pytest.mark.parametrize(
    ("shape", "area", "size"),
    [
        (L, 37e-6, (8e-3, 9e-3)),
        (Box(size=(60e-3, 1e-3, 5e-3)), 60e-6, (60e-3, 1e-3)),
        (Cylinder(radius=4e-3), np.pi * 16e-6, (8e-3, 8e-3)),
        (
            Nut(across=13e-3, bore=11e-3),
            (np.sqrt(3) / 2 * 169 - np.pi / 4 * 121) * 1e-6,
            (13 / np.cos(np.pi / 6) * 1e-3, 13e-3),
        ),
    ],
)
def test_area_and_size_of_a_face_are_measured(shape, area, size):
    face = measure(shape)
    assert face.area == pytest.approx(area, rel=2e-3)
    assert sorted(2 * face.half) == pytest.approx(sorted(size), rel=2e-3)


def test_walls_and_edges_of_a_letter_are_found():
    face = measure(L)
    assert face.walls == pytest.approx([3e-3, 2e-3], rel=0.02)
    found = [sorted(set(np.round(edges, 1)) - {0, 1}) for edges in face.edges]
    assert found == [[0.4], [0.2]]


def test_edges_of_a_letter_fall_on_edges_of_cells():
    face = measure(L)
    for cells in (64, 96, 144):
        counts = choose_counts(face.half, face, THICK, cells)
        grid = CellGrid.span(face.middle, face.half, counts)
        assert np.isfinite(L.gap(grid.x, grid.y)).sum() * grid.area == pytest.approx(37e-6, rel=2e-3)
        assert grid.match_area(L.gap, face).scale == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("wall", "places"), [(0.8e-3, [0.1, 0.9]), pytest.param(0.83e-3, [0.10375, 0.89625], marks=pytest.mark.slow)]
)
def test_each_edge_of_a_thin_frame_is_found_once(wall, places):
    outer, hole = ([(s * a, t * a) for s, t in ((1, 1), (-1, 1), (-1, -1), (1, -1))] for a in (4e-3, 4e-3 - wall))
    face = measure(Prism(points=tuple(outer), holes=(tuple(hole),)))
    for edges in face.edges:
        assert edges == pytest.approx(places, abs=1e-4)


def test_a_face_that_no_sample_meets_is_refused():
    with pytest.raises(ValueError, match="walls are too thin"):
        Face.measure(lambda x, y: np.full(x.shape, np.inf), np.zeros(2), np.ones(2))


def make_face(half, walls, edges=()):
    """A face with walls of given widths, and edges at given places along x."""
    return Face(
        middle=np.zeros(2), half=np.array(half), area=1.0, walls=np.array(walls), edges=(np.array(edges), np.empty(0))
    )


@pytest.mark.parametrize(
    ("half", "face", "layer", "cells", "counts"),
    [
        # Four cells per layer on nine times the pattern, at least sixteen.
        ((5e-3, 1e-3), None, 0.2e-3, 64, (4 * 23, 64)),
        ((5e-3, 1e-3), None, 0.2e-3, 144, (9 * 23, 144)),
        ((5e-3, 1e-3), None, np.inf, 96, (96, 96)),
        # No more than 96 along an axis and 1600 in all, in proportion.
        ((20e-3, 1e-3), None, 0.1e-3, 16, (96, 16)),
        ((5e-3, 4e-3), None, 0.03e-3, 16, (40, 40)),
        ((30e-3, 4e-3), None, 0.1e-3, 16, (66, 25)),
        # Forty-five cells per wall on nine times the pattern.
        ((5e-3, 1e-3), ([5e-3, 1e-3], [2.4e-3, 2e-3]), np.inf, 64, (4 * 21, 64)),
        ((5e-3, 4e-3), ([5e-3, 4e-3], [1e-3, 0.5e-3]), np.inf, 64, (4 * 32, 4 * 51)),
        # An edge at two fifths needs a multiple of five, one at the border none.
        ((1e-3, 1e-3), ([1e-3, 1e-3], [1e-3, 1e-3], [0.4]), np.inf, 64, (65, 64)),
        ((1e-3, 1e-3), ([1e-3, 1e-3], [1e-3, 1e-3], [0.0, 1.0]), np.inf, 64, (64, 64)),
        ((1e-3, 1e-3), ([1e-3, 1e-3], [1e-3, 1e-3], [0.25, 1 / 3]), np.inf, 64, (72, 64)),
    ],
)
def test_numbers_of_cells_follow_the_layer_the_walls_and_the_edges(half, face, layer, cells, counts):
    made = None if face is None else make_face(*face)
    assert tuple(choose_counts(np.array(half), made, layer, cells)) == counts


def test_cells_are_scaled_about_their_middle_to_the_area_of_a_face():
    """A disk of radius 1 on 8 x 6 cells around (2, -1)."""
    grid = CellGrid.span(np.array([2.0, -1.0]), np.array([1.0, 1.5]), np.array([8, 6]))
    assert (grid.cell, grid.area) == ((0.25, 0.5), 0.125)
    assert (grid.x[[0, -1], 0].tolist(), grid.y[0, [0, -1]].tolist()) == ([1.125, 2.875], [-2.25, 0.25])

    def gap(x, y):
        return np.where(np.hypot(x - 2, y + 1) < 1, 0.0, np.inf)

    face = Face(middle=np.array([2.0, -1.0]), half=np.ones(2), area=np.pi, walls=np.ones(2), edges=(np.empty(0),) * 2)
    inside = np.isfinite(gap(grid.x, grid.y)).sum()
    scaled = grid.match_area(gap, face)
    assert scaled.scale == pytest.approx(np.sqrt(np.pi / (0.125 * inside)))
    assert inside * scaled.area == pytest.approx(np.pi)
    np.testing.assert_allclose(scaled.x - 2, scaled.scale * (grid.x - 2))
    np.testing.assert_allclose(scaled.y + 1, scaled.scale * (grid.y + 1))
    np.testing.assert_allclose(scaled.unscaled, (grid.x, grid.y))
    with pytest.raises(ValueError, match=r"no cell of 5e\+02 mm has its middle"):
        grid.match_area(lambda x, _y: np.full(x.shape, np.inf), face)


@pytest.mark.parametrize("seed", range(6))
def test_the_first_number_of_cells_that_fits_all_edges_is_taken_or_the_best_one(seed):
    """Up to a fifth more cells, each edge within a fiftieth of a cell."""
    rng = np.random.default_rng(seed)
    places = np.sort(rng.uniform(0.05, 0.95, 1 + seed % 3))
    face = make_face([1e-3, 1e-3], [1e-3, 1e-3], places)
    found, other = choose_counts(np.array([1e-3, 1e-3]), face, THICK, 112)
    tried = range(112, 135)
    misses = [max(abs(n * e - round(n * e)) for e in places) for n in tried]
    fits = [n for n, miss in zip(tried, misses, strict=True) if miss < 0.02]
    assert found == (fits[0] if fits else tried[int(np.argmin(misses))])
    assert other == 112


@pytest.mark.parametrize(("neck", "wall"), [(5e-3, 10e-3), (6e-3, 1e-3)])
def test_walls_on_less_than_a_tenth_of_a_face_do_not_count(neck, wall):
    """A bar of 10 mm x 5 mm with a neck 1 mm wide, on 1 / 11 or on 6 / 56 of the face."""
    outline = [(-5, 0), (5, 0), (5, 5), (0.5, 5), (0.5, 5 + 1e3 * neck), (-0.5, 5 + 1e3 * neck), (-0.5, 5), (-5, 5)]
    face = measure(Prism(points=tuple((1e-3 * x, 1e-3 * y) for x, y in outline)))
    assert face.walls[0] == pytest.approx(wall, rel=0.02)
    assert face.area == pytest.approx(50e-6 + 1e-3 * neck, rel=2e-3)


@pytest.mark.parametrize(("step", "found"), [(0.4e-3, False), (0.6e-3, True)])
def test_a_step_of_more_than_a_twentieth_of_the_width_is_an_edge(step, found):
    """A bar of 10 mm x 8 mm whose right half is lower."""
    outline = ((-5e-3, 0.0), (5e-3, 0.0), (5e-3, 8e-3 - step), (1e-3, 8e-3 - step), (1e-3, 8e-3), (-5e-3, 8e-3))
    outline = tuple((x, 10 / 8 * y) for x, y in outline)
    edges = measure(Prism(points=outline)).edges[0]
    assert (np.abs(edges - 0.6).min(initial=1.0) < 2e-3) == found


def test_an_edge_that_is_spread_over_samples_is_none():
    """The slanted side of a trapezoid changes the width as much as a step, over many samples."""
    face = measure(Prism(points=((-5e-3, 0.0), (5e-3, 0.0), (2e-3, 8e-3), (-5e-3, 8e-3))))
    assert not any(0.01 < edge < 0.99 for each in face.edges for edge in each)
