"""Tables of designs, and the page with their maps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from validation.json_values import json_text
from validation.render.table import Cell, Table, number
from validation.resolution.design import AXES, FLAT, NUMBERS, Design, Designs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Size of a map [inches].
_WIDTH, _HEIGHT = 4.4, 3.2
#: Colours of maps from the least to the largest value, and of lines and words on them, which no theme changes.
_COLOURS, _INK = ("#f4f8fc", "#8fbbe0"), "#1f2a37"
#: Largest over least value of a map from which its iso-lines are at equal ratios [-].
_WIDE = 8.0
#: These ratios over a power of ten, for few and for many powers [-].
_STEPS = ((1.0, 1.5, 2.0, 3.0, 5.0, 7.0), (1.0, 2.0, 5.0))


def tabulate_designs(found: Designs, shown: Sequence[Design], axes: Sequence[str], **options: Any) -> Table:  # noqa: ANN401 -- as `Table`
    """Make a table with one row for each of some designs: their places on the axes, and all numbers."""
    rows: list[list[Cell | str]] = [
        [
            *(AXES[axis].text(getattr(each, axis)) for axis in axes),
            *(
                number(each.numbers[name], column=NUMBERS[name], small=options.get("name", "") and _band(each, name))
                for name in NUMBERS
            ),
        ]
        for each in shown
    ]
    headings = [_title(found, axis) for axis in axes] + [column.title for column in NUMBERS.values()]
    return Table(headings, rows, **options)


def tabulate_best(found: Designs) -> Table:
    """Make a table of the numbers of the best design, with the bands of the tolerance."""
    rows = [
        [column.title, column.text(found.middle.numbers[name]), _band(found.middle, name), column.meaning]
        for name, column in NUMBERS.items()
    ]
    return Table(("", "value", "band", "what it is"), rows, caption="Best design", name="best", texts=(2, 3))


def _band(design: Design, name: str) -> str:
    low, high = (NUMBERS[name].text(each) for each in design.bands[name] or (None, None))
    return "" if low == high else f"{low} to {high}"


def _title(found: Designs, axis: str) -> str:
    return f"hardness [Shore {found.scale.upper()}]" if axis == "hardness" else AXES[axis].title


def list_maps(found: Designs) -> list[tuple[str, tuple[str, ...]]]:
    """List the names of numbers that vary, and the one or two axes of each picture."""
    maps: list[tuple[str, tuple[str, ...]]] = []
    for name in NUMBERS:
        axes = found.varies(name)
        pairs = [tuple(axes)] if len(axes) < len(AXES) else [(axes[0], axes[1]), (axes[0], axes[2])]
        maps += [(name, pair) for pair in pairs if pair]
    return maps


def write_designs(found: Designs, folder: Path) -> None:
    """Write the page of designs, its maps as one picture `maps.png`, and `design.json`.

    Args:
        found: The designs.
        folder: An existing folder to write to.

    Raises:
        MissingExtraError: If jinja2 or matplotlib is not installed.
        OSError: If the folder cannot be written.
    """
    from validation.render.figure import PAGE, open_figure
    from validation.report.figures import render_svg
    from validation.report.page import render_page

    maps = list_maps(found)
    plots = [
        (_caption(found, name, axes), render_svg(partial(draw, found, name, axes), _WIDTH, _HEIGHT))
        for name, axes in maps
    ]
    shown: dict[str, Any] = {
        "found": found,
        "sentences": list(found.explain()),
        "best": tabulate_best(found),
        "plots": plots,
        "all": tabulate_designs(
            found, found.designs, found.varied or ["thickness"], name="designs", caption="All designs, with their bands"
        ),
    }
    render_page("design.html.j2", shown, folder)
    (folder / "design.json").write_text(json_text(found.as_json()), encoding="utf-8")
    if maps:
        rows = (len(maps) + 1) // 2
        with open_figure(folder / "maps.png", width=PAGE, height=2.6 * rows) as figure:
            for place, each in enumerate(maps):
                draw(found, *each, figure.add_subplot(rows, 2, place + 1))


def _caption(found: Designs, name: str, axes: tuple[str, ...]) -> str:
    column, others = NUMBERS[name], [axis for axis in found.varied if axis not in axes]
    fixed = [axis for axis in others if axis in found.varies(name)]
    free = [axis for axis in others if axis not in fixed]
    text = f"{column.heading.capitalize()}: {column.meaning}."
    if fixed:
        places = (f"{a} {AXES[a].text(getattr(found.middle, a))} {AXES[a].unit}".strip() for a in fixed)
        text += f" At {', '.join(places)}."
    return text + (f" The same for every {' and '.join(free)}." if free else "")


def draw(found: Designs, name: str, axes: tuple[str, ...], figure: Axes) -> None:
    """Draw a number over one axis with its band, or as iso-lines over two, at the best design otherwise.

    A star marks the best design, and a dashed line the designs with at most 1.1 times its error.

    Args:
        found: The designs.
        name: Name of the number.
        axes: One or two axes of the designs.
        figure: Axes to draw into.
    """
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.ticker import LogLocator, MaxNLocator

    from validation.render.figure import label_lines

    column, middle = NUMBERS[name], found.middle
    fixed = [axis for axis in AXES if axis not in axes]
    chosen = [each for each in found.designs if all(getattr(each, a) == getattr(middle, a) for a in fixed)]
    places = [AXES[axis].factor * np.array(found.values(axis), dtype=np.float64) for axis in axes]
    shape = [len(each) for each in places]
    values = column.factor * np.array([each.numbers[name] for each in chosen], dtype=np.float64).reshape(shape)
    star = [AXES[axis].factor * getattr(middle, axis) for axis in axes]
    figure.set(xlabel=_title(found, axes[0]), title=column.title)
    if len(axes) == 1:
        bands = [each.bands[name] or (np.nan, np.nan) for each in chosen]
        figure.fill_between(places[0], *(column.factor * np.array(bands).T), alpha=0.25, color="#0072b2", linewidth=0)
        figure.plot(places[0], values, "o-", color="#0072b2")
        height = column.factor * (middle.numbers[name] or np.nan)
        figure.plot(star[0], height, "*", color="#d55e00", markersize=10)
        figure.set_ylim(bottom=0)
        return
    known = values[np.isfinite(values)]
    figure.plot(*star, "*", color="#d55e00", markersize=10, clip_on=False)
    figure.set(xlim=places[0][[0, -1]], ylim=places[1][[0, -1]], ylabel=_title(found, axes[1]))
    if not len(known) or known.min() == known.max():
        figure.set_title(f"{column.title}: {f'{known[0]:.3g} everywhere here' if len(known) else 'none here'}")
        return
    least, most = known.min(), known.max()
    locator = (
        LogLocator(subs=_STEPS[int(most > _WIDE**2 * least)]) if least > 0 and most > _WIDE * least else MaxNLocator(7)
    )
    levels = np.unique(np.clip(locator.tick_values(least, most), least, most))
    grid = (*places, values.T)
    figure.contourf(*grid, levels=levels, cmap=LinearSegmentedColormap.from_list("maps", _COLOURS))
    lines = figure.contour(*grid, levels=levels, colors=_INK, linewidths=0.7)
    label_lines(figure, lines, fmt="%g", colors=_INK)
    if name == "error_m" and least < (level := FLAT * column.factor * middle.error) < most:
        figure.contour(*grid, levels=[level], colors="#d55e00", linestyles="--")
