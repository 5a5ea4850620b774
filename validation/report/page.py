"""The report's page: content of its template, which are tables, tiles, images and notes.

The printed form of a table column is defined with the corresponding field of the result.
"""

from __future__ import annotations

import dataclasses
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from fastmodel.signal.electronics import describe_calibration
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray
from validation.campaign import results
from validation.campaign.evaluation import Evaluation, RecordingEvaluation
from validation.credibility.evidence import GROUP_METRICS, Evidence
from validation.credibility.stages import STAGES
from validation.credibility.uncertainty import ComparisonError, find_missing_range
from validation.credibility.verification import Check, Convergence
from validation.data_sets.results import CountScore, RecordingExample, RecordingRow, RecordingScores, find_difference
from validation.data_sets.score import FAST
from validation.derivation.base import Derivation
from validation.extras import REPORT_MODULES, require
from validation.json_values import json_text
from validation.metrics import METRICS, TABULATED
from validation.moving.results import MovingResult, MovingScore
from validation.pooling import Pooled
from validation.render.image import Scale, colour_bar, find_outline, spell_units, tactile_image
from validation.render.table import Cell, Table, interval, number, tabulate, tabulate_facts
from validation.report.figures import (
    Pictures,
    draw_campaign,
    draw_cases,
    draw_left_out,
    draw_moving,
    plot_responses,
    render_svg,
)
from validation.results import Column, columns
from validation.text.indenter import describe_indenter
from validation.verdict import SHOWN, Finding

#: Largest number of requirements on the first screen [-].
_FIRST = 8
#: Models whose images are shown next to the recorded image; the image of the best null model follows them.
_SHOWN = (FAST, f"{FAST}, texel gains", "reference, texel gains")


def contents(evaluation: RecordingEvaluation) -> dict[str, Any]:
    """Return the variables that every page of the report uses, by name.

    Args:
        evaluation: The results to show.
    """
    verdict, recordings = evaluation.verdict, evaluation.recordings
    # What is not met stands before the means; single cases that meet their limit are not on the first screen.
    others = [
        each for each in verdict.findings if each not in verdict.deciding and (each.status, each.cases) != ("met", 1)
    ]
    others.sort(key=lambda each: tuple(_STATUS).index(each.status))
    requirements = _tabulate_requirements(verdict.findings, "requirements")
    splits = (
        _show_splits(recordings, evaluation.recorded.array, evaluation.recorded.layered_cover) if recordings else []
    )
    return {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "sensor": evaluation.sensor,
        "evaluation": evaluation,
        "verdict": verdict,
        "campaign": None,
        "keys": [(_list_cells(each), _draw_limit(each)) for each in verdict.deciding],
        "doubts": [each for each in verdict.reasons if each not in {finding.text for finding in verdict.findings}],
        "first": _tabulate_requirements(others[:_FIRST], "first"),
        "tables": defaultdict(lambda: None, {requirements.name: requirements}),
        "splits": splits,
        "picture": _show_recorded(splits[0]) if splits else None,
    }


def _show_campaign(evaluation: Evaluation, pictures: Pictures) -> dict[str, Any]:
    """Return the variables that a page with a campaign uses besides `contents`, by name.

    Args:
        evaluation: The results to show.
        pictures: Pictures of the cases in three dimensions.
    """
    campaign, derivation, evidence = evaluation.campaign, evaluation.derivation, evaluation.evidence
    cases = [_show_case(evaluation, result, pictures) for result in campaign.cases]
    return {
        "derivation": derivation,
        "result": derivation.result,
        "campaign": campaign,
        "plan": evaluation.plan,
        "evidence": evidence,
        # A missing note or table has an empty value, for which the template shows nothing.
        "notes": defaultdict(str, evidence.notes),
        "tables": defaultdict(lambda: None, list_tables(evaluation)),
        "calibration": describe_calibration(derivation.parameters.electronics),
        "metrics": TABULATED,
        "comparison": describe_comparison(campaign),
        "picture": _show_worst(cases),
        "floor": _show_floor(campaign),
        "moving": [_show_moving(each, f"moving-{k}") for k, each in enumerate(evaluation.moving)],
        "maps": _draw_maps(derivation),
        "cases": cases,
        "missing_pictures": pictures.missing,
        "input_list": list_inputs(evidence),
        "limits": name_limits(evidence),
        "plots": {name: (text, render_svg(draw)) for name, (text, draw) in plot_responses(derivation).items()},
        "campaign_plot": render_svg(partial(draw_campaign, campaign)),
        "reference_error": results.describe_reference_error(campaign),
        "percent": lambda value, digits=2: "\u2013" if math.isnan(value) else f"{100 * value:.{digits}g}",
    }


def _show_moving(result: MovingResult, name: str) -> dict[str, Any]:
    """Return the variables of one moving case: its result, a table of scores, and a plot of the forces over time."""
    shown = [field for field in columns(MovingScore) if field != "case"]
    table = tabulate(name, result.name, result.scores, MovingScore, shown)
    return {"result": result, "table": table, "plot": render_svg(partial(draw_moving, result))}


def _show_worst(cases: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the picture of the first screen: the case with the largest misplaced force."""
    worst = max(cases, key=lambda each: float(np.nan_to_num(each["error"])))
    title = f"The largest error of {len(cases)} cases: {worst['case'].name} ({worst['bodies']})"
    return worst | {"title": f"{title}, {worst['misplaced']} % of {worst['case'].load:.3g} N misplaced"}


def _show_recorded(split: dict[str, Any]) -> dict[str, Any]:
    """Return the picture of the first screen without a campaign: a recorded image, and that of the fast model."""
    (recorded, first, _), (name, second, difference), *_ = split["images"]["images"]
    images = [(recorded, first), (name, second), (f"{name} \u2212 recorded", difference)]
    example = split["example"]
    return {"images": images, "bars": split["images"]["bars"], "title": f"{example.case}, {example.load:.2f} N"}


def _show_floor(campaign: results.CampaignResult) -> str:
    """Describe the misplaced force by the simplest model, and the reference's own error, beside the fast model's."""
    bare, own = 100 * campaign.pooled["no-spread"]["misplaced_force"].mean, results.describe_reference_error(campaign)
    return f"Without spread of the load the mean is {bare:.3g} %; the finite elements' own error is {own}."


def _draw_limit(finding: Finding) -> str:
    """Draw the value of a requirement with its interval on a line from zero, and the limit, as SVG."""
    end = 1.15 * max(finding.limit, np.nan_to_num(finding.high), np.nan_to_num(finding.value)) or 1.0
    low, high, value, limit = (
        f"{300 * min(max(np.nan_to_num(each) / end, 0.0), 1.0):.1f}"
        for each in (finding.low, finding.high, finding.value, finding.limit)
    )
    return (
        f'<svg class="limit" viewBox="0 0 300 18" aria-hidden="true"><path class="scale" d="M0 9H300"/>'
        f'<path class="interval" d="M{low} 9H{high}"/><circle cx="{value}" cy="9" r="5"/>'
        f'<path class="end" d="M{limit} 1V17"/></svg>'
    )


def _draw_maps(derivation: Derivation) -> dict[str, Any]:
    """Draw the responses of the texels to a load on one texel, and the error of the fitted kernel.

    All responses have one colour scale.  The last two are the reference under a uniform load and the fitted kernel.
    """
    array, maps = derivation.sensor.array, derivation.maps
    *_, uniform, kernel = maps.values()
    force = Scale(peak=float(uniform.max()), unit="% of the load", factor=100)
    apart = dataclasses.replace(force, peak=float(np.abs(kernel - uniform).max()), difference=True)
    difference = f"{list(maps)[-1]} \u2212 reference"
    images = [(caption, tactile_image(array, values, force, name=caption)) for caption, values in maps.items()]
    images.append((difference, tactile_image(array, kernel - uniform, apart, name=difference)))
    return {"images": images, "bars": colour_bar(force) + colour_bar(apart)}


def _show_case(evaluation: Evaluation, result: results.CaseResult, pictures: Pictures) -> dict[str, Any]:
    array, case, reference = evaluation.sensor.array, result.case, result.reference
    fast = result.predictions["fast"].texel_forces
    force = Scale(peak=float(max(reference.texel_forces.max(), fast.max())))
    apart = Scale(peak=float(np.abs(fast - reference.texel_forces).max()), difference=True)
    first = "finite elements" + ", with an outline around all bodies" * bool(case.others)
    shown: tuple[tuple[str, FloatArray, Scale, FloatArray | None], ...] = (
        (first, reference.texel_forces, force, find_outline(array, reference.found)),
        ("fast model", fast, force, None),
        ("difference", fast - reference.texel_forces, apart, None),
    )
    return {
        "case": case,
        "bodies": case.describe(describe_indenter),
        "images": [
            (caption, tactile_image(array, values, scale, outline=line, name=f"{case.name}, {caption}, forces"))
            for caption, values, scale, line in shown
        ],
        "bars": colour_bar(force) + colour_bar(apart),
        "picture": pictures.files.get(case.name),
        "error": (error := result.predictions["fast"].score.misplaced_force),
        "misplaced": TABULATED["misplaced_force"].text(error),
    }


def _show_splits(scores: RecordingScores, array: TexelArray, cover: Cover) -> list[dict[str, Any]]:
    """Return tables and images for each division of the recordings into fitted and scored recordings."""
    out = []
    for split in dict.fromkeys(row.split for row in scores.rows):
        rows = [row for row in scores.rows if row.split == split]
        own, best, _ = find_difference(rows)
        chosen = scores.left_out.get(split)
        null, fast, least = best.model, *(each.pooled["image_changed_percent"].mean for each in (own, best))
        example = next(example for example in scores.examples if example.split == split)
        parameters: Mapping[str, Any] = {
            FAST + (", texel gains" if row.texel_gains else ""): row.parameters for row in rows if row.model == FAST
        }
        out.append(
            {
                "name": split,
                "finding": f"image changed: fast model {fast:.3g} %, best null model {least:.3g} %",
                "table": tabulate_recordings(split, rows, null),
                "null": null,
                "notes": scores.notes.get(split, ()),
                "left_out": render_svg(partial(draw_left_out, chosen), 4, 2.2) if chosen else "",
                "errors": tabulate(
                    f"errors-{split.replace(' ', '-')}",
                    "Comparison error E = S - D of the fast model with texel gains S against recorded counts D",
                    scores.errors.get(split, ()),
                    ComparisonError,
                    (
                        "case",
                        "fast",
                        "reference",
                        "error",
                        "u_num",
                        "u_input",
                        "u_data",
                        "u_val",
                        "least_error",
                        "largest_error",
                        "resolved",
                    ),
                ),
                "missing": find_missing_range(cover),
                "fitted": ", ".join(next((row.fitted for row in rows if row.fitted), ())),
                "scored": ", ".join(rows[0].per_case),
                "example": example,
                "images": _draw_example(example, array, (*_SHOWN, null)),
                "parameters": parameters,
            }
        )
    return out


def _draw_example(example: RecordingExample, array: TexelArray, names: tuple[str, ...]) -> dict[str, Any]:
    """Draw a recorded tactile image, the images of the named models, and their differences from it, in grey levels."""
    recorded = example.recorded.astype(np.float64).ravel()
    shown = {name: example.predicted[name].astype(np.float64).ravel() for name in names if name in example.predicted}
    peak = max(float(each.max()) for each in (recorded, *shown.values()))
    grey = Scale(peak=peak, unit="grey", factor=1)
    largest = max(float(np.abs(each - recorded).max()) for each in shown.values())
    apart = dataclasses.replace(grey, peak=largest, difference=True)
    draw = partial(tactile_image, array, values_shown=False)
    images: list[tuple[str, str, str | None]] = [("recorded", draw(recorded, grey, name="recorded"), None)]
    for name, values in shown.items():
        difference = draw(values - recorded, apart, name=f"{name}, difference from the recorded image")
        images.append((name, draw(values, grey, name=name), difference))
    return {"images": images, "bars": colour_bar(grey) + colour_bar(apart)}


#: Printed words for the status of a requirement of the acceptance criterion, in the order of the first screen.
_STATUS = {"missed": "missed", "open": "not decided", "met": "met"}
#: Printed words for two kinds of rows in the table of recordings that are no models of the sensor: null models, such as
#: an image without force, and the difference between repeated recordings.
_KINDS = {"null": "null", "floor": "repeatability"}
#: Printed form of the ranges of the validated domain, by name of the quantity.
_RANGES = {
    "load_N": Column(heading="load", unit="N"),
    "depth_over_thickness": Column(
        heading="depth of the indenter over the thickness of the cover", unit="%", factor=100
    ),
    "contact_area_m2": Column(heading="contact area", unit="mm\u00b2", factor=1e6),
    "obliquity_rad": Column(
        heading="angle between the motion and the normal of the cover", unit="\u00b0", factor=math.degrees(1)
    ),
    "share_outside_array": Column(heading="share of the load that acts outside the array", unit="%", factor=100),
}
#: Factor to the printed unit of an uncertain input, and the printed unit, by the unit in the name of the input.
_INPUT_UNITS = {"relative": (100.0, " %"), "m": (1e3, " mm"), "rad": (math.degrees(1), "\u00b0"), "-": (1.0, "")}
#: Metrics in the table that compares published models with the fast model.
_COMPARED = (*results.SKILL_METRICS, "centre_of_pressure_m")


def list_tables(evaluation: Evaluation) -> dict[str, Table]:
    """Return the tables of the page by name; tables without rows are left out."""
    campaign, evidence = evaluation.campaign, evaluation.evidence
    found = (
        _tabulate_requirements(evaluation.verdict.findings, "requirements"),
        _tabulate_models(campaign),
        _tabulate_cases(campaign),
        _tabulate_published(campaign),
        tabulate(
            "codes",
            "Code verification: error against closed forms or a finer mesh on three grids, computed for this report",
            evidence.checks,
            Check,
            ("name", "errors", "order", "result", "passed"),
        ),
        tabulate(
            "solutions",
            "Solution verification: the reference on three grids",
            evidence.convergence,
            Convergence,
            ("case", "values", "result", "order", "estimate"),
        ),
        tabulate(
            "errors-table",
            "Comparison error E = S - D of the fast model S against the reference D, and validation uncertainty",
            evidence.errors,
            ComparisonError,
            ("case", "fast", "reference", "error", "u_num", "u_input", "u_data", "u_val", "resolved_here", "resolved"),
        ),
        _tabulate_inputs(evidence),
        _tabulate_stages(evidence),
        _tabulate_groups(evidence),
        Table(
            name="domain",
            caption="Range of the cases, where the validated domain ends",
            headings=("quantity", "smallest", "largest"),
            rows=[
                [Cell(text=_RANGES[name].title), *(number(end, _RANGES[name].factor) for end in ends)]
                for name, ends in evidence.domain.items()
            ],
        ),
        tabulate_facts(
            "responses", "Responses of the texels, and what is fitted to them", evaluation.derivation.result
        ),
    )
    return {each.name: each for each in found if each.rows}


def tabulate_scores(campaign: results.CampaignResult) -> Table:
    """Make a table with every metric of every model in every case, under their names and units in `report.json`."""
    rows: list[tuple[Cell | str, ...]] = [
        (
            result.case.name,
            Cell(text="", value=result.case.load),
            model,
            *(Cell(text="", value=getattr(prediction.score, metric)) for metric in METRICS),
        )
        for result in campaign.cases
        for model, prediction in result.predictions.items()
    ]
    return Table(("case", "load", "model", *METRICS), rows)


def _tabulate_requirements(findings: Sequence[Finding], name: str) -> Table:
    return Table(
        name=name,
        caption="Acceptance criterion: every requirement, what was found, and whether it is met",
        headings=("requirement", "found (95 % interval)", "at most", "margin", "status"),
        rows=[_list_cells(each) for each in findings],
        texts=(4,),
    )


def _list_cells(finding: Finding) -> list[Cell]:
    """Return the cells of a requirement: its metric, what was found, the limit, the margin and the status."""
    metric = SHOWN[finding.metric]
    unit, factor = metric.unit, metric.factor
    ends = f"{factor * finding.low:.3g} to {factor * finding.high:.3g} {unit}".strip()
    limit = f"{factor * finding.limit:.3g} {unit}".strip()
    return [
        Cell(text=metric.heading, small=finding.over),
        number(finding.value, factor, small="" if finding.low == finding.high else ends, unit=unit),
        Cell(text=limit, value=finding.limit),
        number(finding.margin, factor, unit=unit),
        Cell(text=_STATUS[finding.status], bold=finding.status != "met"),
    ]


def _tabulate_models(campaign: results.CampaignResult) -> Table:
    return Table(
        name="pooled",
        caption=f"Our models and the null models against finite elements: means and 95 % intervals over "
        f"{len(campaign.cases)} cases",
        headings=("model", *(metric.title for metric in TABULATED.values())),
        rows=[
            [Cell(text=name, small=meaning), *_average(campaign.pooled[name], TABULATED)]
            for name, meaning in campaign.models.items()
        ],
    )


def _average(pooled: Mapping[str, Pooled], shown: Mapping[str, Column]) -> Iterator[Cell]:
    return (interval(pooled[name], column) for name, column in shown.items())


def _tabulate_cases(campaign: results.CampaignResult) -> Table:
    rows = []
    for result in campaign.cases:
        fast, reference = result.predictions["fast"].score, result.reference
        rows.append(
            [
                Cell(text=result.case.name, small=result.case.describe(describe_indenter)),
                number(result.case.load),
                *(number(getattr(fast, name), column=column) for name, column in TABULATED.items()),
                number(result.predictions["no-spread"].score.misplaced_force, 100),
                Cell(text=str(fast.pixels_lit_line), value=fast.pixels_lit_line),
                number(reference.depth, 1e3),
                number(results.texel_error(reference.error_estimate), 100, 2),
            ]
        )
    return Table(
        name="case-table",
        caption="Fast model against the reference, case by case",
        headings=(
            "case",
            "load [N]",
            *(metric.title for metric in TABULATED.values()),
            "no spread, misplaced [%]",
            "texels lit after the WTS line",
            "depth of the reference [mm]",
            f"estimated error of the reference [% of {results.name_texel_error(campaign.noise_floor)}]",
        ),
        rows=rows,
    )


def _tabulate_published(campaign: results.CampaignResult) -> Table:
    """Tabulate parameters and mean scores of the models of this package and of the published ones.

    The table has no rows if no published model was scored.
    """
    kinds = {name: "null model" if text.startswith("null") else "ours" for name, text in campaign.models.items()}
    rows = [
        [
            Cell(text=f"{name} ({kinds[name]})", small=campaign.models[name]),
            Cell(text="\u2013", small="fitted: by the derivation alone"),
            *_average(pooled, {each: METRICS[each] for each in _COMPARED}),
        ]
        for name, pooled in campaign.pooled.items()
    ]
    rows += [
        [
            Cell(text=f"{row.title}, {row.variant}", small="; ".join(_describe_row(row))),
            Cell(text=_list_parameters(row) or "\u2013", small=f"fitted: {_list_fitted(row)}"),
            *_average(row.pooled, {each: METRICS[each] for each in _COMPARED}),
        ]
        for row in campaign.published
    ]
    return Table(
        name="comparison-table",
        caption="Published models, our own and the null models in the same cases under the same loads: means and 95 % "
        "intervals",
        headings=("model", "parameters and fit", *(METRICS[name].title for name in _COMPARED)),
        rows=rows if campaign.published else [],
        texts=(1,),
    )


def _describe_row(row: results.RowScores) -> Iterator[str]:
    yield row.contact
    yield row.rule
    yield f"sure of it: {row.certainty}"
    if row.total != "the load":
        yield f"sum: {row.total}"


def _list_parameters(row: results.RowScores) -> str:
    values = (
        f"{name.replace('_', ' ')} {value:.3g} {row.units.get(name, '')}" for name, value in row.parameters.items()
    )
    return ", ".join(value.strip() for value in values)


def _list_fitted(row: results.RowScores) -> str:
    names = ", ".join(name.replace("_", " ") for name in row.fitted)
    return f"{names}, on {len(row.fitted_on)} presses" if names else "nothing"


def describe_comparison(campaign: results.CampaignResult) -> dict[str, Any]:
    """Describe the comparison with published models, for sentences on the page.

    A model counts as equally good if the interval of the fast model's skill against it includes zero, or if the cases
    are too few to tell.

    Returns:
        `presses` names the presses to which the published models are fitted; `as_good` lists by metric the models that
        are at least as good as the fast model; `not_built` names by model what is not implemented.
    """
    as_good: dict[str, list[str]] = {METRICS[metric].heading: [] for metric in results.SKILL_METRICS}
    for row in campaign.published:
        for metric in results.SKILL_METRICS:
            found = row.skill[metric]
            if found.few or not found.low > 0:
                word = "better" if found.high < 0 and not found.few else "not told apart"
                as_good[METRICS[metric].heading].append(f"{row.title} {row.variant} ({word})")
    return {
        "presses": next((row.fitted_on for row in campaign.published if row.fitted_on), ()),
        "as_good": as_good,
        "not_built": {row.title: row.not_built for row in campaign.published if row.not_built},
    }


def _tabulate_inputs(evidence: Evidence) -> Table:
    names = list(dict.fromkeys(name for each in evidence.inputs.values() for name in each.misplaced))
    return Table(
        name="inputs",
        caption="Input uncertainty: misplaced force [% of the load] by one standard uncertainty of each input, and all",
        headings=("case", *(name.split(" [")[0] for name in names), "all, in quadrature"),
        rows=[
            [
                Cell(text=case),
                *(number(each.misplaced.get(name), 100, 2) for name in names),
                number(each.misplaced_total, 100, 2),
            ]
            for case, each in evidence.inputs.items()
        ],
    )


def _tabulate_stages(evidence: Evidence) -> Table:
    rows = []
    if (stages := evidence.stages) is not None:
        for stage, what in STAGES.items():
            worst, errors = max(stages.cases.items(), key=lambda item: item[1][stage])
            mean = interval(stages.pooled[stage], METRICS["misplaced_force"])
            rows.append([Cell(text=stage, small=what), mean, number(errors[stage], 100, 2, small=worst)])
    return Table(
        name="stages",
        caption="Score by stage: misplaced force [% of the load] when one part of the reference is replaced",
        headings=("stage", "mean over the cases", "largest"),
        rows=rows,
    )


def _tabulate_groups(evidence: Evidence) -> Table:
    shown = {name: METRICS[name] for name in GROUP_METRICS}
    rows = []
    for group, members in evidence.groups.items():
        for member, metrics in members.items():
            count = metrics[GROUP_METRICS[0]].cases
            rows.append([Cell(text=member, small=group), Cell(text=str(count), value=count), *_average(metrics, shown)])
    *first, last = evidence.groups
    return Table(
        name="groups",
        caption=f"Error of the fast model by {', '.join(first)} and {last}: means and 95 % intervals",
        headings=("group", "cases", *(column.title for column in shown.values())),
        rows=rows,
    )


def tabulate_recordings(split: str, rows: Sequence[RecordingRow], null: str) -> Table:
    """Tabulate the scores of the models on the recordings of one split.

    Args:
        split: Name of the division of the recordings into fitted and scored ones.
        rows: Scores of the models in this split.
        null: Name of the best null model, against which the skill of the models is stated.
    """
    shown, skill = columns(CountScore), Column(heading="skill", decimals=2)
    return Table(
        name=f"recordings-{split.replace(' ', '-')}",
        caption="Models on recordings that were not fitted: means and 95 % intervals over cases",
        headings=("model", "kind", *(column.title for column in shown.values()), skill.title),
        rows=[
            [
                Cell(text=row.model),
                Cell(text="with texel gains" if row.texel_gains else _KINDS.get(row.kind, "")),
                *_average(row.pooled, shown),
                number(row.skill[null].mean if null in row.skill else None, column=skill),
            ]
            for row in rows
        ],
        texts=(1,),
    )


def list_inputs(evidence: Evidence) -> list[str]:
    """Describe the standard uncertainties of the inputs, which are those of the first case, in one text each."""
    out = []
    for name, value in next((each.uncertainties for each in evidence.inputs.values()), {}).items():
        what, _, unit = name.removesuffix("]").partition(" [")
        if unit:
            factor, text = _INPUT_UNITS[unit]
            out.append(f"{what} {factor * value:.3g}{text}")
        else:
            bound = "no slip" if math.isinf(value) else f"a coefficient of {value:g}"
            out.append(f"{what} uniform from none to {bound}")
    return out


def name_limits(evidence: Evidence) -> dict[str, Any]:
    """Return what limits the fast model: its errors by cause, for a sentence on the page.

    Returns:
        `stage` is the name of the stage with the largest mean error; `error` is this error [%]; `hidden` is the mean
        error by the electronics [%]; `inputs` is the mean misplaced force by uncertain inputs [%].
    """
    if (stages := evidence.stages) is None:
        return {}
    model = {name: each.mean for name, each in stages.pooled.items() if name != "electronics" and each.cases}
    largest = max(model, key=lambda name: model[name])
    inputs = [each.misplaced_total for each in evidence.inputs.values()]
    return {
        "stage": largest,
        "error": 100 * model[largest],
        "hidden": 100 * stages.pooled["electronics"].mean,
        "inputs": 100 * float(np.mean(inputs)) if inputs else math.nan,
    }


#: Files of the report's page that are copied unchanged.
_ASSETS = ("report.css", "report.js")


def write_report(evaluation: RecordingEvaluation, folder: Path) -> None:
    """Write the report on a sensor's evaluation: the page, `report.json`, `scores.csv`, and the parameters.

    Args:
        evaluation: The results to show.
        folder: An existing folder to write to.

    Raises:
        MissingExtraError: If jinja2 or matplotlib is not installed.
        OSError: If the folder cannot be written.
    """
    require(*REPORT_MODULES)
    shown = contents(evaluation)
    if isinstance(evaluation, Evaluation):
        shown |= _show_campaign(evaluation, draw_cases(evaluation.derivation, evaluation, folder))
        (folder / "scores.csv").write_text(tabulate_scores(evaluation.campaign).to_csv(), encoding="utf-8")
        evaluation.derivation.parameters.save(folder)
    render_page("index.html.j2", shown, folder)
    (folder / "report.json").write_text(json_text(evaluation.report), encoding="utf-8")


def render_page(template: str, shown: Mapping[str, Any], folder: Path) -> None:
    """Write `index.html` and what it loads into a folder.

    Args:
        template: Name of the template of the page.
        shown: Values that the template shows, by name.
        folder: An existing folder.

    Raises:
        OSError: If the folder cannot be written.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    assets = resources.files("validation.report").joinpath("assets")
    environment = Environment(
        loader=PackageLoader("validation.report", "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = spell_units(environment.get_template(template).render(shown))
    (folder / "index.html").write_text(text, encoding="utf-8")
    for name in _ASSETS:
        (folder / name).write_bytes(assets.joinpath(name).read_bytes())
