"""A solid under a rigid indenter, followed along a loading path.

Each step solves for all unknowns at a given depth, or for all unknowns and the depth at a given load (one bordered
system, one factorisation).  At every target the penetration that the penalty leaves is reduced by augmentation, and the
balance is met more closely than on the way.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import zip_longest

import numpy as np
import scipy.sparse as sp

from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.contact import ContactState, SurfaceContact
from fem_reference.finite_strain.hyperelastic import SmallStrainSolid, Solid
from fem_reference.finite_strain.loading_path import Control, Units
from fem_reference.finite_strain.newton import (
    EASY_ITERATIONS,
    STEP_FAILURES,
    Equilibrium,
    Linearisation,
    PathConvergenceError,
    is_balanced,
    solve_newton,
    walk_to,
)
from fem_reference.sparse_solver import ConstrainedSystem
from meshes.array_types import FloatArray, IntArray

_LOG = logging.getLogger(__name__)

#: Treat a mean penetration below this fraction of the depth as zero: augmentation stops there [-].
OVERLAP = 2.5e-4
#: Largest residual at a target and on the way to it.  Forces are relative to the largest nodal contact force, volumes
#: to the volume per pressure unknown, the load to its target [-].
_TARGET_TOLERANCE, _STEP_TOLERANCE = 1e-6, 1e-3
#: Largest number of augmentations at a target.
_AUGMENTATIONS = 6
#: Largest number of Newton iterations of a step: without friction, and with it, where the widths of the friction cones
#: are found in the same iterations.
_ITERATIONS, _FRICTION_ITERATIONS = 24, 60
#: First Newton iterations of a step in which the tangent leaves out the curvature of the indenter: far from equilibrium
#: it makes the iteration diverge.
_UNCURVED_ITERATIONS = 2
#: Least number of steps to a target with friction, because slip depends on the loading history.
_FRICTION_STEPS = 16
#: Tolerance of the iteration that updates the friction cones from the contact pressures: change of the pressures
#: between two updates over their sum [-].
_CONE_CHANGE = 1e-4
#: Number of times that the first step of a path is halved.
_FIRST_HALVINGS = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactEquilibrium(Equilibrium):
    """A converged state of a solid under an indenter.

    Attributes:
        contact: The contact.
        before_augmentation: The state before the penetration was reduced by augmentation; None if this is that state.
    """

    contact: ContactState
    before_augmentation: ContactEquilibrium | None = None

    @property
    def penalty_solution(self) -> ContactEquilibrium:
        """The solution that Newton's method finds first, with the penetration that the penalty leaves."""
        return self.before_augmentation or self


@dataclass(frozen=True, kw_only=True, eq=False)
class Guess:
    """A start for Newton's method.

    Attributes:
        state: Displacements [m], then mean pressures [Pa], shape (n,).
        depth: Approach [m].
    """

    state: FloatArray
    depth: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactProblem:
    """A solid, its constraints and the indenter above it.

    Attributes:
        solid: Elements and materials, in `units`.
        contact: Contact between the top and the indenter, in `units`.
        constrained: Unknowns that are zero.
        units: Units of length and stress of this problem; messages are in SI units.
        load_scale: Factor on the indenter's heights and on the targets; messages are divided by it [-].
        overlap: Mean penetration, relative to the depth, below which augmentation stops [-].
    """

    solid: Solid | SmallStrainSolid
    contact: SurfaceContact
    constrained: IntArray
    units: Units
    load_scale: float = 1.0
    overlap: float = OVERLAP

    def follow(
        self,
        targets: Sequence[float],
        *,
        control: Control,
        first: float,
        guesses: Sequence[Guess] = (),
        progress: Callable[[str], None] | None = None,
    ) -> list[ContactEquilibrium]:
        """Follow one loading path and return the equilibrium at every target.

        Args:
            targets: Loads [N] or depths [m], ascending.
            control: Whether the targets are loads or depths.
            first: Depth of the first step, small enough for a linear response [m].
            guesses: A guess for each target, from a coarser mesh.  Steps are taken only to targets where Newton's
                method does not converge from the guess.
            progress: Called with a line of text after each step.

        Raises:
            PathConvergenceError: If a step fails even after repeated halving.
        """
        out: list[ContactEquilibrium] = []
        for target, guess in zip_longest(targets, guesses):
            last = out[-1] if out else None
            reached = None if guess is None else self._solve_from_guess(guess, target, control, last)
            if reached is None:
                reached = self._walk(
                    last or self._take_first_step(first, target, control), target, first, control, progress
                )
            out.append(replace(self._tighten(reached, control), before_augmentation=reached))
            if progress is not None:
                progress(self._describe(out[-1]))
        return out

    def _describe(self, here: ContactEquilibrium) -> str:
        """Return load and depth as text, in SI units."""
        force, length = self.units.force / self.load_scale, self.units.length / self.load_scale
        return f"{here.load * force:.3g} N at {here.depth * length * 1e3:.3g} mm"

    def _solve_from_guess(
        self, guess: Guess, target: float, control: Control, before: ContactEquilibrium | None
    ) -> ContactEquilibrium | None:
        """Solve for a target directly from a guess; return None where that fails."""
        used = before.iterations if before else 0
        load, depth = (target, guess.depth) if control == "load" else (None, target)
        self.contact.augment(np.zeros_like(self.contact.weight))
        try:
            return self._solve(guess.state, depth, load, used, tolerance=_STEP_TOLERANCE)
        except STEP_FAILURES as error:
            _LOG.info("guess for %s %.4g failed: %s", control, target, error)
            return None

    def _walk(
        self,
        start: ContactEquilibrium,
        target: float,
        first: float,
        control: Control,
        progress: Callable[[str], None] | None,
    ) -> ContactEquilibrium:
        """Step to a target; each step starts from the last two equilibria, continued linearly."""

        def solve(before: ContactEquilibrium | None, here: ContactEquilibrium, aim: float) -> ContactEquilibrium:
            state, depth = _extrapolate(before, here, aim, control)
            load = aim if control == "load" else None
            reached = self._solve(state, depth, load, here.iterations, tolerance=_STEP_TOLERANCE)
            self.contact.record_slip(reached.contact)
            if progress is not None:
                progress(self._describe(reached))
            return reached

        friction = self.contact.friction
        return walk_to(
            target,
            start,
            control=control,
            step=start.load if control == "load" else first,
            solve=solve,
            describe=self._describe,
            easy=np.inf if friction else EASY_ITERATIONS,
            longest=abs(target) / _FRICTION_STEPS if friction else np.inf,
        )

    def _take_first_step(self, depth: float, target: float, control: Control) -> ContactEquilibrium:
        """Solve at a small depth from the undeformed state; the depth is halved until the solve converges.

        With friction the step must also be short enough not to pass the first of `_FRICTION_STEPS` steps to the target.
        """
        undeformed = np.zeros(self.solid.elements.displacements + self.solid.elements.pressures)
        most = target / _FRICTION_STEPS if self.contact.friction else np.inf
        for halving in range(_FIRST_HALVINGS):
            step = depth / 2**halving
            if control == "depth" and step > most:
                continue
            try:
                here = self._solve(undeformed, step, None, 0, tolerance=_STEP_TOLERANCE)
            except STEP_FAILURES as error:
                _LOG.info("first step halved: %s", error)
                continue
            if control == "depth" or here.load <= most:
                self.contact.record_slip(here.contact)
                return here
        millimetres = step * self.units.length / self.load_scale * 1e3
        raise PathConvergenceError(f"no convergence even at a depth of {millimetres:.3g} mm", None)

    def _tighten(self, here: ContactEquilibrium, control: Control) -> ContactEquilibrium:
        """Reduce the penetration by augmentation, then meet the balance closely."""
        pressure = np.zeros_like(here.contact.pressure)
        for _ in range(_AUGMENTATIONS):
            if here.contact.overlap < self.overlap * here.depth:
                break
            self.contact.augment(here.contact.pressure)
            closer = self._solve_again(here, control, _STEP_TOLERANCE)
            if closer is None:
                self.contact.augment(pressure)
                break
            here, pressure = closer, here.contact.pressure
        return self._solve_again(here, control, _TARGET_TOLERANCE) or here

    def _solve_again(self, here: ContactEquilibrium, control: Control, tolerance: float) -> ContactEquilibrium | None:
        """Solve for the same target from a nearby state; return None where that fails."""
        load = here.load if control == "load" else None
        try:
            out = self._solve(here.state, here.depth, load, here.iterations, tolerance=tolerance, uncurved=0)
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
        uncurved: int = _UNCURVED_ITERATIONS,
    ) -> ContactEquilibrium:
        """Solve at a depth or, if a load is given, for the depth as well.

        Args:
            state: State to start from.
            depth: The depth, or the one to start from [m].
            load: The load [N].
            used: Newton iterations of the path so far.
            tolerance: Largest relative residual [-].
            uncurved: Number of iterations that leave out the curvature of the indenter.
        """

        def linearise(unknowns: FloatArray, iteration: int) -> Linearisation[ContactEquilibrium]:
            state, depth = unknowns[:-1], float(unknowns[-1])
            internal, stiffness = self.solid.linearise(state)
            contact = self.contact.evaluate(state, depth, curved=iteration >= uncurved)
            balanced = self._is_balanced(internal + contact.force, contact, load, tolerance)
            equilibrium = None
            if balanced and self.contact.update_cone(contact) <= max(tolerance, _CONE_CHANGE):
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

        iterations = _FRICTION_ITERATIONS if self.contact.friction else _ITERATIONS
        return solve_newton(linearise, np.append(state, depth), iterations=iterations)

    def _solve_step(
        self, tangent: sp.csr_matrix, residual: FloatArray, contact: ContactState, load: float | None
    ) -> FloatArray:
        """Return Newton's step of the state and, if a load is given, of the depth; else the depth stays."""
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
        reference = np.abs(contact.force).max()
        balanced = is_balanced(
            self.solid.elements, residual, self.constrained, reference=reference, tolerance=tolerance
        )
        return balanced and (load is None or abs(load - contact.total) < tolerance * load)

    @cached_property
    def _system(self) -> ConstrainedSystem:
        return ConstrainedSystem(self.constrained)


def _extrapolate(
    before: ContactEquilibrium | None, here: ContactEquilibrium, aim: float, control: Control
) -> tuple[FloatArray, float]:
    """Return state and depth at a load or depth from the line through the last two equilibria."""
    if before is None:
        return here.state, here.depth if control == "load" else aim
    last, previous = (here.load, before.load) if control == "load" else (here.depth, before.depth)
    ahead = (aim - last) / (last - previous)
    depth = here.depth + ahead * (here.depth - before.depth) if control == "load" else aim
    return here.state + ahead * (here.state - before.state), depth
