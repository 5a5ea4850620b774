"""Cost of a campaign: which finite-element solutions are missing from the result store, and how long they take."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence

from meshes import Cover, TexelArray
from validation.campaign.case import Case
from validation.campaign.reference_press import find_stored_reference

#: Time of one missing solution by the kind of problem, on one core of a computer of 2020 [s].  `foil` are covers with a
#: layer that is much stiffer than another one; `solid` are faces and other bodies that are not round.
_SECONDS = {
    "small strain": 2.0,
    "finite strain, round": 10.0,
    "finite strain, solid": 25.0,
    "finite strain, solid on foil": 300.0,
    "friction, round": 20.0,
    "friction, solid": 200.0,
}
#: Ratio of the moduli of two layers above which a cover counts as one with a foil [-].
_FOIL = 100.0
#: Time of one case besides the missing solution: fast model, published models, scores [s].
_PER_CASE = 0.7
#: Time of everything besides the cases: fits, verification, uncertainty, the page [s].
_REST = 15.0
#: Seconds per minute, and number of seconds from which minutes are printed.
_MINUTE, _LONG = 60.0, 100.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """What a campaign has to compute.

    Attributes:
        cases: Number of cases [-].
        missing: Whether the solution of each case is missing from the store; cases that share one count once.
        seconds: Expected time of each case [s].
        rest: Expected time of everything besides the cases [s].
    """

    cases: int
    missing: tuple[bool, ...]
    seconds: tuple[float, ...]
    rest: float = _REST

    @property
    def total(self) -> float:
        """Expected time of the whole evaluation [s]."""
        return sum(self.seconds) + self.rest

    def describe(self) -> str:
        """Say in one line how many solutions are missing and about how long the evaluation takes."""
        count = sum(self.missing)
        what = (
            f"all reference solutions of {self.cases} cases are in the store"
            if not count
            else f"{self.cases} cases, {count} reference solutions missing from the store"
        )
        return f"{what}; about {format_time(self.total)}"


class Clock:
    """Time left of a campaign, from the plan and from the time that the finished cases took."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._started = time.perf_counter()

    def describe(self, done: int, name: str) -> str:
        """Return the name of the next case with the time left.

        Args:
            done: Number of finished cases [-].
            name: Name of the next case.
        """
        expected = sum(self._plan.seconds[:done])
        elapsed = time.perf_counter() - self._started
        # The finished cases tell how fast this computer is; before the first the plan is all there is.
        factor = elapsed / expected if expected else 1.0
        return f"{name}, about {format_time(factor * sum(self._plan.seconds[done:]))} left"


def plan_solves(cover: Cover, array: TexelArray, cases: Sequence[Case], *, friction: float = 0.0) -> Plan:
    """Find out which reference solutions are missing from the store, and how long the cases take.

    Args:
        cover: The cover.
        array: The array.
        cases: The indentations.
        friction: Coulomb friction coefficient between indenter and cover, inf for no slip [-].
    """
    seen: list[Case] = []
    missing, seconds = [], []
    for case in cases:
        absent = find_stored_reference(cover, array, case, friction=friction) is None
        shared = any(_share_solution(cover, case, other) for other in seen)
        seen.append(case)
        missing.append(absent and not shared)
        seconds.append(_PER_CASE + (_SECONDS[classify(cover, case, friction)] if missing[-1] else 0.0))
    return Plan(cases=len(cases), missing=tuple(missing), seconds=tuple(seconds))


def classify(cover: Cover, case: Case, friction: float) -> str:
    """Return the kind of problem that the reference of a case is, a key of the table of times."""
    form = "round" if case.indenter.axisymmetric and not any(case.pose.tilt) else "solid"
    if friction:
        return f"friction, {form}"
    if cover.small_strain_only:
        return "small strain"
    moduli = [layer.material.youngs_modulus for layer in cover.layers]
    foil = " on foil" if form == "solid" and max(moduli) > _FOIL * min(moduli) else ""
    return f"finite strain, {form}{foil}"


def format_time(seconds: float) -> str:
    """Return a time in whole seconds below 100 s, else in whole minutes."""
    return f"{max(seconds, 1):.0f} s" if seconds < _LONG else f"{seconds / _MINUTE:.0f} min"


def _share_solution(cover: Cover, case: Case, other: Case) -> bool:
    """Whether the references of two cases share their solution: the same body and load at two poses of a wide cover."""
    return (
        cover.size is None
        and (case.load, case.path, case.pose.tilt) == (other.load, other.path, other.pose.tilt)
        and case.has_shape_of(other)
    )
