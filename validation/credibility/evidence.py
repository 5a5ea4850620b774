"""All evidence beside the scores: verification, uncertainty, stages, and where the validated range ends."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from meshes import Cover, TexelArray
from validation.campaign.campaign_file import Campaign
from validation.campaign.pooling import Pooled, pool
from validation.campaign.results import CampaignResult, CaseResult
from validation.credibility.code_verification import Check, verify_code
from validation.credibility.comparison_error import ComparisonError, compare_quantities
from validation.credibility.input_uncertainty import InputUncertainty, propagate_inputs
from validation.credibility.solution_verification import Convergence, verify_solutions
from validation.credibility.stages import StageErrors, score_stages
from validation.results import Number, Result, renamed, result_model

if TYPE_CHECKING:
    from fastmodel import Parameters

#: Progress of the evidence: called with a line of text.
Progress = Callable[[str], None]
#: Load between the two groups of loads [N], and share of the load outside the array above which a case is at the edge.
_HEAVY, _AT_EDGE = 2.0, 0.05
#: Metrics of the grouped errors.
GROUP_METRICS = ("misplaced_force", "image_changed_percent", "centre_of_pressure_m")


@result_model
class Evidence(Result):
    """Evidence beside the scores.

    Attributes:
        checks: Code verification.
        convergence: Solution verification.
        inputs: Effects of the uncertain inputs, by name of the case.
        errors: Comparison errors with their uncertainties.
        stages: Errors by stage; None if the fast model has no cover data.
        groups: Pooled errors of the fast model by load, shape and pose: group, member, metric.
        domain: Range of the cases, by name: smallest and largest value, in SI units.
        failed: Why a part is missing, one line each.
        left_out: Which sections have no meaning for this kind of cover, one sentence each.
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


def gather_evidence(
    cover: Cover, parameters: Parameters, campaign: Campaign, result: CampaignResult, progress: Progress | None = None
) -> Evidence:
    """Verify codes and solutions, propagate the inputs, and score the stages.

    What fails is named in the result and costs nothing else.  After an interruption nothing that needs a new
    solution is computed.

    Args:
        cover: Laterally wide cover.
        parameters: Parameters of the fast model.
        campaign: The campaign with the uncertainties of its inputs.
        result: The scores.
        progress: Called with the name of each part.
    """
    from fem_reference import ConvergenceError

    tell = progress or (lambda _: None)
    failed: list[str] = []
    checks: tuple[Check, ...] = ()
    inputs: dict[str, InputUncertainty] = {}
    stages = None
    if result.interrupted:
        failed.append("interrupted: codes are not verified, inputs not propagated, stages not scored")
    else:
        tell("verification of the codes")
        try:
            checks = verify_code(cover, parameters.array)
        except (ConvergenceError, ValueError) as error:
            failed.append(f"code verification: {error}")
        inputs, faults = _propagate(cover, parameters.array, campaign, result.cases, tell)
        failed += faults
        tell("score by stage")
        try:
            stages = score_stages(cover, parameters, result.cases)
        except (ConvergenceError, ValueError) as error:
            failed.append(f"stages: {error}")
    errors = [
        each
        for case in result.cases
        if case.case.name in inputs
        for each in compare_quantities(parameters.array, case, inputs[case.case.name], campaign.inputs.data)
    ]
    return Evidence(
        checks=checks,
        convergence=verify_solutions(result.cases),
        inputs=inputs,
        errors=tuple(errors),
        stages=stages,
        groups=group_errors(result.cases),
        domain=describe_domain(cover, result.cases),
        failed=tuple(failed),
    )


def _propagate(
    cover: Cover, array: TexelArray, campaign: Campaign, results: Sequence[CaseResult], tell: Progress
) -> tuple[dict[str, InputUncertainty], list[str]]:
    """Propagate the inputs in every case; return the effects by name of the case, and one line per failure."""
    from fem_reference import ConvergenceError

    out: dict[str, InputUncertainty] = {}
    failed = []
    for number, result in enumerate(results):
        tell(f"input uncertainty, case {number + 1} of {len(results)}")
        try:
            out[result.case.name] = propagate_inputs(cover, array, result.case, campaign.inputs)
        except (ConvergenceError, ValueError) as error:
            failed.append(f"input uncertainty of {result.case.name}: {error}")
    return out, failed


def group_errors(results: Sequence[CaseResult]) -> dict[str, dict[str, dict[str, Pooled]]]:
    """Pool the errors of the fast model by load, by shape and by pose of the indenter."""
    groups: dict[str, dict[str, list[CaseResult]]] = {name: defaultdict(list) for name in ("load", "shape", "pose")}
    for result in results:
        case = result.case
        groups["load"]["below 2 N" if case.load < _HEAVY else "2 N and more"].append(result)
        groups["shape"][case.shape.split(":")[0]].append(result)
        outside = result.reference.outside / case.load
        turned = math.degrees(case.pose.yaw) % 90 != 0
        pose = "over an edge" if outside > _AT_EDGE else "turned" if turned else "inside, not turned"
        groups["pose"][pose].append(result)
    return pool_groups(groups)


def pool_groups(
    groups: Mapping[str, Mapping[str, Sequence[CaseResult]]],
) -> dict[str, dict[str, dict[str, Pooled]]]:
    """Pool the errors of the fast model over the cases of each member of each group."""
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


def describe_domain(cover: Cover, results: Sequence[CaseResult]) -> dict[str, tuple[float, float]]:
    """Return the range of loads, depths over thickness, contact areas and shares outside that the cases cover."""
    ranges = {
        "load_N": [each.case.load for each in results],
        "depth_over_thickness": [each.reference.depth / cover.thickness for each in results],
        "contact_area_m2": [each.reference.contact_area for each in results],
        "share_outside_array": [each.reference.outside / each.case.load for each in results],
    }
    return {name: (min(values), max(values)) for name, values in ranges.items()}
