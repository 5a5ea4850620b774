"""Kernels of the cover for the contact method `cover` of the fast model, which divides each texel into small cells.

The response of a laterally wide cover is the same everywhere, so two kernels describe it: the compliance, which is the
displacement of the cover's top around a loaded cell, and the influence, which is the force on a texel per unit force on
a cell.  Near free side edges the influence depends on the position; there the influence is a table with one entry per
cell and texel.  The compliance remains that of the wide cover, which is stiffer than the real cover near its sides.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel.surface import CoverCells
from meshes import Cover, TexelArray
from validation.derivation.quadrature import gauss_points

if TYPE_CHECKING:
    from fem_reference.linear_response.finite_cover import SolidInfluence
    from fem_reference.linear_response.point_spread import PointSpread
    from fem_reference.linear_response.surface_compliance import SurfaceCompliance

FloatArray = npt.NDArray[np.float64]

#: Target edge length of a cell of the contact grid, over the thickness of the cover [-].
_CELL_SIZE = 0.45
#: Least and greatest number of cells of the contact grid along one pitch of the texels [-].
_CELLS_PER_PITCH = (4, 12)
#: Radius of the kernels, over the decay length of the cover's response: at larger distances the response is negligible
#: [-].
_KERNEL_RADIUS = 8.0


def cover_cells(cover: Cover, array: TexelArray, spread: PointSpread, *, per_texel: int | None = None) -> CoverCells:
    """Tabulate the compliance and the influence of a wide cover between cells of the contact grid.

    Args:
        cover: A laterally wide cover, linearised at zero load.
        array: A flat array.  Pitch and texel size define the cells; rows and columns limit the radius of the kernels.
        spread: The point spread function of the cover.
        per_texel: Number of cells along one pitch; if None, it follows from the thickness of the cover [-].
    """
    from fem_reference.linear_response.surface_compliance import decay_length

    count = per_texel or int(np.clip(math.ceil(min(array.pitch) / (_CELL_SIZE * cover.thickness)), *_CELLS_PER_PITCH))
    cell = (array.pitch[0] / count, array.pitch[1] / count)
    reach = math.ceil(_KERNEL_RADIUS * decay_length(cover) / min(cell))
    reach = min(reach, (max(array.rows, array.columns) + 2) * count)
    surface = tabulate_surface(cover, reach, cell)
    return CoverCells(
        per_texel=count,
        cell=cell,
        compliance=compliance_kernel(surface, reach, cell),
        influence=influence_kernel(array, spread, count, reach),
        top_compliance=surface.half_space,
        thickness=cover.thickness,
        source="finite elements",
    )


def tabulate_surface(cover: Cover, reach: int, cell: tuple[float, float]) -> SurfaceCompliance:
    """Tabulate the compliance of the cover's top over all distances between cells up to `reach` cells apart."""
    from fem_reference.linear_response.surface_compliance import surface_compliance

    return surface_compliance(cover, (1.5 * reach + 1) * max(cell))


def compliance_kernel(surface: SurfaceCompliance, reach: int, cell: tuple[float, float]) -> FloatArray:
    """Compute the displacement of a cell's centre per uniform pressure on the cell i rows and j columns away.

    Returns:
        Displacements per pressure, shape (reach + 1, reach + 1) [m/Pa].
    """
    offsets = np.meshgrid(np.arange(reach + 1) * cell[0], np.arange(reach + 1) * cell[1])
    return surface.of_rectangle(offsets[0], offsets[1], *cell)


def cells_with_sides(cover: Cover, array: TexelArray, influence: PointSpread | SolidInfluence) -> CoverCells:
    """Tabulate the response of a cover with free side edges between the cells of the contact grid and the texels.

    The compliance is that of a wide cover of the same layers; the influence is a table by cell and texel.

    Args:
        cover: A cover with a size, hence with free side edges.
        array: Texels under the cover, flat and on a regular grid.
        influence: Finite-element response of the texels to loads anywhere on the cover.
    """
    from fem_reference.linear_response.point_spread import point_spread

    wide = dataclasses.replace(cover, size=None)
    cells = cover_cells(wide, array, point_spread(wide))
    rows, columns = array.rows * cells.per_texel, array.columns * cells.per_texel
    low = array.centres[:, :2].min(axis=0) - np.array(array.pitch) / 2
    x, y = np.meshgrid(*(low[i] + (np.arange(n) + 0.5) * cells.cell[i] for i, n in enumerate((columns, rows))))
    # Integration points that lie beside the cover are moved to the cover's edge.
    half = np.array(cover.size) / 2
    table = _mean_over_cells(
        lambda points: influence.texel_influence(array, np.clip(points, -half, half)), x, y, cells.cell
    )
    return dataclasses.replace(
        cells,
        table=table.T.reshape(array.count, rows, columns),
        source="finite elements; influence with free side edges, compliance of the wide cover",
    )


def influence_kernel(array: TexelArray, spread: PointSpread, count: int, reach: int) -> FloatArray:
    """Tabulate the force on one texel per unit force on each cell around the texel, spread uniformly over the cell.

    Args:
        array: The array, which gives the pitch and the size of the texel.
        spread: The point spread function of the cover.
        count: Number of cells along one pitch [-].
        reach: Number of cells beyond the texel's edges [-].

    Returns:
        Forces by row and column of the cell, a square array of edge 2 reach + count [-].
    """
    texel = TexelArray.grid(1, 1, array.pitch, texel_size=array.texel_size)
    cell = (array.pitch[0] / count, array.pitch[1] / count)
    index = np.arange(-reach, count + reach) + 0.5 - count / 2
    x, y = np.meshgrid(index * cell[0], index * cell[1])
    kernel = _mean_over_cells(lambda points: spread.texel_influence(texel, points), x, y, cell)
    return kernel.reshape(len(index), len(index))


def _mean_over_cells(
    influence: Callable[[FloatArray], FloatArray], x: FloatArray, y: FloatArray, cell: tuple[float, float]
) -> FloatArray:
    """Average the force on each of n texels over the place of a unit force within each cell.

    Args:
        influence: Function from m positions, shape (m, 2), to the forces on texels under a unit point load at each of
            them, shape (m, n).
        x: x coordinates of the cells' centres, any shape [m].
        y: y coordinates of the cells' centres, same shape [m].
        cell: Edge lengths of a cell along x and y [m].

    Returns:
        Force on each texel per unit force spread uniformly over each cell, shape (cells, n) [-].
    """
    middles = np.column_stack([x.ravel(), y.ravel()])
    points, weights = gauss_points(cell, 3)
    return np.asarray(sum(w * influence(middles + point) for point, w in zip(points, weights, strict=True)))
