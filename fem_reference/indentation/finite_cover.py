"""Solve the indentation of a cover of limited size in three dimensions, at finite strain or with friction.

The solution depends on the position of the indenter on the cover.  The mesh is therefore fixed in the frame of the
array, ends at the free side faces of the cover, and is solved for every pose.  If indenter and pose are symmetric about
the planes x = 0 or y = 0 of the cover, a half or a quarter is meshed.  The solutions on three grids correct an accurate
small-strain solution, see `correction`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np

from fem_reference.elements.grading import fill_by_spacing
from fem_reference.elements.line import Line
from fem_reference.finite_strain.block_path import BasePressure, Block, recover_nodal_pressure
from fem_reference.finite_strain.contact_problem import OVERLAP
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import small_strain
from fem_reference.indentation.correction import (
    LEAST_FRICTION_ERROR,
    BlockModel,
    correct_path,
    solve_block_pair,
    state_correction,
)
from fem_reference.indentation.grid_solution import GridStudy
from fem_reference.indentation.rounding import SolidGrid, choose_edge_safety, choose_solid_grids
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from meshes import FlatPunch, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose

#: Element size at the edge of a contact: over the radius of the rounded edge where the edge lies on mesh lines, else
#: over the regular element size, which follows from the number of elements through the cover [-].
_EDGE, _INSIDE = 0.6, 0.5
#: Increase of the element size per distance from the edge of the contact and from the sides of the cover [-].
_GROWTH = 0.4
#: Largest element size in the contact, and at the sides of the cover, over the regular element size [-].
_LARGEST, _AT_SIDE = 1.2, 1.5
#: Distance between the edge of the contact and a side of the cover, over half the width of the cover, below which the
#: edge of the contact counts as on the side [-].
_ON_SIDE = 1e-9
#: Number of samples of the element size between two fixed element edges [-].
_SAMPLES = 801


def study_path(path: LoadingPath, place: Place, progress: Callable[[str], None] | None) -> GridStudy:
    """Solve a loading path on three grids for one pose of the indenter.

    Args:
        path: Cover of limited size, indenter, targets and friction.
        place: Array under the cover, and pose of the indenter.
        progress: Called with a line of text after each step.

    Returns:
        The solutions of every target with the element sizes and the expected order of convergence.

    Raises:
        ValueError: If the base slides and the problem is not symmetric in both planes, so that the cover could move.
    """
    cover, indenter, pose = path.cover, path.indenter, place.pose
    if cover.base == "sliding" and not all(find_mirror_planes(indenter, pose)):
        raise ValueError(
            "a cover of limited size that slides on its base stays where it is only under a shape that mirrors in both "
            "its middle planes; press its middle, bond its base, or take linear-elastic layers"
        )
    accurate = small_strain.study_path(path, place, progress)
    grids = choose_solid_grids(cover.thickness, indenter, in_turn=path.refines_in_turn)
    points = accurate.solutions[-1][0].contact[:, :2]
    if isinstance(indenter, FlatPunch):
        points = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * indenter.footprint
    model = BlockModel(
        kind="bounded-press",
        inputs={"pose": pose},
        pose=pose,
        grids=grids,
        lay_out=lambda grid: lay_out_cover(path, pose, points, grid),
        recover_pressure=recover_nodal_pressure,
        integrate=lambda base: partial(integrate_nodal, base),
    )
    return GridStudy(
        solutions=correct_path(path, accurate.solutions, partial(solve_block_pair, model=model, progress=progress)),
        edge_safety=choose_edge_safety(path, pose),
        least_order=1.0 if path.friction else 2.0,
        least_overlap=OVERLAP,
        least_error=LEAST_FRICTION_ERROR if path.friction else 0.0,
        accurate=accurate,
        assumptions=state_correction(path, accurate.solutions, min(grid.fillet for grid in grids)),
    )


def integrate_nodal(base: BasePressure, array: TexelArray, pose: Pose) -> FloatArray:  # noqa: ARG001 -- one signature
    """Integrate a biquadratic base pressure, given in the frame of the array, over each of n texels and over the rest.

    Args:
        base: Positions of the nodes along x and y over the whole cover [m], and pressures at the nodes [Pa].
        array: Array with the texels.
        pose: Not used; the base pressure is that of the pose for which it was solved.

    Returns:
        Force on each texel, 0 on inactive texels, and then the force outside the active texels, shape (n + 1,) [N].
    """
    *lines, pressure = base
    integrals, whole = [], []
    for axis, nodes in enumerate(lines):
        line = Line(edges=nodes[::2], order=2)
        centres, half = array.centres[:, axis], array.texel_size[axis] / 2
        values, position = np.unique(centres, return_inverse=True)
        integrals.append(np.array([line.integral(c - half, c + half) for c in values])[position])
        whole.append(line.integral(nodes[0], nodes[-1]))
    force = np.where(array.active, np.einsum("na,nb,ab->n", *integrals, pressure, optimize=True), 0.0)
    return np.append(force, whole[0] @ pressure @ whole[1] - force.sum())


def lay_out_cover(path: LoadingPath, pose: Pose, contact: FloatArray, grid: SolidGrid) -> Block:
    """Choose the element edges of the whole cover, or of its half or quarter, with small elements around the contact.

    Args:
        path: Cover, indenter and targets.
        pose: Pose of the indenter in the frame of the array.
        contact: m points whose bounding rectangle contains the contact, in the frame of the indenter, shape (m, 2) [m].
        grid: Number of elements through the cover, and radius of rounded edges of the indenter.
    """
    cover, indenter = path.cover, path.indenter
    unit = path.units.length
    placed = np.stack(pose.to_array(*contact.T)) / unit
    ends = np.array(cover.size) / 2 / unit
    low, high = np.maximum(placed.min(axis=1), -ends), np.minimum(placed.max(axis=1), ends)
    size = min(1.0, float((high - low).min())) / grid.count
    edge_on_line = isinstance(indenter, FlatPunch) and pose.is_aligned and not indenter.axisymmetric
    fine = _EDGE * grid.fillet / unit if edge_on_line else _INSIDE * size
    symmetric = find_mirror_planes(indenter, pose)
    sides = [
        _grade_side((low[i], high[i]), float(ends[i]), fine=fine, coarse=size, symmetric=symmetric[i]) for i in (0, 1)
    ]
    surface = IndenterSurface(indenter=indenter, fillet=grid.fillet / unit, unit=unit, pose=pose)
    return Block(sides=sides, symmetric=symmetric, size=size, surface=surface, free=True)


def _grade_side(contact: tuple[float, float], end: float, *, fine: float, coarse: float, symmetric: bool) -> FloatArray:
    """Place element edges along one direction, with the smallest elements at the edges of the contact.

    Lengths may have any unit.

    Args:
        contact: Lower and upper edge of the contact; both become element edges unless they lie on a side.
        end: Distance of the sides of the cover from its middle.
        fine: Element size at the edges of the contact.
        coarse: Regular element size, to which the largest elements in the contact and at the sides are proportional.
        symmetric: Whether only the part from the middle to the upper side is meshed.
    """
    low, high = contact
    marks = [value for value in contact if abs(value) < end * (1 - _ON_SIDE)]
    ends = [0.0 if symmetric else -end, *(mark for mark in marks if not symmetric or mark > 0), end]
    parts = [np.array(ends[:1])]
    for start, stop in pairwise(ends):
        x = np.linspace(start, stop, _SAMPLES)
        from_edge = np.min([np.abs(x - mark) for mark in marks], axis=0) if marks else np.full_like(x, np.inf)
        from_contact = np.maximum(np.maximum(low - x, x - high), 0)
        from_side = np.minimum(end - x, end + x)
        largest = np.minimum(_LARGEST * coarse + _GROWTH * from_contact, _AT_SIDE * coarse + _GROWTH * from_side)
        parts.append(fill_by_spacing(x, np.minimum(fine + _GROWTH * from_edge, largest))[1:])
    return np.concatenate(parts)
