"""Pressure between rigid bodies and the cover, by conjugate gradients (Polonsky and Keer, Wear 231, 1999).

Minimise f A f / 2 + g f over the cell forces f >= 0, where A is the compliance of the cover between cells and g the gap
of the undeformed surfaces.  The force of every body is prescribed, and its two moments where the body is free to tilt.
The solution has pressure only where the surfaces touch and no overlap elsewhere.  The multipliers of the constraints
are the approach and the two tilts of each body.  The constraints are projected out of the residual and of the search
direction.

A acts as a convolution on a window of whole cells around the contact.  The force on a partly covered cell acts at the
centroid of its covered part: it is divided bilinearly among the four nearest whole cells, and the displacement is
interpolated with the same weights, so that A stays symmetric.  A smaller loaded area also yields more under its own
force; this self compliance is added on the diagonal.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.conjugate_gradient_kernels import find_start, minimise_energy, place_cells
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.pressure.gap_sampling import GapSamples
from meshes.array_types import FloatArray, IntArray

#: Displacement at the centre of a square under a uniform pressure of unit force on a half space, over top compliance
#: divided by edge length: 4 asinh(1) [-].
_SQUARE = 4 * float(np.arcsinh(1.0))
#: Fewest cells on which moments are prescribed: three points define a plane.
_PLANE = 3
#: Length by which the lever arms of moments are divided: the size of a typical contact [m].
_LEVER = 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class Load:
    """The force and moments with which one body presses.

    Attributes:
        force: Against the array's normal [N].
        moment: Sums of force times x and of force times y over the contact points, in the array's frame, shape (2,)
            [N m].
        tilts: Whether the body is free to tilt.  Only then do the moments say where it presses; otherwise a guide takes
            them up.
    """

    force: float
    moment: FloatArray
    tilts: bool

    def equals(self, other: Load, tolerance: float, length: float) -> bool:
        """Whether another load is the same up to a tolerance.

        Args:
            other: The other load.
            tolerance: Largest difference of the forces, over the force; and of the moments, over force times length
                [-].
            length: The length [m].
        """
        moment = np.abs(self.moment - other.moment).max()
        return bool(max(abs(self.force - other.force), moment / length) <= tolerance * self.force)

    def without_moments(self) -> Load:
        """The same load with the force prescribed only."""
        return dataclasses.replace(self, tilts=False)

    def build_constraints(self, samples: GapSamples, own: IntArray | slice) -> tuple[FloatArray, FloatArray]:
        """Linear constraints columns.T @ forces = target on the body's cell forces.

        The first column is that of the force, so its multiplier is the approach.

        Args:
            samples: Cells under all bodies.
            own: Which of them are this body's, shape (m,).

        Returns:
            Columns, shape (m, k), and target, shape (k,).
        """
        x, y = samples.x[own], samples.y[own]
        if not self.tilts or len(x) < _PLANE:
            return np.ones((len(x), 1)), np.array([self.force])
        # about the centre of pressure and over a typical length: the unknowns are then of similar magnitude
        centre = (self.moment / (self.force * _LEVER)).tolist()
        columns = np.ones((len(x), 3))
        columns[:, 1] = x / _LEVER - centre[0]
        columns[:, 2] = y / _LEVER - centre[1]
        return columns, np.array([self.force, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureSolution:
    """Forces on cells.

    Attributes:
        forces: On each sampled cell, shape (m,) [N].
        height: Height over each body's lowest cell up to which the body lies below the undeformed surface, shape
            (bodies,) [m].
        approach: Of each body from first touch of the undeformed cover, shape (bodies,); None where not computed [m].
        window: The same forces on a window of whole cells, shape (rows, columns); None where not computed [N].
        origin: Row and column of the window's first cell in the grid.
        steps: Steps taken.
        converged: Whether the tolerance was met.
    """

    forces: FloatArray
    height: FloatArray
    approach: FloatArray | None = None
    window: FloatArray | None = None
    origin: tuple[int, int] = (0, 0)
    steps: int = 0
    converged: bool = True


class CoverSolver:
    """Solves one contact after another on the same array; each solution is the start of the next."""

    def __init__(self, cells: CoverCells, grid: CellGrid, *, tolerance: float = 2e-4, steps: int = 200) -> None:
        """Prepare the compliance.

        Args:
            cells: The cover.
            grid: The cells of the array.
            tolerance: Change of the cell forces in one step at which the solver stops, over the load [-].
            steps: Most steps.
        """
        self._grid, self._tolerance, self._steps = grid, tolerance, steps
        self._convolution = cells.convolution
        kernel = cells.compliance / (cells.cell[0] * cells.cell[1])
        self._square = _SQUARE * cells.top_compliance / float(np.sqrt(cells.cell[0] * cells.cell[1]))
        self._near = np.zeros((2, 2))
        self._near[: min(2, len(kernel)), : min(2, kernel.shape[1])] = kernel[:2, :2]
        self._place, self._start = compile_kernel(place_cells), compile_kernel(find_start)
        self._minimise = compile_kernel(minimise_energy)
        self._scratch = np.zeros((grid.rows, grid.columns))
        self.reset()

    def reset(self) -> None:
        """Forget the last contact."""
        self._last = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Find the cell forces of one contact.

        If no pressure on the sampled cells can have the prescribed moments, only the forces are prescribed, and the
        bodies keep the tilt of their pose.

        Args:
            samples: Cells under each body.
            loads: Load of each body.
        """
        cells = (samples.row, samples.column, samples.coverage, samples.x, samples.y)
        origin, shape, corner, weight, own = self._place(cells, self._grid.arrays, self._near, self._square)
        cover = (corner, weight, own, *self._convolution.matrices(*shape))
        wanted = np.array([load.force for load in loads])
        start = self._start(
            self._last, (samples.row, samples.column, samples.coverage, samples.body), wanted, self._scratch
        )
        tolerance = self._tolerance * float(wanted.sum())
        columns, target, approach = _join_constraints(samples, loads)
        found = self._minimise(cover, samples.gap, columns, target, start, tolerance, self._steps)
        if not found[-1] and any(load.tilts for load in loads):
            columns, target, approach = _join_constraints(samples, [load.without_moments() for load in loads])
            found = self._minimise(cover, samples.gap, columns, target, start, tolerance, self._steps)
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


def _join_constraints(samples: GapSamples, loads: Sequence[Load]) -> tuple[FloatArray, FloatArray, list[int]]:
    """Constraints of all bodies: columns (m, k), target (k,), and the column of each body's force."""
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
