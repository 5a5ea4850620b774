"""Contact on the cover itself: pressure that each cell shares with its neighbours through the cover's compliance.

Minimise f A f / 2 + gap f over cell forces f >= 0, with the force of every body (and its moments, where it is free to
tilt) prescribed: pressure only where surfaces touch, no overlap elsewhere.  The multipliers are the approach and the
two tilts of each body.  Conjugate gradients on the touching cells (Polonsky and Keer, Wear 231, 1999) with the
constraints projected out; A is a convolution on the cells of a window around the contact.

A cell that a body covers in part carries its force at the middle of the covered part: it acts on the four cells around
as their bilinear share, both ways, so A stays symmetric; and being smaller it yields more under its own force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import choose_kernel, find_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.cell_shares import shares_loops, shares_numpy
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.pressure.gap_sampling import Load, Samples
from fastmodel.pressure.iteration import iterate
from fastmodel.pressure.kernels import iterate_loops, scatter_loops
from fastmodel.pressure.winkler import foundation_forces

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Windows of cells are rounded up to a multiple of this, so that few spectra are needed.
_BLOCK = 4
#: Displacement at the middle of a square under unit force over half_space / edge: 4 asinh(1).
_SQUARE = 4 * float(np.arcsinh(1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Settings:
    """When the solver stops.

    Attributes:
        tolerance: Change of cell forces in one step over the load [-].
        steps: Most steps.
    """

    tolerance: float = 2e-4
    steps: int = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Cell forces and how they were found.

    Attributes:
        forces: On each sampled cell, shape (m,) [N].
        approach: Of each body from its first touch of the undeformed cover, shape (bodies,) [m].
        level: Height over each body's lowest point up to which its cells, moved with it, lie under the undeformed top,
            shape (bodies,) [m].
        steps: Steps taken.
        converged: Whether the tolerance was met.
        on_cells: From forces on sampled cells, shape (m,), to the same on a window of whole cells, (rows, columns) [N].
        origin: Row and column of the window's first cell in the grid.
    """

    forces: FloatArray
    approach: FloatArray
    level: FloatArray
    steps: int
    converged: bool
    on_cells: Callable[[FloatArray], FloatArray]
    origin: tuple[int, int]


class CoverSolver:
    """Solves contacts on one grid of cells, remembering the last one as a start for the next."""

    def __init__(self, cells: CoverCells, grid: CellGrid, settings: Settings, *, native: bool | None = False) -> None:
        """Prepare the kernel.

        Args:
            cells: The cover.
            grid: The cells of the array.
            settings: When to stop.
            native: True for compiled loops, False for numpy, None for whichever is there.
        """
        self._cells, self._grid, self._settings = cells, grid, settings
        kernel = cells.compliance / (cells.cell[0] * cells.cell[1])
        edge = float(np.sqrt(cells.cell[0] * cells.cell[1]))
        self.square = _SQUARE * cells.top_compliance / edge
        self.near = np.zeros((2, 2))
        known = kernel[:2, :2]
        self.near[: known.shape[0], : known.shape[1]] = known
        self.scatter = find_kernel(scatter_loops, native=native)
        self.shares = choose_kernel(shares_loops, shares_numpy, native=native)
        self._native = native
        self._modulus = cells.foundation_modulus()
        self.convolution = cells.convolution
        self._iterate = choose_kernel(iterate_loops, iterate, native=native)
        self._last: FloatArray | None = None
        self._pressed: tuple[IntArray, IntArray] | None = None
        self._operator: _Operator | None = None

    def reset(self) -> None:
        """Forget the last contact."""
        self._last = self._pressed = self._operator = None

    def solve(self, samples: Samples, loads: Sequence[Load], slid: tuple[int, int] = (0, 0)) -> Solution:
        """Find the cell forces of one contact.

        Args:
            samples: Cells under each body.
            loads: What each body presses with.
            slid: Rows and columns by which the bodies have slid since the last contact, so that it still is a start.
        """
        if self._operator is None or self._operator.samples is not samples:
            self._operator = _Operator(self, samples)
        operator = self._operator
        constraints = _Constraints(samples, loads)
        start = self._start(samples, loads, slid)
        found = self._find(operator, constraints, start)
        if not found.converged and any(load.tilts for load in loads):
            # moments that no pressure on these cells can carry: the pose that the engine gives stands for the tilt
            constraints = _Constraints(samples, [load.upright() for load in loads])
            found = self._find(operator, constraints, start)
        if not found.balanced:
            # numbers that got out of hand: springs carry the loads, whatever the cells
            springs = self._springs(samples, loads)
            found = _Found(forces=springs, motion=found.motion, steps=found.steps, converged=False, balanced=True)
        self._keep(samples, found.forces)
        return Solution(
            forces=found.forces,
            approach=found.motion[constraints.approach] - samples.lowest,
            level=samples.largest(constraints.columns @ found.motion) - samples.lowest,
            steps=found.steps,
            converged=found.converged,
            on_cells=operator.on_cells,
            origin=operator.origin,
        )

    def _find(self, operator: _Operator, constraints: _Constraints, start: FloatArray) -> _Found:
        cells = operator.target if self._iterate is iterate else operator.corner
        forces, motion, steps, converged = self._iterate(
            (
                (cells, operator.weight, operator.soft, *operator.matrices),
                operator.samples.gap,
                constraints.columns,
                constraints.target,
            ),
            start,
            self._settings.tolerance * constraints.total,
            self._settings.steps,
        )
        miss = np.abs(constraints.target - forces @ constraints.columns).max()
        return _Found(
            forces=forces,
            motion=motion,
            steps=int(steps),
            converged=bool(converged),
            balanced=bool(miss <= 1e-6 * constraints.total),
        )

    def _springs(self, samples: Samples, loads: Sequence[Load]) -> FloatArray:
        """The elastic foundation's answer, shape (m,) [N]."""
        area = self._cells.cell[0] * self._cells.cell[1]
        return foundation_forces(samples, loads, self._modulus * area * samples.coverage, native=self._native)[0]

    def _start(self, samples: Samples, loads: Sequence[Load], slid: tuple[int, int]) -> FloatArray:
        """The last solution on the cells that are still there, else the elastic foundation's."""
        if self._last is not None:
            row = np.clip(samples.row - slid[0], 0, self._grid.rows - 1)
            column = np.clip(samples.column - slid[1], 0, self._grid.columns - 1)
            start = self._last[row, column] * samples.coverage
            sums = np.bincount(samples.body, start, len(loads))
            want = np.array([load.force for load in loads])
            if (sums > 0.5 * want).all():
                return np.asarray(start * (want / sums)[samples.body])
        return self._springs(samples, loads)

    def _keep(self, samples: Samples, forces: FloatArray) -> None:
        if self._last is None:
            self._last = np.zeros((self._grid.rows, self._grid.columns))
        elif self._pressed is not None:
            self._last[self._pressed] = 0.0
        self._pressed = (samples.row, samples.column)
        self._last[self._pressed] = forces / samples.coverage


class _Operator:
    """Cell forces to displacements of the covered parts."""

    def __init__(self, solver: CoverSolver, samples: Samples) -> None:
        self.samples = samples
        grid = solver._grid  # noqa: SLF001 -- one unit with the solver
        first_row, first_column = int(samples.row.min()) - 1, int(samples.column.min()) - 1
        rows = -(-(int(samples.row.max()) + 2 - first_row) // _BLOCK) * _BLOCK
        columns = -(-(int(samples.column.max()) + 2 - first_column) // _BLOCK) * _BLOCK
        self._shape, self._scatter = (rows, columns), solver.scatter
        self.origin = (first_row, first_column)
        self.matrices = solver.convolution.matrices(rows, columns)
        self.corner = np.empty((2, samples.count), dtype=np.int64)
        self.weight, self.soft = np.empty((4, samples.count)), np.empty(samples.count)
        solver.shares(
            samples.coverage,
            samples.x,
            samples.y,
            grid.low,
            *grid.edge,
            first_row,
            first_column,
            solver.near,
            solver.square,
            self.corner,
            self.weight,
            self.soft,
        )

    @cached_property
    def target(self) -> IntArray:
        """Which four cells of the window, row by row, each sampled cell acts on, shape (4, m)."""
        columns = self._shape[1]
        first = self.corner[0] * columns + self.corner[1]
        return np.asarray(np.add.outer(np.array([0, 1, columns, columns + 1]), first))

    def on_cells(self, forces: FloatArray) -> FloatArray:
        """Forces shared among the window's cells, shape (rows, columns) [N]."""
        if self._scatter is not None:
            window = np.empty(self._shape)
            self._scatter(self.corner, self.weight, forces, window)
            return window
        size = self._shape[0] * self._shape[1]
        shared = np.bincount(self.target.ravel(), (self.weight * forces).ravel(), size)
        return shared.reshape(self._shape).astype(np.float64)


class _Constraints:
    """What each body's cell forces must add up to: columns (m, k) and target (k,)."""

    def __init__(self, samples: Samples, loads: Sequence[Load]) -> None:
        self.total = sum(load.force for load in loads)
        columns: list[FloatArray] = []
        target: list[FloatArray] = []
        self.approach: list[int] = []
        for body, load in enumerate(loads):
            mine = np.arange(samples.count) if len(loads) == 1 else (samples.body == body).nonzero()[0]
            own, wanted = load.constraints(samples, mine)
            if len(loads) == 1:
                self.approach, self.columns, self.target = [0], own, wanted
                return
            whole = np.zeros((samples.count, len(wanted)))
            whole[mine] = own
            self.approach.append(sum(map(len, target)))
            columns.append(whole)
            target.append(wanted)
        self.columns = np.concatenate(columns, axis=1)
        self.target = np.concatenate(target)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """Where the iteration ended: cell forces and the bodies' motions."""

    forces: FloatArray
    motion: FloatArray
    steps: int
    converged: bool
    balanced: bool
