"""Run of a campaign: indentations (cases) are computed by finite elements and by the fast model, which is scored.

The finite-element solution is the reference.  Simpler contact methods of the fast model and two null models are scored
for comparison.  The null models are an empty image, and the contact forces on rigid boxes without any spread to other
texels.  Published models can be scored in the same cases; `validation.published` holds them.  The error estimate of the
reference is the noise floor of all scores.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshes import Cover
from validation.campaign.case import Case
from validation.campaign.pooling import Pooled, pool, skill
from validation.errors import InputError
from validation.metrics import Score, published_line, score

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.indentation.result import Indentation
    from validation.published.calibration import ComparisonModels, Row
    from validation.published.scene import Forces

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[int, int, str], None]

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
    reference: Indentation
    predictions: Mapping[str, Prediction]
    warnings: tuple[str, ...]
    published: Mapping[str, Prediction] = dataclasses.field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the case and all its results as a dictionary of JSON values."""
        return {
            "name": self.case.name,
            "indenter": self.case.shape,
            "load": self.case.load,
            "at": list(self.case.at),
            "yaw": self.case.yaw,
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
    """

    cases: Sequence[CaseResult]
    skipped: Sequence[SkippedCase]
    pooled: Mapping[str, Mapping[str, Pooled]]
    skill: Mapping[str, Pooled]
    noise_floor: Mapping[str, float]
    published: Sequence[RowScores] = ()

    def as_json(self) -> dict[str, Any]:
        """Return all results of the campaign as a dictionary of JSON values."""
        return {
            "models": dict(MODELS),
            "pooled": {
                model: {metric: dataclasses.asdict(value) for metric, value in metrics.items()}
                for model, metrics in self.pooled.items()
            },
            "skill": {model: dataclasses.asdict(value) for model, value in self.skill.items()},
            "noise_floor": dict(self.noise_floor),
            "comparison_models": [scores.as_json() for scores in self.published],
            "cases": [result.as_json() for result in self.cases],
            "skipped": [each.as_json() for each in self.skipped],
        }


def run_campaign(
    cover: Cover,
    parameters: Parameters,
    cases: Sequence[Case],
    *,
    friction: float = 0.0,
    comparison: ComparisonModels | None = None,
    progress: Progress | None = None,
) -> CampaignResult:
    """Compute every case by finite elements and by the fast model, and score the fast model.

    Args:
        cover: The cover in the finite-element model.
        parameters: Parameters of the fast model, already fitted; the campaign changes none of them.
        cases: The indentations.
        friction: Coulomb friction coefficient between indenter and cover in the finite elements, inf for no slip [-].
        comparison: Published models to score in the same cases, already fitted (`prepare_models`); None for none.
        progress: Called before each case with (number of cases done, number of all cases, name of the next case).

    Raises:
        InputError: If no case can be computed by all models.
        ValueError: If a published model was fitted to one of the cases.
    """
    from fem_reference import ConvergenceError

    if comparison is not None:
        comparison.check_unseen(cases)
    results, skipped = [], []
    for number, case in enumerate(cases):
        if progress:
            progress(number, len(cases), case.name)
        try:
            results.append(run_case(cover, parameters, case, comparison, friction=friction))
        except (ValueError, ConvergenceError) as error:
            converged = not isinstance(error, ConvergenceError)
            skipped.append(SkippedCase(case=case, reason=str(error), converged=converged))
    if progress:
        progress(len(cases), len(cases), "")
    if not results:
        raise InputError(*(f"{each.case.name} ({each.case.shape}): {each.reason}" for each in skipped))
    return _summarise(results, skipped, comparison)


def run_case(
    cover: Cover,
    parameters: Parameters,
    case: Case,
    comparison: ComparisonModels | None = None,
    *,
    friction: float = 0.0,
) -> CaseResult:
    """Compute one case by finite elements and by all other models, and score all but the finite elements.

    Args:
        cover: The cover in the finite-element model.
        parameters: Parameters of the fast model.
        case: The indentation.
        comparison: Published models to score as well; None for none.
        friction: Coulomb friction coefficient between indenter and cover in the finite elements, inf for no slip [-].
    """
    from fastmodel import indent
    from fem_reference.indentation.press import press

    array = parameters.array
    reference = press(cover, array, case.indenter, load=case.load, at=case.at, yaw=case.yaw, friction=friction)
    press_fast = partial(indent, parameters, case.indenter, load=case.load, at=case.at, yaw=case.yaw)
    fast, area = press_fast(method="default"), press_fast(method="area")
    published: dict[str, Forces] = {}
    if comparison is None:
        boxes = press_fast(method="boxes")
    else:
        # The published models read the contacts of the same simulation.
        scene, published = comparison.predict(cover, parameters, case)
        boxes = scene.boxes
    kept = np.where(array.active, boxes.contact_forces, 0.0)
    forces = {
        "fast": (fast.texel_forces, fast.outside),
        "area": (area.texel_forces, area.outside),
        "boxes": (boxes.texel_forces, boxes.outside),
        "no-spread": (kept, case.load - float(kept.sum())),
        "zeros": (np.zeros(array.count), 0.0),
    }

    def score_all(forces: Mapping[str, tuple[FloatArray, float]]) -> dict[str, Prediction]:
        return {
            name: Prediction(
                texel_forces=texel_forces,
                outside=outside,
                score=score_forces(reference, texel_forces, outside, case.load, parameters),
            )
            for name, (texel_forces, outside) in forces.items()
        }

    return CaseResult(
        case=case,
        reference=reference,
        predictions=score_all(forces),
        warnings=fast.warnings,
        published=score_all(published),
    )


def score_forces(
    reference: Indentation, texel_forces: FloatArray, outside: float, load: float, parameters: Parameters
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


def describe_reference(reference: Indentation) -> dict[str, Any]:
    """Return the finite-element result of an indentation as a dictionary, under the names used in JSON."""
    numbers = ("texel_forces", "outside", "total_force", "balance", "depth", "contact_area", "energy", "seconds")
    texts = {"error_estimate": dict(reference.error_estimate), "assumptions": dict(reference.assumptions)}
    return {name: getattr(reference, name) for name in numbers} | texts | {"warnings": list(reference.warnings)}


def _summarise(
    results: Sequence[CaseResult], skipped: Sequence[SkippedCase], comparison: ComparisonModels | None
) -> CampaignResult:
    """Average the scores over the cases of a campaign."""

    def pool_scores(predictions: Sequence[Prediction]) -> dict[str, Pooled]:
        return {metric: pool([float(getattr(each.score, metric)) for each in predictions]) for metric in POOLED_METRICS}

    def measure_skill(predictions: Sequence[Prediction], metric: str = "misplaced_force") -> Pooled:
        errors, others = (
            [float(getattr(each.score, metric)) for each in scores] for scores in (scored["fast"], predictions)
        )
        return skill(errors, others)

    scored = {model: [result.predictions[model] for result in results] for model in MODELS}
    errors = [result.reference.error_estimate for result in results]
    published = []
    for row in comparison.rows if comparison else ():
        predictions = [result.published[row.name] for result in results]
        skills = {metric: measure_skill(predictions, metric) for metric in SKILL_METRICS}
        published.append(RowScores(row=row, pooled=pool_scores(predictions), skill=skills))
    return CampaignResult(
        cases=tuple(results),
        skipped=tuple(skipped),
        pooled={model: pool_scores(predictions) for model, predictions in scored.items()},
        skill={model: measure_skill(predictions) for model, predictions in scored.items() if model != "fast"},
        noise_floor={key: float(np.mean([each[key] for each in errors])) for key in errors[0]},
        published=tuple(published),
    )
