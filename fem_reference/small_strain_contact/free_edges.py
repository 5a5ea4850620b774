"""What free side edges add to the way the top of a cover yields.

A cover of limited size is a wide one with its surroundings cut away, which only makes it softer.  What the cut adds to
the displacement of the top is smooth away from the sides, while the wide cover's own answer is singular under a load.
So the two are kept apart: the wide cover's compliance stays the fine one of `slab`, and the difference between the
cover and the same cover with its surroundings left on comes from three-dimensional elements on two meshes that agree
under the cover, where the load's singularity and most of the mesh's error cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference.elements.grading import fill_by_spacing, growing_steps, layer_heights
from fem_reference.elements.line import Line
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.linear_response.mirror_symmetry import PARITIES, mirror_held, solid_of
from fem_reference.linear_response.point_spread import decay_length
from fem_reference.small_strain_contact.frictionless import ContactPatch
from fem_reference.sparse_solver import SymmetricFactors
from meshes import Cover, Indenter
from meshes.pose import PlanarPose

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

#: Elements through the cover on the three grids, and their size over that of the finest.
THROUGH, COARSENING = (2, 3, 4), (2.25, 1.5, 1.0)
#: Sides this many decay lengths away add nothing (their effect travels there and back); the surroundings end here.
_NEAR, _FAR = 6.0, 8.0
#: Size of the elements at the sides over their distance, its bounds in thicknesses, and least of them across a contact.
_FINE, _SMALLEST, _LARGEST, _LEAST = 1 / 3, 1 / 8, 1 / 2, 6
#: Growth of elements away from contact and sides, and in the surroundings.
_GROWTH, _OUTWARD = 0.3, 0.6
#: Elements of the top layer crowd towards the top: depth ~ (i / n) to this power.
_CROWDING = 1.5
#: Right-hand sides solved at once.
_BLOCK = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class SideEdges:
    """The free side edges of a cover, seen from one indenter.

    Attributes:
        cover: A cover with a size.
        indenter: The shape.
        pose: Where it stands.
        half: Half widths of a rectangle around the axis that holds the contact, in the indenter's frame [m].
        grid: Which of the three grids.
    """

    cover: Cover
    indenter: Indenter
    pose: PlanarPose
    half: FloatArray
    grid: int

    @cached_property
    def window(self) -> tuple[FloatArray, FloatArray]:
        """Centre and half widths of the cells' rectangle: of a flat face that stands square, its part on the cover."""
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
        """Which points of the indenter's frame lie on the cover."""
        u, v = self.pose.to_array(x, y)
        return np.asarray((np.abs(u) <= self._side[0]) & (np.abs(v) <= self._side[1]))

    def add_compliance(self, x: FloatArray, y: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Forces at points of the indenter's frame [N] to what the sides add to the displacement there [m]."""
        if not self.near:
            return np.zeros_like
        places = np.stack(self.pose.to_array(x, y), axis=-1)
        lines, chosen, table = self._difference
        along = [line.at(np.abs(places[:, i]) / self.cover.thickness)[:, chosen[i]] for i, line in enumerate(lines)]
        side = np.where(places < 0, -1.0, 1.0)
        signs = [(side**parity).prod(axis=1) for parity in self._parities]
        unit = self.cover.thickness * self.cover.layers[-1].material.shear_modulus

        def apply(force: FloatArray) -> FloatArray:
            out = np.zeros_like(force)
            for sign, each in zip(signs, table, strict=True):
                load = along[0].T @ (along[1] * (sign * force)[:, None])
                lift = (each @ load.ravel()).reshape(load.shape)
                out += sign * ((along[0] @ lift) * along[1]).sum(axis=1)
            return out / (4 * unit)

        return apply

    def kept(self, patch: ContactPatch) -> ContactPatch:
        """A contact whose outermost cells have their centres on the cover, which scaled cells may miss by a hair."""
        u, v = self.pose.to_array(patch.x, patch.y)
        x, y = self.pose.to_indenter(*(np.clip(c, -side, side) for c, side in zip((u, v), self._side, strict=True)))
        return replace(patch, x=x, y=y)

    @cached_property
    def _side(self) -> FloatArray:
        """Half edges of the cover [m]."""
        return np.array(self.cover.size) / 2

    @cached_property
    def _box(self) -> tuple[FloatArray, FloatArray]:
        """Low and high ends along x and along y, in the array's frame, of the part of the rectangle on the cover."""
        signs = np.array([[1, 1, -1, -1], [1, -1, 1, -1]])
        corners = np.stack(self.pose.to_array(*(signs * self.half[:, None])))
        low, high = np.maximum(corners.min(axis=1), -self._side), np.minimum(corners.max(axis=1), self._side)
        return np.array([low[0], high[0]]), np.array([low[1], high[1]])

    @property
    def _distance(self) -> float:
        """From the rectangle to the nearest side [m]."""
        return min(float(side - np.abs(ends).max()) for side, ends in zip(self._side, self._box, strict=True))

    @cached_property
    def _parities(self) -> tuple[tuple[int, int], ...]:
        """The parities that the contact's forces can have."""
        even = mirrored(self.indenter, self.pose)
        return tuple(parity for parity in PARITIES if not any(p and e for p, e in zip(parity, even, strict=True)))

    @cached_property
    def _difference(self) -> tuple[list[Line], list[IntArray], list[FloatArray]]:
        """Lines of the mesh, their nodes around the contact, and between these what the sides add, by parity [-]."""
        unit = self.cover.thickness
        spans = [_quarter(ends / unit) for ends in self._box]
        widths = [high - low for low, high in spans]
        clear = max(self._distance / unit, 0.15 * min(widths))
        size = float(np.clip(_FINE * clear, _SMALLEST, _LARGEST)) * COARSENING[self.grid]
        heights, layer = _heights(self.cover, THROUGH[self.grid])
        inner = [_graded(*span, side / unit, size) for span, side in zip(spans, self._side, strict=True)]
        outer = [np.concatenate([edges, _outward(edges, _FAR * decay_length(self.cover) / unit)]) for edges in inner]
        lines = [Line(edges=edges, order=2) for edges in inner]
        chosen = [
            np.unique(line.index[(line.edges[:-1] <= high) & (line.edges[1:] >= low)])
            for line, (low, high) in zip(lines, spans, strict=True)
        ]
        # the pressure may jump at the sides, so that the meshes' energies differ by that of the surroundings alone
        ends = (len(inner[0]) - 1,), (len(inner[1]) - 1,)
        cut, whole = (
            _flexibility(
                solid_of(self.cover, (x, y, heights / unit), layer, breaks=breaks),
                chosen,
                self._parities,
                self.cover.base,
            )
            for (x, y), breaks in ((inner, ((), ())), (outer, ends))
        )
        return lines, chosen, [(a + a.T - b - b.T) / 2 for a, b in zip(cut, whole, strict=True)]


def mirrored(indenter: Indenter, pose: PlanarPose) -> tuple[bool, bool]:
    """Whether shape and pose are their own mirror image in the cover's planes x = 0 and y = 0."""
    if not pose.is_aligned:
        return False, False
    shape = indenter.mirror_symmetry
    if round(2 * pose.yaw / np.pi) % 2:
        shape = shape[::-1]
    return shape[0] and pose.at[0] == 0, shape[1] and pose.at[1] == 0


def _quarter(ends: FloatArray) -> tuple[float, float]:
    """A span by its distances from the middle."""
    low, high = ends
    return (0.0 if low <= 0 <= high else float(np.abs(ends).min())), float(np.abs(ends).max())


def _graded(low: float, high: float, end: float, size: float) -> FloatArray:
    """Element edges from 0 to `end`: `size` long at the end, growing inwards and away from `low` to `high`."""
    x = np.linspace(0, end, 2001)
    away = np.maximum(np.maximum(low - x, x - high), 0)
    most = max((high - low) / _LEAST, size) + _GROWTH * away
    return fill_by_spacing(x, np.minimum(size + _GROWTH * (end - x), most), least=2, round_up=True)


def _outward(edges: FloatArray, length: float) -> FloatArray:
    """Element edges of the surroundings, growing from the side on."""
    first = (1 + _OUTWARD) * (edges[-1] - edges[-2])
    return np.asarray(edges[-1] + np.cumsum(growing_steps(first, length, lambda step: (1 + _OUTWARD) * step)))


def _heights(cover: Cover, through: int) -> tuple[FloatArray, IntArray]:
    """Element edges along z [m] and the layer of each element."""
    thicknesses = [layer.thickness for layer in cover.layers]
    counts = [max(1, round(through * each / cover.thickness)) for each in thicknesses]
    return layer_heights(thicknesses, counts, crowd_surface=_CROWDING)


def _flexibility(
    solid: TensorSolid, chosen: list[IntArray], parities: tuple[tuple[int, int], ...], base: str
) -> list[FloatArray]:
    """Downward displacements of chosen top nodes under unit forces on them, for each parity, shape (k, k) each."""
    upper = solid.upper()
    _, rows, last = solid.field_shape(2)
    node = chosen[0][:, None] * rows + chosen[1]
    unknown = (solid.offsets[2] + (node + 1) * last - 1).ravel()
    factors: SymmetricFactors | None = None
    out = []
    for parity in parities:
        values, held = mirror_held(solid, upper, parity, sliding=base == "sliding")
        if factors is None:
            factors = SymmetricFactors(sp.csr_matrix((values, upper.indices, upper.indptr), shape=upper.shape))
        else:
            factors.refactor(values)
        parts = []
        for block in np.array_split(unknown, max(1, len(unknown) // _BLOCK)):
            load = np.zeros((upper.shape[0], len(block)))
            load[block, np.arange(len(block))] = ~held[block]
            parts.append(factors.solve(load)[unknown])
        out.append(np.hstack(parts))
    return out
