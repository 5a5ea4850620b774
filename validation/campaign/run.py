"""Run of a campaign: indentations (cases) are computed by finite elements and by the fast model, which is scored.

A case that a model cannot compute is named and left out.  An interrupted run keeps the finished cases.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from validation.campaign.case import Case
from validation.campaign.plan import Budget, OutOfBudgetError, Plan, check_budget, plan_cases
from validation.campaign.results import (
    MODELS,
    OUT_OF_BUDGET,
    SKILL_METRICS,
    CampaignResult,
    CaseResult,
    Prediction,
    RowScores,
    SkippedCase,
)
from validation.errors import InputError
from validation.metrics import TABULATED
from validation.pooling import Pooled, pool, skill

if TYPE_CHECKING:
    from validation.campaign.bench import Bench
    from validation.published.models import ComparisonModels

Progress = Callable[[int, int, str], None]


def run_campaign(
    bench: Bench,
    cases: Sequence[Case],
    *,
    plan: Plan | None = None,
    budget: Budget | None = None,
    spare: int = 0,
    progress: Progress | None = None,
) -> CampaignResult:
    """Compute every case by finite elements and by all models of a bench, and score the models.

    With a budget the cases that are expected to take least come first, so that a case that takes longer than expected
    costs no other one.  A case that shares its solution follows the one that pays for it.  Spare cases come last, each
    if its expected time is left.

    Args:
        bench: Sensor with its models, already fitted; the campaign changes no model.
        cases: The indentations.
        plan: Solutions that are missing from the store; determined anew if None.
        budget: Time that the cases may take; None for no limit.
        spare: Number of cases at the end that are spare; those for which no time is left are not listed as skipped.
        progress: Called before each case and each step of its solution with (number of cases done, number of all cases,
            name of the case and time left).

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
    tell = progress or (lambda *_: None)
    results: dict[int, CaseResult] = {}
    skipped: dict[int, SkippedCase] = {}
    left, interrupted = list(range(len(cases) - spare)), False
    try:
        for number in _order_cases(plan, len(cases) - spare, budget):
            case, started = cases[number], time.process_time()
            shown = plan.describe_left(left or [number], case.name)

            def report(line: str, shown: str = shown, done: int = len(cases) - spare - len(left)) -> None:
                check_budget(budget)
                tell(done, len(cases) - spare, f"{shown}{line and ': '}{line}")

            try:
                report("")
                results[number] = bench.solve(case, report)
            except OutOfBudgetError:
                if number in left:
                    skipped[number] = SkippedCase.of(case, OUT_OF_BUDGET)
            except (ValueError, ConvergenceError) as error:
                converged = not isinstance(error, ConvergenceError)
                skipped[number] = SkippedCase.of(case, str(error), converged=converged)
            left = [each for each in left if each != number]
            plan.spent[number] = time.process_time() - started
    except KeyboardInterrupt:
        if not results:
            raise
        interrupted = True
        skipped |= {number: SkippedCase.of(cases[number], "interrupted") for number in left}
    tell(len(cases) - spare, len(cases) - spare, "")
    in_order = [skipped[number] for number in sorted(skipped)]
    if not results:
        raise InputError(*(f"{each.name} ({each.indenter}): {each.reason}" for each in in_order))
    return summarise(
        [results[number] for number in sorted(results)], in_order, bench.comparison, interrupted=interrupted,
        models=bench.models,
    )  # fmt: skip


def _order_cases(plan: Plan, planned: int, budget: Budget | None) -> Iterator[int]:
    """Yield the indices of the planned cases, those of least expected time first, then of spare ones that still fit."""
    owners = plan.shares or range(planned)
    yield from sorted(range(planned), key=lambda i: (plan.seconds[owners[i]] if budget else 0, i))
    for number in range(planned, len(plan.seconds)):
        if budget is not None and budget.left >= plan.expect(number):
            yield number


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
