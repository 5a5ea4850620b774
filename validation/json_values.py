"""Converts results with numpy arrays and NaN to values that JSON can hold, and to JSON text."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import numpy as np


def to_json_values(value: Any) -> Any:  # noqa: ANN401, PLR0911 -- JSON is untyped; one line for each type
    """Convert a nested value to dicts, lists, numbers and text: arrays to lists, NaN and infinity to None.

    Objects with a method `as_json` convert themselves; other dataclasses become dicts of their fields.
    """
    if hasattr(value, "as_json"):
        return to_json_values(value.as_json())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {each.name: to_json_values(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json_values(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_json_values(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return to_json_values(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def json_text(value: Any, *, indent: int | None = 1) -> str:  # noqa: ANN401 -- JSON is untyped
    """Return a nested value as JSON text; NaN and infinity become null."""
    return json.dumps(to_json_values(value), indent=indent, allow_nan=False)
