"""Verdict on a fast model: every requirement, what was found, and whether the requirements are met.

The fast model is compared with finite elements in the cases of a campaign, and with recordings under known loads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from validation.campaign.campaign_file import Campaign
from validation.campaign.results import OUT_OF_BUDGET, CampaignResult
from validation.data_sets.results import CountScore, RecordingScores, find_difference
from validation.metrics import METRICS
from validation.pooling import FEWEST, Pooled, pool
from validation.results import Column, Number, Result, columns, renamed, result_model
from validation.schema.campaign import BEHIND_NULL

#: Status of a requirement; `open` if the cases do not decide it.
Status = Literal["met", "missed", "open"]

#: Largest estimated error of the reference, over the limit on misplaced force, with which the cases can decide [-].
_RESOLVED = 1 / 3
#: Verdict if all requirements are met.
ACCEPTED = "accepted"
#: Verdict if a requirement is missed.
NOT_ACCEPTED = "not accepted"
#: Verdict if no requirement is missed, but one is undecided, a case is not scored or the reference is too inaccurate.
NOT_DECIDED = "not decided"
#: Value of `Finding.over` for a limit on the mean of a metric.
_MEAN = "mean over the cases"
#: What the fast model is compared with.
ELEMENTS, RECORDINGS = "finite elements", "recordings"
#: Printed form of every metric that a requirement may limit.
SHOWN: Mapping[str, Column] = {
    **columns(CountScore),
    BEHIND_NULL: Column(heading="image changed, behind the best null model", unit="%"),
    **METRICS,
}


@result_model
class Finding(Result):
    """One requirement on the fast model, and whether its scores meet the requirement.

    Attributes:
        metric: Name of the metric, a field of `Score` or `CountScore`, or `behind_null_percent`.
        over: What the limit applies to: `mean over the cases`, the name of a case, or the split of the recordings.
        value: The mean or the value, in SI units, as a fraction, or in percent where the name says so.
        low: Lower end of the 95 % interval of a mean, same unit; equal to `value` without an interval.
        high: Upper end, same unit.
        limit: Largest accepted value, same unit.
        status: Whether the requirement is met.
        cases: Number of cases or loads over which the mean is taken; 1 for a single case [-].
        undefined: Number of further cases or loads in which the metric is not defined; they leave the requirement
            undecided [-].
        against: What the fast model is compared with: `finite elements` or `recordings`.
    """

    metric: str
    over: str
    value: Number
    low: Number
    high: Number
    limit: float
    status: Status
    cases: int = 1
    undefined: int = 0
    against: str = ELEMENTS
    computed = (("text", "text"), ("margin", "margin"))

    @property
    def margin(self) -> float:
        """Distance of the upper end of the interval below the limit, negative above it, in the unit of `value`."""
        return self.limit - self.high

    @property
    def short(self) -> str:
        """Metric, value and limit in a few words."""
        metric = SHOWN[self.metric]
        unit = f" {metric.unit}" if metric.unit else ""
        value, limit = (f"{metric.factor * each:.3g}{unit}" for each in (self.value, self.limit))
        return f"{metric.heading} {value}, limit {limit}"

    @property
    def text(self) -> str:
        """Metric, value and limit of the requirement as a sentence without full stop."""
        metric = SHOWN[self.metric]
        name, unit = metric.heading, metric.unit
        values = [f"{metric.factor * number:.3g}" for number in (self.value, self.low, self.high, self.limit)]
        unit = f" {unit}" if unit else ""
        if math.isnan(self.value):
            return f"{name}, {self.over}: not defined in these cases, at most {values[3]}{unit} required"
        interval = f" (95 % interval {values[1]} to {values[2]}{unit})" if self.low != self.high else ""
        few = "; too few to tell" if self.status == "open" and 1 < self.cases < FEWEST else ""
        defined = f"; defined in {self.cases} of {self.cases + self.undefined}" if self.undefined else ""
        return f"{name}, {self.over}: {values[0]}{unit}{interval}, at most {values[3]}{unit} required{few}{defined}"


@result_model
class Verdict(Result):
    """Whether the fast model is accepted.

    Attributes:
        word: `accepted`, `not accepted` or `not decided`.
        reasons: Reasons for the verdict, sentences without full stop.
        findings: Every requirement.
        scored: Number of scored cases [-].
        cases: Number of cases in the campaign, including those left out [-].
        compared: Number of cases or loads in words, by what the fast model is compared with.
    """

    word: str = renamed("verdict")
    reasons: tuple[str, ...]
    findings: tuple[Finding, ...]
    scored: int
    cases: int
    compared: Mapping[str, str]
    computed = (("accepted", "accepted"), ("sentence", "sentence"))

    @property
    def accepted(self) -> bool:
        """Whether the fast model is accepted."""
        return self.word == ACCEPTED

    @property
    def sentence(self) -> str:
        """The verdict as a sentence, which names what the fast model was compared with."""
        against = " and ".join(f"against {other} ({count})" for other, count in self.compared.items())
        if self.word == ACCEPTED:
            return f"The fast model is accepted {against}: every requirement is met."
        if self.word == NOT_ACCEPTED:
            missed = sum(each.status == "missed" for each in self.findings)
            return (
                f"The fast model is not accepted {against}: {missed} of {len(self.findings)} requirements are missed."
            )
        return (
            f"Nothing is decided about the fast model {against}: no requirement is missed, but it is not shown "
            "that all are met."
        )

    @property
    def deciding(self) -> tuple[Finding, ...]:
        """The requirement that decides in each comparison: the first one missed, else undecided, else met."""
        groups = [[each for each in self.findings if each.against == other] for other in self.compared]
        order = ("missed", "open", "met")
        return tuple(min(group, key=lambda each: order.index(each.status)) for group in groups if group)

    @property
    def short(self) -> str:
        """The verdict in one line, with the requirement that decides in each comparison."""
        first = {each.against: f": {each.short}" for each in self.deciding}
        parts = [f"against {other}, {count}{first.get(other, '')}" for other, count in self.compared.items()]
        return f"verdict: {self.word.upper()}; fast model {'; '.join(parts)}"


def judge(
    campaign: Campaign,
    result: CampaignResult | None,
    recordings: RecordingScores | None = None,
    *,
    required: Mapping[str, float] | None = None,
    splits: Sequence[str] = (),
) -> Verdict:
    """Compare the scores of the fast model with the acceptance criterion.

    The model is accepted if every requirement is met and every case is scored.  It is not accepted if a requirement is
    missed.  A mean meets its limit if its whole 95 % interval lies at or below the limit.  It misses the limit if the
    mean itself lies above.  In between, below five cases or loads, and if the metric is not defined in one of them, the
    requirement is undecided.  So is the verdict without any requirement, and if recordings, series or splits of the
    data set were left out.

    Args:
        campaign: The campaign with its criterion.
        result: The scores against finite elements; None if only recordings are scored.
        recordings: The scores on recordings; None without recordings.
        required: Limits of the data set, which replace those of the campaign.
        splits: Names of all splits of the data set; one without scores leaves the verdict undecided.
    """
    findings: list[Finding] = []
    doubts: list[str] = []
    compared: dict[str, str] = {}
    scored, total = 0, 0
    if result is not None:
        findings += _judge_campaign(campaign, result)
        doubts += _list_doubts(campaign, result)
        scored = len(result.cases)
        total = scored + len(result.skipped) + len(campaign.left_out)
        limits = ", limits of the built-in campaign" if campaign.inherits else ""
        compared[ELEMENTS] = f"{scored} of {total} cases{limits}"
    if recordings is not None:
        findings += _judge_recordings(recordings, {**campaign.criterion.recordings, **(required or {})})
        missing = [name for name in splits if all(row.split != name for row in recordings.rows)]
        doubts += [f"no scores on the recordings of split {name!r}" for name in missing]
        lost = [line for line in recordings.problems if line.endswith("left out")]
        if lost:
            doubts.append(f"{len(lost)} fault{'s' * (len(lost) > 1)} in the recordings, such as: {lost[0]}")
        loads = {case for row in recordings.rows for case in row.per_case}
        compared[RECORDINGS] = f"{recordings.name}, {len(loads)} load{'s' * (len(loads) > 1)}"
    if not findings:
        doubts.append("no requirement was compared with a limit")
    missed = [each.text for each in findings if each.status == "missed"]
    undecided = [each.text for each in findings if each.status == "open"]
    if missed:
        word, reasons = NOT_ACCEPTED, missed
    elif undecided or doubts:
        word, reasons = NOT_DECIDED, [*doubts, *undecided]
    else:
        means = [each.text for each in findings if each.over == _MEAN or each.against == RECORDINGS]
        word, reasons = ACCEPTED, means or [findings[0].text]
    return Verdict(
        word=word, reasons=tuple(reasons), findings=tuple(findings), scored=scored, cases=total, compared=compared
    )


def _find_mean(
    metric: str, over: str, pooled: Pooled, limit: float, *, compared: int, against: str = ELEMENTS
) -> Finding:
    """Compare a mean over `compared` cases with its limit; below five cases, or undefined in one, it is undecided."""
    undefined = compared - pooled.cases
    known = not math.isnan(pooled.low)
    low, high = (pooled.low, pooled.high) if known else (pooled.mean, pooled.mean)
    status: Status = "met" if high <= limit else "missed" if pooled.mean > limit else "open"
    if pooled.few or undefined:
        status = "open"
    return Finding(
        metric=metric, over=over, value=pooled.mean, low=low, high=high, limit=limit, status=status,
        cases=pooled.cases, undefined=undefined, against=against,
    )  # fmt: skip


def _judge_campaign(campaign: Campaign, result: CampaignResult) -> Iterator[Finding]:
    """Yield the result of every requirement in the cases: on means over them, then on single cases."""
    enough = len(result.cases) >= FEWEST
    for metric, limit in campaign.criterion.mean.items():
        values = [
            float(getattr(each.predictions["fast"].score, metric))
            for each in result.cases
            if each.case.compares(metric)
        ]
        yield _find_mean(metric, _MEAN, pool(values), limit, compared=len(values))
    for each in result.cases:
        for metric, limit in {**campaign.criterion.each, **each.case.required}.items():
            if each.case.compares(metric):
                value = float(getattr(each.predictions["fast"].score, metric))
                status: Status = "open" if not enough or math.isnan(value) else "met" if value <= limit else "missed"
                yield Finding(
                    metric=metric, over=each.case.name, value=value, low=value, high=value, limit=limit, status=status
                )


def _judge_recordings(scores: RecordingScores, required: Mapping[str, float]) -> Iterator[Finding]:
    """Yield the result of every requirement in each split of the recordings, on means over its loads."""
    for split in dict.fromkeys(row.split for row in scores.rows):
        own, null, behind = find_difference([row for row in scores.rows if row.split == split])
        over = f"recordings, split {split}, {behind.cases} load{'s' * (behind.cases > 1)}"
        for metric, limit in required.items():
            compared = metric == BEHIND_NULL
            yield _find_mean(
                metric, f"{over} ({null.model})" if compared else over, behind if compared else own.pooled[metric],
                limit, compared=len(own.per_case), against=RECORDINGS,
            )  # fmt: skip


def _list_doubts(campaign: Campaign, result: CampaignResult) -> list[str]:
    """List the reasons why the cases do not decide, even if every requirement is met."""
    doubts = []
    if len(result.cases) < FEWEST:
        doubts.append(f"{len(result.cases)} of the cases are scored, and fewer than {FEWEST} decide nothing")
    if result.interrupted:
        doubts.append("the run was interrupted")
    failed = [each.name for each in result.skipped if each.reason not in {"interrupted", OUT_OF_BUDGET}]
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
