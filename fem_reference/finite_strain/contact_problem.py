"""Solve the contact of an elastic solid with a rigid indenter along a loading path.

A loading path is a sequence of ascending target loads or depths.  Each step solves for all unknowns at a given depth,
or for all unknowns and the depth at a given load (one bordered system, one factorisation).  At every target,
augmentation reduces the penetration that remains with the penalty method, and the tolerance on the balance of forces
is smaller than in the steps between targets.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import zip_longest

import numpy as np
import scipy.sparse as sp

from fem_reference.elements.line import Line
from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.errors import ConvergenceError, PathConvergenceError
from fem_reference.finite_strain.contact import ContactState, SurfaceContact
from fem_reference.finite_strain.hyperelastic import SmallStrainSolid, Solid
from fem_reference.finite_strain.loading_path import Control, Progress, Units, report
from fem_reference.finite_strain.newton import (
    EASY_ITERATIONS,
    STEP_FAILURES,
    Equilibrium,
    Linearisation,
    is_balanced,
    solve_newton,
    walk_to,
)
from fem_reference.sparse_solver import ConstrainedSystem
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class PathSettings:
    """Constants of Newton's method along the loading path of an indenter."""

    #: Depth over cover thickness at which a loading path ends, before the cover under the indenter vanishes [-].
    deepest: float = 0.98
    #: Largest relative residual at a target [-].  Forces are relative to the largest nodal contact force, volumes to
    #: the volume per pressure unknown, and the error of the load to the load.
    target_tolerance: float = 1e-6
    #: Largest relative residual in the steps between targets, see `target_tolerance` [-].
    step_tolerance: float = 1e-3
    #: Largest number of augmentations at a target [-].
    augmentations: int = 6
    #: Largest number of Newton iterations in a step without friction [-].
    iterations: int = 24
    #: Largest number of Newton iterations in a step with friction [-].  These iterations also find the friction cones.
    friction_iterations: int = 60
    #: Change of the contact pressures over their sum below which the friction cones are no longer updated [-].
    cone_change: float = 1e-4
    #: First step from an initial guess between targets, over the distance to the next target [-].
    step_from_between: float = 0.25
    #: Largest number of times that the first step of a loading path is halved [-].
    first_halvings: int = 12
    #: Largest number of times that the first step of a loading path is doubled, after halving it has failed [-].
    first_doublings: int = 4
    #: Relative step below which a step that fails is solved by a viscous motion [-].
    small_step: float = 1 / 64
    #: Penetration over that at which augmentation stops, above which an augmentation may move viscously [-].
    far_overlap: float = 4.0
    #: First drag of a viscous motion [units of stress per area].
    first_drag: float = 1000.0
    #: Drag below which the next step of a viscous motion has no drag [units of stress per area].
    least_drag: float = 1.0
    #: Factor by which the drag rises after a step that fails and falls after one that converges [-].
    drag_ratio: float = 5.0
    #: Largest number of steps of a viscous motion [-].
    creep_steps: int = 25
    #: Largest number of Newton iterations in a step of a viscous motion [-].
    creep_iterations: int = 12
    #: Decimal digits, relative to the largest coordinate, to which coordinates of nodes on one mesh line agree [-].
    digits: int = 9
    #: Loads, over the largest load, at which equilibria between targets serve as initial guesses [-].
    shares: tuple[float, ...] = (0.8, 0.6, 0.4, 0.2)
    #: Further such loads, over the largest load of a path that stopped [-].
    stopped: tuple[float, ...] = (0.95, 0.9, 0.88)


_SETTINGS = PathSettings()


_LOG = logging.getLogger(__name__)

#: Mean penetration of indenter and cover, over the depth, below which augmentation stops [-].
OVERLAP = 2.5e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactEquilibrium(Equilibrium):
    """Equilibrium of an elastic solid under a rigid indenter.

    Attributes:
        contact: Contact forces and pressures.
        before_augmentation: Equilibrium before augmentation reduced the penetration; None without augmentation.
    """

    contact: ContactState
    before_augmentation: ContactEquilibrium | None = None

    @property
    def penalty_solution(self) -> ContactEquilibrium:
        """Equilibrium before augmentation, with the whole penetration of the penalty method."""
        return self.before_augmentation or self


@dataclass(frozen=True, kw_only=True, eq=False)
class Guess:
    """Initial guess for Newton's method.

    Attributes:
        state: Displacements [m], then mean pressures [Pa], shape (n,).
        depth: Approach of the indenter from first touch [m].
        load: Force on the indenter, needed only at a load between targets [N].
        contact_pressure: Largest contact pressure that is expected; 0 if unknown [Pa].
    """

    state: FloatArray
    depth: float
    load: float = 0.0
    contact_pressure: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactProblem:
    """Elastic solid with its constraints, in contact with a rigid indenter.

    Attributes:
        solid: Elements and materials, in `units`.
        contact: Contact condition between the top of the solid and the indenter, in `units`.
        constrained: Indices of the unknowns that are zero.
        units: Units of length and stress of this problem; messages are in SI units.
        load_scale: Factor on the heights of the indenter and on the targets; messages are divided by it [-].
        overlap: Mean penetration, over the depth, below which augmentation stops [-].
        friction_steps: Smallest number of steps to a target with friction, because slip depends on the loading
            history [-].
    """

    solid: Solid | SmallStrainSolid
    contact: SurfaceContact
    constrained: IntArray
    units: Units
    load_scale: float = 1.0
    overlap: float = OVERLAP
    friction_steps: int = 16

    def follow(
        self,
        targets: Sequence[float],
        *,
        control: Control,
        first: float,
        guesses: Sequence[Guess] = (),
        between: Sequence[Guess] = (),
        progress: Progress = None,
        record: Callable[[ContactEquilibrium], None] | None = None,
    ) -> list[ContactEquilibrium]:
        """Solve for the equilibrium at every target of a loading path, one after the other.

        Args:
            targets: Target loads [N] or depths [m], ascending.
            control: Whether the targets are loads or depths.
            first: Depth of the first step, small enough for a linear response [m].
            guesses: Initial guess for each target, from a coarser mesh.  Where Newton's method does not converge from
                the guess, the target is reached in steps.
            between: Initial guesses from a coarser mesh between the targets, descending.  The steps to a target start
                from the first guess from which Newton's method converges.
            progress: Called with a line of text after each step.
            record: Called with the equilibrium after each step.

        Returns:
            The equilibrium at every target.

        Raises:
            PathConvergenceError: If a step fails even after repeated halving.
        """
        out: list[ContactEquilibrium] = []
        for target, guess in zip_longest(targets, guesses):
            last = out[-1] if out else None
            reached = None if guess is None else self._solve_from_guess(guess, target, control, last, creeps=True)
            if reached is None:
                start = self._start_between(between, target, control, last)
                step = None if start is None else (target - getattr(start, control)) * _SETTINGS.step_from_between
                start = start or last or self._take_first_step(first, target, control)
                step = step or (start.load if control == "load" else first)
                try:
                    reached = self._walk(start, target, step, control=control, progress=progress, record=record)
                except PathConvergenceError as error:
                    error.load *= self.units.force / self.load_scale
                    error.depth *= self.units.length / self.load_scale
                    raise
            out.append(replace(self._tighten(reached, control), before_augmentation=reached))
            report(progress, self._describe(out[-1]))
        return out

    def _describe(self, here: ContactEquilibrium) -> str:
        """Format load and depth of an equilibrium as text, in SI units."""
        force, length = self.units.force / self.load_scale, self.units.length / self.load_scale
        return f"{here.load * force:.3g} N at {here.depth * length * 1e3:.3g} mm"

    def _solve_from_guess(
        self, guess: Guess, target: float, control: Control, before: ContactEquilibrium | None, *, creeps: bool = False
    ) -> ContactEquilibrium | None:
        """Solve for a target directly from an initial guess; return None if Newton's method does not converge.

        Args:
            guess: Initial guess.
            target: Load [N] or depth [m].
            control: Whether the target is a load or a depth.
            before: Equilibrium at the target before, if any.
            creeps: Whether a viscous motion from the guess is tried where Newton's method does not converge.
        """
        used = before.iterations if before else 0
        load, depth = (target, guess.depth) if control == "load" else (None, target)
        self.contact.augment(np.zeros_like(self.contact.weight))
        self.contact.stiffen(guess.contact_pressure)
        solve = self._solve_or_creep if creeps else self._solve
        try:
            return solve(guess.state, depth, load, used, tolerance=_SETTINGS.step_tolerance)
        except STEP_FAILURES as error:
            _LOG.info("guess for %s %.4g failed: %s", control, target, error)
            return None

    def _start_between(
        self, between: Sequence[Guess], target: float, control: Control, last: ContactEquilibrium | None
    ) -> ContactEquilibrium | None:
        """Solve for an equilibrium between the last and the next target, from initial guesses of a coarser mesh.

        Returns:
            The first equilibrium for which Newton's method converges; None if there is none.
        """
        reached = getattr(last, control) if last else 0.0
        inside = [guess for guess in between if reached < getattr(guess, control) < target]
        for guess in inside:
            found = self._solve_from_guess(guess, getattr(guess, control), control, last, creeps=guess is inside[0])
            if found is not None:
                return found
        return None

    def _walk(
        self,
        start: ContactEquilibrium,
        target: float,
        step: float,
        *,
        control: Control,
        progress: Progress,
        record: Callable[[ContactEquilibrium], None] | None,
    ) -> ContactEquilibrium:
        """Reach a target in steps; the initial guess of each step is the line through the last two equilibria."""

        def follow(before: ContactEquilibrium | None, here: ContactEquilibrium, aim: float) -> ContactEquilibrium:
            state, depth = _extrapolate(before, here, aim, control)
            self.contact.stiffen(float(here.contact.pressure.max()))
            load = aim if control == "load" else None
            # A small step that fails meets an instability.
            small = before is None and abs(aim / getattr(here, control) - 1) < _SETTINGS.small_step
            solve = self._solve_or_creep if small else self._solve
            reached = solve(state, depth, load, here.iterations, tolerance=_SETTINGS.step_tolerance, near=here)
            if self.load_scale == 1 and reached.depth >= _SETTINGS.deepest:
                raise ConvergenceError(
                    "the indenter would touch the base: its tip passes between the nodes of the mesh"
                )
            self.contact.record_slip(reached.contact)
            if record is not None:
                record(reached)
            report(progress, self._describe(reached))
            return reached

        friction = self.contact.friction
        return walk_to(
            target,
            start,
            control=control,
            step=step,
            solve=follow,
            describe=self._describe,
            easy=np.inf if friction else EASY_ITERATIONS,
            longest=abs(target) / self.friction_steps if friction else np.inf,
        )

    def _solve_or_creep(
        self,
        state: FloatArray,
        depth: float,
        load: float | None,
        used: int,
        *,
        tolerance: float,
        near: ContactEquilibrium | None = None,
    ) -> ContactEquilibrium:
        """Solve for an equilibrium; where Newton's method fails, by implicit steps of a viscous motion to rest.

        The drag on the displacements falls after each step that converges and rises after each that does not
        (pseudo-transient continuation, Kelley and Keyes 1998).  The motion passes instabilities, such as that of an
        element that slides around the edge of an indenter.  With friction, which depends on the path, nothing creeps.
        The arguments are those of `_solve`.

        Raises:
            ConvergenceError: If the motion does not come to rest.
        """
        drag = 0.0
        for _ in range(_SETTINGS.creep_steps):
            try:
                near = self._solve(state, depth, load, used, tolerance=tolerance, near=near, drag=drag)
            except STEP_FAILURES as error:
                if self.contact.friction:
                    raise
                _LOG.info("drag %.3g: %s", drag, error)
                drag = max(drag * _SETTINGS.drag_ratio, _SETTINGS.first_drag)
                continue
            if drag == 0:
                return near
            moved = near.iterations > used
            state, depth, used = near.state, near.depth, near.iterations
            drag = drag / _SETTINGS.drag_ratio if moved and drag > _SETTINGS.least_drag else 0.0
        raise ConvergenceError("the cover does not come to rest")

    def _take_first_step(self, depth: float, target: float, control: Control) -> ContactEquilibrium:
        """Solve at a small depth from the undeformed state.

        If Newton's method does not converge, the depth is halved, up to `first_halvings` times.  If it still does not
        converge, multiples 2, 4, ... of the depth are tried, because under a sharp tip no quadrature point is in
        contact at a very small depth.  With friction, the load or depth is at most 1 / `friction_steps` of the target.

        Args:
            depth: First depth that is tried [m].
            target: Load [N] or depth [m] at the end of the loading path.
            control: Whether the target is a load or a depth.
        """
        undeformed = np.zeros(self.solid.elements.displacements + self.solid.elements.pressures)
        most = target / self.friction_steps if self.contact.friction else np.inf
        largest = min(most, target) if control == "depth" else np.inf
        steps = [depth / 2**count for count in range(_SETTINGS.first_halvings)]
        for step in (*steps, *(depth * 2**count for count in range(1, _SETTINGS.first_doublings + 1))):
            if step > largest:
                continue
            try:
                here = self._solve(undeformed, step, None, 0, tolerance=_SETTINGS.step_tolerance)
            except STEP_FAILURES as error:
                _LOG.info("first step %.3g failed: %s", step, error)
                continue
            if control == "depth" or here.load <= most:
                self.contact.record_slip(here.contact)
                return here
        millimetres = steps[-1] * self.units.length / self.load_scale * 1e3
        cause = f"no convergence even at a depth of {millimetres:.3g} mm"
        raise PathConvergenceError(cause, cause=cause)

    def _tighten(self, here: ContactEquilibrium, control: Control) -> ContactEquilibrium:
        """Reduce the penetration in an equilibrium by augmentation, then solve with the smaller target tolerance."""
        pressure = np.zeros_like(here.contact.pressure)
        for _ in range(_SETTINGS.augmentations):
            if here.contact.overlap < self.overlap * here.depth:
                break
            self.contact.augment(here.contact.pressure)
            closer = self._solve_again(here, control, _SETTINGS.step_tolerance)
            if closer is None:
                self.contact.augment(pressure)
                break
            here, pressure = closer, here.contact.pressure
        return self._solve_again(here, control, _SETTINGS.target_tolerance) or here

    def _solve_again(self, here: ContactEquilibrium, control: Control, tolerance: float) -> ContactEquilibrium | None:
        """Solve again for the target of an equilibrium, from its state; None if Newton's method does not converge."""
        load = here.load if control == "load" else None
        far = here.contact.overlap > _SETTINGS.far_overlap * self.overlap * here.depth
        solve = self._solve_or_creep if far else self._solve
        try:
            out = solve(here.state, here.depth, load, here.iterations, tolerance=tolerance, near=here)
        except STEP_FAILURES as error:
            _LOG.info("a mean penetration of %.2g m remains: %s", here.contact.overlap, error)
            return None
        self.contact.record_slip(out.contact)
        _LOG.info("penetration %.2g of the depth, %d iterations", out.contact.overlap / out.depth, out.iterations)
        return out

    def _solve(
        self,
        state: FloatArray,
        depth: float,
        load: float | None,
        used: int,
        *,
        tolerance: float,
        near: ContactEquilibrium | None = None,
        drag: float = 0.0,
    ) -> ContactEquilibrium:
        """Solve for the equilibrium at a depth or, if a load is given, for the equilibrium and the depth at this load.

        Args:
            state: Initial guess of displacements and pressures, shape (n,).
            depth: Given depth or, if a load is given, initial guess of the depth [m].
            load: Given load [N], or None.
            used: Number of Newton iterations on the loading path so far [-].
            tolerance: Largest relative residual [-].
            near: Nearby equilibrium, whose contact pressure and volume enter the first tangent.  Later tangents use
                those predicted by the previous iteration.  The pressure and volume of the state itself contain the
                penalty times the error of linearisation, with which Newton's method diverges.
            drag: Force per volume and per displacement from the initial guess [units of stress per area].
        """
        anchor, pull = state, drag * self._volume
        seen: tuple[FloatArray, ContactState] | None = None

        def linearise(unknowns: FloatArray, iteration: int) -> Linearisation[ContactEquilibrium]:
            nonlocal seen
            state, depth = unknowns[:-1], float(unknowns[-1])
            volume, pressure = None, np.zeros_like(self.contact.weight)
            if seen is not None:
                volume = self.solid.predict_volume(seen[0], state)
                pressure = self.contact.predict_pressure(seen[1], state, depth)
            elif near is not None:
                volume, pressure = self.solid.predict_volume(near.state, near.state), near.contact.pressure
            internal, stiffness = self.solid.linearise(state, volume)
            if drag:
                internal, stiffness = internal + pull * (state - anchor), stiffness + sp.diags_array(pull).tocsr()
            contact = self.contact.evaluate(state, depth, expected=pressure)
            seen = state, contact
            balanced = self._is_balanced(internal + contact.force, contact, load, tolerance)
            equilibrium = None
            if balanced and self.contact.update_cone(contact) <= max(tolerance, _SETTINGS.cone_change):
                equilibrium = ContactEquilibrium(
                    state=state,
                    depth=depth,
                    load=contact.total if load is None else load,
                    contact=contact,
                    reaction=internal,
                    iterations=used + iteration,
                )
            elif balanced:
                contact = self.contact.evaluate(state, depth)
            unbalanced = 0.0 if load is None else (contact.total - load) / self.contact.multiple
            return Linearisation(
                equilibrium=equilibrium,
                solve=partial(self._solve_step, stiffness + contact.tangent, internal + contact.force, contact, load),
                gradient=np.append(internal + contact.force, unbalanced),
                changed=balanced,
            )

        iterations = _SETTINGS.creep_iterations if drag else _SETTINGS.iterations
        if self.contact.friction:
            iterations = _SETTINGS.friction_iterations
        return solve_newton(linearise, np.append(state, depth), iterations=iterations)

    def _solve_step(
        self, tangent: sp.csr_matrix, residual: FloatArray, contact: ContactState, load: float | None
    ) -> FloatArray:
        """Solve for the Newton step of the state and of the depth; the depth changes only if a load is given."""
        if load is None:
            return np.append(self._system.factorise(tangent).solve(-residual), 0.0)
        if contact.stiffness == 0:
            raise ConvergenceError("the indenter lost contact with the cover")
        right = np.column_stack([-residual, -contact.depth_force])
        at_depth, per_depth = self._system.factorise(tangent).solve(right).T
        depth_force = contact.depth_force * self.contact.multiple
        change = (load - contact.total - depth_force @ at_depth) / (contact.stiffness + depth_force @ per_depth)
        return np.append(at_depth + change * per_depth, change)

    def _is_balanced(self, residual: FloatArray, contact: ContactState, load: float | None, tolerance: float) -> bool:
        """Return whether the residual of equilibrium and the error of the load are below the tolerance [-]."""
        reference = np.abs(contact.force).max()
        balanced = is_balanced(
            self.solid.elements, residual, self.constrained, reference=reference, tolerance=tolerance
        )
        return balanced and (load is None or abs(load - contact.total) < tolerance * load)

    @cached_property
    def _volume(self) -> FloatArray:
        """Volume that belongs to each displacement, 0 for each pressure, shape (n,)."""
        elements = self.solid.elements
        share = elements.weight.sum(axis=1, keepdims=True) / elements.cells.shape[1]
        size = elements.displacements + elements.pressures
        volume = np.broadcast_to(share, elements.unknowns.shape).ravel()
        return np.asarray(np.bincount(elements.unknowns.ravel(), volume, minlength=size), dtype=float)

    @cached_property
    def _system(self) -> ConstrainedSystem:
        """Linear solver for the Newton steps, in which the constrained unknowns are zero."""
        return ConstrainedSystem(self.constrained)


def _extrapolate(
    before: ContactEquilibrium | None, here: ContactEquilibrium, aim: float, control: Control
) -> tuple[FloatArray, float]:
    """Extrapolate the unknowns and the depth linearly from the last two equilibria to the load or depth `aim`."""
    if before is None:
        return here.state, here.depth if control == "load" else aim
    last, previous = (here.load, before.load) if control == "load" else (here.depth, before.depth)
    ahead = (aim - last) / (last - previous)
    depth = here.depth + ahead * (here.depth - before.depth) if control == "load" else aim
    return here.state + ahead * (here.state - before.state), depth


@dataclass(frozen=True, kw_only=True, eq=False)
class SolvedPath:
    """Equilibria of a loading path on one mesh.

    Attributes:
        elements: Elements of the mesh.
        equilibria: Equilibrium at every target load or depth.
        steps: Equilibria between the targets, ascending.
        coarse: Solution of this loading path on a coarser mesh, for initial guesses below the first of `steps`.
    """

    elements: MixedElements
    equilibria: Sequence[ContactEquilibrium]
    steps: Sequence[ContactEquilibrium] = ()
    coarse: SolvedPath | None = None

    def transfer_guesses(self, target: MixedElements) -> list[Guess]:
        """Interpolate the equilibrium at every target, before augmentation, to another mesh as initial guesses."""
        return [self._transfer(each.penalty_solution, target) for each in self.equilibria]

    def transfer_steps(self, target: MixedElements, wanted: Sequence[float] | None = None) -> list[Guess]:
        """Interpolate a few of the equilibria between the targets to another mesh as initial guesses, descending.

        Args:
            target: Elements of the other mesh.
            wanted: Descending loads near which equilibria are selected [N]; None for `PathSettings.shares` of the
                largest load.
        """
        loads = np.array([each.load for each in self.steps])
        least = loads.min(initial=np.inf)
        if wanted is None:
            last = self.equilibria[-1].load if self.equilibria else loads.max(initial=0.0)
            shares = _SETTINGS.shares if self.equilibria else (*_SETTINGS.stopped, *_SETTINGS.shares)
            wanted = [share * last for share in shares]
        chosen = dict.fromkeys(int(np.argmin(np.abs(loads - load))) for load in wanted if load >= least)
        below = [load for load in wanted if load < least]
        coarse = self.coarse.transfer_steps(target, below) if self.coarse else []
        return [self._transfer(self.steps[index], target) for index in chosen] + coarse

    def _transfer(self, reached: ContactEquilibrium, target: MixedElements) -> Guess:
        """Interpolate one equilibrium to another mesh as an initial guess."""
        return Guess(
            state=transfer_state(self.elements, target, reached.state),
            depth=reached.depth,
            load=reached.load,
            contact_pressure=float(reached.contact.pressure.max()),
        )


def transfer_state(source: MixedElements, target: MixedElements, state: FloatArray) -> FloatArray:
    """Interpolate displacements and pressures to another tensor-product mesh of the same cover.

    Args:
        source: Elements that `state` belongs to.
        target: Elements of the other mesh.  At nodes outside the source mesh the nearest value is used.
        state: Displacements [m], then pressures [Pa], on the source mesh, shape (n,).

    Returns:
        Displacements [m], then pressures [Pa], on the target mesh, shape (m,).
    """
    d = source.dimension
    displacement = state[: source.displacements].reshape(-1, d)
    components = [_interpolate(source.nodes, displacement[:, i], target.nodes, 2) for i in range(d)]
    here, there = locate_pressures(source), locate_pressures(target)
    pressure = np.empty(target.pressures)
    # Pressures jump between regions, so the pressure is interpolated in each region separately.
    for region in np.unique(target.region):
        mine, theirs = _find_pressures(source, region), _find_pressures(target, region)
        pressure[theirs] = _interpolate(here[mine], state[source.displacements + mine], there[theirs], 1)
    return np.concatenate([np.stack(components, axis=1).ravel(), pressure])


def locate_pressures(elements: MixedElements) -> FloatArray:
    """Return the positions of the p pressure unknowns, shape (p, dimension) [m]."""
    mesh = elements.basis.mesh
    out = np.empty((elements.pressures, elements.dimension))
    out[elements.pressure_cells] = np.moveaxis(mesh.p[:, mesh.t], 0, -1).transpose(1, 0, 2)
    return out


def _interpolate(positions: FloatArray, values: FloatArray, wanted: FloatArray, order: int) -> FloatArray:
    """Interpolate nodal values from one tensor-product mesh to another by the shape functions of the elements.

    Args:
        positions: Positions of the n nodes in any order, shape (n, d) [m].
        values: Values at the nodes, shape (n,).
        wanted: Positions of the m nodes of the other mesh, shape (m, d) [m].
        order: Polynomial order of the elements [-].

    Returns:
        Interpolated values, shape (m,); outside the mesh the nearest value.
    """
    (lines, index), (others, place) = _find_lines(positions), _find_lines(wanted)
    table = np.empty([len(line) for line in lines])
    table[tuple(index)] = values
    for axis, (line, other) in enumerate(zip(lines, others, strict=True)):
        shapes = Line(edges=line[::order], order=order).at(np.clip(other, line[0], line[-1]))
        table = np.moveaxis(np.tensordot(shapes, table, axes=(1, axis)), 0, axis)
    return np.asarray(table[tuple(place)])


def _find_lines(positions: FloatArray) -> tuple[list[FloatArray], list[IntArray]]:
    """Return the mesh lines of a tensor-product grid along each axis, and the line of each of n nodes, shape (n,)."""
    digits = _SETTINGS.digits - int(np.ceil(np.log10(np.abs(positions).max())))
    found = [np.unique(np.round(axis, digits), return_inverse=True) for axis in positions.T]
    return [line for line, _ in found], [index for _, index in found]


def _find_pressures(elements: MixedElements, region: int) -> IntArray:
    """Return the indices of the pressure unknowns of one region, that is of one layer."""
    return np.unique(elements.pressure_cells[elements.region == region])
