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
