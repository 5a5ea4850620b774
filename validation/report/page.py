"""The report's page: tiles, images and notes for its template, and the tables of `validation.report.tables`."""

from __future__ import annotations

import dataclasses
import math
from collections import defaultdict
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

from fastmodel.signal.electronics import describe_calibration
from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.campaign.evaluation import Evaluation
from validation.campaign.results import CaseResult, Pooled, describe_reference_error, name_texel_error
from validation.data_sets.results import RecordingExample, RecordingScores, find_best_null
from validation.data_sets.score import FAST
from validation.derivation.base import Derivation
from validation.json_values import json_text
from validation.metrics import TABULATED
from validation.render.image import Scale, colour_bar, tactile_image
from validation.report import tables
from validation.report.figures import Pictures, campaign_figure, find_outline, plot_responses

#: Name of the division of the recordings into fitted and scored weights whose score is shown at the top of the page:
#: the parameters are fitted to light weights and scored on heavy ones.  This extrapolation separates a model from a
#: mere table of values.
_TILE_SPLIT = "heavier"
#: Models whose images are shown next to the recorded image; the image of the best null model follows them.
_SHOWN = (FAST, f"{FAST}, texel gains", "reference, texel gains")


def contents(evaluation: Evaluation, pictures: Pictures) -> dict[str, Any]:
    """Return all variables that the template of the page uses, by name.

    Args:
        evaluation: The results to show.
        pictures: Pictures of the cases in three dimensions.
    """
    campaign, derivation, evidence = evaluation.campaign, evaluation.derivation, evaluation.evidence
    plots = plot_responses(derivation)
    drawn = {"campaign-plot": campaign_figure(campaign)} | {name: plot.to_plotly() for name, plot in plots.items()}
    return {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "sensor": evaluation.sensor,
        "evaluation": evaluation,
        "derivation": derivation,
        "result": derivation.result,
        "campaign": campaign,
        "verdict": evaluation.verdict,
        "plan": evaluation.plan,
        "evidence": evidence,
        # A section without a note, or without a table, shows none.
        "notes": defaultdict(str, evidence.notes),
        "tables": defaultdict(lambda: None, tables.list_tables(evaluation)),
        "calibration": describe_calibration(derivation.parameters.electronics),
        "metrics": TABULATED,
        "comparison": tables.describe_comparison(campaign),
        "tiles": list(_list_tiles(evaluation)),
        "maps": _draw_maps(derivation),
        "cases": [_show_case(evaluation, result, pictures) for result in campaign.cases],
        "missing_pictures": pictures.missing,
        "input_list": tables.list_inputs(evidence),
        "limits": tables.name_limits(evidence),
        "splits": _show_splits(evaluation.recordings, evaluation.recorded.array) if evaluation.recordings else [],
        "plots": {name: plot.caption for name, plot in plots.items()},
        "reference_error": describe_reference_error(campaign),
        "percent": lambda value, digits=2: "\u2013" if math.isnan(value) else f"{100 * value:.{digits}g}",
        # The figures' data stand in a script element of the page; a text "</" in the data would end this element.
        "figures": json_text(drawn, indent=None).replace("</", "<\\/"),
    }


def _list_tiles(evaluation: Evaluation) -> Any:  # noqa: ANN401 -- yields texts by name
    campaign, scores = evaluation.campaign, evaluation.recordings
    fast, empty = campaign.pooled["fast"], campaign.pooled["zeros"]["image_changed_percent"]
    misplaced, changed = fast["misplaced_force"], fast["image_changed_percent"]
    null, floor = campaign.skill["no-spread"], campaign.reference_error

    def tile(value: str, name: str, small: str) -> dict[str, str]:
        return {"value": value, "name": name, "small": small}

    found = f"fast model, {len(campaign.cases)} cases, {_interval(misplaced, 100)}"
    yield tile(f"{100 * misplaced.mean:.3g} %", "of the load misplaced", found)
    than = f"{_interval(changed, 1)}; an empty image has {empty.mean:.3g} %"
    yield tile(f"{changed.mean:.3g} %", "image changed", than)
    yield tile(
        f"{100 * null.mean:.0f} %", "better than no spread", f"skill in misplaced force, {_interval(null, 100, 2)}"
    )
    yield tile(f"{1e3 * evaluation.derivation.sigma:.3g}", "sigma [mm]", "least squares to a uniform texel load")
    what = f"estimate, share of {name_texel_error(campaign.noise_floor)}; mean over cases: the noise floor"
    yield tile("unknown" if math.isnan(floor) else f"{100 * floor:.2g} %", "reference error", what)
    if scores is not None and any(row.split == _TILE_SPLIT for row in scores.rows):
        image = scores.row(_TILE_SPLIT, "fast model").pooled["image_changed_percent"]
        best = find_best_null([row for row in scores.rows if row.split == _TILE_SPLIT])
        other = f"({best.model}) has {best.pooled['image_changed_percent'].mean:.3g} %"
        small = f"light weights to heavy ones, no gains per texel; the best null model {other}"
        yield tile(f"{image.mean:.3g} %", "image changed, recordings", small)


def _interval(value: Pooled, factor: float, digits: int = 3) -> str:
    return f"95 % interval {factor * value.low:.{digits}g}\u2026{factor * value.high:.{digits}g}"


def _draw_maps(derivation: Derivation) -> dict[str, Any]:
    """Draw the responses to a load on one texel; those that are no difference have the scale of the uniform load."""
    array, (uniform, _, difference) = derivation.sensor.array, derivation.maps[-3:]
    force = Scale(peak=float(uniform.values.max()), unit="% of the load", factor=100)
    apart = dataclasses.replace(force, peak=float(np.abs(difference.values).max()), difference=True)
    images = [
        (each.caption, tactile_image(array, each.values, apart if each.is_difference else force, name=each.caption))
        for each in derivation.maps
    ]
    return {"images": images, "bars": colour_bar(force) + colour_bar(apart)}


def _show_case(evaluation: Evaluation, result: CaseResult, pictures: Pictures) -> dict[str, Any]:
    array, case, reference = evaluation.sensor.array, result.case, result.reference
    fast = result.predictions["fast"].texel_forces
    force = Scale(peak=float(max(reference.texel_forces.max(), fast.max())))
    apart = Scale(peak=float(np.abs(fast - reference.texel_forces).max()), difference=True)
    shown: tuple[tuple[str, FloatArray, Scale, FloatArray | None], ...] = (
        ("reference", reference.texel_forces, force, find_outline(evaluation.derivation, result)),
        ("fast", fast, force, None),
        ("fast \u2212 reference", fast - reference.texel_forces, apart, None),
    )
    return {
        "case": case,
        "images": [
            (caption, tactile_image(array, values, scale, outline=line, name=f"{case.name}, {caption}, forces"))
            for caption, values, scale, line in shown
        ],
        "bars": colour_bar(force) + colour_bar(apart),
        "picture": pictures.files.get(case.name),
        "misplaced": TABULATED["misplaced_force"].text(result.predictions["fast"].score.misplaced_force),
    }


def _show_splits(scores: RecordingScores, array: TexelArray) -> list[dict[str, Any]]:
    """Return tables and images for each division of the recordings into fitted and scored recordings."""
    out = []
    for split in dict.fromkeys(row.split for row in scores.rows):
        rows = [row for row in scores.rows if row.split == split]
        null = find_best_null(rows).model
        example = next(example for example in scores.examples if example.split == split)
        parameters: Mapping[str, Any] = {
            FAST + (", texel gains" if row.texel_gains else ""): row.parameters for row in rows if row.model == FAST
        }
        out.append(
            {
                "name": split,
                "table": tables.tabulate_recordings(split, rows, null),
                "null": null,
                "notes": scores.notes.get(split, ()),
                "fitted": ", ".join(next((row.fitted for row in rows if row.fitted), ())),
                "scored": ", ".join(rows[0].per_case),
                "example": example,
                "images": _draw_example(example, array, (*_SHOWN, null)),
                "parameters": parameters,
            }
        )
    return out


def _draw_example(example: RecordingExample, array: TexelArray, names: tuple[str, ...]) -> dict[str, Any]:
    """Draw the recorded image, and those of the named models with their differences from it, in grey levels."""
    recorded = example.recorded.astype(np.float64).ravel()
    shown = {name: example.predicted[name].astype(np.float64).ravel() for name in names if name in example.predicted}
    peak = max(float(each.max()) for each in (recorded, *shown.values()))
    grey = Scale(peak=peak, unit="grey", factor=1)
    largest = max(float(np.abs(each - recorded).max()) for each in shown.values())
    apart = dataclasses.replace(grey, peak=largest, difference=True)
    images: list[tuple[str, str, str | None]] = [("recorded", tactile_image(array, recorded, grey), None)]
    for name, values in shown.items():
        images.append((name, tactile_image(array, values, grey), tactile_image(array, values - recorded, apart)))
    return {"images": images, "bars": colour_bar(grey) + colour_bar(apart)}
