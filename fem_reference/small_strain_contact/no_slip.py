"""Solve a flat punch without slip on a cover at small strain: in the r-z plane, or in three dimensions.

Every point of the cover under the face moves down by the depth and not sideways, so the problem is linear and one
factorisation solves it.

In the r-z plane elements shrink geometrically towards the edge of the punch, where the stress is singular.

In three dimensions the same mesh is solved without friction, where only the displacement along z is prescribed.  Both
solutions have nearly the same discretisation error, so their ratio is much more accurate than each of them (a control
variate).  Where the sides of the face run along x and y they lie on mesh lines, towards which the elements shrink.  Any
other face is represented by the nodes that it covers, on a mesh of equal elements under the face.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from fem_reference.elements.grading import fill_by_spacing, grade_around_edge
from fem_reference.elements.taylor_hood import assemble_linear, prepare_elements
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.linear_response.axisymmetric import BaseResponse, find_constrained, mesh_cover, recover_base_response
from fem_reference.linear_response.surface_compliance import choose_friction_reach
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Box, Cover, FlatPunch
from meshes.array_types import FloatArray, IntArray
from meshes.indenters.shapes import PolygonalPunch
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class NoSlipSettings:
    """Numbers of the meshes under a flat face without slip."""

    #: Element size at the edge of a punch of revolution over the smaller of its radius and the thickness of the top
    #: layer [-].
    disk_edge: float = 1e-4
    #: Size ratio of neighbouring elements in the r-z plane, minus one, times the number of elements through the cover
    #: [-].
    disk_growth: float = 1.2
    #: Increase of the element size per distance from the face [-].
    outward: float = 0.6
    #: Increase of the element size per distance from the sides of the face inside it, where the sides are farther than
    #: a cover thickness away [-].
    inward: float = 0.3
    #: Element size at the free sides of a cover over the cover thickness, times the number of elements through the
    #: cover [-].
    at_side: float = 1.5
    #: Element size at the free sides, if larger, over the distance of the face from the sides [-].
    at_far_side: float = 0.3
    #: Samples of the element size between two mesh lines, on each half [-].
    samples: int = 400
    #: Smallest distance of a sample from these lines over the distance between them [-].
    closest: float = 1e-5
    #: Distance over the thickness of the cover below which two positions are equal [-].
    same: float = 1e-7
    #: Factor on the thickness of the top layer in the comparison of lengths that sets the element size at the sides of
    #: a face [-].
    thin_top: float = 4.0
    #: Factor on the number of elements across a face without mirror symmetry, to limit the computing time [-].
    unsymmetric: float = 0.6
    #: Distance from the outline of a face, over the smaller of its half width and the cover thickness, within which
    #: tensile forces count as discretisation error of the singular stress at the edge [-].
    at_edge: float = 0.1


_SETTINGS = NoSlipSettings()


#: Distance from a boundary of the mesh, over the cover thickness, below which a node counts as on the boundary [-].
_ON_BOUNDARY = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedDisk:
    """Contact of a flat punch of revolution without slip, per unit depth.

    Attributes:
        force: Normal force on the punch [N/m].
        base: Base pressure over the radius [Pa/m].
        reach: Radius of the outer boundary [m].
        rings: For the circle through each of m nodes under the punch, its radius [m] and the force of the punch on the
            cover along -z and along the radius [N/m], shape (m, 3).
        tension: Tensile part of the contact force away from the edge, over the whole force [-].
    """

    force: float
    base: BaseResponse
    reach: float
    rings: FloatArray
    tension: float


def press_stuck_disk(cover: Cover, radius: float, *, elements_per_thickness: int) -> PressedDisk:
    """Press a flat-ended rigid cylinder without slip into a laterally wide cover by a unit depth.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius of the cylinder [m].
        elements_per_thickness: Number of elements through the cover away from the punch; each layer gets at least
            two [-].
    """
    # Units of length and stress are the cover thickness and the shear modulus of the top layer.
    unit, modulus = cover.thickness, cover.layers[-1].material.shear_modulus
    size = min(unit, radius) / elements_per_thickness
    fine = _SETTINGS.disk_edge * min(radius, cover.layers[-1].thickness)
    reach = choose_friction_reach(cover, radius)
    radii = grade_around_edge(fine, size, radius, reach, 1 + _SETTINGS.disk_growth / elements_per_thickness)
    mesh, region = mesh_cover(cover, elements_per_thickness, radii, surface_size=fine)
    elements = prepare_elements(mesh.scaled(1 / unit), region=region, axisymmetric=True)
    shear = np.array([layer.material.shear_modulus for layer in cover.layers]) / modulus
    compliance = np.array([modulus / layer.material.bulk_modulus for layer in cover.layers])
    matrix = assemble_linear(elements, shear, compliance)
    r, z = elements.nodes.T
    under = np.flatnonzero((z > 1 - _ON_BOUNDARY) & (r < radius / unit * (1 + _ON_BOUNDARY)))
    under = under[np.argsort(r[under])]
    displacement = np.zeros(len(matrix.indptr) - 1)
    displacement[2 * under + 1] = -1.0
    fixed = np.unique(np.concatenate([find_constrained(cover, r, z, reach / unit), 2 * under, 2 * under + 1]))
    system = ConstrainedSystem(fixed).factorise(matrix)
    load = np.zeros_like(displacement)
    reaction = system.reaction(system.solve(load, displacement[fixed]), load) * modulus * unit
    rings = np.column_stack([r[under] * unit, -reaction[2 * under + 1], reaction[2 * under]])
    base = np.flatnonzero(z < _ON_BOUNDARY)
    base = base[np.argsort(r[base])]
    found = recover_base_response(r[base] * unit, reaction[2 * base + 1])
    return PressedDisk(
        force=float(rings[:, 1].sum()),
        base=found,
        reach=reach,
        rings=rings,
        tension=measure_tension(rings[:, 1], radius - rings[:, 0], min(radius, unit)),
    )


@dataclass(frozen=True, kw_only=True)
class FaceGrid:
    """Element sizes of a grid.

    Attributes:
        through: Number of elements per cover thickness, and per width of a face narrower than the thickness [-].
        edge: Element size at the sides of a face that lie on mesh lines, over the smaller of its half width and the
            cover thickness [-].
        growth: Increase of the element size per distance from these sides [-].
        across: Number of elements across half of the longer side of a face whose sides do not lie on mesh lines [-].
        order: Polynomial order of the displacement [-].
    """

    through: int
    edge: float
    growth: float
    across: int
    order: int = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedFace:
    """Contact of a flat face with a cover, with or without slip, per unit depth.

    Attributes:
        force: Normal force on the face [N/m].
        lines: Positions of the nodes of the meshed part along x, shape (m,), and along y, shape (n,) [m].
        base: Normal reactions of the base at these nodes, shape (m, n) [N/m].
        contact: Columns x, y [m], force on the cover along -z, x and y [N/m] of the k nodes of the meshed part that the
            face touches, shape (k, 5).
        symmetric: Whether x = 0 and y = 0 are planes of symmetry; the mesh then ends at the plane.
        tension: Tensile part of the contact force away from the sides of the face, over the whole force [-].
    """

    force: float
    lines: tuple[FloatArray, FloatArray]
    base: FloatArray
    contact: FloatArray
    symmetric: tuple[bool, bool]
    tension: float


def lies_on_lines(face: FlatPunch, pose: Pose) -> bool:
    """Return whether all sides of a face run along the x or y axis of the array."""
    if not pose.is_aligned or not isinstance(face, Box | PolygonalPunch):
        return False
    if isinstance(face, Box):
        return True
    small = _SETTINGS.same * min(face.footprint)
    return all(
        min(abs(b[0] - a[0]), abs(b[1] - a[1])) < small
        for polygon in face.polygons
        for a, b in pairwise([*polygon, polygon[0]])
    )


def press_face(cover: Cover, face: FlatPunch, pose: Pose, grid: FaceGrid) -> tuple[PressedFace, PressedFace]:
    """Press a flat face into a cover by a unit depth, without friction and without slip, on one grid.

    Contact is two-sided: a face that would separate from the cover has a `tension` above zero.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        face: Indenter with a flat face.
        pose: Pose of the indenter in the frame of the array.
        grid: Element sizes.

    Returns:
        The contact without friction, and the contact without slip.
    """
    unit, modulus = cover.thickness, cover.layers[-1].material.shear_modulus
    symmetric = find_mirror_planes(face, pose)
    lines = _Lines(cover=cover, face=face, pose=pose, grid=grid)
    heights, layer = lines.along_z()
    solid = TensorSolid(
        edges=(lines.across(0), lines.across(1), heights),
        layer=layer,
        shear_modulus=np.array([each.material.shear_modulus for each in cover.layers]) / modulus,
        bulk_compliance=np.array([modulus / each.material.bulk_modulus for each in cover.layers]),
        order=grid.order,
    )
    upper = solid.assemble_upper()
    matrix = (upper + sp.triu(upper, 1).T).tocsr()
    x, y, _ = (line.nodes * unit for line in solid.lines)
    inside = np.asarray(face.signed_distance(*pose.to_indenter(*np.meshgrid(x, y, indexing="ij"))))
    touched = inside > -_SETTINGS.same * unit
    positions = [each[touched] for each in np.meshgrid(x, y, indexing="ij")]
    number = [
        int(solid.offsets[axis]) + np.arange(np.prod(solid.field_shape(axis))).reshape(solid.field_shape(axis))
        for axis in range(3)
    ]
    constrained = _find_constrained(number, symmetric, bonded=cover.base == "bonded", wide=cover.size is None)
    out = []
    for held in ((2,), (0, 1, 2)):
        top = [number[axis][:, :, -1][touched] for axis in held]
        fixed = np.unique(np.concatenate([constrained, *top]))
        displacement = np.zeros(matrix.shape[0])
        displacement[top[-1]] = -1.0
        system = ConstrainedSystem(fixed).factorise(matrix)
        load = np.zeros_like(displacement)
        reaction = system.reaction(system.solve(load, displacement[fixed]), load) * modulus * unit
        shear_x, shear_y, normal = (reaction[each[:, :, -1][touched]] for each in number)
        if len(held) == 1:
            shear_x, shear_y = np.zeros_like(normal), np.zeros_like(normal)
        out.append(
            PressedFace(
                force=-float(normal.sum()) * (1 + symmetric[0]) * (1 + symmetric[1]),
                lines=(x, y),
                base=reaction[number[2][:, :, 0]],
                contact=np.column_stack([*positions, -normal, shear_x, shear_y]),
                symmetric=symmetric,
                tension=measure_tension(-normal, inside[touched], min(unit, *face.footprint)),
            )
        )
    return out[0], out[1]


def _find_constrained(number: list[IntArray], symmetric: tuple[bool, bool], *, bonded: bool, wide: bool) -> IntArray:
    """Return the unknowns that are zero: on the base, on planes of symmetry, and on the outer boundary if `wide`.

    Args:
        number: Indices of the displacements along x, y and z at the nodes, each of shape (nodes along x, y, z).
        symmetric: Whether x = 0 and y = 0 are planes of symmetry.
        bonded: Whether the base holds all displacements, not only the normal one.
        wide: Whether the outer boundary is held: all displacements above a bonded base, and the one normal to the
            boundary above a sliding base, where the others would press on the base.
    """
    parts = [number[axis][:, :, 0] for axis in range(3) if bonded or axis == 2]  # noqa: PLR2004 -- normal
    for axis, mirror in enumerate(symmetric):
        held = number if bonded else [number[axis]]
        if mirror:
            parts.append(np.take(number[axis], 0, axis))
        elif wide:
            parts += [np.take(each, 0, axis) for each in held]
        if wide:
            parts += [np.take(each, -1, axis) for each in held]
    return np.unique(np.concatenate([part.ravel() for part in parts]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lines:
    """Element edges of a grid, in units of the cover thickness.

    Attributes:
        cover: Cover to mesh.
        face: Indenter with a flat face.
        pose: Pose of the indenter in the frame of the array.
        grid: Element sizes.
    """

    cover: Cover
    face: FlatPunch
    pose: Pose
    grid: FaceGrid

    @cached_property
    def _on_lines(self) -> bool:
        """Whether the sides of the face lie on mesh lines."""
        return lies_on_lines(self.face, self.pose)

    @cached_property
    def _half(self) -> float:
        """Smaller half width of the face [thicknesses]."""
        return min(self.face.footprint) / self.cover.thickness

    @cached_property
    def _edge(self) -> float:
        """Element size at sides of the face that lie on mesh lines [thicknesses]."""
        top = self.cover.layers[-1].thickness / self.cover.thickness
        return self.grid.edge * min(1.0, self._half, _SETTINGS.thin_top * top)

    @cached_property
    def _corners(self) -> FloatArray:
        """Corners of the face, or of its bounding rectangle, in the frame of the array, shape (n, 2) [thicknesses]."""
        if isinstance(self.face, PolygonalPunch):
            corners = np.concatenate([np.array(polygon, dtype=float) for polygon in self.face.polygons])
        else:
            corners = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * self.face.footprint
        return np.column_stack(self.pose.to_array(*corners.T)) / self.cover.thickness

    def across(self, axis: int) -> FloatArray:
        """Place element edges along x (axis 0) or y (axis 1), from 0 outwards if that is a plane of symmetry."""
        corners = self._corners[:, axis]
        low, high = float(corners.min()), float(corners.max())
        symmetric = find_mirror_planes(self.face, self.pose)
        start, end = self._find_ends(axis, low, high)
        marks = np.unique(corners) if self._on_lines else np.array([low, high])
        marks = marks[np.append(True, np.diff(marks) > _SETTINGS.same)]
        if symmetric[axis]:
            start, marks = 0.0, marks[marks > _SETTINGS.same]
        inner = marks[(marks > start + _SETTINGS.same) & (marks < end - _SETTINGS.same)]
        parts = [np.array([start])]
        for first, last in pairwise([start, *inner, end]):
            x = _sample(first, last)
            parts.append(fill_by_spacing(x, self._space(x, marks, any(symmetric), (low, high), end))[1:])
        return np.concatenate(parts)

    def _find_ends(self, axis: int, low: float, high: float) -> tuple[float, float]:
        """Return the positions of the outer boundary along an axis, given those of the ends of the face."""
        if self.cover.size is not None:
            half = self.cover.size[axis] / 2 / self.cover.thickness
            return -half, half
        reach = choose_friction_reach(self.cover, (high - low) / 2 * self.cover.thickness) / self.cover.thickness
        return low - reach, high + reach

    def _space(
        self, x: FloatArray, marks: FloatArray, symmetric: bool, ends: tuple[float, float], boundary: float
    ) -> FloatArray:
        """Compute the element size at positions along an axis.

        Args:
            x: Positions, shape (n,).
            marks: Positions of mesh lines at the sides of the face, or of the ends of the face.
            symmetric: Whether there is a plane of symmetry.
            ends: Lowest and highest position of the face.
            boundary: Position of the upper outer boundary; the lower one of an unsymmetric mesh is opposite.
        """
        outside = np.maximum(np.maximum(ends[0] - x, x - ends[1]), 0.0)
        regular = min(1.0, 2 * self._half) / self.grid.through
        if self._on_lines:
            nearest = np.abs(x[:, None] - marks).min(axis=1)
            inward = _SETTINGS.inward * np.maximum(nearest - 1, 0)
            size = regular + np.where(outside > 0, _SETTINGS.outward * outside, inward)
            size = np.minimum(size, self._edge + self.grid.growth * nearest)
        else:
            across = self.grid.across * (1.0 if symmetric else _SETTINGS.unsymmetric)
            size = min(regular, max(self.face.footprint) / self.cover.thickness / across) + _SETTINGS.outward * outside
        if self.cover.size is not None:
            clearance = min(boundary - ends[1], boundary + ends[0])
            at_side = max(_SETTINGS.at_side / self.grid.through, _SETTINGS.at_far_side * clearance)
            size = np.minimum(size, at_side + _SETTINGS.outward * np.minimum(boundary - x, x + boundary))
        return size

    def along_z(self) -> tuple[FloatArray, IntArray]:
        """Place element edges along z; return them and the layer of each element."""
        edges, layers, bottom = [np.zeros(1)], [], 0.0
        for number, each in enumerate(self.cover.layers):
            thickness = each.thickness / self.cover.thickness
            z = _sample(bottom, bottom + thickness)
            spacing = np.full_like(z, thickness / max(1, round(thickness * self.grid.through)))
            if self._on_lines and number == len(self.cover.layers) - 1:
                spacing = np.minimum(spacing, self._edge + self.grid.growth * (z[-1] - z))
            part = fill_by_spacing(z, spacing, least=2)[1:]
            edges.append(part)
            layers += [number] * len(part)
            bottom += thickness
        heights = np.concatenate(edges)
        heights[-1] = 1.0
        return heights, np.array(layers)


def _sample(first: float, last: float) -> FloatArray:
    """Return positions from `first` to `last` that lie close together at both ends."""
    near = np.concatenate([[0.0], np.geomspace(_SETTINGS.closest, 0.5, _SETTINGS.samples)])
    return np.asarray(first + (last - first) * np.unique(np.concatenate([near, 1 - near])))


def measure_tension(forces: FloatArray, inside: FloatArray, size: float) -> float:
    """Compute the tensile part of nodal contact forces away from the edge of a face, over the whole force [-].

    A face under which it is not near zero would separate from the cover.

    Args:
        forces: Normal contact forces on the cover at n nodes, positive in compression, shape (n,) [N].
        inside: Distance of each node from the outline of the face, shape (n,) [m].
        size: Smaller of the face's half width and the cover thickness [m].
    """
    away = inside > _SETTINGS.at_edge * size
    return float(-np.minimum(forces[away], 0.0).sum() / forces.sum())
