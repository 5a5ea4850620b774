"""Solve frictionless indentations at small strain: contact on rectangular cells, texel forces by superposition.

On a wide cover, whose edges have no effect, the contact solution is the same at every position.  On a cover of limited
size the free side edges increase the compliance of the top, and the texel forces follow from a three-dimensional
solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from fem_reference import result_store
from fem_reference.finite_strain.loading_path import LoadingPath, Progress, report
from fem_reference.grid_convergence import grid_convergence, texel_convergence
from fem_reference.indentation.grid_solution import Base, GridSolution, GridStudy, scale_to_target
from fem_reference.linear_response.axisymmetric import point_spread
from fem_reference.linear_response.point_spread import TexelInfluence, superpose
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, decay_length, surface_compliance
from fem_reference.small_strain_contact.frictionless import ContactPatch, bound_contact, solve_contact
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose

#: Number of cells across the contact on all grids, coarsest first [-].  Three neighbouring grids give a result and its
#: error.  The numbers are multiples of 16, the smallest number of cells of the pattern that all grids repeat.
CELLS = (64, 96, 144, 224, 336)
#: Number of cells across the contact under several layers, to choose element sizes [-].
_FEW_CELLS = 16
#: Smallest estimated relative error on a wide cover, due to the table of the compliance of the top [-].
_LEAST_ERROR = 1e-4
#: Smallest estimated relative error on a cover of limited size, due to the additional compliance of its sides [-].  All
#: grids use the same mesh for this compliance, so that the differences between grids do not include its error.
_LEAST_ERROR_LIMITED = 1.5e-3
#: Size of the rectangle of cells in which the contact is searched, over the estimated size of the contact [-].
_WINDOW = 1.35
#: Size of the contact over that of the rectangle of cells, above which the rectangle may be too small for the contact
#: [-]; one to two cells less than 1.
_FULL = 0.98


def study_path(path: LoadingPath, place: Place | None, progress: Progress, refinement: int = 0) -> GridStudy:
    """Solve a frictionless loading path at small strain on three grids, or read the solutions from the result store.

    The solution under a flat face is proportional to the load, so a flat face is solved once and scaled.

    Args:
        path: Cover, indenter, and target loads or depths.
        place: Array, and pose of the indenter.  Required on a cover of limited size, where every pose is solved.
        progress: Called with a line of text before each solve.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].

    Returns:
        For each target the solutions on the three grids, coarsest first, and how they converge.
    """
    flat, response = path.indenter.is_flat, respond(path.cover, place, progress)
    parts = [replace(path, targets=(target,)) for target in path.targets]
    if flat:
        parts = [replace(path, targets=(path.cover.thickness,), control="depth")]
    solutions = [
        [
            build_solution(press_cells(part, place, progress, cells), path.indenter, response)
            for cells in CELLS[refinement : refinement + 3]
        ]
        for part in parts
    ]
    if flat:
        solutions = [[scale_to_target(each, target, path.control) for each in solutions[0]] for target in path.targets]
    return GridStudy(
        solutions=solutions,
        most_order=1.0,
        extrapolate=flat,
        least_error=least_error(path.cover),
    )


def respond(cover: Cover, place: Place | None, progress: Progress) -> TexelInfluence:
    """Solve for the texel forces per unit load on the top; on a cover of limited size for the array of a place."""
    if cover.size is None:
        return point_spread(cover, progress=progress)
    from fem_reference.linear_response.finite_cover import solid_influence

    return solid_influence(cover, require_place(place).array, progress=progress)


def least_error(cover: Cover) -> float:
    """Return the smallest estimated relative error on a cover [-]."""
    return _LEAST_ERROR if cover.size is None else _LEAST_ERROR_LIMITED


def solve_coarse(path: LoadingPath, progress: Progress) -> list[GridSolution]:
    """Solve a loading path of a curved indenter on a wide cover on the coarsest grid alone, where 1 % suffices.

    Args:
        path: Cover, indenter, and target loads or depths.
        progress: Called with a line of text before each solve.

    Returns:
        One solution for each target.
    """
    response = point_spread(path.cover, progress=progress)
    each = (replace(path, targets=(target,)) for target in path.targets)
    return [build_solution(press_cells(one, None, progress, CELLS[0]), path.indenter, response) for one in each]


def estimate_contact(path: LoadingPath, place: Place | None, progress: Progress) -> FloatArray:
    """Solve the contact at the target for which a path is meshed, on one coarse grid, to choose element sizes.

    Under several layers `_FEW_CELLS` suffice, because a grid gets more cells the thinner the top layer is.

    Returns:
        Centres of the m cells in contact, in the frame of the indenter, shape (m, 2) [m].
    """
    target = path.targets[-1] if path.meshed_for is None else path.meshed_for
    cells = CELLS[0] if len(path.cover.layers) == 1 else _FEW_CELLS
    patch = press_cells(replace(path, targets=(target,)), place, progress, cells)
    return np.column_stack([patch.x, patch.y])


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedCells(Base):
    """Load on the base of a cover under contact forces on cells of its top.

    Attributes:
        contact: Columns x, y in the frame of the indenter [m] and force [N] of m cells, shape (m, 3); with friction
            the shear along x and y as well, shape (m, 5).
        response: Texel forces per unit point load on the cover.
    """

    contact: FloatArray
    response: TexelInfluence

    def forces(self, array: TexelArray, pose: Pose) -> FloatArray:
        """Superpose the responses of the base to the forces on all cells, see `Base.forces`."""
        return superpose(self.contact, self.response, array, pose)

    def estimate_error(self, place: Place, texel: int, share: float) -> float:
        """Estimate the error of a texel force from the base response on three grids, see `Base.estimate_error`."""
        coarse = [float(each[texel]) for each in _superpose_coarse(self, place)]
        # Values that do not converge monotonically say nothing about the order of convergence.
        steps = np.diff([*coarse, share])
        most = 4.0 if steps.prod() > 0 else self.response.unsure_order
        return grid_convergence([*coarse, share], self.response.sizes, most=most) / abs(share) if share else 0.0

    def texel_errors(self, place: Place, shares: FloatArray) -> FloatArray:
        """Estimate the errors of all forces from the base response on three grids, see `Base.texel_errors`."""
        table = np.array([*_superpose_coarse(self, place), shares])
        most = 4.0 if np.diff(table, axis=0).prod(axis=0).sum() > 0 else self.response.unsure_order
        return texel_convergence(table, self.response.sizes, most=most)


@lru_cache(maxsize=2)
def _superpose_coarse(pressed: PressedCells, place: Place) -> list[FloatArray]:
    """Superpose the responses on the two coarser grids, for all forces over that on the indenter, (n + 1,) each [-]."""
    contact = pressed.contact
    return [
        superpose(contact, each, place.array, place.pose) / contact[:, 2].sum()
        for each in pressed.response.on_grids[:-1]
    ]


def build_solution(patch: ContactPatch, indenter: Indenter, response: TexelInfluence) -> GridSolution:
    """Build the solution on one grid from the solved contact of an indenter and the response of the base."""
    shear = np.empty((0, len(patch.x))) if patch.shear is None else patch.shear
    contact = np.column_stack([patch.x, patch.y, patch.force, *shear])
    gap = indenter.gap(patch.x, patch.y)
    # The middles of scaled cells may lie outside a flat face, where the gap is inf.
    work = patch.depth - np.where(np.isfinite(gap), gap, 0.0)
    return GridSolution(
        size=float(np.sqrt(np.prod(patch.cell))),
        total_force=patch.total_force,
        depth=patch.depth,
        area=patch.area,
        contact=contact[:, :3],
        base=PressedCells(contact=contact, response=response),
        energy=(float(patch.force @ work) + patch.shear_work) / 2,
        shear=None if patch.shear is None else patch.shear.T,
    )


def require_place(place: Place | None) -> Place:
    """Return the place of an indenter; raise a ValueError if it is None."""
    if place is None:
        raise ValueError("the solution on a cover of limited size depends on the place: give the indenter's pose")
    return place


def press_cells(path: LoadingPath, place: Place | None, progress: Progress, cells: int) -> ContactPatch:
    """Solve the contact of a loading path with one target on one grid, or read it from the result store."""
    cover, indenter = path.cover, path.indenter
    target = path.targets[0]
    load, depth = (target, None) if path.control == "load" else (None, target)

    def compute() -> ContactPatch:
        report(progress, f"contact on {cells} x {cells} cells or more")
        reach = max(3.0 * float(np.hypot(*bound_contact(indenter, cover.thickness))), 4 * decay_length(cover))
        surface = _tabulate_surface(replace(cover, size=None), reach)
        # An extreme load, which `press` refuses afterwards because it pierces the cover, may overflow here.
        with np.errstate(over="ignore", invalid="ignore"):
            if cover.size is None:
                return solve_contact(surface, indenter, cells=cells, load=load, depth=depth)
            pose = require_place(place).pose
            return _touch_near_sides(surface, path, pose, cells=cells, load=load, depth=depth)

    inputs = {"cover": cover, "indenter": indenter, path.control: target, "cells": cells}
    if cover.size is not None:
        inputs["pose"] = require_place(place).pose
    return result_store.fetch("contact", inputs, compute)


#: Tables of the compliance of the top of wide covers; all grids of a contact use the same table.
_tabulate_surface = lru_cache(maxsize=4)(surface_compliance)


def _touch_near_sides(
    surface: SurfaceCompliance,
    path: LoadingPath,
    pose: Pose,
    *,
    cells: int,
    load: float | None,
    depth: float | None,
) -> ContactPatch:
    """Solve the contact on a cover of limited size, in a rectangle of cells that grows until it spans the contact."""
    from fem_reference.small_strain_contact.free_edges import SideEdges

    indenter = path.indenter
    largest = np.array(bound_contact(indenter, path.cover.thickness))
    half = largest
    if not indenter.is_flat:
        on_wide_cover = solve_contact(surface, indenter, cells=CELLS[0], load=load, depth=depth)
        half = np.minimum(largest, _WINDOW * _measure_extent(on_wide_cover))
    while True:
        sides = SideEdges(cover=path.cover, indenter=indenter, pose=pose, half=half)
        patch = solve_contact(surface, indenter, cells=cells, load=load, depth=depth, sides=sides)
        cut_off = (_measure_extent(patch) > _FULL * half) & (half < largest)
        if indenter.is_flat or not cut_off.any():
            # The middles of scaled cells may lie outside the cover.
            x, y = sides.clip_to_cover(patch.x, patch.y)
            return replace(patch, x=x, y=y)
        half = np.minimum(largest, _WINDOW * half)


def _measure_extent(patch: ContactPatch) -> FloatArray:
    """Measure the half widths of a contact along x and y around the axis of the indenter, shape (2,) [m]."""
    return np.array([np.abs(patch.x).max(), np.abs(patch.y).max()]) + np.array(patch.cell) / 2
