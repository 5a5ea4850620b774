import dataclasses

import numpy as np
import pytest

from fastmodel.pressure.cell_grid import BaseForces, CellGrid
from meshes import TexelArray
from meshes.catalogue import ARRAYS
from tests.support.cover_data import WTS, cells
from tests.support.posed_bodies import GRID

CELLS = cells()
BASE = BaseForces(CELLS, GRID, WTS)


@pytest.mark.parametrize("array", [WTS, TexelArray.grid(3, 5, (2e-3, 5e-3))], ids=["square", "oblong"])
def test_cells_belong_to_the_texel_over_them(array):
    grid = CellGrid.over(array, 4, 1)
    row, column = np.divmod(np.arange(grid.rows * grid.columns), grid.columns)
    texel = grid.find_texel(row, column)
    x, y = grid.low[0] + (column + 0.5) * grid.edge[0], grid.low[1] + (row + 0.5) * grid.edge[1]
    apart = np.abs(np.column_stack([x, y])[:, None] - array.centres[:, :2])
    expected = (apart < np.array(array.pitch) / 2).all(axis=2)
    assert expected.sum() == 16 * array.count
    np.testing.assert_array_equal(texel >= 0, expected.any(axis=1))
    np.testing.assert_array_equal(texel[texel >= 0], expected.argmax(axis=1)[texel >= 0])


def test_force_at_the_base_is_the_sum_of_the_influence_of_every_cell():
    rng = np.random.default_rng(0)
    window, origin = rng.uniform(0, 1, (9, 11)), (13, 5)
    found = WTS.image(BASE.from_window(window, origin))
    expected = np.zeros((14, 6))
    for i, j in np.ndindex(window.shape):
        for r, c in np.ndindex(expected.shape):
            a = origin[0] + i - GRID.margin[0] - 4 * r + CELLS.reach
            b = origin[1] + j - GRID.margin[1] - 4 * c + CELLS.reach
            if 0 <= a < len(CELLS.influence) and 0 <= b < len(CELLS.influence):
                expected[r, c] += window[i, j] * CELLS.influence[a, b]
    np.testing.assert_allclose(found, expected, atol=1e-5 * expected.max())


def test_uniform_forces_on_texels_arrive_as_forces_on_their_cells():
    forces = np.zeros(84)
    forces[40] = 2.0
    s = CELLS.per_texel
    window = np.full((s, s), 2.0 / s**2)
    there = BASE.from_window(window, (GRID.margin[0] + s * (40 // 6), GRID.margin[1] + s * (40 % 6)))
    np.testing.assert_allclose(BASE.from_texels(forces), there, atol=1e-12)


def test_masked_texels_read_zero():
    array = ARRAYS["sdh2-distal"]
    data = cells(array)
    grid = CellGrid.over(array, data.per_texel, 1)
    found = BaseForces(data, grid, array).from_texels(np.ones(array.count))
    assert (found[~array.active] == 0).all()
    assert (found[array.active] > 0).all()


@pytest.mark.parametrize("origin", [(-5, 0), (0, -7), (GRID.rows, 0), (0, GRID.columns), (-9, -9)])
def test_a_window_beyond_the_grid_reaches_no_texel(origin):
    assert (BASE.from_window(np.zeros((5, 7)), origin) == 0).all()


def test_a_table_of_all_cells_and_texels_is_applied_to_a_window():
    random = np.random.default_rng(3)
    array = TexelArray.grid(2, 3, 4e-3, active=np.arange(6) != 1)
    table = random.uniform(0, 1, (6, 8, 12))
    grid = CellGrid.over(array, 4, 2)
    base = BaseForces(dataclasses.replace(cells(array), table=table), grid, array)
    window = random.uniform(0, 1, (5, 9))
    found = base.from_window(window, (grid.margin[0] - 1, grid.margin[1] + 4))
    expected = np.einsum("tij,ij->t", table[:, :4, 4:12], window[1:, :8])  # a row and a column lie in the margin
    np.testing.assert_allclose(found, np.where(array.active, expected, 0.0))
    np.testing.assert_allclose(
        base.from_texels(np.arange(6.0)),
        np.where(array.active, table.reshape(6, 2, 4, 3, 4).mean(axis=(2, 4)).reshape(6, 6) @ np.arange(6.0), 0.0),
    )
