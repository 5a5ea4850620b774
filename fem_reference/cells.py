"""The cover as data between sub-texel cells, for models that solve the contact themselves at run time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem_reference.linear_response.point_spread import decay_length, point_spread
from fem_reference.linear_response.surface_compliance import surface_compliance
from meshes import Cover, TexelArray

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CellData:
    """A wide cover on a grid of cells that divides every texel of a flat grid evenly.

    Attributes:
        cell: Edge lengths of a cell along x and y [m].
        rows: Rows of cells [-].
        columns: Columns of cells [-].
        compliance: Downward displacement of one cell's centre per uniform pressure on a cell that stands `[i, j]` rows
            and columns away, shape (rows, columns); symmetric, so it is a Toeplitz kernel [m/Pa].
        influence: Force on each texel per unit force, spread evenly over each cell, shape (n, rows * columns) [-].
    """

    cell: tuple[float, float]
    rows: int
    columns: int
    compliance: FloatArray
    influence: FloatArray


def cell_data(cover: Cover, array: TexelArray, *, per_texel: int = 4) -> CellData:
    """Tabulate the compliance between cells and the influence of cells on texels.

    Args:
        cover: A laterally wide cover, linearised at zero load.
        array: A planar grid of texels.
        per_texel: Cells along each edge of a pitch [-].

    Raises:
        ValueError: If the cover has free side edges or the array is not planar.
    """
    spread = point_spread(cover)
    cell = (array.pitch[0] / per_texel, array.pitch[1] / per_texel)
    rows, columns = array.rows * per_texel, array.columns * per_texel
    x, y = np.arange(columns) * cell[0], np.arange(rows) * cell[1]
    reach = max(float(np.hypot(x[-1], y[-1])) * 1.01, 4 * decay_length(cover))
    surface = surface_compliance(cover, reach)
    grid = np.meshgrid(x, y)
    centres = np.column_stack([(g - g.mean()).ravel() for g in grid])
    nodes, weights = np.polynomial.legendre.leggauss(3)
    influence = np.zeros((array.count, len(centres)))
    for a, u in zip(nodes, weights, strict=True):
        for b, v in zip(nodes, weights, strict=True):
            shift = np.array([a * cell[0], b * cell[1]]) / 2
            influence += u * v / 4 * spread.texel_influence(array, centres + shift).T
    return CellData(
        cell=cell,
        rows=rows,
        columns=columns,
        compliance=surface.of_rectangle(grid[0], grid[1], cell[0], cell[1]),
        influence=influence,
    )
