"""What the page shows of recordings."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from meshes import TexelArray
from validation.report.tactile_image import Scale, colour_bar, tactile_image
from validation.stamp import StampExample, StampRow, StampScores

#: Metrics of a row: name, heading, factor, unit.
COLUMNS = (
    ("image_changed_percent", "image changed", 1.0, "%"),
    ("relative_l2", "relative L2", 100.0, "%"),
    ("total_counts_error", "total counts", 100.0, "%"),
    ("centre_of_pressure_m", "centre of counts", 1e3, "mm"),
    ("wasserstein_m", "Wasserstein-1", 1e3, "mm"),
    ("active_area_iou", "active-area IoU", 1.0, ""),
)
#: The strongest null model: a table of the weights with no sensor model at all.
NULL = "quadratic per texel"
#: The models whose images are shown beside the recorded one.
_SHOWN = ("fast model", "fast model, texel gains", "reference", NULL)


def recordings_contents(scores: StampScores, array: TexelArray) -> dict[str, Any]:
    """Tables and images by split."""
    splits = list(dict.fromkeys(row.split for row in scores.rows))
    return {
        "scores": scores,
        "columns": COLUMNS,
        "null": NULL,
        "splits": [_split(scores, split, array) for split in splits],
        "models": {name: text for name, text in scores.about.items() if name not in splits},
    }


def _split(scores: StampScores, split: str, array: TexelArray) -> dict[str, Any]:
    rows = [row for row in scores.rows if row.split == split]
    example = next(example for example in scores.examples if example.split == split)
    return {
        "name": split,
        "about": scores.about[split],
        "rows": [_row(row) for row in rows],
        "fitted": ", ".join(rows[0].fitted),
        "scored": ", ".join(rows[0].per_case),
        "example": example,
        "images": _images(example, array),
        "parameters": {
            "fast model" + (", texel gains" if row.texel_gains else ""): row.parameters
            for row in rows
            if row.model == "fast model"
        },
    }


def _row(row: StampRow) -> dict[str, Any]:
    return {
        "model": row.model,
        "kind": "with texel gains" if row.texel_gains else {"null": "null", "floor": "repeatability"}.get(row.kind, ""),
        "values": [(row.pooled[name], factor) for name, _, factor, _ in COLUMNS],
        "skill": row.skill.get(NULL),
    }


def _images(example: StampExample, array: TexelArray) -> dict[str, Any]:
    recorded = example.recorded.astype(np.float64).ravel()
    shown = {name: example.predicted[name].astype(np.float64).ravel() for name in _SHOWN if name in example.predicted}
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
