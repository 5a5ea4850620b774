"""Contact methods with a rigid plate for each flat panel of an array, which distribute forces over cells of the cover.

MuJoCo's contacts with a plate give the total force of each body exactly and at little cost, but not the distribution of
this force over the texels.  After a simulation step the shape of each touching body determines how its force is
distributed over cells of the contact grid, which are smaller than a texel.  `Foundation` uses an elastic foundation.
`CoverContact` uses the compliance of the cover, in which a force on one cell also displaces the other cells.  Both
compute the texel forces at the base by the influence of each cell on each texel.

`CellReader` reads a flat, regular array with one plate, and `PanelReader` an array with several plates or texels in
any layout.  `fastmodel.contact.reader` describes the stages from MuJoCo's contacts to a reading.

MuJoCo divides the force of a rigid body among panels by number of contact points, so that only the sum has a physical
meaning.  Therefore the force of each body is summed over all panels as a vector, together with its moment if the body
is free to tilt.  One rigid motion of the body then determines the pressure on the cells of all panels together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import EVERY, check_box, describe_box, sample_boxes
from fastmodel.contact.forces import FRONT, NetForceReader, Sums, press_plate, read_contacts, sum_contacts
from fastmodel.contact.interface import ContactReader, Reading, TexelContact
from fastmodel.contact.reader import ArrayContact, PressureReader, Solved
from fastmodel.errors import ParametersError
from fastmodel.pressure.cell_grid import BaseForces, Panel, PanelCells, divide_into_panels, lay_out
from fastmodel.pressure.flexes import FlexSurfaces
from fastmodel.pressure.gap import GapSamples, PosedBody, sample_gap
from fastmodel.pressure.pressure_kernels import spread_on_window
from fastmodel.pressure.solvers import STEEP, CoverSolver, FoundationSolver, Load, PressureSolution, PressureSolver
from fastmodel.state import State, take_array
from fastmodel.surface import Surface
from fastmodel.validity import FEWEST_CELLS
from meshes import TexelArray
from meshes.array import check_margin
from meshes.array_types import FloatArray, IntArray

#: Reach at the first contact of a body [-]: height above the body's smallest gap up to which cells are sampled, over
#: the cover's thickness, or for `Foundation` over the pitch.  Later readings adapt the reach to the contact.
_FIRST = 0.1
#: Largest margin of a plate that is widened for a body [pitches].
_MOST_PITCHES = 24
#: Modulus of the elastic foundation without cover data, about that of 2 mm of rubber [Pa/m]; and the number of its
#: cells along each texel pitch [-].
_MODULUS, _PER_TEXEL = 1e9, 4


@dataclass(frozen=True, kw_only=True)
class Plate:
    """Settings of the rigid plate that replaces the texels of an array in MuJoCo.

    Attributes:
        height: Thickness of the plate, inwards from the cover's top [m].
        margin: Width by which plate and cover extend beyond the texels on each side, one number or (x, y) [m].  Force
            on the margin counts as `outside`, the force that no texel measures.  By default `TexelArray.margin`, or
            one pitch if the array states none.  Bent arrays have no margin.
        contype: Collision mask of the plate, 31 bits [-].  With all bits, the default, the plate collides with every
            geom that collides with anything, including other arrays.
        conaffinity: Mask of the geoms that the plate collides with, 31 bits [-].
        solref: Time constant and damping ratio of the plate's contacts, see `fit_contact` [s, -].  By default MuJoCo
            combines its default values with those of the touching geom.
        solimp: MuJoCo's five impedance parameters of the plate's contacts, given together with `solref`: impedance at
            zero depth and at full width, width, midpoint, power [-, -, m, -, -].
        widened: Whether the margin was chosen to hold bodies, so that nobody states it.
    """

    height: float = 2e-3
    margin: float | tuple[float, float] | None = None
    contype: int = EVERY
    conaffinity: int = EVERY
    solref: tuple[float, float] | None = None
    solimp: tuple[float, float, float, float, float] | None = None
    widened: bool = False

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive, the margin negative, a mask not of 31 bits, or only one of solref
                and solimp given.
        """
        check_box(self.height, self.contype, self.conaffinity)
        if self.margin is not None:
            check_margin(self.margin)
        if (self.solref is None) != (self.solimp is None):
            raise ValueError("solref and solimp belong together; give both or neither")

    def count_pitches(self, array: TexelArray) -> tuple[float, float]:
        """Return the margin along x and y, in pitches of the array [-]."""
        stated = array if self.margin is None else replace(array, margin=check_margin(self.margin))
        return stated.margin_pitches

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add the plate to a spec: one box geom for each flat panel of the array; see `TexelContact.attach`."""
        # with a higher priority, MuJoCo uses the softness of the plate alone and not that of the touching geom
        soft: dict[str, Any] = (
            {} if self.solref is None else {"solref": self.solref, "solimp": self.solimp, "priority": 1}
        )
        for panel, geom in zip(*self.divide(array, name), strict=True):
            frame.add_geom(
                name=geom,
                pos=(panel.origin - 0.5 * self.height * panel.axes[:, 2]).tolist(),
                quat=Rotation.from_matrix(panel.axes).as_quat(scalar_first=True).tolist(),
                **describe_box((*panel.half, self.height / 2), self.contype, self.conaffinity),
                **soft,
            )

    def divide(self, array: TexelArray, name: str) -> tuple[tuple[Panel, ...], list[str]]:
        """Divide an array into flat panels; return the panels, and the names of their geoms in MuJoCo.

        The names are numbered if there are several panels.
        """
        panels = divide_into_panels(array, self.count_pitches(array))
        numbers = [""] if len(panels) == 1 else range(len(panels))
        return panels, [f"{name}/plate{number}" for number in numbers]


@dataclass(frozen=True, kw_only=True)
class _PlateMethod(TexelContact):
    """Base class of the contact methods that represent the array in MuJoCo by rigid plates, one for each flat panel.

    Attributes:
        plate: Settings of the plates.
    """

    plate: Plate = field(default_factory=Plate)

    computes_spread: ClassVar[bool] = True

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add a plate for each flat panel of the array to a spec; see `TexelContact.attach`."""
        self.plate.attach(frame, array, name)

    def adapt(self, surface: Surface | None) -> Self:
        """Return the method with a plate that ends at the texels if the cover has free side edges there."""
        if surface is None or surface.margin is None:
            return self
        return replace(self, plate=replace(self.plate, margin=surface.margin))

    def hold(self, array: TexelArray, reach: tuple[float, float]) -> Self:
        """Return the method with a plate that holds bodies, at most `_MOST_PITCHES` wide; see `TexelContact.hold`."""
        if self.plate.margin is not None or array.margin is not None:
            return self
        sides = np.multiply(array.pitch, (array.columns, array.rows)) / 2
        pitches = np.clip(np.ceil(np.subtract(reach, sides) / array.pitch) + 1, 1, _MOST_PITCHES)
        if (pitches == 1).all() or not array.regular:
            return self
        x, y = (pitches * array.pitch).tolist()
        return replace(self, plate=replace(self.plate, margin=(x, y), widened=True))

    def sample_top(
        self, model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, array: TexelArray
    ) -> tuple[FloatArray, FloatArray]:
        """Place points on the top of the array, not on its margin; see `TexelContact.sample_top`."""
        inset = max(np.multiply(self.plate.count_pitches(array), array.pitch).tolist())
        return sample_boxes(model, data, geoms, inset=inset, spacing=0.5 * min(array.pitch))


@dataclass(frozen=True, kw_only=True)
class Foundation(_PlateMethod):
    """Contact method with a rigid plate, which distributes the force of each body by an elastic foundation of cells.

    The texel forces at the base follow from the influence of each cell of the cover without load.  Parameters without
    cells have the point spread between texels instead, which misplaces two to fifteen times as much force.

    Attributes:
        plate: Settings of the plate.
        modulus: Pressure on the foundation per displacement; by default that of the cover under a square patch four
            thicknesses wide, or `_MODULUS` without cells [Pa/m].  It does not matter under a flat face.
    """

    modulus: float | None = None

    def __post_init__(self) -> None:
        """Check the modulus.

        Raises:
            ValueError: If it is not positive.
        """
        if self.modulus is not None and not 0 < self.modulus < math.inf:
            raise ValueError(f"modulus of a foundation must be positive, not {self.modulus} Pa/m")

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> ContactReader:
        """Find the plate in the compiled model; see `TexelContact.bind`.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        cells = None if surface is None else surface.cells
        grid = lay_out(array, self.plate.count_pitches(array), cells.per_texel if cells else _PER_TEXEL)
        modulus, bases = self.modulus or _MODULUS, list[BaseForces]()
        if cells is not None:
            cells.check(array)
            modulus = self.modulus or cells.foundation_modulus()
            bases.append(grid.build_base_forces(cells.under_loads[0], array))
        reader = PanelReader if grid.panels else CellReader
        solver = FoundationSolver(grid, modulus, bases)
        return reader(self.plate, model, array, name, solver=solver, first=min(array.pitch))


@dataclass(frozen=True, kw_only=True)
class CoverContact(_PlateMethod):
    """Contact method with a rigid plate, which distributes the force of each body by the compliance of the cover.

    Attributes:
        plate: Settings of the plate.
        tolerance: Sum of the changes of cell forces in one step of the solver, over the load, below which the solver
            stops [-].  Texel forces with 2e-3 differ from those with 5e-4 by at most 0.02 % of the load.
        steps: Largest number of steps of the solver [-].
    """

    tolerance: float = 2e-3
    steps: int = 100

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> ContactReader:
        """Find the plate in the compiled model.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If the parameters hold no cover data for this pitch.
        """
        cells = None if surface is None else surface.cells
        if cells is None:
            raise ParametersError(
                f"sensor {name!r}: the contact method 'cover' needs the cover's cells, which these parameters do not "
                f"hold; derive them anew, or use 'foundation' or 'boxes'"
            )
        cells.check(array)
        grid = lay_out(array, self.plate.count_pitches(array), cells.per_texel, max(cells.compliance.shape))
        bases = [grid.build_base_forces(each, array) for each in cells.under_loads]
        solver = CoverSolver(cells, grid, tolerance=self.tolerance, steps=self.steps, bases=bases)
        reader = PanelReader if grid.panels else CellReader
        return reader(self.plate, model, array, name, solver=solver, first=cells.thickness)


class CellReader(PressureReader):
    """Reader that computes texel forces from the bodies on the plate of a flat, regular array.

    The reader samples the gap under the bodies, solves for the forces on cells, and sums these forces over texels.
    """

    _net_force: NetForceReader

    def __init__(
        self,
        plate: Plate,
        model: mujoco.MjModel,
        array: TexelArray,
        name: str,
        *,
        solver: PressureSolver,
        first: float,
    ) -> None:
        """Find the plate in the compiled model, and start in the state without contacts.

        Args:
            plate: Settings of the plate.
            model: The compiled model.
            array: The array that was attached.
            name: Name of the sensor, as given to `Plate.attach`.
            solver: Solver that computes the forces on cells.
            first: Length by which `_FIRST` is multiplied to give the reach at the first contact of a body [m].
        """
        panels, geoms = plate.divide(array, name)
        axes, edges = panels[0].axes, solver.grid.edge
        middle = panels[0].origin - 0.5 * plate.height * axes[:, 2]
        # solids with sharp edges are enlarged by an eighth of a cell; `fastmodel.pressure.gap` explains why
        edge = 0.125 * float(np.sqrt(edges[0] * edges[1]))
        super().__init__(model, array, name, geoms=geoms, frame=(axes, middle), edge=edge)
        self._grid, self._solver = solver.grid, solver
        self._length, self._height = min(edges), plate.height
        self._net_force = NetForceReader(model, array, self._geoms, axes=axes, middle=middle)
        self._flexes = FlexSurfaces(model, 0.5 * min(array.pitch))
        self._press_plate, self._spread = compile_kernel(press_plate), compile_kernel(spread_on_window)
        self._first, self._reach = _FIRST * first, dict[int, float]()
        self._may_go_on = (plate.margin is None or plate.widened) and array.margin is None and not self._grid.panels
        self._nothing = self.at_rest(np.zeros(array.count))

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, and discard previous solutions; see `ContactReader.at_rest`."""
        self._reach.clear()
        self._solver.reset()
        bases = self._solver.bases
        reading = self._rest(contact_forces, bases[0].from_texels(contact_forces) if bases else None)
        return self._net_force.add(reading, None)

    def get_state(self) -> State:
        """Return the last solution and the start values of the next one; see `ContactReader.get_state`."""
        reach = np.array(list(self._reach.items()), dtype=np.float64).reshape(-1, 2)
        return {"reach": reach, **super().get_state(), **self._solver.get_state()}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned; see `ContactReader.set_state`."""
        self._reach = {int(body): float(reach) for body, reach in take_array(state, "reach")}
        super().set_state(state)
        self._solver.set_state(state)

    def find_contact(self, data: mujoco.MjData) -> tuple[ArrayContact, Sums] | None:
        """Find the bodies that press on the plate, their loads and poses; see `PressureReader.find_contact`.

        Friction can pull at the front of an array where the contact's normal is inclined.  The force of a body that
        pulls in total counts in the total force only, because no texel measures a pull.
        """
        bodies, sums, owner, touches, frame, totals = self._press_plate(
            read_contacts(self._model, data),
            data.geom_xmat,
            data.geom_xpos,
            self._net_force.parts,
            self._bodies.of_geom,
        )
        pressed, _, wrench, beside = totals
        if not np.count_nonzero(wrench):
            return None
        if self._model.nflex and (owner < 0).any():
            size, low, edge = self._grid.arrays
            bounds = np.array([[*low, -self._height], [*(low + size * edge), 0.0]])
            owner, touches = self._flexes.replace_points(
                data, pressed.sum(axis=1), owner, touches, place=frame, bounds=bounds
            )
        found, poses, loads = [], [], []
        for body, (force, x, y, depth) in zip(bodies.tolist(), sums.tolist(), strict=True):
            if force <= 0:  # A force that is nan passes this test and is refused below.
                continue
            tilts = self._joints.let_tilt(data, body, frame[:3, 2])
            loads.append(Load.on_plate(force + 0 * (x + y), np.array([x, y]), tilts=tilts))
            found.append(body)
            poses.append(self._find_pose(data, body, frame, depth))
        points = touches[:0]
        if len(found) < len(bodies) or (owner < 0).any():
            # Bodies that pull in total, and contacts of unknown shape that pull, press on no texel.  Their forces count
            # in the total force alone.
            lost = np.isin(owner, (sums[:, 0] <= 0).nonzero()[0]) | ((owner < 0) & (touches[:, 2] <= 0))
            beside += float(touches[lost, 2].sum())
            points = touches[(owner < 0) & ~lost]
            kept = ~lost & (owner >= 0)
            touches, owner = touches[kept], np.unique(owner[kept], return_inverse=True)[1]
        if not math.isfinite(beside + sum([load.force for load in loads]) + points[:, 2].sum()):
            self._refuse(data)
        contact = ArrayContact(
            bodies=tuple(found),
            loads=tuple(loads),
            poses=tuple(poses),
            owner=owner,
            touches=touches,
            points=points,
            beside=beside,
        )
        return contact, totals

    def sample_gap(self, contact: ArrayContact, reach: Sequence[float]) -> GapSamples:
        """Sample the gap between each body and the undeformed cover, on cells of the contact grid.

        Args:
            contact: The bodies.
            reach: For each body, gap above the body's smallest gap up to which cells are kept [m].
        """
        return sample_gap(self._grid, contact.poses, reach)

    def _solve(self, contact: ArrayContact) -> Solved:
        """Compute the forces on cells, and sum them over texels.

        The reach of a body is the height above its smallest gap up to which cells are sampled.  It is increased until
        all cells under pressure lie within it.
        """
        kept = list(range(len(contact.bodies)))
        reach = [self._reach.get(body, self._first) for body in contact.bodies]
        # The parts of a body may touch far from one another, where MuJoCo's contacts are.
        reach = [
            have if pose.is_convex else max(have, pose.depth) for have, pose in zip(reach, contact.poses, strict=True)
        ]
        while reach:
            samples = self.sample_gap(contact, reach)
            found = samples.bodies_found
            if len(found) < len(reach):
                # No cell is below the shape of these bodies; their contact points represent them.
                contact, reach, kept = contact.select(found), [reach[k] for k in found], [kept[k] for k in found]
                continue
            solution = self._solver.solve(samples, contact.loads)
            heights = self._find_heights(contact, samples, solution)
            needed = [1.2 * top if have < top else have for have, top in zip(reach, heights, strict=True)]
            if needed == reach:
                for body, top in zip(contact.bodies, heights, strict=True):
                    # a margin, so that the reach suffices while the load rises
                    self._reach[body] = max(1.2 * top, 0.25 * self._first)
                return self._sum(contact, kept, samples, solution)
            # A solution on fewer cells is a poor start value: the iteration would stop at once and add no cells.
            self._solver.reset()
            reach = needed
        nothing = np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3))
        return self._conclude(
            contact, (), self._add_points(contact, self._nothing), nothing, np.zeros(0), depth=0.0, layout=()
        )

    def _find_heights(self, contact: ArrayContact, samples: GapSamples, solution: PressureSolution) -> list[float]:
        """Find, for each body, the reach that the solution requires, shape (bodies,) [m].

        The contact of a convex body with a plate is connected.  If no cell around the cells within reach is under
        pressure, the solution is that on all cells.  Other bodies, and panels, whose cells have no such neighbours, may
        touch in several places.  Their reach must exceed the height up to which the undeformed surfaces overlap,
        because the cover may bulge beside a contact.
        """
        pressed, flat = solution.forces > 0, not self._grid.panels
        heights = []
        for body, pose in enumerate(contact.poses):
            own = pressed & (samples.body == body) if len(contact.poses) > 1 else pressed
            exact = flat and pose.is_convex
            top = float((samples.gap if exact else solution.surface)[own].max(initial=-np.inf) - samples.lowest[body])
            heights.append((top if exact else 1.5 * top) if math.isfinite(top) else self._first)
        return heights

    def _sum(
        self, contact: ArrayContact, kept: Sequence[int], samples: GapSamples, solution: PressureSolution
    ) -> Solved:
        """Sum the forces on cells over texels, at the top and, if the method computes them, at the base."""
        pressed = np.bincount(samples.body, solution.forces > 0, len(contact.loads))
        window, origin = solution.window, solution.origin
        texel_forces, layout = None, list[npt.NDArray[Any]]([samples.row, samples.column])
        if window is not None and solution.shares is not None:
            layout += [*solution.shares, np.array([*window.shape, *origin])]
            placed, first = window, origin
            if len(pressed) == 1 and pressed[0] < FEWEST_CELLS and not self._grid.panels:
                placed, first = self._grid.shift_window(window, origin, contact.loads[0].centre[:2])
            texel_forces = self._solver.find_base_forces(placed, first)
        reading = Reading(
            contact_forces=self._grid.sum_on_texels(samples.row, samples.column, solution.forces),
            texel_forces=texel_forces,
            carried=float(solution.forces.sum()),
            # on cells in one plane the approach of a body is one number
            approach=solution.approach if len(self._grid.panels) <= 1 else None,
            fewest_cells=int(pressed.min()),
            at_end=self._measure_end(samples, solution.forces) if self._may_go_on else 0.0,
        )
        cells = samples.body, samples.place, samples.normal
        depth = float((solution.surface - samples.gap).max())
        return self._conclude(
            contact, kept, self._add_points(contact, reading), cells, solution.forces, depth=depth, layout=tuple(layout)
        )

    def _measure_end(self, samples: GapSamples, forces: FloatArray) -> float:
        """Return the share of the force on the outermost cells of the grid [-]."""
        outer = (samples.row % (self._grid.rows - 1) == 0) | (samples.column % (self._grid.columns - 1) == 0)
        total = float(forces.sum())
        return float(forces[outer].sum()) / total if total > 0 else 0.0

    def _find_point_torque(self, points: FloatArray) -> FloatArray:
        """Return the torque of point forces, shape (3,) [N m]; on panels their places in space are not known."""
        x, y = points[:, 2] @ points[:, :2] if len(points) and not self._grid.panels else (0.0, 0.0)
        return np.array([-y, x, 0.0])

    def _sum_forces(self, layout: tuple[npt.NDArray[Any], ...], forces: FloatArray) -> list[FloatArray]:
        """Sum forces on cells over texels, see `PressureReader._sum_forces`.

        The layout holds row and column of each cell and, if the method computes forces at the base, the shares of the
        cells in the window, and shape and origin of the window.
        """
        row, column, *window = layout
        sums = [self._grid.sum_on_texels(row, column, forces)]
        if window:
            corner, weight, place = window
            rows, columns, first, left = place.tolist()
            spread = self._spread(corner, weight, forces, (rows, columns))
            sums.append(np.asarray(self._solver.find_base_forces(spread, (first, left))))
        return sums

    def _add_points(self, contact: ArrayContact, reading: Reading) -> Reading:
        """Add the point forces of a contact to a reading."""
        if not len(contact.points):
            return reading
        row, column, forces = self._grid.divide_points(contact.points)
        contact_forces = reading.contact_forces + self._grid.sum_on_texels(row, column, forces)
        texel_forces = reading.texel_forces
        if texel_forces is not None:
            origin = int(row.min()), int(column.min())
            window = np.zeros((row.max() - origin[0] + 1, column.max() - origin[1] + 1))
            np.add.at(window, (row - origin[0], column - origin[1]), forces)
            texel_forces = texel_forces + np.asarray(self._solver.find_base_forces(window, origin))
        carried = reading.carried + float(contact.points[:, 2].sum())
        return reading._replace(contact_forces=contact_forces, texel_forces=texel_forces, carried=carried)


class PanelReader(CellReader):
    """Reader that computes texel forces from the bodies that press on the plates of several flat panels."""

    def find_contact(self, data: mujoco.MjData) -> tuple[ArrayContact, Sums] | None:
        """Find the bodies that press on the panels, their loads and poses; see `PressureReader.find_contact`."""
        contacts, parts = read_contacts(self._model, data), self._net_force.parts
        sums: Sums = compile_kernel(sum_contacts)(contacts, data.geom_xmat, data.geom_xpos, parts)
        if not np.count_nonzero(sums[2]):
            return None
        frame = self._find_frame(data)
        touches, panels = self._list_touches(data, frame), self._grid.panels
        normals = np.array([part.panel.axes[:, 2] for part in panels])
        normal = normals[touches.part]
        # only the component of friction along the panel's normal is used, because the other components are not pressure
        forces = touches.pressure + (touches.friction * normal).sum(axis=1, keepdims=True) * normal
        along = (forces * normal).sum(axis=1)
        front = (touches.outward * normal).sum(axis=1) >= FRONT
        # Positions of the contacts on the common grid of all panels.  A contact at the rim of a panel is moved onto the
        # outermost cells of the panel.
        local = np.zeros((len(along), 2))
        for k, (number, point) in enumerate(zip(touches.part.tolist(), touches.place, strict=True)):
            part = panels[number]
            half = np.array(part.panel.half) - np.array(part.grid.edge) / 2
            x, y, _ = (point - part.panel.origin) @ part.panel.axes
            local[k] = np.clip([x, y], -half, half) + self._shift(part)
        points = front & (touches.body < 0) & (along > 0)
        table = np.column_stack([local, along])
        contact = self._build_contact(
            data,
            frame,
            touches,
            forces=forces,
            normals=normals,
            upright=frame[:3, 2],
            table=table,
            front=front,
            points=points,
        )
        measured = points | (front & np.isin(touches.body, contact.bodies))
        return replace(contact, beside=float(along[~measured].sum())), sums

    def _shift(self, part: PanelCells) -> FloatArray:
        """Return the position of a flat panel's origin on the contact grid of all panels, shape (2,) [m]."""
        return np.asarray(self._grid.low - part.grid.low + np.array([part.column, part.row]) * part.grid.edge)

    def sample_gap(self, contact: ArrayContact, reach: Sequence[float]) -> GapSamples:
        """Sample the gap under each body, on the cells of each panel on which the body's force may press."""
        none, numbers, vectors = np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        found: list[tuple[Any, ...]] = [(*[numbers] * 3, *[none] * 4, vectors, vectors)]
        for body, (pose, load) in enumerate(zip(contact.poses, contact.loads, strict=True)):
            tables = []
            for part in self._grid.panels:
                # only panels within reach of the bounding sphere of a solid of the body
                away = np.linalg.norm(pose.centres - part.panel.origin, axis=1) - part.radius
                near = (away <= np.linalg.norm(pose.shape.halves, axis=1) + reach[body]).any()
                if near and part.panel.axes[:, 2] @ load.directions[0] > STEEP:
                    tables.append(self._sample_panel(part, pose, reach[body]))
            lowest = min((table[5].min(initial=np.inf) for table in tables), default=np.inf)
            for table in tables:
                kept = table[5] <= lowest + reach[body]
                found.append((np.full(kept.sum(), body), *(each[kept] for each in table)))
        return GapSamples(*(np.concatenate(each) for each in zip(*found, strict=True)))

    def _sample_panel(self, part: PanelCells, pose: PosedBody, reach: float) -> tuple[Any, ...]:
        """Sample the gap between a body and one panel; return the fields of `GapSamples` without the first, `body`."""
        axes, origin = part.panel.axes, part.panel.origin
        local = replace(pose, rotation=axes.T @ pose.rotation, position=(pose.position - origin) @ axes)
        samples = sample_gap(part.grid, [local], [reach])
        place = origin + np.outer(samples.x, axes[:, 0]) + np.outer(samples.y, axes[:, 1])
        (x, y), inside = self._shift(part), part.holds(samples.row, samples.column)
        table = (
            samples.row + part.row,
            samples.column + part.column,
            samples.coverage,
            samples.x + x,
            samples.y + y,
            samples.gap,
            place,
            np.tile(axes[:, 2], (samples.count, 1)),
        )
        return tuple(each[inside] for each in table)
