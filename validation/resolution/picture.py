"""Pictures: the error of place over the array, and the touches of a frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes.solids.texels import tangent_axes
from validation.render.figure import COLUMN, OUTLINE, draw_texels, open_figure
from validation.render.image import Scale, unroll

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
    scale = Scale(peak=float(np.nanmax(values)), unit="\u00b5m", factor=1e6)
    with open_figure(path, width=COLUMN, height=COLUMN, bbox_inches="tight") as figure:
        axes = figure.subplots()
        title = f"{found.sensor}: error of place per axis\n{found.load:g} N, force known"
        drawn = draw_texels(axes, array, values, scale, title=title)
        figure.colorbar(drawn, ax=axes, label="error of place [\u00b5m]")


def draw_touches(found: Located, array: TexelArray, frames: Frames, path: Path) -> None:
    """Draw the brightest frame and its touches with their intervals; curved arrays are unrolled.

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
    scale = Scale(peak=float(values.max()), unit="N" if frames.forces else "counts", factor=1.0)
    frame = found.frames[number]
    flat = array.regular
    places = (array.centres - array.centres[0])[:, :2] / array.pitch if flat else 1e3 * unroll(array)
    unit = np.array(array.pitch) if flat else np.full(2, 1e-3)
    with open_figure(path, width=COLUMN, height=COLUMN, bbox_inches="tight") as figure:
        axes = figure.subplots()
        title = f"{found.sensor}, {frame.time:g} s"
        drawn = draw_texels(axes, array, values, scale, title=title)
        for touch in frame.touches:
            ends = [[each.low, each.value, each.high] for each in (touch.x, touch.y, touch.z)]
            low, middle, high = np.transpose(ends)
            near = int(np.argmin(np.linalg.norm(array.centres - middle, axis=1)))
            along = tangent_axes(array.normals[[near]])[0]
            x, y = places[near] + along @ (middle - array.centres[near]) / unit
            half = np.abs(along) @ (high - low) / 2 / unit
            axes.errorbar(x, y, xerr=half[0], yerr=half[1], fmt="+", color=OUTLINE)
        figure.colorbar(drawn, ax=axes, label=f"force [{scale.unit}]" if frames.forces else scale.unit)
