"""Mirror symmetry of rectangular covers: the mesh of a quarter, its constraints, and the texels that it serves.

A rectangular cover is its own mirror image in the planes x = 0 and y = 0.  A load splits into four parts that are even
or odd in x and in y; each part needs only the quarter x, y >= 0, with constraints on the planes that depend on its
parity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fem_reference.elements.grading import fill_by_spacing, layer_heights
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Cover, TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Parities in x and y of the four parts of a load: 0 even, 1 odd.
PARITIES = ((0, 0), (0, 1), (1, 0), (1, 1))
#: Distance from the array at which a cover without a size is cut, in decay lengths [-].
_MARGIN = 12.0
#: Distance from texel and side edges over which elements stay small, in thicknesses, and their growth beyond [-].
_NEAR, _GROWTH = 2.0, 0.35
#: Texel edges closer to one another than this part of an element share one element edge [-].
_SLIVER = 0.05
#: Samples between two texel edges from which element edges are computed.
_SAMPLES = 401
#: Power of the heights of the elements in the lowest layer: above 1, they are small at the base, where texels end [-].
_CROWDING = 1.5


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """Element sizes of a grid.

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
    """Texels grouped by their mirror images, lengths in thicknesses.

    A texel's span along x is the interval between its edges after its centre is mirrored to x >= 0.  Texels with equal
    spans along x and along y are mirror images of one another and share one solution.

    Attributes:
        spans: Distinct spans along x and along y, shape (m, 2) each.
        pairs: Distinct pairs of the number of an x span and of a y span, shape (k, 2).
        pair: Number of each texel's pair, shape (n,).
        side: Sign of each texel's centre along x and y, 1 in the middle, shape (n, 2).
    """

    spans: tuple[FloatArray, FloatArray]
    pairs: IntArray
    pair: IntArray
    side: FloatArray

    @classmethod
    def group(cls, array: TexelArray, thickness: float) -> MirroredTexels:
        """Group the texels of a planar array under a cover of the given thickness [m]."""
        centres = np.round(array.centres[:, :2] / thickness, 9)
        spans, numbers = [], []
        for axis in (0, 1):
            distinct, number = np.unique(np.abs(centres[:, axis]), return_inverse=True)
            half = array.texel_size[axis] / thickness / 2
            spans.append(np.column_stack([distinct - half, distinct + half]))
            numbers.append(number)
        pairs, pair = np.unique(np.column_stack(numbers), axis=0, return_inverse=True)
        side = np.where(centres < 0, -1.0, 1.0)
        return cls(spans=(spans[0], spans[1]), pairs=pairs, pair=pair, side=side)

    @property
    def swapped(self) -> IntArray | None:
        """Number of the pair with x and y exchanged, for each pair; None if the array is no square grid."""
        if self.spans[0].shape != self.spans[1].shape or not np.allclose(*self.spans, atol=1e-9):
            return None
        numbers = {tuple(pair): number for number, pair in enumerate(self.pairs.tolist())}
        found = [numbers.get((pair[1], pair[0]), -1) for pair in self.pairs.tolist()]
        return None if -1 in found else np.array(found)


def mesh_quarter(cover: Cover, array: TexelArray, resolution: Resolution) -> TensorSolid:
    """Mesh the quarter x, y >= 0 of a cover, lengths in thicknesses and moduli in that of the top layer.

    Args:
        cover: Layers, with free side edges at `size` or cut far beyond the array.
        array: A planar array; element edges lie on texel edges.
        resolution: Element sizes.
    """
    x, y = (_grade_side(cover, array, axis, resolution.across) for axis in (0, 1))
    thicknesses = [layer.thickness for layer in cover.layers]
    counts = [max(1, round(resolution.through * each / cover.thickness)) for each in thicknesses]
    heights, layer = layer_heights(thicknesses, counts, crowd_base=_CROWDING)
    return build_solid(cover, (x, y, heights / cover.thickness), layer, resolution.order)


def build_solid(
    cover: Cover,
    edges: tuple[FloatArray, FloatArray, FloatArray],
    layer: IntArray,
    order: int = 2,
    breaks: tuple[tuple[int, ...], tuple[int, ...]] = ((), ()),
) -> TensorSolid:
    """Put a cover's materials on a tensor mesh, lengths in thicknesses and moduli in that of the top layer.

    Args:
        cover: Layers, bonded or sliding.
        edges: Element edges along x, y and z [thicknesses].
        layer: Layer of each element along z, shape (e,).
        order: Polynomial order of the displacement [-].
        breaks: Elements along x and along y before which the pressure may jump.
    """
    modulus = cover.layers[-1].material.shear_modulus
    sideways = 1 if cover.base == "bonded" else 0
    return TensorSolid(
        edges=edges,
        layer=layer,
        shear_modulus=np.array([each.material.shear_modulus for each in cover.layers]) / modulus,
        bulk_compliance=np.array([modulus / each.material.bulk_modulus for each in cover.layers]),
        order=order,
        first=(sideways, sideways, 1),
        breaks=breaks,
    )


def constrain_parity(
    solid: TensorSolid, upper: sp.csr_matrix, parity: tuple[int, int], *, sliding: bool
) -> tuple[sp.csr_matrix, BoolArray]:
    """Constrain the unknowns that vanish on the planes of symmetry, without a change of the matrix's pattern.

    For a load even in x, the displacement along x is odd in x and vanishes at x = 0; for a load odd in x, the other
    components and the pressure vanish there.  A block on a sliding base may also move or turn as a rigid body without
    force; one more unknown is constrained against that.

    Args:
        solid: The quarter x, y >= 0 of a block.
        upper: Upper triangle of its stiffness, shape (n, n).
        parity: 0 where the load is even, 1 where it is odd, in x and in y.
        sliding: Whether the base slides.

    Returns:
        The upper triangle with unit rows and columns for the constrained unknowns, and which unknowns these are, shape
        (n,).
    """
    constrained = np.zeros(upper.shape[0], dtype=bool)
    for field in range(4):
        view = constrained[solid.offsets[field] : solid.offsets[field + 1]].reshape(solid.field_shape(field))
        view[0] |= (field == 0) != bool(parity[0])
        view[:, 0] |= (field == 1) != bool(parity[1])
        if sliding and ((field == 0 and parity[0] == 1) or (field == 1 and parity == (0, 1))):
            view[0, -1 if parity == (1, 1) else 0, 0] = True
    row = np.repeat(np.arange(len(constrained)), np.diff(upper.indptr))
    values = np.where(constrained[row] | constrained[upper.indices], 0.0, upper.data)
    values[upper.indptr[:-1][constrained]] = 1.0  # the diagonal is the first entry of each row of an upper triangle
    return sp.csr_matrix((values, upper.indices, upper.indptr), shape=upper.shape), constrained


def _grade_side(cover: Cover, array: TexelArray, axis: int, across: float) -> FloatArray:
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
    parts = [_grade_between(marks[i], marks[i + 1], across, (sharp[i], sharp[i + 1])) for i in range(len(marks) - 1)]
    return np.concatenate([[0.0], *parts])


def _grade_between(low: float, high: float, across: float, sharp: tuple[bool, bool]) -> FloatArray:
    """Element edges in (low, high], 1 / across apart near sharp ends and growing away from them [thicknesses]."""
    x = np.linspace(low, high, _SAMPLES)
    distance = np.minimum(x - low if sharp[0] else np.inf, high - x if sharp[1] else np.inf)
    return fill_by_spacing(x, (1 + _GROWTH * np.maximum(distance - _NEAR, 0)) / across)[1:]
