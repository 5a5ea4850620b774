"""Pressure between rigid bodies and the cover, by conjugate gradients (Polonsky and Keer, Wear 231, 1999).

Minimise f A f / 2 + g f over the cell forces f >= 0, where A is the compliance of the cover between cells and g the gap
of the undeformed surfaces.  The force of every body is prescribed; for a body that is free to tilt, two moments are
prescribed too.  In the solution, pressure acts only where the surfaces touch, and the surfaces overlap nowhere.  The
Lagrange multipliers of the prescribed forces and moments are the approach and the two tilts of each body.  The residual
and the search direction are projected on the subspace that satisfies these constraints.

A acts as a convolution on a window (rectangle of cells of the contact grid) around the contact.  The force on a partly
covered cell acts at the centroid of the covered part: the force is divided bilinearly among the four nearest whole
cells, and the displacement is interpolated with the same weights, so that A stays symmetric.  A force on a smaller area
also displaces that area more; this additional self compliance is added to the diagonal of A.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.conjugate_gradient_kernels import minimise_energy
from fastmodel.pressure.gap_sampling import GapSamples
from fastmodel.pressure.preparation_kernels import are_close, find_start, place_cells
from fastmodel.state import State, take_array
from fastmodel.surface import CoverCells
from meshes.array_types import FloatArray, IntArray

#: Displacement at the centre of a square on an elastic half space under uniform pressure of unit force, divided by
#: `CoverCells.top_compliance` and multiplied by the edge length of the square: 4 asinh(1) [-].
_SQUARE = 4 * float(np.arcsinh(1.0))
#: Change of the forces that is still missing, over the tolerance, below which the iteration stops [-].  The residual
#: times the largest stiffness of the cover bounds this change.  The share is below 1 because errors of starts that are
#: accepted one after the other add up.
_MISSING = 0.25
#: Smallest number of cells under a body with which moments are prescribed [-]: three points define a plane.
_PLANE = 3
#: Length by which the lever arms of moments are divided, so that the constraints on force and moments are of similar
#: magnitude: the size of a typical contact [m].
_LEVER = 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class Load:
    """The force and moments with which one body presses on the array.

    Attributes:
        force: Force of the body against the array's normal [N].
        moment: Sums over the contact points of force times x and of force times y, in the array's frame, shape (2,)
            [N m].
        tilts: Whether the body is free to tilt.  If so, the moments determine where the body presses.  Otherwise a
            guide of the body takes up moments, and they are not prescribed.
    """

    force: float
    moment: FloatArray
    tilts: bool

    def equals(self, other: Load, tolerance: float, length: float) -> bool:
        """Return whether another load is equal up to a tolerance.

        Args:
            other: The other load.
            tolerance: Largest accepted difference of the forces over the force, and of the moments over force times
                `length` [-].
            length: Lever arm by which differences of moments are divided [m].
        """
        if abs(self.force - other.force) > tolerance * self.force:
            return False
        return compile_kernel(are_close)(self.moment, other.moment, length * tolerance * self.force)

    def without_moments(self) -> Load:
        """Return the same load with only the force prescribed, not the moments."""
        return dataclasses.replace(self, tilts=False)

    def build_constraints(self, samples: GapSamples, own: IntArray | slice) -> tuple[FloatArray, FloatArray]:
        """Build the k linear constraints columns.T @ forces = target on the forces on the m cells under the body.

        The first constraint prescribes the force of the body, so its Lagrange multiplier is the approach of the body.

        Args:
            samples: Cells under all bodies.
            own: Indices of the cells under this body, shape (m,).

        Returns:
            Columns, shape (m, k), and target, shape (k,) [N].
        """
        x, y = samples.x[own], samples.y[own]
        if not self.tilts or len(x) < _PLANE:
            return np.ones((len(x), 1)), np.array([self.force])
        # moments about the centre of pressure, divided by a typical length: the unknowns are then of similar magnitude
        centre = (self.moment / (self.force * _LEVER)).tolist()
        columns = np.ones((len(x), 3))
        columns[:, 1] = x / _LEVER - centre[0]
        columns[:, 2] = y / _LEVER - centre[1]
        return columns, np.array([self.force, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureSolution:
    """Forces on the cells of the contact grid, and the approach of each body.

    Attributes:
        forces: Force on each of the m cells under bodies, shape (m,) [N].
        height: For each body, the height above its smallest gap up to which the body's surface lies below the
            undeformed top of the cover, shape (bodies,) [m].
        approach: Approach of each body since its first touch of the undeformed cover, shape (bodies,) [m]; None if not
            computed.
        window: The forces as forces on a window (rectangle) of whole cells, shape (rows, columns) [N]; None if not
            computed.
        origin: Row and column in the contact grid of the first cell of the window.
        steps: Number of steps of the iteration [-].
        converged: Whether the iteration met its tolerance.
    """

    forces: FloatArray
    height: FloatArray
    approach: FloatArray | None = None
    window: FloatArray | None = None
    origin: tuple[int, int] = (0, 0)
    steps: int = 0
    converged: bool = True


class CoverSolver:
    """Solver for the pressure on a cover; the iteration of each contact starts from the previous solution."""

    def __init__(self, cells: CoverCells, grid: CellGrid, *, tolerance: float = 2e-4, steps: int = 200) -> None:
        """Prepare the compliance of the cover between cells.

        Args:
            cells: The cover.
            grid: The contact grid of the array.
            tolerance: Tolerance of the iteration: sum of the changes of cell forces in one step, over the load, below
                which the iteration stops [-].
            steps: Largest number of steps of the iteration [-].
        """
        self._grid, self._tolerance, self._steps, self._cells = grid, tolerance, steps, cells
        self._square = _SQUARE * cells.top_compliance / float(np.sqrt(cells.cell[0] * cells.cell[1]))
        self._near = [_find_near_compliance(each) for each in cells.under_loads]
        self._stiffest = [_find_largest_stiffness(each) for each in cells.under_loads]
        self._place, self._start = compile_kernel(place_cells), compile_kernel(find_start)
        self._minimise = compile_kernel(minimise_energy)
        self._scratch = np.zeros((grid.rows, grid.columns))
        self.reset()

    def reset(self) -> None:
        """Discard the last solution; the next iteration starts from uniform pressure."""
        self._last = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))

    def get_state(self) -> State:
        """Return the last solution: row, column and pressure times area [N] of each of m cells, shape (3, m)."""
        return {"last": np.array(self._last, dtype=np.float64)}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned."""
        row, column, pressure = take_array(state, "last")
        self._last = (row.astype(np.int64), column.astype(np.int64), pressure.copy())

    def solve(self, samples: GapSamples, loads: Sequence[Load], stretching: float | None = None) -> PressureSolution:
        """Compute the forces on the cells under all bodies.

        If the iteration with the prescribed moments does not converge, for example because no pressure on the cells has
        these moments, only the forces of the bodies are prescribed, and the bodies keep their tilt.

        Args:
            samples: Cells under each body, with their gaps.
            loads: Force and moments of each body.
            stretching: Load whose nearest tables are used, for a cover that depends on the load; by default the largest
                force of a body [N].
        """
        cells = (samples.row, samples.column, samples.coverage, samples.x, samples.y)
        largest = max(load.force for load in loads)
        nearest = round(self._cells.position_among_loads(largest if stretching is None else stretching))
        origin, shape, corner, weight, own = self._place(cells, self._grid.arrays, self._near[nearest], self._square)
        cover = (corner, weight, own, *self._cells.under_loads[nearest].convolution.matrices(*shape))
        wanted = np.array([load.force for load in loads])
        start = self._start(
            self._last, (samples.row, samples.column, samples.coverage, samples.body), wanted, self._scratch
        )
        tolerance = self._tolerance * float(wanted.sum())
        limits = (tolerance, _MISSING * tolerance / self._stiffest[nearest], self._steps)
        columns, target, approach = _join_constraints(samples, loads)
        found = self._minimise(cover, samples.gap, columns, target, start, limits)
        if not found[-1] and any(load.tilts for load in loads):
            columns, target, approach = _join_constraints(samples, [load.without_moments() for load in loads])
            found = self._minimise(cover, samples.gap, columns, target, start, limits)
        forces, window, motion, steps, converged = found
        self._last = (samples.row, samples.column, forces / samples.coverage)
        return PressureSolution(
            forces=forces,
            height=samples.find_largest(columns.dot(motion)) - samples.lowest,
            approach=motion[approach] - samples.lowest,
            window=window,
            origin=origin,
            steps=steps,
            converged=converged,
        )


def _find_near_compliance(cells: CoverCells) -> FloatArray:
    """Return the compliance between cells that lie 0 or 1 rows and columns apart, shape (2, 2) [m/N]."""
    kernel = cells.compliance[:2, :2] / (cells.cell[0] * cells.cell[1])
    near = np.zeros((2, 2))
    near[: len(kernel), : kernel.shape[1]] = kernel
    return near


def _find_largest_stiffness(cells: CoverCells) -> float:
    """Return the force over displacement of cells that are pushed and pulled in turn, like a chessboard [N/m].

    The compliance of a cover decreases with the wave number, so that this is the stiffest of all patterns.
    """
    kernel = cells.compliance / (cells.cell[0] * cells.cell[1])
    signs = np.where(np.arange(max(kernel.shape)) % 2, -2.0, 2.0)
    signs[0] = 1.0
    return float(1 / (signs[: len(kernel)] @ kernel @ signs[: kernel.shape[1]]))


def _join_constraints(samples: GapSamples, loads: Sequence[Load]) -> tuple[FloatArray, FloatArray, list[int]]:
    """Join the constraints of all bodies, see `Load.build_constraints`.

    Returns:
        Columns of k constraints on the m cell forces, shape (m, k); target, shape (k,) [N]; and for each body the index
        of the column that prescribes its force.
    """
    if len(loads) == 1:
        return *loads[0].build_constraints(samples, slice(None)), [0]
    columns: list[FloatArray] = []
    targets: list[FloatArray] = []
    first: list[int] = []
    for body, load in enumerate(loads):
        own = (samples.body == body).nonzero()[0]
        part, target = load.build_constraints(samples, own)
        column = np.zeros((samples.count, len(target)))
        column[own] = part
        first.append(sum(len(each) for each in targets))
        columns.append(column)
        targets.append(target)
    return np.concatenate(columns, axis=1), np.concatenate(targets), first
