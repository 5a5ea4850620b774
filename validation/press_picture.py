"""The picture of one indentation: texel forces of the models, and a section through the cover and the indenter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover
from validation.places import find_middle
from validation.render.figure import COLUMN, INDENTER, LAYERS, OUTLINE, PAGE, draw_texels, open_figure, save_figure
from validation.render.image import LEAST_PULL, Scale, find_outline
from validation.text.indenter import describe_indenter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from fastmodel import FastIndentation
    from fem_reference.fields.cover_fields import CoverFields
    from fem_reference.indentation.result import Indentation
    from meshes.array_types import FloatArray
    from validation.campaign.comparison import Comparison


#: Tolerance with which nodes are found on a level of the cover and in the plane of the section, over the thickness of
#: the cover [-].
_IN_PLANE = 1e-6
#: Half the width of the section, over the radius of the contact area [-].
_EXTENT = 4.0
#: Number of points along the section [-].
_POINTS = 801


def describe_force(found: Indentation | FastIndentation) -> str:
    """Describe the force of a press [N]: its parts on a flat base, which add up to it, or its component on a solid."""
    total, outside = found.total_force, found.outside
    if getattr(found, "mesh", found.force) is not None:
        return f"{total:.4f} N along the motion"
    texels = float(found.texel_forces.sum())
    # Adding 0.0 removes the minus sign of a value that is rounded to negative zero.
    outside, rest = (round(each, 4) + 0.0 for each in (outside, total - texels - outside))
    text = f"{total:.4f} N: {texels:.4f} N on the texels, {outside:.4f} N outside the array"
    return f"{text}, {rest:+.4f} N not balanced" if rest else text


def write_picture(comparison: Comparison, folder: Path) -> tuple[str, ...]:
    """Write `press.png`, if matplotlib is installed: texel forces of the models, their difference, and a section.

    The section shows the layers of a flat cover and the indenter: deformed, if the finite elements have fields, else
    before the load.

    Args:
        comparison: Result of at least one of the models.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    images = list(list_images(comparison))
    case, found = comparison.case, comparison.fem or comparison.fast
    cover = getattr(comparison.sensor, "cover", None)
    flat = isinstance(cover, Cover)
    width = PAGE if len(images) > 1 else COLUMN
    rows, columns = comparison.sensor.array.rows, comparison.sensor.array.columns
    x, y = comparison.sensor.array.pitch
    tall = min(max(1.4 + 1.6 * rows * y / (columns * x), 2.4), 3.9)  # as high as the images need

    def draw(path: Path) -> None:
        with open_figure(path, width=width, height=tall + 1.9 * flat) as figure:
            above, *below = figure.subfigures(1 + flat, 1, squeeze=False, height_ratios=(tall, 1.9)[: 1 + flat])[:, 0]
            _draw_images(above, comparison, images)
            if isinstance(cover, Cover):
                _draw_section(below[0].subplots(), comparison, cover)
            shape = describe_indenter(case.shape)
            force = f"\n{describe_force(found)}" if found else ""
            figure.suptitle(f"{shape[0].upper()}{shape[1:]}, on {comparison.sensor.array.name}{force}")

    return save_figure(folder / "press.png", draw)


def list_images(comparison: Comparison) -> Iterator[tuple[str, FloatArray]]:
    """Yield title and texel forces of each computed model, shape (n,) [N].

    If both models are computed, the difference of the fast model from the finite elements follows.
    """
    fem = comparison.fem if "fem" in comparison.models else None
    if fem is not None:
        yield "finite elements", fem.texel_forces
    if comparison.fast is not None:
        yield "fast model", comparison.fast.texel_forces
    if fem is not None and comparison.fast is not None:
        yield "difference", comparison.fast.texel_forces - fem.texel_forces


def is_pulled(forces: FloatArray) -> bool:
    """Return whether a cover pulls a texel by more than 1 % of the largest force, given all forces, shape (n,) [N]."""
    return bool(forces.min() < -LEAST_PULL * np.abs(forces).max())


def find_profile(
    fields: CoverFields, at: tuple[float, float], yaw: float, level: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Find a deformed level of the cover along the indenter's x axis: the depth profile, for the level of its top.

    Args:
        fields: Displacement in the cover.
        at: Position of the indenter's axis in the frame of the array [m].
        yaw: Rotation of the indenter about its axis [rad].
        level: Height of the level before deformation, such as that of an interface of two layers; the top if None [m].

    Returns:
        Distances from the axis after deformation, ascending, shape (k,) [m], and displacements along z at these points,
        shape (k,) [m].  Tangential displacements also move the points along the axis.
    """
    top = float(fields.position[:, 2].max())
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    if fields.axisymmetric:
        turn = np.eye(2)
    local = (fields.position[:, :2] - at) @ turn.T
    moved = (fields.position[:, :2] + fields.displacement[:, :2] - at) @ turn.T
    on_top = np.abs(fields.position[:, 2] - (top if level is None else level)) < _IN_PLANE * top
    nearest = float(np.abs(local[on_top, 1]).min())
    chosen = on_top & (np.abs(local[:, 1]) <= nearest + _IN_PLANE * top)
    distance, height = moved[chosen, 0], fields.displacement[chosen, 2]
    if fields.axisymmetric:
        distance, height = np.concatenate([-distance, distance]), np.concatenate([height, height])
    order = np.argsort(distance, kind="stable")
    return distance[order], height[order]


def _draw_images(figure: SubFigure, comparison: Comparison, images: list[tuple[str, FloatArray]]) -> None:
    """Draw texel forces with one scale and their difference with another; a dashed line bounds the contact area."""
    panels = figure.subplots(1, len(images), squeeze=False)[0].tolist()
    array, fem = comparison.sensor.array, comparison.fem
    outline = None if fem is None else find_outline(array, fem)
    forces, apart = panels[:2], panels[2:]  # The difference is the third image.
    for group, shown, label in (
        (forces, images[:2], "force on the texel [mN]"),
        (apart, images[2:], "difference [mN]"),
    ):
        scale = Scale(peak=float(max((np.abs(each).max() for _, each in shown), default=0)), difference=group is apart)
        for panel, (name, values) in zip(group, shown, strict=True):
            title = "fast model \u2212 finite elements" if group is apart else name
            drawn = draw_texels(panel, array, values, scale, title=title)
            if outline is not None:
                origin, unit = (0, array.pitch) if array.regular else (find_middle(array), (1e-3, 1e-3))
                corners = ((outline - array.centres[origin, :2]) / unit).T
                panel.fill(*corners, fill=False, edgecolor=OUTLINE, linestyle="--", linewidth=0.9)
        pulled = group is forces and any(is_pulled(each) for _, each in shown)
        if group:
            text = f"{label}\nred: pulled, below zero" if pulled else label
            figure.colorbar(drawn, ax=group, label=text, extend="min" if pulled else "neither")


def _draw_section(axes: Axes, comparison: Comparison, cover: Cover) -> None:
    """Draw a section along the indenter's x axis to scale: the layers of the cover, its base and the indenter."""
    case, fem = comparison.case, comparison.fem
    fields = None if fem is None else fem.fields
    levels = np.cumsum([0.0, *(layer.thickness for layer in cover.layers)])
    top, depth = float(levels[-1]), 0.0 if fem is None or fields is None else fem.depth
    radius = 0.0 if fem is None else math.sqrt(fem.contact_area / math.pi)
    extent = max(_EXTENT * radius, 2 * top, 1.3 * case.indenter.footprint[0])
    x = np.linspace(-extent, extent, _POINTS)
    heights = [np.full_like(x, level) for level in levels]
    if fields is not None:
        profiles = [find_profile(fields, case.pose.at, case.pose.yaw, level) for level in levels.tolist()]
        heights = [level + np.interp(x, *profile) for level, profile in zip(levels, profiles, strict=True)]
    for index, (layer, low, high) in enumerate(zip(cover.layers, heights, heights[1:], strict=False)):
        label = f"{layer.material.name}, {1e3 * layer.thickness:.3g} mm"
        colour = LAYERS[index % len(LAYERS)]
        axes.fill_between(1e3 * x, 1e3 * low, 1e3 * high, facecolor=colour, edgecolor="#404040", lw=0.5, label=label)
    end = top + max(top, 0.3 * extent)
    gap = case.indenter.gap(x, np.zeros_like(x))
    x, gap = x[np.isfinite(gap)], gap[np.isfinite(gap)]
    turn, along = -case.pose.tilt[1], np.concatenate([x, x[::-1]])
    over = np.concatenate([gap, np.full_like(gap, 4 * end)])
    across, up = along * math.cos(turn) - over * math.sin(turn), along * math.sin(turn) + over * math.cos(turn)
    up += top - depth - up.min()
    axes.fill(1e3 * across, 1e3 * up, facecolor=INDENTER, edgecolor="#202020", lw=0.6, label="indenter", alpha=0.85)
    axes.axhline(0, color="black", linewidth=2, label=f"{cover.base} base")
    if fem is not None:
        axes.plot([], [], color=OUTLINE, linestyle="--", label="contact area, above")
    when = "before the load" if fields is None else f"at a depth of {1e3 * depth:.3g} mm"
    axes.set(
        xlim=(-1e3 * extent, 1e3 * extent), ylim=(-0.05e3 * end, 1e3 * end), aspect="equal", ylabel="height [mm]",
        xlabel="distance from the indenter's axis, along its x axis [mm]", title=f"section {when}, to scale",
    )  # fmt: skip
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0, reverse=True)
