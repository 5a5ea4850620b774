"""Compute the additional compliance of the top of a cover due to free side edges.

A cover of limited size is more compliant than a wide cover.  The additional displacement under a load is smooth away
from the sides, but the displacement of the wide cover is singular under the load, so the two are computed separately.
The compliance of the wide cover is that of `surface_compliance`.  The additional compliance is the difference between
the cover alone and the same cover with surroundings of the same layers, both from three-dimensional elements.  The two
meshes agree under the cover, so the singularity and most of the discretisation error cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from fem_reference.elements.grading import fill_by_spacing, layer_heights
from fem_reference.elements.line import Line
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.linear_response.finite_cover import PARITIES, build_solid, constrain_parity, turn_parity
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, decay_length
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator
from fem_reference.sparse_solver import SymmetricFactors
from meshes import Cover, Indenter
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class SideSettings:
    """Constants of the meshes that give the effect of free side edges."""

    #: Number of elements per cover thickness, and number of parts of each element of a coarse pattern along x and y
    #: [-].  With 2, the additional compliance is wrong by up to a third, with 3 by at most 2 %.
    parts: int = 3
    #: Distance of a free edge from the contact, over the decay length of the cover's response, above which the edge is
    #: neglected on a bonded base [-].  The effect of the edge decays from the contact to the edge and again from the
    #: edge to the contact.
    near: float = 6.0
    #: Width of the meshed surroundings on a bonded base, over the decay length of the cover's response [-].
    far: float = 8.0
    #: Distance of a free edge from the contact, over the decay length, above which the edge is neglected on a sliding
    #: base [-].  There the effect of the edge decays only with the square of the distance.  At this distance it is
    #: below 0.06 % of the force.
    near_sliding: float = 15.0
    #: Width of the meshed surroundings on a sliding base, over the decay length of the cover's response [-].
    far_sliding: float = 40.0
    #: Element size of the coarse pattern at the sides of the cover, over the distance of the sides from the contact
    #: [-].
    fine: float = 4 / 3
    #: Smallest size of the pattern's elements at the sides of the cover, over the cover thickness [-].
    smallest: float = 1 / 2
    #: Largest size of the pattern's elements at the sides of the cover, over the cover thickness [-].
    largest: float = 2.0
    #: Smallest distance between contact and sides from which the element size is computed, over the width of the
    #: contact [-].
    clearance: float = 0.15
    #: Smallest number of the pattern's elements across a contact [-].
    least: float = 1.5
    #: Increase of the pattern's element size per distance from contact and sides, in the cover [-].
    growth: float = 1.2
    #: Increase of the pattern's element size per distance from the sides, in the surroundings of the cover [-].
    outward: float = 1.6
    #: Distance between the edge of a face and a side or the middle of the cover, over the cover thickness, below which
    #: the edge of the face is no element edge of its own [-].
    sliver: float = 0.02
    #: Samples of the element size from the middle of the cover to its side [-].
    samples: int = 2001
    #: Exponent of the depths of the element edges in the top layer; above 1 the elements are small at the top [-].
    crowding: float = 1.5
    #: Number of right-hand sides that are solved at once, to limit the memory [-].
    block: int = 64


_SETTINGS = SideSettings()


@dataclass(frozen=True, kw_only=True, eq=False)
class SideEdges:
    """Free side edges of a cover of limited size, under one indenter in one pose.

    Attributes:
        cover: Cover with a size.
        indenter: Indenter with its shape.
        pose: Position and rotation of the indenter in the frame of the array.
        half: Half widths of a rectangle around the axis of the indenter that contains the contact, in the frame of the
            indenter [m].
        components: 1 for pressure alone, 3 for pressure and shear along x and y of the indenter [-].
    """

    cover: Cover
    indenter: Indenter
    pose: Pose
    half: FloatArray
    components: int = 1

    @cached_property
    def window(self) -> tuple[FloatArray, FloatArray]:
        """Centre and half widths of the rectangle that is divided into cells, in the frame of the indenter [m].

        Under a flat face with sides along those of the array, the rectangle is the part of the face on the cover.
        """
        middle, half = np.zeros(2), self.half
        if not (self.pose.is_aligned and self.indenter.is_flat):
            return middle, half
        corners = self.pose.to_indenter(*self._box)
        low, high = (np.array([pick(*axis) for axis in corners]) for pick in (min, max))
        return (low + high) / 2, (high - low) / 2

    @property
    def near(self) -> bool:
        """Whether a side of the cover is so near to the contact that its effect is not neglected."""
        near = _SETTINGS.near_sliding if self.cover.base == "sliding" else _SETTINGS.near
        return bool(self._distance < near * decay_length(self.cover))

    @property
    def is_face(self) -> bool:
        """Whether the contact is a flat face."""
        return self.indenter.is_flat

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the gap between indenter and cover [m]; inf beside the indenter and beside the cover."""
        return np.where(self.contain(x, y), self.indenter.gap(x, y), np.inf)

    def rate(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the motion against the normal of the cover per approach, 1 [-]."""
        del y
        return np.ones_like(x)

    def contain(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Return whether points in the frame of the indenter [m] lie on the cover."""
        u, v = self.pose.to_array(x, y)
        return np.asarray((np.abs(u) <= self._side[0]) & (np.abs(v) <= self._side[1]))

    def compliance(
        self, surface: SurfaceCompliance, x: FloatArray, y: FloatArray, cell: tuple[float, float]
    ) -> ComplianceOperator:
        """Create the map from pressures on cells to their displacements, see `ContactPlace.compliance`."""
        return ComplianceOperator(surface, x.shape, cell, self.add_compliance(x.ravel(), y.ravel()))

    def add_compliance(self, x: FloatArray, y: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Create the map from forces at m points to the additional displacements of these points due to the sides.

        Args:
            x: x coordinates of the points in the frame of the indenter, shape (m,) [m].
            y: y coordinates of the points in the frame of the indenter, shape (m,) [m].

        Returns:
            Function from forces to displacements in the same components, downwards and along x and y of the indenter,
            shape (m,) or (3, m) [N, m].
        """
        if not self.near:
            return np.zeros_like
        places = np.stack(self.pose.to_array(x, y), axis=-1)
        lines, chosen, flexibilities = self._difference
        along = [line.at(np.abs(places[:, i]) / self.cover.thickness)[:, chosen[i]] for i, line in enumerate(lines)]
        side = np.where(places < 0, -1.0, 1.0)
        signs = [
            np.array([(side ** turn_parity(parity, i)).prod(axis=1) for i in range(self.components)])
            for parity in self._parities
        ]
        unit = self.cover.thickness * self.cover.layers[-1].material.shear_modulus
        turn = replace(self.pose, point=(0.0, 0.0, 0.0))

        def displace(force: FloatArray) -> FloatArray:
            """Compute additional displacements [m] from forces [N] as the sum over the parities of the forces."""
            # Forces on the cover and displacements are upwards in the meshes.
            given = np.stack([-force[0], *turn.to_array(*force[1:])]) if force.ndim > 1 else -force[None]
            out = np.zeros_like(given)
            for sign, flexibility in zip(signs, flexibilities, strict=True):
                load = along[0].T @ (along[1] * (sign * given)[..., None])
                moved = (flexibility @ load.ravel()).reshape(load.shape)
                out += sign * ((along[0] @ moved) * along[1]).sum(axis=-1)
            out /= 4 * unit
            return np.stack([-out[0], *turn.to_indenter(*out[1:])]) if force.ndim > 1 else -out[0]

        return displace

    def clip_to_cover(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move points in the frame of the indenter that lie outside the cover onto its side edges [m]."""
        u, v = self.pose.to_array(x, y)
        return self.pose.to_indenter(*(np.clip(c, -side, side) for c, side in zip((u, v), self._side, strict=True)))

    @cached_property
    def _side(self) -> FloatArray:
        """Half the size of the cover along x and along y, shape (2,) [m]."""
        return np.array(self.cover.size) / 2

    @cached_property
    def _box(self) -> tuple[FloatArray, FloatArray]:
        """Bounds along x and along y of the part of the contact rectangle on the cover, in the array's frame [m]."""
        signs = np.array([[1, 1, -1, -1], [1, -1, 1, -1]])
        corners = np.stack(self.pose.to_array(*(signs * self.half[:, None])))
        low, high = np.maximum(corners.min(axis=1), -self._side), np.minimum(corners.max(axis=1), self._side)
        return np.array([low[0], high[0]]), np.array([low[1], high[1]])

    @property
    def _distance(self) -> float:
        """Distance from the contact rectangle to the nearest side of the cover [m]."""
        return min(float(side - np.abs(ends).max()) for side, ends in zip(self._side, self._box, strict=True))

    @cached_property
    def _parities(self) -> tuple[tuple[int, int], ...]:
        """Parities in x and y of the parts of the contact forces: only even across a plane of mirror symmetry."""
        symmetric = find_mirror_planes(self.indenter, self.pose)
        return tuple(
            parity for parity in PARITIES if not any(p and even for p, even in zip(parity, symmetric, strict=True))
        )

    @cached_property
    def _difference(self) -> tuple[list[Line], list[IntArray], list[FloatArray]]:
        """Displacements of the top around the contact per force, in the cover alone minus those in a wider cover.

        Returns:
            Line elements of the mesh along x and y, indices of the k nodes around the contact, and for each parity the
            displacements of these nodes per forces on them, shape (k, k), or (3 k, 3 k) with shear [-].
        """
        unit = self.cover.thickness
        spans = [_mirror_span(ends / unit) for ends in self._box]
        clearance = max(self._distance / unit, _SETTINGS.clearance * min(high - low for low, high in spans))
        size = float(np.clip(_SETTINGS.fine * clearance, _SETTINGS.smallest, _SETTINGS.largest))
        thicknesses = [layer.thickness for layer in self.cover.layers]
        counts = [max(1, round(_SETTINGS.parts * each / unit)) for each in thicknesses]
        heights, layer = layer_heights(thicknesses, counts, crowd_surface=_SETTINGS.crowding)
        inner = [
            _grade_cover(*span, side / unit, size, sharp=self.indenter.is_flat)
            for span, side in zip(spans, self._side, strict=True)
        ]
        far = _SETTINGS.far_sliding if self.cover.base == "sliding" else _SETTINGS.far
        far *= decay_length(self.cover) / unit
        beyond = np.linspace(0, far, _SETTINGS.samples)
        beyond = fill_by_spacing(beyond, size + _SETTINGS.outward * beyond, parts=_SETTINGS.parts)[1:]
        outer = [np.append(edges, edges[-1] + beyond) for edges in inner]
        lines = [Line(edges=edges, order=2) for edges in inner]
        chosen = [
            np.unique(line.index[(line.edges[:-1] <= high) & (line.edges[1:] >= low)])
            for line, (low, high) in zip(lines, spans, strict=True)
        ]
        # In the wider mesh the pressure may jump at the sides of the cover, so that both meshes agree under the cover.
        ends = (len(inner[0]) - 1,), (len(inner[1]) - 1,)
        alone, surrounded = (
            _solve_flexibility(
                build_solid(self.cover, (x, y, heights / unit), layer, breaks=breaks),
                chosen,
                self._parities,
                self.components,
                sliding=self.cover.base == "sliding",
            )
            for (x, y), breaks in ((inner, ((), ())), (outer, ends))
        )
        return lines, chosen, [(a + a.T - b - b.T) / 2 for a, b in zip(alone, surrounded, strict=True)]


def find_mirror_planes(indenter: Indenter, pose: Pose) -> tuple[bool, bool]:
    """Return whether an indenter in a pose is symmetric about the planes x = 0 and y = 0 of the array."""
    if not pose.is_aligned:
        return False, False
    shape = indenter.mirror_symmetry
    if round(2 * pose.yaw / np.pi) % 2:
        shape = shape[::-1]
    return shape[0] and pose.at[0] == 0, shape[1] and pose.at[1] == 0


def _mirror_span(ends: FloatArray) -> tuple[float, float]:
    """Return the smallest and the largest absolute value of all coordinates between two ends."""
    low, high = ends
    return (0.0 if low <= 0 <= high else float(np.abs(ends).min())), float(np.abs(ends).max())


def _grade_cover(low: float, high: float, end: float, size: float, *, sharp: bool) -> FloatArray:
    """Place element edges from the middle of the cover, 0, to its side, `end`.

    Args:
        low: Smallest distance of the contact from the middle [thicknesses].
        high: Largest distance of the contact from the middle [thicknesses].
        end: Distance of the side from the middle [thicknesses].
        size: Size of the pattern's element at the side; elements grow away from side and contact [thicknesses].
        sharp: Whether the pressure is singular at the edges of the contact, which then become element edges.
    """
    marks = [0.0, *(mark for mark in (low, high) if sharp and _SETTINGS.sliver < mark < end - _SETTINGS.sliver), end]
    edges = [np.zeros(1)]
    for start, stop in pairwise(marks):
        x = np.linspace(start, stop, _SETTINGS.samples)
        distance = np.maximum(np.maximum(low - x, x - high), 0)
        largest = max((high - low) / _SETTINGS.least, size) + _SETTINGS.growth * distance
        edges.append(
            fill_by_spacing(x, np.minimum(size + _SETTINGS.growth * (end - x), largest), parts=_SETTINGS.parts)[1:]
        )
    return np.concatenate(edges)


def _solve_flexibility(
    solid: TensorSolid,
    chosen: list[IntArray],
    parities: tuple[tuple[int, int], ...],
    components: int,
    *,
    sliding: bool,
) -> list[FloatArray]:
    """Solve for the displacements of k top nodes along unit forces on these nodes, for each parity.

    Args:
        solid: Quarter of a block.
        chosen: Indices of the nodes along x and along y whose grid forms the k nodes.
        parities: Parities of the forces along z in x and y.
        components: 1 for forces along z, 3 for those along x and y too [-].
        sliding: Whether the base slides.

    Returns:
        Displacements per force for each parity, the component first, shape (k, k) or (3 k, 3 k) each.
    """
    upper = solid.assemble_upper()
    parts = []
    for axis in (2, 0, 1)[:components]:
        _, rows, last = solid.field_shape(axis)
        node = chosen[0][:, None] * rows + chosen[1]
        parts.append((solid.offsets[axis] + (node + 1) * last - 1).ravel())
    unknown = np.concatenate(parts)
    factors = SymmetricFactors()
    out = []
    for parity in parities:
        matrix, constrained = constrain_parity(solid, upper, parity, sliding=sliding)
        factors.factorise(matrix)
        columns = []
        for block in np.array_split(unknown, max(1, len(unknown) // _SETTINGS.block)):
            load = np.zeros((upper.shape[0], len(block)))
            load[block, np.arange(len(block))] = ~constrained[block]
            columns.append(factors.solve(load)[unknown])
        out.append(np.hstack(columns))
    return out
