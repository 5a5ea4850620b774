"""The cells of an array: its contact grid, its flat panels, and the forces on texels under forces on cells.

A cell is a square or rectangle of the contact grid; whole numbers of cells divide each texel pitch.  A panel is a flat
part of the array, represented in MuJoCo by one rigid plate.  The cells of all panels are placed on one common grid,
which represents the cover unrolled into a plane:

- A flat, regular array has no panels; its cells are the grid.
- Texels that lie about one pitch from their neighbours in the image, as on a bent sheet, are placed as in the image.
  Cells of adjacent panels then interact as at their distance along the surface, whatever the angle between the panels.
- Texels of any other layout in one plane form a single panel, whose cells are the common grid.
- In any other layout, each texel is a panel of its own.  The panels are placed so far apart on the common grid that
  their cells do not interact.  A force on a cell still acts on other texels at the base, depending on their offset in
  the plane of the loaded panel.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fastmodel.signal.array_namespace import Array, cast, convert, find_namespace
from fastmodel.signal.point_spread import find_tangents
from fastmodel.surface import CoverCells
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Largest distance of texels of one panel from a plane or from a flat, regular grid, over the pitch [-].
_FLAT = 1e-3
#: Largest difference between the pitch and the distance of neighbouring texels on a bent sheet, over the pitch [-].
#: The distance is a chord of the bent surface and therefore shorter than the pitch.
_BENT = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """The contact grid: cells that divide the pitches of a flat array and of a margin around the array.

    Attributes:
        per_texel: Number of cells along each texel pitch [-].
        rows: Number of rows of cells, margin included [-].
        columns: Number of columns of cells, margin included [-].
        margin: Numbers of rows and columns of cells by which the grid extends beyond the array on each side [-].
        edge: Edge lengths of a cell along x and y [m].
        low: x and y of the grid's lowest corner in the array's frame, shape (2,) [m].
        texel_columns: Number of columns of texels [-].
        panels: The flat panels of the array with their cells; empty if the array is flat and regular.
    """

    per_texel: int
    rows: int
    columns: int
    margin: tuple[int, int]
    edge: tuple[float, float]
    low: FloatArray
    texel_columns: int
    panels: tuple[PanelCells, ...] = ()

    @classmethod
    def over(cls, array: TexelArray, per_texel: int, margin: float | tuple[float, float]) -> CellGrid:
        """Make the grid that divides a flat array, and a margin around the array, into cells.

        The margin, in pitches, one number or (x, y), is rounded to whole cells.
        """
        edge = (array.pitch[0] / per_texel, array.pitch[1] / per_texel)
        columns, rows = (round(along * per_texel) for along in np.broadcast_to(margin, 2).tolist())
        half_pitch = np.array(array.pitch) / 2
        return cls(
            per_texel=per_texel,
            rows=array.rows * per_texel + 2 * rows,
            columns=array.columns * per_texel + 2 * columns,
            margin=(rows, columns),
            edge=edge,
            low=array.centres[0, :2] - half_pitch - np.array([columns, rows]) * edge,
            texel_columns=array.columns,
        )

    @property
    def texels(self) -> int:
        """Number of texels of the array [-]."""
        return (self.rows - 2 * self.margin[0]) * (self.columns - 2 * self.margin[1]) // self.per_texel**2

    @cached_property
    def mean_edge(self) -> float:
        """Edge of a square of a cell's area [m]."""
        return math.sqrt(self.edge[0] * self.edge[1])

    @cached_property
    def arrays(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """The grid for kernels: (columns, rows) [-], lowest corner [m] and edges of a cell [m], each of shape (2,)."""
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

    def divide_points(self, points: Array) -> tuple[Array, Array, Array]:
        """Divide point forces bilinearly among the four nearest cells; forces that pull count as zero.

        Args:
            points: Positions x, y in the frame of the grid [m] and pressing forces [N], shape (k, 3), an array of any
                library.

        Returns:
            Row and column of 4 k cells, and the force on each of them [N], each of shape (4 k,).
        """
        xp, (cells, low, edge) = find_namespace(points), (convert(each, points) for each in self.arrays)
        place = xp.clip((points[:, :2] - low) / edge - 0.5, 0 * cells, cells - 1)
        first = xp.minimum(xp.floor(place), xp.maximum(cells - 2, 0 * cells))
        share, pressed = place - first, xp.maximum(points[:, 2], 0 * points[:, 2])
        row, column, forces = [], [], []
        for j, i in np.ndindex(2, 2):
            column.append(xp.minimum(first[:, 0] + i, cells[0] - 1))
            row.append(xp.minimum(first[:, 1] + j, cells[1] - 1))
            forces.append(pressed * xp.abs(1 - i - share[:, 0]) * xp.abs(1 - j - share[:, 1]))
        row, column = (cast(xp, xp.concat(each), xp.asarray(0).dtype) for each in (row, column))
        return row, column, xp.concat(forces)

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
        """Index plus one of the texel of each cell of the grid; 0 for cells in the margin, shape (rows * columns,)."""
        return self.find_texel(*np.divmod(np.arange(self.rows * self.columns), self.columns)) + 1

    def find_texel(self, row: IntArray, column: IntArray) -> IntArray:
        """Find the index of the texel that each cell belongs to, -1 for cells in the margin, same shape as `row`."""
        i, j = row - self.margin[0], column - self.margin[1]
        inside = (i >= 0) & (j >= 0) & (i < self.rows - 2 * self.margin[0]) & (j < self.columns - 2 * self.margin[1])
        return np.asarray(np.where(inside, i // self.per_texel * self.texel_columns + j // self.per_texel, -1))

    def build_base_forces(self, cells: CoverCells, array: TexelArray) -> BaseForces:
        """Build the operator from forces on cells to forces on texels at the base of the cover."""
        return BaseForces(cells, self, array)


class BaseForces:
    """The operator from forces on cells at the top of the cover to forces on texels at the base of the cover.

    The influence is the force on a texel per unit force on a cell.  It depends on the distances between texel and cell
    along rows and along columns.  A low-rank factorisation writes it as a sum of products of row factors and column
    factors, so that two matrix products give the texel forces under a window (rectangle) of cells.  For a cover with
    free side edges this form does not exist, and a table of all cells and texels is used instead.
    """

    def __init__(self, cells: CoverCells, grid: CellGrid, array: TexelArray) -> None:
        """Store the influence of the cover, the contact grid and the texels.

        Args:
            cells: The cover, whose influence is used.
            grid: The contact grid of the array.
            array: The texels.
        """
        self._cells, self._grid, self._array = cells, grid, array
        rows, columns = ((beyond, beyond) for beyond in grid.margin)
        # the table contains no cells in the margin; a force in the margin then reaches no texel
        self._table = None if cells.table is None else np.pad(cells.table, ((0, 0), rows, columns))
        self._masked = None if array.active.all() else ~array.active
        #: The last window, as row and column of its first cell and its shape; and its factors, see `factor_window`.
        self._last: tuple[tuple[int, ...], _Factors] | None = None

    def from_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Compute the forces on n texels at the base under forces on a window of cells, shape (n,) [N].

        Forces on masked texels are set to zero.

        Args:
            forces: Forces on a window (rectangle) of cells, shape (rows, columns).  The window may extend beyond the
                grid; forces on cells outside the grid must be zero [N].
            origin: Row and column of the window's first cell in the grid.
        """
        key = (*origin, *forces.shape)
        if self._last is None or self._last[0] != key:
            self._last = (key, self.factor_window(origin, forces.shape))
        along, across, near = self._last[1]
        if self._table is not None:
            texels = along.dot(forces.ravel())
        else:
            image = np.zeros((self._array.rows, self._array.columns))
            if along.size and across.size:
                terms = len(across) // forces.shape[1]
                image[near] = along.dot(forces).reshape(-1, terms * forces.shape[1]).dot(across)
            texels = image.ravel()
        if self._masked is not None:
            texels[self._masked] = 0.0
        return np.asarray(texels)

    def from_texels(self, contact_forces: FloatArray) -> FloatArray:
        """Compute the forces on n texels at the base under contact forces on the texels, shape (n,) [N].

        Args:
            contact_forces: Forces, each distributed uniformly over the cells of a texel, shape (n,) [N].
        """
        s = self._cells.per_texel
        image = contact_forces.reshape(self._array.rows, self._array.columns)
        uniform = np.kron(image, np.full((s, s), 1 / s**2))
        return self.from_window(uniform, self._grid.margin)

    def factor_window(self, origin: tuple[int, int], shape: tuple[int, ...]) -> _Factors:
        """Find the factors of the influence for a window of cells.

        The influence is the force on a texel per unit force on a cell, a sum of products of row and column factors.

        Args:
            origin: Row and column of the window's first cell in the grid.
            shape: Number of rows and of columns of the window.

        Returns:
            Factors from rows of cells to rows of texels, for each term, shape (texel rows * terms, rows) [-].  Factors
            from columns of cells to columns of texels, shape (terms * columns, texel columns) [-].  Rows and columns of
            the texels that the window reaches.  For a cover with a table the first entry is the part of the table for
            the window, shape (n, rows * columns) [-], and the others are not used.
        """
        cells = [start + np.arange(size) for start, size in zip(origin, shape, strict=True)]
        if self._table is not None:
            # Cells outside the grid carry no force, so that the table's values for the nearest cells can be used there.
            row, column = (np.clip(c, 0, most - 1) for c, most in zip(cells, self._table.shape[1:], strict=True))
            return self._table[:, row[:, None], column].reshape(len(self._table), -1), np.zeros(0), (slice(0), slice(0))
        data, factors, near = self._cells, [], []
        for factor, cell, texels, margin in zip(
            data.influence_factors, cells, (self._array.rows, self._array.columns), self._grid.margin, strict=True
        ):
            index = cell - margin - data.per_texel * np.arange(texels)[:, None] + data.reach
            inside = (index >= 0) & (index < factor.shape[1])
            reached = inside.any(axis=1).nonzero()[0]
            near.append(slice(reached[0], reached[-1] + 1) if len(reached) else slice(0))
            values = np.where(inside, factor[:, np.clip(index, 0, factor.shape[1] - 1)], 0.0)
            factors.append(values[:, near[-1]])
        along, across = factors[0].transpose(1, 0, 2), factors[1].transpose(0, 2, 1)
        return along.reshape(-1, shape[0]), across.reshape(-1, across.shape[2]), (near[0], near[1])


#: Return value of `BaseForces.factor_window`: row factors, column factors, and rows and columns of the reached texels.
_Factors = tuple[FloatArray, FloatArray, tuple[slice, slice]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A flat part of an array.

    Attributes:
        origin: Centre of the panel in the array's frame, shape (3,) [m].
        axes: x axis, y axis and outward normal of the panel in the array's frame, as columns, shape (3, 3) [-].
        half: Half edge lengths of the panel's plate along its x and y axes [m].
        first: Row and column in the tactile image of the panel's first texel if the array is a bent sheet; else None.
    """

    origin: FloatArray
    axes: FloatArray
    half: tuple[float, float]
    first: tuple[int, int] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PanelCells:
    """The cells of a panel.

    Attributes:
        panel: The panel.
        grid: The cells of the panel, in the frame of the panel.
        row: Row on the common grid of the panel's first cell.
        column: Column on the common grid of the panel's first cell.
        rim: Number of cells along each edge of `grid` that lie beyond the panel.  The gap is not sampled on these
            cells, but a share of the force on a partly covered cell at the panel's edge acts on them [-].
    """

    panel: Panel
    grid: CellGrid
    row: int
    column: int
    rim: int = 0

    def holds(self, row: IntArray, column: IntArray) -> BoolArray:
        """Return whether cells of `grid` lie on the panel and not on the rim, same shape as `row`."""
        inside = (row >= self.rim) & (row < self.grid.rows - self.rim)
        return np.asarray(inside & (column >= self.rim) & (column < self.grid.columns - self.rim))

    @property
    def radius(self) -> float:
        """Distance from the panel's centre to the farthest corner of the panel's cells [m]."""
        return float(np.hypot(*np.abs(self.grid.low)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ScatteredGrid(CellGrid):
    """A common grid whose cells belong to texels in any arrangement.

    Attributes:
        shares: Share of each cell's area that belongs to each of n texels, sparse, shape (n, rows * columns) [-].
    """

    shares: sp.csr_array

    @property
    def texels(self) -> int:
        """Number of texels [-]."""
        return int(self.shares.shape[0])

    def sum_on_texels(self, row: IntArray, column: IntArray, forces: FloatArray) -> FloatArray:
        """Sum forces on cells over the texels that the cells belong to; see `CellGrid.sum_on_texels`."""
        whole = np.bincount(row * self.columns + column, forces, self.rows * self.columns)
        return np.asarray(self.shares @ whole)

    def build_base_forces(self, cells: CoverCells, array: TexelArray) -> BaseForces:
        """Build the operator for texels in any arrangement; see `CellGrid.build_base_forces`."""
        return ScatteredBaseForces(cells, self, array)


def divide_into_panels(array: TexelArray, margin: float | tuple[float, float]) -> tuple[Panel, ...]:
    """Divide an array into flat panels.

    Args:
        array: The texels.
        margin: Number of pitches by which the plate of a flat array extends beyond the texels, one number or (x,
            y).  Curved arrays have no margin, because the plates of adjacent panels would overlap [-].
    """
    axes = np.stack([*find_tangents(array), array.normals], axis=-1)
    is_bent = not array.planar and _is_bent_sheet(array, axes)
    if is_bent:
        return tuple(_build_panel(array, axes, block) for block in _find_blocks(array, axes))
    local = (array.centres - array.centres[0]) @ axes[0]
    pitch = np.array(array.pitch)
    if np.abs(local[:, 2]).max() < _FLAT * min(array.pitch) and np.abs(axes - axes[0]).max() < _FLAT:
        low, high = local[:, :2].min(axis=0), local[:, :2].max(axis=0)
        half = (high - low) / 2 + (0.5 + np.array(margin)) * pitch
        middle = array.centres[0] + axes[0] @ np.append((low + high) / 2, 0.0)
        return (Panel(origin=middle, axes=axes[0], half=(float(half[0]), float(half[1]))),)
    half = (array.pitch[0] / 2, array.pitch[1] / 2)
    return tuple(Panel(origin=centre, axes=turn, half=half) for centre, turn in zip(array.centres, axes, strict=True))


def lay_out(array: TexelArray, margin: float | tuple[float, float], per_texel: int, apart: int = 1) -> CellGrid:
    """Divide an array, or every panel of it, into cells, and place the cells of all panels on a common grid.

    Args:
        array: The texels.
        margin: Number of pitches by which the plate of a flat array extends beyond the texels, one number or (x, y)
            [-].
        per_texel: Number of cells along each texel pitch [-].
        apart: Number of cells between panels that do not interact [-].
    """
    if array.regular:
        return CellGrid.over(array, per_texel, margin)
    panels = divide_into_panels(array, margin)
    edge = (array.pitch[0] / per_texel, array.pitch[1] / per_texel)
    if panels[0].first is not None:
        corners = [np.multiply(panel.first or (0, 0), per_texel).tolist() for panel in panels]
        sheet = CellGrid.over(TexelArray.grid(array.rows, array.columns, array.pitch), per_texel, 0)
        placed = (
            PanelCells(panel=panel, grid=_divide_panel(panel, edge, 0), row=row, column=column)
            for panel, (row, column) in zip(panels, corners, strict=True)
        )
        return dataclasses.replace(sheet, panels=tuple(placed))
    grids = [_divide_panel(panel, edge, 1) for panel in panels]
    wide = int(np.ceil(np.sqrt(len(panels))))
    rows, columns = (max(getattr(grid, name) for grid in grids) + apart for name in ("rows", "columns"))
    placed = (
        PanelCells(panel=panel, grid=grid, row=k // wide * rows, column=k % wide * columns, rim=1)
        for k, (panel, grid) in enumerate(zip(panels, grids, strict=True))
    )
    whole = ScatteredGrid(
        per_texel=per_texel,
        rows=((len(panels) - 1) // wide + 1) * rows,
        columns=wide * columns,
        margin=(0, 0),
        edge=edge,
        low=np.zeros(2),
        texel_columns=array.columns,
        panels=tuple(placed),
        shares=sp.csr_array((0, 0)),
    )
    return dataclasses.replace(whole, shares=_share_cells(array, whole))


class ScatteredBaseForces(BaseForces):
    """The operator from forces on cells to forces at the base on texels in any layout; compare `BaseForces`."""

    def __init__(self, cells: CoverCells, grid: ScatteredGrid, array: TexelArray) -> None:
        """Tabulate the influence of each cell on each texel, which is force on the texel per force on the cell.

        Args:
            cells: The cover.
            grid: The common grid of all panels.
            array: The texels.
        """
        self._grid = grid
        matrix = _tabulate_influence(cells, grid, array)
        self._matrix = sp.csr_array(sp.diags_array(array.active.astype(np.float64)) @ matrix)
        whole = np.asarray(grid.shares.sum(axis=1))
        self._uniform = sp.csr_array(sp.diags_array(1 / np.maximum(whole, 1e-12)) @ grid.shares).T

    def from_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Compute the texel forces under forces on a window of cells; see `BaseForces.from_window`."""
        row, column = (np.arange(size) + start for size, start in zip(forces.shape, origin, strict=True))
        inside = np.outer((row >= 0) & (row < self._grid.rows), (column >= 0) & (column < self._grid.columns))
        whole = np.zeros(self._grid.rows * self._grid.columns)
        whole[np.add.outer(row * self._grid.columns, column)[inside]] = forces[inside]
        return np.asarray(self._matrix @ whole)

    def from_texels(self, contact_forces: FloatArray) -> FloatArray:
        """Compute the forces on n texels at the base under contact forces on the texels, shape (n,) [N].

        Args:
            contact_forces: Forces, each distributed uniformly over the cells of a texel, shape (n,) [N].
        """
        return np.asarray(self._matrix @ (self._uniform @ contact_forces))


def _is_bent_sheet(array: TexelArray, axes: FloatArray) -> bool:
    """Return whether an array is a bent sheet.

    On a bent sheet neighbouring texels of the tactile image lie about one pitch apart, along the mean of their axes.

    Args:
        array: The n texels.
        axes: Two tangents and the normal of each texel, as columns, shape (n, 3, 3) [-].
    """
    turns = axes.reshape(array.rows, array.columns, 3, 3)
    places = array.centres.reshape(array.rows, array.columns, 3)
    for along, (here, there) in ((0, (np.s_[:, :-1], np.s_[:, 1:])), (1, (np.s_[:-1], np.s_[1:]))):
        mean = turns[here] + turns[there]
        length = np.linalg.norm(mean, axis=-2)
        if (length < 1).any():
            return False
        apart = np.einsum("...i,...ij->...j", places[there] - places[here], mean / length[..., None, :])
        apart[..., along] -= array.pitch[along]
        if np.abs(apart / [*array.pitch, min(array.pitch)]).max(initial=0.0) > _BENT:
            return False
    return True


def _find_blocks(array: TexelArray, axes: FloatArray) -> list[tuple[int, int, int, int]]:
    """Divide the tactile image of a bent sheet into rectangular blocks of coplanar texels.

    Args:
        array: The n texels.
        axes: Two tangents and the normal of each texel, as columns, shape (n, 3, 3) [-].

    Returns:
        First row, first column, one past the last row, and one past the last column of each block.
    """
    left = np.ones((array.rows, array.columns), dtype=bool)
    found = []
    for row, column in np.ndindex(array.rows, array.columns):
        if not left[row, column]:
            continue
        bottom, right = row + 1, column + 1
        while right < array.columns and left[row, right] and _is_regular(array, axes, (row, column, bottom, right + 1)):
            right += 1
        while bottom < array.rows and _is_regular(array, axes, (row, column, bottom + 1, right)):
            bottom += 1
        left[row:bottom, column:right] = False
        found.append((row, column, bottom, right))
    return found


def _is_regular(array: TexelArray, axes: FloatArray, block: tuple[int, int, int, int]) -> bool:
    """Return whether a block of texels, given by rows and columns as in `_find_blocks`, is a flat, regular grid."""
    texels = _list_texels(array, block)
    grid = TexelArray.grid(block[2] - block[0], block[3] - block[1], array.pitch).centres
    local = (array.centres[texels] - array.centres[texels[0]]) @ axes[texels[0]]
    straight = np.abs(axes[texels] - axes[texels[0]]).max() < _FLAT * min(array.pitch) / max(np.ptp(grid), 1e-9)
    return bool(straight and np.abs(local - (grid - grid[0])).max() < _FLAT * min(array.pitch))


def _list_texels(array: TexelArray, block: tuple[int, int, int, int]) -> IntArray:
    """List the indices of the n texels of a block, given by rows and columns as in `_find_blocks`, shape (n,)."""
    row, column = np.mgrid[block[0] : block[2], block[1] : block[3]]
    return np.asarray((row * array.columns + column).ravel())


def _build_panel(array: TexelArray, axes: FloatArray, block: tuple[int, int, int, int]) -> Panel:
    """Build the flat panel of a block of coplanar texels, given by rows and columns as in `_find_blocks`."""
    texels = _list_texels(array, block)
    rows, columns = block[2] - block[0], block[3] - block[1]
    half = (columns * array.pitch[0] / 2, rows * array.pitch[1] / 2)
    return Panel(origin=array.centres[texels].mean(axis=0), axes=axes[texels[0]], half=half, first=(block[0], block[1]))


def _divide_panel(panel: Panel, edge: tuple[float, float], rim: int) -> CellGrid:
    """Divide a panel into cells in the frame of the panel, with a rim of `rim` cells around the panel."""
    columns, rows = (np.ceil(2 * np.array(panel.half) / edge - 1e-6).astype(int) + 2 * rim).tolist()
    low = -np.array(panel.half) - rim * np.array(edge)
    return CellGrid(per_texel=1, rows=rows, columns=columns, margin=(0, 0), edge=edge, low=low, texel_columns=columns)


def _find_centres(part: PanelCells) -> FloatArray:
    """Compute the centres of a panel's cells in the array's frame, shape (rows, columns, 3) [m]."""
    grid, axes = part.grid, part.panel.axes
    along, up = np.arange(grid.columns) + 0.5, np.arange(grid.rows) + 0.5
    x, y = np.meshgrid(grid.low[0] + along * grid.edge[0], grid.low[1] + up * grid.edge[1])
    return np.asarray(part.panel.origin + x[..., None] * axes[:, 0] + y[..., None] * axes[:, 1])


def _number_cells(part: PanelCells, whole: CellGrid) -> IntArray:
    """Return the index on the common grid, counted row by row, of each cell of a panel, shape (rows, columns)."""
    row, column = np.arange(part.grid.rows) + part.row, np.arange(part.grid.columns) + part.column
    return np.add.outer(row * whole.columns, column)


def _share_cells(array: TexelArray, whole: CellGrid) -> sp.csr_array:
    """Compute the share of each cell's area that belongs to each of n texels, shape (n, rows * columns) [-].

    A point belongs to the nearest texel, if this texel's centre is at most half a pitch away along x and along y.
    """
    # Each cell is sampled at 4 x 4 points; the offsets from its centre are in units of the cell's edges.
    offset = (np.arange(4) + 0.5) / 4 - 0.5
    texels: list[IntArray] = []
    cells: list[IntArray] = []
    for k, part in enumerate(whole.panels):
        own = np.arange(array.count) if len(whole.panels) == 1 else np.array([k])
        local = (array.centres[own] - part.panel.origin) @ part.panel.axes
        tree = cKDTree(local[:, :2] / array.pitch)
        centres = (_find_centres(part) - part.panel.origin) @ part.panel.axes
        number = _number_cells(part, whole)
        for dx, dy in np.ndindex(4, 4):
            place = centres[..., :2] + np.array([offset[dx], offset[dy]]) * whole.edge
            distance, nearest = tree.query(place / array.pitch, p=np.inf)
            inside = distance <= 0.5 + 1e-9
            texels.append(own[np.asarray(nearest)[inside]])
            cells.append(number[inside])
    texel, cell = np.concatenate(texels), np.concatenate(cells)
    share = np.full(len(texel), 1 / 4**2)
    return sp.csr_array(sp.coo_array((share, (texel, cell)), shape=(array.count, whole.rows * whole.columns)))


def _tabulate_influence(cells: CoverCells, grid: ScatteredGrid, array: TexelArray) -> sp.csr_array:
    """Tabulate the force on each of n texels per unit force on each cell, shape (n, rows * columns) [-].

    The influence of the cover is interpolated by cubic splines at the offset between cell and texel in the plane of the
    cell's panel.
    """
    from scipy.interpolate import RectBivariateSpline

    index = np.arange(len(cells.influence)) - cells.reach + 0.5 - cells.per_texel / 2
    y, x = index * cells.cell[1], index * cells.cell[0]
    order = min(3, len(index) - 1)
    table = RectBivariateSpline(y, x, cells.influence, kx=order, ky=order)
    tree = cKDTree(array.centres)
    found: list[tuple[IntArray, IntArray, FloatArray]] = []
    for part in grid.panels:
        axes, number, centres = part.panel.axes, _number_cells(part, grid), _find_centres(part)
        texels = tree.query_ball_point(part.panel.origin, part.radius + np.hypot(x[-1], y[-1]))
        for texel in (t for t in texels if array.normals[t] @ axes[:, 2] > 0):
            apart = (centres - array.centres[texel]) @ axes[:, :2]
            inside = (np.abs(apart[..., 0]) <= x[-1] + 1e-12) & (np.abs(apart[..., 1]) <= y[-1] + 1e-12)
            if inside.any():
                force = table.ev(apart[inside][:, 1], apart[inside][:, 0])
                found.append((np.full(inside.sum(), texel), number[inside], force))
    texel, cell, force = (np.concatenate(each) for each in zip(*found, strict=True))
    return sp.csr_array(sp.coo_array((force, (texel, cell)), shape=(array.count, grid.rows * grid.columns)))
