"""Figures of the report: interactive ones as data for plotly.js, and pictures of the cases.

What only one kind of cover has is registered by the type of its derivation; a new kind has none at first.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from meshes.array_types import FloatArray
from validation.campaign.evaluation import Evaluation
from validation.campaign.results import CampaignResult, CaseResult
from validation.derivation.layers import LayeredDerivation
from validation.derivation.solid import SolidDerivation
from validation.extras import MissingExtraError

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


@singledispatch
def list_figures(derivation: object) -> dict[str, tuple[dict[str, Any], str]]:
    """Return the figures of a derivation: data and caption by name."""
    del derivation
    return {}


@list_figures.register(LayeredDerivation)
def _(derivation: LayeredDerivation) -> dict[str, tuple[dict[str, Any], str]]:
    return {
        "texel-plot": (
            texel_profile_figure(derivation),
            "Forces on the middle column of texels. The kernel is fitted to the uniform load on one texel.",
        ),
        "psf-plot": (
            point_spread_figure(derivation),
            "Pressure on the base under a point load. The Gaussian is fitted to uniform loads on whole texels.",
        ),
    }


@singledispatch
def find_outline(derivation: object, result: CaseResult) -> FloatArray | None:
    """Return the corners (x, y) of the contact area of the reference, for planar images [m]; None for no line."""
    del derivation, result
    return None


@find_outline.register(LayeredDerivation)
def _(derivation: LayeredDerivation, result: CaseResult) -> FloatArray | None:
    """Return the convex hull of the cells of the contact grid that are in contact."""
    from scipy.spatial import ConvexHull, QhullError

    del derivation
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


def point_spread_figure(derivation: LayeredDerivation) -> dict[str, Any]:
    """Make the figure of base pressure over distance from a unit point load: finite elements, closed form and Gaussian.

    Raises:
        ValueError: If the cover has free side edges, so that there is no radial profile.
    """
    from fem_reference.closed_form import point_response

    spread = derivation.point_spread
    if spread is None:
        raise ValueError("a cover with free side edges has no radial profile")
    radius = np.linspace(0, min(spread.reach, 6 * derivation.sensor.cover.thickness), 300)
    gaussian = gaussian_pressure(derivation, radius)
    exact = point_response(derivation.sensor.layered_cover, radius)
    lines = (
        ("finite elements", spread.pressure(radius), {"color": _COLOURS["fast"], "width": 3}),
        ("exact layer solution", exact, {"color": _INK, "dash": "dot"}),
        ("fitted Gaussian (to uniform texel load)", gaussian, {"color": _COLOURS["no-spread"], "dash": "dash"}),
    )
    return {
        "data": [
            {"type": "scatter", "mode": "lines", "name": name, "x": 1e3 * radius, "y": 1e-6 * y, "line": line}
            for name, y, line in lines
        ],
        "layout": _layout("distance from the load [mm]", "base pressure per force [1/mm²]"),
    }


def gaussian_pressure(derivation: LayeredDerivation, radius: FloatArray) -> FloatArray:
    """Compute the pressure per unit force of the fitted Gaussian at distances from its centre, with sigma along x.

    Args:
        derivation: The derivation, which holds the fitted Gaussian.
        radius: Distances from the centre, any shape [m].

    Returns:
        Pressures per unit force, same shape [1/m2].
    """
    sigma = derivation.fit.gaussian.sigma_x * derivation.sensor.array.pitch[0]
    return np.asarray(np.exp(-((radius / sigma) ** 2) / 2) / (2 * np.pi * sigma**2))


def texel_profile_figure(derivation: LayeredDerivation) -> dict[str, Any]:
    """Make the figure of the forces on the middle column of texels: finite elements and the fitted kernel."""
    array = derivation.sensor.array
    column = array.columns // 2
    offset = np.arange(array.rows) - array.rows // 2
    kernel = array.image(derivation.fit.gaussian.operator(array)[:, array.middle])[:, column]
    lines = (
        ("reference, uniform texel load", derivation.texel_response_uniform[:, column], _COLOURS["fast"], "circle"),
        ("reference, point load", derivation.texel_response[:, column], _INK, "diamond"),
        ("fitted kernel", kernel, _COLOURS["no-spread"], "square"),
    )
    return {
        "data": [
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": name,
                "x": offset,
                "y": 100 * values,
                "line": {"color": colour},
                "marker": {"symbol": symbol, "size": 7},
            }
            for name, values, colour, symbol in lines
        ],
        "layout": _layout("texels from the loaded one, along y", "force on the texel [% of the load]"),
    }


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
