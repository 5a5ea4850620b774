"""What `derive --out` writes: parameters, numbers and a plot."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import numpy as np

from validation.derive import Derivation
from validation.plain import plain

_LOG = logging.getLogger(__name__)


def write_derivation(derivation: Derivation, folder: Path) -> tuple[str, ...]:
    """Write `parameters.toml`, `cover.npz`, `derive.json` and, where matplotlib is installed, `psf.svg`.

    Args:
        derivation: What was derived.
        folder: An existing folder to write to.

    Returns:
        The names of the files.

    Raises:
        OSError: If the folder cannot be written.
    """
    derivation.parameters.save(folder)
    numbers = json.dumps(plain(derivation.as_json()), indent=1, allow_nan=False)
    (folder / "derive.json").write_text(numbers, encoding="utf-8")
    files = ("parameters.toml", "cover.npz", "derive.json")
    try:
        _plot(derivation, folder / "psf.svg")
    except ImportError:
        _LOG.warning("no plot: matplotlib is not installed; run: python -m pip install 'softcover[report]'")
        return files
    return (*files, "psf.svg")


def _plot(derivation: Derivation, path: Path) -> None:
    """Radial profile beside the texel response; row 0 at the bottom."""
    from matplotlib.figure import Figure

    spread, sensor = derivation.point_spread, derivation.sensor
    figure = Figure(figsize=(9, 4), layout="constrained")
    profile, image = figure.subplots(1, 2, width_ratios=(2, 1))
    radius = np.linspace(0, 6 * sensor.cover.thickness, 300)
    sigma = derivation.fit.gaussian.sigma_x * sensor.array.pitch[0]
    gaussian = np.exp(-((radius / sigma) ** 2) / 2) / (2 * np.pi * sigma**2)
    profile.plot(1e3 * radius, 1e-6 * spread.pressure(radius), label="finite elements, point load")
    profile.plot(1e3 * radius, 1e-6 * gaussian, "--", label=f"fitted Gaussian ({derivation.fit.estimator})")
    profile.set(xlabel="distance from the load [mm]", ylabel="base pressure per force [1/mm²]")
    profile.legend(frameon=False)
    drawn = image.imshow(100 * derivation.texel_response_uniform, origin="lower", cmap="viridis")
    figure.colorbar(drawn, ax=image, label="uniform load on one texel [% of the load]")
    image.set(xlabel="column", ylabel="row")
    label = " (assumed cover)" if sensor.cover.assumed else ""
    figure.suptitle(f"{sensor.name}{label}")
    figure.savefig(path)
