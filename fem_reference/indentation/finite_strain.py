"""Solve the indentation of a wide cover at finite strain or with friction.

A wide cover is so large that its edges have no effect, and has the same properties everywhere.  The mesh is therefore
fixed in the frame of the indenter, and one stored solution is valid for all poses.  An indenter with a smooth shape of
revolution is solved directly in the r-z plane.  Flat faces and shapes without an axis of revolution are solved as
corrections of the small-strain solution, see `correction`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from fem_reference import result_store
from fem_reference.fields.cover_fields import CoverFields
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.block_path import BasePressure, Block, lay_out_block, recover_gauss_pressure
from fem_reference.finite_strain.contact import divide_rings
from fem_reference.finite_strain.contact_problem import OVERLAP
from fem_reference.finite_strain.loading_path import LoadingPath, name_grid
from fem_reference.indentation import small_strain
from fem_reference.indentation.correction import (
    LEAST_FRICTION_ERROR,
    LEAST_PAIRED_FRICTION_ERROR,
    BlockModel,
    SolvedPair,
    correct_path,
    solve_block_pair,
    state_correction,
)
from fem_reference.indentation.grid_solution import BaseForces, GridSolution, GridStudy
from fem_reference.indentation.rounding import (
    SolidGrid,
    choose_edge_safety,
    choose_fillet,
    choose_solid_grids,
    scale_fillet,
    state_rounding,
)
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import choose_reach, choose_solid_reach, warn_of_boundary
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose

#: Function that is called with a line of text about the progress of a solution, or None.
Progress = Callable[[str], None] | None

#: Number of elements through the cover on all axisymmetric grids; three neighbouring grids give a result, that of the
#: finest, and its error [-].
GRIDS = (6, 9, 13, 19, 28)
#: Number of Gauss points along each side of a texel, for the integral of the base pressure [-].
_TEXEL_POINTS = 16


def count_refinements(path: LoadingPath) -> int:
    """Return how often the grids of `study_path` can be refined; in three dimensions finer ones are not feasible."""
    return len(GRIDS) - 3 if path.indenter.axisymmetric else 0


def study_path(
    path: LoadingPath, progress: Progress, refinement: int = 0, rubbing: GridStudy | None = None
) -> GridStudy:
    """Solve a loading path on a wide cover on three grids.

    Corrections of the small-strain solution have no singularity under a sharp edge, so they are assumed to converge
    with order 2, and with order 1 with friction.

    Args:
        path: Cover, indenter, target loads or depths, and friction.
        progress: Called with a line of text after each step.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].
        rubbing: Small-strain solutions with friction, which are then corrected instead of frictionless ones.

    Returns:
        The solutions of every target with the element sizes and the expected order of convergence.
    """
    if rubbing is not None:
        path = replace(path, baseline_friction=path.friction)
    corrected = path.indenter.is_flat or not path.indenter.axisymmetric or rubbing is not None
    accurate = None
    fillet = choose_fillet(path.cover.thickness, path.indenter)
    assumptions = state_rounding(path.indenter, fillet)
    if corrected:
        accurate = rubbing or small_strain.study_path(path, None, progress)
        contact = accurate.solutions[-1][0].contact
        solve = partial(_solve_pair, contact=contact, progress=progress, refinement=refinement)
        solutions = correct_path(path, accurate.solutions, solve)
        assumptions = state_correction(path, accurate.solutions, fillet)
    else:
        contact = small_strain.estimate_contact(path, None, progress)
        solutions = _solve_axisymmetric(path.at_model_strain, contact, progress, refinement)
    return GridStudy(
        solutions=solutions,
        edge_safety=choose_edge_safety(path, Pose()),
        least_order=2.0 if corrected and not path.has_friction_effect else 1.0,
        least_overlap=OVERLAP,
        least_error=_choose_least_error(path),
        accurate=accurate,
        assumptions=assumptions,
        warnings=warn_of_boundary(path.cover),
    )


def _choose_least_error(path: LoadingPath) -> float:
    """Return the smallest error that is estimated for a loading path [-]."""
    if path.has_friction_effect:
        return LEAST_FRICTION_ERROR
    return LEAST_PAIRED_FRICTION_ERROR if path.friction else 0.0


def _solve_pair(
    path: LoadingPath, approaches: Sequence[float], *, contact: FloatArray, progress: Progress, refinement: int
) -> SolvedPair:
    """Solve a loading path and its baseline, at small strain without friction, on three grids.

    Args:
        path: Cover, indenter, targets and friction.
        approaches: Small-strain depth at each target [m].
        contact: m points of the largest small-strain contact, columns x, y [m] first, shape (m, 2) or wider.
        progress: Called with a line of text after each step.
        refinement: Number of axisymmetric grids that are skipped at the coarse end and added at the fine end [-].
    """
    cover, indenter = path.cover, path.indenter
    if indenter.axisymmetric:
        baseline, full = (_solve_axisymmetric(each, contact, progress, refinement) for each in (path.baseline, path))
        return baseline, full
    half_x, half_y = indenter.footprint if indenter.is_flat else np.abs(contact[:, :2]).max(axis=0)
    reach = choose_solid_reach(cover)

    def lay_out_grid(grid: SolidGrid) -> Block:
        """Return the block to mesh on a grid."""
        return lay_out_block(
            path,
            elements_per_thickness=grid.count,
            contact_half=(float(half_x), float(half_y)),
            fillet=grid.fillet,
            reach=reach,
        )

    model = BlockModel(
        kind="finite-press",
        inputs={},
        pose=Pose(),
        grids=choose_solid_grids(cover.thickness, indenter, in_turn=path.refines_in_turn),
        lay_out=lay_out_grid,
        recover_pressure=recover_gauss_pressure,
        integrate=lambda base: partial(integrate_spline, base),
    )
    return solve_block_pair(path, approaches, model, progress)


def integrate_spline(base: BasePressure, array: TexelArray, pose: Pose) -> FloatArray:
    """Integrate a base pressure, given in the frame of the indenter, over n texels and the rest, shape (n + 1,) [N]."""
    nodes, weights = np.polynomial.legendre.leggauss(_TEXEL_POINTS)
    half = np.array(array.texel_size) / 2
    offset = np.stack(np.meshgrid(nodes * half[0], nodes * half[1]), axis=-1).reshape(-1, 2)
    position = array.centres[:, None, :2] + offset
    x, y = pose.to_indenter(position[..., 0], position[..., 1])
    grid_x, grid_y, pressure = base
    inside = (x > grid_x[0]) & (x < grid_x[-1]) & (y > grid_y[0]) & (y < grid_y[-1])
    spline = RectBivariateSpline(grid_x, grid_y, pressure)
    value = np.where(inside, spline.ev(x, y), 0.0)
    force = np.where(array.active, value @ np.outer(weights, weights).ravel() * half[0] * half[1], 0.0)
    return np.append(force, spline.integral(grid_x[0], grid_x[-1], grid_y[0], grid_y[-1]) - force.sum())


def _solve_axisymmetric(
    path: LoadingPath, contact: FloatArray, progress: Progress, refinement: int
) -> list[list[GridSolution]]:
    """Solve a loading path of an indenter of revolution on three grids, or read the solutions from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        contact: m points of the largest small-strain contact, columns x, y [m] first, shape (m, 2) or wider.
        progress: Called with a line of text after each step.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].

    Returns:
        For each target one solution per grid, coarsest first.
    """
    cover, indenter = path.cover, path.indenter
    grids = GRIDS[refinement : refinement + 3]
    fillet = choose_fillet(cover.thickness, indenter)

    def compute() -> dict[str, Any]:
        radius = max(indenter.footprint) if indenter.is_flat else float(np.hypot(*contact[:, :2].T).max())
        reach = choose_reach(cover, radius)
        out: dict[str, Any] = {}
        coarse = None
        for count in grids:
            states, coarse = press_axisymmetric(
                path,
                elements_per_thickness=count,
                contact_radius=radius,
                fillet=scale_fillet(fillet, count, GRIDS[:3]),
                reach=reach,
                coarse=coarse,
                progress=name_grid(progress, count),
            )
            for i, state in enumerate(states):
                out |= state.base.pack(f"{count}_{i}", reach)
                out[f"scalars_{count}_{i}"] = np.array(
                    [state.load, state.depth, state.area, state.overlap / state.depth, state.energy]
                )
                out[f"rings_{count}_{i}"] = state.rings
                if state.fields is not None and count == grids[-1]:
                    out |= state.fields.pack(f"fields_{count}_{i}")
        return out

    data = result_store.fetch("finite-press", {"path": path, "grids": grids, "fillet": fillet}, compute)
    return [
        [read_axisymmetric_solution(data, f"{count}_{i}", 1 / count, path) for count in grids]
        for i in range(len(path.targets))
    ]


def read_axisymmetric_solution(data: Mapping[str, Any], key: str, size: float, path: LoadingPath) -> GridSolution:
    """Build one axisymmetric solution from stored arrays; forces and depth are divided by the load scale.

    Args:
        data: Stored arrays.
        key: End of the names of the arrays of this solution.
        size: Size of its elements; only ratios of sizes are used.
        path: Cover, friction and load scale.
    """
    load, depth, area, overlap, energy = (float(value) for value in data[f"scalars_{key}"])
    base = PointSpread.unpack(data, key, thickness=path.cover.thickness, force=load)
    force = load / path.load_scale
    points = divide_rings(data[f"rings_{key}"] / [1, path.load_scale, path.load_scale])
    return GridSolution(
        size=size,
        total_force=force,
        depth=depth / path.load_scale,
        area=area,
        overlap=overlap,
        contact=points[:, :3],
        shear=points[:, 3:] if path.friction else None,
        energy=energy / path.load_scale**2,
        fields=CoverFields.unpack(data, f"fields_{key}"),
        base_forces=integrate_rings(force, base),
    )


def integrate_rings(force: float, base: PointSpread) -> BaseForces:
    """Return a function that computes the forces on and outside the texels due to an axisymmetric base pressure."""
    load = np.array([[force]])
    return lambda array, pose: base.base_forces(array, np.array(pose.at[:1]), np.array(pose.at[1:]), load)
