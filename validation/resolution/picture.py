"""Picture of the error of place over the array."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.render.figure import COLUMN, draw_texels, open_figure
from validation.render.image import Scale

if TYPE_CHECKING:
    from meshes import TexelArray
    from validation.resolution.limits import Limits


def draw_map(found: Limits, array: TexelArray, path: Path) -> None:
    """Draw the error of place of touches above each texel.

    Args:
        found: Limits with `by_texel`.
        array: The array.
        path: The picture, .png or .svg.

    Raises:
        ImportError: If matplotlib is not installed.
        OSError: If the file cannot be written.
    """
    values = np.array([np.nan if each is None else each for each in found.by_texel])
    scale = Scale(peak=float(np.nanmax(values)), unit="um", factor=1e6)
    with open_figure(path, width=COLUMN, height=COLUMN) as figure:
        axes = figure.subplots()
        title = f"{found.sensor}: error of place per axis\n{found.load:g} N, force known"
        drawn = draw_texels(axes, array, values, scale, title=title)
        figure.colorbar(drawn, ax=axes, label="um")
