"""Figures: plots for the report and for files, pictures of the cases, and the files of a derivation.

Plots and files that only one kind of cover has are registered by the type of its derivation.  A new kind of cover has
none at first.
"""

from __future__ import annotations

import dataclasses
import io
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from validation.calibration.cross_validation import POWERS
from validation.derivation.base import Derivation
from validation.derivation.layers import LayeredDerivation
from validation.derivation.solid import SolidDerivation
from validation.extras import MissingExtraError
from validation.json_values import json_text
from validation.moving.results import TRUTH, MovingResult
from validation.render.figure import COLOURS, draw_texels, open_figure
from validation.render.image import Scale
from validation.text.indenter import describe_indenter

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from validation.campaign.evaluation import Evaluation
    from validation.campaign.results import CampaignResult

_LOG = logging.getLogger(__name__)

#: Largest number of cases with a picture in three dimensions [-], because each picture takes a second or two.
_MOST_PICTURES = 24
#: Place of the legend of a plot: above its axes, where it covers nothing.
_ABOVE: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0}
#: Function that draws a plot into the axes of a figure.
Draw = Callable[["Axes"], None]
#: Number of models besides the fast one whose forces are drawn over time [-].
_DRAWN = 4


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pictures:
    """Pictures of the cases in three dimensions.

    Attributes:
        files: Name of the picture's file by name of the case.
        missing: Reason why pictures are missing; empty if none is.
    """

    files: Mapping[str, str] = dataclasses.field(default_factory=dict)
    missing: str = ""


def render_svg(draw: Draw, width: float = 6, height: float = 3) -> str:
    """Draw a plot as an SVG element without background, in which black becomes the colour of the page's text.

    Args:
        draw: Function that draws the plot.
        width: Width [inches].
        height: Height [inches].
    """
    out = io.StringIO()
    metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with open_figure(out, width=width, height=height, format="svg", transparent=True, metadata=metadata) as figure:
        draw(figure.subplots())
    _, start, rest = out.getvalue().partition("<svg")
    # Names of groups are removed, because they would not be unique on a page with several plots.
    return re.sub(r'<g id="[^"]*"', "<g", start + rest).replace("#000000", "currentColor")


@singledispatch
def plot_responses(derivation: object) -> dict[str, tuple[str, Draw]]:
    """Return the plots of a derivation, each a caption and a function that draws it, by name.

    A kind of cover without a registered function has no plots.
    """
    del derivation
    return {}


@plot_responses.register(LayeredDerivation)
def _(derivation: LayeredDerivation) -> dict[str, tuple[str, Draw]]:
    """Plot the forces on a column of texels under planar layers; of a wide cover also the pressure of a point load."""
    from fem_reference.closed_form import point_response

    sensor, spread, sigma = derivation.sensor, derivation.point_spread, derivation.sigma
    array = sensor.array

    def draw_texel_forces(axes: Axes) -> None:
        from matplotlib.ticker import MaxNLocator

        column, offset = array.columns // 2, np.arange(array.rows) - array.rows // 2
        kernel = array.image(derivation.fit.gaussian.operator(array)[:, array.middle])
        for name, image, style, colour in (
            ("reference, uniform texel load", derivation.texel_response_uniform, "o-", COLOURS["fem"]),
            ("reference, point load", derivation.texel_response, "D-", COLOURS["exact"]),
            ("fitted kernel", kernel, "s--", COLOURS["fit"]),
        ):
            axes.plot(offset, 100 * np.asarray(image, dtype=np.float64)[:, column], style, color=colour, label=name)
        axes.set(xlabel="texels from the loaded one, along y", ylabel="force on the texel [% of the load]")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(**_ABOVE)

    caption = "Forces on the middle column of texels. The kernel is fitted to the uniform load on one texel."
    plots: dict[str, tuple[str, Draw]] = {"texel-plot": (caption, draw_texel_forces)}
    if spread is None:
        return plots

    def draw_pressure(axes: Axes) -> None:
        radius = np.linspace(0, min(spread.reach, 6 * sensor.cover.thickness), 300)
        gaussian = np.exp(-((radius / sigma) ** 2) / 2) / (2 * np.pi * sigma**2)
        for name, values, style, colour in (
            ("finite elements", spread.pressure(radius), "-", COLOURS["fem"]),
            ("exact layer solution", point_response(sensor.layered_cover, radius), ":", COLOURS["exact"]),
            ("Gaussian fitted to texel forces", gaussian, "--", COLOURS["fit"]),
        ):
            axes.plot(1e3 * radius, 1e-6 * values, style, color=colour, label=name)
        axes.set(xlabel="distance from the load [mm]", ylabel="base pressure per force [1/mm\u00b2]")
        axes.legend(**_ABOVE)

    caption = "Pressure on the base under a point load. The Gaussian is fitted to uniform loads on whole texels."
    return plots | {"psf-plot": (caption, draw_pressure)}


def draw_campaign(campaign: CampaignResult, axes: Axes) -> None:
    """Draw the misplaced force of every scored model in every case of a campaign as marks on a logarithmic scale."""
    for model, marker in zip(campaign.models, "osD^v", strict=False):
        shares = [100 * result.predictions[model].score.misplaced_force for result in campaign.cases]
        axes.semilogy(range(len(shares)), shares, marker, color=COLOURS[model], label=model)
    names = [result.case.name for result in campaign.cases]
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right", rotation_mode="anchor")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("misplaced force [% of the load]")
    axes.grid(axis="y", linewidth=0.4, alpha=0.5)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)


def draw_moving(result: MovingResult, axes: Axes) -> None:
    """Draw the total force on the texels over time: true, by the fast model, and by the models with most delay."""
    axes.plot(result.times, result.totals[TRUTH], color="black", linewidth=2, label="finite elements")
    axes.plot(result.times, result.totals["fast"], color=COLOURS["fast"], linewidth=1, label="fast")
    late = sorted((each for each in result.scores if each.delay > 0), key=lambda each: each.delay)
    latest = {each.model.split(",")[0]: each for each in late}.values()  # of all settings of a model
    for each in sorted(latest, key=lambda each: -each.delay)[:_DRAWN]:
        axes.plot(result.times, result.totals[each.model], "--", linewidth=1, label=each.model)
    axes.set(xlabel="time [s]", ylabel="force on the texels [N]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0)


def draw_left_out(errors: Mapping[str, Sequence[float]], axes: Axes) -> None:
    """Draw the error of left-out images [counts] by the description of the seat, over the power of the load."""
    for seat, values in errors.items():
        axes.plot([f"{power:g}" for power in POWERS], values, "o-", label=seat)
    axes.set(xlabel="weight of an image: power of its load", ylabel="left-out images [counts]")
    axes.legend(**_ABOVE)


@singledispatch
def draw_cases(derivation: object, evaluation: Evaluation, folder: Path) -> Pictures:
    """Draw the reference of each case in three dimensions, as files in a folder, if a flat image is not enough.

    Raises:
        OSError: If the folder cannot be written.
    """
    del derivation, evaluation, folder
    return Pictures()


@draw_cases.register(SolidDerivation)
def _(derivation: SolidDerivation, evaluation: Evaluation, folder: Path) -> Pictures:
    """Draw the cases of a solid cover: contact pressure, section, and forces on the texels."""
    from validation.scene.cover_scene import show_indentation
    from validation.scene.rendering import RenderingError

    results = evaluation.campaign.cases
    files: dict[str, str] = {}
    try:
        from validation.scene.draw import write_picture

        for index, result in enumerate(results[:_MOST_PICTURES]):
            case, name = result.case, f"case-{index + 1:02d}.png"
            title = f"{case.name}: {describe_indenter(case.shape)}, {case.load:.3g} N"
            scene = show_indentation(
                result.reference.found, derivation.sensor.array, case.indenter, case.pose, title=title
            )
            if scene is not None:
                write_picture(scene, folder / name)
                files[case.name] = name
    except ImportError:
        missing = str(MissingExtraError("pyvista"))
    except RenderingError as error:
        missing = str(error)
    else:
        left = len(results) - len(files)
        return Pictures(files=files, missing=f"{left} further cases are not drawn" if left else "")
    _LOG.warning("no pictures in the report: %s", missing)
    return Pictures(missing=f"no pictures in three dimensions: {missing}")


def write_derivation(derivation: Derivation, folder: Path, picture: str = "png") -> None:
    """Write a derivation: `parameters.toml`, `cover.npz`, `derive.json`, and what `draw_derivation` writes.

    Args:
        derivation: Response of a sensor's cover, and the fast model's parameters fitted to the response.
        folder: An existing folder to write to.
        picture: Format of a plot, `png` or `svg`.

    Raises:
        OSError: If the folder cannot be written.
    """
    derivation.parameters.save(folder)
    (folder / "derive.json").write_text(json_text(derivation.result), encoding="utf-8")
    draw_derivation(derivation, folder, picture)


@singledispatch
def draw_derivation(derivation: object, folder: Path, picture: str) -> None:
    """Write pictures and further files of a derivation.

    A kind of cover without a registered function has none.
    """


@draw_derivation.register(SolidDerivation)
def _(derivation: SolidDerivation, folder: Path, picture: str) -> None:
    """Write the mesh of a solid cover, `responses.npz`, and pictures where this machine can draw.

    `responses.npz` holds the nodes of the top and the force on each texel per unit force vector on each node.
    """
    from meshes.bounded_file import pack_npz
    from meshes.solids import write_mesh
    from validation.scene.cover_scene import show_mesh
    from validation.scene.draw import write_scene

    del picture  # Three-dimensional pictures are PNG files.
    grid = derivation.responses.finest
    arrays = {"points": grid.top.nodes, "normals": grid.top.normals, "influence": grid.influence}
    (folder / "responses.npz").write_bytes(pack_npz(arrays))
    write_mesh(folder / "mesh.npz", grid.mesh)
    scene = show_mesh(grid.mesh, derivation.sensor.array, title=derivation.sensor.name)
    write_scene(scene, folder)


@draw_derivation.register(LayeredDerivation)
def _(derivation: LayeredDerivation, folder: Path, picture: str) -> None:
    """Draw the spread of a load under planar layers as `psf.png` or `psf.svg`, if matplotlib is installed.

    The figure shows the plots of the responses, and the forces under a uniform load on one texel, row 0 below.
    """
    plots = plot_responses(derivation).values()
    array, cover = derivation.sensor.array, derivation.sensor.cover
    peak = float(derivation.texel_response_uniform.max())
    layers = " + ".join(f"{1e3 * layer.thickness:.3g} mm {layer.material.name}" for layer in cover.layers)
    layers += " (assumed)" * (cover.assumed and "assumed" not in layers)
    try:
        with open_figure(folder / f"psf.{picture}", height=3.3) as figure:
            *axes, image = figure.subplots(1, len(plots) + 1, width_ratios=(*(2 for _ in plots), 1))
            for (_, draw), each in zip(plots, axes, strict=True):
                draw(each)
            scale = Scale(peak=peak, factor=100)
            drawn = draw_texels(image, array, derivation.texel_response_uniform.ravel(), scale)
            figure.colorbar(drawn, ax=image, label="uniform load on one texel [% of the load]")
            figure.suptitle(f"{derivation.sensor.name} under {layers}")
    except ImportError:
        _LOG.warning("no plot: %s", MissingExtraError("matplotlib"))
