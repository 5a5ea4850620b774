"""The contact grid of a flat array, and the forces on texels, at the cover's top and base, under forces on its cells.

A cell is a square or rectangle of the contact grid; whole numbers of cells divide each texel pitch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fastmodel.surface import CoverCells
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """The contact grid: cells that divide the pitches of a flat array and of a margin around the array.

    Attributes:
        per_texel: Number of cells along each texel pitch [-].
        rows: Number of rows of cells, margin included [-].
        columns: Number of columns of cells, margin included [-].
        margin: Number of cells by which the grid extends beyond the array on each side [-].
        edge: Edge lengths of a cell along x and y [m].
        low: x and y of the grid's lowest corner in the array's frame, shape (2,) [m].
        texel_columns: Number of columns of texels [-].
    """

    per_texel: int
    rows: int
    columns: int
    margin: int
    edge: tuple[float, float]
    low: FloatArray
    texel_columns: int

    @classmethod
    def over(cls, array: TexelArray, per_texel: int, margin: int) -> CellGrid:
        """Make the grid that divides a flat array, and a margin of `margin` pitches around the array, into cells."""
        edge = (array.pitch[0] / per_texel, array.pitch[1] / per_texel)
        beyond = margin * per_texel
        half_pitch = np.array(array.pitch) / 2
        return cls(
            per_texel=per_texel,
            rows=array.rows * per_texel + 2 * beyond,
            columns=array.columns * per_texel + 2 * beyond,
            margin=beyond,
            edge=edge,
            low=array.centres[0, :2] - half_pitch - beyond * np.array(edge),
            texel_columns=array.columns,
        )

    @property
    def texels(self) -> int:
        """Number of texels of the array [-]."""
        return (self.rows - 2 * self.margin) * (self.columns - 2 * self.margin) // self.per_texel**2

    @cached_property
    def arrays(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """The grid as kernels take it: (columns, rows) [-], lowest corner [m] and edges of a cell [m], each (2,)."""
        return np.array([self.columns, self.rows]), self.low, np.array(self.edge)

    def sum_on_texels(self, row: IntArray, column: IntArray, forces: FloatArray) -> FloatArray:
        """Sum forces on m cells over the texels that the cells belong to; cells in the margin belong to no texel.

        Args:
            row: Row of each cell, shape (m,).
            column: Column of each cell, shape (m,).
            forces: Force on each cell, shape (m,) [N].

        Returns:
            Force on each of n texels, shape (n,) [N].
        """
        slot = self._slots.take(row * self.columns + column)
        return np.bincount(slot, forces, self.texels + 1)[1:].astype(np.float64, copy=False)

    def divide_points(self, points: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Divide point forces bilinearly among the four nearest cells; only forces that press count.

        Args:
            points: Positions x, y in the frame of the grid [m] and forces [N], shape (k, 3).

        Returns:
            Row and column of 4 k cells, and the force on each of them [N], each of shape (4 k,).
        """
        last = np.array([self.columns, self.rows]) - 1
        place = np.clip((points[:, :2] - self.low) / self.edge - 0.5, 0, last)
        first = np.minimum(place.astype(np.int64), np.maximum(last - 1, 0))
        share = place - first
        pressed = np.maximum(points[:, 2], 0.0)
        row, column, forces = [], [], []
        for j, i in np.ndindex(2, 2):
            column.append(np.minimum(first[:, 0] + i, last[0]))
            row.append(np.minimum(first[:, 1] + j, last[1]))
            forces.append(pressed * np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1]))
        return np.concatenate(row), np.concatenate(column), np.concatenate(forces)

    def shift_window(
        self, forces: FloatArray, origin: tuple[int, int], centre: FloatArray
    ) -> tuple[FloatArray, tuple[int, int]]:
        """Shift forces on a window of cells by less than a cell, so that they act around a given centre.

        Each force is divided bilinearly among four cells.  If the centre is a cell or more away, nothing is shifted.

        Args:
            forces: Forces on a window (rectangle) of cells, shape (rows, columns) [N].
            origin: Row and column of the window's first cell in the grid.
            centre: Wanted centre of the forces in the array's frame, shape (2,) [m].

        Returns:
            Forces on a window with one more cell on each side, and the row and column of its first cell.
        """
        total = forces.sum()
        column = (forces.sum(axis=0) @ np.arange(forces.shape[1])) / total + origin[1] + 0.5
        row = (forces.sum(axis=1) @ np.arange(forces.shape[0])) / total + origin[0] + 0.5
        x, y = (centre - self.low) / self.edge - (column, row)
        if not max(abs(x), abs(y)) < 1:
            return forces, origin
        wide = np.pad(forces, 1)
        wide = (1 - abs(x)) * wide + abs(x) * np.roll(wide, 1 if x > 0 else -1, axis=1)
        wide = (1 - abs(y)) * wide + abs(y) * np.roll(wide, 1 if y > 0 else -1, axis=0)
        return wide, (origin[0] - 1, origin[1] - 1)

    @cached_property
    def _slots(self) -> IntArray:
        """Index of each cell's texel plus one, and 0 for cells in the margin, shape (rows * columns,)."""
        return self.find_texel(*np.divmod(np.arange(self.rows * self.columns), self.columns)) + 1

    def find_texel(self, row: IntArray, column: IntArray) -> IntArray:
        """Find the index of the texel that each cell belongs to, -1 for cells in the margin, same shape as `row`."""
        i, j = row - self.margin, column - self.margin
        inside = (i >= 0) & (j >= 0) & (i < self.rows - 2 * self.margin) & (j < self.columns - 2 * self.margin)
        return np.asarray(np.where(inside, i // self.per_texel * self.texel_columns + j // self.per_texel, -1))


class _Window(NamedTuple):
    """The factors of the influence (force on a texel per unit force on a cell) for one window of the contact grid.

    A window is a rectangle of cells.

    Attributes:
        inside: Rows and columns of the window that lie within the grid.
        first: Row and column in the grid of the first cell of the window that lies within the grid.
        texels: Rows and columns of the texels that forces on the window reach.
        along: Factors from rows of cells to rows of texels, for every term of the low-rank factorisation, shape (texel
            rows * terms, rows) [-].
        across: Factors from columns of cells to columns of texels, shape (terms * columns, texel columns) [-].
    """

    inside: tuple[slice, slice]
    first: tuple[int, int]
    texels: tuple[slice, slice]
    along: FloatArray
    across: FloatArray


class BaseForces:
    """The operator from forces on cells at the top of the cover to forces on texels at the base of the cover.

    The influence, which is the force on a texel per unit force on a cell, depends on the distances between texel and
    cell along rows and along columns.  A low-rank factorisation writes the influence as a sum of products of row
    factors and column factors, so that two matrix products give the texel forces under a window (rectangle) of cells.
    For a cover with free side edges this form does not exist, and its table of all cells and texels is applied instead.
    """

    def __init__(self, cells: CoverCells, grid: CellGrid, array: TexelArray) -> None:
        """Tabulate the factors of the influence between all texels and all cells of the grid.

        Args:
            cells: Compliance and influence of the cover.
            grid: The contact grid.
            array: The texels.
        """
        self._cells, self._grid, self._array = cells, grid, array
        along, across = cells.influence_factors
        beyond = (grid.margin, grid.margin)
        # the table contains no cells in the margin; a force in the margin then reaches no texel
        self._table = None if cells.table is None else np.pad(cells.table, ((0, 0), beyond, beyond))
        self._masked = None if array.active.all() else ~array.active
        self._rows = _lay_out_factor(along, array.rows, grid.rows, cells, grid.margin)
        self._columns = _lay_out_factor(across, array.columns, grid.columns, cells, grid.margin)
        self._window: tuple[tuple[tuple[int, int], tuple[int, ...]], _Window] | None = None

    def from_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Compute the forces on n texels at the base under forces on a window of cells, shape (n,) [N].

        Forces on masked texels are set to zero.

        Args:
            forces: Forces on a window (rectangle) of cells, shape (rows, columns).  The window may extend beyond the
                grid; forces on cells outside the grid must be zero [N].
            origin: Row and column of the window's first cell in the grid.
        """
        if self._window is None or self._window[0] != (origin, forces.shape):
            self._window = ((origin, forces.shape), self._build_window(origin, forces.shape))
        window = self._window[1]
        forces = forces[window.inside]
        if self._table is not None:
            row, column = window.first
            part = self._table[:, row : row + forces.shape[0], column : column + forces.shape[1]]
            return self._mask(np.tensordot(part, forces, 2))
        texels = np.zeros((self._array.rows, self._array.columns))
        if window.along.size and window.across.size:
            terms = len(self._rows)
            products = window.along.dot(forces).reshape(-1, terms * forces.shape[1])
            texels[window.texels] = products.dot(window.across)
        return self._mask(texels.ravel())

    def from_texels(self, contact_forces: FloatArray) -> FloatArray:
        """Compute the forces on n texels at the base under contact forces on the texels, shape (n,) [N].

        Args:
            contact_forces: Forces, each distributed uniformly over the cells of a texel, shape (n,) [N].
        """
        s = self._cells.per_texel
        image = contact_forces.reshape(self._array.rows, self._array.columns)
        uniform = np.kron(image, np.full((s, s), 1 / s**2))
        return self.from_window(uniform, (self._grid.margin, self._grid.margin))

    def _build_window(self, origin: tuple[int, int], shape: tuple[int, ...]) -> _Window:
        """Select the factors of the influence for a window with given first cell (row, column) and shape."""
        row, rows, near_rows = self._clip(origin[0], shape[0], self._grid.rows, self._array.rows)
        column, columns, near_columns = self._clip(origin[1], shape[1], self._grid.columns, self._array.columns)
        height, width = rows.stop - rows.start, columns.stop - columns.start
        along = self._rows[:, near_rows, row : row + height].transpose(1, 0, 2)
        across = self._columns[:, near_columns, column : column + width].transpose(0, 2, 1)
        return _Window(
            inside=(rows, columns),
            first=(row, column),
            texels=(near_rows, near_columns),
            along=along.reshape(along.shape[0] * along.shape[1], height),
            across=across.reshape(across.shape[0] * width, across.shape[2]),
        )

    def _clip(self, start: int, length: int, cells: int, texels: int) -> tuple[int, slice, slice]:
        """Clip a window to the grid along one axis.

        Args:
            start: Index of the window's first cell in the grid.
            length: Number of cells of the window.
            cells: Number of cells of the grid.
            texels: Number of texels of the array.

        Returns:
            Index in the grid of the first cell within the grid; part of the window within the grid; and the texels
            that forces on the window reach.
        """
        skipped = max(0, -start)
        inside = slice(skipped, max(skipped, min(length, cells - start)))
        start, length = start + skipped, inside.stop - skipped
        s, reach, margin = self._cells.per_texel, self._cells.reach, self._grid.margin
        first = max(0, (start - margin - reach - s) // s + 1)
        last = min(texels, (start + length - 1 - margin + reach) // s + 1)
        return start, inside, slice(first, max(first, last))

    def _mask(self, texel_forces: FloatArray) -> FloatArray:
        """Set the forces on masked texels to zero."""
        if self._masked is not None:
            texel_forces[self._masked] = 0.0
        return texel_forces


def _lay_out_factor(factor: FloatArray, texels: int, cells: int, data: CoverCells, margin: int) -> FloatArray:
    """Tabulate the factors of the influence along one axis, shape (terms, texels, cells) [-].

    Args:
        factor: Factor of each term at each distance between cell and texel, shape (terms, distances) [-].
        texels: Number of texels along the axis.
        cells: Number of cells of the grid along the axis.
        data: The cover.
        margin: Number of cells of the grid before the first texel.
    """
    index = np.arange(cells) - margin - data.per_texel * np.arange(texels)[:, None] + data.reach
    inside = (index >= 0) & (index < factor.shape[1])
    return np.where(inside, factor[:, np.clip(index, 0, factor.shape[1] - 1)], 0.0)
