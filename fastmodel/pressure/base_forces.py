"""From forces on cells of the top to forces on texels at the base: one convolution, taken at the texels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.cover_kernels import CoverCells
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]


class _Window(NamedTuple):
    """A window of cells: its part within the grid, where that begins, and factors to the texels that it reaches.

    The factors have shapes (texel rows * terms, rows) and (terms * columns, texel columns).
    """

    rows: slice
    columns: slice
    first: tuple[int, int]
    down: int
    along: FloatArray
    across: FloatArray
    texels: tuple[slice, slice]


class BaseForces:
    """The influence of cells on the texels of one array, over windows of cells."""

    def __init__(self, cells: CoverCells, grid: CellGrid, array: TexelArray) -> None:
        """Factorise the influence and lay it out over the whole grid, one axis at a time; a table is taken as it is."""
        self._cells, self._grid, self._array = cells, grid, array
        along, across = cells.influence_factors
        self._terms, self._dead = len(along), None if array.active.all() else ~array.active
        self._rows = _placed(along, array.rows, grid.rows, cells, grid.margin)
        self._kept: tuple[tuple[tuple[int, int], tuple[int, ...]], _Window] | None = None
        self._columns = _placed(across, array.columns, grid.columns, cells, grid.margin)

    def of_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Force on each texel, masked ones zero, shape (n,) [N].

        Args:
            forces: On a window of cells, which may reach beyond the grid where it is zero, shape (rows, columns) [N].
            origin: Row and column of the window's first cell in the grid.
        """
        if self._kept is None or self._kept[0] != (origin, forces.shape):
            self._kept = ((origin, forces.shape), self._window(origin, forces.shape))
        window = self._kept[1]
        forces = forces[window.rows, window.columns]
        if self._cells.table is not None:
            return self._of_table(self._cells.table, forces, window.first)
        texels = np.zeros((self._array.rows, self._array.columns))
        if window.along.size and window.across.size:
            first = window.along.dot(forces).reshape(window.down, -1)  # all terms in one product each way
            texels[window.texels] = first.dot(window.across)
        return self._felt(texels.ravel())

    def _window(self, origin: tuple[int, int], shape: tuple[int, ...]) -> _Window:
        """Factors of a window, which may reach beyond the grid: windows carry a rim of empty cells."""
        (row, column), grid = origin, self._grid
        top, left = max(0, -row), max(0, -column)
        rows, columns = slice(top, max(top, grid.rows - row)), slice(left, max(left, grid.columns - column))
        row, column = row + top, column + left
        high, wide = len(range(shape[0])[rows]), len(range(shape[1])[columns])
        r0, r1 = self._near(row, high, self._array.rows)
        c0, c1 = self._near(column, wide, self._array.columns)
        along = self._rows[:, r0 : max(r0, r1), row : row + high].transpose(1, 0, 2).reshape(-1, high)
        across = self._columns[:, c0 : max(c0, c1), column : column + wide].transpose(0, 2, 1)
        return _Window(
            rows, columns, (row, column), r1 - r0, along, across.reshape(-1, max(0, c1 - c0)), np.s_[r0:r1, c0:c1]
        )

    def _of_table(self, table: FloatArray, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """The part of a window that lies on the array, through the table: beyond it no texel feels anything."""
        row, column = (start - self._grid.margin for start in origin)
        top, left = max(0, -row), max(0, -column)
        forces = forces[top : max(0, table.shape[1] - row), left : max(0, table.shape[2] - column)]
        row, column = row + top, column + left
        part = table[:, row : row + forces.shape[0], column : column + forces.shape[1]]
        return self._felt(np.tensordot(part, forces, 2))

    def _felt(self, flat: FloatArray) -> FloatArray:
        if self._dead is not None:
            flat[self._dead] = 0.0
        return flat

    def of_texels(self, contact_forces: FloatArray) -> FloatArray:
        """The same for forces spread evenly over each texel's cells, shape (n,) to (n,) [N]."""
        s = self._cells.per_texel
        image = contact_forces.reshape(self._array.rows, self._array.columns)
        even = np.kron(image, np.full((s, s), 1 / s**2))
        return self.of_window(even, (self._grid.margin, self._grid.margin))

    def _near(self, start: int, length: int, count: int) -> tuple[int, int]:
        """First and one past the last texel along one axis that cells of a window reach."""
        s, reach = self._cells.per_texel, self._cells.reach
        first = (start - self._grid.margin - reach - s) // s + 1
        last = (start + length - 1 - self._grid.margin + reach) // s + 1
        return max(0, first), min(count, last)


def _placed(factor: FloatArray, texels: int, cells: int, data: CoverCells, margin: int) -> FloatArray:
    """A factor along one axis, `[term, texel, cell]`."""
    index = np.arange(cells) - margin - data.per_texel * np.arange(texels)[:, None] + data.reach
    inside = (index >= 0) & (index < factor.shape[1])
    return np.where(inside, factor[:, np.clip(index, 0, factor.shape[1] - 1)], 0.0)
