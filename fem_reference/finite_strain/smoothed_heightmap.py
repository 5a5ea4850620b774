"""Smooth the lower surface of an indenter of any shape: facets and edges rounded, steep walls replaced by slopes.

The heights at the nodes of a square grid are the coefficients of a cubic B-spline.  The spline approximates the heights
and does not interpolate them; it rounds facets and edges over about one cell of the grid and cannot overshoot.  The
spline preserves the curvature of a curved surface and raises the surface, in each direction, by one sixth of the
curvature times the squared cell size; the lowest point is then moved back to height zero.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from meshes import Indenter
from meshes.array_types import FloatArray

#: Number of grid cells on each side outside the footprint of the indenter, and largest number of cells along the
#: longer half of the footprint [-].
_MARGIN, _MOST_CELLS = 5, 500
#: Radius of the cone with which one erosion of the heightmap limits its slope [cells].
_CONE_RADIUS = 3


class SmoothedHeightmap:
    """Twice continuously differentiable approximation of an indenter's lower surface, in units of length.

    Args:
        indenter: Indenter with its shape.
        cell: Edge length of a grid cell; increased if the grid would have too many cells [units of length].
        steepest: Slope that replaces steeper walls [-].
        highest: Height at which the surface is clipped, and the height beside the indenter [units of length].
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
        """Compute the height of the surface above its lowest point; outside the grid the surface extends as a cone.

        Args:
            x: x coordinates of the points, any shape [units of length].
            y: y coordinates of the points, same shape [units of length].

        Returns:
            Heights, shape of `x` [units of length].
        """
        position = np.stack(np.broadcast_arrays(x, y))
        end = (self._extent * self._cell).reshape(-1, *[1] * (position.ndim - 1))
        within = np.clip(position, -end, end)
        beyond = np.hypot(*(position - within))
        spline = self._evaluate_spline((within + end) / self._cell)
        return np.asarray(spline - self._lowest + self._steepest * beyond)

    def _evaluate_spline(self, position: FloatArray) -> FloatArray:
        """Evaluate the spline at positions in cells from the first node of the grid, shape (2, ...)."""
        return np.asarray(ndimage.map_coordinates(self._heights, position, order=3, mode="nearest", prefilter=False))


def _limit_slope(heights: FloatArray, step: float) -> FloatArray:
    """Compute the largest heights, nowhere above the given heights, that change by at most about `step` per cell.

    Each pass takes the minimum over all upward cones of this slope with their tips on the surface (a grey erosion).
    """
    offset = np.arange(-_CONE_RADIUS, _CONE_RADIUS + 1)
    cone = step * np.hypot(*np.meshgrid(offset, offset))
    while True:
        lower = np.asarray(ndimage.grey_erosion(heights, structure=-cone, mode="nearest"))  # type: ignore[call-overload]
        if np.array_equal(lower, heights):
            return heights
        heights = lower
