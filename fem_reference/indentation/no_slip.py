"""Solve flat faces without slip at small strain.

The contact area is the whole face and every point under it sticks, so the problem is linear: each grid takes one
factorisation, without a loading path.  A flat punch of revolution on a wide cover is solved in the r-z plane.  Any
other face is solved in three dimensions and corrects the accurate frictionless solution, see `correction`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.finite_strain.block_path import (
    BasePressure,
    BlockState,
    recover_gauss_pressure,
    recover_nodal_pressure,
)
from fem_reference.finite_strain.contact import divide_rings, unfold_points
from fem_reference.finite_strain.loading_path import Control, LoadingPath
from fem_reference.indentation import small_strain
from fem_reference.indentation.finite_cover import integrate_nodal
from fem_reference.indentation.finite_strain import integrate_rings, integrate_spline
from fem_reference.indentation.grid_solution import (
    GridSolution,
    GridStudy,
    correct_solution,
    extrapolate_solutions,
    scale_solution,
)
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.small_strain_contact.no_slip import (
    FaceGrid,
    PressedFace,
    lies_on_lines,
    press_face,
    press_stuck_disk,
)
from meshes import FlatPunch
from meshes.pose import Place, Pose

#: Function that is called with a line of text about the progress of a solution, or None.
Progress = Callable[[str], None] | None

#: Number of elements through the cover on the three axisymmetric grids [-].
DISK_GRIDS = (3, 4, 6)
#: The three grids in three dimensions.
FACE_GRIDS = (
    FaceGrid(through=2, edge=0.04, growth=1.2, across=8),
    FaceGrid(through=3, edge=0.02, growth=1.0, across=12),
    FaceGrid(through=4, edge=0.01, growth=0.8, across=16),
)
#: Tensile part of the contact force, over the whole force, above which a face separates from the cover [-].
_SEPARATES = 2e-3
#: Smallest estimated error: of axisymmetric solutions; in three dimensions of faces with sides on mesh lines, and of
#: other faces, which are represented by whole nodes [-].
_LEAST_DISK, _LEAST_ON_LINES, _LEAST_OFF_LINES = 5e-5, 1.5e-3, 3e-3


def study_path(path: LoadingPath, place: Place, progress: Progress) -> GridStudy | None:
    """Solve a loading path of a flat face without slip on three grids.

    Args:
        path: Cover, indenter with a flat face, and target loads or depths.
        place: Array, and pose of the indenter.
        progress: Called with a line of text before each solve.

    Returns:
        The solutions of every target, or None if a part of the face would separate from the cover, so that the contact
        area is not known beforehand.
    """
    wide = path.cover.size is None
    if wide and path.indenter.axisymmetric:
        return _study_disk(path, progress)
    assert isinstance(path.indenter, FlatPunch)  # noqa: S101 -- for the type checker
    pose = Pose() if wide else place.pose
    accurate = small_strain.study_path(path, None if wide else place, progress)
    pairs = _solve_faces(path, pose, progress)
    if max(face.tension for pair in pairs for face in pair) > _SEPARATES:
        return None
    on_lines = lies_on_lines(path.indenter, pose)
    sizes = [grid.edge if on_lines else 1 / grid.across for grid in FACE_GRIDS]
    solved = [
        [_build_solution(path, face, pose, size) for face in pair] for pair, size in zip(pairs, sizes, strict=True)
    ]
    return GridStudy(
        solutions=[
            [_correct(extrapolate_solutions(grids), slides, sticks, path.control, target) for slides, sticks in solved]
            for target, grids in zip(path.targets, accurate.solutions, strict=True)
        ],
        least_order=1.0,
        most_order=1.0 if on_lines else 4.0,  # the singular stress at the sides limits the order of convergence
        least_error=_LEAST_ON_LINES if on_lines else _LEAST_OFF_LINES,
        accurate=accurate,
        assumptions={},
    )


def _correct(
    accurate: GridSolution, slides: GridSolution, sticks: GridSolution, control: Control, target: float
) -> GridSolution:
    """Multiply an accurate frictionless solution by the effect of no slip on one grid.

    Args:
        accurate: Frictionless solution at the target.
        slides: Solution without friction at some depth.
        sticks: Solution without slip at the same depth.
        control: Whether the target is a load or a depth.
        target: Load [N] or depth [m].
    """
    baseline, full = (
        scale_solution(each, target / (each.depth if control == "depth" else each.total_force))
        for each in (slides, sticks)
    )
    return correct_solution(accurate, baseline=baseline, full=full, control=control, area=accurate.area)


def _build_solution(path: LoadingPath, face: PressedFace, pose: Pose, size: float) -> GridSolution:
    """Build the solution at a depth of 1 m, with a given element size; the contact area is set to zero."""
    state = BlockState(
        depth=1.0,
        load=face.force,
        area=0.0,
        overlap=0.0,
        lines=face.lines,
        forces=face.base,
        symmetric=face.symmetric,
        contact=unfold_points(face.contact, face.symmetric),
        energy=face.force / 2,
    )
    wide = path.cover.size is None
    base: BasePressure = (recover_gauss_pressure if wide else recover_nodal_pressure)(state)
    x, y, normal, *shear = state.contact.T
    turn = replace(pose, point=(0.0, 0.0, 0.0))
    return GridSolution(
        size=size,
        total_force=face.force,
        depth=1.0,
        area=0.0,
        overlap=0.0,
        contact=np.column_stack([*pose.to_indenter(x, y), normal]),
        shear=np.column_stack(turn.to_indenter(*shear)),
        energy=face.force / 2,
        base_forces=partial(integrate_spline if wide else integrate_nodal, base),
    )


def _solve_faces(path: LoadingPath, pose: Pose, progress: Progress) -> list[tuple[PressedFace, PressedFace]]:
    """Solve a face on three grids without friction and without slip, or read both from the result store."""
    cover, face = path.cover, path.indenter
    assert isinstance(face, FlatPunch)  # noqa: S101 -- for the type checker

    def compute() -> dict[str, Any]:
        out: dict[str, Any] = {}
        for number, grid in enumerate(FACE_GRIDS):
            if progress is not None:
                progress(f"no slip, {grid.through} elements through the cover")
            for name, solved in zip(("slides", "sticks"), press_face(cover, face, pose, grid), strict=True):
                key = f"{name}_{number}"
                out |= {f"x_{key}": solved.lines[0], f"y_{key}": solved.lines[1]}
                out |= {f"base_{key}": solved.base, f"contact_{key}": solved.contact}
                out[f"scalars_{key}"] = np.array([solved.force, solved.tension, *solved.symmetric])
        return out

    grids = [(grid.through, grid.edge, grid.growth, grid.across) for grid in FACE_GRIDS]
    data = result_store.fetch("no-slip-face", {"cover": cover, "indenter": face, "pose": pose, "grids": grids}, compute)
    return [
        (_read_face(data, f"slides_{number}"), _read_face(data, f"sticks_{number}"))
        for number in range(len(FACE_GRIDS))
    ]


def _read_face(data: Mapping[str, Any], key: str) -> PressedFace:
    """Build a contact from stored arrays."""
    force, tension, x, y = data[f"scalars_{key}"]
    return PressedFace(
        force=float(force),
        lines=(data[f"x_{key}"], data[f"y_{key}"]),
        base=data[f"base_{key}"],
        contact=data[f"contact_{key}"],
        symmetric=(bool(x), bool(y)),
        tension=float(tension),
    )


def _study_disk(path: LoadingPath, progress: Progress) -> GridStudy | None:
    """Solve a flat punch of revolution without slip on a wide cover on three grids."""
    cover, radius = path.cover, path.indenter.footprint[0]

    def compute() -> dict[str, Any]:
        out: dict[str, Any] = {}
        for count in DISK_GRIDS:
            if progress is not None:
                progress(f"no slip, {count} elements through the cover")
            solved = press_stuck_disk(cover, radius, elements_per_thickness=count)
            out |= solved.base.pack(f"{count}", solved.reach)
            out[f"contact_{count}"] = solved.rings
            out[f"tension_{count}"] = np.array(solved.tension)
        return out

    data = result_store.fetch("no-slip-disk", {"cover": cover, "radius": radius, "grids": DISK_GRIDS}, compute)
    if max(float(data[f"tension_{count}"]) for count in DISK_GRIDS) > _SEPARATES:
        return None
    units = [_read_disk(data, count, path) for count in DISK_GRIDS]
    return GridStudy(
        solutions=[
            [scale_solution(each, target if path.control == "depth" else target / each.total_force) for each in units]
            for target in path.targets
        ],
        least_order=1.0,
        least_error=_LEAST_DISK,
        assumptions={},
    )


def _read_disk(data: Mapping[str, Any], count: int, path: LoadingPath) -> GridSolution:
    """Build the solution of a flat punch of revolution at a depth of 1 m from stored arrays."""
    points = divide_rings(data[f"contact_{count}"])
    force = float(points[:, 2].sum())
    base = PointSpread.unpack(data, f"{count}", thickness=path.cover.thickness, force=force)
    return GridSolution(
        size=1 / count,
        total_force=force,
        depth=1.0,
        area=float(np.pi * path.indenter.footprint[0] ** 2),
        overlap=0.0,
        contact=points[:, :3],
        shear=points[:, 3:],
        energy=force / 2,
        base_forces=integrate_rings(force, base),
    )
