"""Drawing of tactile images as inline SVG: sharp at any size, with the value of each texel in it and as a tooltip.

Row 0, the row of smallest y, is drawn at the bottom; only the drawing is flipped, never the data.
"""

from __future__ import annotations

import html
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Edge length of a texel in the units of the drawing, and on the page [px]; the page may show it smaller or larger.
_CELL, _SHOWN = 15, 26
#: Size of the printed values in the units of the drawing, and largest number of characters of a value [-].
_FONT, _LONGEST = 5.6, 5
#: Colours of forces from zero to the peak, with increasing lightness.
_FORCE = ("#1b1340", "#3b2f74", "#3f5a94", "#36839a", "#3aa78d", "#79c66a", "#c9dd4b", "#fdf3a1")
#: Colours of differences from the negative to the positive peak, white at zero.
_DIFFERENCE = ("#0b4f8a", "#3f8cc4", "#a3cfe6", "#ffffff", "#f6b89b", "#d9604c", "#97142a")
#: Colour of masked texels.
_MASKED = "#e6e6ea"


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
        """Colours at equal steps from the lowest to the highest value of the scale."""
        return _DIFFERENCE if self.difference else _FORCE

    def colour(self, value: float) -> str:
        """Return the colour of a value, as `#rrggbb`."""
        share = value / self.peak if self.peak > 0 else 0.0
        place = 0.5 + share / 2 if self.difference else share
        steps = np.linspace(0, 1, len(self.colours))
        channels = ([int(colour[k : k + 2], 16) for colour in self.colours] for k in (1, 3, 5))
        return "#" + "".join(f"{round(float(np.interp(place, steps, channel))):02x}" for channel in channels)


def tactile_image(
    array: TexelArray,
    values: FloatArray,
    scale: Scale,
    *,
    outline: FloatArray | None = None,
    name: str = "Texel values",
) -> str:
    """Draw a tactile image, one coloured square per texel with its value, as an SVG element with a label.

    Args:
        array: The n texels.
        values: Value of each texel, shape (n,).
        scale: Colour scale of the image.
        outline: Corners (x, y) of a closed line that is drawn over the image, for example around the contact area, in
            the array's frame, shape (m, 2) [m]; None for no line.
        name: What the image shows, for its label.
    """
    cells = "".join(_cell(array, index, float(value), scale) for index, value in enumerate(values))
    width, height = array.columns * _CELL, array.rows * _CELL
    line = "" if outline is None else _line(array, outline)
    label = html.escape(f"{name}: {_describe(array, values, scale)}")
    return (
        f'<svg class="tactile" viewBox="0 0 {width} {height}" width="{array.columns * _SHOWN}" '
        f'height="{array.rows * _SHOWN}" role="img" aria-label="{label}">{cells}{line}</svg>'
    )


def colour_bar(scale: Scale) -> str:
    """Draw the legend of a colour scale: a bar with all colours between the least and the greatest value, as HTML."""
    low = -scale.peak if scale.difference else 0.0
    edge = 90 / len(scale.colours)
    blocks = "".join(
        f'<rect x="{i * edge:.2f}" width="{edge + 0.1:.2f}" height="10" fill="{colour}"/>'
        for i, colour in enumerate(scale.colours)
    )
    first, last = f"{low * scale.factor:.4g}", html.escape(f"{scale.peak * scale.factor:.4g} {scale.unit}")
    return (
        f'<span class="bar"><span>{first}</span><svg width="90" height="10" role="img" '
        f'aria-label="Colour scale from {first} to {last}">{blocks}</svg><span>{last}</span></span>'
    )


def _describe(array: TexelArray, values: FloatArray, scale: Scale) -> str:
    """Describe an image in words: its size and the texel with the largest absolute value."""
    shown = np.where(array.active, values, 0.0)
    row, column = divmod(int(np.argmax(np.abs(shown))), array.columns)
    largest = float(shown[row * array.columns + column]) * scale.factor
    size = f"{array.rows} rows, {array.columns} columns"
    return f"{size}; largest {largest:.4g} {scale.unit} in row {row}, column {column}"


def _cell(array: TexelArray, index: int, value: float, scale: Scale) -> str:
    row, column = divmod(index, array.columns)
    colour, text, printed = _MASKED, f"[{row}, {column}] no texel", ""
    x, y = column * _CELL, (array.rows - 1 - row) * _CELL
    if array.active[index]:
        colour, text = scale.colour(value), f"[{row}, {column}] {value * scale.factor:.4g} {scale.unit}"
        ink = choose_ink(colour)
        printed = (
            f'<text x="{x + _CELL / 2}" y="{y + _CELL / 2 + _FONT / 3:.1f}" font-size="{_FONT}" fill="{ink}" '
            f'text-anchor="middle">{shorten(value * scale.factor)}</text>'
        )
    return (
        f'<rect x="{x}" y="{y}" width="{_CELL}" height="{_CELL}" fill="{colour}"><title>{text}</title></rect>{printed}'
    )


def choose_ink(colour: str) -> str:
    """Return black or white, whichever can be read on a colour `#rrggbb`."""
    return "#000" if measure_luminance(colour) > _MIDDLE else "#fff"


def shorten(value: float) -> str:
    """Format a value with at most five characters, without a minus sign before zero."""
    for decimals in (0,) if abs(value) >= 10 else (1, 0):  # noqa: PLR2004 -- two digits are enough
        text = f"{value:.{decimals}f}"
        if float(text) == 0:
            return "0"
        if len(text) <= _LONGEST:
            return text.replace("-", "\u2212")
    return f"{value:.0e}"


#: Luminance at which black and white text have the same contrast to the ground (WCAG 2, relative luminance) [-].
_MIDDLE = 0.179


def measure_luminance(colour: str) -> float:
    """Return the relative luminance of a colour `#rrggbb` (WCAG 2) [-]."""
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]  # noqa: PLR2004 -- sRGB
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


def _line(array: TexelArray, outline: FloatArray) -> str:
    low = array.centres[:, :2].min(axis=0) - np.array(array.pitch) / 2
    x, y = ((outline - low) / array.pitch).T
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x * _CELL, (array.rows - y) * _CELL, strict=True))
    return f'<polygon points="{points}" class="outline"/>'
