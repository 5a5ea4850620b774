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
from validation.campaign.results import MODELS, CampaignResult, CaseResult
from validation.data_sets.score import RecordingScores
from validation.derivation.derive import Derivation
from validation.json_values import json_text
from validation.report.comparison import comparison_contents
from validation.report.evidence import evidence_contents
from validation.report.figures import campaign_figure, point_spread_figure, texel_profile_figure
from validation.report.page_table import Cell, PageTable, head, interval, number
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
        "metrics": METRICS,
        "comparison": comparison_contents(campaign),
        "tiles": _tiles(evaluation),
        "verdict": evaluation.verdict,
        "plan": evaluation.plan,
        "validity": derivation.parameters.validity,
        "evidence": evidence_contents(evaluation),
        "pooled": _tabulate_models(campaign),
        "case_table": _tabulate_cases(campaign),
        "psf_images": _psf_images(derivation),
        "estimates": _tabulate_estimates(derivation),
        "recordings": None
        if evaluation.recordings is None
        else recordings_contents(evaluation.recordings, evaluation.recorded.array),
        "cases": [_case(evaluation, result) for result in campaign.cases],
        "percent": lambda value, digits=2: f"{100 * value:.{digits}g}",
        # The figures' data stand in a script element of the page; a text "</" in the data would end this element.
        "figures": json_text(figures, indent=None).replace("</", "<\\/"),
    }


def _tabulate_estimates(derivation: Derivation) -> PageTable:
    used = derivation.fit.estimator
    pairs = sorted(derivation.fit.estimates.items(), key=lambda item: item[0] != used)
    return PageTable(
        name="estimates",
        caption="Sigma by estimator: the value depends on how it is estimated",
        headings=("estimator", "sigma x [pitches]", "sigma y [pitches]"),
        rows=[
            [Cell(text=name, small="used" if name == used else ""), *(number(value, 1, 4) for value in pair)]
            for name, pair in pairs
        ],
    )


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
        "images": [(caption, tactile_image(array, values, scale, name=caption)) for caption, values, scale in images],
        "bars": colour_bar(force) + colour_bar(apart),
    }


def _case(evaluation: Evaluation, result: CaseResult) -> dict[str, Any]:
    array, case, reference = evaluation.sensor.array, result.case, result.reference
    fast = result.predictions["fast"]
    difference = fast.texel_forces - reference.texel_forces
    force = Scale(peak=float(max(reference.texel_forces.max(), fast.texel_forces.max())))
    apart = Scale(peak=float(np.abs(difference).max()), difference=True)
    outline = _contact_outline(reference.contact)
    images = [
        (caption, tactile_image(array, values, scale, outline=line, name=f"{case.name}, {caption}, forces"))
        for caption, values, scale, line in (
            ("reference", reference.texel_forces, force, outline),
            ("fast", fast.texel_forces, force, None),
            ("fast \u2212 reference", difference, apart, None),
        )
    ]
    return {
        "case": case,
        "images": images,
        "bars": colour_bar(force) + colour_bar(apart),
        "misplaced": METRICS["misplaced_force"].text(fast.score.misplaced_force),
    }


def _tabulate_models(campaign: CampaignResult) -> PageTable:
    rows = [
        [
            Cell(text=name, small=meaning),
            *(interval(campaign.pooled[name][metric], METRICS[metric]) for metric in METRICS),
        ]
        for name, meaning in MODELS.items()
    ]
    return PageTable(
        name="pooled",
        caption=f"Our models and the null models against finite elements: means and 95 % intervals over "
        f"{len(campaign.cases)} cases",
        headings=("model", *map(head, METRICS.values())),
        rows=rows,
    )


def _tabulate_cases(campaign: CampaignResult) -> PageTable:
    rows = []
    for result in campaign.cases:
        fast, reference = result.predictions["fast"].score, result.reference
        scores = [Cell(text=METRICS[name].text(getattr(fast, name)), value=getattr(fast, name)) for name in METRICS]
        scores = [each if each.value == each.value else Cell(text=each.text) for each in scores]
        rows.append(
            [
                Cell(text=result.case.name, small=f"{result.case.shape} at {result.case.pose}"),
                number(result.case.load),
                *scores,
                number(result.predictions["no-spread"].score.misplaced_force, 100),
                Cell(text=str(fast.pixels_lit_line), value=fast.pixels_lit_line),
                number(reference.depth, 1e3),
                number(reference.error_estimate["peak_texel"], 100, 2),
            ]
        )
    return PageTable(
        name="case-table",
        caption="Fast model against the reference, case by case",
        headings=(
            "case",
            "load [N]",
            *map(head, METRICS.values()),
            "no spread, misplaced [%]",
            "texels lit after the WTS line",
            "depth of the reference [mm]",
            "peak error of the reference [%]",
        ),
        rows=rows,
    )


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
