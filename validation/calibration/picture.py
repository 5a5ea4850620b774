"""Picture of the recordings that a calibration left out: recorded, predicted, and their difference."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from meshes import TexelArray
from validation.calibration.hold_out import HoldOut

#: Largest number of recordings in the picture [-].
_MOST = 4


def draw_hold_out(hold_out: HoldOut, array: TexelArray, path: Path) -> Path:
    """Draw the left-out images, the predicted ones and their differences as a PNG file.

    Args:
        hold_out: Recorded and predicted counts.
        array: The texels.
        path: The file to write.

    Raises:
        ImportError: If matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    order = np.argsort(hold_out.loads)
    chosen = order[np.unique(np.linspace(0, len(order) - 1, min(_MOST, len(order))).astype(int))]
    figure = Figure(figsize=(2.4 * len(chosen) + 1.2, 7.5), layout="constrained")
    axes = figure.subplots(3, len(chosen), squeeze=False)
    top = float(max(hold_out.recorded[chosen].max(), hold_out.predicted[chosen].max(), 1.0))
    apart = hold_out.predicted[chosen] - hold_out.recorded[chosen]
    most = float(max(np.abs(apart).max(), 1.0))
    x, y = (1e3 * array.centres[:, axis] for axis in (0, 1))
    halves = [1e3 * pitch / 2 for pitch in array.pitch]
    extent = (x.min() - halves[0], x.max() + halves[0], y.min() - halves[1], y.max() + halves[1])
    rows = (("recorded", hold_out.recorded[chosen]), ("predicted", hold_out.predicted[chosen]), ("difference", apart))
    for row, (name, values) in enumerate(rows):
        difference = name == "difference"
        limits = {"cmap": "RdBu_r", "vmin": -most, "vmax": most} if difference else {"vmin": 0.0, "vmax": top}
        for column, image in enumerate(values):
            shown = np.asarray(array.image(np.where(array.active, image, np.nan)), dtype=np.float64)
            drawn = axes[row, column].imshow(shown, origin="lower", extent=extent, **limits)
            axes[row, column].set_title(f"{name}, {hold_out.loads[chosen[column]]:.3g} N", fontsize=9)
            axes[row, column].set_xlabel("x [mm]", fontsize=8)
            axes[row, column].set_ylabel("y [mm]", fontsize=8)
        figure.colorbar(drawn, ax=axes[row, :].tolist(), label="counts")
    figure.suptitle(f"left out: {hold_out.summary}", fontsize=10)
    figure.savefig(path, dpi=150)
    return path
