"""Contact areas from pressures of known shape, located below the size of a cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.small_strain_contact.frictionless import measure_area


def grid(cells, half):
    offset = ((np.arange(cells) + 0.5) / cells * 2 - 1) * half
    return *np.meshgrid(offset, offset, indexing="ij"), (2 * half / cells, 2 * half / cells)


@given(radius=st.floats(0.5, 0.9), ratio=st.floats(0.5, 1))
@settings(max_examples=40, deadline=None)
def test_an_elliptical_pressure_has_the_area_of_its_ellipse(radius, ratio):
    x, y, cell = grid(60, 1.0)
    pressure = np.sqrt(np.maximum(0, 1 - (x / radius) ** 2 - (y / radius / ratio) ** 2))
    assert measure_area(pressure, np.ones_like(x, dtype=bool), cell) == pytest.approx(
        np.pi * radius**2 * ratio, rel=1e-3
    )


def test_at_the_edge_of_the_indenter_cells_count_as_a_whole():
    x, y, cell = grid(40, 1.0)
    allowed = np.abs(x) < 0.5
    pressure = np.where(allowed, np.sqrt(np.maximum(0, 0.64 - y**2)), 0.0)
    assert measure_area(pressure, allowed, cell) == pytest.approx(1.6, rel=2e-3)


def test_few_cells_and_odd_pressures_count_as_a_whole():
    pressure = np.zeros((8, 8))
    pressure[3:5, 3:5] = 1.0
    assert measure_area(pressure, np.ones((8, 8), dtype=bool), (2.0, 3.0)) == 24.0
    even = np.zeros((20, 20))
    even[4:16, 4:16] = 1.0
    assert measure_area(even, np.ones((20, 20), dtype=bool), (1.0, 1.0)) == 144.0


@pytest.mark.parametrize(("lean", "wave"), [((0.3, -0.2), 1.5), ((-0.25, 0.3), 2.0), ((0.1, 0.3), 1.0)])
def test_a_leaning_pressure_has_the_area_of_its_ellipse_however_it_is_mirrored(lean, wave):
    """The square of the pressure is no quadratic polynomial, so that the fit depends on where its cells lie."""
    x, y, cell = grid(48, 1.0)
    pressure = np.sqrt(np.maximum(0, 1 - (x / 0.8) ** 2 - (y / 0.6) ** 2))
    pressure *= 1.5 + lean[0] * x + lean[1] * np.sin(wave * y)
    for image in (np.asarray, np.flipud, np.fliplr, np.transpose):
        area = measure_area(image(pressure), np.ones_like(x, dtype=bool), cell)
        assert area == pytest.approx(np.pi * 0.8 * 0.6, rel=3e-4)


def count_parts(pressure, allowed, cell):
    """Area by the rules of `measure_area`, cell by cell: the fit around the nearest cell tells what each part is."""
    rows, columns = pressure.shape
    near = [(i, j) for i in range(-2, 3) for j in range(-2, 3)]
    powers = np.array([[1, i, j, i * i, j * j, i * j] for i, j in near])
    touching = {(i, j) for i, j in np.argwhere(pressure > 0)}
    known = [each for each in touching if all((each[0] + i, each[1] + j) in touching for i, j in near)]
    total = 0.0
    for i, j in np.argwhere(allowed):
        around = [(i + u, j + v) for u, v in near if 0 <= i + u < rows and 0 <= j + v < columns]
        if (i, j) in touching and all(each in touching or not allowed[each] for each in around):
            total += 1
        elif any(each in touching for each in around if max(abs(each[0] - i), abs(each[1] - j)) < 2):
            distances = [np.hypot((i - u) * cell[0], (j - v) * cell[1]) for u, v in known]
            first, second = np.sort(distances)[:2]
            assert second > first * (1 + 1e-9)
            u, v = known[int(np.argmin(distances))]
            values = [pressure[u + a, v + b] ** 2 for a, b in near]
            fit = np.linalg.lstsq(powers.astype(float), values, rcond=None)[0]
            x, y = ((np.indices((12, 12)) + 0.5) / 12 - 0.5) + np.array([i - u, j - v])[:, None, None]
            part = (fit @ np.array([1 + 0 * x, x, y, x * x, y * y, x * y]).reshape(6, -1) > 0).mean()
            inside = (i, j) in touching
            total += {(1.0, False): 0.0, (0.0, True): 1.0}.get((float(part), inside), part)
    return total * cell[0] * cell[1]


@pytest.mark.parametrize("cell", [(1.0, 2.3), (3.1, 1.0), (0.7, 0.9)])
@pytest.mark.parametrize(("turn", "middle"), [(0.4, 8.6), (-0.7, 8.6), (0.4, 13.1)])
def test_the_edge_in_an_oblong_cell_is_told_by_the_nearest_surrounded_cell(cell, turn, middle):
    """A turned ellipse of uneven pressure, cut off by the edge of the indenter, on 22 x 18 oblong cells.

    The last one ends at the border of the cells too.
    """
    i, j = np.indices((22, 18)) - np.array([10.3, middle])[:, None, None]
    x, y = np.cos(turn) * i + np.sin(turn) * j, np.cos(turn) * j - np.sin(turn) * i
    allowed = i + 0.21 * j < 6.4
    pressure = np.sqrt(np.maximum(0, 1 - (x / 8.2) ** 2 - (y / 6.7) ** 2)) * (1.4 + 0.06 * i - 0.4 * np.sin(0.5 * j))
    pressure = np.where(allowed, pressure, 0.0)
    assert measure_area(pressure, allowed, cell) == pytest.approx(count_parts(pressure, allowed, cell), rel=1e-9)
