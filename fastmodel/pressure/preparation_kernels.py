"""Compiled kernels that prepare the cells and the first forces of a contact; `conjugate_gradient` calls them."""

from __future__ import annotations

import math

import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Multiple to which the numbers of rows and columns of windows are rounded up, so that few matrices are needed [-].
_BLOCK = 4
#: Smallest share of a body's load that the last pressures must give on the cells now under the body; below this share
#: the iteration starts from uniform pressure [-].
_USABLE = 0.5


def place_cells(
    samples: tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray],
    grid: tuple[IntArray, FloatArray, FloatArray],
    near: FloatArray,
    square: float,
) -> tuple[tuple[int, int], tuple[int, int], IntArray, FloatArray, FloatArray]:
    """Kernel: divide each cell under a body among the four whole cells around the centroid of the covered part.

    Args:
        samples: Row, column, coverage, x and y of the cells, see `GapSamples`.
        grid: Arrays that describe the contact grid, see `CellGrid.arrays`.
        near: Compliance between cells that lie 0 or 1 rows and columns apart, shape (2, 2) [m/N].
        square: Displacement at the centre of a whole cell under unit force on this cell of a half space [m/N].

    Returns:
        Row and column in the contact grid of the first cell of a window that contains all these whole cells; rows and
        columns of the window; and the first three entries of
        `conjugate_gradient_kernels.Cover`.
    """
    row, column, coverage, x, y = samples
    _, low, edge = grid
    top, left, rows, cols = row[0], column[0], 0, 0
    for k in range(len(x)):
        top, left = min(top, row[k]), min(left, column[k])
        rows, cols = max(rows, row[k] + 1), max(cols, column[k] + 1)
    # extend the window by one cell on each side
    top, left, rows, cols = top - 1, left - 1, rows - top + 2, cols - left + 2
    corner, weight = np.empty((2, len(x)), dtype=np.int64), np.empty((4, len(x)))
    own = np.empty(len(x))
    for k in range(len(x)):
        # rounded to 1e-9 cells, so that rounding errors do not divide a fully covered cell among four cells
        u = math.floor(1e9 * ((x[k] - low[0]) / edge[0] - 0.5 - left) + 0.5) * 1e-9
        v = math.floor(1e9 * ((y[k] - low[1]) / edge[1] - 0.5 - top) + 0.5) * 1e-9
        corner[0, k], corner[1, k] = math.floor(v), math.floor(u)
        a, b = u - math.floor(u), v - math.floor(v)
        p, q, r, s = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
        weight[0, k], weight[1, k], weight[2, k], weight[3, k] = p, q, r, s
        # self compliance of the divided cell by the convolution; for a whole cell it is near[0, 0]
        interpolated = near[0, 0] * (p * p + q * q + r * r + s * s) + 2 * near[0, 1] * (p * q + r * s)
        interpolated += 2 * near[1, 0] * (p * r + q * s) + 2 * near[1, 1] * (p * s + q * r)
        own[k] = near[0, 0] - interpolated + square * (1 / math.sqrt(coverage[k]) - 1)
    shape = ((rows + _BLOCK - 1) // _BLOCK * _BLOCK, (cols + _BLOCK - 1) // _BLOCK * _BLOCK)
    return (top, left), shape, corner, weight, own


def find_start(
    last: tuple[IntArray, IntArray, FloatArray],
    samples: tuple[IntArray, IntArray, FloatArray, IntArray],
    wanted: FloatArray,
    scratch: FloatArray,
) -> FloatArray:
    """Kernel: compute the cell forces from which the iteration starts, shape (m,) [N].

    They are the last pressures on the m cells, scaled to the load of each body, or uniform pressure if the last
    pressures on the cells under a body give less than the share `_USABLE` of its load.

    Args:
        last: Row, column, and pressure times the area of a whole cell [N], of each cell of the last solution.
        samples: Row, column, coverage and body of the m cells, see `GapSamples`.
        wanted: Load of each body, shape (bodies,) [N].
        scratch: Working memory of zeros, with the shape of the contact grid; zeros again afterwards.
    """
    row, column, coverage, body = samples
    forces, sums, areas = np.zeros(len(row)), np.zeros(len(wanted)), np.zeros(len(wanted))
    for k in range(len(last[0])):
        scratch[last[0][k], last[1][k]] = last[2][k]
    for k in range(len(row)):
        forces[k] = scratch[row[k], column[k]] * coverage[k]
        sums[body[k]] += forces[k]
        areas[body[k]] += coverage[k]
    for k in range(len(last[0])):
        scratch[last[0][k], last[1][k]] = 0.0
    for k in range(len(row)):
        b = body[k]
        if sums[b] > _USABLE * wanted[b]:
            forces[k] *= wanted[b] / sums[b]
        else:
            forces[k] = wanted[b] * coverage[k] / areas[b]
    return forces


def are_close(one: FloatArray, other: FloatArray, tolerance: float) -> bool:
    """Kernel: return whether no entries of two arrays of equal length, shape (n,), differ by more than a tolerance."""
    return bool(np.abs(one - other).max() <= tolerance)
