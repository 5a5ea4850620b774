"""Results of a campaign: scores of every model in every case, and their means over cases.

The finite-element solution is the reference.  Simpler contact methods of the fast model and two null models are scored
for comparison.  The null models are an empty image, and the contact forces on rigid boxes without any spread to other
texels.  Published models can be scored in the same cases; `validation.published` holds them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from validation.campaign.case import Case
from validation.campaign.pooling import Pooled
from validation.metrics import Score

if TYPE_CHECKING:
    from fem_reference.indentation.result import Indentation
    from validation.curved.reference import CurvedReference
    from validation.published.calibration import Row

FloatArray = npt.NDArray[np.float64]

#: Names of the scored models, with a description of each for tables.
MODELS: Mapping[str, str] = {
    "fast": "the fast model by default: contact on the cover's own cells, or boxes if there are none",
    "area": "rigid box texels in MuJoCo, forces shared by contact area, fitted Gaussian spread",
    "boxes": "the 2015 report's: rigid box texels, forces by contact points, fitted Gaussian spread",
    "no-spread": "null: the same boxes, their texel forces without spread",
    "zeros": "null: an empty image",
}

#: Names of the metrics, attributes of `Score`, whose means over cases are tabulated.
POOLED_METRICS = (
    "misplaced_force",
    "relative_l2",
    "total_force_error",
    "peak_error",
    "centre_of_pressure_m",
    "wasserstein_m",
    "image_changed_percent",
    "image_changed_line_percent",
    "pixels_changed",
)


#: Names of the metrics by which the fast model is compared with published models.
SKILL_METRICS = ("misplaced_force", "image_changed_percent", "image_changed_line_percent")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Texel forces that a model predicts in one case, with their score.

    Attributes:
        texel_forces: Steady forces on the n texels, shape (n,) [N].
        outside: Force that no active texel measures [N].
        score: Score against the finite-element reference.
    """

    texel_forces: FloatArray
    outside: float
    score: Score

    def as_json(self) -> dict[str, Any]:
        """Return forces and scores as a dictionary of JSON values."""
        return {"texel_forces": self.texel_forces, "outside": self.outside, "scores": self.score.as_json()}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class CaseResult:
    """Results of one case: the finite-element reference, and every model scored against the reference.

    Attributes:
        case: The indentation.
        reference: Result of the finite elements.
        predictions: Result and score of each scored model, by the name of the model.
        warnings: Sentences about reasons not to rely on the fast model in this case.
        published: Result and score of each published model, by the name of its row; empty if none was scored.
    """

    case: Case
    reference: Indentation | CurvedReference
    predictions: Mapping[str, Prediction]
    warnings: tuple[str, ...]
    published: Mapping[str, Prediction] = dataclasses.field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the case and all its results as a dictionary of JSON values."""
        return {
            "name": self.case.name,
            "indenter": self.case.shape,
            "load": self.case.load,
            **self.case.describe_pose(),
            "reference": describe_reference(self.reference),
            "warnings": list(self.warnings),
            "models": {name: prediction.as_json() for name, prediction in self.predictions.items()},
            "comparison_models": {name: prediction.as_json() for name, prediction in self.published.items()},
        }


@dataclasses.dataclass(frozen=True, kw_only=True)
class SkippedCase:
    """A case without scores, because a model failed.

    Attributes:
        case: The indentation.
        reason: Why a model cannot compute the indentation; for example, the indenter would pierce a soft cover.
        converged: False if the finite-element solver did not converge.
    """

    case: Case
    reason: str
    converged: bool

    def as_json(self) -> dict[str, Any]:
        """Return name, indenter and reason as a dictionary of JSON values."""
        return {
            "name": self.case.name,
            "indenter": self.case.shape,
            "reason": self.reason,
            "converged": self.converged,
        }


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class RowScores:
    """Scores of a published model, pooled over the cases of a campaign.

    Attributes:
        row: The model and its parameters.
        pooled: Mean over the scored cases with bootstrap interval, by metric.
        skill: Skill of the fast model, 1 - its mean error / mean error of this model [-], by metric (`SKILL_METRICS`).
    """

    row: Row
    pooled: Mapping[str, Pooled]
    skill: Mapping[str, Pooled]

    def as_json(self) -> dict[str, Any]:
        """Return the model, its parameters and its scores as a dictionary of JSON values."""
        pooled, skills = (
            {metric: dataclasses.asdict(value) for metric, value in values.items()}
            for values in (self.pooled, self.skill)
        )
        return {**self.row.as_json(), "pooled": pooled, "skill": skills}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class CampaignResult:
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

    cases: Sequence[CaseResult]
    skipped: Sequence[SkippedCase]
    pooled: Mapping[str, Mapping[str, Pooled]]
    skill: Mapping[str, Pooled]
    noise_floor: Mapping[str, float]
    published: Sequence[RowScores] = ()
    interrupted: bool = False
    models: Mapping[str, str] = dataclasses.field(default_factory=lambda: MODELS)

    @property
    def reference_error(self) -> float:
        """Mean over cases of the estimated error of the reference's texel forces [-]."""
        return texel_error(self.noise_floor)

    def as_json(self) -> dict[str, Any]:
        """Return all results of the campaign as a dictionary of JSON values."""
        return {
            "models": dict(self.models),
            "pooled": {
                model: {metric: dataclasses.asdict(value) for metric, value in metrics.items()}
                for model, metrics in self.pooled.items()
            },
            "skill": {model: dataclasses.asdict(value) for model, value in self.skill.items()},
            "noise_floor": dict(self.noise_floor),
            "comparison_models": [scores.as_json() for scores in self.published],
            "cases": [result.as_json() for result in self.cases],
            "skipped": [each.as_json() for each in self.skipped],
            "interrupted": self.interrupted,
        }


def texel_error(estimates: Mapping[str, float]) -> float:
    """Return the estimated error of texel forces [-]: of the largest one, or on a curved cover the misplaced force."""
    return estimates.get("peak_texel", estimates.get("misplaced_force", 0.0))


def name_texel_error(estimates: Mapping[str, float]) -> str:
    """Say what `texel_error` is a share of."""
    return "the peak texel" if "peak_texel" in estimates else "the load, on wrong texels"


def describe_reference_error(campaign: CampaignResult) -> str:
    """Describe the mean estimated error of the reference's texel forces in words."""
    if math.isnan(campaign.reference_error):
        return "not known, there is one mesh only"
    return f"{100 * campaign.reference_error:.2g} % of {name_texel_error(campaign.noise_floor)}"


def require_flat(reference: Indentation | CurvedReference) -> Indentation:
    """Return the reference of a case on a flat cover.

    Raises:
        TypeError: If it is that of a case on a curved cover.
    """
    from validation.curved.reference import CurvedReference

    if isinstance(reference, CurvedReference):
        raise TypeError("this part of the evaluation takes flat covers only")
    return reference


def describe_reference(reference: Indentation | CurvedReference) -> dict[str, Any]:
    """Return the finite-element result of an indentation as a dictionary, under the names used in JSON."""
    from validation.curved.reference import CurvedReference

    if isinstance(reference, CurvedReference):
        return reference.as_json()
    numbers = ("texel_forces", "outside", "total_force", "balance", "depth", "contact_area", "energy", "seconds")
    texts: dict[str, Any] = {"grid_values": dict(reference.grid_values)}
    texts |= {"error_estimate": dict(reference.error_estimate), "assumptions": dict(reference.assumptions)}
    return {name: getattr(reference, name) for name in numbers} | texts | {"warnings": list(reference.warnings)}
