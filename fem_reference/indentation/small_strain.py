"""Small-strain pressing: contact on cells, base forces superposed.

On a wide cover the contact is the same everywhere; on one of limited size the side edges add to how the top yields, and
the base forces come from the three-dimensional solution.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fem_reference import result_store
from fem_reference.indentation.grid_solution import Level, ScaledLevel
from fem_reference.linear_response.finite_cover import SolidInfluence, solid_influence
from fem_reference.linear_response.point_spread import PointSpread, decay_length, point_spread
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, surface_compliance
from fem_reference.small_strain_contact.free_edges import SideEdges
from fem_reference.small_strain_contact.frictionless import ContactPatch, bound_contact, is_flat, solve_contact
from meshes import Cover, Indenter, TexelArray
from meshes.pose import Place, Pose

FloatArray = npt.NDArray[np.float64]

#: Cells across the contact on the three grids; the last one is the answer.  Sixteenths of the width fall between cells
#: on each, so that the legs of most letters and brackets are cut where they end.
CELLS = (64, 96, 144)


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearLevel:
    """One grid's answer: where the cells touch, and how the cover spreads them; the last pose's forces are kept."""

    patch: ContactPatch
    spread: PointSpread | SolidInfluence
    _last: list[tuple[TexelArray, Pose, FloatArray]] = field(default_factory=list, init=False, repr=False)

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
    def overlap(self) -> float:
        """Cells touch without overlap [-]."""
        return 0.0

    @property
    def surface(self) -> FloatArray:
        """Touching cells in the indenter's frame: x, y [m], force [N], shape (m, 3)."""
        return np.column_stack([self.patch.x, self.patch.y, self.patch.force])

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Superpose the base response of every cell, gathered into bins far smaller than the response is wide."""
        pose = Pose(at=at, yaw=yaw)
        for known, where, forces in self._last:
            if known is array and where == pose:
                return forces
        x, y, each = self.surface.T
        place = np.column_stack(pose.placed(x, y))
        _, group = np.unique(np.round(place / (self.spread.thickness / 16)), axis=0, return_inverse=True)
        force = np.bincount(group, each)
        centre = np.column_stack([np.bincount(group, place[:, i] * each) / force for i in range(2)])
        forces = np.asarray(force @ self.spread.texel_influence(array, centre))
        self._last[:] = [(array, pose, forces)]
        return forces


def levels(
    cover: Cover,
    indenter: Indenter,
    targets: Sequence[float],
    control: Literal["load", "depth"],
    progress: Callable[[str], None] | None,
    *,
    place: Place | None = None,
) -> list[list[Level]]:
    """The contact on three grids for every target, from the store where it is known.

    A cover of limited size needs the place; its levels hold for that place only.  A flat face is solved at one depth,
    and scaled: the contact is the face at any load.
    """
    spread = _spread(cover, place, progress)

    def solved(target: float, control: Literal["load", "depth"]) -> list[Level]:
        patches = _patches(cover, indenter, target, control, progress, place=place)
        return [LinearLevel(patch=patch, spread=spread) for patch in patches]

    if not is_flat(indenter):
        return [solved(target, control) for target in targets]
    known = solved(_FLAT_DEPTH * cover.thickness, "depth")
    reached = [each.depth if control == "depth" else each.total_force for each in known]
    return [
        [ScaledLevel(level=each, factor=target / one) for each, one in zip(known, reached, strict=True)]
        for target in targets
    ]


#: Depth over thickness at which flat faces are solved; small strain knows no scale [-].
_FLAT_DEPTH = 1e-2


def sizes(indenter: Indenter) -> list[float]:  # noqa: ARG001 -- one interface for both solvers
    """Cell sizes of the three grids, relative to the contact [-]."""
    return [1 / cells for cells in CELLS]


def least_order(indenter: Indenter) -> float:  # noqa: ARG001 -- one interface for both solvers
    """Smallest order of convergence believed of the three grids [-]."""
    return 1.0


def assumptions(cover: Cover, indenter: Indenter) -> dict[str, str]:  # noqa: ARG001 -- one interface for both solvers
    """Nothing beyond what every result states."""
    return {}


def base_error(cover: Cover, place: Place | None = None) -> float:
    """Relative error of a texel that the spread adds to the contact's [-]."""
    return _spread(cover, place, None).error_estimate["peak_texel"]


def _spread(cover: Cover, place: Place | None, progress: Callable[[str], None] | None) -> PointSpread | SolidInfluence:
    if cover.size is None:
        return point_spread(cover, progress=progress)
    return solid_influence(cover, _known(place).array, progress=progress)


def _known(place: Place | None) -> Place:
    if place is None:
        raise ValueError("a cover of limited size is not alike everywhere: say where the indenter stands")
    return place


def _patches(
    cover: Cover,
    indenter: Indenter,
    target: float,
    control: Literal["load", "depth"],
    progress: Callable[[str], None] | None,
    *,
    place: Place | None,
) -> list[ContactPatch]:
    aim = {control: target}
    load, depth = aim.get("load"), aim.get("depth")

    def compute() -> dict[str, Any]:
        if progress is not None:
            progress("contact on three grids")
        reach = max(3.0 * float(np.hypot(*bound_contact(indenter, cover.thickness))), 4 * decay_length(cover))
        surface = surface_compliance(replace(cover, size=None), reach)
        out: dict[str, Any] = {}
        for grid, cells in enumerate(CELLS):
            with np.errstate(over="ignore", invalid="ignore"):  # an absurd load pierces any cover, which is told below
                if cover.size is None:
                    patch = solve_contact(surface, indenter, cells=cells, load=load, depth=depth)
                else:
                    patch = _touch_near_sides(
                        surface, cover, indenter, _known(place), grid=grid, load=load, depth=depth
                    )
            out[f"cells_{cells}"] = np.column_stack([patch.x, patch.y, patch.force])
            out[f"scalars_{cells}"] = np.array([patch.cell, patch.depth])
        return out

    inputs = {"cover": cover, "indenter": indenter, control: target, "cells": CELLS}
    if cover.size is not None:
        inputs["pose"] = _known(place).pose
    data = result_store.fetch("contact", inputs, compute)
    found = []
    for cells in CELLS:
        x, y, force = data[f"cells_{cells}"].T
        cell, approach = data[f"scalars_{cells}"]
        found.append(ContactPatch(x=x, y=y, force=force, cell=float(cell), depth=float(approach)))
    return found


def _touch_near_sides(
    surface: SurfaceCompliance,
    cover: Cover,
    indenter: Indenter,
    place: Place,
    *,
    grid: int,
    load: float | None,
    depth: float | None,
) -> ContactPatch:
    """Contact on a cover of limited size, in a rectangle that grows until it holds the contact."""
    whole = np.array(bound_contact(indenter, cover.thickness))
    half = whole
    if not is_flat(indenter):
        wide = solve_contact(surface, indenter, cells=CELLS[0], load=load, depth=depth)
        half = np.minimum(whole, _ROOM * _extent(wide))
    while True:
        sides = SideEdges(cover=cover, indenter=indenter, pose=place.pose, half=half, grid=grid)
        patch = solve_contact(surface, indenter, cells=CELLS[grid], load=load, depth=depth, sides=sides)
        full = _extent(patch) > 0.98 * half  # within a cell or two of the rectangle
        if is_flat(indenter) or not (full & (half < whole)).any():
            return sides.kept(patch)
        half = np.minimum(whole, _ROOM * half)


#: Room around an expected contact [-].
_ROOM = 1.35


def _extent(patch: ContactPatch) -> FloatArray:
    """Half widths of a contact around the axis [m]."""
    return np.array([np.abs(patch.x).max(), np.abs(patch.y).max()]) + patch.cell / 2
