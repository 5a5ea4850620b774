"""Figures: plots that plotly.js draws in the report and matplotlib in files, pictures of cases, files of derivations.

What only one kind of cover has is registered by the type of its derivation; a new kind has none at first.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshes.array_types import FloatArray
from validation.derivation.base import Derivation
from validation.derivation.layers import LayeredDerivation
from validation.derivation.solid import SolidDerivation
from validation.extras import MissingExtraError
from validation.json_values import json_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from meshes import TexelArray
    from validation.campaign.evaluation import Evaluation
    from validation.campaign.results import CampaignResult, CaseResult

_LOG = logging.getLogger(__name__)

#: Most cases of which a picture is drawn, which takes a second or two each [-].
_MOST_PICTURES = 24
#: Colour of each scored model in the figures.
_COLOURS = {"fast": "#2b6cb0", "area": "#3a9d6e", "boxes": "#8a5fb0", "no-spread": "#dd8a34", "zeros": "#9aa0ab"}
_COLOURS |= {"gaussian": _COLOURS["area"], "rigid": _COLOURS["boxes"]}
#: Colour of the curve of the closed-form solution: that of the text, which the page's script fills in.
_INK = "ink"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pictures:
    """Pictures of the cases in three dimensions.

    Attributes:
        files: Name of the picture's file by name of the case.
        missing: Why there are none, or not all; empty if nothing is to say.
    """

    files: Mapping[str, str] = dataclasses.field(default_factory=dict)
    missing: str = ""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A line of a plot.

    Attributes:
        name: Its name in the legend.
        x, y: Its points, shape (m,) each, in the units of the axes.
        colour: Its colour, `#rrggbb` or `ink`, the colour of the text.
        dash: `solid`, `dot` or `dash`.
        marker: `circle`, `diamond` or `square`; empty for none.
    """

    name: str
    x: FloatArray
    y: FloatArray
    colour: str
    dash: str = "solid"
    marker: str = ""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Plot:
    """A plot of lines.

    Attributes:
        caption: What it shows.
        x, y: Labels of the axes with their units.
        lines: Its lines.
    """

    caption: str
    x: str
    y: str
    lines: tuple[Line, ...]

    def to_plotly(self) -> dict[str, Any]:
        """Return the plot as data for plotly.js."""
        data = [
            {"type": "scatter", "mode": "lines+markers" if line.marker else "lines", "name": line.name}
            | {"x": line.x, "y": line.y, "line": {"color": line.colour, "dash": line.dash}}
            | ({"marker": {"symbol": line.marker, "size": 7}} if line.marker else {})
            for line in self.lines
        ]
        return {"data": data, "layout": _layout(self.x, self.y)}

    def draw(self, axes: Axes) -> None:
        """Draw the plot by matplotlib."""
        styles = {"solid": "-", "dot": ":", "dash": "--"}
        markers = {"": "", "circle": "o", "diamond": "D", "square": "s"}
        for line in self.lines:
            colour = "black" if line.colour == _INK else line.colour
            axes.plot(
                line.x, line.y, linestyle=styles[line.dash], marker=markers[line.marker], color=colour, label=line.name
            )
        axes.set(xlabel=self.x, ylabel=self.y)
        axes.legend(frameon=False, fontsize="small")


@singledispatch
def plot_responses(derivation: object) -> dict[str, Plot]:
    """Return the plots of a derivation by name; a new kind of cover has none at first."""
    del derivation
    return {}


@plot_responses.register(LayeredDerivation)
def _(derivation: LayeredDerivation) -> dict[str, Plot]:
    """Plot the forces on a column of texels and, of a wide cover, the pressure under a point load."""
    from fem_reference.closed_form import point_response

    array, sensor = derivation.sensor.array, derivation.sensor
    column, offset = array.columns // 2, np.arange(array.rows, dtype=np.float64) - array.rows // 2
    kernel = array.image(derivation.fit.gaussian.operator(array)[:, array.middle])
    forces = (
        ("reference, uniform texel load", derivation.texel_response_uniform, _COLOURS["fast"], "circle"),
        ("reference, point load", derivation.texel_response, _INK, "diamond"),
        ("fitted kernel", kernel, _COLOURS["no-spread"], "square"),
    )
    texels = Plot(
        caption="Forces on the middle column of texels. The kernel is fitted to the uniform load on one texel.",
        x="texels from the loaded one, along y",
        y="force on the texel [% of the load]",
        lines=tuple(
            Line(
                name=name,
                x=offset,
                y=100 * np.asarray(image, dtype=np.float64)[:, column],
                colour=colour,
                marker=marker,
            )
            for name, image, colour, marker in forces
        ),
    )
    spread = derivation.point_spread
    if spread is None:
        return {"texel-plot": texels}
    radius = np.linspace(0, min(spread.reach, 6 * sensor.cover.thickness), 300)
    sigma = derivation.sigma
    pressures = (
        ("finite elements", spread.pressure(radius), _COLOURS["fast"], "solid"),
        ("exact layer solution", point_response(sensor.layered_cover, radius), _INK, "dot"),
        (
            "fitted Gaussian (to uniform texel load)",
            np.exp(-((radius / sigma) ** 2) / 2) / (2 * np.pi * sigma**2),
            _COLOURS["no-spread"],
            "dash",
        ),
    )
    pressure = Plot(
        caption="Pressure on the base under a point load. The Gaussian is fitted to uniform loads on whole texels.",
        x="distance from the load [mm]",
        y="base pressure per force [1/mm\u00b2]",
        lines=tuple(
            Line(name=name, x=1e3 * radius, y=1e-6 * values, colour=colour, dash=dash)
            for name, values, colour, dash in pressures
        ),
    )
    return {"texel-plot": texels, "psf-plot": pressure}


def find_outline(array: TexelArray, result: CaseResult) -> FloatArray | None:
    """Return the convex hull (x, y) of the contact area of the reference, for images of planar arrays [m]."""
    from scipy.spatial import ConvexHull, QhullError

    if not array.planar:
        return None
    points = result.reference.found.contact_points[:, :2]
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # fewer than three cells in contact, or all of them on one line
        return np.asarray(points)


@singledispatch
def draw_cases(derivation: object, evaluation: Evaluation, folder: Path) -> Pictures:
    """Draw the reference of each case in three dimensions, as files in a folder, where a flat image shows too little.

    Raises:
        OSError: If the folder cannot be written.
    """
    del derivation, evaluation, folder
    return Pictures()


@draw_cases.register(SolidDerivation)
def _(derivation: SolidDerivation, evaluation: Evaluation, folder: Path) -> Pictures:
    """Draw contact pressure, section, and forces on the texels."""
    from validation.scene.cover_scene import show_indentation
    from validation.scene.rendering import RenderingError

    results = evaluation.campaign.cases
    files: dict[str, str] = {}
    try:
        from validation.scene.draw import write_picture

        for index, result in enumerate(results[:_MOST_PICTURES]):
            case, name = result.case, f"case-{index + 1:02d}.png"
            title = f"{case.name}: {case.shape}, {case.load:.3g} N"
            scene = show_indentation(
                result.reference.found, derivation.sensor.array, direction=case.pose.towards, title=title
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


def campaign_figure(campaign: CampaignResult) -> dict[str, Any]:
    """Make the bar chart of misplaced force of every scored model in every case of a campaign."""
    names = [result.case.name for result in campaign.cases]
    bars = [
        {
            "type": "bar",
            "name": model,
            "x": names,
            "y": [100 * result.predictions[model].score.misplaced_force for result in campaign.cases],
            "marker": {"color": _COLOURS[model]},
        }
        for model in campaign.models
    ]
    layout = _layout("", "misplaced force [% of the load]")
    layout["xaxis"]["tickangle"] = -35
    return {"data": bars, "layout": layout | {"barmode": "group", "margin": {"l": 60, "r": 10, "t": 40, "b": 130}}}


def _layout(x: str, y: str) -> dict[str, Any]:
    axis = {"automargin": True}
    return {
        "font": {"family": "system-ui, sans-serif", "size": 12},
        "xaxis": axis | {"title": {"text": x}},
        "yaxis": axis | {"title": {"text": y}},
        "margin": {"l": 60, "r": 10, "t": 60, "b": 50},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "plot_bgcolor": "rgba(0,0,0,0)",
        "paper_bgcolor": "rgba(0,0,0,0)",
        "height": 360,
    }


def write_derivation(derivation: Derivation, folder: Path, picture: str = "png") -> tuple[str, ...]:
    """Write a derivation: `parameters.toml`, `cover.npz`, `derive.json`, and what `draw_derivation` writes.

    Args:
        derivation: Response of a sensor's cover, and the fast model's parameters fitted to the response.
        folder: An existing folder to write to.
        picture: Format of a plot, `png` or `svg`.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    derivation.parameters.save(folder)
    (folder / "derive.json").write_text(json_text(derivation.result), encoding="utf-8")
    return ("parameters.toml", "cover.npz", "derive.json", *draw_derivation(derivation, folder, picture))


@singledispatch
def draw_derivation(derivation: object, folder: Path, picture: str) -> tuple[str, ...]:
    """Write pictures and further files of a kind of cover; return their names.  A new kind has none at first."""
    del derivation, folder, picture
    return ()


@draw_derivation.register(SolidDerivation)
def _(derivation: SolidDerivation, folder: Path, picture: str) -> tuple[str, ...]:
    """Write the mesh, `responses.npz`, and pictures where possible.

    `responses.npz` holds the nodes of the top and the force on each texel per unit force vector on each of them.
    """
    from meshes.bounded_file import pack_npz
    from meshes.solids import write_mesh
    from validation.scene.cover_scene import show_mesh
    from validation.scene.draw import write_scene

    del picture  # three-dimensional ones are PNG
    grid = derivation.responses.finest
    arrays = {"points": grid.top.nodes, "normals": grid.top.normals, "influence": grid.influence}
    (folder / "responses.npz").write_bytes(pack_npz(arrays))
    write_mesh(folder / "mesh.npz", grid.mesh)
    scene = show_mesh(grid.mesh, derivation.sensor.array, title=derivation.sensor.name)
    return ("responses.npz", "mesh.npz", *write_scene(scene, folder))


@draw_derivation.register(LayeredDerivation)
def _(derivation: LayeredDerivation, folder: Path, picture: str) -> tuple[str, ...]:
    """Draw the spread of a load as `psf.png` or `psf.svg`, if matplotlib is installed."""
    try:
        return (_plot(derivation, folder / f"psf.{picture}"),)
    except ImportError:
        _LOG.warning("no plot: %s", MissingExtraError("matplotlib"))
        return ()


def _plot(derivation: LayeredDerivation, path: Path) -> str:
    """Draw the plots of the responses, and the image of the forces under a uniform load on one texel, row 0 below.

    Returns:
        The name of the file.
    """
    from matplotlib.figure import Figure

    plots = plot_responses(derivation).values()
    figure = Figure(figsize=(12, 4), layout="constrained")
    *axes, image = figure.subplots(1, len(plots) + 1, width_ratios=(*(2 for _ in plots), 1))
    for plot, each in zip(plots, axes, strict=True):
        plot.draw(each)
    drawn = image.imshow(100 * derivation.texel_response_uniform, origin="lower", cmap="viridis")
    figure.colorbar(drawn, ax=image, label="uniform load on one texel [% of the load]")
    image.set(xlabel="column", ylabel="row")
    label = " (assumed cover)" if derivation.sensor.cover.assumed else ""
    figure.suptitle(f"{derivation.sensor.name}{label}")
    figure.savefig(path, dpi=150)
    return path.name
