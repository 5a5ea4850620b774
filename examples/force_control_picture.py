"""The pictures of the example `force_control.py`: loops over time, and what each model makes of the same controller."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from force_control import (
    BLOCK,
    MOST,
    PLACES,
    SLIDE_Y,
    STEP,
    WANTED,
    FloatArray,
    Loop,
    Record,
    load_sensor,
    make_images,
    step,
)
from matplotlib.figure import Figure

from meshes import Sphere

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Creep of the Weiss array on average [-], and the time from which a held load is taken as fully read [s].
CREEP, REFERENCE_TIME = 0.12, 2.0
#: The object that saturates single texels.
BALL = Sphere(radius=12e-3)
#: Colours of the models, or of loops of one panel.
COLOURS = ("#222222", "#2b6cb0", "#3a9d6e", "#dd8a34")


def make_loop(place: str, rate: float, *, late: float = 0.0, creep: float = 0.0) -> Loop:
    """Make the loop of a place of the block with the fast model, with a delay of some frames."""
    (x, y), (parameters, cover) = PLACES[place], load_sensor(rate, creep)
    images = make_images("fast", parameters, cover, BLOCK, places=[x], y=y)
    return Loop(images=images, expected=images, parameters=parameters, delay=late / rate)


def make_ball(rate: float = 271.0) -> Loop:
    """Make the loop with a ball, under which the middle texels saturate."""
    parameters, cover = load_sensor(rate)
    loads = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 9.0, MOST)
    images = make_images("fast", parameters, cover, BALL, loads=loads)
    return Loop(images=images, expected=images, parameters=parameters)


def draw_record(axis: Axes, found: Record, colour: str, name: str) -> None:
    """Draw the reading as a line, and the true force dashed."""
    axis.step(found.times, found.reading, where="post", color=colour, label=name)
    axis.step(found.times, found.true, "--", where="post", color=colour, linewidth=1.2)


def draw_steps(path: Path) -> None:
    """Draw steps, delays, a disturbance, creep, saturation and a load beside the array."""
    figure = Figure(figsize=(12, 7), layout="constrained")
    axes = figure.subplots(2, 3)
    for rate, colour in zip((31.0, 271.0), COLOURS, strict=False):
        draw_record(axes[0, 0], make_loop("near the edge", rate).run(1.2, step), colour, f"{rate:g} frames/s")
    axes[0, 0].set_title("step of the wanted force, near the edge")
    for late, colour in zip((0.0, 1.0, 3.0), COLOURS, strict=False):
        draw_record(
            axes[0, 1], make_loop("off-centre", 31.0, late=late).run(1.6, step), colour, f"{late:g} frames late"
        )
    axes[0, 1].set_title("delay of the sensor, 31 frames/s")
    for rate, colour in zip((31.0, 271.0), COLOURS, strict=False):
        found = make_loop("centre", rate).run(1.2, lambda _: WANTED, moved=lambda now: 1e-4 * (now >= STEP))
        draw_record(axes[0, 2], found, colour, f"{rate:g} frames/s")
    axes[0, 2].set_title("the object moves by 0.1 mm at 0.6 s")
    draw_creep(axes[1, 0])
    for name, loop, colour in (("block", make_loop("centre", 271.0), COLOURS[0]), ("ball", make_ball(), COLOURS[3])):
        found = loop.run(6.0, lambda now: 2.0 * now)
        axes[1, 1].plot(found.true, found.reading, color=colour, label=f"{name}, wanted force rises to 12 N")
    axes[1, 1].plot([0, 12], [0, 12], ":", color="grey")
    axes[1, 1].set_title("dead zone of the texels, and saturation")
    axes[1, 1].set_xlabel("true force [N]")
    draw_beside(axes[1, 2])
    for axis in axes.flat:
        axis.set_ylabel("force [N]")
        axis.legend(frameon=False, fontsize="small", loc="lower right")
    for axis in axes[0]:
        axis.axhspan(0.95 * WANTED, 1.05 * WANTED, color="#dfe7f1", zorder=0)
        axis.set_xlim(0.4, None)
        axis.set_ylim(2.0, 8.0)
        axis.set_xlabel("time [s]")
    figure.suptitle("reading of the array (lines) and true force (dashed), at the frames")
    figure.savefig(path, dpi=100)


def hold_with_creep(seconds: float = 100.0, rate: float = 31.0) -> tuple[Record, FloatArray]:
    """Hold the wanted force on an array that creeps; return the record, and 1 / (1 + c ln(t / 2 s)) at its times."""
    found = make_loop("centre", rate, creep=CREEP).run(seconds, lambda _: WANTED)
    return found, 1 / (1 + CREEP * np.log(np.maximum(found.times, 0.5) / REFERENCE_TIME))


def draw_creep(axis: Axes) -> None:
    """Draw the reading and the true force of a long hold with creep, and the logarithm."""
    found, falls = hold_with_creep()
    draw_record(axis, found, COLOURS[0], "reading, true force dashed")
    still = make_loop("centre", 31.0).run(2.0, lambda _: WANTED).true[-1]
    axis.plot(found.times, still * falls, ":", color=COLOURS[3], linewidth=2, label="F / (1 + c ln(t / 2 s))")
    axis.set_xscale("log")
    axis.set_xlim(0.5, None)
    axis.set_xlabel("time [s]")
    axis.set_ylim(3, 8)
    axis.set_title("held with creep, c = 0.12")


def draw_beside(axis: Axes) -> None:
    """Draw reading and true force when the block is put down further and further over the edge of the array."""
    parameters, cover = load_sensor(271.0)
    places = np.linspace(0.0, 11e-3, 12)
    images = make_images("fast", parameters, cover, BLOCK, places=places.tolist(), y=SLIDE_Y)
    rest = [Loop(images=images, expected=images, parameters=parameters).run(1.0, lambda _: WANTED, x=x) for x in places]
    axis.plot(1e3 * places, [each.reading[-1] for each in rest], color=COLOURS[0], label="reading")
    axis.plot(1e3 * places, [each.true[-1] for each in rest], "--", color=COLOURS[0], label="true force")
    axis.axvline(1e3 * (parameters.array.extent[0] / 2 - BLOCK.size[0] / 2), color="grey", linewidth=0.8, linestyle=":")
    axis.set_ylim(0, None)
    axis.set_xlabel("place of the block [mm]")
    axis.set_title("a load beside the array (dotted: its edge)")


def draw_models(guided: Mapping[str, tuple[Record, FloatArray]], path: Path) -> None:
    """Draw what the controller of the largest texel and of the middle does with the images of each model."""
    figure = Figure(figsize=(12, 7), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(1, 1.15))
    axes = above.subplots(1, 3)
    for (model, (found, true)), colour in zip(guided.items(), COLOURS, strict=True):
        axes[0].plot(found.times, true.max(axis=1), color=colour, label=model)
        axes[1].plot(found.times, found.true, color=colour)
        axes[2].plot(found.times, 1e3 * found.place, color=colour)
    titles = ("true largest texel [N], limit 0.45 N", "true force [N]", "block from the middle [mm]")
    for axis, title in zip(axes, titles, strict=True):
        axis.set_title(title)
        axis.set_xlabel("time [s]")
        axis.set_xlim(0, None)
    axes[0].axhline(0.45, color="grey", linewidth=0.8, linestyle=":")
    axes[0].legend(frameon=False)
    array = load_sensor(271.0)[0].array
    most = max(true[-1].max() for _, true in guided.values())
    images = below.subplots(2, len(guided))
    for column, (model, (found, true)) in enumerate(guided.items()):
        for row, (forces, name) in enumerate(((found.forces, f"{model}, in its loop"), (true, "true, at its end"))):
            axis = images[row, column]
            drawn = axis.imshow(array.image(forces[-1]).T, origin="lower", cmap="inferno", vmin=0, vmax=most)
            axis.set_title(f"{name}: {forces[-1].max():.2f} N", fontsize="medium")
            axis.set_xticks([])
            axis.set_yticks([])
    below.colorbar(drawn, ax=images, label="force on the texel [N]")
    figure.savefig(path, dpi=100)
