"""Small-strain pressing on a wide cover: contact on cells, base forces superposed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fem_reference import store
from fem_reference.contact import Patch, touch
from fem_reference.point_spread import PointSpread, decay_length, point_spread
from fem_reference.slab import surface_compliance
from meshes import Cover, Indenter, TexelArray

FloatArray = npt.NDArray[np.float64]

#: Cells across the contact on the three grids; the last one is the answer.
CELLS = (56, 84, 126)


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearLevel:
    """One grid's answer: where the cells touch, and how the cover spreads them."""

    patch: Patch
    spread: PointSpread

    @property
    def total_force(self) -> float:
        """Force on the indenter [N]."""
        return self.patch.total_force

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""
        return self.patch.depth

    @property
    def area(self) -> float:
        """Contact area [m2]."""
        return self.patch.area

    @property
    def surface(self) -> FloatArray:
        """Touching cells in the indenter's frame: x, y [m], force [N], shape (m, 3)."""
        return np.column_stack([self.patch.x, self.patch.y, self.patch.force])

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Superpose the base response of every cell, gathered into bins far smaller than the response is wide."""
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, each = self.surface.T
        place = np.column_stack([at[0] + c * x - s * y, at[1] + s * x + c * y])
        _, group = np.unique(np.round(place / (self.spread.thickness / 16)), axis=0, return_inverse=True)
        force = np.bincount(group, each)
        centre = np.column_stack([np.bincount(group, place[:, i] * each) / force for i in range(2)])
        return np.asarray(force @ self.spread.texel_influence(array, centre))


def levels(
    cover: Cover,
    indenter: Indenter,
    targets: Sequence[float],
    control: Literal["load", "depth"],
    progress: Callable[[str], None] | None,
) -> list[list[LinearLevel]]:
    """The contact on three grids for every target, from the store where it is known."""
    spread = point_spread(cover, progress=progress)
    return [
        [LinearLevel(patch=patch, spread=spread) for patch in _patches(cover, indenter, target, control, progress)]
        for target in targets
    ]


def sizes(indenter: Indenter) -> list[float]:  # noqa: ARG001 -- one interface for both solvers
    """Cell sizes of the three grids, relative to the contact [-]."""
    return [1 / cells for cells in CELLS]


def assumptions(cover: Cover, indenter: Indenter) -> dict[str, str]:  # noqa: ARG001 -- one interface for both solvers
    """Nothing beyond what every result states."""
    return {}


def base_error(cover: Cover) -> float:
    """Relative error of a texel that the spread adds to the contact's [-]."""
    return point_spread(cover).error_estimate["peak_texel"]


def _patches(
    cover: Cover,
    indenter: Indenter,
    target: float,
    control: Literal["load", "depth"],
    progress: Callable[[str], None] | None,
) -> list[Patch]:
    def compute() -> dict[str, Any]:
        if progress is not None:
            progress("contact on three grids")
        reach = max(3.0 * float(np.hypot(*indenter.footprint)), 4 * decay_length(cover))
        surface = surface_compliance(cover, reach)
        out: dict[str, Any] = {}
        for cells in CELLS:
            patch = touch(surface, indenter, cells=cells, **{control: target})
            out[f"cells_{cells}"] = np.column_stack([patch.x, patch.y, patch.force])
            out[f"scalars_{cells}"] = np.array([patch.cell, patch.depth])
        return out

    inputs = {"cover": cover, "indenter": indenter, control: target, "cells": CELLS}
    data = store.fetch("contact", inputs, compute)
    found = []
    for cells in CELLS:
        x, y, force = data[f"cells_{cells}"].T
        cell, approach = data[f"scalars_{cells}"]
        found.append(Patch(x=x, y=y, force=force, cell=float(cell), depth=float(approach)))
    return found
