"""Draw docs/overview.png: one touch by the reference and by the fast model, and the point spread behind it.

Run it in the repository root: `.venv/bin/python docs/overview.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import fastmodel
import fem_reference
from fem_reference import closed_form
from meshes import Box, Pose
from validation.derivation.derive import Derivation, derive
from validation.render.figure import COLOURS, draw_texels, open_figure
from validation.render.image import Scale
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
    images = [reference.texel_forces, fast.texel_forces]
    peak = max(float(image.max()) for image in images)
    images.append(MAGNIFIED * (images[1] - images[0]))
    titles = ("finite elements", "fast model", f"difference x {MAGNIFIED}")
    with open_figure(Path(__file__).with_suffix(".png"), height=2.8) as figure:
        axes = figure.subplots(1, 4, width_ratios=(1.9, 1, 1, 1))
        draw_spread(axes[0], derivation)
        for axis, title, image in zip(axes[1:], titles, images, strict=True):
            scale = Scale(peak=peak, difference=True)
            drawn = draw_texels(axis, array, image, scale, title=title)
        figure.colorbar(drawn, ax=axes[1:], label="force on the texel [mN]")


def draw_spread(axis: Axes, derivation: Derivation) -> None:
    """Draw base pressure per unit point load over the distance from it."""
    response = fem_reference.point_spread(derivation.sensor.cover)
    radius = np.linspace(0, 6e-3, 200)
    exact = closed_form.point_response(derivation.sensor.cover, radius)
    axis.plot(radius * 1e3, response.pressure(radius) * 1e-6, label="finite elements", color=COLOURS["fem"])
    axis.plot(radius * 1e3, exact * 1e-6, ":", label="exact layer", color=COLOURS["exact"])
    axis.set_xlabel("distance from a point load [mm]")
    axis.set_ylabel("base pressure per load [1/mm²]")
    axis.set_title("point spread, 2 mm cover")
    axis.legend()


if __name__ == "__main__":
    main()
