"""Pressure between rigid bodies and an elastic (Winkler) foundation: each cell yields under its own pressure only.

The force on a cell is k max(0, d + s x + t y - g), with stiffness k, gap g and, for each body, an approach d and, where
the body is free to tilt, two slopes s and t.  They are chosen such that the force and the moments are the prescribed
ones.  This minimises a convex, piecewise quadratic function of d, s and t, by Newton's method with step halving.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.conjugate_gradient import Load, PressureSolution
from fastmodel.pressure.gap_sampling import GapSamples
from meshes.array_types import FloatArray

#: Most Newton steps.
_STEPS = 60
#: Error of force and moments at which the iteration ends, over the force [-].
_BALANCED = 1e-9
#: Shortest Newton step that is tried, over the full one [-].
_SHORTEST = 1e-6
#: Ridge added to the tangent matrix, over the stiffness of all cells; keeps it regular while few cells touch [-].
_RIDGE = 1e-9


class FoundationSolver:
    """Solves contacts on an elastic foundation."""

    def __init__(self, grid: CellGrid, modulus: float) -> None:
        """Prepare the stiffness of a cell.

        Args:
            grid: The cells of the array.
            modulus: Pressure per depth [Pa/m].
        """
        self._stiffness = modulus * grid.edge[0] * grid.edge[1]
        self._match = compile_kernel(match_springs)

    def reset(self) -> None:
        """Do nothing: a solution does not depend on earlier ones."""

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Find the cell forces of one contact.

        Args:
            samples: Cells under each body.
            loads: Load of each body.
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
    """Kernel: find the motion of one body under which its springs carry the load.

    Args:
        columns: Columns of the constraints, shape (m, k).
        gap: Gap over each cell, shape (m,) [m].
        stiffness: Force per depth of each cell, shape (m,) [N/m].
        target: Values of the constraints, shape (k,).

    Returns:
        Force on each cell, shape (m,) [N]; gap of each cell up to which it would touch, shape (m,) [m]; whether the
        constraints are met.
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
