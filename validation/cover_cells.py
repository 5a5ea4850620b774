"""The cover between sub-texel cells, as the fast model's contact method `cover` takes it.

A laterally wide cover answers everywhere alike: one kernel says how the top yields around a loaded cell, another what
of a loaded cell's force arrives on a texel.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel.cover_cells import CoverCells
from meshes import Cover, TexelArray

if TYPE_CHECKING:
    from fem_reference.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]

#: Length of a cell over the thickness that is aimed at, and cells along a pitch at least and at most.
_CELL = 0.45
_PER_TEXEL = (4, 8)
#: Distance over the decay length beyond which the cover's answer is left out.
_REACH = 8.0


def cover_cells(cover: Cover, array: TexelArray, spread: PointSpread, *, per_texel: int | None = None) -> CoverCells:
    """Tabulate compliance and influence of a wide cover for any array of one pitch.

    Args:
        cover: A laterally wide cover, linearised at zero load.
        array: A flat, even grid; only its pitch and texel size matter, and its size as a bound.
        spread: The cover's point spread function.
        per_texel: Cells along each edge of a pitch; by the cover's thickness when not given [-].
    """
    from fem_reference.point_spread import decay_length
    from fem_reference.slab import surface_compliance

    count = per_texel or int(np.clip(math.ceil(min(array.pitch) / (_CELL * cover.thickness)), *_PER_TEXEL))
    cell = (array.pitch[0] / count, array.pitch[1] / count)
    reach = math.ceil(_REACH * decay_length(cover) / min(cell))
    reach = min(reach, (max(array.rows, array.columns) + 2) * count)
    surface = surface_compliance(cover, 1.5 * reach * max(cell))
    offsets = np.meshgrid(np.arange(reach + 1) * cell[0], np.arange(reach + 1) * cell[1])
    return CoverCells(
        per_texel=count,
        cell=cell,
        compliance=surface.of_rectangle(offsets[0], offsets[1], *cell),
        influence=_influence(array, spread, count, reach),
        top_compliance=surface.half_space,
        thickness=cover.thickness,
        source="finite elements",
    )


def _influence(array: TexelArray, spread: PointSpread, count: int, reach: int) -> FloatArray:
    """Force on one texel per unit force on each cell around, by 3 x 3 Gauss points on the cell [-]."""
    one = TexelArray.grid(1, 1, array.pitch, texel_size=array.texel_size)
    cell = np.array(array.pitch) / count
    index = np.arange(-reach, count + reach) + 0.5 - count / 2
    x, y = np.meshgrid(index * cell[0], index * cell[1])
    middles = np.column_stack([x.ravel(), y.ravel()])
    nodes, weights = np.polynomial.legendre.leggauss(3)
    influence = sum(
        u * v / 4 * spread.texel_influence(one, middles + np.array([a, b]) * cell / 2)[:, 0]
        for a, u in zip(nodes, weights, strict=True)
        for b, v in zip(nodes, weights, strict=True)
    )
    return np.asarray(influence).reshape(len(index), len(index))
