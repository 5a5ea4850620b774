"""A campaign: cases pressed by the finite elements and by the fast model, and scored.

Beside the fast model stand its simpler contact methods and two null models: zeros, and the forces on rigid boxes
without any spread.
What the reference itself is uncertain about is the noise floor of every score.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshes import Cover, TexelArray
from validation.campaign.case import Case
from validation.campaign.pooling import Pooled, pool, skill
from validation.errors import InputError
from validation.metrics import Score, score

if TYPE_CHECKING:
    from fastmodel import FastIndentation, Parameters
    from fem_reference.indentation.press import Indentation

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[int, int, str], None]

#: The scored models, and what each is.
MODELS: Mapping[str, str] = MappingProxyType(
    {
        "fast": "the fast model as it comes: contact on the cover's own cells, or boxes where there are none",
        "area": "rigid box texels in MuJoCo, forces shared by contact area, fitted Gaussian spread",
        "boxes": "the 2015 report's: rigid box texels, forces by contact points, fitted Gaussian spread",
        "no-spread": "null: the same boxes, texel forces as they come",
        "zeros": "null: an empty image",
    }
)

#: Metrics that a table pools; the first is the one that others are sorted by.
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


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What one model says about one case.

    Attributes:
        texel_forces: Steady texel forces, shape (n,) [N].
        outside: Force that no texel measures [N].
        score: Against the reference.
    """

    texel_forces: FloatArray
    outside: float
    score: Score


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class CaseResult:
    """One case: the reference, and every model scored against it.

    Attributes:
        case: The indentation.
        reference: By the finite elements.
        fast: By the fast model.
        predictions: By model name.
    """

    case: Case
    reference: Indentation
    fast: FastIndentation
    predictions: Mapping[str, Prediction]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Skipped:
    """A case without scores.

    Attributes:
        case: The indentation.
        reason: Why a model cannot press it: it would pierce a cover so soft, for example.
        converged: False where the reference's solver gave up.
    """

    case: Case
    reason: str
    converged: bool


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class CampaignResult:
    """All cases of a campaign.

    Attributes:
        cases: One result per case that was scored.
        skipped: The others.
        pooled: Mean and bootstrap interval over cases, by model and metric.
        skill: 1 - error / error of the null model, of the fast model's misplaced force, by null model.
        noise_floor: Mean relative errors of the reference over cases.
    """

    cases: Sequence[CaseResult]
    skipped: Sequence[Skipped]
    pooled: Mapping[str, Mapping[str, Pooled]]
    skill: Mapping[str, Pooled]
    noise_floor: Mapping[str, float]

    def as_json(self) -> dict[str, Any]:
        """Every number, by name."""
        return {
            "models": dict(MODELS),
            "pooled": {
                model: {metric: dataclasses.asdict(value) for metric, value in metrics.items()}
                for model, metrics in self.pooled.items()
            },
            "skill": {model: dataclasses.asdict(value) for model, value in self.skill.items()},
            "noise_floor": dict(self.noise_floor),
            "cases": [_case_json(result) for result in self.cases],
            "skipped": [
                {
                    "name": each.case.name,
                    "indenter": each.case.shape,
                    "reason": each.reason,
                    "converged": each.converged,
                }
                for each in self.skipped
            ],
        }


def default_cases(array: TexelArray) -> tuple[Case, ...]:
    """The default campaign on any flat array of the size of a fingertip or larger.

    Every shape, both weights of the 2015 report and its three yaws; over the centre of the array (between texels
    where their number is even), over a texel, off the grid by less than half a pitch, over an edge and over a corner,
    where force leaves the array.

    Args:
        array: The texels; they decide the positions.
    """
    rows = (
        ("sphere, centre", "sphere:radius=5mm", "100 g", "centre", "0deg"),
        ("sphere, centre, heavy", "sphere:radius=5mm", "500 g", "centre", "0deg"),
        ("sphere, texel", "sphere:radius=5mm", "500 g", "texel", "0deg"),
        ("large sphere, off grid", "sphere:radius=8mm", "500 g", "off grid", "0deg"),
        ("sphere, edge", "sphere:radius=5mm", "500 g", "edge", "0deg"),
        ("cylinder, centre", "cylinder:radius=5mm", "100 g", "centre", "0deg"),
        ("cylinder, off grid", "cylinder:radius=5mm", "500 g", "off grid", "0deg"),
        ("cylinder, corner", "cylinder:radius=4mm", "500 g", "corner", "0deg"),
        ("big square, centre", "box:size=12mmx12mmx8mm", "500 g", "centre", "0deg"),
        ("big square, off grid, 45", "box:size=12mmx12mmx8mm", "500 g", "off grid", "45deg"),
        ("small square, texel", "box:size=6mmx6mmx8mm", "100 g", "texel", "0deg"),
        ("big rectangle, 0", "box:size=6mmx18mmx8mm", "500 g", "off grid", "0deg"),
        ("big rectangle, 45", "box:size=6mmx18mmx8mm", "500 g", "off grid", "45deg"),
        ("big rectangle, 90", "box:size=6mmx18mmx8mm", "500 g", "off grid", "90deg"),
        ("small rectangle, edge", "box:size=4mmx10mmx8mm", "100 g", "edge", "0deg"),
        ("tip, texel", "tip:radius=1mm", "20 g", "texel", "0deg"),
        ("tip, off grid", "tip:radius=1mm", "100 g", "off grid", "0deg"),
    )
    places = _places(array)
    return tuple(
        dataclasses.replace(Case.read(name, shape, load, yaw=yaw), at=places[place])
        for name, shape, load, place, yaw in rows
    )


def _places(array: TexelArray) -> dict[str, tuple[float, float]]:
    """Positions of interest [m]."""
    centres = array.centres[array.active, :2]
    right, top = centres.max(axis=0)
    middle = array.centres[array.middle]
    pitch_x, pitch_y = array.pitch
    return {
        "centre": (0.0, 0.0),
        "texel": (float(middle[0]), float(middle[1])),
        # 0.7 and 1.1 mm on a pitch of 3.4 mm: no symmetry of the grid is left.
        "off grid": (0.206 * pitch_x, -0.324 * pitch_y),
        "edge": (float(right), 0.206 * pitch_y),
        "corner": (float(right) - 0.324 * pitch_x, float(top) - 0.324 * pitch_y),
    }


def run_campaign(
    cover: Cover, parameters: Parameters, cases: Sequence[Case], *, progress: Progress | None = None
) -> CampaignResult:
    """Press every case by both models and score the fast one.

    Args:
        cover: The cover of the reference.
        parameters: The fast model, fitted beforehand; nothing is fitted here.
        cases: The indentations.
        progress: Told (cases done, cases in all, name of the next) as it goes.

    Raises:
        InputError: If no case at all can be pressed.
    """
    from fem_reference import ConvergenceError

    results, skipped = [], []
    for number, case in enumerate(cases):
        if progress:
            progress(number, len(cases), case.name)
        try:
            results.append(run_case(cover, parameters, case))
        except (ValueError, ConvergenceError) as error:
            converged = not isinstance(error, ConvergenceError)
            skipped.append(Skipped(case=case, reason=str(error), converged=converged))
    if progress:
        progress(len(cases), len(cases), "")
    if not results:
        raise InputError(*(f"{each.case.name} ({each.case.shape}): {each.reason}" for each in skipped))
    return summarise(results, skipped)


def run_case(cover: Cover, parameters: Parameters, case: Case) -> CaseResult:
    """Press one case by both models and score the fast one and the null models."""
    from fastmodel import indent
    from fem_reference.indentation.press import press

    array = parameters.array
    reference = press(cover, array, case.indenter, load=case.load, at=case.at, yaw=case.yaw)
    fast, area, boxes = (
        indent(parameters, case.indenter, load=case.load, at=case.at, yaw=case.yaw, method=method)
        for method in ("default", "area", "boxes")
    )
    forces = {
        "fast": (fast.texel_forces, fast.outside),
        "area": (area.texel_forces, area.outside),
        "boxes": (boxes.texel_forces, boxes.outside),
        "no-spread": (np.where(array.active, boxes.contact_forces, 0.0), 0.0),
        "zeros": (np.zeros(array.count), 0.0),
    }
    predictions = {
        name: score_forces(reference, texel_forces, outside, case.load, array)
        for name, (texel_forces, outside) in forces.items()
    }
    return CaseResult(case=case, reference=reference, fast=fast, predictions=predictions)


def score_forces(
    reference: Indentation, texel_forces: FloatArray, outside: float, load: float, array: TexelArray
) -> Prediction:
    """Score texel forces against a reference indentation."""
    result = score(
        reference.texel_forces,
        texel_forces,
        reference_outside=reference.outside,
        outside=outside,
        load=load,
        array=array,
    )
    return Prediction(texel_forces=texel_forces, outside=outside, score=result)


def summarise(results: Sequence[CaseResult], skipped: Sequence[Skipped] = ()) -> CampaignResult:
    """Pool scores over cases."""

    def column(model: str, metric: str) -> list[float]:
        return [float(getattr(result.predictions[model].score, metric)) for result in results]

    own = column("fast", "misplaced_force")
    keys = results[0].reference.error_estimate
    return CampaignResult(
        cases=tuple(results),
        skipped=tuple(skipped),
        pooled={model: {metric: pool(column(model, metric)) for metric in POOLED_METRICS} for model in MODELS},
        skill={model: skill(own, column(model, "misplaced_force")) for model in MODELS if model != "fast"},
        noise_floor={key: float(np.mean([result.reference.error_estimate[key] for result in results])) for key in keys},
    )


def _case_json(result: CaseResult) -> dict[str, Any]:
    case, reference = result.case, result.reference
    return {
        "name": case.name,
        "indenter": case.shape,
        "load": case.load,
        "at": list(case.at),
        "yaw": case.yaw,
        "reference": {
            "texel_forces": reference.texel_forces,
            "outside": reference.outside,
            "total_force": reference.total_force,
            "depth": reference.depth,
            "contact_area": reference.contact_area,
            "error_estimate": dict(reference.error_estimate),
            "assumptions": dict(reference.assumptions),
            "seconds": reference.seconds,
        },
        "models": {
            name: {
                "texel_forces": prediction.texel_forces,
                "outside": prediction.outside,
                "scores": prediction.score.as_json(),
            }
            for name, prediction in result.predictions.items()
        },
    }
