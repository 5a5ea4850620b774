"""Where cells lie under an array of any layout: flat panels, each with cells of its own, side by side on one lattice.

A panel is a flat part of the array and one rigid plate.  The lattice is the cover unrolled:

- Texels that stand about one pitch from their neighbours in the image, as on a bent sheet, lie on it as in the image.
  Cells then know one another at the distance along the surface, whatever the angle between their panels.
- Any other layout in one plane is a single panel, its own lattice.
- Any other layout is one panel per texel.  They lie too far apart on the lattice to yield for one another; force still
  spreads to all texels at the base, by offsets in the plane of the pressed panel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.pressure.gap_sampling import Samples
from fastmodel.signal.point_spread import find_tangents
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Share of a pitch by which texels of one panel may stand off its plane and lattice [-].
_FLAT = 1e-3
#: Share of a pitch by which a neighbour's distance may differ from the pitch on a bent sheet: a chord is shorter [-].
_BENT = 0.2
#: Points along each edge of a cell that find their texel.
_POINTS = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A flat part of an array.

    Attributes:
        origin: Its middle in the array's frame, shape (3,) [m].
        axes: Its x, y and outward normal in the array's frame, as columns, shape (3, 3) [-].
        half: Half edge lengths of its plate [m].
        first: Row and column of its first texel in the image, on a bent sheet; else None.
    """

    origin: FloatArray
    axes: FloatArray
    half: tuple[float, float]
    first: tuple[int, int] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Facet:
    """A panel's cells.

    Attributes:
        panel: The panel.
        grid: Its cells in its own frame.
        row: Row of its first cell on the lattice.
        column: Column of its first cell on the lattice.
        rim: Cells around it that no body is looked at from, but on which one at its edge has its share [-].
    """

    panel: Panel
    grid: CellGrid
    row: int
    column: int
    rim: int = 0

    def holds(self, row: IntArray, column: IntArray) -> npt.NDArray[np.bool_]:
        """Whether cells of its grid lie within the rim, same shape."""
        inside = (row >= self.rim) & (row < self.grid.rows - self.rim)
        return np.asarray(inside & (column >= self.rim) & (column < self.grid.columns - self.rim))

    @property
    def radius(self) -> float:
        """Distance from the panel's middle that holds its cells [m]."""
        return float(np.hypot(*np.abs(self.grid.low)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ScatteredGrid(CellGrid):
    """A lattice on which texels lie anywhere: which share of every cell is whose, `[texel, cell]`."""

    shares: Any

    @property
    def texels(self) -> int:
        """Number of texels [-]."""
        return int(self.shares.shape[0])

    def on_texels(self, samples: Samples, forces: FloatArray) -> FloatArray:
        """Sums of cell forces (m,) over texels, shape (n,) [N]."""
        whole = np.bincount(samples.row * self.columns + samples.column, forces, self.rows * self.columns)
        return np.asarray(self.shares @ whole)


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """The cells of an array of any layout: its facets, and the lattice that they lie on."""

    facets: tuple[Facet, ...]
    grid: CellGrid


def panels(array: TexelArray, margin: int) -> tuple[Panel, ...]:
    """Divide an array into flat panels.

    Args:
        array: The texels.
        margin: Pitches by which the plate of a flat array reaches beyond its outermost texels; curved ones have none,
            since panels would stand in one another's way.
    """
    axes = np.stack([*find_tangents(array), array.normals], axis=-1)
    if _is_bent_sheet(array, axes) and not array.planar:
        return tuple(_block(array, axes, block) for block in _blocks(array, axes))
    local = (array.centres - array.centres[0]) @ axes[0]
    pitch = np.array(array.pitch)
    if _flat(local[:, 2], array) and np.abs(axes - axes[0]).max() < _FLAT:
        low, high = local[:, :2].min(axis=0), local[:, :2].max(axis=0)
        half = (high - low) / 2 + (0.5 + margin) * pitch
        middle = array.centres[0] + axes[0] @ np.append((low + high) / 2, 0.0)
        return (Panel(origin=middle, axes=axes[0], half=(float(half[0]), float(half[1]))),)
    half = (array.pitch[0] / 2, array.pitch[1] / 2)
    return tuple(Panel(origin=centre, axes=turn, half=half) for centre, turn in zip(array.centres, axes, strict=True))


def lay_out(array: TexelArray, parts: tuple[Panel, ...], per_texel: int, apart: int) -> Layout:
    """Give every panel its cells and a place on the lattice.

    Args:
        array: The texels.
        parts: Its panels.
        per_texel: Cells along each edge of a pitch [-].
        apart: Cells between panels that know nothing of one another.
    """
    edge = (array.pitch[0] / per_texel, array.pitch[1] / per_texel)
    if parts[0].first is not None:
        corners = [np.multiply(part.first or (0, 0), per_texel).tolist() for part in parts]
        facets = [
            Facet(panel=part, grid=_cells(part, edge, 0), row=row, column=column)
            for part, (row, column) in zip(parts, corners, strict=True)
        ]
        image = TexelArray.grid(array.rows, array.columns, array.pitch)
        return Layout(facets=tuple(facets), grid=CellGrid.over(image, per_texel, 0))
    # one cell around, on which a cell at the rim that is covered in part has its share
    grids = [_cells(part, edge, 1) for part in parts]
    wide = int(np.ceil(np.sqrt(len(parts))))
    rows, columns = (max(getattr(grid, name) for grid in grids) + apart for name in ("rows", "columns"))
    facets = [
        Facet(panel=part, grid=grid, row=k // wide * rows, column=k % wide * columns, rim=1)
        for k, (part, grid) in enumerate(zip(parts, grids, strict=True))
    ]
    whole = CellGrid(
        per_texel=per_texel,
        rows=facets[-1].row + rows,
        columns=wide * columns,
        margin=0,
        edge=edge,
        low=np.zeros(2),
        texel_columns=array.columns,
    )
    shares = _shares(array, facets, whole)
    return Layout(facets=tuple(facets), grid=ScatteredGrid(**{**vars(whole), "shares": shares}))


class ScatteredBase:
    """What of a force on a cell arrives on texels that lie anywhere; mirrors `BaseForces`."""

    def __init__(self, cells: CoverCells, layout: Layout, grid: ScatteredGrid, array: TexelArray) -> None:
        """Tabulate the influence of every cell, `[texel, cell]`.

        Args:
            cells: The cover.
            layout: Panels and their cells.
            grid: The lattice.
            array: The texels.
        """
        self._grid = grid
        matrix = _influence(cells, layout, grid, array)
        self._matrix = sp.csr_array(sp.diags_array(array.active.astype(np.float64)) @ matrix)
        whole = np.asarray(grid.shares.sum(axis=1))
        self._even = sp.csr_array(sp.diags_array(1 / np.maximum(whole, 1e-12)) @ grid.shares).T

    def of_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Force on each texel, masked ones zero, shape (n,) [N].

        Args:
            forces: On a window of cells, which may reach beyond the lattice where it is zero, shape (rows, columns)
                [N].
            origin: Row and column of the window's first cell on the lattice.
        """
        row, column = (np.arange(size) + start for size, start in zip(forces.shape, origin, strict=True))
        inside = np.outer((row >= 0) & (row < self._grid.rows), (column >= 0) & (column < self._grid.columns))
        whole = np.zeros(self._grid.rows * self._grid.columns)
        whole[np.add.outer(row * self._grid.columns, column)[inside]] = forces[inside]
        return np.asarray(self._matrix @ whole)

    def of_texels(self, contact_forces: FloatArray) -> FloatArray:
        """The same for forces spread evenly over each texel's cells, shape (n,) to (n,) [N]."""
        return np.asarray(self._matrix @ (self._even @ contact_forces))


def _flat(heights: FloatArray, array: TexelArray) -> bool:
    return bool(np.abs(heights).max() < _FLAT * min(array.pitch))


def _is_bent_sheet(array: TexelArray, axes: FloatArray) -> bool:
    """Whether neighbours in the image stand about one pitch apart, along their own axes."""
    turns = axes.reshape(array.rows, array.columns, 3, 3)
    places = array.centres.reshape(array.rows, array.columns, 3)
    for along, (here, there) in (
        (0, (np.s_[:, :-1], np.s_[:, 1:])),
        (1, (np.s_[:-1], np.s_[1:])),
    ):
        mean = turns[here] + turns[there]
        length = np.linalg.norm(mean, axis=-2)
        if (length < 1).any():
            return False
        apart = np.einsum("...i,...ij->...j", places[there] - places[here], mean / length[..., None, :])
        apart[..., along] -= array.pitch[along]
        if np.abs(apart / [*array.pitch, min(array.pitch)]).max(initial=0.0) > _BENT:
            return False
    return True


def _blocks(array: TexelArray, axes: FloatArray) -> list[tuple[int, int, int, int]]:
    """Rectangles of texels that share a plane: first row and column, one past the last."""
    left = np.ones((array.rows, array.columns), dtype=bool)
    found = []
    for row, column in np.ndindex(array.rows, array.columns):
        if not left[row, column]:
            continue
        bottom, right = row + 1, column + 1
        while right < array.columns and left[row, right] and _even(array, axes, (row, column, bottom, right + 1)):
            right += 1
        while bottom < array.rows and _even(array, axes, (row, column, bottom + 1, right)):
            bottom += 1
        left[row:bottom, column:right] = False
        found.append((row, column, bottom, right))
    return found


def _even(array: TexelArray, axes: FloatArray, block: tuple[int, int, int, int]) -> bool:
    """Whether a block of texels is a flat, even grid."""
    texels = _texels(array, block)
    grid = TexelArray.grid(block[2] - block[0], block[3] - block[1], array.pitch).centres
    local = (array.centres[texels] - array.centres[texels[0]]) @ axes[texels[0]]
    straight = np.abs(axes[texels] - axes[texels[0]]).max() < _FLAT * min(array.pitch) / max(np.ptp(grid), 1e-9)
    return bool(straight and np.abs(local - (grid - grid[0])).max() < _FLAT * min(array.pitch))


def _texels(array: TexelArray, block: tuple[int, int, int, int]) -> IntArray:
    row, column = np.mgrid[block[0] : block[2], block[1] : block[3]]
    return np.asarray((row * array.columns + column).ravel())


def _block(array: TexelArray, axes: FloatArray, block: tuple[int, int, int, int]) -> Panel:
    texels = _texels(array, block)
    rows, columns = block[2] - block[0], block[3] - block[1]
    half = (columns * array.pitch[0] / 2, rows * array.pitch[1] / 2)
    return Panel(origin=array.centres[texels].mean(axis=0), axes=axes[texels[0]], half=half, first=(block[0], block[1]))


def _cells(panel: Panel, edge: tuple[float, float], rim: int) -> CellGrid:
    """Cells over a panel in its own frame, and a rim of them around it."""
    columns, rows = (np.ceil(2 * np.array(panel.half) / edge - 1e-6).astype(int) + 2 * rim).tolist()
    low = -np.array(panel.half) - rim * np.array(edge)
    return CellGrid(per_texel=1, rows=rows, columns=columns, margin=0, edge=edge, low=low, texel_columns=columns)


def _middles(facet: Facet) -> FloatArray:
    """Middles of a facet's cells in the array's frame, shape (rows, columns, 3) [m]."""
    grid, axes = facet.grid, facet.panel.axes
    along, up = np.arange(grid.columns) + 0.5, np.arange(grid.rows) + 0.5
    x, y = np.meshgrid(grid.low[0] + along * grid.edge[0], grid.low[1] + up * grid.edge[1])
    return np.asarray(facet.panel.origin + x[..., None] * axes[:, 0] + y[..., None] * axes[:, 1])


def _numbers(facet: Facet, whole: CellGrid) -> IntArray:
    """Numbers of a facet's cells on the lattice, shape (rows, columns)."""
    row, column = np.arange(facet.grid.rows) + facet.row, np.arange(facet.grid.columns) + facet.column
    return np.add.outer(row * whole.columns, column)


def _shares(array: TexelArray, facets: list[Facet], whole: CellGrid) -> sp.csr_array:
    """Which share of every cell lies nearest to which texel, no further than half a pitch, `[texel, cell]`."""
    from scipy.spatial import cKDTree

    offset = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
    texels: list[IntArray] = []
    cells: list[IntArray] = []
    for k, facet in enumerate(facets):
        own = np.arange(array.count) if len(facets) == 1 else np.array([k])
        local = (array.centres[own] - facet.panel.origin) @ facet.panel.axes
        tree = cKDTree(local[:, :2] / array.pitch)
        middles = (_middles(facet) - facet.panel.origin) @ facet.panel.axes
        number = _numbers(facet, whole)
        for dx, dy in np.ndindex(_POINTS, _POINTS):
            place = middles[..., :2] + np.array([offset[dx], offset[dy]]) * whole.edge
            distance, nearest = tree.query(place / array.pitch, p=np.inf)
            inside = distance <= 0.5 + 1e-9
            texels.append(own[np.asarray(nearest)[inside]])
            cells.append(number[inside])
    texel, cell = np.concatenate(texels), np.concatenate(cells)
    share = np.full(len(texel), 1 / _POINTS**2)
    return sp.csr_array(sp.coo_array((share, (texel, cell)), shape=(array.count, whole.rows * whole.columns)))


def _influence(cells: CoverCells, layout: Layout, grid: ScatteredGrid, array: TexelArray) -> sp.csr_array:
    """Force on each texel per unit force on each cell: the table of cells, between its points by cubic splines."""
    from scipy.interpolate import RectBivariateSpline
    from scipy.spatial import cKDTree

    index = np.arange(len(cells.influence)) - cells.reach + 0.5 - cells.per_texel / 2
    y, x = index * cells.cell[1], index * cells.cell[0]
    order = min(3, len(index) - 1)
    table = RectBivariateSpline(y, x, cells.influence, kx=order, ky=order)
    near = cKDTree(array.centres)
    found: list[tuple[IntArray, IntArray, FloatArray]] = []
    for facet in layout.facets:
        axes, number, middles = facet.panel.axes, _numbers(facet, grid), _middles(facet)
        texels = near.query_ball_point(facet.panel.origin, facet.radius + np.hypot(x[-1], y[-1]))
        for texel in (t for t in texels if array.normals[t] @ axes[:, 2] > 0):
            apart = (middles - array.centres[texel]) @ axes[:, :2]
            inside = (np.abs(apart[..., 0]) <= x[-1] + 1e-12) & (np.abs(apart[..., 1]) <= y[-1] + 1e-12)
            if inside.any():
                force = table.ev(apart[inside][:, 1], apart[inside][:, 0])
                found.append((np.full(inside.sum(), texel), number[inside], force))
    texel, cell, force = (np.concatenate(each) for each in zip(*found, strict=True))
    return sp.csr_array(sp.coo_array((force, (texel, cell)), shape=(array.count, grid.rows * grid.columns)))
