"""Load stepping and Newton's method for a solid under an obstacle.

Each step solves for all unknowns at a given depth, or for all unknowns and the depth at a given load (one bordered
system, one factorisation).  A step that does not converge is halved; after enough halvings the path stops and what
converged is returned with the error.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference.elements.scaling import Units
from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.contact import SurfaceContact, Touch
from fem_reference.finite_strain.hyperelastic import InvertedError, SmallStrainSolid, Solid
from fem_reference.sparse_solver import ConstrainedSystem

FloatArray = npt.NDArray[np.float64]

_LOG = logging.getLogger(__name__)

#: What a step that was too long ends in.
_FAILURES = (InvertedError, ConvergenceError, np.linalg.LinAlgError)
_ITERATIONS = 24
_SMALLEST = 1 / 256
#: Residuals relative to the largest contact force and to a pressure unknown's share of the volume: at a target, and
#: on the way to it.
_TIGHT, _LOOSE = 1e-6, 1e-3
#: Iterations of each step in which the obstacle's curvature is left out of the tangent.
_STRAIGHT = 2
#: Steps of a path with friction, whose slip depends on the way, and iterations of each, cones included.
_FRICTION_STEPS, _FRICTION_ITERATIONS = 16, 60
#: Share of the pressures that may still change when friction counts as found.
_CONE = 1e-4
#: Halvings of Newton's steps that would turn an element inside out, in one solve.
_HALVINGS = 4
#: Slope at a step's end over that at its beginning from which it went too far.
_UPHILL = 0.3
#: A step that took fewer iterations than this may be followed by a longer one.
_EASY = 8
#: How often at most the overlap that the penalty leaves is worked off at a target [-].
_AUGMENTATIONS = 6
#: Overlap that counts as none, relative to the depth.
OVERLAP = 2.5e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Equilibrium:
    """A converged state.

    Attributes:
        state: Displacements and mean pressures, shape (n,) [m], [Pa].
        depth: Approach [m].
        load: Force on the indenter [N].
        touch: The contact.
        reaction: Internal force at every unknown, shape (n,) [N]; at held ones it is the reaction.
        iterations: Newton iterations since the path began [-].
        pressed: The state before the overlap that the penalty leaves was worked off; None where it was not.
    """

    state: FloatArray
    depth: float
    load: float
    touch: Touch
    reaction: FloatArray
    iterations: int
    pressed: Equilibrium | None = None


def first_solved(target: Equilibrium) -> Equilibrium:
    """A target before its overlap was worked off, which is where a path solves it first."""
    return target.pressed or target


def _predicted(before: Equilibrium | None, here: Equilibrium, aim: float, control: str) -> tuple[FloatArray, float]:
    """State and depth to start Newton's method from: the last two states continued on a straight line."""
    if before is None:
        return here.state, here.depth if control == "load" else aim
    last, previous = (here.load, before.load) if control == "load" else (here.depth, before.depth)
    ahead = (aim - last) / (last - previous)
    depth = here.depth + ahead * (here.depth - before.depth) if control == "load" else aim
    return here.state + ahead * (here.state - before.state), depth


@dataclass(frozen=True, kw_only=True, eq=False)
class Guess:
    """A state near a target.

    Attributes:
        state: Displacements and mean pressures, shape (n,) [m], [Pa].
        depth: Approach [m].
    """

    state: FloatArray
    depth: float


class PathError(ConvergenceError):
    """The loading path stopped early.

    Attributes:
        reached: The last converged state, None when there is none.
    """

    def __init__(self, message: str, reached: Equilibrium | None) -> None:
        super().__init__(message)
        self.reached = reached


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """A step of Newton's method; `slope` is that of the potential along it where it began [J]."""

    state: FloatArray
    depth: float
    slope: float = 0.0

    def back(self, slope: float) -> float:
        """Share of the step to take back where it ended uphill nearly as steep as it began downhill, else 0.

        Points that stick in one iteration and slide in the next make Newton's method cycle; a secant of the slope
        stops it between the two.
        """
        if self.slope * slope >= 0 or abs(slope) < _UPHILL * abs(self.slope):
            return 0.0
        return float(np.clip(slope / (slope - self.slope), 0.1, 0.9))


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """A solid, its held unknowns and the obstacle over it.

    Attributes:
        solid: Elements and materials, in `units`.
        contact: The top and the obstacle, in `units`.
        fixed: Held unknowns.
        units: What one stands for in lengths and stresses here; messages are in SI.
        load_scale: Factor on heights and targets, which messages undo [-].
        overlap: Overlap that counts as none, relative to the depth [-].
    """

    solid: Solid | SmallStrainSolid
    contact: SurfaceContact
    fixed: npt.NDArray[np.int64]
    units: Units
    load_scale: float = 1.0
    overlap: float = OVERLAP
    _last: list[ConstrainedSystem] = field(default_factory=list, init=False, repr=False)

    def follow(
        self,
        targets: Sequence[float],
        *,
        control: str,
        first: float,
        guesses: Sequence[Guess] = (),
        progress: Callable[[str], None] | None = None,
    ) -> list[Equilibrium]:
        """Follow one loading path and stop at every target.

        Args:
            targets: Loads [N] or depths [m], ascending.
            control: "load" or "depth".
            first: Depth of the first step, well inside the linear range [m].
            guesses: A state and depth near each target, from a coarser mesh; the path is walked only where they fail.
            progress: Called with a line of text after each step.

        Raises:
            PathError: If a step fails even when halved repeatedly.
        """
        out: list[Equilibrium] = []
        for target, guess in zip_longest(targets, guesses):
            reached = None if guess is None else self._from_guess(guess, target, control, out[-1] if out else None)
            if reached is None:
                start = out[-1] if out else self._first(first, target, control)
                reached = self._walk(start, target, control, first, progress)
            out.append(replace(self._tightened(reached, control), pressed=reached))
            if progress is not None:
                progress(self._where(out[-1]))
        return out

    def _where(self, here: Equilibrium) -> str:
        force, length = self.units.force / self.load_scale, self.units.length / self.load_scale
        return f"{here.load * force:.3g} N at {here.depth * length * 1e3:.3g} mm"

    def _from_guess(self, guess: Guess, target: float, control: str, before: Equilibrium | None) -> Equilibrium | None:
        """Straight to the target from a good guess; None where that fails."""
        used = before.iterations if before else 0
        load, depth = (target, guess.depth) if control == "load" else (None, target)
        self.contact.augment(np.zeros_like(self.contact.weight))
        try:
            return self._newton(guess.state, depth, load, used, tight=_LOOSE)
        except _FAILURES as error:
            _LOG.info("guess for %s %.4g failed: %s", control, target, error)
            return None

    def _walk(
        self,
        here: Equilibrium,
        target: float,
        control: str,
        first: float,
        progress: Callable[[str], None] | None,
    ) -> Equilibrium:
        """Step to a target; steps grow when easy and are halved when they fail."""
        before = None
        step = here.load if control == "load" else first
        while (done := here.load if control == "load" else here.depth) != target:
            aim = target if abs(target - done) <= 1.3 * step else done + np.sign(target - done) * step
            used = here.iterations
            try:
                state, depth = _predicted(before, here, aim, control)
                load = aim if control == "load" else None
                before, here = here, self._newton(state, depth, load, used, tight=_LOOSE)
                self.contact.settle(here.touch)
            except _FAILURES as error:
                step = abs(aim - done) / 2
                before = None
                _LOG.info("step to %s %.4g halved: %s", control, aim, error)
                if step < abs(target) * _SMALLEST:
                    message = f"no convergence beyond {self._where(here)}: {error}"
                    raise PathError(message, here) from error
                continue
            step *= 1.8 if here.iterations - used < _EASY or self.contact.friction else 1.0
            if self.contact.friction:
                step = min(step, abs(target) / _FRICTION_STEPS)
            if progress is not None:
                progress(self._where(here))
        return here

    def _first(self, depth: float, target: float, control: str) -> Equilibrium:
        """The first step from rest, halved until it converges; with friction it must not pass what it leads to."""
        rest = np.zeros(self.solid.elements.displacements + self.solid.elements.pressures)
        most = target / _FRICTION_STEPS if self.contact.friction else np.inf
        for halving in range(12):
            step = depth / 2**halving
            if control == "depth" and step > most:
                continue
            try:
                here = self._newton(rest, step, None, 0, tight=_LOOSE)
            except _FAILURES as error:
                _LOG.info("first step halved: %s", error)
                continue
            if control == "depth" or here.load <= most:
                self.contact.settle(here.touch)
                return here
        raise PathError(f"no convergence even at a depth of {step * self.units.length / self.load_scale:.3g} m", None)

    def _tightened(self, here: Equilibrium, control: str) -> Equilibrium:
        """Augment until the overlap is negligible beside the depth, then meet the balance closely."""
        pressure = np.zeros_like(here.touch.pressure)
        for _ in range(_AUGMENTATIONS):
            if here.touch.overlap < self.overlap * here.depth:
                break
            self.contact.augment(here.touch.pressure)
            closer = self._again(here, control, _LOOSE)
            if closer is None:
                self.contact.augment(pressure)
                break
            here, pressure = closer, here.touch.pressure
        return self._again(here, control, _TIGHT) or here

    def _again(self, here: Equilibrium, control: str, tight: float) -> Equilibrium | None:
        """The same target once more, from nearby; None where that fails."""
        load = here.load if control == "load" else None
        try:
            out = self._newton(here.state, here.depth, load, here.iterations, tight=tight, straight=0)
        except _FAILURES as error:
            _LOG.info("an overlap of %.2g m stays: %s", here.touch.overlap, error)
            return None
        self.contact.settle(out.touch)
        _LOG.info("overlap %.2g of the depth, %d iterations", out.touch.overlap / out.depth, out.iterations)
        return out

    def _newton(
        self, state: FloatArray, depth: float, load: float | None, used: int, *, tight: float, straight: int = _STRAIGHT
    ) -> Equilibrium:
        """Solve at a depth, or, where a load is given, for the depth as well."""
        state = state.copy()
        step, halved = None, 0
        most = _FRICTION_ITERATIONS if self.contact.friction else _ITERATIONS
        for iteration in range(most):
            try:
                internal, stiffness = self.solid.linearise(state)
            except InvertedError:
                if step is None or halved == _HALVINGS:
                    raise
                step, halved = replace(step, state=step.state / 2, depth=step.depth / 2), halved + 1
                state -= step.state
                depth -= step.depth
                continue
            touch = self.contact.at(state, depth, curved=iteration >= straight)
            balanced = self._balanced(internal + touch.force, touch, load, tight)
            if balanced and self.contact.renew_cone(touch) <= max(tight, _CONE):
                return Equilibrium(
                    state=state,
                    depth=depth,
                    load=touch.total if load is None else load,
                    touch=touch,
                    reaction=internal,
                    iterations=used + iteration,
                )
            if balanced:
                touch, step = self.contact.at(state, depth), None
            if step is not None and (back := step.back(self._slope(step, internal, touch, load))):
                state -= back * step.state
                depth -= back * step.depth
                step = None
                continue
            system = self._system(stiffness + touch.tangent)
            step = self._step(system, internal, touch, load)
            step = replace(step, slope=self._slope(step, internal, touch, load))
            state += step.state
            depth += step.depth
        raise ConvergenceError(f"Newton's method did not converge in {most} iterations")

    def _system(self, tangent: sp.csr_matrix) -> ConstrainedSystem:
        """The tangent, factorised; what the analysis of the last one found is used again."""
        self._last[:] = [ConstrainedSystem(tangent, self.fixed, like=self._last[0] if self._last else None)]
        return self._last[0]

    def _step(self, system: ConstrainedSystem, internal: FloatArray, touch: Touch, load: float | None) -> _Step:
        """Newton's step at a depth, or, where a load is given, with the depth."""
        if load is None:
            return _Step(state=system.solve(-internal - touch.force), depth=0.0)
        if touch.stiffness == 0:
            raise ConvergenceError("the indenter lost touch with the cover")
        right = np.column_stack([-internal - touch.force, -touch.depth_force])
        at_rest, per_depth = system.solve(right).T
        lift = touch.depth_force * self.contact.multiple
        change = float((load - touch.total - lift @ at_rest) / (touch.stiffness + lift @ per_depth))
        return _Step(state=at_rest + change * per_depth, depth=change)

    def _slope(self, step: _Step, internal: FloatArray, touch: Touch, load: float | None) -> float:
        """Slope of the potential along a step [J]."""
        along = float((internal + touch.force) @ step.state)
        return along if load is None else along + (touch.total - load) / self.contact.multiple * step.depth

    def _balanced(self, residual: FloatArray, touch: Touch, load: float | None, tight: float) -> bool:
        """Whether forces, volumes and the load are met."""
        split = self.solid.elements.displacements
        forces = np.abs(residual[:split][self._moving]).max(initial=0.0)
        volumes = np.abs(residual[split:]).max()
        share = float(self.solid.elements.weight.sum()) / (len(residual) - split)
        met = load is None or abs(load - touch.total) < tight * load
        return bool(forces < tight * np.abs(touch.force).max() and volumes < tight * share and met)

    @cached_property
    def _moving(self) -> npt.NDArray[np.bool_]:
        moving = np.ones(self.solid.elements.displacements, dtype=bool)
        moving[self.fixed[self.fixed < len(moving)]] = False
        return moving
