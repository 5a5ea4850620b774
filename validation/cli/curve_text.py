"""Drawing of a curve as text, for a small picture in the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from meshes.array_types import FloatArray

#: Dots of a Braille character by row and column, as bits that are added to the first character of the block.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_FIRST = 0x2800
#: Number of rows and columns of dots in a character [-].
_ROWS, _COLUMNS = 4, 2
#: Number of points that a curve is sampled at, per column of dots [-].
_OVERSAMPLING = 8


def draw_curve(x: FloatArray, y: FloatArray, *, width: int = 60, height: int = 10) -> list[str]:
    """Draw a curve over the whole range of its values, with the ends of both axes as numbers.

    Args:
        x: Ascending values, shape (n,).
        y: Values at `x`, shape (n,).
        width: Width of the drawing without its numbers [characters].
        height: Height of the drawing [lines].

    Returns:
        Lines of text: the drawing, then a line with the ends of the range of x.
    """
    dots = np.zeros((height * _ROWS, width * _COLUMNS), dtype=bool)
    fine = np.linspace(x[0], x[-1], width * _COLUMNS * _OVERSAMPLING)
    values = np.interp(fine, x, y)
    low, high = float(values.min()), float(values.max())
    rows = np.rint((high - values) / ((high - low) or 1.0) * (len(dots) - 1)).astype(int)
    columns = np.minimum(np.arange(len(fine)) // _OVERSAMPLING, dots.shape[1] - 1)
    dots[rows, columns] = True
    margin = max(len(f"{end:.3g}") for end in (low, high))
    lines = []
    for line in range(height):
        block = dots[line * _ROWS : (line + 1) * _ROWS]
        text = "".join(_draw_character(block[:, k * _COLUMNS : (k + 1) * _COLUMNS]) for k in range(width))
        label = f"{high:.3g}" if line == 0 else f"{low:.3g}" if line == height - 1 else ""
        lines.append(f"{label:>{margin}} |{text}".rstrip(chr(_FIRST)))
    start, end = f"{x[0]:.3g}", f"{x[-1]:.3g}"
    return [*lines, " " * (margin + 2) + start + end.rjust(width - len(start))]


def _draw_character(dots: np.ndarray[tuple[int, int], np.dtype[np.bool_]]) -> str:
    bits = sum(_DOTS[i][j] for i in range(_ROWS) for j in range(_COLUMNS) if dots[i, j])
    return chr(_FIRST + bits)
