"""Texels must not lie on top of one another: what presses there would be felt twice."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fastmodel.errors import OverlapError
from fastmodel.signal.point_spread import tangent_axes
from meshes import TexelArray

#: Share of a texel's edge by which neighbours may overlap: rounding, and the corners of a curved layout [-].
_ALLOWED = 0.02


def refuse_overlaps(array: TexelArray) -> None:
    """Check that no two texels overlap.

    Neighbours that look the same way and lie in one another's plane are compared as rectangles.

    Args:
        array: The texels.

    Raises:
        OverlapError: If two overlap; it names the first pair.
    """
    size = np.array(array.texel_size)
    pairs = cKDTree(array.centres).query_pairs(float(np.hypot(*size)), output_type="ndarray")
    if not len(pairs):
        return
    first, second = pairs.T
    axis_x, axis_y = tangent_axes(array)
    apart = array.centres[second] - array.centres[first]
    along = np.abs([np.einsum("ij,ij->i", apart, axis[first]) for axis in (axis_x, axis_y, array.normals)])
    alike = np.einsum("ij,ij->i", array.normals[first], array.normals[second]) > 0
    inside = (along[:2] < (1 - _ALLOWED) * size[:, None]).all(axis=0)
    on_top = (inside & alike & (along[2] < size.min() / 2)).nonzero()[0]
    if len(on_top):
        a, b = first[on_top[0]], second[on_top[0]]
        raise OverlapError(
            f"array {array.name!r}: texels {a} and {b} overlap ({len(on_top)} pairs in all); centres must lie at least "
            f"a texel's size of {tuple(size.tolist())} m apart along x or y"
        )
