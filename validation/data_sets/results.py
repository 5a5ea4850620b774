"""Scores of models on recordings: metrics of one image, rows of the table, example images, and all of a data set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Annotated

from pydantic import Field

from fastmodel import Electronics
from fastmodel.signal.electronics import grey_levels
from meshes.array import TexelArray
from meshes.array_types import FloatArray
from validation import metrics
from validation.campaign.texel_metrics import AREA_THRESHOLD, active_area_iou, centre_of_pressure_error
from validation.campaign.wasserstein import wasserstein
from validation.credibility.uncertainty import ComparisonError
from validation.pooling import Pooled, pool
from validation.recordings.recording import BoolArray
from validation.results import Column, GreyImage, Number, Result, result_model


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
        full_scale: Largest count according to the recording, shown as white [-].
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
        centre_of_pressure_m=centre_of_pressure_error(r, p, places),
        wasserstein_m=wasserstein(r, p, places),
        active_area_iou=active_area_iou(r, p, threshold=AREA_THRESHOLD * float(r.max())),
    )


def group_by_metric(scores: Iterable[CountScore]) -> dict[str, tuple[float, ...]]:
    """Regroup scores by metric: return the values of each metric in all scores, by its name."""
    table = [asdict(score) for score in scores]
    return {metric: tuple(row[metric] for row in table) for metric in table[0]}


@result_model
class RecordingRow(Result):
    """Row of the table of scores: one model on one split of the recordings into fitted and scored ones.

    Attributes:
        split: Name of the split.
        model: Name of the model.
        kind: `model` (forward model), `null` (null model) or `floor` (repeatability of the recordings).
        texel_gains: Whether a gain per texel was fitted.
        fitted: Names of the recordings that the model was fitted to.
        parameters: The fitted parameters, by name with unit.
        per_case: Score of each scored case, the mean over its repeated recordings, by name.
        pooled: Mean score over the scored cases with its interval, by metric.
        skill: 1 - (changed grey of this model) / (changed grey of a null model), by name of the null model [-].
        electronics: The fitted curve as electronics of the fast model; None for rows without one.
    """

    split: str
    model: str
    kind: str
    texel_gains: bool
    fitted: tuple[str, ...]
    parameters: Mapping[str, Number]
    per_case: Mapping[str, CountScore]
    pooled: Mapping[str, Pooled]
    skill: Mapping[str, Pooled]
    electronics: Electronics | None


def find_best_null(rows: Sequence[RecordingRow]) -> RecordingRow:
    """Find the null model (a prediction without a sensor model) with the smallest mean change of the image.

    Args:
        rows: Rows of the table of scores of one split.
    """
    nulls = [row for row in rows if row.kind == "null"]
    return min(nulls, key=lambda row: row.pooled["image_changed_percent"].mean)


def find_difference(rows: Sequence[RecordingRow]) -> tuple[RecordingRow, RecordingRow, Pooled]:
    """Compare the first model with texel gains with the best null model.

    The changes of the image by both models are subtracted case by case, because both have large errors in the same
    cases.

    Args:
        rows: Rows of the table of scores of one split.

    Returns:
        The rows of the model and of the null model, and the mean difference of the image changed over the cases [%].
    """
    null = find_best_null(rows)
    own = next(row for row in rows if row.texel_gains)
    differences = [
        own.per_case[case].image_changed_percent - score.image_changed_percent for case, score in null.per_case.items()
    ]
    return own, null, pool(differences)


def compare_with_nulls(rows: Sequence[RecordingRow]) -> str:
    """State whether the first model with texel gains predicts the scored recordings better than the best null model.

    Below five cases the models are not ranked.

    Args:
        rows: Rows of the table of scores of one split.

    Returns:
        One sentence with both means, the difference and its interval [%].
    """
    own, null, found = find_difference(rows)
    verdict = "these recordings do not tell the two apart"
    if found.few:
        verdict = "too few cases to tell"
    elif found.low > 0:
        verdict = "it is behind"
    elif found.high < 0:
        verdict = "it is ahead"
    own_mean, null_mean = (row.pooled["image_changed_percent"].mean for row in (own, null))
    return (
        f"{own.model} with texel gains changes the image by {own_mean:.2f} %, the best null model ({null.model}) "
        f"by {null_mean:.2f} %: {verdict} "
        f"(difference {found.mean:+.2f} %, {found.describe('{:+.2f}', unit='%')})"
    )


@result_model
class RecordingExample(Result):
    """Tactile images of one scored recording: the recorded image and the image that each model predicts.

    Attributes:
        split: Name of the split.
        case: Name of the recording.
        load: Load [N].
        recorded: Grey levels of the recorded mean frame, shape (rows, columns) [-].
        predicted: Predicted grey levels by name of the model, each of shape (rows, columns) [-].
    """

    split: str
    case: str
    load: Number
    recorded: GreyImage
    predicted: Mapping[str, GreyImage]


@result_model
class RecordingScores(Result):
    """All scores on the recordings of a data set.

    Attributes:
        name: Name of the data set.
        rows: Rows of the table of scores, one per split and model.
        examples: Images of one scored recording per split.
        about: Description of each model and each split in one line, by name.
        notes: Comparison with null models, and what the fitted recordings determine, by name of the split.
        files: SHA-256 hash of each recording, by name of the recording.
        noise: Root mean square over recordings of the standard deviation of a texel's counts [counts].
        source: Publication of the recordings.
        problems: One line per recording, series or split that was left out.
        errors: Comparison errors of the quantities under each scored load, by name of the split.
        left_out: Error of fitted images that were left out, with weights by the load to each power of
            `cross_validation.POWERS`, by name of the split and description of the seat [counts].
    """

    name: str
    rows: tuple[RecordingRow, ...]
    examples: tuple[RecordingExample, ...]
    about: Mapping[str, str]
    notes: Mapping[str, tuple[str, ...]]
    files: Mapping[str, str]
    noise: Number
    source: str
    problems: tuple[str, ...]
    errors: Mapping[str, tuple[ComparisonError, ...]] = Field(default_factory=dict)
    left_out: Mapping[str, Mapping[str, tuple[Number, ...]]] = Field(default_factory=dict)

    def row(self, split: str, model: str, *, texel_gains: bool = False) -> RecordingRow:
        """Return the row of a model on a split, with or without texel gains.

        Raises:
            KeyError: If the table has no such row.
        """
        for row in self.rows:
            if (row.split, row.model, row.texel_gains) == (split, model, texel_gains):
                return row
        raise KeyError(f"no row {model!r} in split {split!r}; rows: {sorted({r.model for r in self.rows})}")
