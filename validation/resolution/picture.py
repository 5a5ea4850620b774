"""Pictures: the error of place over the array, and the touches of a frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.render.figure import COLUMN, OUTLINE, draw_texels, open_figure
from validation.render.image import Scale

if TYPE_CHECKING:
    from meshes import TexelArray
    from validation.resolution.frames import Frames
    from validation.resolution.limits import Limits
    from validation.resolution.locate import Located


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


def draw_touches(found: Located, array: TexelArray, frames: Frames, path: Path) -> None:
    """Draw the brightest frame, and on arrays of several rows its touches with their intervals.

    Args:
        found: Touches of the frames.
        array: The array.
        frames: The frames.
        path: The picture, .png or .svg.

    Raises:
        ImportError: If matplotlib is not installed.
        OSError: If the file cannot be written.
    """
    number = int(np.argmax(frames.values.sum(axis=1)))
    values = np.zeros(array.count)
    values[array.active] = frames.values[number]
    scale = Scale(peak=float(values.max()), unit="N" if frames.forces else "counts")
    frame = found.frames[number]
    with open_figure(path, width=COLUMN, height=COLUMN) as figure:
        axes = figure.subplots()
        drawn = draw_texels(axes, array, values, scale, title=f"{found.sensor}, {frame.time:g} s")
        for touch in frame.touches if array.rows > 1 else ():
            ends = [
                (np.array([each.low, each.value, each.high]) - array.centres[0, axis]) / array.pitch[axis]
                for axis, each in enumerate((touch.x, touch.y))
            ]
            bars = [[[middle - low], [high - middle]] for low, middle, high in ends]
            axes.errorbar(ends[0][1], ends[1][1], xerr=bars[0], yerr=bars[1], fmt="+", color=OUTLINE)
        figure.colorbar(drawn, ax=axes, label=scale.unit)
