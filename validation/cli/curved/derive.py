"""Texts that the commands on curved covers share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.cli.entry import DONE, OUTSIDE_FAILED
from validation.cli.meaning import GOOD_ERROR
from validation.cli.output import describe_errors, say

if TYPE_CHECKING:
    from meshes.array_types import FloatArray


def say_written(files: tuple[str, ...], out: Path | None) -> int:
    """Name the written files, and return the exit status, which says whether this machine could draw pictures."""
    from validation.scene.draw import lacks_picture

    if files:
        say(f"wrote {', '.join(files)} to {out}")
    return OUTSIDE_FAILED if lacks_picture(files) else DONE


def judge_error(error: float, what: str) -> str:
    """Return a sentence on an estimated error [-]."""
    if np.isnan(error):
        return f"No error of {what} is known: there is one mesh only."
    if error <= GOOD_ERROR:
        return f"The estimated error of {what} is good: {100 * error:.2g} %."
    return (
        f"The estimated error of {what} is {100 * error:.2g} %, above {100 * GOOD_ERROR:g} %: take it as their "
        "uncertainty."
    )


def describe_known_errors(estimates: Mapping[str, float]) -> str:
    """Describe estimated errors, or say that there are none."""
    known = {name: value for name, value in estimates.items() if not np.isnan(value)}
    return describe_errors(known) or "none: there is one mesh only"


def format_vector(values: FloatArray, digits: int = 3) -> str:
    """Format the components of a vector."""
    return ", ".join(f"{round(float(each), digits) + 0.0:.4g}" for each in values)
