"""The gap between touching bodies and the undeformed cover, averaged over the cells of the contact grid.

Each cell is sampled on a regular grid of `POINTS` x `POINTS` points.  A body consists of one or several solids.  At
each point the gap is the height of the lowest surface of these solids over the array, so that solids which overlap or
share an edge are counted once.
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
from fastmodel.pressure.preparation_kernels import are_close
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyShape:
    """The p solids of one body, also as the arrays that the compiled kernel takes.

    Attributes:
        solids: The solids, each in its own frame.
        edge: Distance by which solids with sharp edges are enlarged [m].
    """

    solids: tuple[Solid, ...]
    edge: float = 0.0

    @cached_property
    def centres(self) -> FloatArray:
        """Centre of each solid's bounding box in the frame of the solid, shape (p, 3) [m]."""
        return np.array([each.centre for each in self.solids])

    @cached_property
    def halves(self) -> FloatArray:
        """Half edge lengths of each solid's bounding box, shape (p, 3) [m]."""
        return np.array([each.half for each in self.solids])

    @cached_property
    def arrays(self) -> tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
        """The solids as kernels take them.

        Kinds (p,), sizes (p, 3), planes of all faces (f, 4), index of each solid's first plane and f (p + 1,), centres
        and half edges of bounding boxes (p, 3); see `Solid`.
        """
        return (
            np.array([each.kind for each in self.solids], dtype=np.int64),
            np.array([each.size for each in self.solids]),
            np.concatenate([each.planes for each in self.solids]),
            np.cumsum([0, *(len(each.planes) for each in self.solids)], dtype=np.int64),
            self.centres,
            self.halves,
        )

    def equals(self, other: BodyShape) -> bool:
        """Return whether another body has the same solids."""
        if self is other:
            return True
        return all(np.array_equal(mine, theirs) for mine, theirs in zip(self.arrays, other.arrays, strict=True))


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedBody:
    """The shape of a body, with the pose of each of its p solids.

    Attributes:
        shape: The solids of the body.
        rotation: Axes of each solid in the array's frame, as columns, shape (p, 3, 3) [-].
        position: Origin of each solid in the array's frame, shape (p, 3) [m].
        back: Height below which parts of the body lie behind the array.  A body may reach round the array; where a
            vertical line enters it below this height, it presses on nothing [m].
    """

    shape: BodyShape
    rotation: FloatArray
    position: FloatArray
    back: float = -np.inf

    def equals(self, other: PosedBody, tolerance: float, length: float) -> bool:
        """Return whether another body has the same shape, and a pose that is equal up to a tolerance.

        Args:
            other: The other body.
            tolerance: Largest accepted difference of positions over `length`, and of entries of rotations [-].
            length: Length by which differences of positions are divided [m].
        """
        if not self.shape.equals(other.shape):
            return False
        close = compile_kernel(are_close)
        moved = not close(self.position.ravel(), other.position.ravel(), tolerance * length)
        return not moved and close(self.rotation.ravel(), other.rotation.ravel(), tolerance)


@dataclass(frozen=True, kw_only=True, eq=False)
class GapSamples:
    """The m cells of the contact grid under bodies; a cell under two bodies is listed for each body.

    All arrays have shape (m,).

    Attributes:
        body: Index of the body above the cell, from 0 and in rising order.
        row: Row of the cell in the contact grid.
        column: Column of the cell in the contact grid.
        coverage: Share of the cell's area that lies under the body [-].
        x: x of the centroid of the covered part of the cell, in the array's frame [m].
        y: y of the centroid of the covered part of the cell, in the array's frame [m].
        gap: Mean gap between the body's surface and the undeformed cover over the covered part [m].
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
        """Number m of cells, summed over all bodies."""
        return len(self.body)

    @cached_property
    def bodies(self) -> int:
        """Number of bodies."""
        return int(self.body[-1]) + 1

    @cached_property
    def bodies_found(self) -> list[int]:
        """Indices of the bodies that lie over at least one cell."""
        return np.bincount(self.body).nonzero()[0].tolist()

    @cached_property
    def lowest(self) -> FloatArray:
        """Smallest gap over the cells under each body, shape (bodies,) [m]."""
        return -self.find_largest(-self.gap)

    def find_largest(self, values: FloatArray) -> FloatArray:
        """Find the largest of some values, shape (m,), over the cells under each body, shape (bodies,)."""
        if self.bodies == 1:
            return np.array([values.max()])
        largest = np.full(self.bodies, -np.inf)
        np.maximum.at(largest, self.body, values)
        return largest


def sample_gap(grid: CellGrid, bodies: Sequence[PosedBody], reach: Sequence[float]) -> GapSamples:
    """Average the gap under each body over the cells of the contact grid.

    Args:
        grid: The contact grid.
        bodies: Shapes and poses of the bodies.
        reach: For each body, gap above the body's smallest gap up to which cells are kept [m].
    """
    found = [_sample_body(grid, body, height) for body, height in zip(bodies, reach, strict=True)]
    row, column, coverage, x, y, gap = (
        found[0] if len(found) == 1 else (np.concatenate(each) for each in zip(*found, strict=True))
    )
    body = np.repeat(np.arange(len(found)), [len(each[0]) for each in found])
    return GapSamples(body=body, row=row, column=column, coverage=coverage, x=x, y=y, gap=gap)


def _sample_body(grid: CellGrid, body: PosedBody, reach: float) -> Cells:
    """Average the gap under one body over the cells of the contact grid, up to `reach` above the smallest gap [m]."""
    kernel = compile_kernel(sample_body)
    return kernel(body.shape.arrays, body.shape.edge, body.rotation, body.position, grid.arrays, reach, body.back)
