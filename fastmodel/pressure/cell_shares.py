"""Which lattice cells a partly covered cell's force acts on, and how much softer it is than a whole one.

Both functions fill `corner` (2, m) with row and column of the first of the four cells around the middle of the covered
part, `weight` (4, m) with their bilinear shares, and `soft` (m,) with the displacement under its own unit force that
the shares and the smaller area take or add [m/N].  They take the samples' `coverage`, `x`, `y` (m,), the lowest corner
and edge lengths of the grid, the first row and column of the window, the compliance between neighbours `near` (2, 2)
[m/N] and that of a whole cell on a half space, `square` [m/N].
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def shares_numpy(  # noqa: PLR0917 -- numba kernels take positions
    coverage: FloatArray,
    x: FloatArray,
    y: FloatArray,
    low: FloatArray,
    edge_x: float,
    edge_y: float,
    first_row: int,
    first_column: int,
    near: FloatArray,
    square: float,
    corner: IntArray,
    weight: FloatArray,
    soft: FloatArray,
) -> None:
    """All cells at once."""
    # whole cells sit exactly on the lattice: rounding must not share them with a neighbour
    u = np.round((x - low[0]) / edge_x - 0.5 - first_column, 9)
    v = np.round((y - low[1]) / edge_y - 0.5 - first_row, 9)
    column, row = np.floor(u), np.floor(v)
    a, b = u - column, v - row
    corner[:] = row, column
    weight[:] = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    w = weight
    own = near[0, 0] * (w * w).sum(axis=0)
    own += 2 * near[0, 1] * (w[0] * w[1] + w[2] * w[3]) + 2 * near[1, 0] * (w[0] * w[2] + w[1] * w[3])
    own += 2 * near[1, 1] * (w[0] * w[3] + w[1] * w[2])
    soft[:] = near[0, 0] - own + square * (1 / np.sqrt(coverage) - 1)


def shares_loops(  # noqa: PLR0917 -- numba kernels take positions
    coverage: FloatArray,
    x: FloatArray,
    y: FloatArray,
    low: FloatArray,
    edge_x: float,
    edge_y: float,
    first_row: int,
    first_column: int,
    near: FloatArray,
    square: float,
    corner: IntArray,
    weight: FloatArray,
    soft: FloatArray,
) -> None:
    """One cell at a time, for numba."""
    for k in range(len(coverage)):
        u = np.floor(1e9 * ((x[k] - low[0]) / edge_x - 0.5 - first_column) + 0.5) * 1e-9
        v = np.floor(1e9 * ((y[k] - low[1]) / edge_y - 0.5 - first_row) + 0.5) * 1e-9
        column, row = np.floor(u), np.floor(v)
        a, b = u - column, v - row
        corner[0, k], corner[1, k] = int(row), int(column)
        p, q, r, s = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
        weight[0, k], weight[1, k], weight[2, k], weight[3, k] = p, q, r, s
        own = near[0, 0] * (p * p + q * q + r * r + s * s) + 2 * near[0, 1] * (p * q + r * s)
        own += 2 * near[1, 0] * (p * r + q * s) + 2 * near[1, 1] * (p * s + q * r)
        soft[k] = near[0, 0] - own + square * (1 / np.sqrt(coverage[k]) - 1)
