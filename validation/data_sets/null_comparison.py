"""Comparison of the forward model with the best null model on one split of the recordings, case by case."""

from __future__ import annotations

from collections.abc import Sequence

from validation.campaign.pooling import pool
from validation.data_sets.results import RecordingRow


def find_best_null(rows: Sequence[RecordingRow]) -> RecordingRow:
    """Find the null model (a prediction without a sensor model) with the smallest mean change of the image.

    Args:
        rows: Rows of the table of scores of one split.
    """
    nulls = [row for row in rows if row.kind == "null"]
    return min(nulls, key=lambda row: row.pooled["image_changed_percent"].mean)


def compare_with_nulls(rows: Sequence[RecordingRow]) -> str:
    """State whether the first model with texel gains predicts the scored recordings better than the best null model.

    The change of the image by both is subtracted case by case, because both fail in the same cases; the interval is
    that of the mean difference over the cases, by bootstrap.

    Args:
        rows: Rows of the table of scores of one split.

    Returns:
        One sentence with both means, the difference and its interval [%].
    """
    null = find_best_null(rows)
    own = next(row for row in rows if row.texel_gains)
    found = pool(
        [
            own.per_case[case].image_changed_percent - score.image_changed_percent
            for case, score in null.per_case.items()
        ]
    )
    if found.low > 0:
        verdict = "it is behind"
    elif found.high < 0:
        verdict = "it is ahead"
    else:
        verdict = "these recordings do not tell the two apart"
    own_mean, null_mean = (row.pooled["image_changed_percent"].mean for row in (own, null))
    return (
        f"{own.model} with texel gains changes the image by {own_mean:.2f} %, the best null model ({null.model}) "
        f"by {null_mean:.2f} %: {verdict} "
        f"(difference {found.mean:+.2f}, 95 % interval {found.low:+.2f} to {found.high:+.2f} %)"
    )
