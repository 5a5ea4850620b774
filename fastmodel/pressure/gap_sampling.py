"""The gap between touching bodies and the undeformed cover, averaged over cells.

Each cell is sampled on a regular grid of `POINTS` x `POINTS` points.  At each point the gap is the height of the lowest
surface of the body's parts over the array.  Parts that overlap or share an edge are thus counted once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import Solid
from fastmodel.pressure.gap_kernels import Cells, sample_body
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyShape:
    """The solids of one body, as the arrays that the kernel takes.

    Attributes:
        solids: The solids.
        edge: Distance by which solids with sharp edges are enlarged [m].
    """

    solids: tuple[Solid, ...]
    edge: float = 0.0

    @cached_property
    def centres(self) -> FloatArray:
        """Centre of each solid's bounding box in its own frame, shape (p, 3) [m]."""
        return np.array([each.centre for each in self.solids])

    @cached_property
    def halves(self) -> FloatArray:
        """Half edges of those boxes, shape (p, 3) [m]."""
        return np.array([each.half for each in self.solids])

    @cached_property
    def arrays(self) -> tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
        """Kinds (p,), sizes (p, 3), planes (f, 4), first plane of each solid (p + 1,), centres and halves (p, 3)."""
        return (
            np.array([each.kind for each in self.solids], dtype=np.int64),
            np.array([each.size for each in self.solids]),
            np.concatenate([each.planes for each in self.solids]),
            np.cumsum([0, *(len(each.planes) for each in self.solids)], dtype=np.int64),
            self.centres,
            self.halves,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedBody:
    """A body's shape with the pose of each of its solids.

    Attributes:
        shape: The body's solids.
        rotation: Axes of each solid in the array's frame, as columns, shape (p, 3, 3) [-].
        position: Origin of each solid in the array's frame, shape (p, 3) [m].
    """

    shape: BodyShape
    rotation: FloatArray
    position: FloatArray

    def equals(self, other: PosedBody, tolerance: float, length: float) -> bool:
        """Whether another pose of the same body is the same up to a tolerance.

        Args:
            other: The other pose.
            tolerance: Largest difference of positions, over `length`, and of rotations [-].
            length: The length [m].
        """
        if np.abs(self.position - other.position).max() > tolerance * length:
            return False
        return bool(np.abs(self.rotation - other.rotation).max() <= tolerance)


@dataclass(frozen=True, kw_only=True, eq=False)
class GapSamples:
    """The cells under each body; a cell under two bodies is listed for each of them.  All shapes (m,).

    Attributes:
        body: Number of the body, from 0; sorted.
        row: Row in the cell grid.
        column: Column in the cell grid.
        coverage: Share of the cell's area under the body [-].
        x: Centroid of the covered part in the array's frame [m].
        y: Centroid of the covered part in the array's frame [m].
        gap: Mean height of the body's surface over the covered part [m].
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
        return int(self.body[-1]) + 1

    @cached_property
    def bodies_found(self) -> list[int]:
        """The bodies that lie over at least one cell."""
        return np.bincount(self.body).nonzero()[0].tolist()

    @cached_property
    def lowest(self) -> FloatArray:
        """Gap of each body's lowest cell, shape (bodies,) [m]."""
        return -self.find_largest(-self.gap)

    def find_largest(self, values: FloatArray) -> FloatArray:
        """Largest of some values (m,) over the cells of each body, shape (bodies,)."""
        if self.bodies == 1:
            return np.array([values.max()])
        largest = np.full(self.bodies, -np.inf)
        np.maximum.at(largest, self.body, values)
        return largest


def sample_gap(grid: CellGrid, bodies: Sequence[PosedBody], reach: Sequence[float]) -> GapSamples:
    """Average the gap over the cells under each body.

    Args:
        grid: The cells.
        bodies: The bodies.
        reach: For each body, height over its lowest cell up to which cells are kept [m].
    """
    found = [_sample_body(grid, body, height) for body, height in zip(bodies, reach, strict=True)]
    row, column, coverage, x, y, gap = (
        found[0] if len(found) == 1 else (np.concatenate(each) for each in zip(*found, strict=True))
    )
    body = np.repeat(np.arange(len(found)), [len(each[0]) for each in found])
    return GapSamples(body=body, row=row, column=column, coverage=coverage, x=x, y=y, gap=gap)


def _sample_body(grid: CellGrid, body: PosedBody, reach: float) -> Cells:
    kernel = compile_kernel(sample_body)
    return kernel(body.shape.arrays, body.shape.edge, body.rotation, body.position, grid.arrays, reach)
