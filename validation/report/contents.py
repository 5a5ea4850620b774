"""Contents of the report's page, for its template: numbers, text, images and figures."""

from __future__ import annotations

import dataclasses
from datetime import UTC, datetime
from typing import Any

import numpy as np

from fastmodel.signal.electronics import describe_calibration
from validation.campaign.evaluation import Evaluation
from validation.campaign.metric_text import METRICS
from validation.campaign.pooling import Pooled
from validation.campaign.results import MODELS, CaseResult
from validation.data_sets.score import RecordingScores
from validation.derivation.derive import Derivation
from validation.json_values import json_text
from validation.report.comparison import comparison_contents
from validation.report.figures import campaign_figure, point_spread_figure, texel_profile_figure
from validation.report.recordings import best_null, recordings_contents
from validation.report.tactile_image import FloatArray, Scale, colour_bar, tactile_image

#: Name of the division of the recordings into fitted and scored weights whose score is shown at the top of the page:
#: the parameters are fitted to light weights and scored on heavy ones.  This extrapolation separates a model from a
#: mere table of values.
_TILE_SPLIT = "heavier"


def contents(evaluation: Evaluation) -> dict[str, Any]:
    """Return all variables that the template of the page uses, by name.

    Args:
        evaluation: The results to show.
    """
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
        "calibration": describe_calibration(derivation.parameters.electronics),
        "models": MODELS,
        "metrics": METRICS,
        "comparison": comparison_contents(campaign),
        "tiles": _tiles(evaluation),
        "psf_images": _psf_images(derivation),
        "estimates": sorted(derivation.fit.estimates.items(), key=lambda item: item[0] != derivation.fit.estimator),
        "recordings": None
        if evaluation.recordings is None
        else recordings_contents(evaluation.recordings, evaluation.recorded.array),
        "cases": [_case(evaluation, result) for result in campaign.cases],
        "percent": lambda value, digits=2: f"{100 * value:.{digits}g}",
        # The figures' data stand in a script element of the page; a text "</" in the data would end this element.
        "figures": json_text(figures, indent=None).replace("</", "<\\/"),
    }


def _tiles(evaluation: Evaluation) -> list[dict[str, str]]:
    campaign, derivation = evaluation.campaign, evaluation.derivation
    fast = campaign.pooled["fast"]
    null = campaign.skill["no-spread"]
    tiles = [
        {
            "value": f"{100 * fast['misplaced_force'].mean:.3g} %",
            "name": "of the load misplaced",
            "small": f"fast model, {len(campaign.cases)} cases, {_interval(fast['misplaced_force'], 100)}",
        },
        {
            "value": f"{fast['image_changed_percent'].mean:.3g} %",
            "name": "image changed",
            "small": f"{_interval(fast['image_changed_percent'], 1)}; an empty image has "
            f"{campaign.pooled['zeros']['image_changed_percent'].mean:.3g} %",
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
    if evaluation.recordings is not None and any(row.split == _TILE_SPLIT for row in evaluation.recordings.rows):
        tiles.append(_recordings_tile(evaluation.recordings))
    return tiles


def _recordings_tile(scores: RecordingScores) -> dict[str, str]:
    fast = scores.row(_TILE_SPLIT, "fast model").pooled["image_changed_percent"]
    null = best_null(scores, _TILE_SPLIT)
    return {
        "value": f"{fast.mean:.3g} %",
        "name": "image changed, recordings",
        "small": f"light weights to heavy ones, no gains per texel; the best null model "
        f"({null.model}) has {null.pooled['image_changed_percent'].mean:.3g} %",
    }


def _psf_images(derivation: Derivation) -> dict[str, Any]:
    """Draw images of the texel forces under a point load and a uniform load, of the fitted kernel, and of the error.

    The error is the difference of the fitted kernel and the response to the uniform load.
    """
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
        "case": case,
        "reference": reference,
        "images": images,
        "bars": colour_bar(force) + colour_bar(apart),
        "score": fast.score.as_json(),
        "bare": bare.score.as_json(),
        "lit": fast.score.pixels_lit_line,
    }


def _contact_outline(contact: FloatArray) -> FloatArray:
    """Return the corners (x, y) of the convex hull of the cells of the contact grid that are in contact [m].

    Args:
        contact: One row per cell in contact; the first two columns are its x and y [m].
    """
    from scipy.spatial import ConvexHull, QhullError

    points = contact[:, :2]
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # fewer than three cells in contact, or all of them on one line
        return points


def _interval(value: Pooled, factor: float, digits: int = 3) -> str:
    return f"95 % interval {factor * value.low:.{digits}g}…{factor * value.high:.{digits}g}"
