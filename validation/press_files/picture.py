"""Draws one indentation: the forces of both models, their difference, and the depth profile of the cover."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.extras import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fem_reference.fields.cover_fields import CoverFields
    from meshes import TexelArray
    from meshes.array_types import FloatArray
    from validation.campaign.comparison import Comparison

_LOG = logging.getLogger(__name__)

#: Distance of a node from the plane of the profile, over the thickness of the cover, up to which it is drawn [-].
_IN_PLANE = 1e-6
#: Largest number of radii of contact that the profile extends to each side of the axis [-].
_EXTENT = 4.0


def write_picture(comparison: Comparison, folder: Path) -> tuple[str, ...]:
    """Write `press.svg` and `press.png`, if matplotlib is installed.

    Args:
        comparison: Result of at least one of the models.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        _LOG.warning("no picture: %s", MissingExtraError("matplotlib"))
        return ()
    images = list(list_images(comparison))
    fields = None if comparison.fem is None else comparison.fem.fields
    panels = len(images) + (fields is not None)
    figure = Figure(figsize=(2.9 * panels + 1.5, 4.4), layout="constrained")
    ratios = [1.0] * len(images) + [1.7] * (fields is not None)
    axes = np.atleast_1d(np.asarray(figure.subplots(1, panels, width_ratios=ratios)))
    peak = max(float(np.max(np.abs(forces))) for _, forces in images) or 1.0
    for panel, (title, forces) in zip(axes, images, strict=False):
        _draw_image(panel, comparison.sensor.array, title, forces, peak=peak)
    if fields is not None:
        _draw_profile(axes[-1], comparison, fields)
    case = comparison.case
    figure.suptitle(f"{case.shape} on {comparison.sensor.array.name}, {case.load:.4g} N")
    names = ("press.svg", "press.png")
    for name in names:
        figure.savefig(folder / name, dpi=150)
    return names


def list_images(comparison: Comparison) -> Iterator[tuple[str, FloatArray]]:
    """Yield title and texel forces of each model, shape (n,) [N], and of their difference if there are both."""
    fem = comparison.fem if "fem" in comparison.models else None
    if fem is not None:
        yield "finite elements", fem.texel_forces
    if comparison.fast is not None:
        yield "fast model", comparison.fast.texel_forces
    if fem is not None and comparison.fast is not None:
        yield "difference", comparison.fast.texel_forces - fem.texel_forces


def find_profile(fields: CoverFields, at: tuple[float, float], yaw: float) -> tuple[FloatArray, FloatArray]:
    """Find the surface of the deformed cover along the indenter's x axis.

    Args:
        fields: Displacement in the cover.
        at: Position of the indenter's axis in the frame of the array [m].
        yaw: Rotation of the indenter about its axis [rad].

    Returns:
        Distances from the axis after deformation, ascending, shape (k,) [m], and displacements along z there, shape
        (k,) [m].  Tangential displacements move the points along the axis too.
    """
    top = float(fields.position[:, 2].max())
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    if fields.axisymmetric:
        turn = np.eye(2)
    local = (fields.position[:, :2] - at) @ turn.T
    moved = (fields.position[:, :2] + fields.displacement[:, :2] - at) @ turn.T
    on_top = np.abs(fields.position[:, 2] - top) < _IN_PLANE * top
    nearest = float(np.abs(local[on_top, 1]).min())
    chosen = on_top & (np.abs(local[:, 1]) <= nearest + _IN_PLANE * top)
    distance, height = moved[chosen, 0], fields.displacement[chosen, 2]
    if fields.axisymmetric:
        distance, height = np.concatenate([-distance, distance]), np.concatenate([height, height])
    order = np.argsort(distance, kind="stable")
    return distance[order], height[order]


def _draw_image(axes: Axes, array: TexelArray, title: str, forces: FloatArray, *, peak: float) -> None:
    """Draw one image of texel forces in mN, row 0 at the bottom; a difference has a scale of its own, with its sign."""
    image = np.where(array.image(array.active), 1e3 * np.asarray(array.image(forces), dtype=np.float64), np.nan)
    signed = title == "difference"
    top = float(np.nanmax(np.abs(image))) or 1.0 if signed else 1e3 * peak
    aspect, colours, least = array.pitch[1] / array.pitch[0], "RdBu_r" if signed else "viridis", -top if signed else 0.0
    drawn = axes.imshow(image, origin="lower", aspect=aspect, cmap=colours, vmin=least, vmax=top)
    axes.set(title="fast - finite elements" if signed else title, xlabel="column", ylabel="row")
    axes.figure.colorbar(drawn, ax=axes, label="mN", location="bottom", shrink=0.8)


def _draw_profile(axes: Axes, comparison: Comparison, fields: CoverFields) -> None:
    case, fem = comparison.case, comparison.fem
    distance, height = find_profile(fields, case.pose.at, case.pose.yaw)
    radius = math.sqrt(fem.contact_area / math.pi) if fem is not None else 0.0
    extent = max(_EXTENT * radius, 2 * float(fields.position[:, 2].max()))
    shown = np.abs(distance) <= extent
    axes.plot(1e3 * distance[shown], 1e3 * height[shown], label="surface of the cover")
    if fem is not None:
        axes.axhline(-1e3 * fem.depth, linestyle=":", color="grey", label=f"depth {1e3 * fem.depth:.3g} mm")
    axes.axhline(0.0, linewidth=0.6, color="grey")
    axes.set(xlabel="along the indenter's x axis [mm]", ylabel="height above rest [mm]", title="depth profile")
    axes.legend(frameon=False, loc="center left", fontsize="small")
