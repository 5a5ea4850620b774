"""Drawing of tactile images as coloured text: one number per texel on a background from black over red to yellow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from rich.table import Column, Table
from rich.text import Text

from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Width of a texel in the text [characters].
CELL = 6
#: Width of the space between two images side by side [characters].
GAP = 3
#: Background colour of negative values, dark blue: red, green and blue, each 0..255.
NEGATIVE = (30, 50, 110)
#: Red component of a background colour, 0..255, above which the text on the background is black; else it is white.
BLACK_TEXT_FROM = 191


def to_colours(shares: FloatArray) -> npt.NDArray[np.uint8]:
    """Convert values, given as shares of the full scale, to colours.

    Args:
        shares: Values over the full scale, any shape; values above 1 are drawn as 1 [-].

    Returns:
        Red, green and blue, each 0..255, shape (..., 3): from black at 0 over red to yellow at 1; dark blue below 0.
    """
    level = np.sqrt(np.clip(shares, 0, 1))
    red_green_blue = np.stack([level, 0.72 * level**1.5, 0.25 * level**3], axis=-1)
    colours: npt.NDArray[np.uint8] = np.rint(255 * red_green_blue).astype(np.uint8)
    colours[np.asarray(shares) < 0] = NEGATIVE
    return colours


def draw_heat_map(
    numbers: npt.NDArray[np.integer],
    shares: FloatArray,
    active: npt.NDArray[np.bool_] | None = None,
    *,
    cell: int = CELL,
) -> Text:
    """Draw one tactile image as coloured text, with row 0 at the bottom.

    Args:
        numbers: Number that is printed in each texel, shape (rows, columns).
        shares: Value of each texel over the full scale, which determines its colour, shape (rows, columns) [-].
        active: Whether each texel is drawn, shape (rows, columns); all texels if None.
        cell: Width of a texel [characters].

    Returns:
        Text with one line per row of texels.
    """
    text, colours = Text(), to_colours(shares).tolist()
    for row in range(len(numbers) - 1, -1, -1):
        for column, number in enumerate(numbers[row].tolist()):
            if active is not None and not active[row, column]:
                text.append(" " * cell)
                continue
            red, green, blue = colours[row][column]
            foreground = "black" if red > BLACK_TEXT_FROM else "white"
            text.append(f"{number:{cell}d}", style=f"{foreground} on rgb({red},{green},{blue})")
        text.append("\n")
    return text


def draw_force_images(array: TexelArray, images: Sequence[tuple[str, FloatArray]], *, width: int = 80) -> Table:
    """Draw images of texel forces in mN as coloured text, with one colour scale for all images.

    The texels are narrowed to their numbers if the images fit side by side then.

    Args:
        array: The array of n texels to which all images belong.
        images: Title of each image, and forces on its texels, shape (n,) [N].
        width: Width of the terminal: the images are drawn side by side if they fit, else one below the other
            [characters].
    """
    peak = max(float(np.max(np.abs(forces))) for _, forces in images) or 1.0
    active = np.asarray(array.image(array.active))
    shown = [np.rint(1e3 * np.asarray(array.image(forces))).astype(np.int64) for _, forces in images]
    narrowest = 1 + max(len(str(number)) for image in shown for number in image.ravel().tolist())
    room = (width + GAP) // len(images) - GAP
    cell = max(min(CELL, room // array.columns), narrowest)
    maps = [
        draw_heat_map(image, np.asarray(1e-3 * image / peak, dtype=np.float64), active, cell=cell) for image in shown
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
    """Draw an image of shares of a load in percent, cut to the neighbourhood of its largest texel.

    Args:
        image: Shares, shape (rows, columns) [-].
        most: Number of texels that are drawn on each side of the largest one, at most [-].
    """
    row, column = np.unravel_index(int(np.argmax(image)), image.shape)
    part = image[max(0, row - most) : row + most + 1, max(0, column - most) : column + most + 1]
    return draw_heat_map(np.rint(100 * part).astype(np.int64), part / image.max(), cell=4)
