"""One style for all figures: sizes that a two-column paper prints, and colours that colour-blind readers tell apart.

The colours of lines are those of M. Okabe and K. Ito, "Color Universal Design" (2008).  Texel values have the colours
of `validation.render.image`, so that a figure and the report's page show one value in one colour.
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from meshes import atomic_file
from meshes.array_types import FloatArray
from validation.extras import MissingExtraError
from validation.render.image import LEAST_PULL, MASKED, PULLED, Scale, spell_units, unroll

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.contour import ContourSet
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from meshes import TexelArray

_LOG = logging.getLogger(__name__)

#: Width of a figure across both columns of a paper, and across one column [inches].
PAGE, COLUMN = 7.2, 3.5
#: Colour of each kind of result in all figures.
COLOURS = {
    "fem": "#0072b2", "fast": "#d55e00", "exact": "#000000", "fit": "#009e73", "foundation": "#56b4e9",
    "boxes": "#cc79a7", "no-spread": "#e69f00", "zeros": "#8a8f98",
}  # fmt: skip
COLOURS |= {"gaussian": COLOURS["foundation"], "rigid": COLOURS["boxes"]}
#: Colours of layers from bottom to top, of indenters, and of the line around a contact area.
LAYERS, INDENTER, OUTLINE = ("#d8cfc0", "#b5cde0", "#cfe0b8", "#e6c8d4"), "#7d8794", "#ff5da2"
#: Settings of matplotlib.  Names may come from strangers, so that text is never read as mathematics.
_STYLE: dict[Any, Any] = {
    "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "legend.fontsize": 7, "xtick.labelsize": 7,
    "ytick.labelsize": 7, "figure.titlesize": 9, "lines.linewidth": 1.2, "lines.markersize": 4,
    "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6, "xtick.major.width": 0.6,
    "ytick.major.width": 0.6, "legend.frameon": False, "text.parse_math": False, "svg.fonttype": "none",
    "axes.prop_cycle": f"cycler('color', {[COLOURS[each] for each in ('fem', 'fast', 'fit', 'no-spread', 'boxes')]})",
}  # fmt: skip
#: Resolution of a figure in pixels [1/inch].
_DPI = 200
#: Largest number of marks along one edge of a tactile image [-].
_MARKS = 7
#: Least distance of the label of an iso-line from the edges of its axes, over their length [-].
_MARGIN = 0.06


@contextlib.contextmanager
def open_figure(target: Path | IO[str], *, height: float, width: float = PAGE, **options: Any) -> Iterator[Figure]:  # noqa: ANN401
    """Open a figure in the style of all figures, and save it, completely or not at all, after the `with` block.

    Args:
        target: File to write.
        height: Height of the figure [inches].
        width: Width of the figure [inches].
        **options: Further options of matplotlib's `savefig`.

    Raises:
        ImportError: If matplotlib is not installed.
        OSError: If the file cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        for text in figure.findobj(Text):  # Terminals may lack the letter; pictures do not.
            text.set_text(spell_units(text.get_text()))
        if not isinstance(target, Path):
            figure.savefig(target, dpi=_DPI, **options)
            return
        drawn = io.BytesIO()
        figure.savefig(drawn, format=target.suffix[1:], dpi=_DPI, **options)
    target.parent.mkdir(parents=True, exist_ok=True)
    atomic_file.replace(target, [drawn.getvalue()])


def save_figure(path: Path, draw: Callable[[Path], None]) -> tuple[str, ...]:
    """Draw a picture that is no result by itself, and return its name; a warning and no name without matplotlib.

    Args:
        path: The picture.
        draw: Function that draws it by `open_figure`.

    Raises:
        OSError: If the file cannot be written.
    """
    try:
        draw(path)
    except ImportError:
        _LOG.warning("no picture: %s", MissingExtraError("matplotlib"))
        return ()
    return (path.name,)


def label_lines(axes: Axes, lines: ContourSet, **options: Any) -> None:  # noqa: ANN401
    """Write its value on each iso-line that has a place for it inside the axes, away from their edges.

    Args:
        axes: Axes of the lines.
        lines: The iso-lines.
        **options: Further options of matplotlib's `clabel`.
    """
    places: list[Any] = []
    inwards = axes.transData + axes.transAxes.inverted()
    for parts in lines.allsegs:
        dense = [np.linspace(part[:-1], part[1:], 20).swapaxes(0, 1).reshape(-1, 2) for part in parts if len(part) > 1]
        inside = [part[(np.abs(inwards.transform(part) - 0.5) < 0.5 - _MARGIN).all(axis=1)] for part in dense]
        if longest := max(inside, key=len, default=np.empty((0, 2))).tolist():
            places.append(longest[len(longest) // 2])
    axes.clabel(lines, manual=places, **options)


def draw_texels(
    axes: Axes, array: TexelArray, values: FloatArray, scale: Scale, *, title: str = ""
) -> AxesImage | PolyCollection:
    """Draw the values of an array in the colours of a scale.

    Texels on a grid are counted, row 0 at the bottom; a single row is as high as the axes, so that it can be seen.
    Others are squares on the surface, unrolled about the middle texel, in mm.

    Args:
        axes: Axes to draw into.
        array: The n texels.
        values: Value of each texel, shape (n,).
        scale: Colour scale of the image; its factor applies to the values.
        title: Text above the image.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LinearSegmentedColormap

    shown = np.where(array.active, scale.factor * np.asarray(values, dtype=np.float64), np.nan)
    colours = LinearSegmentedColormap.from_list("texels", scale.colours).with_extremes(bad=MASKED, under=PULLED)
    peak = scale.factor * scale.peak or 1.0
    if not scale.difference:  # Smaller pulls have the colour of zero.
        shown = np.where(shown < -LEAST_PULL * peak, shown, np.maximum(shown, 0))
    limits = (-peak if scale.difference else 0.0, peak)
    if not array.regular:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(array.texel_size) / 2
        squares = PolyCollection(list(1e3 * (unroll(array)[:, None] + corners)), edgecolors="white", linewidths=0.3)
        squares.set(array=shown, cmap=colours, clim=limits)
        axes.add_collection(squares)
        axes.autoscale_view()
        axes.set(title=title, xlabel="unrolled x [mm]", ylabel="unrolled y [mm]", aspect="equal")
        return squares
    row = array.rows == 1
    drawn = axes.imshow(
        array.image(shown), origin="lower", aspect="auto" if row else array.pitch[1] / array.pitch[0], cmap=colours,
        vmin=limits[0], vmax=limits[1],
    )  # fmt: skip
    for axis, count in ((axes.xaxis, array.columns), (axes.yaxis, array.rows)):
        axis.set_ticks(range(0, count if count > 1 else 0, math.ceil(count / _MARKS)))
    axes.set(title=title, xlabel="texel" if row else "column", ylabel="" if row else "row")
    return drawn
