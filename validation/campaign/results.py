"""Results of a campaign: scores of every model in every case, and their means over cases.

The finite-element solution is the reference.  Simpler contact methods of the fast model and two null models are scored
for comparison.  The null models are an empty image, and the contact forces on rigid boxes without any spread to other
texels.  Published models can be scored in the same cases (`validation.published`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Field, model_validator

from meshes.array_types import FloatArray
from validation.campaign.campaign_file import Campaign
from validation.campaign.case import Case
from validation.json_values import to_json_values
from validation.metrics import METRICS, Score, published_line, score
from validation.results import Array, Number, Result, Unread, renamed, result_model

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.indentation.result import Indentation

#: Names of the scored models, with a description of each for tables.
MODELS: Mapping[str, str] = {
    "fast": "the fast model by default: contact on the cover's own cells, or boxes if there are none",
    "foundation": "the fast model's simple method: independent springs on the cover's cells, spread of each cell",
    "boxes": "the 2015 report's: rigid box texels, forces by contact points, fitted Gaussian spread",
    "no-spread": "null: the same boxes, their texel forces without spread",
    "zeros": "null: an empty image",
}

#: Names of the metrics by which the fast model is compared with published models.
SKILL_METRICS = ("misplaced_force", "image_changed_percent", "image_changed_line_percent")


@result_model
class Reference(Result):
    """Part of the finite-element result of one case that is kept for scores and reports.

    Attributes:
        texel_forces: Force on each of n texels, along its normal on a curved cover, shape (n,) [N].
        outside: Force on the base outside the active texels [N]; 0 on a curved cover, where `unmeasured` is the
            corresponding vector.
        total_force: Force on the indenter along its motion [N].
        depth: Approach of the indenter from first touch [m].
        contact_area: Contact area [m2].
        error_estimate: Estimated relative errors by name; NaN with one mesh [-].
        assumptions: Assumptions of the solution by topic.
        warnings: Reasons not to rely on the result.
        balance: Forces on texels and outside over the load, minus 1 [-].
        energy: Elastic energy stored in the cover; None on curved covers [J].
        seconds: Elapsed time of the computation [s].
        grid_values: Quantities on the three grids, coarsest first, in SI units.
        force: Force of the indenter on the cover, shape (3,) [N].
        moment: Moment of `force` about the origin, shape (3,) [N m]; None with friction on flat covers.
        base_force: Force of the cover on the base, shape (3,) [N].
        base_moment: Moment of `base_force` about the origin, shape (3,) [N m]; None on flat covers.
        unmeasured: Part of the base force that no texel measures, shape (3,) [N].
        found: Complete result of the solver; None in a result that was read from a file.
    """

    texel_forces: Array
    outside: float = 0.0
    total_force: float
    depth: Number
    contact_area: Number
    error_estimate: Mapping[str, Number]
    assumptions: Mapping[str, str]
    warnings: tuple[str, ...]
    balance: Number | None = None
    energy: Number | None = None
    seconds: Number | None = None
    grid_values: Mapping[str, tuple[Number, ...]] | None = None
    force: Array | None = None
    moment: Array | None = None
    base_force: Array | None = None
    base_moment: Array | None = None
    unmeasured: Array | None = None
    found: Annotated[Any, Unread()] = Field(default=None, exclude=True)

    @classmethod
    def of(cls, found: object) -> Reference:
        """Make a reference of a solver's result; a reference is returned unchanged."""
        if isinstance(found, Reference):
            return found
        names = [each.name for each in dataclasses.fields(cls) if each.name != "found"]
        return cls(**{name: getattr(found, name) for name in names if hasattr(found, name)}, found=found)


@result_model
class Prediction(Result):
    """Texel forces that a model predicts in one case, with their score.

    Attributes:
        texel_forces: Steady forces on the n texels, shape (n,) [N].
        outside: Force that no active texel measures [N].
        score: Score against the finite-element reference.
    """

    texel_forces: Array
    outside: float
    score: Score = renamed("scores")


@result_model
class CaseResult(Result):
    """Results of one case: the finite-element reference, and every model scored against the reference.

    Attributes:
        case: The indentation.
        reference: Result of the finite elements.
        predictions: Result and score of each scored model, by the name of the model.
        warnings: Sentences about reasons not to rely on the fast model in this case.
        published: Result and score of each published model, by the name of its row; empty if none was scored.
    """

    case: Annotated[Case, Unread()] = Field(exclude=True)
    reference: Annotated[
        Reference, BeforeValidator(lambda value: value if isinstance(value, dict) else Reference.of(value))
    ]
    warnings: tuple[str, ...]
    predictions: Mapping[str, Prediction] = renamed("models")
    published: Mapping[str, Prediction] = Field(
        default_factory=dict, validation_alias="comparison_models", serialization_alias="comparison_models"
    )

    def as_json(self) -> dict[str, Any]:
        """Return the case and all its results as a dictionary of JSON values."""
        return {**to_json_values(self.case), **super().as_json()}

    @model_validator(mode="before")
    @classmethod
    def _read_case(cls, values: Any) -> Any:  # noqa: ANN401 -- as pydantic gives them
        return values | {"case": Case.from_json(values)} if isinstance(values, dict) else values


#: Reason for which a case of a run with a budget has no scores.
OUT_OF_BUDGET = "the budget of time is used up"


@result_model
class SkippedCase(Result):
    """A case without scores, because a model failed.

    Attributes:
        name: Name of the case.
        indenter: The indenter as text.
        load: Applied force [N].
        reason: Reason why a model cannot compute the indentation; for example, the indenter would pierce a soft cover.
        converged: False if the finite-element solver did not converge.
    """

    name: str
    indenter: str
    load: float
    reason: str
    converged: bool

    @classmethod
    def of(cls, case: Case, reason: str, *, converged: bool = True) -> SkippedCase:
        """Make the entry of a case that has no scores."""
        return cls(name=case.name, indenter=case.shape, load=case.load, reason=reason, converged=converged)


@result_model
class RowScores(Result):
    """Scores of a published model, pooled over the cases of a campaign.

    Attributes:
        name: Name of the row, unique in its table.
        title: Name of the model.
        variant: `as shipped` (published parameters) or `as fitted`.
        contact: Input from which the model computes texel forces, such as contact points.
        rule: The model in a few words.
        certainty: Source of the equations: published code, a summary, or other publications.
        total: Statement of whether the forces sum to the load.
        not_built: Part of the model that concerns changes in time and is not implemented, in words.
        parameters: Values of all parameters by name, in SI units.
        units: Units of the parameters by name.
        fitted: Names of the fitted parameters.
        fitted_on: Presses to which the parameters were fitted, as text.
        fit_misplaced_force: Mean misplaced force over the presses of `fitted_on` [-].
        pooled: Mean over the scored cases with bootstrap interval, by metric.
        skill: Skill of the fast model, 1 - its mean error / mean error of this model [-], by metric (`SKILL_METRICS`).
    """

    name: str
    title: str
    variant: str
    contact: str
    rule: str
    certainty: str
    total: str
    not_built: str
    parameters: Mapping[str, Number]
    units: Mapping[str, str]
    fitted: tuple[str, ...]
    fitted_on: tuple[str, ...]
    fit_misplaced_force: Number
    pooled: Mapping[str, Pooled]
    skill: Mapping[str, Pooled]


@result_model
class CampaignResult(Result):
    """Results of all cases of a campaign.

    Attributes:
        cases: One result per scored case.
        skipped: The cases without scores.
        pooled: Mean over the scored cases with bootstrap interval, by model and metric.
        skill: Skill of the fast model in misplaced force, 1 - mean error / mean error of another model [-], by the name
            of the other model.
        noise_floor: Mean over cases of each relative error estimate of the reference, by name [-].
        published: Pooled scores of the published models, in the order of their table; empty if none was scored.
        interrupted: Whether the run was interrupted, so that cases are missing.
        models: Names of the scored models, with a description of each for tables.
    """

    cases: tuple[CaseResult, ...]
    skipped: tuple[SkippedCase, ...]
    pooled: Mapping[str, Mapping[str, Pooled]]
    skill: Mapping[str, Pooled]
    noise_floor: Mapping[str, Number]
    published: tuple[RowScores, ...] = Field(
        default=(), validation_alias="comparison_models", serialization_alias="comparison_models"
    )
    interrupted: bool = False
    models: Mapping[str, str] = Field(default_factory=lambda: MODELS)

    @property
    def reference_error(self) -> float:
        """Mean over cases of the estimated error of the reference's texel forces [-]."""
        return texel_error(self.noise_floor)


def texel_error(estimates: Mapping[str, float]) -> float:
    """Return the estimated error of texel forces [-]: the misplaced force, or if unknown that of the largest texel."""
    return estimates.get("misplaced_force", estimates.get("peak_texel", 0.0))


def name_texel_error(estimates: Mapping[str, float]) -> str:
    """Describe in words the quantity to which the estimated error of the texel forces is relative."""
    return "the load, on wrong texels" if "misplaced_force" in estimates else "the peak texel"


def describe_reference_error(campaign: CampaignResult) -> str:
    """Describe the mean estimated error of the reference's texel forces in words."""
    if math.isnan(campaign.reference_error):
        return "not known, there is one mesh only"
    return f"{100 * campaign.reference_error:.2g} % of {name_texel_error(campaign.noise_floor)}"


def predict(
    reference: Reference | Indentation,
    forces: Mapping[str, tuple[FloatArray, float]],
    load: float,
    parameters: Parameters,
) -> dict[str, Prediction]:
    """Score the texel forces of several models in one case.

    Args:
        reference: Result of the finite elements.
        forces: Forces on the n texels, shape (n,) [N], and force that no active texel measures [N], by model.
        load: Applied force [N].
        parameters: Texels and electronics of the sensor.
    """
    return {
        name: Prediction(
            texel_forces=texel_forces,
            outside=outside,
            score=score_forces(reference, texel_forces, outside, load, parameters),
        )
        for name, (texel_forces, outside) in forces.items()
    }


def score_forces(
    reference: Reference | Indentation,
    texel_forces: FloatArray,
    outside: float,
    load: float,
    parameters: Parameters,
) -> Score:
    """Score the texel forces of a model against the finite-element result of the same indentation.

    Args:
        reference: Result of the finite elements.
        texel_forces: Forces on the n texels by the model, shape (n,) [N].
        outside: Force that no active texel measures, by the model [N].
        load: Applied force [N].
        parameters: Texels and electronics of the sensor.
    """
    return score(
        reference.texel_forces,
        texel_forces,
        reference_outside=reference.outside,
        outside=outside,
        load=load,
        array=parameters.array,
        line=published_line(parameters.electronics),
    )


@result_model
class Pooled(Result):
    """Mean of a quantity over cases, or another statistic of the cases, with its bootstrap interval.

    Attributes:
        mean: Mean over the cases in which the quantity exists, in the unit of the quantity.
        low: Lower end of the bootstrap interval, same unit.
        high: Upper end of the bootstrap interval, same unit.
        level: Nominal coverage of the interval [-].
        cases: Number of cases over which the mean is taken [-].
    """

    mean: Number
    low: Number
    high: Number
    level: float
    cases: int


def pool(values: Sequence[float] | FloatArray, *, level: float = 0.95, resamples: int = 5000) -> Pooled:
    """Compute the mean of a quantity over cases, with a percentile bootstrap interval.

    The bootstrap resamples cases (indentations), never single pixels of an image.

    Args:
        values: One number per case; NaN in cases in which the quantity does not exist.
        level: Nominal coverage of the interval [-].
        resamples: Number of bootstrap resamples [-].
    """
    known = np.asarray(values, dtype=np.float64)
    known = known[~np.isnan(known)]
    if not known.size:
        return Pooled(mean=math.nan, low=math.nan, high=math.nan, level=level, cases=0)
    means = known[_draw_cases(known.size, resamples)].mean(axis=1)
    return _with_interval(float(known.mean()), means, level, known.size)


def skill(
    errors: Sequence[float] | FloatArray,
    comparison: Sequence[float] | FloatArray,
    *,
    level: float = 0.95,
    resamples: int = 5000,
) -> Pooled:
    """Compute the skill of a model, 1 - mean error / mean error of a comparison model [-], with a bootstrap interval.

    The bootstrap resamples cases, and takes the errors of the two models from the same cases.

    Args:
        errors: Error of the model in each case; NaN in cases in which the error does not exist.
        comparison: Error of the comparison model in the same cases.
        level: Nominal coverage of the interval [-].
        resamples: Number of bootstrap resamples [-].

    Raises:
        ValueError: If the two sequences differ in length or are not one-dimensional.
    """
    e, c = np.asarray(errors, dtype=np.float64), np.asarray(comparison, dtype=np.float64)
    if e.shape != c.shape or e.ndim != 1:
        raise ValueError(f"skill needs the same cases twice, not shapes {e.shape} and {c.shape}")
    known = ~(np.isnan(e) | np.isnan(c))
    e, c = e[known], c[known]
    if not e.size or c.mean() <= 0:
        return Pooled(mean=math.nan, low=math.nan, high=math.nan, level=level, cases=int(e.size))
    draws = _draw_cases(e.size, resamples)
    below = c[draws].mean(axis=1)
    ratios = 1 - e[draws].mean(axis=1)[below > 0] / below[below > 0]
    return _with_interval(1 - float(e.mean() / c.mean()), ratios, level, e.size)


def _draw_cases(cases: int, resamples: int) -> npt.NDArray[np.int64]:
    """Draw the indices of cases for all bootstrap resamples, always the same ones, shape (resamples, cases)."""
    return np.random.default_rng(0).integers(0, cases, size=(resamples, cases))


def _with_interval(mean: float, resampled: FloatArray, level: float, cases: int) -> Pooled:
    low, high = np.quantile(resampled, [(1 - level) / 2, (1 + level) / 2])
    return Pooled(mean=mean, low=float(low), high=float(high), level=level, cases=cases)


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


@result_model
class Finding(Result):
    """One requirement on the fast model, and whether its scores meet the requirement.

    Attributes:
        metric: Name of the metric, a field of `Score`.
        over: What the limit applies to: `mean over the cases`, or the name of a case.
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
        """Metric, value and limit of the requirement as a sentence without full stop."""
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
        reasons: Reasons for the verdict, sentences without full stop.
        findings: Every requirement.
        scored: Number of scored cases [-].
        cases: Number of cases in the campaign, including those left out [-].
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
        if not self.findings:  # Every limit is on single cases, and no case is scored.
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

    The model is accepted if every requirement is met and every case is scored.  It is not accepted if a requirement is
    missed.  A mean meets its limit if its whole 95 % interval lies at or below the limit.  It misses the limit if the
    mean itself lies above.  In between, the requirement is undecided.

    Args:
        campaign: The campaign with its criterion.
        result: The scores.
    """
    findings = tuple(_judge(campaign, result.cases))
    doubts = _list_doubts(campaign, result)
    total = len(result.cases) + len(result.skipped) + len(campaign.left_out)
    missed = [each.text for each in findings if each.status == "missed"]
    undecided = [each.text for each in findings if each.status == "open"]
    if len(result.cases) < campaign.fewest:
        few = f"{len(result.cases)} cases are scored, and fewer than {campaign.fewest} decide nothing"
        word, reasons = NOT_DECIDED, [few, *missed, *undecided, *doubts]
    elif missed:
        word, reasons = NOT_ACCEPTED, missed
    elif undecided or doubts:
        word, reasons = NOT_DECIDED, [*undecided, *doubts]
    else:
        word, reasons = ACCEPTED, [each.text for each in findings if each.over == _MEAN] or [findings[0].text]
    return Verdict(word=word, reasons=tuple(reasons), findings=findings, scored=len(result.cases), cases=total)


def _judge(campaign: Campaign, results: Sequence[CaseResult]) -> Iterator[Finding]:
    """Yield the result of every requirement: on means over the cases, then on single cases."""

    def find(metric: str, over: str, value: float, *, low: float, high: float, limit: float) -> Finding:
        status: Status = "met" if high <= limit else "missed" if value > limit else "open"
        return Finding(metric=metric, over=over, value=value, low=low, high=high, limit=limit, status=status)

    def measure(result: CaseResult, metric: str) -> float:
        return float(getattr(result.predictions["fast"].score, metric))

    for metric, limit in campaign.criterion.mean.items():
        pooled = pool([measure(each, metric) for each in results if each.case.compares(metric)])
        yield find(metric, _MEAN, pooled.mean, low=pooled.low, high=pooled.high, limit=limit)
    for result in results:
        for metric, limit in {**campaign.criterion.each, **result.case.required}.items():
            if result.case.compares(metric):
                value = measure(result, metric)
                yield find(metric, result.case.name, value, low=value, high=value, limit=limit)


def _list_doubts(campaign: Campaign, result: CampaignResult) -> list[str]:
    """List the reasons why the cases do not decide, even if every requirement is met."""
    doubts = []
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
