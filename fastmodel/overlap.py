"""Check that texels do not overlap, because a force on two overlapping texels would be measured twice."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fastmodel.errors import FastModelError
from fastmodel.signal.point_spread import find_tangents
from meshes import TexelArray

#: Share of a texel's edge length by which neighbouring texels may overlap [-].  It allows for rounding and for curved
#: layouts, in which the rectangles of neighbouring texels overlap at their corners.
_ALLOWED = 0.02


def refuse_overlaps(array: TexelArray) -> None:
    """Check that no two texels overlap.

    Two texels overlap if their normals are less than 90 degrees apart, their planes are less than half a texel apart,
    and their rectangles overlap in the plane of the first texel.

    Args:
        array: The texels.

    Raises:
        FastModelError: If texels overlap; the message names the first pair.
    """
    size = np.array(array.texel_size)
    pairs = cKDTree(array.centres).query_pairs(float(np.hypot(*size)), output_type="ndarray")
    if not len(pairs):
        return
    first, second = pairs.T
    axis_x, axis_y = find_tangents(array)
    apart = array.centres[second] - array.centres[first]
    along = np.abs([np.einsum("ij,ij->i", apart, axis[first]) for axis in (axis_x, axis_y, array.normals)])
    alike = np.einsum("ij,ij->i", array.normals[first], array.normals[second]) > 0
    inside = (along[:2] < (1 - _ALLOWED) * size[:, None]).all(axis=0)
    on_top = (inside & alike & (along[2] < size.min() / 2)).nonzero()[0]
    if len(on_top):
        a, b = first[on_top[0]], second[on_top[0]]
        raise FastModelError(
            f"array {array.name!r}: texels {a} and {b} overlap ({len(on_top)} pairs in all); centres must lie at least "
            f"a texel's size of {tuple(size.tolist())} m apart along x or y"
        )
