"""The sentence that compares the forward model with the best null model."""

from dataclasses import fields

import numpy as np
import pytest

from validation.data_sets.results import CountScore, RecordingRow, compare_with_nulls
from validation.pooling import pool

RANDOM = np.random.default_rng(4)
CASES = [f"case {number}" for number in range(8)]


def make_row(model, kind, values):
    per_case = {
        case: CountScore(**{each.name: value for each in fields(CountScore)})
        for case, value in zip(CASES, values, strict=True)
    }
    return RecordingRow(
        split="split",
        model=model,
        kind=kind,
        texel_gains=kind == "model",
        fitted=(),
        parameters={},
        per_case=per_case,
        pooled={"image_changed_percent": pool(list(values))},
        skill={},
        electronics=None,
    )


@pytest.mark.parametrize(
    ("shift", "words"),
    [(0.2, "it is behind"), (-0.2, "it is ahead"), (0.0, "these recordings do not tell the two apart")],
)
def test_cases_are_compared_one_by_one_with_the_best_null_model(shift, words):
    null = RANDOM.uniform(0.5, 3.0, len(CASES))  # scatters much more from case to case than the two models differ
    scatter = 0.05 * np.array([1, -1, 1, -1, 1, -1, 1, -1])
    rows = [make_row("line", "null", null), make_row("zeros", "null", null + 1)]
    rows.append(make_row("fast model", "model", null + shift + scatter))
    sentence = compare_with_nulls(rows)
    assert words in sentence
    assert "(line)" in sentence
    assert f"by {null.mean():.2f} %" in sentence
    assert f"difference {shift + 0.0:+.2f}" in sentence or shift == 0
