"""What commands print: results on standard output, everything else on standard error."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

from validation.json_values import json_text


def say(message: str) -> None:
    """Write a message for the user to standard error."""
    sys.stderr.write(f"{message}\n")


def show(line: str) -> None:
    """Write one line of the result to standard output."""
    sys.stdout.write(f"{line}\n")


def print_json(result: Mapping[str, Any]) -> None:
    """Write one JSON object to standard output."""
    sys.stdout.write(f"{json_text(result)}\n")
