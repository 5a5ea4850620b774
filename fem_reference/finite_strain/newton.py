"""Solve for the equilibrium of a deforming solid by Newton's method, and follow a loading path in steps.

A problem provides a function that linearises its equations at given unknowns (`Linearisation`).  `solve_newton`
iterates to equilibrium.  `walk_to` reaches a target load or depth in steps, each solved by Newton's method; a step that
does not converge is halved.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.errors import ConvergenceError, PathConvergenceError
from fem_reference.finite_strain.hyperelastic import InvertedElementError
from fem_reference.finite_strain.loading_path import Control
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class NewtonSettings:
    """Constants of Newton's method and of the steps of a loading path."""

    #: Largest number of times that Newton steps are halved in one solution because they invert an element [-].
    halvings: int = 4
    #: Magnitude of the slope of the potential energy at the end of a Newton step, over that at its beginning, above
    #: which a step past the minimum of the energy is partly reversed [-].
    overshoot: float = 0.3
    #: Smallest fraction of a Newton step that is reversed [-].
    least_back: float = 0.1
    #: Largest fraction of a Newton step that is reversed [-].
    most_back: float = 0.9
    #: Smallest step along a loading path, over the load or depth that has been reached [-].  The solver stops if a
    #: smaller step would be needed.  The step is not relative to the target, because under a sharp tip the first loads
    #: are far below the target.
    smallest_step: float = 1 / 256
    #: Largest length of the last step to a target over the planned step, so that no tiny step remains [-].
    last_step: float = 1.3
    #: Factor by which the step along a loading path grows after an easy step, if no step has failed yet [-].
    growth: float = 1.8
    #: Factor by which the step along a loading path grows after an easy step, if a step has failed before [-].  The
    #: failed step was near the longest step that converges.  With faster growth most of the time would be spent on
    #: failed steps.
    careful_growth: float = 1.2


_SETTINGS = NewtonSettings()


_LOG = logging.getLogger(__name__)

#: Exceptions that Newton's method raises when a step along the loading path was too long.
STEP_FAILURES = (ConvergenceError, np.linalg.LinAlgError)
#: Number of Newton iterations below which a step counts as easy [-].
EASY_ITERATIONS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Equilibrium:
    """Equilibrium of an elastic solid that is loaded by a rigid body.

    Attributes:
        state: Displacements [m], then mean pressures [Pa], shape (n,).
        depth: Approach of the rigid body from first touch [m].
        load: Force on the rigid body [N].
        reaction: Internal force at every unknown, which is the reaction at constrained unknowns, shape (n,) [N].
        iterations: Number of Newton iterations since the start of the loading path [-].
    """

    state: FloatArray
    depth: float
    load: float
    reaction: FloatArray
    iterations: int


#: Type of the equilibrium that the equations of a problem return.
Reached = TypeVar("Reached", bound=Equilibrium)


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearisation(Generic[Reached]):
    """Equations of equilibrium, linearised at given values of the n unknowns.

    Attributes:
        equilibrium: Equilibrium, if the unknowns satisfy the equations within the tolerance; else None.
        solve: Function that returns the Newton step, shape (n,).
        gradient: Gradient of the potential energy, shape (n,); None where steps need not be checked for overshoot.
        changed: Whether the equations differ from those of the previous iteration.  The slopes of the energy at the
            beginning and end of the last step cannot be compared then.
    """

    equilibrium: Reached | None
    solve: Callable[[], FloatArray]
    gradient: FloatArray | None = None
    changed: bool = False

    def measure_slope(self, step: FloatArray) -> float:
        """Compute the derivative of the potential energy along a step [J]; 0 if the gradient is None."""
        return 0.0 if self.gradient is None else float(self.gradient @ step)


def solve_newton(
    linearise: Callable[[FloatArray, int], Linearisation[Reached]], start: FloatArray, *, iterations: int
) -> Reached:
    """Solve nonlinear equations by Newton's method.

    Args:
        linearise: Function that linearises the equations, given the unknowns, shape (n,), and the iteration number.
        start: Initial guess of the unknowns, shape (n,).
        iterations: Largest number of iterations [-].

    Returns:
        The equilibrium.

    Raises:
        ConvergenceError: If Newton's method does not converge in `iterations` iterations.
        InvertedElementError: If an element remains inverted although steps are halved.
    """
    unknowns, step, slope, halvings = start, None, 0.0, 0
    for iteration in range(iterations):
        # If a Newton step turns an element inside out, half of it is tried.
        try:
            here = linearise(unknowns, iteration)
        except InvertedElementError:
            if step is None or halvings == _SETTINGS.halvings:
                raise
            step, halvings = step / 2, halvings + 1
            unknowns = unknowns - step
            continue
        if here.equilibrium is not None:
            return here.equilibrium
        # A step that passes the minimum of the potential energy is partly reversed.  Otherwise contact points that
        # stick in one iteration and slide in the next can make the iteration cycle.
        if step is not None and not here.changed:
            back = _measure_overshoot(slope, here.measure_slope(step))
            if back:
                unknowns, step = unknowns - back * step, None
                continue
        step = here.solve()
        slope = here.measure_slope(step)
        unknowns = unknowns + step
    raise ConvergenceError(f"Newton's method did not converge in {iterations} iterations")


def walk_to(
    target: float,
    start: Reached,
    *,
    control: Control,
    step: float,
    solve: Callable[[Reached | None, Reached, float], Reached],
    describe: Callable[[Reached], str],
    easy: float = EASY_ITERATIONS,
    longest: float = np.inf,
) -> Reached:
    """Reach a target load or depth from an equilibrium in steps, which grow after easy steps and are halved on failure.

    Args:
        target: Load [N] or depth [m] to reach.
        start: Equilibrium to start from.
        control: Whether the target is a load or a depth.
        step: Length of the first step [N] or [m].
        solve: Function that solves at a load or depth.  Its arguments are the equilibrium before the last (None in the
            first step, and where a step with extrapolation from the last two equilibria failed), the last equilibrium,
            and the load or depth.
        describe: Function that describes an equilibrium as text, for error messages.
        easy: Number of Newton iterations below which the next step is longer [-].
        longest: Largest length of a step [N] or [m].

    Returns:
        The equilibrium at the target.

    Raises:
        PathConvergenceError: If a step fails even after repeated halving.
    """
    before, here, extrapolates, growth = None, start, True, _SETTINGS.growth
    while (done := getattr(here, control)) != target:
        aim = target if abs(target - done) <= _SETTINGS.last_step * step else done + np.sign(target - done) * step
        try:
            reached = solve(before if extrapolates else None, here, aim)
        except STEP_FAILURES as error:
            _LOG.info("step to %s %.4g failed: %s", control, aim, error)
            if extrapolates and before is not None:
                # The step is solved again, with the last equilibrium as the initial guess.
                extrapolates = False
                continue
            step, growth = abs(aim - done) / 2, _SETTINGS.careful_growth
            if step < abs(done or target) * _SETTINGS.smallest_step:
                raise PathConvergenceError(
                    f"no convergence beyond {describe(here)}: {error}",
                    cause=str(error),
                    load=here.load,
                    depth=here.depth,
                ) from error
            continue
        before, here, extrapolates = here, reached, True
        step = min(step * (growth if here.iterations - before.iterations < easy else 1.0), longest)
    return here


def is_balanced(
    elements: MixedElements, residual: FloatArray, constrained: IntArray, *, reference: float, tolerance: float
) -> bool:
    """Return whether the residual forces and volumes of a solid are below the tolerance.

    Args:
        elements: Elements of the solid.
        residual: Residual forces [N], then volume residuals [m3], shape (n,).
        constrained: Indices of the prescribed displacements, whose residual forces are reactions.
        reference: Force by which residual forces are divided [N].
        tolerance: Largest residual force over `reference`, and volume residual over the volume per pressure unknown
            [-].
    """
    split = elements.displacements
    forces = np.abs(np.delete(residual[:split], constrained)).max(initial=0.0)
    volumes = np.abs(residual[split:]).max()
    volume_per_unknown = float(elements.weight.sum()) / (len(residual) - split)
    return bool(forces < tolerance * reference and volumes < tolerance * volume_per_unknown)


def _measure_overshoot(slope_before: float, slope_after: float) -> float:
    """Compute the fraction of a Newton step to reverse so that the energy is stationary along the step (secant rule).

    Args:
        slope_before: Derivative of the potential energy along the step, at the beginning of the step [J].
        slope_after: The same derivative at the end of the step [J].

    Returns:
        Fraction of the step; 0 if the step has not passed the minimum of the energy by much [-].
    """
    if slope_before * slope_after >= 0 or abs(slope_after) < _SETTINGS.overshoot * abs(slope_before):
        return 0.0
    return float(np.clip(slope_after / (slope_after - slope_before), _SETTINGS.least_back, _SETTINGS.most_back))
