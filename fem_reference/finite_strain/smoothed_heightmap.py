"""The lower surface of any shape as a smooth heightmap: facets and edges rounded, steep walls replaced by slopes.

The heights at the nodes of a square grid are used as the coefficients of a cubic B-spline.  The spline approximates the
heights instead of interpolating them.  This rounds facets and edges over about one cell and cannot overshoot.  A curved
surface keeps its curvature and is raised by its curvature times one sixth of the cell squared for each direction; the
lowest point is moved back to zero.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from meshes import Indenter
from meshes.array_types import FloatArray

#: Number of cells of the grid beyond the footprint, and largest number along the longer half of the footprint.
_MARGIN, _MOST_CELLS = 5, 500
#: Radius of the cone that limits the slope in one pass over the grid [cells].
_CONE_RADIUS = 3


class SmoothedHeightmap:
    """A twice continuously differentiable lower surface, in units of length.

    Args:
        indenter: The shape.
        cell: Edge of a cell of the grid, in units of length; larger if the grid would have too many cells.
        steepest: Slope that replaces steeper walls [-].
        highest: Height that replaces larger ones, and the height where there is no lower surface, in units of length.
        unit: Unit of length [m].
    """

    def __init__(self, indenter: Indenter, *, cell: float, steepest: float, highest: float, unit: float) -> None:
        half = np.array(indenter.footprint) / unit
        self._cell, self._steepest = max(cell, float(half.max()) / _MOST_CELLS), steepest
        self._extent = np.ceil(half / self._cell).astype(int) + _MARGIN
        x, y = np.meshgrid(*(np.arange(-n, n + 1) * self._cell for n in self._extent), indexing="ij")
        heights = np.minimum(indenter.gap(x * unit, y * unit) / unit, highest)
        self._heights = _limit_slope(heights, steepest * self._cell)
        half_cells = np.meshgrid(*(np.arange(4 * n + 1) / 2 for n in self._extent), indexing="ij")
        self._lowest = float(self._evaluate_spline(np.array(half_cells)).min())

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height over the lowest point; beyond the grid the surface continues as a steep cone.

        Args:
            x: Positions, any shape, in units of length.
            y: Positions of the same shape.
        """
        position = np.stack(np.broadcast_arrays(x, y))
        end = (self._extent * self._cell).reshape(-1, *[1] * (position.ndim - 1))
        within = np.clip(position, -end, end)
        beyond = np.hypot(*(position - within))
        spline = self._evaluate_spline((within + end) / self._cell)
        return np.asarray(spline - self._lowest + self._steepest * beyond)

    def _evaluate_spline(self, position: FloatArray) -> FloatArray:
        """Return the spline at positions, shape (2, ...), counted in cells from the grid's first node."""
        return np.asarray(ndimage.map_coordinates(self._heights, position, order=3, mode="nearest", prefilter=False))


def _limit_slope(heights: FloatArray, step: float) -> FloatArray:
    """Return the largest heights below the given ones that change by at most about `step` per cell.

    Each pass takes the minimum over all cones of that slope which stand on the surface (a grey erosion).
    """
    offset = np.arange(-_CONE_RADIUS, _CONE_RADIUS + 1)
    cone = step * np.hypot(*np.meshgrid(offset, offset))
    while True:
        lower = np.asarray(ndimage.grey_erosion(heights, structure=-cone, mode="nearest"))  # type: ignore[call-overload]
        if np.array_equal(lower, heights):
            return heights
        heights = lower
