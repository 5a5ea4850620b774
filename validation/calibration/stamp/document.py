"""Stamp scores as plain values for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from validation.calibration.stamp.score import StampScores


def as_document(scores: StampScores) -> dict[str, Any]:
    """Everything as dicts, lists, numbers and text; what does not exist is None, since JSON has no NaN.

    Args:
        scores: What `score_recordings` returned.
    """
    return {
        "rows": [_plain(row) for row in scores.rows],
        "examples": [_plain(example) for example in scores.examples],
        "about": dict(scores.about),
        "files": dict(scores.files),
        "window_s": list(scores.window),
        "noise_counts": scores.noise,
        "source": scores.source,
    }


def _plain(value: Any) -> Any:  # noqa: ANN401 -- any value that scores hold
    if is_dataclass(value) and not isinstance(value, type):
        return {key: _plain(each) for key, each in asdict(value).items()}
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, float) and math.isnan(value):
        return None
    return value
