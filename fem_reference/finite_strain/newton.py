"""Newton's method for a deforming solid, and stepping along a loading path with it.

A problem provides its equations as a function that linearises them at given unknowns (`Linearisation`).  `solve_newton`
iterates to equilibrium.  `walk_to` follows a path of loads or depths in steps, each solved by Newton's method; a step
that does not converge is halved.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.hyperelastic import InvertedElementError
from fem_reference.finite_strain.loading_path import Control
from meshes.array_types import FloatArray, IntArray

_LOG = logging.getLogger(__name__)

#: Errors of a step that was too long.
STEP_FAILURES = (ConvergenceError, np.linalg.LinAlgError)
#: Number of times that Newton's method halves a step that inverts an element, in one solve.
_HALVINGS = 4
#: Slope of the potential at the end of a step over that at its beginning, above which the step is taken back in part:
#: the step has passed a minimum and ends uphill [-].
_OVERSHOOT = 0.3
#: Least and largest part of a step that is taken back [-].
_LEAST_BACK, _MOST_BACK = 0.1, 0.9
#: A path stops if its step is shorter than this fraction of the target [-].
_SMALLEST_STEP = 1 / 256
#: The last step to a target may be longer than the planned one by this factor, so that no tiny step remains [-].
_LAST_STEP = 1.3
#: Factor on the step length after a step that took fewer than this many iterations.
_GROWTH, EASY_ITERATIONS = 1.8, 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Equilibrium:
    """A converged state of a solid.

    Attributes:
        state: Displacements [m], then mean pressures [Pa], shape (n,).
        depth: Approach of the rigid body [m].
        load: Force on the rigid body [N].
        reaction: Internal force at every unknown, shape (n,) [N]; at constrained unknowns this is the reaction.
        iterations: Newton iterations since the start of the path.
    """

    state: FloatArray
    depth: float
    load: float
    reaction: FloatArray
    iterations: int


Reached = TypeVar("Reached", bound=Equilibrium)


class PathConvergenceError(ConvergenceError):
    """A loading path stopped before its target.

    Attributes:
        reached: The last converged state; None if there is none.
    """

    def __init__(self, message: str, reached: Equilibrium | None) -> None:
        super().__init__(message)
        self.reached = reached


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearisation(Generic[Reached]):
    """The equations of a problem, linearised at given unknowns.

    Attributes:
        equilibrium: The converged state; None if the equations are not satisfied within the tolerance.
        solve: Returns Newton's step, shape (n,).
        gradient: Gradient of the potential energy, shape (n,); None where steps need not be checked for overshoot.
        changed: Whether the equations differ from those of the previous iteration, so that the slopes at the beginning
            and at the end of the last step cannot be compared.
    """

    equilibrium: Reached | None
    solve: Callable[[], FloatArray]
    gradient: FloatArray | None = None
    changed: bool = False

    def measure_slope(self, step: FloatArray) -> float:
        """Return the derivative of the potential energy along a step [J], 0 without a gradient."""
        return 0.0 if self.gradient is None else float(self.gradient @ step)


def solve_newton(
    linearise: Callable[[FloatArray, int], Linearisation[Reached]], start: FloatArray, *, iterations: int
) -> Reached:
    """Solve nonlinear equations by Newton's method.

    Args:
        linearise: Linearises the equations, given unknowns of shape (n,) and the number of the iteration.
        start: Unknowns to start from, shape (n,).
        iterations: Largest number of iterations.

    Raises:
        ConvergenceError: If the iterations do not suffice.
        InvertedElementError: If an element stays inverted although steps are halved.
    """
    unknowns, step, slope, halvings = start, None, 0.0, 0
    for iteration in range(iterations):
        # A step that inverts an element is halved.
        try:
            here = linearise(unknowns, iteration)
        except InvertedElementError:
            if step is None or halvings == _HALVINGS:
                raise
            step, halvings = step / 2, halvings + 1
            unknowns = unknowns - step
            continue
        if here.equilibrium is not None:
            return here.equilibrium
        # A step that passes the minimum of the potential along it is taken back in part.  Otherwise points that stick
        # in one iteration and slide in the next can make the iteration cycle.
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
    """Step from an equilibrium to a target load or depth; steps grow when they are easy and are halved when they fail.

    Args:
        target: Load [N] or depth [m] to reach.
        start: Equilibrium to start from.
        control: Whether the target is a load or a depth.
        step: Length of the first step [N] or [m].
        solve: Solves at a load or depth, given the last but one equilibrium of this walk (None if there is none), the
            last one, and the load or depth.
        describe: Returns a text for an equilibrium, for error messages.
        easy: Steps that took fewer iterations than this are followed by longer ones.
        longest: Largest step [N] or [m].

    Raises:
        PathConvergenceError: If a step fails even after repeated halving.
    """
    before, here = None, start
    while (done := getattr(here, control)) != target:
        aim = target if abs(target - done) <= _LAST_STEP * step else done + np.sign(target - done) * step
        try:
            before, here = here, solve(before, here, aim)
        except STEP_FAILURES as error:
            step, before = abs(aim - done) / 2, None
            _LOG.info("step to %s %.4g halved: %s", control, aim, error)
            if step < abs(target) * _SMALLEST_STEP:
                raise PathConvergenceError(f"no convergence beyond {describe(here)}: {error}", here) from error
            continue
        step = min(step * (_GROWTH if here.iterations - before.iterations < easy else 1.0), longest)
    return here


def is_balanced(
    elements: MixedElements, residual: FloatArray, constrained: IntArray, *, reference: float, tolerance: float
) -> bool:
    """Return whether forces and volumes are in balance.

    Args:
        elements: Elements of the solid.
        residual: Unbalanced forces [N], then volume residuals [m3], shape (n,).
        constrained: Displacements that are prescribed.
        reference: Force that residual forces are compared with [N].
        tolerance: Largest residual relative to the reference, and to the volume per pressure unknown [-].
    """
    split = elements.displacements
    forces = np.abs(np.delete(residual[:split], constrained)).max(initial=0.0)
    volumes = np.abs(residual[split:]).max()
    volume_per_unknown = float(elements.weight.sum()) / (len(residual) - split)
    return bool(forces < tolerance * reference and volumes < tolerance * volume_per_unknown)


def _measure_overshoot(slope_before: float, slope_after: float) -> float:
    """Return the part of a step to take back so that the slope along it vanishes (secant rule), or 0.

    Args:
        slope_before: Slope of the potential at the beginning of the step [J].
        slope_after: Slope at its end [J].
    """
    if slope_before * slope_after >= 0 or abs(slope_after) < _OVERSHOOT * abs(slope_before):
        return 0.0
    return float(np.clip(slope_after / (slope_after - slope_before), _LEAST_BACK, _MOST_BACK))
