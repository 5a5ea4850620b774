"""The cover between sub-texel cells, as the fast model's contact method `cover` takes it.

A laterally wide cover answers everywhere alike: one kernel says how the top yields around a loaded cell, another what
of a loaded cell's force arrives on a texel.  Near free side edges the second differs from place to place and becomes a
table of every cell and texel; the first stays that of the wide cover, which is stiffer than the cover near its sides.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel.pressure.cover_kernels import CoverCells
from meshes import Cover, TexelArray

if TYPE_CHECKING:
    from fem_reference.linear_response.finite_cover import SolidInfluence
    from fem_reference.linear_response.point_spread import PointSpread

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
    from fem_reference.linear_response.point_spread import decay_length
    from fem_reference.linear_response.surface_compliance import surface_compliance

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


def cells_with_sides(cover: Cover, array: TexelArray, influence: SolidInfluence) -> CoverCells:
    """The same for a cover with free side edges: the wide cover's compliance, and what each cell puts on each texel.

    Args:
        cover: A cover with a size.
        array: A flat, even grid that lies under it.
        influence: The cover's answer to loads anywhere on it.
    """
    from fem_reference.linear_response.point_spread import point_spread

    wide = dataclasses.replace(cover, size=None)
    cells = cover_cells(wide, array, point_spread(wide))
    rows, columns = array.rows * cells.per_texel, array.columns * cells.per_texel
    low = array.centres[:, :2].min(axis=0) - np.array(array.pitch) / 2
    x, y = np.meshgrid(*(low[i] + (np.arange(n) + 0.5) * cells.cell[i] for i, n in enumerate((columns, rows))))
    half = np.array(cover.size) / 2
    table = _even(lambda places: influence.texel_influence(array, np.clip(places, -half, half)), x, y, cells.cell)
    source = "finite elements; influence with free side edges, compliance of the wide cover"
    return dataclasses.replace(cells, table=table.T.reshape(array.count, rows, columns), source=source)


def _influence(array: TexelArray, spread: PointSpread, count: int, reach: int) -> FloatArray:
    """Force on one texel per unit force on each cell around [-]."""
    one = TexelArray.grid(1, 1, array.pitch, texel_size=array.texel_size)
    cell = (array.pitch[0] / count, array.pitch[1] / count)
    index = np.arange(-reach, count + reach) + 0.5 - count / 2
    x, y = np.meshgrid(index * cell[0], index * cell[1])
    return _even(lambda places: spread.texel_influence(one, places), x, y, cell).reshape(len(index), len(index))


def _even(
    influence: Callable[[FloatArray], FloatArray], x: FloatArray, y: FloatArray, cell: tuple[float, float]
) -> FloatArray:
    """What force spread evenly over cells puts on texels, by 3 x 3 Gauss points on each cell, shape (cells, n) [-]."""
    middles = np.column_stack([x.ravel(), y.ravel()])
    nodes, weights = np.polynomial.legendre.leggauss(3)
    return np.asarray(
        sum(
            u * v / 4 * influence(middles + np.array([a, b]) * np.array(cell) / 2)
            for a, u in zip(nodes, weights, strict=True)
            for b, v in zip(nodes, weights, strict=True)
        )
    )
