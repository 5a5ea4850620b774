"""Results of a campaign: scores of every model in every case, and their means over cases.

The finite-element solution is the reference.  Simpler contact methods of the fast model and two null models are scored
for comparison.  The null models are an empty image, and the contact forces on rigid boxes without any spread to other
texels.  Published models can be scored in the same cases (`validation.published`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from meshes.array_types import FloatArray
from validation.campaign.case import Case
from validation.json_values import to_json_values
from validation.metrics import Score, published_line, score
from validation.pooling import Pooled
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
        texel_errors: Estimated errors of `texel_forces`, half widths of 95 % intervals, shape (n,) [N].
        outside_error: The same for `outside` [N].
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
    texel_errors: Array | None = None
    outside_error: Number | None = None
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
        indenter: The indenter as text; of several bodies each with its load and place.
        load: Applied force of all bodies [N].
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
        shape = f"{case.describe()}, together" if case.others else case.shape
        return cls(name=case.name, indenter=shape, load=case.load, reason=reason, converged=converged)


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
        pooled: Mean over the scored cases with interval, by metric.
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
        pooled: Mean over the scored cases with interval, by model and metric.
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
