"""Small linear systems in what numba compiles fast: a few unknowns, one per body and tilt."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fastmodel.native import called_by_kernels

FloatArray = npt.NDArray[np.float64]


@called_by_kernels()
def gram(columns: FloatArray, weight: FloatArray, matrix: FloatArray) -> None:
    """Sums of weight times column times column over the rows of `columns` (m, k), into `matrix` (k, k)."""
    k = columns.shape[1]
    for a in range(k):
        for b in range(a + 1):
            total = 0.0
            for i in range(columns.shape[0]):
                total += weight[i] * columns[i, a] * columns[i, b]
            matrix[a, b] = total
            matrix[b, a] = total


@called_by_kernels()
def project(values: FloatArray, columns: FloatArray, sums: FloatArray) -> None:
    """Sums of values (m,) times columns (m, k), into `sums` (k,)."""
    for a in range(columns.shape[1]):
        total = 0.0
        for i in range(columns.shape[0]):
            total += values[i] * columns[i, a]
        sums[a] = total


@called_by_kernels()
def eliminate(matrix: FloatArray, ridge: float, wanted: FloatArray, found: FloatArray) -> None:
    """Solve matrix @ found = wanted, without a choice of pivots, which a positive matrix does not need.

    Args:
        matrix: Symmetric, positive, shape (k, k); destroyed.
        ridge: What is added to its diagonal.
        wanted: Right-hand side, shape (k,).
        found: The solution, shape (k,).
    """
    k = matrix.shape[0]
    for i in range(k):
        found[i] = wanted[i]
        matrix[i, i] += ridge
    for i in range(k):
        for j in range(i + 1, k):
            factor = matrix[j, i] / matrix[i, i]
            for n in range(i, k):
                matrix[j, n] -= factor * matrix[i, n]
            found[j] -= factor * found[i]
    for i in range(k - 1, -1, -1):
        for n in range(i + 1, k):
            found[i] -= matrix[i, n] * found[n]
        found[i] /= matrix[i, i]
