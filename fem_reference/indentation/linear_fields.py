"""Compute the fields in a cover of linear elastic layers from the contact of a solved indentation.

The contact on a linear cover is solved with the compliance of its surface, without a mesh of the cover.  The fields are
solved afterwards on one mesh with the contact forces as loads on the top.  The loads are consistent nodal forces: each
contact force is distributed by the values of the shape functions at its point.  Under a flat face without slip, the
displacements of the top are known and are prescribed instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from fem_reference.elements.grading import ON_BOUNDARY, grade_contact, grade_outward
from fem_reference.elements.line import Line
from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.fields.cover_fields import CoverFields, recover_fields
from fem_reference.finite_strain.block_path import Block, find_constrained, lay_out_cover, mesh_block
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from fem_reference.linear_response.axisymmetric import RadialCover
from fem_reference.linear_response.surface_compliance import (
    choose_friction_reach,
    choose_linear_reach,
    choose_solid_reach,
)
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import FlatPunch
from meshes.array_types import FloatArray, IntArray
from meshes.pose import Place, Pose

#: Number of elements through the cover in the axisymmetric mesh for displacement and stress [-].
_COUNT = 16
#: Number of elements through the cover in the three-dimensional mesh for displacement and stress [-].
_SOLID_COUNT = 4
#: Radius of the region of small elements in axisymmetric meshes, over the contact radius [-].
_FINE_REGION = 1.3
#: Number of elements along the contact radius in axisymmetric meshes [-].
_ACROSS = 24
#: Number of points along each edge of a cell of the contact, over which its force is spread [-].
_POINTS = 4
#: Size ratio of neighbouring elements outside the region of small elements, minus one, times the number of elements
#: through the cover [-].
_GROWTH = 1.2
#: Element size at the edge of the contact in the three-dimensional mesh, over the regular element size [-].
_EDGE = 0.5
#: Largest element size in the contact in the three-dimensional mesh, over the regular element size [-].
_LARGEST = 1.2
#: Largest number of elements along half a contact in three dimensions, to limit the memory [-].
_MOST = 14


def solve_linear_fields(path: LoadingPath, contact: FloatArray, place: Place, depth: float) -> CoverFields:
    """Solve for displacement and stress in a linear cover under a contact with or without friction.

    Some indentations have no fields, see `state_missing_fields`.

    Args:
        path: Cover and indenter.
        contact: Columns x, y in the frame of the indenter [m] and force [N] of m contact points, shape (m, 3); with
            friction the shear along x and y as well, shape (m, 5).
        place: Array, and pose of the indenter.
        depth: Approach of the indenter [m].

    Returns:
        The fields in the frame of the array.
    """
    sticks, contact = _find_stuck(path, contact, depth), _spread_over_cells(contact)
    if path.cover.size is not None:
        size = min(path.cover.thickness, *np.ptp(contact[:, :2], axis=0)) / _SOLID_COUNT
        block = lay_out_cover(path, place.pose, contact[:, :2], elements_per_thickness=_SOLID_COUNT, fillet=size)
        x, y, force, *shear = contact.T
        shear = list(replace(place.pose, point=(0.0, 0.0, 0.0)).to_array(*shear)) if shear else []
        return _solve_block(path, np.column_stack([*place.pose.to_array(x, y), force, *shear]), block, sticks)
    if path.indenter.axisymmetric:
        return _solve_axisymmetric(path, contact, sticks).to_array(place.pose)
    return _solve_wide_block(path, contact, sticks).to_array(place.pose)


def state_missing_fields(path: LoadingPath, pose: Pose) -> str:
    """State in one line why an indentation has no fields; empty if it has fields.

    A cover of limited size that slides on its base is not fixed sideways, unless by symmetry.
    """
    cover = path.cover
    if cover.size is None or cover.base == "bonded" or all(find_mirror_planes(path.indenter, pose)):
        return ""
    return (
        "no fields: those of a cover of limited size that slides on its base need a load that mirrors in both its "
        "middle planes; press its middle or bond its base"
    )


def _spread_over_cells(contact: FloatArray) -> FloatArray:
    """Divide the force on each cell of a contact evenly among points of the cell.

    One point per cell would load the small elements at the axis unevenly, by up to 1 % of the depth.
    """
    x, y, *forces = contact.T
    offsets = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
    u, v = (offset.ravel() for offset in np.meshgrid(*(edge * offsets for edge in _measure_cell(x, y))))
    parts = [np.repeat(each / u.size, u.size) for each in forces]
    return np.column_stack([np.add.outer(x, u).ravel(), np.add.outer(y, v).ravel(), *parts])


def _measure_cell(x: FloatArray, y: FloatArray) -> list[float]:
    """Return the edges of the cells whose middles are given, along x and along y [m]; 0 for one row."""
    # Positions are rounded, because equal positions of cells may differ by rounding.
    steps = (np.diff(np.unique(each.round(12))) for each in (x, y))
    return [float(each.min()) if each.size else 0.0 for each in steps]


#: Function that returns the displacement of points of the top in the frame of the indenter [m], upwards, where they
#: stick to a flat face, else NaN [m].
_Stuck = Callable[[FloatArray, FloatArray], FloatArray]


def _find_stuck(path: LoadingPath, contact: FloatArray, depth: float) -> _Stuck:
    """Find where the top sticks to a flat face without slip: on the face, within a cell of a cell in contact."""
    face, near = path.indenter, -ON_BOUNDARY * path.cover.thickness
    if not (np.isinf(path.friction) and isinstance(face, FlatPunch)):
        return lambda x, _y: np.full(x.shape, np.nan)
    cell = np.array([edge or 1.0 for edge in _measure_cell(*contact[:, :2].T)])
    tree = cKDTree(contact[:, :2] / cell)

    def displace(x: FloatArray, y: FloatArray) -> FloatArray:
        reached = tree.query(np.column_stack([x, y]) / cell, p=np.inf)[0] < 1
        return np.where(reached & (face.signed_distance(x, y) > near), -depth, np.nan)

    return displace


def _solve_axisymmetric(path: LoadingPath, contact: FloatArray, sticks: _Stuck) -> CoverFields:
    """Solve for displacement and stress around the axis of an indenter of revolution, in the frame of the indenter."""
    units = path.units
    r = np.hypot(contact[:, 0], contact[:, 1]) / units.length
    radius = float(r.max())
    choose = choose_friction_reach if path.friction else choose_linear_reach
    reach = choose(path.cover, radius * units.length) / units.length
    size = min(1 / _COUNT, radius / _ACROSS)
    radii = grade_outward(size, _FINE_REGION * radius, reach, 1 + _GROWTH / _COUNT)
    radial = RadialCover.mesh(path.cover, _COUNT, radii, surface_size=size)
    elements, top = radial.elements, radial.top
    load = np.zeros(elements.displacements + elements.pressures)
    shapes = Line(edges=radii, order=2).at(r).T / units.force
    load[2 * top + 1] = -shapes @ contact[:, 2]
    x, y, _, *shear = contact.T
    if shear:
        load[2 * top] = shapes @ ((x * shear[0] + y * shear[1]) / (r * units.length))
    at = elements.nodes[top, 0] * units.length
    return _solve(path, elements, load, radial.constrained, top=top, moved=sticks(at, 0 * at))


def _solve_wide_block(path: LoadingPath, contact: FloatArray, sticks: _Stuck) -> CoverFields:
    """Solve for displacement and stress in a wide cover around an indenter, in the frame of the indenter."""
    unit = path.units.length
    halves = np.abs(contact[:, :2]).max(axis=0) / unit
    reach = choose_solid_reach(path.cover) / unit
    symmetric = path.indenter.mirror_symmetry
    sides, sizes = [], []
    for half, mirror in zip(halves.tolist(), symmetric, strict=True):
        size = max(min(1.0, 2 * half) / _SOLID_COUNT, half / _MOST)
        side = grade_contact(half, reach, fine=_EDGE * size, most=_LARGEST * size)
        sides.append(side if mirror else np.concatenate([-side[:0:-1], side]))
        sizes.append(size)
    size = min(sizes)
    surface = IndenterSurface(indenter=path.indenter, fillet=size, unit=unit)
    block = Block(sides=sides, symmetric=symmetric, size=size, surface=surface)
    return _solve_block(path, contact, block, sticks)


def _solve_block(path: LoadingPath, contact: FloatArray, block: Block, sticks: _Stuck) -> CoverFields:
    """Solve for displacement and stress in a meshed part of a cover, and extend them by mirror images.

    Args:
        path: Cover and indenter.
        contact: Columns x, y [m] and force, with friction also the shear along x and y [N], of m contact points in the
            frame of the block, shape (m, 3) or (m, 5).
        block: The part of the cover.
        sticks: Where the top sticks to a face.
    """
    units = path.units
    elements = mesh_block(block, units.scale_cover(path.cover), _SOLID_COUNT)
    x, y, z = elements.nodes.T
    top = np.flatnonzero(z > 1 - ON_BOUNDARY)
    side = [
        np.where(each < 0, -1.0, 1.0) if mirror else 1.0
        for each, mirror in zip(contact[:, :2].T, block.symmetric, strict=True)
    ]
    along_x, along_y = (
        line.at(sign * each / units.length)
        for line, sign, each in zip(block.lines, side, contact[:, :2].T, strict=True)
    )
    load = np.zeros(elements.displacements + elements.pressures)
    for axis, sign, force in zip((2, 0, 1), (-1.0, *side), contact[:, 2:].T, strict=False):
        forces = along_x.T @ (along_y * (sign * force)[:, None]) / (units.force * block.multiple)
        load[3 * top + axis] = forces[block.find_nodes(x[top], y[top])]
    constrained = find_constrained(block, elements, bonded=path.cover.base == "bonded")
    moved = sticks(*block.surface.pose.to_indenter(x[top] * units.length, y[top] * units.length))
    return _solve(path, elements, load, constrained, top=top, moved=moved).unfold(block.symmetric)


def _solve(
    path: LoadingPath,
    elements: MixedElements,
    load: FloatArray,
    constrained: IntArray,
    *,
    top: IntArray,
    moved: FloatArray,
) -> CoverFields:
    """Solve the linear system of a meshed cover under nodal forces and under displacements of the top.

    Args:
        path: Cover.
        elements: Elements of the cover, in units of its thickness.
        load: Force on each of n unknowns, shape (n,) [units of force].
        constrained: Indices of the unknowns that are zero.
        top: Nodes of the top, shape (m,).
        moved: Upward displacement of each of them that sticks to a face, else NaN, shape (m,) [m].
    """
    units = Units.of(path.cover)
    solid = Solid.from_cover(elements, path.cover, units)
    matrix = solid.linearise_at_rest().stiffness
    d, stuck, value = elements.dimension, np.isfinite(moved), np.zeros_like(load)
    under = top[stuck]
    value[d * under + d - 1] = moved[stuck] / units.length
    fixed = np.unique(np.concatenate([constrained, *(d * under + axis for axis in range(d))]))
    state = ConstrainedSystem(fixed).factorise(matrix).solve(load, value[fixed])
    return recover_fields(solid, state, units, linear=True)
