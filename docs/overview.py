"""Draw docs/overview.png: one touch by the reference and by the fast model, and the point spread behind it.

Run it in the repository root: `.venv/bin/python docs/overview.py`.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import fastmodel
import fem_reference
from fem_reference import closed_form
from meshes import Box, Pose
from validation.derivation.derive import Derivation, derive
from validation.sensor_file import load

LOAD = 4.903325  # 500 g [N]
PLACE = (1.0e-3, 0.6e-3)
YAW = np.radians(30)
INDENTER = Box(size=(9e-3, 9e-3, 5e-3))
#: The difference is drawn so much stronger.
MAGNIFIED = 10


def main() -> None:
    """Solve, press, and write the picture beside this file."""
    derivation = derive(load("wts-0614-34"))
    array = derivation.parameters.array
    reference = fem_reference.press(
        derivation.sensor.cover, array, INDENTER, load=LOAD, pose=Pose.planar(at=PLACE, yaw=YAW)
    )
    fast = fastmodel.indent(derivation.parameters, INDENTER, load=LOAD, at=PLACE, yaw=YAW)
    figure, axes = plt.subplots(
        1, 4, figsize=(10, 3.6), layout="constrained", gridspec_kw={"width_ratios": [1.9, 1, 1, 1]}
    )
    draw_spread(axes[0], derivation)
    images = [array.image(reference.texel_forces), array.image(fast.texel_forces)]
    peak = max(float(image.max()) for image in images)
    titles = ("finite elements", "fast model", f"difference x {MAGNIFIED}")
    for axis, title, image in zip(axes[1:], titles, [*images, MAGNIFIED * (images[1] - images[0])], strict=True):
        drawn = draw_image(axis, title, image, peak)
    figure.colorbar(drawn, ax=axes[1:], label="force on the texel [N]", shrink=0.8)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=120)


def draw_spread(axis: Axes, derivation: Derivation) -> None:
    """Draw base pressure per unit point load over the distance from it."""
    response = fem_reference.point_spread(derivation.sensor.cover)
    radius = np.linspace(0, 6e-3, 200)
    exact = closed_form.point_response(derivation.sensor.cover, radius)
    axis.plot(radius * 1e3, response.pressure(radius) * 1e-6, label="finite elements", linewidth=2)
    axis.plot(radius * 1e3, exact * 1e-6, "k:", label="exact layer")
    axis.set_xlabel("distance from a point load [mm]")
    axis.set_ylabel("base pressure per load [1/mm²]")
    axis.set_title("point spread, 2 mm cover")
    axis.legend(frameon=False)


def draw_image(axis: Axes, title: str, image: np.ndarray, peak: float) -> object:
    """Draw a tactile image, row 0 at the bottom."""
    drawn = axis.imshow(image, origin="lower", cmap="RdBu_r", vmin=-peak, vmax=peak)
    axis.set_title(title)
    axis.set_xticks([])
    axis.set_yticks([])
    return drawn


if __name__ == "__main__":
    main()
