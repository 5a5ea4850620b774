"""Pressure between rigid bodies and cells of the cover, by the compliance of the cover or by an elastic foundation.

`CoverSolver` minimises f A f / 2 + g f + y s^2 / 2 over the cell forces f >= 0 and slacks s, where A is the compliance
of the cover between cells and g the gap of the undeformed surfaces, under linear constraints C' f + s = t, by conjugate
gradients (Polonsky and Keer, Wear 231, 1999).  The force of every body is prescribed without slack.  For a body that is
free to tilt, two moments are prescribed, each with a slack of compliance y, because no pressure on the cells may have
exactly the moments of MuJoCo's contact points.  In the solution, pressure acts only where the surfaces touch, and the
surfaces overlap nowhere.  The Lagrange multipliers of the constraints are the approach and the two tilts of each body.
The residual and the search direction are projected on the subspace that satisfies the constraints.

A acts as a convolution on a window (rectangle of cells of the contact grid) around the contact.  The force on a partly
covered cell acts at the centroid of the covered part: the force is divided bilinearly among the four nearest whole
cells, and the displacement is interpolated with the same weights, so that A stays symmetric.  A force on a smaller area
also displaces that area more; this additional self compliance is added to the diagonal of A.

In `FoundationSolver`, an elastic (Winkler) foundation, pressure displaces its own cell only.  The force on a cell is
k max(0, d + s x + t y - g), with stiffness k, gap g and, for each body, an approach d and, where the body is free to
tilt, two slopes s and t.  The values of d, s and t are those at which the sums of the cell forces and slacks equal the
prescribed force and moments of the body.  They minimise a convex, piecewise quadratic function of d, s and t, which is
done by Newton's method with step halving.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.pressure.cell_grid import BaseForces, CellGrid
from fastmodel.pressure.gap import GapSamples
from fastmodel.pressure.pressure_kernels import (
    constrain_forces,
    match_springs,
    minimise_energy,
    place_cells,
    spread_on_window,
)
from fastmodel.state import State, take_array
from fastmodel.surface import CoverCells, find_largest_stiffness
from meshes.array_types import FloatArray, IntArray

#: Compliance of the slack of a moment, over the compliance of one cell under a force on itself [-].  Per missed moment
#: of one newton times the edge of a cell, the body tilts by this many such compliances over the edge.
TILT = 4.0
#: Compliance of the slack of a force across the body's main force, over the same compliance [-].
SHIFT = 400.0
#: Cosine of the angle between a body's force and a panel's normal, up to which the body exerts no pressure on the panel
#: [-].  It is also the smallest share of a body's force along the directions in which its joints leave the body free;
#: below this share the direction of the force is used instead.
STEEP = 0.2


#: Loads of a flat cover, see `pressure_kernels.Cover`.
_NONE = np.zeros((0, 0))
#: The normal of a plate, the only direction in which a body presses on the plate; and the turns of a body that is free
#: to tilt, about -y and x: the moments about them are the sums of force times x and of force times y.
_UPWARDS, _TILTS = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Load:
    """The force and moment with which one body presses on an array, in the array's frame.

    Attributes:
        vector: Force of the body, with its sign such that a pressing force has a positive component along the surface's
            normal, shape (3,) [N].
        moment: Moment of this force about the array's origin, shape (3,) [N m].
        directions: k unit vectors along which the body is free to move, the first along the component of the force in
            these directions, shape (k, 3) [-].
        turns: j unit vectors about which the body is free to rotate, and the moments are prescribed, shape (j, 3) [-].
            Otherwise a guide of the body takes up the moments.
    """

    vector: FloatArray
    moment: FloatArray
    directions: FloatArray
    turns: FloatArray

    @classmethod
    def on_plate(cls, force: float, moment: FloatArray, *, tilts: bool) -> Load:
        """Make the load of a body on one plate, from the force against the plate's normal.

        Args:
            force: Force of the body against the array's normal [N].
            moment: Sums over the contact points of force times x and of force times y, shape (2,) [N m].
            tilts: Whether the body is free to tilt.
        """
        x, y = moment
        return cls(
            vector=np.array([0.0, 0.0, force]),
            moment=np.array([y, -x, 0.0]),
            directions=_UPWARDS,
            turns=_TILTS if tilts else _TILTS[:0],
        )

    @classmethod
    def along_free_directions(
        cls, vector: FloatArray, moment: FloatArray, slides: FloatArray, *, rotates: bool
    ) -> Load:
        """Make the load of a body on several panels or on a curved surface.

        Args:
            vector: Force of the body, shape (3,) [N].
            moment: Moment of the contact forces about the array's origin, shape (3,) [N m].
            slides: Axes of the k slide joints between body and array, shape (k, 3) [-].
            rotates: Whether the body is free to rotate; the body then counts as free to move in all directions.
        """
        if rotates:
            span = np.eye(3)
        elif len(slides):
            span = np.linalg.svd(slides.T, full_matrices=False)[0]
        else:
            span = vector[:, None]
        along = span @ (span.T @ vector) if rotates or len(slides) else vector
        if np.linalg.norm(along) < STEEP * np.linalg.norm(vector):
            span, along = vector[:, None], vector
        first = along / np.linalg.norm(along)
        rest = span - np.outer(first, first @ span)
        left, sizes, _ = np.linalg.svd(rest, full_matrices=False)
        # The singular value of a direction is 0 if it is parallel to the first direction, and 1 if perpendicular.
        others = np.ascontiguousarray(left[:, sizes > 0.5].T)  # noqa: PLR2004
        # The moment about the first direction is not that of pressure.
        turns = others if rotates else np.zeros((0, 3))
        return cls(vector=vector, moment=moment, directions=np.vstack([first, others]), turns=turns)

    @cached_property
    def force(self) -> float:
        """Component of the body's force along the first direction [N]."""
        return float(self.vector.dot(self.directions[0]))

    @cached_property
    def centre(self) -> FloatArray:
        """A point on the line of action of the force, on a plate the centre of pressure, shape (3,) [m]."""
        return np.asarray(_cross(self.vector, self.moment) / self.vector.dot(self.vector))

    def find_missed_torque(self, torque: FloatArray) -> FloatArray:
        """Return what the torque of a computed pressure on the array lacks of the body's own, shape (3,) [N m].

        Only torques about axes about which the body may turn count.

        Args:
            torque: Torque of the pressure under the body about the array's origin, shape (3,) [N m].
        """
        return np.asarray(-self.turns.T.dot(self.turns.dot(self.moment + torque)))

    def find_change(self, last: Load, centre: FloatArray, edge: float) -> FloatArray:
        """Find the change since another load, of the force and of the moments about the turns, shape (1 + j,) [N].

        Args:
            last: The other load.
            centre: Point about which moments are taken, shape (3,) [m].
            edge: Length by which they are divided [m].
        """
        change, found = self.vector - last.vector, np.empty(1 + len(last.turns))
        found[0] = change.dot(last.directions[0])
        if len(last.turns):
            found[1:] = last.turns.dot(self.moment - last.moment - _cross(centre, change)) / edge
        return found

    def build_constraints(
        self, place: FloatArray, normal: FloatArray, edge: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Build the k + j linear constraints columns.T @ forces + slacks = target on the forces on m cells.

        The first constraint prescribes the force of the body, so its Lagrange multiplier is the approach of the body.
        The others have a slack.  The moments are taken about the point on the line of action of the force next to the
        cells, or the point next to it in the box around the cells.

        Args:
            place: Positions of the cells in the array's frame, shape (m, 3) [m].
            normal: Outward normals of the cells, shape (m, 3) [-].
            edge: Edge of a cell, by which lever arms are divided [m].

        Returns:
            Columns, shape (m, k + j), target, shape (k + j,) [N], and slack of each constraint, shape (k + j,); see
            `TILT` [-].
        """
        columns, target = compile_kernel(constrain_forces)(
            place, normal, (self.vector, self.centre, self.directions, self.turns), edge
        )
        slack = np.zeros(len(target))
        slack[1 : len(self.directions)], slack[len(self.directions) :] = SHIFT, TILT
        return columns, target, slack


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the vector product of two vectors, shape (3,); numpy's function takes ten times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureSolution:
    """Forces on the cells of the contact grid, and the approach of each body.

    Attributes:
        forces: Force on each of the m cells under bodies, shape (m,) [N].
        surface: Gap up to which a body at the cell would touch it if the cover stayed flat, shape (m,) [m].
        approach: Approach of each body since its first touch of the undeformed cover, shape (bodies,) [m]; None if not
            computed.
        window: The forces as forces on a window (rectangle) of whole cells, shape (rows, columns) [N]; None if not
            computed.
        origin: Row and column in the contact grid of the first cell of the window.
        shares: Arrays that divide forces on cells among those of the window, see `spread_on_window`; None if not
            computed.
        steps: Number of steps of the iteration [-].
        converged: Whether the iteration met its tolerance.
    """

    forces: FloatArray
    surface: FloatArray
    approach: FloatArray | None = None
    window: FloatArray | None = None
    origin: tuple[int, int] = (0, 0)
    shares: tuple[IntArray, FloatArray] | None = None
    steps: int = 0
    converged: bool = True


class PressureSolver:
    """Base class of the solvers for the pressure of bodies on cells of an array.

    The base class keeps no previous solution and computes no forces at the base of the cover.

    Attributes:
        grid: The contact grid of the array.
        bases: Operators to texel forces at the base, one for each tabulated load of the cover; empty if not computed.
    """

    def __init__(self, grid: CellGrid, bases: Sequence[BaseForces] = ()) -> None:
        self.grid, self.bases = grid, bases

    def reset(self) -> None:
        """Discard the last solution, from which the next solution would start."""

    def get_state(self) -> State:
        """Return the last solution, from which the next solution starts, as arrays by name."""
        return {}

    def set_state(self, state: State) -> None:
        """Restore the last solution that `get_state` returned."""

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Compute the forces on the cells under all bodies.

        Args:
            samples: Cells under each body, with their gaps.
            loads: Force and moments of each body.
        """
        raise NotImplementedError

    def find_base_forces(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray | None:
        """Compute the forces on texels at the base of the cover; None without operators.

        Args:
            forces: Forces on a window (rectangle) of cells, shape (rows, columns) [N].
            origin: Row and column of the window's first cell in the grid.
        """
        return self.bases[0].from_window(forces, origin) if self.bases else None


class CoverSolver(PressureSolver):
    """Solver for the pressure on a cover; the iteration of each contact starts from the previous solution.

    A cover with a stiff foil on top becomes stiffer under load, because the foil stretches.  Such a cover has
    compliances and influences for some loads of a ball.  For another body, they are taken at the load at which the ball
    has the same depth as the body.  A body with a large face has a small depth and stretches the cover less.
    """

    def __init__(
        self,
        cells: CoverCells,
        grid: CellGrid,
        *,
        tolerance: float = 2e-4,
        steps: int = 200,
        bases: Sequence[BaseForces] = (),
    ) -> None:
        """Prepare the compliance of the cover between cells.

        Args:
            cells: The cover.
            grid: The contact grid of the array.
            tolerance: Tolerance of the iteration: sum of the changes of cell forces in one step, over the load, below
                which the iteration stops [-].
            steps: Largest number of steps of the iteration [-].
            bases: Operators to texel forces at the base, without load and at each of the loads of the cover.
        """
        super().__init__(grid, bases)
        self._tolerance, self._steps, self._cells = tolerance, steps, cells
        self._square, self._near = cells.square_compliance, [each.near for each in cells.under_loads]
        kernels = [each.compliance / (cells.cell[0] * cells.cell[1]) for each in cells.under_loads]
        self._stiffest = [find_largest_stiffness(each) for each in kernels]
        self._place, self._start = compile_kernel(place_cells), compile_kernel(find_start)
        self._minimise = compile_kernel(minimise_energy)
        self._scratch = np.zeros((grid.rows, grid.columns))
        #: Stiffness of a cell of an elastic foundation, from whose pressure the iteration starts [N/m].
        self._stiffness = cells.foundation_modulus() * grid.edge[0] * grid.edge[1]
        self.reset()

    def reset(self) -> None:
        """Discard the last solution, so that the next iteration starts from uniform pressure."""
        self._last = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
        self._load, self._share = 0.0, math.nan

    def get_state(self) -> State:
        """Return the last solution as arrays by name.

        `last` holds row, column and pressure times area of a whole cell [N] of m cells, shape (3, m). `stretching`
        holds the load of the tables in use [N], and its ratio to the largest force of a body [-].
        """
        return {"stretching": np.array([self._load, self._share]), "last": np.array(self._last, dtype=np.float64)}

    def set_state(self, state: State) -> None:
        """Restore the last solution that `get_state` returned."""
        self._load, self._share = take_array(state, "stretching").tolist()
        row, column, pressure = take_array(state, "last")
        self._last = (row.astype(np.int64), column.astype(np.int64), pressure.copy())

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Compute the forces on the cells under all bodies.

        The body with the largest force determines the tables of a cover that depends on the load; see
        `PressureSolver.solve`.
        """
        heaviest = int(np.argmax([load.force for load in loads]))
        force, position = loads[heaviest].force, self._cells.position_among_loads
        known = not math.isnan(self._share)
        share = self._share if known else 1.0
        # The first reading of a contact may take 6 solutions, later readings 2, because they start near the result.
        for _ in range(2 if known else 6):
            self._load = share * force
            solution = self._solve_at(samples, loads, round(position(self._load)))
            if solution.approach is None:
                break
            # Depths have an error that depends on the position of a contact on the cells.  The divisor 0.85 allows for
            # it, so that a ball of the fitted size is not mistaken for a body with a large face.
            equal = min(force, self._cells.load_at_depth(float(solution.approach[heaviest]) / 0.85))
            share = math.sqrt(share * equal / force)
            if abs(position(equal) - position(self._load)) < 0.25:  # noqa: PLR2004 -- steps between tabulated loads
                break
        self._share = share
        return solution

    def _solve_at(self, samples: GapSamples, loads: Sequence[Load], nearest: int) -> PressureSolution:
        """Compute the forces on the cells with the compliance of the cover at one of its tabulated loads.

        Args:
            samples: Cells under each body, with their gaps.
            loads: Force and moments of each body.
            nearest: Index of the tabulated load, 0 for the cover without load.
        """
        cells = (samples.row, samples.column, samples.coverage, samples.x, samples.y)
        origin, shape, corner, weight, own = self._place(cells, self.grid.arrays, self._near[nearest], self._square)
        cover = (corner, weight, own, *self._cells.under_loads[nearest].convolution.matrices(*shape), _NONE, _NONE)
        wanted = np.array([load.force for load in loads])
        known = len(self._last[0]) > 0
        start = self._start(
            self._last, (samples.row, samples.column, samples.coverage, samples.body), wanted, self._scratch
        )
        tolerance = self._tolerance * float(wanted.sum())
        # The residual times the largest stiffness is a bound of the remaining change of the forces.  Only a quarter of
        # the tolerance is allowed for it, because a start value may be accepted unchanged in several successive
        # readings, and its errors add up.
        limits = (tolerance, 0.25 * tolerance / self._stiffest[nearest], self._steps)
        edge, compliance = self.grid.mean_edge, float(self._near[nearest][0, 0])
        constraints, first = join_constraints(loads, samples.body, samples.place, samples.normal, edge, compliance)
        if not known:
            start, _ = press_springs(samples, loads, self._stiffness, edge)
        forces, window, motion, steps, converged = self._minimise(cover, samples.gap, constraints, start, limits)
        if known and not converged:  # The last pressures may be far from the solution.
            start, _ = press_springs(samples, loads, self._stiffness, edge)
            forces, window, motion, steps, converged = self._minimise(cover, samples.gap, constraints, start, limits)
        self._last = (samples.row, samples.column, forces / samples.coverage)
        return PressureSolution(
            forces=forces,
            surface=constraints[0].dot(motion),
            approach=motion[first] - samples.lowest,
            window=window,
            origin=origin,
            shares=(corner, weight),
            steps=steps,
            converged=converged,
        )

    def find_base_forces(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Compute the texel forces under forces on a window of cells; see `BaseForces.from_window`.

        The forces are interpolated between the tabulated loads, at the load of the last solution.
        """
        index, share = divmod(self._cells.position_among_loads(self._load), 1.0)
        found = self.bases[int(index)].from_window(forces, origin)
        if not share:
            return found
        return (1 - share) * found + share * self.bases[int(index) + 1].from_window(forces, origin)


def join_constraints(  # noqa: PLR0917 -- one call per reading
    loads: Sequence[Load], owner: IntArray, place: FloatArray, normal: FloatArray, edge: float, compliance: float
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], list[int]]:
    """Join the linear constraints by which the loads of several bodies prescribe the forces on m cells or points.

    Args:
        loads: Load of each body.
        owner: Index of the body that presses on each cell, -1 for none, shape (m,).
        place: Positions of the cells, shape (m, 3) [m].
        normal: Outward normals of the cells, shape (m, 3) [-].
        edge: Edge of a cell [m].
        compliance: Displacement of a cell under unit force on it [m/N].

    Returns:
        Columns of k constraints on the m forces, shape (m, k), target, shape (k,) [N], and compliance of each slack,
        shape (k,) [m/N]; and for each body the index of the column that prescribes its force.
    """
    if len(loads) == 1 and not owner.any():
        columns, target, slack = loads[0].build_constraints(place, normal, edge)
        return (columns, target, slack * compliance), [0]
    parts: list[FloatArray] = []
    targets: list[FloatArray] = []
    slacks: list[FloatArray] = []
    first: list[int] = []
    for body, load in enumerate(loads):
        own = (owner == body).nonzero()[0]
        part, target, slack = load.build_constraints(place[own], normal[own], edge)
        column = np.zeros((len(owner), len(target)))
        column[own] = part
        first.append(sum(len(each) for each in targets))
        parts.append(column)
        targets.append(target)
        slacks.append(slack * compliance)
    return (np.concatenate(parts, axis=1), np.concatenate(targets), np.concatenate(slacks)), first


def press_springs(
    samples: GapSamples, loads: Sequence[Load], stiffness: float, edge: float
) -> tuple[FloatArray, FloatArray]:
    """Compute the forces of springs under the cells that carry the loads of all bodies.

    Args:
        samples: The m cells under the bodies, with their gaps.
        loads: Load of each body.
        stiffness: Stiffness of the spring of a whole cell [N/m].
        edge: Edge of a cell [m].

    Returns:
        Force on each cell, shape (m,) [N], and gap up to which each cell is in contact, shape (m,) [m].
    """
    forces, surface = np.zeros(samples.count), np.zeros(samples.count)
    for body, load in enumerate(loads):
        own = (samples.body == body).nonzero()[0]
        if len(own):
            columns, target, slack = load.build_constraints(samples.place[own], samples.normal[own], edge)
            springs = samples.gap[own], stiffness * samples.coverage[own]
            forces[own], surface[own] = compile_kernel(match_springs)(*springs, (columns, target, slack / stiffness))
    return forces, surface


class FoundationSolver(PressureSolver):
    """Solver for the pressure on an elastic foundation; no solution depends on previous ones."""

    def __init__(self, grid: CellGrid, modulus: float, bases: Sequence[BaseForces] = ()) -> None:
        """Compute the stiffness of a whole cell.

        Args:
            grid: The contact grid of the array.
            modulus: Modulus of the foundation, pressure per displacement [Pa/m].
            bases: Operator to texel forces at the base.
        """
        super().__init__(grid, bases)
        self._stiffness = modulus * grid.edge[0] * grid.edge[1]
        self._spread = compile_kernel(spread_on_window)

    def solve(self, samples: GapSamples, loads: Sequence[Load]) -> PressureSolution:
        """Compute the forces on the cells under all bodies; see `PressureSolver.solve`.

        In the window, the force on a partly covered cell is that on the whole cell.
        """
        forces, surface = press_springs(samples, loads, self._stiffness, self.grid.mean_edge)
        if not self.bases:
            return PressureSolution(forces=forces, surface=surface)
        origin = int(samples.row.min()), int(samples.column.min())
        corner = np.array([samples.row - origin[0], samples.column - origin[1]])
        weight = np.zeros((4, samples.count))
        weight[0] = 1.0
        window = self._spread(corner, weight, forces, (int(corner[0].max()) + 2, int(corner[1].max()) + 2))
        return PressureSolution(forces=forces, surface=surface, window=window, origin=origin, shares=(corner, weight))


def find_start(
    last: tuple[IntArray, IntArray, FloatArray],
    samples: tuple[IntArray, IntArray, FloatArray, IntArray],
    wanted: FloatArray,
    scratch: FloatArray,
) -> FloatArray:
    """Kernel, which calls no function of another file: compute the first forces of the iteration, shape (m,) [N].

    They are the last pressures on the m cells, scaled to the load of each body, or uniform pressure if the last
    pressures on the cells under a body give less than half its load.

    Args:
        last: Row, column, and pressure times the area of a whole cell [N], of each cell of the last solution.
        samples: Row, column, coverage and body of the m cells, see `GapSamples`.
        wanted: Load of each body, shape (bodies,) [N].
        scratch: Working memory of zeros, with the shape of the contact grid; zeros again afterwards.
    """
    row, column, coverage, body = samples
    forces, sums, areas = np.zeros(len(row)), np.zeros(len(wanted)), np.zeros(len(wanted))
    for k in range(len(last[0])):
        scratch[last[0][k], last[1][k]] = last[2][k]
    for k in range(len(row)):
        forces[k] = scratch[row[k], column[k]] * coverage[k]
        sums[body[k]] += forces[k]
        areas[body[k]] += coverage[k]
    for k in range(len(last[0])):
        scratch[last[0][k], last[1][k]] = 0.0
    for k in range(len(row)):
        b = body[k]
        if sums[b] > 0.5 * wanted[b]:
            forces[k] *= wanted[b] / sums[b]
        else:
            forces[k] = wanted[b] * coverage[k] / areas[b]
    return forces
