"""Solve a flat punch without slip on a cover at small strain in three dimensions, by finite elements of the cover.

The contact area is the whole face, and every point of the cover under it moves down by the depth and not sideways, so
the problem is linear and one factorisation solves it.  It shares no code with the contact on cells, whose ratio of
forces with and without slip it verifies.

The same mesh is solved without friction, where only the displacement along z is prescribed.  Both solutions have nearly
the same discretisation error, so their ratio is much more accurate than each of them (a control variate).  Where the
sides of the face run along x and y they lie on mesh lines, towards which the elements shrink.  Any other face is
represented by the nodes that it covers, on a mesh of equal elements under the face.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from fem_reference.elements.grading import fill_by_spacing
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.finite_strain.block_path import BlockReactions, mark_constrained
from fem_reference.finite_strain.loading_path import Units
from fem_reference.indentation.grid_solution import GridSolution
from fem_reference.linear_response.surface_compliance import choose_friction_reach
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Box, Cover, FlatPunch
from meshes.array_types import FloatArray, IntArray
from meshes.indenters.shapes import PolygonalPunch
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class NoSlipSettings:
    """Constants of the meshes under a flat face without slip."""

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
    #: Number of samples of the element size on each half of the distance between two mesh lines [-].
    samples: int = 400
    #: Smallest distance of a sample of the element size from a mesh line, over the distance between the lines [-].
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


#: The three grids for a flat face without slip in three dimensions, coarsest first.
FACE_GRIDS = (
    FaceGrid(through=2, edge=0.04, growth=1.2, across=8),
    FaceGrid(through=3, edge=0.02, growth=1.0, across=12),
    FaceGrid(through=4, edge=0.01, growth=0.8, across=16),
)


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


def press_face(cover: Cover, face: FlatPunch, pose: Pose, grid: FaceGrid) -> list[tuple[GridSolution, float]]:
    """Press a flat face into a cover by a depth of 1 m, without friction and without slip, on one grid.

    Contact is two-sided: a face that would separate from the cover has a tension above zero.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        face: Indenter with a flat face.
        pose: Pose of the indenter in the frame of the array.
        grid: Element sizes.

    Returns:
        The solution without friction and that without slip, each with the tensile part of the contact force away from
        the sides of the face, over the whole force [-].  Contact areas are set to zero.
    """
    units = Units.of(cover)
    unit, symmetric = units.length, find_mirror_planes(face, pose)
    lines = _Lines(cover=cover, face=face, pose=pose, grid=grid)
    heights, layer = lines.along_z()
    shear, compliance = units.scale_moduli(cover)
    solid = TensorSolid(
        edges=(lines.across(0), lines.across(1), heights),
        layer=layer,
        shear_modulus=shear,
        bulk_compliance=compliance,
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
    held = mark_constrained(
        np.meshgrid(*(line.nodes for line in solid.lines), indexing="ij"),
        [edges[[0, -1]] for edges in solid.edges[:2]],
        symmetric,
        bonded=cover.base == "bonded",
        free=cover.size is not None,
    )
    constrained = np.concatenate([unknown[zero] for unknown, zero in zip(number, held, strict=True)])
    out = []
    for axes in ((2,), (0, 1, 2)):
        top = [number[axis][:, :, -1][touched] for axis in axes]
        fixed = np.unique(np.concatenate([constrained, *top]))
        displacement = np.zeros(matrix.shape[0])
        displacement[top[-1]] = -1.0
        system = ConstrainedSystem(fixed).factorise(matrix)
        load = np.zeros_like(displacement)
        reaction = system.reaction(system.solve(load, displacement[fixed]), load) * units.force / unit
        shear_x, shear_y, normal = (reaction[each[:, :, -1][touched]] for each in number)
        if len(axes) == 1:
            shear_x, shear_y = np.zeros_like(normal), np.zeros_like(normal)
        force = -float(normal.sum()) * (1 + symmetric[0]) * (1 + symmetric[1])
        reactions = BlockReactions(
            lines=(x, y),
            forces=reaction[number[2][:, :, 0]],
            contact=np.column_stack([*positions, -normal, shear_x, shear_y]),
            symmetric=symmetric,
            pose=pose,
            free=cover.size is not None,
            order=grid.order,
        )
        size = grid.edge if lines.on_lines else 1 / grid.across
        solution = reactions.describe(rubs=True, size=size, total_force=force, depth=1.0, area=0.0, energy=force / 2)
        out.append((solution, measure_tension(-normal, inside[touched], min(unit, *face.footprint))))
    return out


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
    def on_lines(self) -> bool:
        """Whether the sides of the face lie on mesh lines."""
        return lies_on_lines(self.face, self.pose)

    @cached_property
    def _half(self) -> float:
        """Smaller half width of the flat face of the indenter [thicknesses]."""
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
        marks = np.unique(corners) if self.on_lines else np.array([low, high])
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
        """Return the positions of the two outer boundaries of the mesh along an axis [thicknesses].

        Args:
            axis: 0 for x, 1 for y.
            low: Lower end of the face [thicknesses].
            high: Upper end of the face [thicknesses].
        """
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
        if self.on_lines:
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
        """Place element edges along z.

        Returns:
            Positions of the edges [thicknesses], and index of the layer of each element.
        """
        edges, layers, bottom = [np.zeros(1)], [], 0.0
        for number, each in enumerate(self.cover.layers):
            thickness = each.thickness / self.cover.thickness
            z = _sample(bottom, bottom + thickness)
            spacing = np.full_like(z, thickness / max(1, round(thickness * self.grid.through)))
            if self.on_lines and number == len(self.cover.layers) - 1:
                spacing = np.minimum(spacing, self._edge + self.grid.growth * (z[-1] - z))
            part = fill_by_spacing(z, spacing, least=2)[1:]
            edges.append(part)
            layers += [number] * len(part)
            bottom += thickness
        heights = np.concatenate(edges)
        heights[-1] = 1.0
        return heights, np.array(layers)


def _sample(first: float, last: float) -> FloatArray:
    """Return sample positions from `first` to `last` that lie close together at both ends, shape (n,)."""
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
