"""Contents of the report's page, for its template: numbers, text, images and figures."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

from fastmodel.signal.electronics import describe_calibration
from meshes.array_types import FloatArray
from validation.campaign.evaluation import Evaluation
from validation.campaign.results import (
    CampaignResult,
    CaseResult,
    Pooled,
    describe_reference_error,
    name_texel_error,
    texel_error,
)
from validation.curved.derive import CurvedDerivation
from validation.data_sets.results import RecordingScores, find_best_null
from validation.derivation.derive import Derivation
from validation.json_values import json_text
from validation.metrics import TABULATED
from validation.render.image import Scale, colour_bar, tactile_image
from validation.render.table import Cell, Table, interval, number
from validation.report.comparison import comparison_contents
from validation.report.curved import Pictures, curved_contents
from validation.report.evidence import evidence_contents
from validation.report.figures import campaign_figure, point_spread_figure, texel_profile_figure
from validation.report.recordings import recordings_contents
from validation.results import Column

#: Name of the division of the recordings into fitted and scored weights whose score is shown at the top of the page:
#: the parameters are fitted to light weights and scored on heavy ones.  This extrapolation separates a model from a
#: mere table of values.
_TILE_SPLIT = "heavier"


def contents(evaluation: Evaluation, pictures: Pictures | None = None) -> dict[str, Any]:
    """Return all variables that the template of the page uses, by name.

    Args:
        evaluation: The results to show.
        pictures: Pictures of the cases on a curved cover.
    """
    campaign, derivation = evaluation.campaign, evaluation.derivation
    curved = isinstance(derivation, CurvedDerivation)
    # The published line of the WTS 0614-34 belongs to a planar array.
    shown = {name: metric for name, metric in TABULATED.items() if not (curved and name.endswith("line_percent"))}
    figures = {"campaign-plot": campaign_figure(campaign)}
    if isinstance(derivation, CurvedDerivation):
        special = curved_contents(evaluation, derivation, pictures or Pictures())
    else:
        special = _flat_contents(evaluation, derivation)
        figures["psf-plot"] = point_spread_figure(derivation)
        figures["texel-plot"] = texel_profile_figure(derivation)
    return special | {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "sensor": evaluation.sensor,
        "evaluation": evaluation,
        "derivation": derivation,
        "campaign": campaign,
        "calibration": describe_calibration(derivation.parameters.electronics),
        "metrics": shown,
        "comparison": comparison_contents(campaign),
        "tiles": _tiles(evaluation),
        "verdict": evaluation.verdict,
        "plan": evaluation.plan,
        "validity": derivation.parameters.validity,
        "evidence": evidence_contents(evaluation),
        "pooled": _tabulate_models(campaign, shown),
        "case_table": _tabulate_cases(campaign, shown, curved=curved),
        "recordings": None
        if evaluation.recordings is None
        else recordings_contents(evaluation.recordings, evaluation.recorded.array),
        "reference_error": describe_reference_error(campaign),
        "percent": lambda value, digits=2: "\u2013" if math.isnan(value) else f"{100 * value:.{digits}g}",
        # The figures' data stand in a script element of the page; a text "</" in the data would end this element.
        "figures": json_text(figures, indent=None).replace("</", "<\\/"),
    }


def _flat_contents(evaluation: Evaluation, derivation: Derivation) -> dict[str, Any]:
    """Return the variables that only a flat cover has."""
    return {
        "curved": None,
        "gaussian": derivation.fit.gaussian,
        "psf_images": _psf_images(derivation),
        "estimates": _tabulate_estimates(derivation),
        "cases": [_case(evaluation, result) for result in evaluation.campaign.cases],
    }


def _tabulate_estimates(derivation: Derivation) -> Table:
    used = derivation.fit.estimator
    pairs = sorted(derivation.fit.estimates.items(), key=lambda item: item[0] != used)
    return Table(
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
    null, floor = campaign.skill["no-spread"], campaign.reference_error
    tiles: list[dict[str, str]] = [
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
        _sigma_tile(derivation),
        {
            "value": "unknown" if math.isnan(floor) else f"{100 * floor:.2g} %",
            "name": "reference error",
            "small": f"estimate, share of {name_texel_error(campaign.noise_floor)}; mean over cases: the noise floor",
        },
    ]
    if evaluation.recordings is not None and any(row.split == _TILE_SPLIT for row in evaluation.recordings.rows):
        tiles.append(_recordings_tile(evaluation.recordings))
    return tiles


def _sigma_tile(derivation: Derivation | CurvedDerivation) -> dict[str, str]:
    if isinstance(derivation, CurvedDerivation):
        sigma = derivation.gaussian.sigma[0]
        small = "along the surface, least squares to uniform texel loads; the fast model does not use it"
        return {"value": f"{1e3 * sigma:.3g}", "name": "sigma [mm]", "small": small}
    sigma = derivation.fit.gaussian.sigma_x
    return {
        "value": f"{sigma:.3f}",
        "name": "sigma [pitches]",
        "small": f"{1e3 * sigma * derivation.sensor.array.pitch[0]:.2f} mm, least squares to a uniform texel load",
    }


def _recordings_tile(scores: RecordingScores) -> dict[str, str]:
    fast = scores.row(_TILE_SPLIT, "fast model").pooled["image_changed_percent"]
    null = find_best_null([row for row in scores.rows if row.split == _TILE_SPLIT])
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
    outline = _contact_outline(reference.found.contact)
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
        "misplaced": TABULATED["misplaced_force"].text(fast.score.misplaced_force),
    }


def _tabulate_models(campaign: CampaignResult, shown: Mapping[str, Column]) -> Table:
    rows = [
        [
            Cell(text=name, small=meaning),
            *(interval(campaign.pooled[name][key], metric) for key, metric in shown.items()),
        ]
        for name, meaning in campaign.models.items()
    ]
    return Table(
        name="pooled",
        caption=f"Our models and the null models against finite elements: means and 95 % intervals over "
        f"{len(campaign.cases)} cases",
        headings=("model", *(metric.title for metric in shown.values())),
        rows=rows,
    )


def _tabulate_cases(campaign: CampaignResult, shown: Mapping[str, Column], *, curved: bool) -> Table:
    rows = []
    for result in campaign.cases:
        fast, reference = result.predictions["fast"].score, result.reference
        scores = [Cell(text=each.text(getattr(fast, name)), value=getattr(fast, name)) for name, each in shown.items()]
        scores = [each if each.value == each.value else Cell(text=each.text) for each in scores]
        rows.append(
            [
                Cell(text=result.case.name, small=f"{result.case.shape} at {result.case.place}"),
                number(result.case.load),
                *scores,
                number(result.predictions["no-spread"].score.misplaced_force, 100),
                *([] if curved else [Cell(text=str(fast.pixels_lit_line), value=fast.pixels_lit_line)]),
                number(reference.depth, 1e3),
                number(texel_error(reference.error_estimate), 100, 2),
            ]
        )
    return Table(
        name="case-table",
        caption="Fast model against the reference, case by case",
        headings=(
            "case",
            "load [N]",
            *(metric.title for metric in shown.values()),
            "no spread, misplaced [%]",
            *([] if curved else ["texels lit after the WTS line"]),
            "depth of the reference [mm]",
            f"{'misplaced force, estimated error' if curved else 'peak error'} of the reference [%]",
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
