"""A quarter of a rectangular cover as a tensor mesh, and texels by what their mirror images share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference.elements.grading import fill_by_spacing, layer_heights
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.linear_response.point_spread import decay_length
from meshes import Cover, TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Even and odd functions of x and y.
PARITIES = ((0, 0), (0, 1), (1, 0), (1, 1))
#: A cover without a size ends this many decay lengths beyond the array.
_MARGIN = 12.0
#: Distance from texel and side edges, in thicknesses, over which elements stay small, and their growth beyond.
_NEAR, _GROWTH = 2.0, 0.35
#: Edges closer than this part of an element are one [-].
_SLIVER = 0.05
#: Elements along z crowd towards the base, where texel edges are sharp: height ~ (i / n) to this power.
_CROWDING = 1.5


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """How fine a grid is.

    Attributes:
        across: Elements per thickness along x and y, near texel and side edges [-].
        through: Elements through the cover; every layer gets at least one [-].
        order: Polynomial order of the displacement [-].
    """

    across: float
    through: int
    order: int = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class MirroredTexels:
    """Texels by what their mirror images share, lengths in thicknesses.

    Attributes:
        spans: Low and high ends along x and along y of the distinct texels, shape (m, 2) each.
        pairs: Distinct pairs of an x span and a y span, shape (k, 2).
        pair: Which pair each texel is, shape (n,).
        side: Sign of each texel's centre along x and y, 1 in the middle, shape (n, 2).
    """

    spans: tuple[FloatArray, FloatArray]
    pairs: IntArray
    pair: IntArray
    side: FloatArray

    @classmethod
    def of(cls, array: TexelArray, unit: float) -> MirroredTexels:
        """Sort the texels of a planar array, whose thickness of cover is `unit` [m]."""
        centres = np.round(array.centres[:, :2] / unit, 9)
        spans, numbers = [], []
        for axis in (0, 1):
            distinct, number = np.unique(np.abs(centres[:, axis]), return_inverse=True)
            half = array.texel_size[axis] / unit / 2
            spans.append(np.column_stack([distinct - half, distinct + half]))
            numbers.append(number)
        pairs, pair = np.unique(np.column_stack(numbers), axis=0, return_inverse=True)
        side = np.where(centres < 0, -1.0, 1.0)
        return cls(spans=(spans[0], spans[1]), pairs=pairs, pair=pair, side=side)

    @property
    def swapped(self) -> IntArray | None:
        """The pair with x and y exchanged, for each pair; None where there is none."""
        if self.spans[0].shape != self.spans[1].shape or not np.allclose(*self.spans, atol=1e-9):
            return None
        known = {tuple(pair): number for number, pair in enumerate(self.pairs.tolist())}
        found = [known.get((pair[1], pair[0]), -1) for pair in self.pairs.tolist()]
        return None if -1 in found else np.array(found)


def quarter_solid(cover: Cover, array: TexelArray, resolution: Resolution) -> TensorSolid:
    """The quarter of a cover with x, y >= 0, lengths in thicknesses and moduli in those of the top layer.

    Args:
        cover: Layers, with free side edges at `size` or cut far beyond the array.
        array: A planar array; element edges lie on texel edges.
        resolution: How fine the grid is.
    """
    edges = tuple(_edges(cover, array, axis, resolution.across) for axis in (0, 1))
    heights, layer = _heights(cover, resolution.through)
    return solid_of(cover, (edges[0], edges[1], heights / cover.thickness), layer, resolution.order)


def solid_of(
    cover: Cover,
    edges: tuple[FloatArray, FloatArray, FloatArray],
    layer: IntArray,
    order: int = 2,
    breaks: tuple[tuple[int, ...], tuple[int, ...]] = ((), ()),
) -> TensorSolid:
    """A tensor mesh of a cover's materials, lengths in thicknesses and moduli in those of the top layer.

    Args:
        cover: Layers, bonded or sliding.
        edges: Element edges along x, y and z [thicknesses].
        layer: Which layer each element along z belongs to, shape (e,).
        order: Polynomial order of the displacement [-].
        breaks: Elements along x and along y before which the pressure may jump.
    """
    stiff = cover.layers[-1].material.shear_modulus
    sideways = 1 if cover.base == "bonded" else 0
    return TensorSolid(
        edges=edges,
        layer=layer,
        shear_modulus=np.array([each.material.shear_modulus for each in cover.layers]) / stiff,
        bulk_compliance=np.array([stiff / each.material.bulk_modulus for each in cover.layers]),
        order=order,
        first=(sideways, sideways, 1),
        breaks=breaks,
    )


def mirror_held(
    solid: TensorSolid, upper: sp.csr_matrix, parity: tuple[int, int], *, sliding: bool
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Entries with unit rows for the unknowns that vanish by symmetry, and which those are, on the same pattern.

    For a load even in x, displacement along x is odd in x and vanishes at x = 0; for an odd one the other components
    and the pressure do.  A block that slides may also drift or turn at no cost; one unknown is held against that.

    Args:
        solid: The quarter x, y >= 0 of a block.
        upper: Upper triangle of its stiffness, shape (n, n).
        parity: 0 where the load is even, 1 where it is odd, in x and in y.
        sliding: Whether the base slides.

    Returns:
        Entries in the order of the upper triangle, and the held unknowns, shape (n,).
    """
    held = np.zeros(upper.shape[0], dtype=bool)
    for field in range(4):
        here = held[solid.offsets[field] : solid.offsets[field + 1]].reshape(solid.field_shape(field))
        here[0] |= (field == 0) != bool(parity[0])
        here[:, 0] |= (field == 1) != bool(parity[1])
        if sliding and ((field == 0 and parity[0] == 1) or (field == 1 and parity == (0, 1))):
            here[0, -1 if parity == (1, 1) else 0, 0] = True
    row = np.repeat(np.arange(len(held)), np.diff(upper.indptr))
    values = np.where(held[row] | held[upper.indices], 0.0, upper.data)
    values[upper.indptr[:-1][held]] = 1.0  # the diagonal comes first in each row of an upper triangle
    return values, held


def _heights(cover: Cover, through: int) -> tuple[FloatArray, IntArray]:
    """Element edges along z [m] and the layer of each element."""
    thicknesses = [layer.thickness for layer in cover.layers]
    counts = [max(1, round(through * each / cover.thickness)) for each in thicknesses]
    return layer_heights(thicknesses, counts, crowd_base=_CROWDING)


def _edges(cover: Cover, array: TexelArray, axis: int, across: float) -> FloatArray:
    """Element edges from the middle of the cover to its side: on texel edges, small near them [thicknesses]."""
    unit = cover.thickness
    centres, half = array.centres[:, axis], array.texel_size[axis] / 2
    texel_edges = np.unique(np.round(np.abs(np.concatenate([centres - half, centres + half])) / unit, 9))
    if cover.size is None:
        end = float(texel_edges[-1]) + _MARGIN * decay_length(cover) / unit
    else:
        end = cover.size[axis] / 2 / unit
    marks = [0.0]
    for mark in texel_edges:
        if mark - marks[-1] > _SLIVER / across and end - mark > _SLIVER / across:
            marks.append(float(mark))
    sharp = [texel_edges[0] == 0.0, *[True] * (len(marks) - 1), True]
    marks.append(end)
    parts = [_between(marks[i], marks[i + 1], across, (sharp[i], sharp[i + 1])) for i in range(len(marks) - 1)]
    return np.concatenate([[0.0], *parts])


def _between(low: float, high: float, across: float, sharp: tuple[bool, bool]) -> FloatArray:
    """Element edges in (low, high], 1 / across long near sharp ends and growing away from them."""
    x = np.linspace(low, high, 401)
    away = np.minimum(x - low if sharp[0] else np.inf, high - x if sharp[1] else np.inf)
    return fill_by_spacing(x, (1 + _GROWTH * np.maximum(away - _NEAR, 0)) / across)[1:]
