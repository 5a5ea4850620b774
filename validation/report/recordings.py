"""Tables and images of the report that compare the fast model with recordings of a real sensor."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from meshes import TexelArray
from validation.data_sets.results import CountScore, RecordingExample, RecordingRow, RecordingScores, find_best_null
from validation.data_sets.score import FAST
from validation.render.image import Scale, colour_bar, tactile_image
from validation.render.table import Cell, Table, interval, number
from validation.results import Column, columns

#: How every metric of counts is printed.
COLUMNS = columns(CountScore)
#: Words for the kinds of rows that are no model of the sensor.
_KINDS = {"null": "null", "floor": "repeatability"}
#: Models whose images are shown next to the recorded image; the image of the best null model follows them.
_SHOWN = (FAST, f"{FAST}, texel gains", "reference, texel gains")


def recordings_contents(scores: RecordingScores, array: TexelArray) -> dict[str, Any]:
    """Return tables and images for each division of the recordings into fitted and scored recordings (split).

    Args:
        scores: Scores against the recordings.
        array: Array of the recorded sensor.

    Returns:
        Variables for the template of the page, by name.
    """
    splits = list(dict.fromkeys(row.split for row in scores.rows))
    return {
        "scores": scores,
        "splits": [_split(scores, split, array) for split in splits],
        "models": {name: text for name, text in scores.about.items() if name not in splits},
    }


def _split(scores: RecordingScores, split: str, array: TexelArray) -> dict[str, Any]:
    rows = [row for row in scores.rows if row.split == split]
    null = find_best_null(rows).model
    example = next(example for example in scores.examples if example.split == split)
    return {
        "about": scores.about[split],
        "table": _tabulate(split, rows, null),
        "null": null,
        "notes": scores.notes.get(split, ()),
        "fitted": ", ".join(next((row.fitted for row in rows if row.fitted), ())),
        "scored": ", ".join(rows[0].per_case),
        "example": example,
        "images": draw_example(example, array, (*_SHOWN, null)),
        "parameters": {
            FAST + (", texel gains" if row.texel_gains else ""): row.parameters for row in rows if row.model == FAST
        },
    }


def _tabulate(split: str, rows: Sequence[RecordingRow], null: str) -> Table:
    skill = Column(heading="skill", decimals=2)
    return Table(
        name=f"recordings-{split.replace(' ', '-')}",
        caption="Models on recordings that were not fitted: means and 95 % intervals over cases",
        headings=("model", "kind", *(column.title for column in COLUMNS.values()), skill.title),
        rows=[
            [
                Cell(text=row.model),
                Cell(text="with texel gains" if row.texel_gains else _KINDS.get(row.kind, "")),
                *(interval(row.pooled[name], column) for name, column in COLUMNS.items()),
                Cell(text=skill.text(row.skill[null].mean), value=row.skill[null].mean)
                if null in row.skill
                else number(None),
            ]
            for row in rows
        ],
        texts=(1,),
    )


def draw_example(example: RecordingExample, array: TexelArray, names: Sequence[str]) -> dict[str, Any]:
    """Draw the recorded image, and those of models with their differences from it, in grey levels.

    Args:
        example: The images.
        array: Array of the recorded sensor.
        names: Models whose images are drawn if the example has them.

    Returns:
        `images`: name, image and difference or None, of each; `bars`: legends of the two scales, as HTML.
    """
    recorded = example.recorded.astype(np.float64).ravel()
    shown = {name: example.predicted[name].astype(np.float64).ravel() for name in names if name in example.predicted}
    grey = Scale(
        peak=max(float(recorded.max()), *(float(each.max()) for each in shown.values())), unit="grey", factor=1
    )
    largest = max(float(np.abs(each - recorded).max()) for each in shown.values())
    apart = dataclasses.replace(grey, peak=largest, difference=True)
    images: list[tuple[str, str, str | None]] = [("recorded", tactile_image(array, recorded, grey), None)]
    for name, values in shown.items():
        pair = tactile_image(array, values, grey), tactile_image(array, values - recorded, apart)
        images.append((name, *pair))
    return {"images": images, "bars": colour_bar(grey) + colour_bar(apart)}
