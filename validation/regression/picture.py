"""Draws the verdict of a regression check: the change of each quantity over its tolerance."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from pathlib import Path

from validation.extras import MissingExtraError

_LOG = logging.getLogger(__name__)

#: Changes over the tolerance between which the axis extends; others are drawn at its ends [-].
_LEAST, _LARGEST = 1e-3, 1e3


def write_verdict(changes: Mapping[str, float], sensor: str, folder: Path) -> tuple[str, ...]:
    """Write `regress.csv` and, if matplotlib is installed, `regress.svg` and `regress.png`.

    Each quantity is a dot at its change over its tolerance, in the row of its group; a dot to the right of 1 is red.

    Args:
        changes: Largest change over the tolerance by title of the quantity, `group: name`; infinity if a quantity is
            missing on one side [-].
        sensor: Name of the sensor.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    lines = ["quantity,change_over_tolerance", *(f'"{title}",{value:.6g}' for title, value in changes.items())]
    (folder / "regress.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    try:
        from matplotlib.figure import Figure
    except ImportError:
        _LOG.warning("no picture: %s", MissingExtraError("matplotlib"))
        return ("regress.csv",)
    groups = sorted({_find_group(title) for title in changes}, reverse=True)
    figure = Figure(figsize=(7, 1 + 0.3 * len(groups)), layout="constrained")
    axes = figure.subplots()
    for red in (False, True):
        chosen = [(title, value) for title, value in changes.items() if (not value <= 1) == red]
        places = [min(max(value, _LEAST), _LARGEST) if math.isfinite(value) else _LARGEST for _, value in chosen]
        rows = [groups.index(_find_group(title)) for title, _ in chosen]
        label = f"{len(chosen)} changed" if red else f"{len(chosen)} within their tolerance"
        axes.plot(places, rows, "x" if red else "o", color="tab:red" if red else "tab:blue", alpha=0.7, label=label)
    axes.axvline(1, color="grey", linestyle=":")
    axes.set(xscale="log", xlim=(_LEAST / 2, 2 * _LARGEST), xlabel="change over tolerance", title=f"regress {sensor}")
    axes.set_yticks(range(len(groups)), groups)
    axes.legend(frameon=False, fontsize="small", loc="lower right")
    names = ("regress.svg", "regress.png")
    for name in names:
        figure.savefig(folder / name, dpi=150)
    return ("regress.csv", *names)


def _find_group(title: str) -> str:
    return title.partition(":")[0]
