"""Cells under an indenter: faces are measured, edges fall on edges of cells, thin walls and covers get more cells."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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


@pytest.mark.parametrize(("wall", "places"), [(0.8e-3, [0.1, 0.9]), (0.83e-3, [0.10375, 0.89625])])
def test_each_edge_of_a_thin_frame_is_found_once(wall, places):
    outer, hole = ([(s * a, t * a) for s, t in ((1, 1), (-1, 1), (-1, -1), (1, -1))] for a in (4e-3, 4e-3 - wall))
    face = measure(Prism(points=tuple(outer), holes=(tuple(hole),)))
    for edges in face.edges:
        assert edges == pytest.approx(places, abs=1e-4)


def test_a_round_face_has_no_straight_edges():
    for edges in measure(Cylinder(radius=4e-3)).edges:
        assert edges.size == 0


@given(aspect=st.floats(1, 60), layer=st.floats(0.1e-3, 20e-3))
@settings(max_examples=50, deadline=None)
def test_slender_and_thin_ones_are_resolved(aspect, layer):
    half = np.array([5e-3, 5e-3 / aspect])
    counts = choose_counts(half, None, layer, 144)
    assert (counts >= 144).all()
    if layer > 0.4e-3:
        assert (2 * half / counts <= 1.01 * layer / 4).all()
    assert (choose_counts(half, None, layer, 96) * 1.5 == counts).all()


HALF = np.array([4e-3, 3e-3])


def count_pattern(walls, layer):
    """Numbers of cells of the pattern, which the grid of 144 cells repeats nine times.

    The widths of walls are given over those of the face.
    """
    face = Face(middle=np.zeros(2), half=HALF, area=1.0, walls=2 * HALF * walls, edges=(np.empty(0), np.empty(0)))
    pattern, rest = np.divmod(choose_counts(HALF, face, layer, 144), 9)
    assert (rest == 0).all()
    return pattern


@given(walls=st.tuples(*[st.floats(1 / 12, 1)] * 2), layer=st.floats(0.06e-3, 1e-3))
def test_as_few_cells_as_needed_lie_across_a_wall_and_through_the_top_layer(walls, layer):
    """45 cells across a wall and 4 per layer; with a cell less in each repetition there would be fewer."""
    pattern = count_pattern(walls, layer)
    wanted = np.maximum(45 / np.array(walls), 4 * 2 * HALF / layer)
    assert (9 * pattern >= wanted * (1 - 1e-9)).all()
    assert ((9 * (pattern - 1) < wanted * (1 + 1e-9)) | (pattern == 16)).all()


@given(walls=st.tuples(*[st.floats(1 / 19, 1 / 12)] * 2))
def test_a_pattern_for_thin_walls_has_about_3600_cells_in_the_same_ratio(walls):
    x, y = count_pattern(walls, THICK)
    assert (x - 1) * (y - 1) < 3600 * (1 + 1e-9)
    assert x * y >= 3600 * (1 - 1e-9)
    assert (x - 1) / y <= walls[1] / walls[0] <= x / (y - 1)


def test_a_face_that_no_sample_meets_is_refused():
    with pytest.raises(ValueError, match="walls are too thin"):
        Face.measure(lambda x, y: np.full(x.shape, np.inf), np.zeros(2), np.ones(2))
