"""Verdict of a campaign: whether the fast model meets the acceptance criterion of the campaign file, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from validation.campaign.campaign_file import Campaign
from validation.campaign.pooling import pool
from validation.campaign.results import CampaignResult, CaseResult
from validation.metrics import METRICS
from validation.results import Number, Result, renamed, result_model

#: Whether a requirement is met: `open` if the cases do not decide it.
Status = Literal["met", "missed", "open"]

#: Largest error estimate of the reference, over the limit on misplaced force, at which a comparison decides [-].
_RESOLVED = 1 / 3
ACCEPTED, NOT_ACCEPTED, NOT_DECIDED = "accepted", "not accepted", "not decided"
#: What a limit on the mean is on.
_MEAN = "mean over the cases"


@result_model
class Finding(Result):
    """One requirement and what was found.

    Attributes:
        metric: Name of the metric, a field of `Score`.
        over: What the limit is on: `mean over the cases`, or the name of a case.
        value: The mean or the value, in SI units, as a fraction, or in percent where the name says so.
        low: Lower end of the 95 % interval of a mean, same unit; equal to `value` for a case.
        high: Upper end, same unit.
        limit: Largest accepted value, same unit.
        status: Whether the requirement is met.
    """

    metric: str
    over: str
    value: Number
    low: Number
    high: Number
    limit: float
    status: Status
    computed = (("text", "text"),)

    @property
    def text(self) -> str:
        """The finding as a sentence without full stop."""
        metric = METRICS[self.metric]
        name, unit = metric.heading, metric.unit
        values = [f"{metric.factor * number:.3g}" for number in (self.value, self.low, self.high, self.limit)]
        unit = f" {unit}" if unit else ""
        if math.isnan(self.value):
            return f"{name}, {self.over}: not defined in these cases, at most {values[3]}{unit} required"
        interval = f" (95 % interval {values[1]} to {values[2]}{unit})" if self.low != self.high else ""
        return f"{name}, {self.over}: {values[0]}{unit}{interval}, at most {values[3]}{unit} required"


@result_model
class Verdict(Result):
    """Whether the fast model is accepted.

    Attributes:
        word: `accepted`, `not accepted` or `not decided`.
        reasons: Sentences without full stop that decide it.
        findings: Every requirement.
        scored: Number of scored cases [-].
        cases: Number of cases in the campaign, with those that were left out [-].
    """

    word: str = renamed("verdict")
    reasons: tuple[str, ...]
    findings: tuple[Finding, ...]
    scored: int
    cases: int
    computed = (("accepted", "accepted"),)

    @property
    def accepted(self) -> bool:
        """Whether the fast model is accepted."""
        return self.word == ACCEPTED

    @property
    def sentence(self) -> str:
        """The verdict as a sentence."""
        scored = f"{self.scored} of {self.cases} cases are scored"
        if self.word == ACCEPTED:
            return f"The fast model is accepted: every requirement is met; {scored}."
        if self.word == NOT_ACCEPTED:
            missed = sum(each.status == "missed" for each in self.findings)
            return (
                f"The fast model is not accepted: {missed} of {len(self.findings)} requirements are missed; {scored}."
            )
        return f"Nothing is decided: no requirement is missed, but the cases do not show that all are met; {scored}."

    @property
    def short(self) -> str:
        """The verdict in one line of at most 80 characters."""
        if not self.findings:  # every limit is on single cases, and none is scored
            return f"verdict: {self.word.upper()}, {self.scored} of {self.cases} cases"
        first = next((each for each in self.findings if each.status == "missed"), self.findings[0])
        metric = METRICS[first.metric]
        unit = f" {metric.unit}" if metric.unit else ""
        found = (
            f"{metric.heading} {metric.factor * first.value:.3g}{unit}, limit {metric.factor * first.limit:.3g}{unit}"
        )
        return f"verdict: {self.word.upper()}, {self.scored} of {self.cases} cases; {found}"


def judge(campaign: Campaign, result: CampaignResult) -> Verdict:
    """Compare the scores of the fast model with the acceptance criterion.

    The model is accepted if every requirement is met and every case is scored, and not accepted if a requirement is
    missed.  A mean meets its limit if its whole 95 % interval lies at or below it, and misses it if the mean itself
    lies above.  Between the two nothing is decided.

    Args:
        campaign: The campaign with its criterion.
        result: The scores.
    """
    findings = [*_judge_means(campaign, result), *_judge_cases(campaign, result.cases)]
    doubts = _list_doubts(campaign, result)
    total = len(result.cases) + len(result.skipped) + len(campaign.left_out)
    missed = [each.text for each in findings if each.status == "missed"]
    undecided = [each.text for each in findings if each.status == "open"]
    if missed:
        word, reasons = NOT_ACCEPTED, missed
    elif undecided or doubts:
        word, reasons = NOT_DECIDED, [*undecided, *doubts]
    else:
        word, reasons = ACCEPTED, [each.text for each in findings if each.over == _MEAN] or [findings[0].text]
    return Verdict(word=word, reasons=tuple(reasons), findings=tuple(findings), scored=len(result.cases), cases=total)


def _judge_means(campaign: Campaign, result: CampaignResult) -> list[Finding]:
    out = []
    for metric, limit in campaign.criterion.mean.items():
        pooled = pool(
            [
                float(getattr(each.predictions["fast"].score, metric))
                for each in result.cases
                if not each.case.compared or metric in each.case.compared
            ]
        )
        status: Status = "met" if pooled.high <= limit else "missed" if pooled.mean > limit else "open"
        out.append(
            Finding(
                metric=metric,
                over=_MEAN,
                value=pooled.mean,
                low=pooled.low,
                high=pooled.high,
                limit=limit,
                status=status,
            )
        )
    return out


def _judge_cases(campaign: Campaign, results: Sequence[CaseResult]) -> list[Finding]:
    out = []
    for result in results:
        case = result.case
        for metric, limit in {**campaign.criterion.each, **case.required}.items():
            if case.compared and metric not in case.compared:
                continue
            value = float(getattr(result.predictions["fast"].score, metric))
            status: Status = "open" if math.isnan(value) else "met" if value <= limit else "missed"
            out.append(
                Finding(metric=metric, over=case.name, value=value, low=value, high=value, limit=limit, status=status)
            )
    return out


def _list_doubts(campaign: Campaign, result: CampaignResult) -> list[str]:
    """List the reasons why the cases do not decide, even if every requirement is met."""
    doubts = []
    if result.interrupted:
        doubts.append("the run was interrupted")
    failed = [each.name for each in result.skipped if each.reason != "interrupted"]
    if failed:
        doubts.append(f"not scored: {', '.join(failed)}")
    if campaign.left_out:
        doubts.append(f"{len(campaign.left_out)} faults in the campaign file cost their cases")
    limit = campaign.criterion.mean.get("misplaced_force")
    floor = result.reference_error
    if limit is not None and math.isnan(floor):
        doubts.append("the reference's own error is not known, because there is one mesh only")
    elif limit is not None and floor > _RESOLVED * limit:
        which = "of the peak texel" if "peak_texel" in result.noise_floor else "in misplaced force"
        doubts.append(
            f"the reference's own error {which}, {100 * floor:.2g} %, is too large for a limit of "
            f"{100 * limit:.2g} % on misplaced force"
        )
    return doubts
