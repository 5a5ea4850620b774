"""Writing of the files of `softcover derive --out`: parameters of the fast model, numbers as JSON, and a plot."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.derivation.derive import Derivation
from validation.json_values import json_text
from validation.report.figures import gaussian_pressure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fem_reference.linear_response.point_spread import PointSpread

_LOG = logging.getLogger(__name__)


def write_derivation(derivation: Derivation, folder: Path) -> tuple[str, ...]:
    """Write a derivation: `parameters.toml`, `cover.npz`, `derive.json` and, if matplotlib is installed, `psf.svg`.

    Args:
        derivation: Response of a sensor's cover, and the fast model's parameters fitted to the response.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    derivation.parameters.save(folder)
    (folder / "derive.json").write_text(json_text(derivation.as_json()), encoding="utf-8")
    files = ("parameters.toml", "cover.npz", "derive.json")
    try:
        _plot(derivation, folder / "psf.svg")
    except ImportError:
        _LOG.warning("no plot: matplotlib is not installed; run: python -m pip install 'softcover[report]'")
        return files
    return (*files, "psf.svg")


def _plot(derivation: Derivation, path: Path) -> None:
    """Draw the radial profile and the image of texel forces under a uniform load side by side, and save the drawing.

    For a cover with free side edges, the response of the middle row of texels replaces the radial profile.  In the
    image, row 0 is at the bottom.
    """
    from matplotlib.figure import Figure

    sensor = derivation.sensor
    figure = Figure(figsize=(9, 4), layout="constrained")
    profile, image = figure.subplots(1, 2, width_ratios=(2, 1))
    if derivation.point_spread is None:
        _plot_row(derivation, profile)
    else:
        _plot_radial(derivation, derivation.point_spread, profile)
    profile.legend(frameon=False)
    drawn = image.imshow(100 * derivation.texel_response_uniform, origin="lower", cmap="viridis")
    figure.colorbar(drawn, ax=image, label="uniform load on one texel [% of the load]")
    image.set(xlabel="column", ylabel="row")
    label = " (assumed cover)" if sensor.cover.assumed else ""
    figure.suptitle(f"{sensor.name}{label}")
    figure.savefig(path)


def _plot_radial(derivation: Derivation, spread: PointSpread, axes: Axes) -> None:
    """Draw the pressure at the cover's base over the distance from a point load, and the fitted Gaussian."""
    radius = np.linspace(0, 6 * derivation.sensor.cover.thickness, 300)
    gaussian = gaussian_pressure(derivation, radius)
    axes.plot(1e3 * radius, 1e-6 * spread.pressure(radius), label="finite elements, point load")
    axes.plot(1e3 * radius, 1e-6 * gaussian, "--", label=f"fitted Gaussian ({derivation.fit.estimator})")
    axes.set(xlabel="distance from the load [mm]", ylabel="base pressure per force [1/mm²]")


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
