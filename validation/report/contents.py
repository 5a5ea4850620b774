"""What the page shows, ready for the template: numbers as text with their sort value, images, figures."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

from validation.calibration.stamp import StampScores
from validation.campaign.evaluation import Evaluation
from validation.campaign.pooling import Pooled
from validation.campaign.run import MODELS, POOLED_METRICS, CampaignResult, CaseResult
from validation.derivation.derive import Derivation
from validation.json_values import json_text
from validation.report.figures import campaign_figure, point_spread_figure, texel_profile_figure
from validation.report.recordings import best_null, recordings_contents
from validation.report.tactile_image import Outline, Scale, colour_bar, tactile_image


@dataclasses.dataclass(frozen=True, kw_only=True)
class Metric:
    """How a metric is shown: heading, factor from SI or fraction, unit, decimals, what it means."""

    heading: str
    factor: float
    unit: str
    meaning: str
    decimals: int = 1

    def text(self, value: float | None) -> str:
        """The number as shown; a dash where it does not exist."""
        return "\u2013" if value is None or math.isnan(value) else f"{self.factor * value:.{self.decimals}f}"


#: The split of the recordings that tells a model from a table.
_HARD = "heavier"

METRICS: Mapping[str, Metric] = {
    "misplaced_force": Metric(
        heading="misplaced force", factor=100, unit="%", meaning="share of the load that would have to be moved"
    ),
    "relative_l2": Metric(
        heading="relative L2", factor=100, unit="%", meaning="norm of the difference over the reference's"
    ),
    "total_force_error": Metric(
        heading="total force",
        factor=100,
        unit="%",
        meaning="difference of the measured totals over the load",
        decimals=2,
    ),
    "peak_error": Metric(
        heading="peak", factor=100, unit="%", meaning="difference of the largest texels over the reference's"
    ),
    "centre_of_pressure_m": Metric(
        heading="centre of pressure",
        factor=1e3,
        unit="mm",
        meaning="distance between the centres of pressure",
        decimals=3,
    ),
    "wasserstein_m": Metric(
        heading="Wasserstein-1",
        factor=1e3,
        unit="mm",
        meaning="mean distance that force would have to travel",
        decimals=3,
    ),
    "image_changed_percent": Metric(
        heading="image changed",
        factor=1,
        unit="%",
        meaning="mean grey difference over 255, white = the case's peak",
        decimals=2,
    ),
    "image_changed_line_percent": Metric(
        heading="image changed, WTS line", factor=1, unit="%", meaning="the same through the published line", decimals=2
    ),
    "pixels_changed": Metric(
        heading="pixels changed", factor=1, unit="", meaning="texels whose grey level differs", decimals=0
    ),
}


def contents(evaluation: Evaluation) -> dict[str, Any]:
    """Everything the template reads."""
    campaign, derivation = evaluation.campaign, evaluation.derivation
    figures = {
        "psf-plot": point_spread_figure(derivation),
        "texel-plot": texel_profile_figure(derivation),
        "campaign-plot": campaign_figure(campaign),
    }
    return {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "sensor": evaluation.sensor,
        "evaluation": evaluation,
        "derivation": derivation,
        "gaussian": derivation.fit.gaussian,
        "campaign": campaign,
        "models": MODELS,
        "metrics": METRICS,
        "tiles": _tiles(evaluation),
        "psf_images": _psf_images(derivation),
        "estimates": sorted(derivation.fit.estimates.items(), key=lambda item: item[0] != derivation.fit.estimator),
        "pooled": _pooled(campaign),
        "recordings": None
        if evaluation.recordings is None
        else recordings_contents(evaluation.recordings, evaluation.recorded.array),
        "cases": [_case(evaluation, result) for result in campaign.cases],
        "percent": lambda value, digits=2: f"{100 * value:.{digits}g}",
        # Inside a script element only "</" could end the data early.
        "figures": json_text(figures, indent=None).replace("</", "<\\/"),
    }


def _tiles(evaluation: Evaluation) -> list[dict[str, str]]:
    campaign, derivation = evaluation.campaign, evaluation.derivation
    fast = campaign.pooled["fast"]
    null = campaign.skill["no-spread"]
    tiles = [
        {
            "value": _interval_mean(fast["misplaced_force"], 100, " %"),
            "name": "of the load misplaced",
            "small": f"fast model, {len(campaign.cases)} cases, {_interval(fast['misplaced_force'], 100)}",
        },
        {
            "value": _interval_mean(fast["image_changed_percent"], 1, " %"),
            "name": "image changed",
            "small": f"{_interval(fast['image_changed_percent'], 1)}; an empty image scores "
            f"{campaign.pooled['zeros']['image_changed_percent'].mean:.3g}",
        },
        {
            "value": f"{100 * null.mean:.0f} %",
            "name": "better than no spread",
            "small": f"skill in misplaced force, {_interval(null, 100, 2)}",
        },
        {
            "value": f"{derivation.fit.gaussian.sigma_x:.3f}",
            "name": "sigma [pitches]",
            "small": f"{1e3 * derivation.fit.gaussian.sigma_x * derivation.sensor.array.pitch[0]:.2f} mm, "
            "least squares to a uniform texel load",
        },
        {
            "value": f"{100 * campaign.noise_floor['peak_texel']:.2g} %",
            "name": "reference error",
            "small": "estimate for the peak texel, mean over cases: the noise floor",
        },
    ]
    if evaluation.recordings is not None and any(row.split == _HARD for row in evaluation.recordings.rows):
        tiles.append(_recordings_tile(evaluation.recordings))
    return tiles


def _recordings_tile(scores: StampScores) -> dict[str, str]:
    fast = scores.row(_HARD, "fast model").pooled["image_changed_percent"]
    null = best_null(scores, _HARD)
    return {
        "value": f"{fast.mean:.3g} %",
        "name": "image changed, recordings",
        "small": f"light weights to heavy ones, nothing per texel fitted; the best null model "
        f"({null.model}) scores {null.pooled['image_changed_percent'].mean:.3g}",
    }


def _psf_images(derivation: Derivation) -> dict[str, Any]:
    """Reference responses, fitted kernel and what is left, as images."""
    array, gaussian = derivation.sensor.array, derivation.fit.gaussian
    kernel = gaussian.operator(array)[:, array.middle]
    uniform = derivation.texel_response_uniform.ravel()
    force = Scale(peak=float(uniform.max()), unit="% of the load", factor=100)
    apart = dataclasses.replace(force, peak=float(np.abs(kernel - uniform).max()), difference=True)
    images = (
        ("point load", derivation.texel_response.ravel(), force),
        ("uniform load", uniform, force),
        ("fitted kernel", kernel, force),
        ("kernel \u2212 uniform", kernel - uniform, apart),
    )
    return {
        "images": [(caption, tactile_image(array, values, scale)) for caption, values, scale in images],
        "bars": colour_bar(force) + colour_bar(apart),
    }


def _case(evaluation: Evaluation, result: CaseResult) -> dict[str, Any]:
    array, case, reference = evaluation.sensor.array, result.case, result.reference
    fast, bare = result.predictions["fast"], result.predictions["no-spread"]
    difference = fast.texel_forces - reference.texel_forces
    force = Scale(peak=float(max(reference.texel_forces.max(), fast.texel_forces.max())))
    apart = Scale(peak=float(np.abs(difference).max()), difference=True)
    outline = _contact_outline(reference.contact)
    images = [
        ("reference", tactile_image(array, reference.texel_forces, force, outline=outline)),
        ("fast", tactile_image(array, fast.texel_forces, force)),
        ("fast \u2212 reference", tactile_image(array, difference, apart)),
    ]
    return {
        "name": case.name,
        "shape": case.shape,
        "load": case.load,
        "pose": case.pose,
        "images": images,
        "bars": colour_bar(force) + colour_bar(apart),
        "score": fast.score.as_json(),
        "bare": bare.score.as_json(),
        "depth": reference.depth,
        "area": reference.contact_area,
        "errors": reference.error_estimate,
        "lit": fast.score.pixels_lit_line,
    }


def _contact_outline(contact: np.ndarray[Any, np.dtype[np.float64]]) -> Outline:
    """The convex hull of the cells that touch."""
    from scipy.spatial import ConvexHull, QhullError

    points = contact[:, :2]
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):  # fewer than three cells, or all on one line
        corners = points
    return Outline(x=corners[:, 0], y=corners[:, 1])


def _pooled(campaign: CampaignResult) -> list[dict[str, Any]]:
    return [
        {
            "model": model,
            "meaning": meaning,
            "values": [(campaign.pooled[model][name], METRICS[name]) for name in POOLED_METRICS],
        }
        for model, meaning in MODELS.items()
    ]


def _interval_mean(value: Pooled, factor: float, unit: str) -> str:
    return f"{factor * value.mean:.3g}{unit}"


def _interval(value: Pooled, factor: float, digits: int = 3) -> str:
    return f"95 % interval {factor * value.low:.{digits}g}…{factor * value.high:.{digits}g}"
