"""A press on a relaxing cover in time: its history as a file or a hold, its results, and their files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from meshes.array_types import FloatArray
from meshes.relaxation import Relaxation
from validation.errors import InputError, at
from validation.json_values import json_text
from validation.moving.history import History
from validation.moving.inertia import BANDWIDTH, SLOW, find_resonance, warn_of_inertia
from validation.moving.results import measure_misplaced
from validation.press_files import write_rows
from validation.recordings import tables
from validation.render.figure import COLOURS, draw_texels, open_figure, save_figure
from validation.render.image import Scale
from validation.text.quantity import read_quantity

if TYPE_CHECKING:
    from fem_reference.indentation.relaxing import Followed
    from fem_reference.indentation.result import Indentation
    from meshes import Cover, TexelArray
    from validation.campaign.case import Case

#: Number of instants that are printed [-].
_SHOWN = 10


def read_history(source: str | Path | History) -> History:
    """Read a history of one touch: from a CSV file with the columns `time` [s] and `load` [N] or `depth` [m], or made.

    Raises:
        InputError: If the file cannot be read, has other columns or holds no history, or the indenter slides, presses
            again or lifts off before the last instant.
    """
    history = source if isinstance(source, History) else _read_file(Path(source))
    with at(f"{history.place}: "):
        if len(set(history.poses)) > 1 or history.repeat > 1:
            raise InputError("slides and repetitions are not computed on relaxing covers; give one touch at one place")
        pressed = np.flatnonzero(history.values)[0]
        if len(lifted := np.flatnonzero(np.array(history.values[pressed:-1]) == 0)):
            instant = history.times[pressed + lifted[0]]
            raise InputError(f"lifts off at {instant:g} s; end it there, or keep the {history.control} up")
    return history


def _read_file(path: Path) -> History:
    with at("--history: "):
        found = tables.read_history(path, ("load",), ("depth",), ("load", "x", "y"), ("depth", "x", "y"))
    with at(f"--history: {path}: "):
        if "x" in found:
            raise InputError("slides are not computed on relaxing covers; leave out x and y")
        control: Literal["load", "depth"] = "load" if "load" in found else "depth"
        values, times = tuple(found[control].tolist()), tuple(found["time"].tolist())
        return History(control=control, times=times, values=values, place=f"--history: {path}")


def read_hold(text: str, control: Literal["load", "depth"], value: float) -> History:
    """Read the time for which a load [N] or depth [m] is held after a step, such as `60s`.

    Raises:
        InputError: If the text is not a positive time.
    """
    with at("--hold: "):
        seconds = read_quantity(text, "time", example="60s")
        return History(control=control, times=(0.0, seconds), values=(value, value), place="--hold")


@dataclass(frozen=True, kw_only=True, eq=False)
class HistoryPress:
    """A press on a relaxing cover in time.

    Attributes:
        case: Indenter and pose.
        array: The n texels.
        cover: The relaxing cover.
        relaxation: Relaxation of the cover.
        history: The given history.
        followed: Forces and depths at k instants.
        indentations: None, because the elastic presses are parts of the result.
        note: None.
        stopped: Empty, because a history is followed to its end or not at all.
    """

    case: Case
    array: TexelArray
    cover: Cover
    relaxation: Relaxation
    history: History
    followed: Followed
    indentations: tuple[Indentation, ...] = ()
    note: str = ""
    stopped: str = ""

    @cached_property
    def resonance(self) -> float:
        """First shear resonance of the cover with its modulus at the end of the last change [Hz]."""
        return find_resonance(self.cover) * math.sqrt(self.relaxation.at(self.history.last_change))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about reasons not to rely on the result."""
        return (*self.followed.warnings, *warn_of_inertia(self.history.fastest, self.resonance))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on the bulk modulus, the resonance, a step, and what a model without relaxation has."""
        bulk = (
            "relaxes with the shear modulus"
            if self.relaxation.bulk == "relaxing"
            else "is constant (approximate where a contact grows)"
        )
        own, ratio = float(self.misplaced.max()), self.fast_ratio
        out = [
            f"the bulk modulus {bulk}; contact without friction at one place",
            f"first shear resonance {self.resonance:.4g} Hz at the last change: right for changes below a tenth of it",
        ]
        if self.history.values[0] > 0:
            out.append(
                f"the step at 0 s is a rise that takes {1e3 * BANDWIDTH / (SLOW * self.resonance):.2g} ms or more"
            )
        out.append(
            f"the fast model has no relaxation: at best it puts up to {100 * own:.2g} % of the force on wrong texels"
            + (
                ""
                if self.history.control == "load"
                else f", and its force is up to {ratio.max():.3g} times that of this cover"
            )
        )
        return tuple(out)

    @cached_property
    def fast_ratio(self) -> FloatArray:
        """Force of an elastic cover over that of the relaxing one, shape (k,) [-]; 1 without force."""
        force, elastic = self.followed.forces, self.followed.fast.sum(axis=1)
        return np.asarray(np.divide(elastic, force, out=np.ones_like(force), where=force > 0))

    @cached_property
    def misplaced(self) -> FloatArray:
        """Share of the force that an elastic cover puts on wrong texels, at equal forces, shape (k,) [-]."""
        found = self.followed
        own = np.column_stack([found.texel_forces, found.outside])
        return np.asarray(np.round(np.nan_to_num(measure_misplaced(own, found.fast, 0.0)), 9))

    def rows(self) -> list[dict[str, float]]:
        """Return one row for each instant, as names with values in SI units."""
        found = self.followed
        columns = {
            "time_s": found.times,
            "load_N": found.forces,
            "depth_m": found.depths,
            "contact_depth_m": found.contact_depths,
            "peak_texel_N": np.abs(found.texel_forces).max(axis=1),
            "outside_N": found.outside,
            "elastic_load_ratio": self.fast_ratio,
            "elastic_misplaced": self.misplaced,
        }
        return [dict(zip(columns, row, strict=True)) for row in np.column_stack(list(columns.values())).tolist()]

    def pick_rows(self) -> list[dict[str, float]]:
        """Return about ten of the rows: the first ones of a few given instants, and others between them."""
        rows, times = self.rows(), self.history.times
        given = np.searchsorted(self.followed.times, times if len(times) <= _SHOWN else ())
        return [rows[k] for k in np.union1d(given, np.linspace(0, len(rows) - 1, _SHOWN).astype(int)).tolist()]

    def as_json(self) -> dict[str, Any]:
        """Return the result under the names that the command line prints as JSON."""
        return {
            "indenter": self.case.shape,
            "sensor": self.array.name,
            "control": self.history.control,
            "relaxation": vars(self.relaxation),
            "resonance_Hz": self.resonance,
            "history": self.rows(),
            "texel_forces": self.followed.texel_forces,
            "error_estimate": self.followed.error_estimate,
            "notes": self.notes,
            "warnings": self.warnings,
        }

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write `history.json`, `history.csv`, `texels.csv` and, if matplotlib is installed, `history.png`.

        Args:
            folder: An existing folder to write to.

        Returns:
            The names of the written files.

        Raises:
            OSError: If the folder cannot be written.
        """
        rows, found = self.rows(), self.followed
        (folder / "history.json").write_text(json_text(self.as_json()), encoding="utf-8")
        write_rows(folder / "history.csv", rows[0], (row.values() for row in rows))
        names = ("time_s", *(f"texel_{k}_N" for k in range(self.array.count)))
        write_rows(folder / "texels.csv", names, np.column_stack([found.times, found.texel_forces]).tolist())
        return ("history.json", "history.csv", "texels.csv", *save_figure(folder / "history.png", self._draw))

    def _draw(self, path: Path) -> None:
        """Draw load and depth over time, and the texel forces at three instants."""
        found, last = self.followed, len(self.followed.times) - 1
        with open_figure(path, height=4.2) as figure:
            grid = figure.add_gridspec(2, 3)
            axes = figure.add_subplot(grid[0, :])
            axes.plot(found.times, found.forces, color=COLOURS["fem"], label="load")
            axes.plot(found.times, found.fast.sum(axis=1), "--", color=COLOURS["fast"], label="load, elastic cover")
            axes.set(xlabel="time [s]", ylabel="load [N]", ylim=(0, 1.1 * found.fast.sum(axis=1).max()), xlim=(0, None))
            other = axes.twinx()
            other.plot(found.times, 1e3 * found.depths, color=COLOURS["fit"], label="depth")
            other.set(ylabel="depth [mm]", ylim=(0, 1.2e3 * found.depths.max()))
            other.spines["right"].set_visible(True)
            lines = [*axes.lines, *other.lines]
            axes.legend(lines, [str(line.get_label()) for line in lines], loc="lower right")
            reached = (int(np.argmax(found.forces >= share * found.forces.max())) for share in (0.5, 0.999))
            scale = Scale(peak=float(np.abs(found.texel_forces).max()))
            for place, k in enumerate(sorted({*reached, last})):
                part = figure.add_subplot(grid[1, place])
                draw_texels(part, self.array, found.texel_forces[k], scale, title=f"texels at {found.times[k]:.3g} s")
