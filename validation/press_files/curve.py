"""Curves of load over depth: computed along one loading path by finite elements, written as CSV and drawn."""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshes import Cover, Indenter, TexelArray
from validation.extras import MissingExtraError

if TYPE_CHECKING:
    from fem_reference.indentation.result import Indentation

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCurve:
    """Indentations at ascending loads or depths of one loading path.

    Attributes:
        indentations: Results in ascending order.
        wanted: Number of results that were asked for [-].
        stopped: Why the path ended before the last result; empty if it did not.
    """

    indentations: Sequence[Indentation]
    wanted: int
    stopped: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the curve under the names that the command line prints as JSON."""
        return {"curve": self.rows(), "wanted": self.wanted, "stopped": self.stopped or None}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of all results, each with the load where it first occurs."""
        first: dict[str, float] = {}
        for each in self.indentations:
            for sentence in each.warnings:
                first.setdefault(sentence, each.total_force)
        return tuple(f"at {load:.4g} N: {sentence}" for sentence, load in first.items())

    def rows(self) -> list[dict[str, Any]]:
        """Return one row for each result: load, depth, area, energy, forces, balance, error estimates and warnings."""
        return [
            {
                "load_N": each.total_force,
                "depth_m": each.depth,
                "contact_area_m2": each.contact_area,
                "energy_J": each.energy,
                "peak_texel_N": float(np.abs(each.texel_forces).max()),
                "outside_N": each.outside,
                "balance": each.balance,
                **{f"error_{name}": value for name, value in each.error_estimate.items()},
                "warnings": list(each.warnings),
            }
            for each in self.indentations
        ]

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write `curve.csv` and, if matplotlib is installed, the pictures `curve.svg` and `curve.png`.

        Args:
            folder: An existing folder to write to.

        Returns:
            The names of the written files.

        Raises:
            OSError: If the folder cannot be written.
        """
        text = io.StringIO()
        rows = [row | {"warnings": "; ".join(row["warnings"])} for row in self.rows()]
        writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        (folder / "curve.csv").write_text(text.getvalue(), encoding="utf-8")
        try:
            self._draw([folder / "curve.svg", folder / "curve.png"])
        except ImportError:
            _LOG.warning("no picture: %s", MissingExtraError("matplotlib"))
            return ("curve.csv",)
        return ("curve.csv", "curve.svg", "curve.png")

    def _draw(self, paths: Sequence[Path]) -> None:
        """Draw load and largest texel force over depth, with error bars from the estimates."""
        from matplotlib.figure import Figure

        rows = self.rows()
        values = {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "warnings"}
        figure = Figure(figsize=(7, 4.5), layout="constrained")
        axes = figure.subplots()
        for name, label in (("load_N", "load"), ("peak_texel_N", "largest texel force")):
            error = values[f"error_{'total_force' if name == 'load_N' else 'peak_texel'}"] * values[name]
            depth_error = 1e3 * values["error_depth"] * values["depth_m"]
            x, y = np.append(0, 1e3 * values["depth_m"]), np.append(0, values[name])
            axes.errorbar(
                x, y, yerr=np.append(0, error), xerr=np.append(0, depth_error), fmt=".-", capsize=2, label=label
            )
        axes.set(xlabel="depth [mm]", ylabel="force [N]", xlim=(0, None), ylim=(0, None))
        axes.set_title("loading; error bars are the error estimates" + ("; the path stopped" if self.stopped else ""))
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
        for path in paths:
            figure.savefig(path, dpi=150)


def trace_curve(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    *,
    points: int,
    load: float | None = None,
    depth: float | None = None,
    progress: Callable[[str], None] | None = None,
    **options: Any,  # noqa: ANN401 -- those of `press_path`
) -> LoadCurve:
    """Press an indenter in equal steps up to a load or depth; results up to where a path stops early are kept.

    Only loading is computed.  Unloading retraces the curve without friction, and is not computed with friction.

    Args:
        cover: Cover that is pressed.
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        points: Number of results [-].
        load: Load at the last result [N].  Give either `load` or `depth`.
        depth: Depth at the last result [m].
        progress: Called with a line of text before each solve.
        **options: Further arguments of `press_path`: pose, friction and accuracy.

    Raises:
        ValueError: If the number of points is not positive, or as for `press_path`.
        IncompletePathError: If not even the first result is reached.
    """
    from fem_reference import IncompletePathError, press_path

    if points < 1:
        raise ValueError(f"a curve needs at least one point, not {points}")
    control, last = ("loads", load) if depth is None else ("depths", depth)
    call: Callable[..., list[Indentation]] = press_path
    if last is None or (load is not None and depth is not None):
        raise ValueError("give either a load or a depth, not both")
    targets = [last * (i + 1) / points for i in range(points)]
    try:
        found, stopped = call(cover, array, indenter, **{control: targets}, progress=progress, **options), ""
    except IncompletePathError as error:
        found, stopped = error.reached, str(error)
        if not found:
            raise
    return LoadCurve(indentations=found, wanted=points, stopped=stopped)
