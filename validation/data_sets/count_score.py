"""Differences between a predicted and a recorded mean frame of counts, by every metric."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Annotated

import numpy as np

from fastmodel.signal.electronics import grey_levels
from meshes.array import FloatArray, TexelArray
from validation import metrics
from validation.recordings.recording import BoolArray
from validation.results import Column, Number, Result, result_model


@result_model
class CountScore(Result):
    """Differences between a predicted and a recorded mean frame of counts, over active texels.

    Attributes:
        image_changed_percent: Mean absolute difference of grey levels over 255, where the grey level is
            round(255 counts / full scale) [%].
        pixels_changed: Number of texels whose grey levels differ [-].
        relative_l2: Euclidean norm of the difference of counts over that of the recorded counts [-].
        total_counts_error: Absolute difference of the sums of counts over the recorded sum [-].
        centre_of_pressure_m: Distance between the centres of predicted and recorded counts [m].
        wasserstein_m: Wasserstein-1 distance of the two maps of counts, each scaled to unit mass [m].
        active_area_iou: Intersection over union of the areas with counts above a tenth of the largest recorded
            count [-].
    """

    image_changed_percent: Annotated[Number, Column(heading="image changed", unit="%")]
    pixels_changed: Number
    relative_l2: Annotated[Number, Column(heading="relative L2", unit="%", factor=100)]
    total_counts_error: Annotated[Number, Column(heading="total counts", unit="%", factor=100)]
    centre_of_pressure_m: Annotated[Number, Column(heading="centre of counts", unit="mm", factor=1e3)]
    wasserstein_m: Annotated[Number, Column(heading="Wasserstein-1", unit="mm", factor=1e3)]
    active_area_iou: Annotated[Number, Column(heading="active-area IoU")]


def score_counts(
    recorded: FloatArray,
    predicted: FloatArray,
    *,
    full_scale: int,
    array: TexelArray,
    measured: BoolArray | None = None,
) -> CountScore:
    """Compare a predicted frame of counts with the recorded frame by every metric, over measured texels.

    Args:
        recorded: Recorded counts of the n texels, shape (n,) [-].
        predicted: Predicted counts, shape (n,) [-].
        full_scale: Largest count as stated in the recording, which becomes white [-].
        array: The texels.
        measured: Texels to compare, shape (n,); the active ones when not given.
    """
    lit = array.active if measured is None else measured
    r, p, places = recorded[lit], predicted[lit], array.centres[lit]
    image = metrics.score_images(grey_levels(r, full_scale), grey_levels(p, full_scale))
    total = float(r.sum())
    return CountScore(
        image_changed_percent=image.image_changed_percent,
        pixels_changed=float(image.pixels_changed),
        relative_l2=metrics.relative_l2(r, p),
        total_counts_error=float(abs(p.sum() - total) / total) if total > 0 else float("nan"),
        centre_of_pressure_m=metrics.centre_of_pressure_error(r, p, places),
        wasserstein_m=metrics.wasserstein(r, p, places),
        active_area_iou=metrics.active_area_iou(r, p, threshold=metrics.AREA_THRESHOLD * float(r.max())),
    )


def average_scores(scores: Sequence[CountScore]) -> CountScore:
    """Average the scores of repeated recordings of one load, because repeats are not independent cases."""
    return CountScore(**{metric: float(np.mean(values)) for metric, values in group_by_metric(scores)})


def group_by_metric(scores: Iterable[CountScore]) -> Iterable[tuple[str, tuple[float, ...]]]:
    """Regroup scores by metric: return pairs of the name of a metric and its values in all scores."""
    table = [asdict(score) for score in scores]
    return [(metric, tuple(row[metric] for row in table)) for metric in table[0]]
