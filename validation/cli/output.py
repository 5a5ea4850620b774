"""What commands print: results on standard output, everything else on standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np


def say(message: str) -> None:
    """Write a message for the user to standard error."""
    sys.stderr.write(f"{message}\n")


def print_json(result: Mapping[str, Any]) -> None:
    """Write one JSON object to standard output."""
    sys.stdout.write(json.dumps(plain(result), indent=1, allow_nan=False))
    sys.stdout.write("\n")


def plain(value: Any) -> Any:  # noqa: ANN401 -- JSON is untyped
    """Turn arrays and numpy numbers into lists and numbers; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
