"""A cover whose stiff top stretches under load: the tables for its solver and base forces follow the load.

The tables were fitted to a ball.  They apply to a body that sinks as deep as the ball under the same load.  A body with
a large face sinks less and stretches the cover less; the smaller load at which the ball is equally deep is then used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fastmodel.contact.panel_layout import ScatteredBaseForces
from fastmodel.pressure.cell_grid import BaseForces
from fastmodel.pressure.conjugate_gradient import CoverSolver, Load, PressureSolution
from fastmodel.pressure.gap_sampling import GapSamples
from fastmodel.state import State, take_array
from fastmodel.surface import CoverCells
from meshes.array_types import FloatArray

#: Depth of a body over that of the ball under the same load, above which the tables of this load are used [-].  It
#: allows for the error of depths, which depends on the position of a contact on the cells.
_ALIKE = 0.85
#: Largest number of solutions for the first reading of a contact and for later readings; and difference between the
#: load of the tables and the load at equal depth, in steps between tabulated loads, up to which a solution is accepted
#: [-].
_FIRST_SOLUTIONS, _SOLUTIONS, _CLOSE = 6, 2, 0.25


class StretchingCover:
    """Solver for cell forces and operator to texel forces, with tables that follow the load."""

    def __init__(
        self, cells: CoverCells, solver: CoverSolver, operators: Sequence[BaseForces | ScatteredBaseForces]
    ) -> None:
        """Store the parts.

        Args:
            cells: The cover.
            solver: Solver for the cell forces.
            operators: Operators to texel forces without load and at each of the loads of the cover.
        """
        self._cells, self._solver, self._operators = cells, solver, operators
        self.reset()

    def reset(self) -> None:
        """Discard the last solution."""
        self._solver.reset()
        self._load, self._share = 0.0, math.nan

    def get_state(self) -> State:
        """Return what the next solution starts from."""
        return {"stretching": np.array([self._load, self._share]), **self._solver.get_state()}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned."""
        self._load, self._share = take_array(state, "stretching").tolist()
        self._solver.set_state(state)

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Compute the forces on the cells under all bodies; see `CoverSolver.solve`.

        The body with the largest force determines the tables.
        """
        heaviest = int(np.argmax([load.force for load in loads]))
        force = loads[heaviest].force
        known = not math.isnan(self._share)
        share = self._share if known else 1.0
        for _ in range(_SOLUTIONS if known else _FIRST_SOLUTIONS):
            self._load = share * force
            solution = self._solver.solve(samples, loads, self._load)
            if solution.approach is None:
                break
            equal = min(force, self._cells.load_at_depth(float(solution.approach[heaviest]) / _ALIKE))
            share = math.sqrt(share * equal / force)
            position = self._cells.position_among_loads
            if abs(position(equal) - position(self._load)) < _CLOSE:
                break
        self._share = share
        return solution

    def from_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Compute the texel forces under forces on a window of cells; see `BaseForces.from_window`.

        The forces are interpolated between the tabulated loads, at the load of the last solution.
        """
        index, share = divmod(self._cells.position_among_loads(self._load), 1.0)
        found = self._operators[int(index)].from_window(forces, origin)
        if not share:
            return found
        return (1 - share) * found + share * self._operators[int(index) + 1].from_window(forces, origin)

    def from_texels(self, contact_forces: FloatArray) -> FloatArray:
        """Compute the texel forces under contact forces on texels, without load; see `BaseForces.from_texels`."""
        return self._operators[0].from_texels(contact_forces)
