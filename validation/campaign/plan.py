"""Plan of a campaign: what each case costs, which cases a budget of time allows, and what they tell.

The costs are learned: the finished cases of a kind of problem correct the expected time of the others.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, singledispatch

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from meshes import Cover, SolidCover, TexelArray
from validation.campaign.campaign_file import Campaign
from validation.campaign.case import Case
from validation.campaign.reference_press import find_stored_reference
from validation.derivation.contact_range import DEEP, bear
from validation.errors import InputError
from validation.pooling import FEWEST
from validation.text.quantity import format_time, read_quantity


@dataclass(frozen=True, kw_only=True)
class Costs:
    """Expected times from which a plan starts, on a core for which `measure_pace` is 1; see benchmarks/campaign.py.

    The time of a solution is multiplied by the steps and the unknowns of its problem over those that are named here.
    """

    #: A solution at small strain on a wide cover, without and with friction [s].
    small: float = 1.5
    rubbing: float = 6.0
    #: What finite strain adds to a case, for its stages, and to the fit of the comparison models [s].
    stages: float = 1.0
    fit: float = 8.0
    #: What the sides of a cover of limited size add to a case [s].
    sides: float = 9.0
    #: The response of a cover of limited size, of 300 squared thicknesses [s].
    response: float = 9.0
    #: A body of revolution at finite strain, pressed to 30 % of the thickness [s].
    round: float = 2.5
    #: A block of one layer in three dimensions at finite strain, symmetric in both planes, as long and as wide as eight
    #: thicknesses, pressed to 30 % of the thickness [s].
    block: float = 32.0
    #: What the steps and meshes of any block add [s].
    blocks: float = 14.0
    #: A solution with friction at finite strain over one without.
    friction: float = 5.0
    #: What several layers add to the contact of a flat face, and to the fit, which presses two [s].
    layers: float = 25.0
    #: A case on a solid cover [s].
    solid: float = 7.0
    #: Everything besides a missing solution, for each case and on the whole, on layers [s].
    case: float = 1.0
    rest: float = 20.0
    #: Everything besides the cases on a solid cover, with and without texel responses in the store [s].
    stored_solid_rest: float = 35.0
    solid_rest: float = 80.0
    #: The comparison of two cases on a solid cover with a finer mesh [s].
    finer: float = 180.0


COSTS = Costs()
#: Edge of the cube of unknowns of `measure_pace`, its repetitions, the processor time of one with pace 1 [s], and the
#: ratio to powers of which a pace is rounded [-].
_CUBE, _REPEATED, _PACE, _ROUNDED = 22, 3, 0.1, 1.25
#: Share of the time of a press to `DEEP` that does not depend on the depth [-].
_FIRST_STEPS = 0.7
#: Elements that each further layer adds to a block, over those of one layer [-].
_LAYER = 0.5
#: Width of a mesh beyond the indenter, and width of that of `Costs.block`, over the thickness [-].
_AROUND, _SPAN = 4.0, 8.0
#: Number of radii at which the surface of a body of revolution is measured [-].
_RADII = 32
#: Distance of a contact from the sides over the decay length above which they are left out [-].
_FAR = 4.0
#: Area of the cover of `Costs.response` over the squared thickness [-].
_AREA = 300.0
#: Exponents with which the times of the response of a cover and of a block grow with the unknowns [-].
_GROWTH, _BLOCK_GROWTH = 1.2, 2.5
#: Number of cases that come before a single expensive one [-].
_FEW = 6
#: Share of a budget that is planned, because the expected times are right within a factor of 1.5 [-].
_PLANNED = 0.7
#: Budget of `--quick`: processor time [s].
QUICK_BUDGET = 300.0
#: Time that an evaluation names for what a larger budget would add [s].
_MORE = 600.0
#: Duration of a minute [s].
_MINUTE = 60.0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Missing solutions and expected times of the cases of a campaign.

    Attributes:
        missing: Whether the solution of each case is missing from the store; a shared solution counts once.
        seconds: Expected time of each case [s].
        kinds: Kind of problem of each case; those of one kind are expected to be equally faster or slower.
        depths: Expected depth of each case over the thickness; 0 where it is not known [-].
        shares: Index of the first case whose solution each case shares; its own index if there is none.
        rest: Expected time of everything besides the cases [s].
        spent: Processor times that finished cases took, by the index of the case [s].
    """

    missing: tuple[bool, ...]
    seconds: tuple[float, ...]
    kinds: tuple[str, ...] = ()
    depths: tuple[float, ...] = ()
    shares: tuple[int, ...] = ()
    rest: float = COSTS.rest
    spent: dict[int, float] = field(default_factory=dict)

    @property
    def total(self) -> float:
        """Expected time of the whole evaluation [s]."""
        return sum(self.seconds) + self.rest

    def describe(self, budget: Budget | None = None, spare: int = 0) -> str:
        """State in one line how many solutions are missing and how long the evaluation takes.

        Args:
            budget: Time that the evaluation may take.
            spare: Number of cases at the end that are computed in the time that the others leave.
        """
        cases = len(self.missing) - spare
        count = sum(self.missing[:cases])
        stored = f"all reference solutions of {cases} cases are in the store"
        what = f"{cases} cases, {count} reference solutions missing from the store" if count else stored
        seconds = self.total if budget is None else min(self.total, budget.seconds)
        return f"{what}{', and more while time is left' if spare else ''}; about {format_time(seconds)}"

    def expect(self, case: int) -> float:
        """Return the time of a case: the expected one, times what finished cases took over what was expected [s].

        Finished cases of the same kind are asked first, then all whose solution was missing.
        """
        same = [i for i in self.spent if self.kinds and self.kinds[i] == self.kinds[case]]
        same = same or [i for i in self.spent if self.missing[i]]
        expected = sum(self.seconds[i] for i in same)
        return self.seconds[case] * (sum(self.spent[i] for i in same) / expected if expected else 1.0)

    def describe_left(self, left: Sequence[int], name: str) -> str:
        """Return the name of the next case with the expected time of the cases with the indices `left`."""
        return f"{name}, about {format_time(sum(map(self.expect, left)))} left"


@cache
def measure_pace() -> float:
    """Measure the processor time of a small factorisation over that on the computer of `Costs` [-].

    The ratio is rounded to a power of 1.25, so that repeated runs choose the same cases.
    """
    line = sparse.diags_array([3.0, -1.0, -1.0], offsets=[0, -1, 1], shape=(_CUBE, _CUBE))
    cube = sparse.kronsum(sparse.kronsum(line, line), line).tocsc()
    times = []
    for _ in range(_REPEATED):
        started = time.process_time()
        splu(cube, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        times.append(time.process_time() - started)
    return float(_ROUNDED ** np.round(np.log(min(times) / _PACE) / np.log(_ROUNDED)))


def plan_cases(cover: Cover | SolidCover, array: TexelArray, cases: Sequence[Case], *, friction: float = 0.0) -> Plan:
    """Determine which reference solutions are missing from the store, and the expected time of the cases.

    Args:
        cover: The cover.
        array: The array.
        cases: The indentations.
        friction: Coulomb friction coefficient between indenter and cover, inf for no slip [-].
    """
    missing, seconds, kinds, depths, shares, rest = [], [], [], [], [], COSTS.rest + _measure_sides(cover)
    pace = measure_pace()
    if isinstance(cover, Cover) and not cover.small_strain_only:
        rest += COSTS.fit + 2 * COSTS.layers * (len(cover.layers) > 1)
    for number, case in enumerate(cases):
        estimate = estimate_cost(cover, case, friction)
        absent = find_stored_reference(cover, array, case, friction=friction) is None
        if isinstance(cover, SolidCover):
            rest = max(rest, COSTS.solid_rest if absent else COSTS.stored_solid_rest)
        shares.append(
            next((i for i, other in enumerate(cases[:number]) if _share_solution(cover, case, other)), number)
        )
        absent = absent and shares[-1] == number
        missing.append(absent)
        kinds.append(estimate.kind if absent else "stored")
        seconds.append(pace * (COSTS.case + (estimate.seconds if absent else 0.0)))
        depths.append(estimate.depth)
    return Plan(
        missing=tuple(missing), seconds=tuple(seconds), kinds=tuple(kinds), depths=tuple(depths),
        shares=tuple(shares), rest=pace * rest,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Kind of problem of a case, expected time of its solution [s], and expected depth over thickness [-]."""

    kind: str
    seconds: float
    depth: float = 0.0


@singledispatch
def estimate_cost(cover: object, case: Case, friction: float) -> Estimate:
    """Estimate the reference of a case: kind of problem, time and depth.

    Args:
        cover: The cover.  The kind is that of solid covers, unless another function is registered for the cover.
        case: The indentation.
        friction: Coulomb friction coefficient between indenter and cover [-].
    """
    del cover, case, friction
    return Estimate(kind="solid cover", seconds=COSTS.solid)


@estimate_cost.register
def _(cover: Cover, case: Case, friction: float) -> Estimate:
    from fem_reference.linear_response.surface_compliance import decay_length

    indenter, thickness, further = case.turned.indenter, cover.thickness, len(cover.layers) - 1
    depth = DEEP * (case.load / bear(cover, indenter)) ** (1 if indenter.is_flat else 2 / 3)
    near = cover.size is not None
    if cover.size is not None and not (indenter.is_flat or cover.small_strain_only):
        # The contact of a round body stays within the radius at which its surface is as high as its depth.
        half = np.linspace(0, max(indenter.footprint), _RADII)
        reached = half[indenter.gap(half, 0 * half) <= depth * thickness].max()
        room = min(edge / 2 - abs(at) for edge, at in zip(cover.size, case.pose.at, strict=True))
        near = bool(room - reached < _FAR * decay_length(replace(cover, size=None)))
    alone = COSTS.sides * near + COSTS.layers * (further > 0 and indenter.is_flat)
    if cover.small_strain_only:
        seconds = alone + (COSTS.rubbing if friction else COSTS.small)
        return Estimate(kind="small strain", seconds=seconds, depth=depth)
    factor = (COSTS.friction if friction else 1.0) * (_FIRST_STEPS + (1 - _FIRST_STEPS) * depth / DEEP)
    if indenter.axisymmetric:
        kind, steps = "round" + " near sides" * near, COSTS.round
    else:
        unknowns = float(np.prod([2 * half / thickness + _AROUND for half in indenter.footprint])) / _SPAN**2
        kind, steps = "block", COSTS.block * (unknowns * (1 + _LAYER * further)) ** _BLOCK_GROWTH + COSTS.blocks
    return Estimate(kind=kind, seconds=alone + COSTS.stages + factor * steps, depth=depth)


def _measure_sides(cover: Cover | SolidCover) -> float:
    """Return the expected time of the response of a cover of limited size [s]."""
    if cover.size is None:
        return 0.0
    return float(COSTS.response * (np.prod(cover.size) / cover.thickness**2 / _AREA) ** _GROWTH)


def _share_solution(cover: Cover | SolidCover, case: Case, other: Case) -> bool:
    """Whether the references of two cases share their solution: same body and load at two poses on a wide cover."""
    return (
        cover.size is None
        and not (case.others or other.others)
        and (case.load, case.path, case.pose.tilt) == (other.load, other.path, other.pose.tilt)
        and case.has_shape_of(other)
    )


@dataclass(frozen=True, kw_only=True)
class Budget:
    """Processor time that an evaluation may take, on one core without other work the time that a user waits.

    Attributes:
        seconds: The time [s].
        quick: Whether it is that of `--quick`.
        started: Processor time of this process at which the budget begins [s].
    """

    seconds: float
    quick: bool = False
    started: float = field(default_factory=time.process_time)

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.seconds - (time.process_time() - self.started)

    def shorten(self, campaign: Campaign, plan: Plan) -> Campaign:
        """Shorten a campaign to the cases that tell most within the budget; the next ones become spare.

        Marked cases come first, then those with most that no chosen case has: kind of body, flat or curved face, place,
        load, rotation, and the largest depth.

        Raises:
            InputError: If the budget is below the cheapest case.
        """
        least = plan.rest + min(plan.seconds[i] for i in plan.shares)
        if self.seconds < least:
            example = math.ceil(2 * (plan.rest + sum(sorted(plan.seconds)[:FEWEST])) / _MINUTE)
            option = "--quick" if self.quick else "--budget"
            raise InputError(
                f"{option}: {format_time(self.seconds)} is less than one case, "
                f"which takes about {format_time(least)} "
                f"with all preparations; write for example --budget {example}min"
            )
        traits = [_list_traits(case) for case in campaign.cases]
        if any(plan.depths):
            traits[int(np.argmax(plan.depths))].add("deepest")
        alone = [measure_pace() * COSTS.case] * len(traits)
        chosen: list[int] = []
        spent, within, stop = plan.rest, max(_PLANNED * self.seconds, least), -1
        while True:
            paid, seen = {plan.shares[i] for i in chosen}, {each for i in chosen for each in traits[i]}
            cost = [each if i in paid else plan.seconds[i] for i, each in zip(plan.shares, alone, strict=True)]
            left = sorted((i for i in range(len(cost)) if i not in chosen), key=cost.__getitem__)
            room = sum(spent + np.cumsum([cost[i] for i in left]) <= within)
            if room:
                # An expensive case is not chosen instead of several others, as long as there are few.
                others = left[: min(room, max(_FEW - len(chosen), 1))]
                fits = [i for i in left if spent + cost[i] + sum(cost[j] for j in others[:-1] if j != i) <= within]
                new = [len(each - seen) for each in traits]
                marked = [case.name in campaign.quick for case in campaign.cases]
                chosen.append(max(fits, key=lambda i: (marked[i], new[i], -cost[i])))
                spent += cost[chosen[-1]]
            elif stop < 0:
                stop, within = len(chosen), max(self.seconds, spent) + _MORE
            else:
                break
        cases, kept = campaign.cases, sorted(chosen[:stop])
        return replace(
            campaign, name=f"{campaign.name}, quick" if self.quick else campaign.name,
            cases=tuple(cases[i] for i in kept),
            spare=tuple(cases[i] for i in chosen[stop:]),
        )  # fmt: skip


def read_budget(text: str | None, *, quick: bool = False) -> Budget | None:
    """Read the option --budget, a time such as `20min`; `--quick` is a budget too; None without either.

    Raises:
        InputError: If both are given, or the text is not a positive time.
    """
    if text is None:
        return Budget(seconds=QUICK_BUDGET, quick=True) if quick else None
    if quick:
        raise InputError(f"--budget: --quick is the budget {format_time(QUICK_BUDGET)}; give one of the two")
    seconds = read_quantity(text, "time", place="--budget", example="20min")
    if not seconds > 0:
        raise InputError(f"--budget: {text!r} is not a positive time; write for example --budget 20min")
    return Budget(seconds=seconds)


def check_budget(budget: Budget | None) -> None:
    """Raise `OutOfBudgetError` if no time is left; solvers call this with their progress."""
    if budget is not None and budget.left < 0:
        raise OutOfBudgetError


class OutOfBudgetError(Exception):
    """A solver was stopped, because the time that the user allows is over."""


def _list_traits(case: Case) -> set[object]:
    """List what a case has that others may not have: kind of body, face, place, load and rotation."""
    place = tuple(round(1e4 * each) for each in case.pose.point)
    return {
        type(case.indenter).__name__, ("flat", case.indenter.is_flat), ("place", place), ("load", f"{case.load:.1g}"),
        ("turned", case.pose.yaw, case.pose.tilt, tuple(round(each, 2) for each in case.pose.direction)),
    }  # fmt: skip
