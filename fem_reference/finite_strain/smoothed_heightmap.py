"""The underside of any shape as a smooth surface: facets and edges rounded, steep walls leaning.

Heights at the nodes of a grid are taken as the coefficients of a cubic B-spline.  That rounds facets and edges over
about one cell, moves a curved surface by no more than its curvature times a third of the cell squared, which is taken
off again, and keeps curvature itself; nothing swings over, unlike a spline through the heights.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from meshes import Indenter

FloatArray = npt.NDArray[np.float64]

#: Cells beyond the footprint, and cells along the longer half at most.
_MARGIN, _MOST = 5, 500
#: Cells over which a wall leans in one go.
_REACH = 3


class Relief:
    """A twice differentiable underside, in lengths of a unit."""

    def __init__(self, indenter: Indenter, *, cell: float, steepest: float, highest: float, unit: float) -> None:
        """Take the heights of a shape.

        Args:
            indenter: The shape.
            cell: Edge of a cell of the grid, in units.
            steepest: Slope at which walls lean [-].
            highest: Height that is taken for any greater one, and where there is no underside, in units.
            unit: Length of a unit [m].
        """
        half = np.array(indenter.footprint) / unit
        self._cell, self._steepest = max(cell, float(half.max()) / _MOST), steepest
        self._reach = np.ceil(half / self._cell).astype(int) + _MARGIN
        x, y = np.meshgrid(*(np.arange(-n, n + 1) * self._cell for n in self._reach), indexing="ij")
        heights = np.minimum(indenter.gap(x * unit, y * unit) / unit, highest)
        self._heights = _leaning(heights, steepest * self._cell)
        fine = np.meshgrid(*(np.arange(4 * n + 1) / 2 for n in self._reach), indexing="ij")
        self._lowest = float(self._spline(np.array(fine)).min())

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height over the lowest point, any shape; beyond the grid it goes on as a steep cone."""
        place = np.stack(np.broadcast_arrays(x, y))
        end = (self._reach * self._cell).reshape(-1, *[1] * (place.ndim - 1))
        within = np.clip(place, -end, end)
        beyond = np.hypot(*(place - within))
        return np.asarray(self._spline((within + end) / self._cell) - self._lowest + self._steepest * beyond)

    def _spline(self, place: FloatArray) -> FloatArray:
        """The spline at places counted in cells from the grid's first node."""
        return np.asarray(ndimage.map_coordinates(self._heights, place, order=3, mode="nearest", prefilter=False))


def _leaning(heights: FloatArray, step: float) -> FloatArray:
    """Heights that rise by no more than about `step` per cell: the lowest of all cones that stand on them."""
    offset = np.arange(-_REACH, _REACH + 1)
    cone = step * np.hypot(*np.meshgrid(offset, offset))
    while True:
        lower = np.asarray(ndimage.grey_erosion(heights, structure=-cone, mode="nearest"))  # type: ignore[call-overload]
        if np.array_equal(lower, heights):
            return heights
        heights = lower
