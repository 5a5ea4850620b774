"""Pressure between rigid bodies and an elastic (Winkler) foundation, in which pressure displaces its own cell only.

The force on a cell is k max(0, d + s x + t y - g), with stiffness k, gap g and, for each body, an approach d and, where
the body is free to tilt, two slopes s and t.  The values of d, s and t are those at which the sums of the cell forces
equal the prescribed force and moments of the body.  They minimise a convex, piecewise quadratic function of d, s and t,
by Newton's method with step halving.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.conjugate_gradient import Load, PressureSolution
from fastmodel.pressure.gap_sampling import GapSamples
from fastmodel.state import State
from meshes.array_types import FloatArray

#: Largest number of Newton steps [-].
_STEPS = 60
#: Tolerance of the Newton iteration: errors of the force, and of the moments divided by a typical length, over the
#: prescribed force [-].
_BALANCED = 1e-9
#: Share of the full Newton step below which step halving ends [-].
_SHORTEST = 1e-6
#: Value added to the diagonal of the tangent matrix, over the summed stiffness of all cells; the matrix can then be
#: inverted even if few cells touch [-].
_RIDGE = 1e-9


class FoundationSolver:
    """Solver for the pressure on an elastic foundation."""

    def __init__(self, grid: CellGrid, modulus: float) -> None:
        """Compute the stiffness of a whole cell.

        Args:
            grid: The contact grid of the array.
            modulus: Modulus of the foundation, pressure per displacement [Pa/m].
        """
        self._stiffness = modulus * grid.edge[0] * grid.edge[1]
        self._match = compile_kernel(match_springs)

    def reset(self) -> None:
        """Do nothing, because a solution does not depend on previous solutions."""

    def get_state(self) -> State:
        """Return no arrays, for the same reason."""
        return {}

    def set_state(self, state: State) -> None:
        """Do nothing, for the same reason."""

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Compute the forces on the cells under all bodies.

        Args:
            samples: Cells under each body, with their gaps.
            loads: Force and moments of each body.
        """
        forces, surface = np.zeros(samples.count), np.zeros(samples.count)
        for body, load in enumerate(loads):
            own = (samples.body == body).nonzero()[0]
            if not len(own):
                continue
            for tried in (load, load.without_moments()):
                columns, target = tried.build_constraints(samples, own)
                forces[own], surface[own], found = self._match(
                    columns, samples.gap[own], self._stiffness * samples.coverage[own], target
                )
                if found:
                    break
        return PressureSolution(forces=forces, height=samples.find_largest(surface) - samples.lowest)


def match_springs(
    columns: FloatArray, gap: FloatArray, stiffness: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """Kernel: find the motion of one body at which the springs of m cells carry the body's force and moments.

    Args:
        columns: Columns of the k constraints, see `Load.build_constraints`, shape (m, k).
        gap: Gap between body and cover at each cell, shape (m,) [m].
        stiffness: Force per displacement of each cell, shape (m,) [N/m].
        target: Prescribed values of the constraints, shape (k,) [N].

    Returns:
        Force on each cell, shape (m,) [N]; gap below which each cell is in contact, shape (m,) [m]; whether the
        constraints are satisfied.
    """
    motion = np.zeros(len(target))
    motion[0] = gap.min() + target[0] / stiffness.sum()
    height = np.dot(columns, motion)
    forces = stiffness * np.maximum(height - gap, 0.0)
    value = 0.5 * np.dot(forces, height - gap) - np.dot(motion, target)
    for _ in range(_STEPS):
        miss = target - np.dot(forces, columns)
        if np.abs(miss).max() <= _BALANCED * target[0]:
            return forces * (target[0] / np.dot(forces, columns)[0]), height, True
        weighted = columns * (stiffness * (forces > 0)).reshape(len(gap), 1)
        tangent = np.dot(np.ascontiguousarray(weighted.T), columns) + _RIDGE * stiffness.sum() * np.eye(len(target))
        step, share, before = np.linalg.solve(tangent, miss), 1.0, value
        while True:
            height = np.dot(columns, motion + share * step)
            forces = stiffness * np.maximum(height - gap, 0.0)
            value = 0.5 * np.dot(forces, height - gap) - np.dot(motion + share * step, target)
            if value <= before or share <= _SHORTEST:
                break
            share /= 2
        motion = motion + share * step
    return forces, height, False
