"""Table, maps and page of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from validation.render.figure import COLOURS, COLUMN, label_lines, open_figure
from validation.render.table import Cell, Table, number
from validation.sweeps.cube import Swept
from validation.sweeps.run import list_versions

#: Largest numbers of maps of a page, and of iso-lines of a map [-].
_MAPS, _LINES = 40, 9


def tabulate(found: Swept, names: Sequence[str], *, brief: bool = False) -> Table:
    """Make the table of all designs: values, some quantities, and the verdict on the wish or the words of a failure.

    Args:
        found: The sweep.
        names: Names of the quantities.
        brief: Whether keys and remarks are shortened.
    """
    keys, judged = list(found.tables.designs), list(found.judge()) if found.wish else []
    short = [key.rpartition(".")[2] for key in keys]
    shown = short if brief and len(set(short)) == len(short) else keys
    headings = [*shown, *(f"{name} [{found.quantities[name][0]}]" for name in names), "remark"]
    rows: list[list[Cell | str]] = []
    for row, design in enumerate(found.designs):
        numbers = [number(float(found.quantities[name][1][row, 0])) for name in names]
        state, words = (judged[row].state, judged[row].reason) if judged else ("", found.words[row])
        if brief and words:
            words = "see below" if found.words[row] else words.partition(" ")[0]
        remark = ": ".join(filter(None, [state, words]))
        rows.append([*(str(design.values[key]) for key in keys), *numbers, remark])
    texts = [*range(1, len(keys)), len(headings) - 1]
    return Table(headings, rows, caption=f"Designs of {found.tables.sensor}", name="designs", texts=texts)


def draw_maps(found: Swept, folder: Path) -> list[str]:
    """Draw each quantity of a grid over its one or two axes, and return the names of the pictures.

    Args:
        found: The sweep; one of drawn designs, of more axes or of materials has no maps.
        folder: Folder of the pictures.

    Raises:
        OSError: If a picture cannot be written.
    """
    axes = [(key, *numbers) for key, (_, numbers) in found.axes.items() if numbers]
    if found.tables.draw or len(axes) != len(found.shape) or len(axes) > 2 or min(found.shape) < 2:  # noqa: PLR2004
        return []
    labels = [f"{key} [{unit}]" if unit else key for key, _, unit in axes]
    names = []
    for name, (unit, table) in list(found.quantities.items())[:_MAPS]:
        values = np.where(np.isfinite(table), table, np.nan)
        if np.isnan(values[:, 0]).all():
            continue
        names.append(f"{name}.png")
        title = f"{name.replace('_', ' ')} [{unit}]" if unit else name.replace("_", " ")
        with open_figure(folder / names[-1], width=COLUMN, height=COLUMN) as figure:
            plot = figure.subplots()
            if len(axes) == 1:
                plot.fill_between(axes[0][1], *values[:, 1:].T, alpha=0.3, color=COLOURS["fem"])
                plot.plot(axes[0][1], values[:, 0], "o-", color=COLOURS["fem"])
                plot.set(xlabel=labels[0], ylabel=title)
                continue
            image = values[:, 0].reshape(found.shape).T
            drawn = plot.contourf(axes[0][1], axes[1][1], image, _LINES)
            if np.ptp(image[np.isfinite(image)]) > 0:
                label_lines(plot, plot.contour(drawn, colors="black", linewidths=0.6), fontsize=6)
            figure.colorbar(drawn, ax=plot)
            plot.set(xlabel=labels[0], ylabel=labels[1], title=title)
    return names


def write_page(found: Swept, folder: Path) -> None:
    """Write `sweep.nc`, the maps and the page `index.html` into a folder.

    Raises:
        OSError: If the folder cannot be written.
    """
    from validation.report.page import render_page

    found.make_cube().to_netcdf(folder / "sweep.nc", engine="scipy")
    shown = {
        "sensor": found.tables.sensor, "versions": list_versions(), "sentences": list(found.explain()),
        "maps": draw_maps(found, folder), "table": tabulate(found, list(found.quantities)[:_MAPS]),
    }  # fmt: skip
    render_page("sweep.html.j2", shown, folder)
