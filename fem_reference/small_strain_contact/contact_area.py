"""Measure the area of a contact from the pressures on cells, with the edge of the contact located within the cells."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from meshes.array_types import BoolArray, FloatArray, IntArray

#: Half width of the square of cells to which a polynomial is fitted [cells].
_FITTED = 2
#: Number of parts of a cell along each axis in which the edge is located [-].
_PARTS = 12


def measure_area(pressure: FloatArray, allowed: BoolArray, cell: tuple[float, float]) -> float:
    """Measure the contact area.

    Towards the edge of a contact under a smooth surface, the square of the pressure decreases to zero linearly with the
    distance from the edge (Johnson, Contact Mechanics, 1985, section 4.2).  A quadratic polynomial is fitted to the
    squared pressure of the 5 x 5 cells around the nearest cell that is surrounded by cells in contact, and its zero is
    the edge.  Where the polynomial does not vanish near the edge, cells count as a whole.

    Args:
        pressure: Pressure on every cell, positive in contact, shape (rows, columns) [Pa].
        allowed: Whether contact is possible on each cell, shape (rows, columns).
        cell: Edge lengths of a cell along x and y [m].

    Returns:
        Area [m2].
    """
    touching = pressure > 0
    ring = np.ones((3, 3), dtype=bool)
    known = ndimage.binary_erosion(touching, ring, iterations=_FITTED)
    # Beside cells that cannot touch, the contact ends at the edge of the indenter, where the pressure does not vanish.
    whole = ndimage.binary_erosion(touching | ~allowed, ring, iterations=_FITTED, border_value=1) & touching
    if not known.any():
        return float(touching.sum() * cell[0] * cell[1])
    band = ndimage.binary_dilation(touching, ring) & allowed & ~whole
    source = ndimage.distance_transform_edt(~known, sampling=cell, return_distances=False, return_indices=True)
    place = np.nonzero(band)
    nearest = source[0][place], source[1][place]
    share = np.zeros(len(place[0]))
    fitted = _fit_squares(pressure**2, nearest)
    part = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    for u in part:
        for v in part:
            x, y = place[0] - nearest[0] + u, place[1] - nearest[1] + v
            share += (_list_powers(x, y) * fitted).sum(axis=0) > 0
    share /= _PARTS**2
    inside = touching[place]
    share[(share == 1) & ~inside] = 0.0
    share[(share == 0) & inside] = 1.0
    return float((share.sum() + whole.sum()) * cell[0] * cell[1])


def _fit_squares(values: FloatArray, place: tuple[IntArray, IntArray]) -> FloatArray:
    """Fit a quadratic polynomial to the 5 x 5 values around each of m places, coefficients of shape (6, m)."""
    offset = np.arange(-_FITTED, _FITTED + 1)
    rows, columns = (each.ravel() for each in np.meshgrid(offset, offset, indexing="ij"))
    around = np.array([values[place[0] + i, place[1] + j] for i, j in zip(rows, columns, strict=True)])
    return np.asarray(np.linalg.pinv(_list_powers(rows.astype(float), columns.astype(float)).T) @ around)


def _list_powers(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the terms of a quadratic polynomial of x and y, shape (6, ...)."""
    return np.array([np.ones(np.shape(x)), x, y, x * x, y * y, x * y])
