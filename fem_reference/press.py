"""Press a rigid indenter into a cover: contact, texel forces, and the error of both."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fem_reference import store
from fem_reference.contact import Patch, is_flat, touch
from fem_reference.error import grid_convergence
from fem_reference.point_spread import PointSpread, decay_length, point_spread
from fem_reference.slab import surface_compliance
from meshes import Cover, Indenter, TexelArray

FloatArray = npt.NDArray[np.float64]

#: Cells across the contact on the three grids; the last one is the answer.
CELLS = (56, 84, 126)
#: Factor on the change between two extrapolations (ASME V&V 20-2009 uses 1.25 on three grids).
_SAFETY = 1.25


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """One indentation, as the reference sees it.

    Attributes:
        texel_forces: Normal force on each texel, shape (n,) [N].
        outside: Force that no active texel feels [N].
        total_force: Force of the indenter [N].
        depth: Approach from first touch of the undeformed cover [m].
        contact_area: Area that touches [m2].
        contact: The touching cells: columns x, y in the array's frame [m] and force [N], shape (m, 3).
        error_estimate: Estimated relative errors: `total_force` (at this depth), `peak_texel`, `contact_area`.
        assumptions: What the solution rests on: `strain`, `friction`, `base`.
        seconds: Wall time, near zero when it came from the store [s].
    """

    texel_forces: FloatArray
    outside: float
    total_force: float
    depth: float
    contact_area: float
    contact: FloatArray
    error_estimate: dict[str, float]
    assumptions: dict[str, str]
    seconds: float


def press(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    *,
    load: float | None = None,
    depth: float | None = None,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> Indentation:
    """Press a guided, frictionless, rigid indenter into a laterally wide cover (small strain).

    The contact does not depend on where the indenter stands or how it is turned, so poses share one stored solution.

    Args:
        cover: The cover; hyperelastic materials are linearised at zero load.
        array: The texels under it.
        indenter: The shape.
        load: Force along the array's normal [N]; or
        depth: Approach from first touch [m].  Exactly one of the two.
        at: Where the indenter's axis stands in the array's frame [m].
        yaw: Turn about that axis [rad].
        progress: Called with a line of text before each solve.

    Raises:
        ValueError: If not exactly one of load and depth is given, it is not positive, or the indenter would reach
            through the cover.
        ConvergenceError: If the contact does not converge.
    """
    _check(cover, load, depth)
    started = time.perf_counter()
    spread = point_spread(cover, progress=progress)
    patches = _patches(cover, indenter, load, depth, progress)
    if patches[-1].depth >= cover.thickness:
        raise ValueError(
            f"the indenter would pierce the cover: depth {patches[-1].depth * 1e3:.3g} mm of "
            f"{cover.thickness * 1e3:.3g} mm; use less load, a wider indenter or a stiffer cover"
        )
    placed = [_place(patch, at, yaw) for patch in patches]
    forces = [_texel_forces(spread, array, contact) for contact in placed]
    sharp = is_flat(indenter)
    total, approach = (_value([getattr(p, name) for p in patches], sharp=sharp) for name in ("total_force", "depth"))
    texel_forces = np.array([_value(list(each), sharp=sharp) for each in zip(*forces, strict=True)])
    return Indentation(
        texel_forces=texel_forces,
        outside=total - float(texel_forces.sum()),
        total_force=total,
        depth=approach,
        contact_area=patches[-1].area,
        contact=placed[-1],
        error_estimate=_error(patches, forces, spread, sharp=sharp),
        assumptions={
            "strain": "small" if _linear(cover) else "small (materials linearised at zero load)",
            "friction": "frictionless",
            "base": cover.base,
        },
        seconds=time.perf_counter() - started,
    )


def _check(cover: Cover, load: float | None, depth: float | None) -> None:
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth, not both")
    value, name = (load, "load") if load is not None else (depth, "depth")
    if value is None or not np.isfinite(value) or value <= 0:
        raise ValueError(f"{name} must be positive, not {value}")
    if depth is not None and depth >= cover.thickness:
        raise ValueError(
            f"depth {depth * 1e3:.3g} mm would pierce the cover; it must be less than its thickness, "
            f"{cover.thickness * 1e3:.3g} mm"
        )


def _patches(
    cover: Cover,
    indenter: Indenter,
    load: float | None,
    depth: float | None,
    progress: Callable[[str], None] | None,
) -> list[Patch]:
    """The contact on three grids, from the store where it is known."""

    def compute() -> dict[str, Any]:
        if progress is not None:
            progress("contact on three grids")
        reach = max(2.0 * float(np.hypot(*indenter.footprint)) * 1.5, 4 * decay_length(cover))
        surface = surface_compliance(cover, reach)
        out: dict[str, Any] = {}
        for cells in CELLS:
            patch = touch(surface, indenter, cells=cells, load=load, depth=depth)
            out[f"cells_{cells}"] = np.column_stack([patch.x, patch.y, patch.force])
            out[f"scalars_{cells}"] = np.array([patch.cell, patch.depth])
        return out

    inputs = {"cover": cover, "indenter": indenter, "load": load, "depth": depth, "cells": CELLS}
    data = store.fetch("contact", inputs, compute)
    found = []
    for cells in CELLS:
        x, y, force = data[f"cells_{cells}"].T
        cell, approach = data[f"scalars_{cells}"]
        found.append(Patch(x=x, y=y, force=force, cell=float(cell), depth=float(approach)))
    return found


def _place(patch: Patch, at: tuple[float, float], yaw: float) -> FloatArray:
    """Cells in the array's frame, shape (m, 3)."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack([at[0] + c * patch.x - s * patch.y, at[1] + s * patch.x + c * patch.y, patch.force])


def _texel_forces(spread: PointSpread, array: TexelArray, contact: FloatArray) -> FloatArray:
    """Superpose the base response of every cell, cells gathered into bins far smaller than the response is wide."""
    bins = np.round(contact[:, :2] / (spread.thickness / 16))
    _, group = np.unique(bins, axis=0, return_inverse=True)
    force = np.bincount(group, contact[:, 2])
    x = np.bincount(group, contact[:, 0] * contact[:, 2]) / force
    y = np.bincount(group, contact[:, 1] * contact[:, 2]) / force
    return np.asarray(force @ spread.texel_influence(array, np.column_stack([x, y])))


def _value(values: list[float], *, sharp: bool) -> float:
    """The answer from three grids.

    Under a sharp edge the pressure is singular and the error falls as the cell size: extrapolate once (Richardson).
    Elsewhere the finest grid is the answer.
    """
    if not sharp:
        return values[-1]
    return values[-1] + (values[-1] - values[-2]) / (CELLS[-1] / CELLS[-2] - 1)


def _uncertainty(values: list[float], *, sharp: bool) -> float:
    """Estimated error of `_value`, relative: what extrapolating a grid earlier would change, or the usual index."""
    answer = _value(values, sharp=sharp)
    if sharp:
        earlier = values[1] + (values[1] - values[0]) / (CELLS[1] / CELLS[0] - 1)
        return _SAFETY * abs(answer - earlier) / abs(answer)
    return grid_convergence(values, [1 / cells for cells in CELLS]) / abs(answer)


def _error(patches: list[Patch], forces: list[FloatArray], spread: PointSpread, *, sharp: bool) -> dict[str, float]:
    peak = int(np.argmax(forces[-1]))
    return {
        "total_force": _uncertainty([p.total_force / p.depth for p in patches], sharp=sharp),
        "peak_texel": _uncertainty([float(force[peak]) for force in forces], sharp=sharp)
        + spread.error_estimate["peak_texel"],
        "contact_area": _uncertainty([p.area for p in patches], sharp=sharp),
    }


def _linear(cover: Cover) -> bool:
    return all(layer.material.small_strain_only for layer in cover.layers)
