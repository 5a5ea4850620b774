"""Writing of the files of `softcover derive --out`: parameters of the fast model, numbers as JSON, and a plot."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.derivation.derive import Derivation
from validation.extras import MissingExtraError
from validation.json_values import json_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fem_reference.linear_response.point_spread import PointSpread

_LOG = logging.getLogger(__name__)


def write_derivation(derivation: Derivation, folder: Path, picture: str = "png") -> tuple[str, ...]:
    """Write a derivation: `parameters.toml`, `cover.npz`, `derive.json`, and `psf.png` if matplotlib is installed.

    Args:
        derivation: Response of a sensor's cover, and the fast model's parameters fitted to the response.
        folder: An existing folder to write to.
        picture: Format of the picture, `png` or `svg`.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    derivation.parameters.save(folder)
    (folder / "derive.json").write_text(json_text(derivation.result), encoding="utf-8")
    files = ("parameters.toml", "cover.npz", "derive.json")
    try:
        return (*files, _plot(derivation, folder / f"psf.{picture}"))
    except ImportError:
        _LOG.warning("no plot: %s", MissingExtraError("matplotlib"))
        return files


def _plot(derivation: Derivation, path: Path) -> str:
    """Draw the spread of a load over the base and the texels, save the drawing, and return the name of the file.

    From left to right: the pressure at the cover's base under a point load; the forces on the middle row of texels
    under a uniform load on the middle one, by finite elements and by the fitted kernel; the image of these forces, row
    0 at the bottom.  With free side edges there is no radial profile, and the rows under two loads are drawn.
    """
    from matplotlib.figure import Figure

    sensor, spread = derivation.sensor, derivation.point_spread
    figure = Figure(figsize=(12, 4), layout="constrained")
    *plots, image = figure.subplots(1, 3 if spread is not None else 2, width_ratios=(2, 2, 1)[spread is None :])
    if spread is None:
        _plot_row(derivation, plots[0])
    else:
        _plot_radial(derivation, spread, plots[0])
        _plot_kernel(derivation, plots[1])
    for axes in plots:
        axes.legend(frameon=False, fontsize="small")
    drawn = image.imshow(100 * derivation.texel_response_uniform, origin="lower", cmap="viridis")
    figure.colorbar(drawn, ax=image, label="uniform load on one texel [% of the load]")
    image.set(xlabel="column", ylabel="row")
    label = " (assumed cover)" if sensor.cover.assumed else ""
    figure.suptitle(f"{sensor.name}{label}")
    figure.savefig(path, dpi=150)
    return path.name


def _plot_radial(derivation: Derivation, spread: PointSpread, axes: Axes) -> None:
    """Draw the pressure at the cover's base over the distance from a point load."""
    radius = np.linspace(0, 5 * derivation.sensor.cover.thickness, 300)
    axes.plot(1e3 * radius, 1e-6 * spread.pressure(radius), label="finite elements")
    axes.axvline(500 * derivation.sensor.array.texel_size[0], linestyle=":", color="grey", label="edge of the texel")
    axes.set(xlabel="distance from the load [mm]", ylabel="base pressure per force [1/mm\u00b2]", title="point load")


def _plot_kernel(derivation: Derivation, axes: Axes) -> None:
    """Draw the forces on the middle row of texels under a uniform load on the middle texel, and the kernel's."""
    array = derivation.sensor.array
    row, column = divmod(array.middle, array.columns)
    place = 1e3 * array.pitch[0] * (np.arange(array.columns) - column)
    kernel = np.asarray(array.image(derivation.fit.gaussian.operator(array)[:, array.middle]))[row]
    axes.bar(place, 100 * kernel, width=0.8e3 * array.pitch[0], color="tab:orange", alpha=0.5, label="fitted Gaussian")
    axes.plot(place, 100 * derivation.texel_response_uniform[row], "o", label="finite elements")
    axes.set(xlabel="texel's distance along x [mm]", ylabel="force on the texel [% of the load]")
    axes.set_title("uniform load on one texel")


def _plot_row(derivation: Derivation, axes: Axes) -> None:
    """Draw the forces on the middle row of texels under a uniform load on the middle texel of the row, and on the last.

    This plot is for a cover with free side edges, whose response depends on the position and has no radial profile.
    """
    array = derivation.sensor.array
    row = array.middle - array.columns // 2 + np.arange(array.columns)
    place = 1e3 * array.centres[row, 0]
    for texel, name in ((array.middle, "middle"), (row[-1], "outermost")):
        response = derivation.influence.texel_response(array, load="uniform", texel=int(texel))
        axes.plot(place, 100 * response[row], "o-", label=f"uniform load on the {name} texel of the middle row")
    axes.set(xlabel="texel's position along x [mm]", ylabel="force on the texel [% of the load]")
