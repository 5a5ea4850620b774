"""Use the mirror symmetry of rectangular covers: mesh and constraints of a quarter, and groups of mirrored texels.

A rectangular cover is symmetric about the planes x = 0 and y = 0.  A load is the sum of four parts that are even or odd
in x and in y (parities).  For each part only the quarter x, y >= 0 is solved, with constraints on the planes of
symmetry that depend on the parity.
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

#: Parities in x and y of the four parts of a load: 0 for even, 1 for odd.
PARITIES = ((0, 0), (0, 1), (1, 0), (1, 1))
#: Distance of the boundary of a wide cover from the array, over the decay length of the cover's response [-].
_MARGIN = 12.0
#: Distance from texel edges and side edges, over the cover thickness, within which elements have the smallest size, and
#: increase of the element size per distance farther away [-].
_NEAR, _GROWTH = 2.0, 0.35
#: Distance between two texel edges, over the element size, below which both share one element edge [-].
_SLIVER = 0.05
#: Number of samples of the element size between two texel edges [-].
_SAMPLES = 401
#: Exponent of the heights of the element edges in the bottom layer; values above 1 give small elements at the base,
#: where the texel edges are [-].
_CROWDING = 1.5


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """Element sizes of a three-dimensional grid.

    Attributes:
        across: Number of elements per cover thickness along x and y, near texel edges and side edges [-].
        through: Number of elements through the cover; every layer gets at least one [-].
        order: Polynomial order of the displacement [-].
    """

    across: float
    through: int
    order: int = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class MirroredTexels:
    """Groups of texels that are mirror images of one another, with lengths in units of the cover thickness.

    The span of a texel along x is the interval between its edges after its centre is mirrored to x >= 0.  Texels with
    equal spans along x and along y are mirror images of one another and share one solution.

    Attributes:
        spans: Lower and upper ends of the m distinct spans along x, and of those along y, shape (m, 2) each.
        pairs: Index of the x span and of the y span of each of the k groups of texels, shape (k, 2).
        pair: Index of the group of each of n texels, shape (n,).
        side: Signs of x and y of the centre of each texel, 1 in the middle, shape (n, 2).
    """

    spans: tuple[FloatArray, FloatArray]
    pairs: IntArray
    pair: IntArray
    side: FloatArray

    @classmethod
    def group(cls, array: TexelArray, thickness: float) -> MirroredTexels:
        """Group the texels of a planar array into mirror images; `thickness` is that of the cover [m]."""
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
        """Index of the group of texels with x and y exchanged, for each group; None if the array is not square."""
        if self.spans[0].shape != self.spans[1].shape or not np.allclose(*self.spans, atol=1e-9):
            return None
        numbers = {tuple(pair): number for number, pair in enumerate(self.pairs.tolist())}
        found = [numbers.get((pair[1], pair[0]), -1) for pair in self.pairs.tolist()]
        return None if -1 in found else np.array(found)


def mesh_quarter(cover: Cover, array: TexelArray, resolution: Resolution) -> TensorSolid:
    """Mesh the quarter x, y >= 0 of a cover, in units of the cover thickness and of the top layer's shear modulus.

    Args:
        cover: Cover with free side edges at `size`; a wide cover gets a boundary far outside the array.
        array: Planar array; texel edges are also element edges.
        resolution: Element sizes of the grid.
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
    """Build a block with the materials of a cover, in units of cover thickness and of the top layer's shear modulus.

    Args:
        cover: Cover, bonded or sliding.
        edges: Element edges along x, y and z [thicknesses].
        layer: Index of the layer of each of the e elements along z, shape (e,).
        order: Polynomial order of the displacement [-].
        breaks: Indices of elements along x and along y at whose lower edge the pressure may jump.
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
    """Constrain the unknowns that vanish on the planes of symmetry, without a change of the sparsity pattern.

    For a load even in x, the displacement along x is odd in x and vanishes at x = 0; for a load odd in x, the other
    displacement components and the pressure vanish at x = 0.  A block on a sliding base may also move or rotate as a
    rigid body without force; one more constrained unknown prevents this motion.

    Args:
        solid: Quarter x, y >= 0 of a block, with n unknowns.
        upper: Upper triangle of the stiffness matrix of the quarter, shape (n, n).
        parity: Parity of the load in x and in y: 0 for even, 1 for odd.
        sliding: Whether the base slides.

    Returns:
        The upper triangle with unit rows and columns for the constrained unknowns, and whether each unknown is
        constrained, shape (n,).
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
    """Place element edges from the middle of the cover to its side; elements are small near texel edges [thicknesses].

    Texel edges are also element edges.
    """
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
    """Place element edges in (low, high], with size 1 / across near ends marked `sharp` and growing away from these."""
    x = np.linspace(low, high, _SAMPLES)
    distance = np.minimum(x - low if sharp[0] else np.inf, high - x if sharp[1] else np.inf)
    return fill_by_spacing(x, (1 + _GROWTH * np.maximum(distance - _NEAR, 0)) / across)[1:]
