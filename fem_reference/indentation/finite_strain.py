"""Solve indentations at finite strain or with friction, mostly as corrections of small-strain solutions.

On a wide cover the mesh is fixed in the frame of the indenter, and one stored solution is valid for all poses.  An
indenter with a smooth shape of revolution is solved directly in the r-z plane there.  Flat faces and shapes without an
axis of revolution are solved as corrections of the small-strain solution, see `correction`.  So is every indenter on a
cover of limited size, whose solution depends on the pose.

A ball may also be pressed on one coarse grid (`press_ball`), to calibrate and to check simpler models, where a fraction
of a percent does not matter and the three grids would take too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fem_reference import result_store
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.block_path import Block, lay_out_block, lay_out_cover
from fem_reference.finite_strain.contact_problem import OVERLAP
from fem_reference.finite_strain.loading_path import LoadingPath, Progress, name_grid
from fem_reference.finite_strain.newton import PathConvergenceError
from fem_reference.indentation import small_strain
from fem_reference.indentation.correction import SolvedPair, correct_path, solve_block_pair, state_correction
from fem_reference.indentation.grid_solution import GridSolution, GridStudy, RadialBase
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
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from meshes import Cover, FlatPunch, Sphere
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose

#: Number of elements through the cover on each axisymmetric grid, coarsest grid first [-].  Three neighbouring grids
#: are solved.  The result is that of the finest of the three; its error is estimated from all three.
GRIDS = (6, 9, 13, 19, 28)
#: Smallest estimated error of a loading path with friction: that of its steps and of its friction springs [-].
_LEAST_FRICTION_ERROR = 0.015
#: Smallest estimated error of a loading path whose baseline has the same friction, steps and springs [-].  Most of the
#: error of steps and springs then cancels.
_LEAST_PAIRED_FRICTION_ERROR = 0.003
#: Number of elements through the cover under a ball on one coarse grid [-].
_BALL_ELEMENTS = 4
#: Largest radius of the region of small elements under a ball, over the radius of the ball [-].
_LARGEST_CONTACT = 0.8


def is_in_plane(path: LoadingPath) -> bool:
    """Return whether a loading path is solved in the r-z plane."""
    return path.cover.size is None and path.indenter.axisymmetric


def study_path(
    path: LoadingPath, place: Place, progress: Progress, refinement: int = 0, rubbing: GridStudy | None = None
) -> GridStudy:
    """Solve a loading path on three grids.

    Corrections of the small-strain solution have no singularity under a sharp edge, so they are assumed to converge
    with order 2, and with order 1 with friction.

    Args:
        path: Cover, indenter, target loads or depths, and friction.
        place: Array, and pose of the indenter, which matter on a cover of limited size.
        progress: Called with a line of text after each step.
        refinement: Number of axisymmetric grids that are skipped at the coarse end and added at the fine end [-].
        rubbing: Small-strain solutions with friction, which are then corrected instead of frictionless ones.

    Returns:
        The solutions of every target with the element sizes and the expected order of convergence.

    Raises:
        ValueError: If the base of a cover of limited size slides and the problem is not symmetric in both planes, so
            that the cover could move.
    """
    cover, indenter = path.cover, path.indenter
    pose = Pose() if cover.size is None else place.pose
    if cover.size is not None and cover.base == "sliding" and not all(find_mirror_planes(indenter, pose)):
        raise ValueError(
            "a cover of limited size that slides on its base stays where it is only under a shape that mirrors in both "
            "its middle planes; press its middle, bond its base, or take linear-elastic layers"
        )
    if rubbing is not None:
        path = replace(path, baseline_friction=path.friction)
    in_plane = is_in_plane(path)
    grids = () if in_plane else choose_solid_grids(cover.thickness, indenter, in_turn=path.refines_in_turn)
    fillet = choose_fillet(cover.thickness, indenter) if in_plane else min(grid.fillet for grid in grids)
    accurate = None
    if in_plane and not indenter.is_flat and rubbing is None:
        contact = small_strain.estimate_contact(path, None, progress)
        solutions = _solve_axisymmetric(path.at_model_strain, contact, progress, refinement)
        assumptions = state_rounding(indenter, fillet)
    else:
        accurate = rubbing or small_strain.study_path(path, None if cover.size is None else place, progress)
        contact = accurate.solutions[-1][0].contact[:, :2]

        def solve(part: LoadingPath, approaches: Sequence[float]) -> SolvedPair:
            """Solve a part of the path and its baseline on three grids."""
            if in_plane:
                baseline, full = (
                    _solve_axisymmetric(each, contact, progress, refinement) for each in (part.baseline, part)
                )
                return baseline, full
            lay_out = partial(_lay_out, part, contact, pose)
            return solve_block_pair(part, approaches, grids=grids, lay_out=lay_out, progress=progress)

        solutions = correct_path(path, accurate.solutions, solve)
        assumptions = state_correction(path, accurate.solutions, fillet)
    least_error = _LEAST_PAIRED_FRICTION_ERROR if path.friction else 0.0
    return GridStudy(
        solutions=solutions,
        edge_safety=choose_edge_safety(path, pose),
        least_order=2.0 if accurate is not None and not path.has_friction_effect else 1.0,
        least_overlap=OVERLAP,
        least_error=_LEAST_FRICTION_ERROR if path.has_friction_effect else least_error,
        accurate=accurate,
        assumptions=assumptions,
        warnings=warn_of_boundary(cover) if cover.size is None else (),
    )


def _lay_out(path: LoadingPath, contact: FloatArray, pose: Pose, grid: SolidGrid) -> Block:
    """Return the block to mesh on a grid.

    Args:
        path: Cover, indenter and targets.
        contact: m points of the largest small-strain contact, shape (m, 2) [m].
        pose: Pose of the indenter in the frame of the mesh.
        grid: The grid.
    """
    if path.cover.size is not None:
        if isinstance(path.indenter, FlatPunch):
            contact = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * path.indenter.footprint
        return lay_out_cover(path, pose, contact, elements_per_thickness=grid.count, fillet=grid.fillet)
    half_x, half_y = path.indenter.footprint if path.indenter.is_flat else np.abs(contact).max(axis=0)
    return lay_out_block(
        path,
        elements_per_thickness=grid.count,
        contact_half=(float(half_x), float(half_y)),
        fillet=grid.fillet,
        reach=choose_solid_reach(path.cover),
    )


def _solve_axisymmetric(
    path: LoadingPath, contact: FloatArray, progress: Progress, refinement: int
) -> list[list[GridSolution]]:
    """Solve a loading path of an indenter of revolution on three grids, or read the solutions from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        contact: m points of the largest small-strain contact, columns x, y [m], shape (m, 2).
        progress: Called with a line of text after each step.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].

    Returns:
        For each target one solution per grid, coarsest first.
    """
    cover, indenter = path.cover, path.indenter
    grids = GRIDS[refinement : refinement + 3]
    fillet = choose_fillet(cover.thickness, indenter)

    def compute() -> list[list[GridSolution]]:
        radius = max(indenter.footprint) if indenter.is_flat else float(np.hypot(*contact[:, :2].T).max())
        out, coarse = [], None
        for count in grids:
            states, coarse = press_axisymmetric(
                replace(path, fields=path.fields and count == grids[-1]),
                elements_per_thickness=count,
                contact_radius=radius,
                fillet=scale_fillet(fillet, count, GRIDS[:3]),
                reach=choose_reach(cover, radius),
                coarse=coarse,
                progress=name_grid(progress, count),
            )
            out.append(states)
        return [list(each) for each in zip(*out, strict=True)]

    return result_store.recall("finite-press", {"path": path, "grids": grids, "fillet": fillet}, compute)


@dataclass(frozen=True, kw_only=True, eq=False)
class BallPath:
    """A ball pressed into a cover to n ascending depths.

    Attributes:
        radius: Radius of the ball [m].
        depth: Approaches of the ball from first touch, shape (n,) [m].
        load: Forces on the ball, shape (n,) [N].
        contact_radius: Radii of the contact area, shape (n,) [m].
        base: Base pressure per force at every depth.
    """

    radius: float
    depth: FloatArray
    load: FloatArray
    contact_radius: FloatArray
    base: tuple[PointSpread, ...]


def press_ball(cover: Cover, radius: float, depths: Sequence[float], *, progress: Progress = None) -> BallPath:
    """Press a ball into a wide cover at finite strain on one coarse grid, or read the path from the result store.

    If the solution stops early, the depths that it reached are solved anew, on a mesh for their smaller contact.

    Args:
        cover: Laterally wide cover; materials for small strain count as neo-Hookean of the same moduli.
        radius: Radius of the ball [m].
        depths: Ascending approaches of the ball from first touch [m].
        progress: Called with a line of text after each step.

    Raises:
        PathConvergenceError: If not even the first depth converges.
    """
    ball = Sphere(radius=radius)

    def solve(wanted: Sequence[float]) -> list[GridSolution]:
        """Solve the path to some depths on one grid."""
        # A thick cover yields beside the ball: its contact is smaller than that of a ball cut off at the depth.
        contact = min(np.sqrt(radius * wanted[-1]), _LARGEST_CONTACT * radius)
        return press_axisymmetric(
            LoadingPath(cover=cover, indenter=ball, targets=tuple(wanted), control="depth"),
            elements_per_thickness=_BALL_ELEMENTS,
            contact_radius=contact,
            fillet=choose_fillet(cover.thickness, ball),
            reach=choose_reach(cover, contact),
            progress=progress,
        )[0]

    def compute() -> BallPath:
        wanted, states = list(depths), None
        while states is None:
            try:
                states = solve(wanted)
            except PathConvergenceError as error:
                wanted = [depth for depth in wanted[:-1] if depth <= error.depth]
                if not wanted:
                    raise
        return BallPath(
            radius=radius,
            depth=np.array([each.depth for each in states]),
            load=np.array([each.total_force for each in states]),
            contact_radius=np.sqrt(np.array([each.area for each in states]) / np.pi),
            base=tuple(each.base.spread for each in states if isinstance(each.base, RadialBase)),
        )

    inputs = {"cover": cover, "ball": ball, "depths": list(depths), "elements": _BALL_ELEMENTS}
    return result_store.recall("ball-path", inputs, compute)
