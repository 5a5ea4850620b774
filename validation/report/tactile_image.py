"""Drawing of tactile images as inline SVG: small, sharp at any size, with the value of each texel as a tooltip.

Row 0, the row of smallest y, is drawn at the bottom; only the drawing is flipped, never the data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Edge length of a texel on the page [px].
_CELL = 15
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


def tactile_image(array: TexelArray, values: FloatArray, scale: Scale, *, outline: FloatArray | None = None) -> str:
    """Draw a tactile image, one coloured square per texel, as an SVG element.

    Args:
        array: The n texels.
        values: Value of each texel, shape (n,).
        scale: Colour scale of the image.
        outline: Corners (x, y) of a closed line that is drawn over the image, for example around the contact area, in
            the array's frame, shape (m, 2) [m]; None for no line.
    """
    cells = "".join(_cell(array, index, float(value), scale) for index, value in enumerate(values))
    width, height = array.columns * _CELL, array.rows * _CELL
    line = "" if outline is None else _line(array, outline)
    return (
        f'<svg class="tactile" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img">'
        f"{cells}{line}</svg>"
    )


def colour_bar(scale: Scale) -> str:
    """Draw the legend of a colour scale: a bar with all colours between the least and the greatest value, as HTML."""
    last = len(scale.colours) - 1
    stops = "".join(
        f"<stop offset='{100 * i / last:.1f}%' stop-color='{colour}'/>" for i, colour in enumerate(scale.colours)
    )
    low = -scale.peak if scale.difference else 0.0
    name = "bar-difference" if scale.difference else "bar-force"
    return (
        f'<span class="bar"><span>{low * scale.factor:.4g}</span><svg width="90" height="10" role="img">'
        f'<defs><linearGradient id="{name}">{stops}</linearGradient></defs>'
        f'<rect width="90" height="10" fill="url(#{name})"/></svg>'
        f"<span>{scale.peak * scale.factor:.4g} {scale.unit}</span></span>"
    )


def _cell(array: TexelArray, index: int, value: float, scale: Scale) -> str:
    row, column = divmod(index, array.columns)
    colour, text = _MASKED, f"[{row}, {column}] no texel"
    if array.active[index]:
        colour, text = scale.colour(value), f"[{row}, {column}] {value * scale.factor:.4g} {scale.unit}"
    return (
        f'<rect x="{column * _CELL}" y="{(array.rows - 1 - row) * _CELL}" width="{_CELL}" height="{_CELL}" '
        f'fill="{colour}"><title>{text}</title></rect>'
    )


def _line(array: TexelArray, outline: FloatArray) -> str:
    low = array.centres[:, :2].min(axis=0) - np.array(array.pitch) / 2
    x, y = ((outline - low) / array.pitch).T
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x * _CELL, (array.rows - y) * _CELL, strict=True))
    return f'<polygon points="{points}" class="outline"/>'
