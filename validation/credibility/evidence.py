"""Evidence on the credibility of the scores: verification, uncertainty, stages, and limits of the validated range."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from pydantic import Field

from validation.campaign.campaign_file import Campaign
from validation.campaign.results import OUT_OF_BUDGET, CampaignResult, CaseResult
from validation.credibility.stages import StageErrors
from validation.credibility.uncertainty import ComparisonError, InputUncertainty, compare_quantities
from validation.credibility.verification import Check, Convergence, verify_solutions
from validation.pooling import Pooled, pool
from validation.results import Number, Result, renamed, result_model

if TYPE_CHECKING:
    from validation.campaign.bench import Bench
    from validation.campaign.plan import Budget

T = TypeVar("T")
#: Function that receives a line of text on the progress of the evidence.
Progress = Callable[[str], None]
#: Metrics that are pooled over groups of cases, such as light and heavy loads.
GROUP_METRICS = ("misplaced_force", "image_changed_percent", "centre_of_pressure_m")


@result_model
class Evidence(Result):
    """Evidence on the credibility of the scores of a campaign.

    Attributes:
        checks: Code verification.
        convergence: Solution verification.
        inputs: Effects of the uncertain inputs, by name of the case.
        errors: Comparison errors with their uncertainties.
        stages: Errors by stage; None if the fast model has no cover data.
        groups: Pooled errors of the fast model by group (load, shape, pose), member and metric.
        domain: Smallest and largest value of each quantity of the cases, by name, in SI units.
        failed: Reasons for missing parts, one line each.
        left_out: Sections that have no meaning for this kind of cover, one sentence each.
        notes: Information for readers about this kind of cover, by section of the report.
    """

    checks: tuple[Check, ...] = renamed("code_verification")
    convergence: tuple[Convergence, ...] = renamed("solution_verification")
    inputs: Mapping[str, InputUncertainty] = renamed("input_uncertainty")
    errors: tuple[ComparisonError, ...] = renamed("comparison_errors")
    stages: StageErrors | None
    groups: Mapping[str, Mapping[str, Mapping[str, Pooled]]]
    domain: Mapping[str, tuple[Number, Number]] = renamed("validated_domain")
    failed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    notes: Mapping[str, str] = Field(default_factory=dict)


def gather_evidence(
    bench: Bench,
    campaign: Campaign,
    result: CampaignResult,
    progress: Progress | None = None,
    *,
    budget: Budget | None = None,
) -> Evidence:
    """Verify codes and solutions, propagate the inputs, and score the stages.

    A part that fails is listed with its reason, and the other parts are kept.  After an interruption no new solution is
    computed.

    Args:
        bench: Sensor that was scored.
        campaign: The campaign with the uncertainties of its inputs.
        result: The scores.
        progress: Called with the name of each part.
        budget: Time that the evaluation may take; parts that it does not allow are left out.
    """
    tell = progress or (lambda _: None)
    failed: list[str] = []
    checks: list[Check] = []
    inputs: dict[str, InputUncertainty] = {}
    stages: StageErrors | None = None

    def attempt(what: str, compute: Callable[[], T], seconds: float = 0.0) -> T | None:
        from fem_reference import ConvergenceError

        if budget is not None and budget.left < seconds:
            failed.append(f"{what}: {OUT_OF_BUDGET if budget.left < 0 else 'the budget of time leaves no room for it'}")
            return None
        try:
            return compute()
        except (ConvergenceError, ValueError) as error:
            failed.append(f"{what}: {error}")
            return None

    if result.interrupted:
        failed.append("interrupted: codes are not verified, inputs not propagated, stages not scored")
    else:
        for name, check, seconds in bench.verify(result.cases):
            tell(name)
            checks += attempt(name, check, seconds) or ()
        for number, each in enumerate(result.cases):
            tell(f"input uncertainty, case {number + 1} of {len(result.cases)}")
            name = each.case.name
            propagated = attempt(f"input uncertainty of {name}", partial(bench.propagate, each.case, campaign.inputs))
            if propagated is not None:
                inputs[name] = propagated
        tell("score by stage")
        stages = attempt("stages", partial(bench.score_stages, result.cases))
    errors = [
        error
        for each in result.cases
        if each.case.name in inputs
        for error in compare_quantities(bench.parameters.array, each, inputs[each.case.name], campaign.inputs.data)
    ]
    return Evidence(
        checks=tuple(checks),
        convergence=verify_solutions(result.cases),
        inputs=inputs,
        errors=tuple(errors),
        stages=stages,
        groups=group_errors(bench, result.cases),
        domain=describe_domain(bench, result.cases),
        failed=tuple(failed),
        left_out=bench.left_out,
        notes=bench.notes,
    )


def group_errors(bench: Bench, results: Sequence[CaseResult]) -> dict[str, dict[str, dict[str, Pooled]]]:
    """Pool the errors of the fast model over the members of the groups that a bench names: group, member, metric."""
    groups: dict[str, dict[str, list[CaseResult]]] = defaultdict(lambda: defaultdict(list))
    for each in results:
        for group, member in bench.classify(each).items():
            groups[group][member].append(each)
    return {
        group: {
            member: {
                metric: pool([float(getattr(each.predictions["fast"].score, metric)) for each in cases])
                for metric in GROUP_METRICS
            }
            for member, cases in sorted(members.items())
        }
        for group, members in groups.items()
    }


def describe_domain(bench: Bench, results: Sequence[CaseResult]) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each quantity that a bench measures in the cases."""
    rows = [bench.measure(each) for each in results]
    return {name: (min(row[name] for row in rows), max(row[name] for row in rows)) for name in rows[0]}
