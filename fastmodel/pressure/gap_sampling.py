"""What touching bodies look like from below, cell by cell, and what each of them carries."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import Kernel, find_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import Solid
from fastmodel.pressure.gap_kernels import sample_loops

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Points along each edge of a cell on an outline at which the gap is taken.
POINTS = 4
_OFFSETS = (np.arange(POINTS) + 0.5) / POINTS - 0.5
#: Share of corners under a part below which it is taken for a thin one, all of whose cells are looked at closely.
_SPARSE = 0.25


#: Row, column, coverage, x, y, gap.
_Cells = tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A solid where it stands: axes as columns (3, 3) and origin (3,) in the array's frame [m]."""

    solid: Solid
    rotation: FloatArray
    position: FloatArray

    def lower(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the underside over the array's plane at points of shape (m,), inf where there is none [m]."""
        return self.solid.lower(x, y, self.rotation, self.position)


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """The solids of one body as arrays, made once.

    Attributes:
        solids: The solids.
        edge: Distance by which sharp edges stand out [m].
    """

    solids: tuple[Solid, ...]
    edge: float = 0.0

    @cached_property
    def kinds(self) -> IntArray:
        """Kind of each solid, shape (p,)."""
        return np.array([each.kind for each in self.solids], dtype=np.int64)

    @cached_property
    def sizes(self) -> FloatArray:
        """Size of each, shape (p, 3) [m]."""
        return np.array([each.size for each in self.solids])

    @cached_property
    def planes(self) -> FloatArray:
        """Faces of all polytopes, shape (f, 4) [-, m]."""
        return np.concatenate([each.planes for each in self.solids])

    @cached_property
    def first_plane(self) -> IntArray:
        """First face of each, and the number of all, shape (p + 1,)."""
        return np.asarray(np.cumsum([0, *(len(each.planes) for each in self.solids)]), dtype=np.int64)

    @cached_property
    def centres(self) -> FloatArray:
        """Centre of each one's bounding box in its own frame, shape (p, 3) [m]."""
        return np.array([each.centre for each in self.solids])

    @cached_property
    def halves(self) -> FloatArray:
        """Half edges of those boxes, shape (p, 3) [m]."""
        return np.array([each.half for each in self.solids])

    @cached_property
    def extents(self) -> FloatArray:
        """By how much a point of each solid moves at most as each of its axes turns, and its rim, shape (p, 4) [m].

        A ball may turn as it likes, and what is round about its axis about that.  The rim is the radius of flat round
        ends, which tilt with the axis that they are square to, else 0.
        """
        half = np.where(np.isfinite(self.halves), self.halves, 1.0) + np.abs(self.centres)
        ball = (self.kinds == 1) & (np.ptp(self.sizes, axis=1) == 0)
        half[ball] = 0.0
        half[self.kinds >= 2, 2] += half[self.kinds >= 2, 0]  # noqa: PLR2004 -- cylinders and capsules
        half[self.kinds >= 2, :2] = 0.0  # noqa: PLR2004
        rims = np.where(self.kinds == 2, self.halves[:, 0], 0.0)  # noqa: PLR2004 -- cylinders
        return np.column_stack([half, rims])


@dataclass(frozen=True, kw_only=True, eq=False)
class Standing:
    """A body where it stands: the rotations (p, 3, 3) and origins (p, 3) of its solids in the array's frame [m]."""

    shape: Shape
    rotation: FloatArray
    position: FloatArray

    def parts(self) -> list[Placed]:
        """Its solids one by one."""
        return [
            Placed(solid=solid, rotation=rotation, position=position)
            for solid, rotation, position in zip(self.shape.solids, self.rotation, self.position, strict=True)
        ]

    def bounds(self, grid: CellGrid) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x and y of each solid's bounding box, in cells from the grid's corner, shape (p, 2)."""
        middle = self.position + np.einsum("pij,pj->pi", self.rotation, self.shape.centres)
        reach = np.zeros_like(self.rotation)
        # a plane has no ends
        half = np.multiply(np.abs(self.rotation), self.shape.halves[:, None], out=reach, where=self.rotation != 0).sum(
            axis=2
        )
        low = (middle[:, :2] - half[:, :2] - grid.low) / grid.edge
        high = (middle[:, :2] + half[:, :2] - grid.low) / grid.edge
        return low, high

    def windows(self, grid: CellGrid) -> IntArray:
        """First column and row, one past the last column and row of cells under each solid, shape (p, 4)."""
        low, high = self.bounds(grid)
        bounds = np.concatenate([np.floor(low), np.ceil(high)], axis=1)
        size = (grid.columns, grid.rows, grid.columns, grid.rows)
        return np.asarray(np.minimum(np.maximum(bounds, 0), size), dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Load:
    """What the engine lets one body press with.

    Attributes:
        force: Against the array's normal [N].
        moment: Sums of force times x and of force times y over the contact points, in the array's frame, shape (2,)
            [Nm].
        tilts: Whether the body is free to tilt, so that its moments say where it presses.
    """

    force: float
    moment: FloatArray
    tilts: bool

    def upright(self) -> Load:
        """The same without moments: the pose that the engine gives stands for the tilt."""
        return dataclasses.replace(self, tilts=False)

    def alike(self, other: Load, distance: float) -> bool:
        """Whether another load presses at the same point, up to a distance [m]; a guided body's point is a guide's."""
        return not self.tilts or bool(np.abs(self.moment / self.force - other.moment / other.force).max() <= distance)

    def constraints(self, samples: Samples, mine: IntArray) -> tuple[FloatArray, FloatArray]:
        """What the body's cell forces are summed with, shape (m, k), and what these sums must be, shape (k,).

        The first column gives the load itself, so its multiplier is the approach.

        Args:
            samples: Cells under all bodies.
            mine: Which of them are this body's, shape (m,).
        """
        if not self.tilts or len(mine) < 3:  # noqa: PLR2004 -- a plane takes three points
            return np.ones((len(mine), 1)), np.array([self.force])
        # about the point of pressure and in units of the contact's size, so that the unknowns are alike
        x, y = (self.moment / self.force).tolist()
        columns = np.ones((len(mine), 3))
        np.subtract(samples.x.take(mine), x, out=columns[:, 1])
        np.subtract(samples.y.take(mine), y, out=columns[:, 2])
        columns[:, 1:] /= max(float(np.abs(columns[:, 1:]).max()), 1e-9)
        return columns, np.array([self.force, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Cells that bodies stand over, each body's own; shapes (m,).

    Attributes:
        body: Which body, from 0.
        row: Row in the cell grid.
        column: Column in the cell grid.
        coverage: Share of the cell under the body [-].
        x: Middle of the covered part in the array's frame [m].
        y: Middle of the covered part [m].
        gap: Mean height of the body's underside over it [m].
    """

    body: IntArray
    row: IntArray
    column: IntArray
    coverage: FloatArray
    x: FloatArray
    y: FloatArray
    gap: FloatArray

    @property
    def count(self) -> int:
        """Number of cells over all bodies."""
        return len(self.body)

    @cached_property
    def bodies(self) -> int:
        """Number of bodies."""
        return int(self.body.max()) + 1

    @cached_property
    def seen(self) -> list[int]:
        """The bodies that stand over any cell."""
        if not self.count:
            return []
        return [0] if not self.body[-1] else np.unique(self.body).tolist()

    @cached_property
    def lowest(self) -> FloatArray:
        """Height of each body's lowest cell, shape (bodies,) [m]."""
        return np.array([self.gap.min()]) if self.bodies == 1 else -self.largest(-self.gap)

    def largest(self, values: FloatArray) -> FloatArray:
        """Largest of some values (m,) on the cells of each body, shape (bodies,)."""
        if self.bodies == 1:
            return np.array([values.max()])
        largest = np.full(self.bodies, -np.inf)
        np.maximum.at(largest, self.body, values)
        return largest


def sample(
    grid: CellGrid, bodies: Sequence[Standing], reach: Sequence[float], *, native: bool | None = False
) -> Samples:
    """Look at every body from below.

    Args:
        grid: The cells.
        bodies: The bodies.
        reach: Height over each body's lowest point up to which it is looked at [m].
        native: True for the numba kernel, False for numpy, None for whichever is there.
    """
    kernel = find_kernel(sample_loops, native=native)
    if kernel is None:
        found = [_sample_body(grid, body, height) for body, height in zip(bodies, reach, strict=True)]
    else:
        found = [_sample_native(kernel, grid, body, height) for body, height in zip(bodies, reach, strict=True)]
    if len(found) == 1:
        row, column, coverage, x, y, gap = found[0]
        body = np.zeros(len(row), dtype=np.int64)
    else:
        row, column, coverage, x, y, gap = (np.concatenate(each) for each in zip(*found, strict=True))
        body = np.repeat(np.arange(len(found)), [len(each[0]) for each in found])
    return Samples(body=body, row=row, column=column, coverage=coverage, x=x, y=y, gap=gap)


def _sample_native(kernel: Kernel, grid: CellGrid, body: Standing, reach: float) -> _Cells:
    """Row, column, coverage, x, y, gap of the cells under one body, each of shape (m,)."""
    shape = body.shape
    cells: _Cells = kernel(
        shape.kinds,
        shape.sizes,
        shape.edge,
        shape.planes,
        shape.first_plane,
        body.rotation,
        body.position,
        shape.centres,
        shape.halves,
        np.array([grid.columns, grid.rows]),
        grid.low,
        np.array(grid.edge),
        POINTS,
        _SPARSE,
        reach,
    )
    return cells


def _sample_body(grid: CellGrid, body: Standing, reach: float) -> _Cells:
    """Row, column, coverage, x, y, gap of the cells under one body, each of shape (m,).

    A cell whose corners all lie under one part lies under it altogether, because parts are convex.  Only cells around
    an outline are looked at in more points.  Where parts overlap or share an edge the lowest one counts, once.
    """
    parts, windows = body.parts(), body.windows(grid)
    low = windows[:, :2].min(axis=0)
    columns, rows = windows[:, 2:].max(axis=0) - low
    if rows <= 0 or columns <= 0:
        return (np.zeros(0, dtype=np.int64),) * 2 + (np.zeros(0),) * 4
    height, outline = np.full((rows, columns), np.inf), np.zeros((rows, columns), dtype=bool)
    for part, first, last in zip(parts, windows[:, :2], windows[:, 2:], strict=True):
        if (first < last).all():
            place = (slice(first[1] - low[1], last[1] - low[1]), slice(first[0] - low[0], last[0] - low[0]))
            whole, around = _look_at_corners(grid, part, first, last)
            height[place] = np.minimum(height[place], whole)
            outline[place] |= around
    row, column = np.nonzero(np.isfinite(height))
    middle = (np.zeros(len(row)),) * 2
    found = [(row, column, np.ones(len(row)), *middle, height[row, column])]
    found.append(_look_closely(grid, parts, low, *np.nonzero(outline & ~np.isfinite(height))))
    row, column, share, right, up, gap = (np.concatenate(each) for each in zip(*found, strict=True))
    row, column = row + low[1], column + low[0]
    x = grid.low[0] + (column + 0.5 + right) * grid.edge[0]
    y = grid.low[1] + (row + 0.5 + up) * grid.edge[1]
    kept = gap <= gap.min(initial=np.inf) + reach
    return row[kept], column[kept], share[kept], x[kept], y[kept], gap[kept]


def _look_at_corners(
    grid: CellGrid, part: Placed, first: IntArray, last: IntArray
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Mean gap of cells that lie under the part altogether, else inf; and which cells its outline may cross."""
    columns, rows = last - first + 1
    x = grid.low[0] + (first[0] + np.arange(columns)) * grid.edge[0]
    y = grid.low[1] + (first[1] + np.arange(rows)) * grid.edge[1]
    gap = part.lower(np.tile(x, rows), np.repeat(y, columns)).reshape(rows, columns)
    whole = 0.25 * (gap[:-1, :-1] + gap[1:, :-1] + gap[:-1, 1:] + gap[1:, 1:])
    hit = np.isfinite(gap)
    if hit.sum() < _SPARSE * hit.size:
        return whole, np.ones(whole.shape, dtype=bool)
    # any corner within one cell of the cell's own corners
    wide = hit[:, :-1] | hit[:, 1:]
    wide[:, 1:] |= hit[:, :-2]
    wide[:, :-1] |= hit[:, 2:]
    around = wide[:-1] | wide[1:]
    around[1:] |= wide[:-2]
    around[:-1] |= wide[2:]
    return whole, around


def _look_closely(
    grid: CellGrid, parts: Sequence[Placed], low: IntArray, row: IntArray, column: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Row, column, coverage, middle of the covered part (in cells from the cell's middle) and gap of covered cells."""
    right, up = np.tile(_OFFSETS, POINTS), np.repeat(_OFFSETS, POINTS)
    x = grid.low[0] + (low[0] + 0.5 + column[:, None] + right) * grid.edge[0]
    y = grid.low[1] + (low[1] + 0.5 + row[:, None] + up) * grid.edge[1]
    gap = np.full(x.size, np.inf)
    for part in parts:
        np.minimum(gap, part.lower(x.ravel(), y.ravel()), out=gap)
    gap = gap.reshape(x.shape)
    hit = np.isfinite(gap)
    count = hit.sum(axis=1)
    some = count.nonzero()[0]
    hit, gap, count = hit[some], gap[some], count[some]
    mean = np.where(hit, gap, 0.0).sum(axis=1) / count
    return row[some], column[some], count / POINTS**2, hit @ right / count, hit @ up / count, mean
