"""Drawing of tactile images as inline SVG: sharp at any size, with the value of each texel in it and as a tooltip.

Row 0, the row of smallest y, is drawn at the bottom; only the drawing is flipped, never the data.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import pdist

from fastmodel.fitting.gaussian import unroll_from
from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.places import find_middle

#: Longest edge of the drawing of a tactile image, in units of its view box.
_SIZE = 200.0
#: Margin around the texels in the drawing of a tactile image, in units of its view box.
_MARGIN = 2.0
#: Largest width of a tactile image on the page [px]; three images stand side by side.
_WIDEST = 190.0
#: Largest height of a tactile image on the page [px].
_HIGHEST = 370.0
#: Edge of the square that represents a texel, over the smallest distance between two texels [-].
_EDGE = 0.94
#: Font size of the value printed in a texel, over the edge of the square that represents the texel [-].
_SHARE = 0.36
#: Micrometres after a number or in brackets.
_MICROMETRE = re.compile(r"(?<=[\d)] )um\b|(?<=\[)um(?=\])")
#: Largest number of characters of the value printed in a texel [-].
_LONGEST = 5
#: Colours of forces at equal steps from zero to the largest force, with increasing lightness.
_FORCE = ("#1b1340", "#3b2f74", "#3f5a94", "#36839a", "#3aa78d", "#79c66a", "#c9dd4b", "#fdf3a1")
#: Colours of differences of forces at equal steps from the most negative to the most positive one, white at zero.
_DIFFERENCE = ("#0b4f8a", "#3f8cc4", "#a3cfe6", "#ffffff", "#f6b89b", "#d9604c", "#97142a")
#: Colour of texels that do not measure.
MASKED = "#e6e6ea"
#: Colour in figures of texels that the cover pulls, and least pull that is shown and told, over the largest force [-].
PULLED, LEAST_PULL = "#e8432e", 0.01


def spell_units(text: str) -> str:
    """Write micrometres with their letter, which pictures and pages have and some terminals lack."""
    return _MICROMETRE.sub("\u00b5m", text)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """A colour scale of tactile images; images that are compared have the same scale.

    Attributes:
        peak: Value that is drawn with the last colour.
        difference: Whether the colours run from -peak to +peak with white at zero, instead of from 0 to peak.
        unit: Unit of the printed numbers.
        factor: Factor from the unit of the values to the unit of the printed numbers [-].
    """

    peak: float
    difference: bool = False
    unit: str = "mN"
    factor: float = 1e3

    @property
    def colours(self) -> tuple[str, ...]:
        """Colours `#rrggbb` of the scale, at equal steps from its lowest to its highest value."""
        return _DIFFERENCE if self.difference else _FORCE

    def rgb(self, values: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """Return the colours of values of any shape as red, green and blue, each 0..255, shape (..., 3)."""
        share = np.asarray(values, dtype=np.float64) / self.peak if self.peak > 0 else np.zeros(np.shape(values))
        place = 0.5 + share / 2 if self.difference else share
        steps = np.linspace(0, 1, len(self.colours))
        channels = np.transpose([list(bytes.fromhex(colour[1:])) for colour in self.colours])
        levels = np.stack([np.interp(place, steps, channel) for channel in channels], axis=-1)
        return np.asarray(np.rint(levels), dtype=np.uint8)

    def colour(self, value: float) -> str:
        """Return the colour of one value of the scale as text, `#rrggbb`."""
        return "#" + self.rgb(value).tobytes().hex()


def unroll(array: TexelArray) -> FloatArray:
    """Compute the places of n texels on the surface, unrolled about the middle texel, shape (n, 2) [m]."""
    middle = find_middle(array)
    return np.asarray(unroll_from(array, array.centres[[middle]], array.normals[[middle]])[0])


class _Frame:
    """Places of the texels of an array in a drawing; the surface is unrolled about the middle texel.

    Lengths in the drawing have the unit of its view box.

    Attributes:
        origin: Centre of the middle texel, from which the surface is unrolled, shape (3,) [m].
        places: Middle of each of n texels in the drawing, shape (n, 2).
        edge: Edge of the square of a texel in the drawing.
        size: Width and height of the drawing.
    """

    def __init__(self, array: TexelArray) -> None:
        middle, unrolled = find_middle(array), unroll(array)
        edge = _EDGE * (float(pdist(unrolled, "chebyshev").min()) if len(unrolled) > 1 else 1.0)
        self._low, high = unrolled.min(axis=0) - edge / 2, unrolled.max(axis=0) + edge / 2
        self._factor = (_SIZE - 2 * _MARGIN) / float((high - self._low).max())
        width, height = (self._factor * (high - self._low) + 2 * _MARGIN).tolist()
        self.origin, self.edge = array.centres[middle], self._factor * edge
        self.size = (round(width, 1), round(height, 1))
        self.places = self.draw(unrolled)

    def draw(self, unrolled: FloatArray) -> FloatArray:
        """Convert points of the unrolled surface, shape (m, 2) [m], to points of the drawing, whose y points down."""
        x, y = (_MARGIN + self._factor * (unrolled - self._low)).T
        return np.column_stack([x, self.size[1] - y])


def tactile_image(
    array: TexelArray,
    values: FloatArray,
    scale: Scale,
    *,
    outline: FloatArray | None = None,
    name: str = "Texel values",
    values_shown: bool = True,
) -> str:
    """Draw a tactile image, one coloured square per texel, as an SVG element with a label.

    The surface is unrolled about its middle texel.  Lengths are true on planes, and along arcs through this texel on
    cylinders and spheres.  All other lengths of a curved surface are distorted, as on a map of the globe.

    Args:
        array: The n texels.
        values: Value of each texel, shape (n,).
        scale: Colour scale of the image.
        outline: Corners (x, y) of a closed line that is drawn over the image of a planar array, for example around the
            contact area, in the array's frame, shape (m, 2) [m]; None for no line.
        name: Title of the image, for its label.
        values_shown: Whether each square shows its value; without values the drawing is five times smaller.
    """
    frame = _Frame(array)
    rows, columns = np.divmod(np.arange(array.count), array.columns)
    labels = [f"[{row}, {column}]" for row, column in zip(rows.tolist(), columns.tolist(), strict=True)]
    shown = [value if on else None for value, on in zip(values.tolist(), array.active.tolist(), strict=True)]
    if values_shown:
        cells = "".join(
            _draw_cell(frame, place, label, value, scale)
            for place, label, value in zip(frame.places.tolist(), labels, shown, strict=True)
        )
    else:
        cells = _draw_squares(frame, shown, scale)
    largest = int(np.argmax(np.abs(np.where(array.active, values, 0.0))))
    summary = f"{int(array.active.sum())} texels; largest {values[largest] * scale.factor:.4g} {scale.unit}"
    where = f"in row {rows[largest]}, column {columns[largest]}"
    line = ""
    if outline is not None:
        corners = frame.draw(outline - frame.origin[:2])
        line = f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in corners)}" class="outline"/>'
    width, height = frame.size
    zoom = min(_WIDEST / width, _HIGHEST / height)
    return (
        f'<svg class="tactile" viewBox="0 0 {width:g} {height:g}" width="{zoom * width:.0f}" '
        f'height="{zoom * height:.0f}" role="img" aria-label="{html.escape(f"{name}: {summary} {where}")}">'
        f'<g font-size="{_trim(frame.edge * _SHARE)}" text-anchor="middle" fill="white">{cells}</g>{line}</svg>'
    )


def _draw_cell(frame: _Frame, place: tuple[float, float], label: str, value: float | None, scale: Scale) -> str:
    """Draw the square of one texel with its value as SVG.

    Args:
        frame: Places of the texels in the drawing.
        place: Middle of the texel in the drawing.
        label: Row and column of the texel, for its tooltip.
        value: Value of the texel; None if the texel is masked.
        scale: Colour scale of the image.
    """
    colour = MASKED if value is None else scale.colour(value)
    (x, y), edge = place, frame.edge
    title = f"{label} no texel" if value is None else f"{label} {value * scale.factor:.4g} {scale.unit}"
    square = f'x="{_trim(x - edge / 2)}" y="{_trim(y - edge / 2)}" width="{_trim(edge)}" height="{_trim(edge)}"'
    text = ""
    if value is not None:
        ink = ' fill="black"' if choose_ink(colour) == "black" else ""
        text = f'<text x="{_trim(x)}" y="{_trim(y + edge * _SHARE / 3)}"{ink}>{shorten(value * scale.factor)}</text>'
    return f'<rect {square} fill="{colour}"><title>{title}</title></rect>{text}'


def _draw_squares(frame: _Frame, values: Sequence[float | None], scale: Scale) -> str:
    """Draw the squares of all texels as SVG, one path for each colour."""
    edge, paths = _trim(frame.edge), dict[str, str]()
    for (x, y), value in zip((frame.places - frame.edge / 2).tolist(), values, strict=True):
        colour = MASKED if value is None else scale.colour(value)
        paths[colour] = f"{paths.get(colour, '')}M{_trim(x)} {_trim(y)}h{edge}v{edge}h-{edge}z"
    return "".join(f'<path fill="{colour}" d="{path}"/>' for colour, path in paths.items())


def _trim(length: float) -> str:
    return f"{round(length, 2) + 0.0:g}"


class Pressed(Protocol):
    """Interface of a solved press, as far as its contact area is drawn."""

    @property
    def contact_points(self) -> FloatArray:
        """Positions of the points of contact in the array's frame, shape (m, 3) [m]."""

    @property
    def contact_forces(self) -> FloatArray:
        """Forces on the cover at these points, shape (m, 3) [N]."""


def find_outline(array: TexelArray, found: Pressed) -> FloatArray | None:
    """Return the convex hull of the contact area of a press, to be drawn over its tactile image.

    Returns:
        Corners (x, y) in the array's frame, shape (m, 2) [m]; None for an array that is not planar.
    """
    if not array.planar:
        return None
    points = found.contact_points[found.contact_forces.any(axis=1), :2]
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # Fewer than three cells are in contact, or all of them lie on one line.
        return np.asarray(points)


def colour_bar(scale: Scale) -> str:
    """Draw the legend of a colour scale: a bar with all colours between the least and the greatest value, as HTML."""
    low, ramp = -scale.peak if scale.difference else 0.0, ", ".join(scale.colours)
    first, last = f"{low * scale.factor:.4g}".replace("-", "\u2212"), f"{scale.peak * scale.factor:.4g} {scale.unit}"
    return (
        f'<span class="bar"><span>{first}</span><span role="img" class="ramp" style="background: '
        f'linear-gradient(90deg, {ramp})" aria-label="Colour scale"></span><span>{html.escape(last)}</span></span>'
    )


def choose_ink(colour: str) -> str:
    """Return `black` or `white`, whichever can be read on a ground of the colour `#rrggbb`."""
    return "black" if measure_luminance(colour) > _MIDDLE else "white"


def shorten(value: float) -> str:
    """Format a number with at most five characters; zero has no minus sign."""
    for decimals in (0,) if abs(value) >= 10 else (1, 0):  # noqa: PLR2004 -- two digits are enough
        text = f"{value:.{decimals}f}"
        if float(text) == 0:
            return "0"
        if len(text) <= _LONGEST:
            return text.replace("-", "\u2212")
    return f"{value:.0e}"


#: Relative luminance of a ground on which black text has the same contrast as white text (by WCAG 2) [-].
_MIDDLE = 0.179


def measure_luminance(colour: str) -> float:
    """Return the relative luminance of a colour `#rrggbb` (WCAG 2) [-]."""
    channels = [level / 255 for level in bytes.fromhex(colour[1:])]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]  # noqa: PLR2004 -- sRGB
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))
