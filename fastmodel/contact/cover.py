"""Contact methods that distribute the force of each touching body over the cells of the contact grid.

In MuJoCo each of the two contact methods has one rigid plate for each flat panel of the array.  After a simulation
step, MuJoCo's force of each touching body is distributed over cells of the contact grid, which are smaller than a
texel.  `Foundation` uses an elastic foundation.  `CoverContact` uses the compliance of the cover, in which a force on
one cell also displaces the other cells; `CoverContact` also computes the texel forces at the base of the cover.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import mujoco
import numpy as np

from fastmodel.contact.interface import ContactReader, Reading
from fastmodel.contact.panel_layout import PanelLayout, ScatteredBaseForces, ScatteredGrid, divide_into_panels, lay_out
from fastmodel.contact.panels import PanelReader, Wrench
from fastmodel.contact.plate import Plate, PlateContact, PlateReader
from fastmodel.contact.stretching import StretchingCover
from fastmodel.errors import ParametersError
from fastmodel.pose import Mount
from fastmodel.pressure.cell_grid import BaseForces, CellGrid
from fastmodel.pressure.conjugate_gradient import CoverSolver, Load, PressureSolution
from fastmodel.pressure.gap import Solid
from fastmodel.pressure.gap_sampling import BodyShape, GapSamples, PosedBody
from fastmodel.pressure.winkler import FoundationSolver
from fastmodel.state import State, pack, take_array, unpack
from fastmodel.surface import CoverCells, Surface
from fastmodel.validity import FEWEST_CELLS
from meshes import TexelArray
from meshes.array_types import FloatArray

#: The reach of a body is the height above its smallest gap up to which cells are sampled.  The three numbers are: the
#: reach at first contact, over the cover's thickness (for `Foundation` over the pitch); and the largest and the
#: smallest reach, over the reach at first contact [-].
_FIRST, _MOST, _SMALLEST = 0.1, 20.0, 0.25
#: Two factors on the height up to which a body lies below the undeformed top of the cover; each gives a reach [-].  The
#: first gives the reach that a contact requires; it exceeds 1 because the cover may bulge beside the contact.  The
#: second gives the reach that is used for the next solution; it is larger, so that this reach suffices while the load
#: rises.
_NEEDED, _TAKEN = 1.2, 1.6
#: Distance by which solids with sharp edges are enlarged, over the edge length of a cell; `fastmodel.pressure.gap`
#: explains why [-].
_EDGE = 0.125
#: Relative change of loads, change of positions over the edge length of a cell, and change of rotations, up to which a
#: contact counts as unchanged, so that the last reading is returned [-].  Bodies at rest in MuJoCo vary by about 1e-6.
_UNCHANGED = 1e-5
#: Number of cells along each texel pitch if neither the contact method nor the parameters define it [-].
_CELLS = 4
#: Types of the parts of a solution, for `unpack`.
_STORED = (PlateContact, Load, Wrench, PosedBody, BodyShape, Solid, Reading)


@dataclass(frozen=True, kw_only=True)
class _PlateMethod:
    """Base class of the contact methods that represent the array in MuJoCo by rigid plates, one for each flat panel.

    Attributes:
        plate: Settings of the plates.
    """

    plate: Plate = field(default_factory=Plate)

    costly: ClassVar[bool] = True
    computes_spread: ClassVar[bool] = False
    takes_overlaps: ClassVar[bool] = False

    def attach(self, body: mujoco.MjsBody, array: TexelArray, pose: Mount, name: str) -> None:
        """Add the plate to a body of the spec; see `TexelContact.attach`."""
        self.plate.attach(body, array, pose, name)

    def adapt(self, surface: Surface | None) -> Self:
        """Return the method with a plate that ends at the texels if the cover has free side edges there."""
        if not isinstance(surface, CoverCells) or surface.table is None:
            return self
        return replace(self, plate=replace(self.plate, margin=0))


@dataclass(frozen=True, kw_only=True)
class Foundation(_PlateMethod):
    """Contact method with a rigid plate, which distributes the force of each body by an elastic foundation of cells.

    Attributes:
        plate: Settings of the plate.
        modulus: Pressure on the foundation per displacement; by default that of the cover under a square patch four
            thicknesses wide [Pa/m].
        per_texel: Number of cells along each texel pitch; by default as in the cover data, or 4 without cover data [-].
    """

    modulus: float | None = None
    per_texel: int | None = None

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> ContactReader:
        """Find the plate in the compiled model; see `TexelContact.bind`.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If there is neither a modulus nor cover data.
        """
        cells = surface if isinstance(surface, CoverCells) else None
        if self.modulus is None and cells is None:
            raise ParametersError(
                f"sensor {name!r}: the contact method 'foundation' needs the cover's cells or a modulus; derive the "
                f"parameters anew, or use Foundation(modulus=...)"
            )
        modulus = self.modulus or (cells.foundation_modulus() if cells else 0.0)
        division = _Division.of(self.plate, array, self.per_texel or (cells.per_texel if cells else _CELLS))
        solver = FoundationSolver(division.grid, modulus)
        reader = division.build_plate_reader(model, array, name)
        return _PressureReader(reader, solver, division, first=_FIRST * min(array.pitch))


@dataclass(frozen=True, kw_only=True)
class CoverContact(_PlateMethod):
    """Contact method with a rigid plate, which distributes the force of each body by the compliance of the cover.

    The method also computes the forces on the texels at the base of the cover.

    Attributes:
        plate: Settings of the plate.
        tolerance: Tolerance of the iteration: sum of the changes of cell forces in one step, over the load, below which
            the solver stops [-].  Texel forces with 2e-3 differ from those with 5e-4 by at most 0.02 % of the load.
        steps: Most steps of the solver.
    """

    tolerance: float = 2e-3
    steps: int = 100

    computes_spread: ClassVar[bool] = True

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> ContactReader:
        """Find the plate in the compiled model.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If the parameters hold no cover data for this pitch.
        """
        if not isinstance(surface, CoverCells):
            raise ParametersError(
                f"sensor {name!r}: the contact method 'cover' needs the cover's cells, which these parameters do not "
                f"hold; derive them anew, or use 'boxes' or 'area'"
            )
        surface.check(array)
        division = _Division.of(self.plate, array, surface.per_texel, apart=max(surface.compliance.shape))
        solver = CoverSolver(surface, division.grid, tolerance=self.tolerance, steps=self.steps)
        operators = [division.build_base_forces(each, array) for each in surface.under_loads]
        base = StretchingCover(surface, solver, operators)
        reader = division.build_plate_reader(model, array, name)
        return _PressureReader(reader, base, division, base, first=_FIRST * surface.thickness)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Division:
    """The cells of an array: one contact grid if the array is flat and regular, else panels on a common contact grid.

    Attributes:
        plate: Settings of the plate.
        grid: The contact grid, or the common contact grid of all panels.
        layout: The flat panels of the array; None if the array is flat and regular.
    """

    plate: Plate
    grid: CellGrid
    layout: PanelLayout | None = None

    @classmethod
    def of(cls, plate: Plate, array: TexelArray, per_texel: int, *, apart: int = 1) -> _Division:
        """Divide an array and the margin of its plate into cells.

        Args:
            plate: Settings of the plate.
            array: The texels.
            per_texel: Number of cells along each texel pitch [-].
            apart: Number of cells between panels that do not interact [-].
        """
        if array.regular:
            return cls(plate=plate, grid=CellGrid.over(array, per_texel, plate.margin))
        layout = lay_out(array, divide_into_panels(array, plate.margin), per_texel, apart)
        return cls(plate=plate, grid=layout.grid, layout=layout)

    @property
    def coherent(self) -> bool:
        """Whether all cells lie in one plane, so that the approach of a body is one number."""
        return self.layout is None or len(self.layout.panels) == 1

    def build_plate_reader(self, model: mujoco.MjModel, array: TexelArray, name: str) -> PlateReader:
        """Build the reader that finds the bodies on the plate, or on the plates of all panels."""
        edge = _EDGE * float(np.sqrt(self.grid.edge[0] * self.grid.edge[1]))
        if self.layout is None:
            return PlateReader(self.plate, model, array, name, grid=self.grid, edge=edge)
        return PanelReader(self.plate, model, array, name, layout=self.layout, edge=edge)

    def build_base_forces(self, cells: CoverCells, array: TexelArray) -> BaseForces | ScatteredBaseForces:
        """Build the operator from forces on cells to forces on texels at the base of the cover."""
        if self.layout is not None and isinstance(self.grid, ScatteredGrid):
            return ScatteredBaseForces(cells, self.layout, self.grid, array)
        return BaseForces(cells, self.grid, array)


class _PressureReader:
    """Reader that computes texel forces from the bodies on a plate.

    The reader samples the gap under the bodies, solves for the forces on cells, and sums these forces over texels.
    """

    def __init__(
        self,
        plate: PlateReader,
        solver: StretchingCover | FoundationSolver,
        division: _Division,
        base: StretchingCover | None = None,
        *,
        first: float,
    ) -> None:
        """Store the parts, and start in the state without contacts.

        Args:
            plate: Reader that finds the bodies on the plate.
            solver: Solver that computes the forces on cells.
            division: The cells of the array.
            base: Operator from forces on cells to forces at the base; None for a method that does not compute them.
            first: Reach at the first contact of a body, see `_FIRST` [m].
        """
        self._plate, self._solver, self._base, self._grid = plate, solver, base, division.grid
        self._coherent, self._regular = division.coherent, division.layout is None
        self._first, self._most = first, _MOST * first
        self._reach: dict[int, float] = {}
        self._solved: tuple[PlateContact, Reading] | None = None
        self._nothing = self.at_rest(np.zeros(self._grid.texels))

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, and discard previous solutions; see `ContactReader.at_rest`."""
        self._reach.clear()
        self._solved = None
        self._solver.reset()
        self._plate.reset()
        base = None if self._base is None else self._base.from_texels(contact_forces)
        return self._plate.net_force.add_at_rest(Reading(contact_forces, base, float(contact_forces.sum())))

    def get_state(self) -> State:
        """Return the last solution and what the next one starts from; see `ContactReader.get_state`."""
        reach = np.array(list(self._reach.items()), dtype=np.float64).reshape(-1, 2)
        return {"reach": reach, **pack("solved", self._solved), **self._solver.get_state()}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned; see `ContactReader.set_state`."""
        self._reach = {int(body): float(reach) for body, reach in take_array(state, "reach")}
        self._solved = unpack(state, "solved", _STORED)
        self._solver.set_state(state)

    def compile_kernels(self, data: mujoco.MjData) -> None:
        """Compile every kernel by solving the contact of a ball of one pitch in diameter under a load of 1 N."""
        self._plate.compile_kernels(data)
        contact = self._plate.imitate_ball(0.5 * float(max(self._grid.edge)) * self._grid.per_texel)
        contact.equals(contact, _UNCHANGED, 1.0)
        self._solver.solve(self._plate.sample_gap(contact, [np.inf]), contact.loads)
        self._solver.reset()

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of a step, or return the last ones if no load or pose has changed."""
        found = self._plate.find_contact(data)
        if found is None:
            return self._nothing
        contact, sums = found
        if self._solved is None or not contact.equals(self._solved[0], _UNCHANGED, min(self._grid.edge)):
            self._solved = (contact, self._solve(contact))
        return self._plate.net_force.add(self._solved[1], sums)

    def _solve(self, contact: PlateContact) -> Reading:
        """Compute the cell forces with a sufficient reach for each body, and sum the forces over texels."""
        reach = [self._reach.get(body, self._first) for body in contact.bodies]
        while reach:
            samples = self._plate.sample_gap(contact, reach)
            found = samples.bodies_found
            if len(found) < len(reach):
                # no cell is in front of the shape of these bodies: their contact points stand for them
                contact, reach = contact.select(found), [reach[k] for k in found]
                continue
            solution = self._solver.solve(samples, contact.loads)
            height = np.where(np.isfinite(solution.height), solution.height, self._first).tolist()
            needed = [
                min(_TAKEN * top, self._most) if have < min(_NEEDED * top, self._most) else have
                for have, top in zip(reach, height, strict=True)
            ]
            if needed == reach:
                for body, top in zip(contact.bodies, height, strict=True):
                    self._reach[body] = min(max(_TAKEN * top, _SMALLEST * self._first), self._most)
                return self._add_points(contact, self._sum(contact, samples, solution))
            # The solution on fewer cells is a poor start: where it is exact, the iteration would not add cells.
            self._solver.reset()
            reach = needed
        return self._add_points(contact, self._nothing)

    def _sum(self, contact: PlateContact, samples: GapSamples, solution: PressureSolution) -> Reading:
        """Sum the forces on cells over texels, at the top and, if the method computes them, at the base."""
        pressed = np.bincount(samples.body, solution.forces > 0, len(contact.loads))
        texel_forces = None
        if self._base is not None and solution.window is not None:
            window, origin = solution.window, solution.origin
            if len(pressed) == 1 and pressed[0] < FEWEST_CELLS and self._regular:
                load = contact.loads[0]
                window, origin = self._grid.shift_window(window, origin, load.moment / load.force)
            texel_forces = self._base.from_window(window, origin)
        return Reading(
            contact_forces=self._grid.sum_on_texels(samples.row, samples.column, solution.forces),
            texel_forces=texel_forces,
            carried=float(solution.forces.sum()),
            approach=solution.approach if self._coherent else None,
            fewest_cells=int(pressed.min()),
        )

    def _add_points(self, contact: PlateContact, reading: Reading) -> Reading:
        """Add the point forces of a contact, and the force beside the front of the array, to a reading."""
        carried = reading.carried + contact.beside
        if not len(contact.points):
            return reading._replace(carried=carried) if contact.beside else reading
        row, column, forces = self._grid.divide_points(contact.points)
        contact_forces = reading.contact_forces + self._grid.sum_on_texels(row, column, forces)
        texel_forces = reading.texel_forces
        if self._base is not None and texel_forces is not None:
            origin = int(row.min()), int(column.min())
            window = np.zeros((row.max() - origin[0] + 1, column.max() - origin[1] + 1))
            np.add.at(window, (row - origin[0], column - origin[1]), forces)
            texel_forces = texel_forces + self._base.from_window(window, origin)
        carried += float(contact.points[:, 2].sum())
        return reading._replace(contact_forces=contact_forces, texel_forces=texel_forces, carried=carried)
