"""Compliance that free side edges add to the top of a cover.

A cover of limited size is a wide cover with its surroundings cut away, which makes it softer.  The displacement that
the cut adds is smooth away from the sides, while the wide cover's displacement is singular under a load.  The two are
therefore computed apart.  The wide cover's compliance is the accurate one of `surface_compliance`.  The addition is the
difference between the cover alone and the same cover with its surroundings, both from three-dimensional elements.
Their meshes agree under the cover, so the singularity and most of the discretisation error cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem_reference.elements.grading import fill_by_spacing, growing_steps, layer_heights
from fem_reference.elements.line import Line
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.linear_response.mirror_symmetry import PARITIES, build_solid, constrain_parity
from fem_reference.linear_response.surface_compliance import decay_length
from fem_reference.sparse_solver import SymmetricFactors
from meshes import Cover, Indenter
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.pose import PlanarPose

#: Elements through the cover on the three grids, and the element size of each over that of the finest.
THROUGH, COARSENING = (2, 3, 4), (2.25, 1.5, 1.0)
#: Distance from the contact beyond which free edges are ignored, and width of the surroundings, in decay lengths [-].
#: The effect of an edge decays on the way there and on the way back.
_NEAR, _FAR = 6.0, 8.0
#: Element size at the sides of the cover over their distance from the contact, and the bounds of that element size over
#: the thickness of the cover [-].
_FINE, _SMALLEST, _LARGEST = 1 / 3, 1 / 8, 1 / 2
#: Smallest distance from the sides that sets the element size, in widths of the contact [-].
_CLEARANCE = 0.15
#: Least number of elements across a contact.
_LEAST = 6
#: Growth of elements per distance from contact and sides, and growth from one to the next in the surroundings [-].
_GROWTH, _OUTWARD = 0.3, 0.6
#: Samples from the middle to the side from which element edges are computed.
_SAMPLES = 2001
#: Power of the depths of the elements in the top layer: above 1, they are small at the top [-].
_CROWDING = 1.5
#: Right-hand sides solved at once; bounds the memory.
_BLOCK = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class SideEdges:
    """The free side edges of a cover, for one indenter at one place.

    Attributes:
        cover: A cover with a size.
        indenter: The shape.
        pose: Position and turn of the indenter.
        half: Half widths of a rectangle around the axis that holds the contact, in the indenter's frame [m].
        grid: Number of the grid, 0 to 2.
    """

    cover: Cover
    indenter: Indenter
    pose: PlanarPose
    half: FloatArray
    grid: int

    @cached_property
    def window(self) -> tuple[FloatArray, FloatArray]:
        """Centre and half widths of the rectangle that is cut into cells, in the indenter's frame [m].

        Under a flat face whose axes lie along the array's it is the part of the face on the cover.
        """
        middle, half = np.zeros(2), self.half
        if not (self.pose.is_aligned and self.indenter.is_flat):
            return middle, half
        corners = self.pose.to_indenter(*self._box)
        low, high = (np.array([pick(*axis) for axis in corners]) for pick in (min, max))
        return (low + high) / 2, (high - low) / 2

    @property
    def near(self) -> bool:
        """Whether the sides are near enough to matter."""
        return bool(self._distance < _NEAR * decay_length(self.cover))

    def contain(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Whether points of the indenter's frame [m] lie on the cover."""
        u, v = self.pose.to_array(x, y)
        return np.asarray((np.abs(u) <= self._side[0]) & (np.abs(v) <= self._side[1]))

    def add_compliance(self, x: FloatArray, y: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Map from forces at points of the indenter's frame [N] to the displacement that the sides add there [m].

        Args:
            x: Positions of the points, shape (m,) [m].
            y: Positions of the points, shape (m,) [m].
        """
        if not self.near:
            return np.zeros_like
        places = np.stack(self.pose.to_array(x, y), axis=-1)
        lines, chosen, flexibilities = self._difference
        along = [line.at(np.abs(places[:, i]) / self.cover.thickness)[:, chosen[i]] for i, line in enumerate(lines)]
        side = np.where(places < 0, -1.0, 1.0)
        signs = [(side**parity).prod(axis=1) for parity in self._parities]
        unit = self.cover.thickness * self.cover.layers[-1].material.shear_modulus

        def displace(force: FloatArray) -> FloatArray:
            """Split forces by parity, spread them to nodes, and sum the displacements of all parities."""
            out = np.zeros_like(force)
            for sign, flexibility in zip(signs, flexibilities, strict=True):
                load = along[0].T @ (along[1] * (sign * force)[:, None])
                moved = (flexibility @ load.ravel()).reshape(load.shape)
                out += sign * ((along[0] @ moved) * along[1]).sum(axis=1)
            return out / (4 * unit)

        return displace

    def clip_to_cover(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Move points of the indenter's frame that lie beyond the side edges onto the edges [m]."""
        u, v = self.pose.to_array(x, y)
        return self.pose.to_indenter(*(np.clip(c, -side, side) for c, side in zip((u, v), self._side, strict=True)))

    @cached_property
    def _side(self) -> FloatArray:
        """Half edges of the cover [m]."""
        return np.array(self.cover.size) / 2

    @cached_property
    def _box(self) -> tuple[FloatArray, FloatArray]:
        """Low and high ends along x and along y, in the array's frame, of the rectangle's part on the cover [m]."""
        signs = np.array([[1, 1, -1, -1], [1, -1, 1, -1]])
        corners = np.stack(self.pose.to_array(*(signs * self.half[:, None])))
        low, high = np.maximum(corners.min(axis=1), -self._side), np.minimum(corners.max(axis=1), self._side)
        return np.array([low[0], high[0]]), np.array([low[1], high[1]])

    @property
    def _distance(self) -> float:
        """Distance from the rectangle to the nearest side [m]."""
        return min(float(side - np.abs(ends).max()) for side, ends in zip(self._side, self._box, strict=True))

    @cached_property
    def _parities(self) -> tuple[tuple[int, int], ...]:
        """Parities that the contact forces can have: none is odd in an axis along which the contact is symmetric."""
        symmetric = find_mirror_planes(self.indenter, self.pose)
        return tuple(
            parity for parity in PARITIES if not any(p and even for p, even in zip(parity, symmetric, strict=True))
        )

    @cached_property
    def _difference(self) -> tuple[list[Line], list[IntArray], list[FloatArray]]:
        """Flexibility that the sides add around the contact.

        Returns:
            Lines of the mesh along x and y, their nodes around the contact, and for each parity the flexibility between
            these nodes, shape (k, k) [-].
        """
        unit = self.cover.thickness
        spans = [_mirror_span(ends / unit) for ends in self._box]
        clearance = max(self._distance / unit, _CLEARANCE * min(high - low for low, high in spans))
        size = float(np.clip(_FINE * clearance, _SMALLEST, _LARGEST)) * COARSENING[self.grid]
        thicknesses = [layer.thickness for layer in self.cover.layers]
        counts = [max(1, round(THROUGH[self.grid] * each / unit)) for each in thicknesses]
        heights, layer = layer_heights(thicknesses, counts, crowd_surface=_CROWDING)
        inner = [_grade_cover(*span, side / unit, size) for span, side in zip(spans, self._side, strict=True)]
        far = _FAR * decay_length(self.cover) / unit
        outer = [np.concatenate([edges, _grade_surroundings(edges, far)]) for edges in inner]
        lines = [Line(edges=edges, order=2) for edges in inner]
        chosen = [
            np.unique(line.index[(line.edges[:-1] <= high) & (line.edges[1:] >= low)])
            for line, (low, high) in zip(lines, spans, strict=True)
        ]
        # The pressure may jump at the sides: then the energies of the two meshes differ by that of the surroundings.
        ends = (len(inner[0]) - 1,), (len(inner[1]) - 1,)
        alone, surrounded = (
            _solve_flexibility(
                build_solid(self.cover, (x, y, heights / unit), layer, breaks=breaks),
                chosen,
                self._parities,
                sliding=self.cover.base == "sliding",
            )
            for (x, y), breaks in ((inner, ((), ())), (outer, ends))
        )
        return lines, chosen, [(a + a.T - b - b.T) / 2 for a, b in zip(alone, surrounded, strict=True)]


def find_mirror_planes(indenter: Indenter, pose: PlanarPose) -> tuple[bool, bool]:
    """Whether shape and pose are symmetric about the cover's planes x = 0 and y = 0."""
    if not pose.is_aligned:
        return False, False
    shape = indenter.mirror_symmetry
    if round(2 * pose.yaw / np.pi) % 2:
        shape = shape[::-1]
    return shape[0] and pose.at[0] == 0, shape[1] and pose.at[1] == 0


def _mirror_span(ends: FloatArray) -> tuple[float, float]:
    """Smallest and largest distance from the middle of the points of a span with the given ends."""
    low, high = ends
    return (0.0 if low <= 0 <= high else float(np.abs(ends).min())), float(np.abs(ends).max())


def _grade_cover(low: float, high: float, end: float, size: float) -> FloatArray:
    """Element edges from 0 to `end`: `size` apart at the end, growing inwards and away from `low` to `high`."""
    x = np.linspace(0, end, _SAMPLES)
    distance = np.maximum(np.maximum(low - x, x - high), 0)
    largest = max((high - low) / _LEAST, size) + _GROWTH * distance
    return fill_by_spacing(x, np.minimum(size + _GROWTH * (end - x), largest), least=2, round_up=True)


def _grade_surroundings(edges: FloatArray, length: float) -> FloatArray:
    """Element edges beyond the side, at least up to `length` from it."""
    first = (1 + _OUTWARD) * (edges[-1] - edges[-2])
    return np.asarray(edges[-1] + np.cumsum(growing_steps(first, length, lambda step: (1 + _OUTWARD) * step)))


def _solve_flexibility(
    solid: TensorSolid, chosen: list[IntArray], parities: tuple[tuple[int, int], ...], *, sliding: bool
) -> list[FloatArray]:
    """Downward displacements of chosen top nodes under unit forces on them, for each parity, shape (k, k) each."""
    upper = solid.assemble_upper()
    _, rows, last = solid.field_shape(2)
    node = chosen[0][:, None] * rows + chosen[1]
    unknown = (solid.offsets[2] + (node + 1) * last - 1).ravel()
    factors = SymmetricFactors()
    out = []
    for parity in parities:
        matrix, constrained = constrain_parity(solid, upper, parity, sliding=sliding)
        factors.factorise(matrix)
        parts = []
        for block in np.array_split(unknown, max(1, len(unknown) // _BLOCK)):
            load = np.zeros((upper.shape[0], len(block)))
            load[block, np.arange(len(block))] = ~constrained[block]
            parts.append(factors.solve(load)[unknown])
        out.append(np.hstack(parts))
    return out
