"""Files of `softcover derive --out`, and the report folder of `softcover validate`."""

from __future__ import annotations

import logging
from functools import singledispatch
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from validation.derivation.base import Derivation
from validation.derivation.layers import LayeredDerivation
from validation.derivation.solid import SolidDerivation
from validation.extras import REPORT_MODULES, MissingExtraError, require
from validation.json_values import json_text

if TYPE_CHECKING:
    from validation.campaign.evaluation import Evaluation

_LOG = logging.getLogger(__name__)


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

    from validation.report.figures import plot_responses

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


#: Files of the report's page that are copied unchanged.
_ASSETS = ("report.css", "report.js")


def write_report(evaluation: Evaluation, folder: Path) -> None:
    """Write the report on a sensor's evaluation.

    Args:
        evaluation: The results to show.
        folder: An existing folder to write to.

    Raises:
        MissingExtraError: If jinja2 or plotly is not installed.
        OSError: If the folder cannot be written.
    """
    require(*REPORT_MODULES)
    from jinja2 import Environment, PackageLoader, StrictUndefined

    from validation.report.figures import draw_cases
    from validation.report.page import contents

    assets = resources.files("validation.report").joinpath("assets")
    environment = Environment(
        loader=PackageLoader("validation.report", "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("index.html.j2")
    pictures = draw_cases(evaluation.derivation, evaluation, folder)
    (folder / "index.html").write_text(template.render(contents(evaluation, pictures)), encoding="utf-8")
    for name in _ASSETS:
        (folder / name).write_bytes(assets.joinpath(name).read_bytes())
    plotly = resources.files("plotly").joinpath("package_data", "plotly.min.js")
    (folder / "plotly.min.js").write_bytes(plotly.read_bytes())
    (folder / "report.json").write_text(json_text(evaluation.report), encoding="utf-8")
    evaluation.derivation.parameters.save(folder)
