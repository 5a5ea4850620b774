"""Run of a campaign: indentations (cases) are computed by finite elements and by the fast model, which is scored.

A case that a model cannot compute is named and left out.  An interrupted run keeps the finished cases.  The missing
solutions in the store of results, and their approximate computing time, are known before the run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover, SolidCover, TexelArray
from validation.campaign.case import Case
from validation.campaign.reference_press import find_stored_reference
from validation.campaign.results import (
    MODELS,
    SKILL_METRICS,
    CampaignResult,
    CaseResult,
    Pooled,
    Prediction,
    RowScores,
    SkippedCase,
    pool,
    skill,
)
from validation.errors import InputError
from validation.metrics import TABULATED

if TYPE_CHECKING:
    from validation.campaign.bench import Bench
    from validation.published.models import ComparisonModels

Progress = Callable[[int, int, str], None]


def run_campaign(
    bench: Bench, cases: Sequence[Case], *, plan: Plan | None = None, progress: Progress | None = None
) -> CampaignResult:
    """Compute every case by finite elements and by all models of a bench, and score the models.

    Args:
        bench: Sensor with its models, already fitted; the campaign changes no model.
        cases: The indentations.
        plan: Solutions that are missing from the store; determined anew if None.
        progress: Called before each case with (number of cases done, number of all cases, name of the next case and
            time left).

    Returns:
        The results; those of the finished cases if the run is interrupted after at least one case.

    Raises:
        InputError: If no case can be computed by all models.
        ValueError: If a published model was fitted to one of the cases.
        KeyboardInterrupt: If the run is interrupted before the first case is finished.
    """
    from fem_reference import ConvergenceError

    if bench.comparison is not None:
        bench.comparison.check_unseen(cases)
    plan = plan or plan_cases(bench.cover, bench.parameters.array, cases, friction=bench.friction)
    started = time.perf_counter()
    tell = progress or (lambda *_: None)
    results: list[CaseResult] = []
    skipped: list[SkippedCase] = []
    number, interrupted = 0, False
    try:
        for number, case in enumerate(cases):
            tell(number, len(cases), plan.describe_left(number, time.perf_counter() - started, case.name))
            try:
                results.append(bench.solve(case))
            except (ValueError, ConvergenceError) as error:
                converged = not isinstance(error, ConvergenceError)
                skipped.append(SkippedCase.of(case, str(error), converged=converged))
    except KeyboardInterrupt:
        if not results:
            raise
        interrupted = True
        skipped += [SkippedCase.of(case, "interrupted") for case in cases[number:]]
    tell(len(cases), len(cases), "")
    if not results:
        raise InputError(*(f"{each.name} ({each.indenter}): {each.reason}" for each in skipped))
    return summarise(results, skipped, bench.comparison, interrupted=interrupted, models=bench.models)


def summarise(
    results: Sequence[CaseResult],
    skipped: Sequence[SkippedCase],
    comparison: ComparisonModels | None,
    *,
    interrupted: bool = False,
    models: Mapping[str, str] = MODELS,
) -> CampaignResult:
    """Average the scores over the cases of a campaign.

    Args:
        results: The scored cases.
        skipped: The cases without scores.
        comparison: The published models that were scored; None for none.
        interrupted: Whether the run was interrupted.
        models: Names and descriptions of the scored models; one is `fast`.
    """
    cases = [result.case for result in results]

    def collect(predictions: Sequence[Prediction], metric: str) -> list[float]:
        """Collect a metric over the cases that compare it; NaN in other cases."""
        return [
            float(getattr(each.score, metric)) if case.compares(metric) else np.nan
            for case, each in zip(cases, predictions, strict=True)
        ]

    def pool_scores(predictions: Sequence[Prediction]) -> dict[str, Pooled]:
        return {metric: pool(collect(predictions, metric)) for metric in TABULATED}

    def measure_skill(predictions: Sequence[Prediction], metric: str = "misplaced_force") -> Pooled:
        return skill(collect(scored["fast"], metric), collect(predictions, metric))

    scored = {model: [result.predictions[model] for result in results] for model in models}
    errors = [result.reference.error_estimate for result in results]
    published = []
    for row in comparison.rows if comparison else ():
        predictions = [result.published[row.name] for result in results]
        skills = {metric: measure_skill(predictions, metric) for metric in SKILL_METRICS}
        published.append(RowScores(**row.as_json(), pooled=pool_scores(predictions), skill=skills))
    return CampaignResult(
        cases=tuple(results),
        skipped=tuple(skipped),
        pooled={model: pool_scores(predictions) for model, predictions in scored.items()},
        skill={model: measure_skill(predictions) for model, predictions in scored.items() if model != "fast"},
        noise_floor={key: float(np.mean([each[key] for each in errors])) for key in errors[0]},
        published=tuple(published),
        interrupted=interrupted,
        models=models,
    )


_SOLID = "solid cover"
#: Time of one finite-element solution that is not in the store, by the kind of problem, on one core of a computer of
#: 2020 [s].  `foil` is for covers with a layer that is much stiffer than another one, and `solid` for indenters that
#: are not bodies of revolution, such as boxes.
_SECONDS = {
    "small strain": 2.0,
    "finite strain, round": 10.0,
    "finite strain, solid": 25.0,
    "finite strain, solid on foil": 300.0,
    "friction, round": 20.0,
    "friction, solid": 200.0,
    _SOLID: 8.0,
}
#: Ratio of the moduli of two layers above which a cover counts as one with a foil [-].
_FOIL = 100.0
#: Time of one case besides the missing solution, for fast model, published models and scores [s].
_PER_CASE = 0.7
#: Time of everything besides the cases, on a cover of planar layers: fits, verification, uncertainty, and report [s].
_REST = 15.0
#: Time of everything besides the cases, on a solid cover whose texel responses are not in the store [s].
_SOLID_REST = 150.0
#: Time of everything besides the cases, on a solid cover whose texel responses are in the store [s].
_STORED_SOLID_REST = 60.0
#: Duration of a minute [s].
_MINUTE = 60.0
#: Time from which minutes are printed instead of seconds [s].
_LONG = 100.0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Missing solutions and computing times of a campaign.

    Attributes:
        missing: Whether the solution of each case is missing from the store; a shared solution counts once.
        seconds: Expected time of each case [s].
        rest: Expected time of everything besides the cases [s].
    """

    missing: tuple[bool, ...]
    seconds: tuple[float, ...]
    rest: float = _REST

    @property
    def total(self) -> float:
        """Expected time of the whole evaluation [s]."""
        return sum(self.seconds) + self.rest

    def describe(self) -> str:
        """State in one line how many solutions are missing and how long the evaluation takes."""
        count, cases = sum(self.missing), len(self.missing)
        what = f"{cases} cases, {count} reference solutions missing from the store"
        if not count:
            what = f"all reference solutions of {cases} cases are in the store"
        return f"{what}; about {format_time(self.total)}"

    def describe_left(self, done: int, elapsed: float, name: str) -> str:
        """Return the name of the next case with the remaining time, estimated from the finished cases.

        Args:
            done: Number of finished cases [-].
            elapsed: Time of the finished cases [s].
            name: Name of the next case.
        """
        expected = sum(self.seconds[:done])
        # The finished cases show the speed of this computer; before the first one only the plan is known.
        factor = elapsed / expected if expected else 1.0
        return f"{name}, about {format_time(factor * sum(self.seconds[done:]))} left"


def plan_cases(cover: Cover | SolidCover, array: TexelArray, cases: Sequence[Case], *, friction: float = 0.0) -> Plan:
    """Determine which reference solutions are missing from the store, and the computing time of the cases.

    Args:
        cover: The cover.
        array: The array.
        cases: The indentations.
        friction: Coulomb friction coefficient between indenter and cover, inf for no slip [-].
    """
    seen: list[Case] = []
    missing, seconds, rest = [], [], _REST
    for case in cases:
        kind = classify(cover, case, friction)
        absent = find_stored_reference(cover, array, case, friction=friction) is None
        if kind != _SOLID:
            absent = absent and not any(_share_solution(cover, case, other) for other in seen)
        else:
            rest = max(rest, _SOLID_REST if absent else _STORED_SOLID_REST)
        seen.append(case)
        missing.append(absent)
        seconds.append(_PER_CASE + (_SECONDS[kind] if absent else 0.0))
    return Plan(missing=tuple(missing), seconds=tuple(seconds), rest=rest)


@singledispatch
def classify(cover: object, case: Case, friction: float) -> str:
    """Return the kind of problem that the reference of a case is, a key of the table of times.

    Args:
        cover: The cover.  The kind is that of solid covers, unless another function is registered for the cover.
        case: The indentation.
        friction: Coulomb friction coefficient between indenter and cover [-].
    """
    del cover, case, friction
    return _SOLID


@classify.register
def _(cover: Cover, case: Case, friction: float) -> str:
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


def _share_solution(cover: Cover | SolidCover, case: Case, other: Case) -> bool:
    """Whether the references of two cases share their solution: same body and load at two poses on a wide cover."""
    return (
        cover.size is None
        and (case.load, case.path, case.pose.tilt) == (other.load, other.path, other.pose.tilt)
        and case.has_shape_of(other)
    )
