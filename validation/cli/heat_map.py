"""Drawing of tactile images as coloured text: one number per texel, on its colour in the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.table import Column, Table
from rich.text import Text

from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.render.image import Scale, choose_ink

#: Largest width of a texel in a tactile image that is drawn as text [characters].
CELL = 6
#: Width of the space between two images side by side [characters].
GAP = 3


def draw_heat_map(
    values: npt.NDArray[Any],
    scale: Scale,
    active: npt.NDArray[np.bool_] | None = None,
    *,
    cell: int = CELL,
) -> Text:
    """Draw one tactile image as coloured text, with row 0 at the bottom.

    Args:
        values: Values of the texels, shape (rows, columns); printed as whole numbers in the unit of the scale.
        scale: Colour scale of the image.
        active: Whether each texel is drawn, shape (rows, columns); all texels if None.
        cell: Width of a texel [characters].

    Returns:
        Text with one line per row of texels.
    """
    text = Text()
    for row in range(len(values) - 1, -1, -1):
        for column, value in enumerate(values[row].tolist()):
            if active is not None and not active[row, column]:
                text.append(" " * cell)
                continue
            colour = scale.colour(value)
            text.append(f"{round(scale.factor * value):{cell}d}", style=f"{choose_ink(colour)} on {colour}")
        text.append("\n")
    return text


def draw_force_images(array: TexelArray, images: Sequence[tuple[str, FloatArray]], *, width: int = 80) -> Table:
    """Draw images of texel forces in mN as coloured text, with one colour scale for all images.

    The width of the texels is reduced to that of their numbers if the images then fit side by side.

    Args:
        array: The array of n texels to which all images belong.
        images: Title of each image, and forces on its texels, shape (n,) [N].
        width: Width of the terminal [characters].  The images are drawn side by side if they fit, else one below the
            other.
    """
    peak = max(float(np.max(np.abs(forces))) for _, forces in images) or 1.0
    active = np.asarray(array.image(array.active))
    narrowest = 1 + max(len(f"{1e3 * force:.0f}") for _, forces in images for force in forces)
    room = (width + GAP) // len(images) - GAP
    cell = max(min(CELL, room // array.columns), narrowest)
    maps = [
        draw_heat_map(
            np.asarray(array.image(forces)), Scale(peak=peak, difference=title == "difference"), active, cell=cell
        )
        for title, forces in images
    ]
    titles = [Text(f"{title}, mN", style="bold") for title, _ in images]
    rows = [titles, maps]
    if any(max(cell * array.columns, len(title)) > room for title in titles):
        rows = [[each] for pair in zip(titles, maps, strict=True) for each in pair]
    table = Table.grid(*(Column(no_wrap=True) for _ in rows[0]), padding=(0, GAP))
    for row in rows:
        table.add_row(*row)
    return table


def draw_share_image(image: FloatArray, *, most: int = 4) -> Text:
    """Draw an image of shares of a load in percent, cut to the texels around the one with the largest share.

    Args:
        image: Shares, shape (rows, columns) [-].
        most: Largest number of texels that are drawn on each side of the largest one [-].
    """
    row, column = np.unravel_index(int(np.argmax(image)), image.shape)
    part = image[max(0, row - most) : row + most + 1, max(0, column - most) : column + most + 1]
    return draw_heat_map(part, Scale(peak=float(image.max()), unit="%", factor=100), cell=4)
