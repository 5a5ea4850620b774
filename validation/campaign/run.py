"""Run of a campaign: indentations (cases) are computed by finite elements and by the fast model, which is scored.

A case that a model cannot compute is named and left out.  An interrupted run keeps the cases that are finished.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from validation.campaign.bench import Clock, Plan
from validation.campaign.case import Case
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


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Cases of a run.

    Attributes:
        results: The scored cases.
        skipped: The cases without scores.
        interrupted: Whether the run was interrupted.
    """

    results: Sequence[CaseResult]
    skipped: Sequence[SkippedCase]
    interrupted: bool


def run_campaign(
    bench: Bench, cases: Sequence[Case], *, plan: Plan | None = None, progress: Progress | None = None
) -> CampaignResult:
    """Compute every case by finite elements and by all models of a bench, and score the models.

    Args:
        bench: The sensor with its models, already fitted; the campaign changes none of them.
        cases: The indentations.
        plan: Which solutions are missing from the store; found out anew if None.
        progress: Called before each case with (number of cases done, number of all cases, name of the next case and
            time left).

    Returns:
        The results; those of the finished cases if the run is interrupted after at least one case.

    Raises:
        InputError: If no case can be computed by all models.
        ValueError: If a published model was fitted to one of the cases.
        KeyboardInterrupt: If the run is interrupted before the first case is finished.
    """
    if bench.comparison is not None:
        bench.comparison.check_unseen(cases)
    run = run_cases(cases, bench.solve, Clock(plan or bench.plan(cases)), progress)
    return summarise(run.results, run.skipped, bench.comparison, interrupted=run.interrupted, models=bench.models)


def run_cases(
    cases: Sequence[Case], solve: Callable[[Case], CaseResult], clock: Clock, progress: Progress | None = None
) -> Run:
    """Compute cases one after the other; name those that fail, and keep what is finished if the run is interrupted.

    Args:
        cases: The indentations.
        solve: Function that computes and scores one case.
        clock: Estimates the time left.
        progress: As for `run_campaign`.

    Raises:
        InputError: If no case can be computed.
        KeyboardInterrupt: If the run is interrupted before the first case is finished.
    """
    from fem_reference import ConvergenceError

    results: list[CaseResult] = []
    skipped: list[SkippedCase] = []
    number, interrupted = 0, False
    try:
        for number, case in enumerate(cases):
            if progress:
                progress(number, len(cases), clock.describe(number, case.name))
            try:
                results.append(solve(case))
            except (ValueError, ConvergenceError) as error:
                converged = not isinstance(error, ConvergenceError)
                skipped.append(SkippedCase.of(case, str(error), converged=converged))
    except KeyboardInterrupt:
        if not results:
            raise
        interrupted = True
        skipped += [SkippedCase.of(case, "interrupted") for case in cases[number:]]
    if progress:
        progress(len(cases), len(cases), "")
    if not results:
        raise InputError(*(f"{each.name} ({each.indenter}): {each.reason}" for each in skipped))
    return Run(results=results, skipped=skipped, interrupted=interrupted)


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
        """Collect a metric over the cases that compare it; NaN in the others."""
        return [
            float(getattr(each.score, metric)) if not case.compared or metric in case.compared else np.nan
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
