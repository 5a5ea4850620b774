"""Convolutions on windows of cells, as sums of matrix products.

The kernels of a cover are smooth beyond one cell, so few singular vectors represent them:
K[i, j] = sum over r of u_r[i] v_r[j].  Each term acts along rows and columns separately.  For windows of the size of a
contact, two matrix products over all terms are faster than a fast Fourier transform, and the matrices do not depend on
the place of the window.
"""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray

#: Most sizes of windows whose matrices are kept; bounds the memory.
_KEPT = 32


def factorise(kernel: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Row factors (terms, rows) and column factors (terms, columns) whose products sum to a kernel.

    Args:
        kernel: Shape (rows, columns).
        tolerance: Largest singular value that is left out, over the largest one [-].
    """
    rows, values, columns = np.linalg.svd(kernel)
    kept = int((values > tolerance * values[0]).sum())
    return (rows[:, :kept] * values[:kept]).T.copy(), columns[:kept].copy()


class SymmetricConvolution:
    """Convolution with a kernel that depends on the distances along rows and along columns only."""

    def __init__(self, quarter: FloatArray, tolerance: float = 3e-5) -> None:
        """Factorise the kernel.

        Args:
            quarter: Kernel at distances [i, j] >= 0, zero beyond, shape (rows, columns).
            tolerance: Relative error of the kernel [-].
        """
        mirrored = np.concatenate([quarter[:0:-1], quarter])
        full = np.concatenate([mirrored[:, :0:-1], mirrored], axis=1)
        along, across = factorise(full, tolerance)
        self._along, self._across = along[:, len(quarter) - 1 :], across[:, quarter.shape[1] - 1 :]
        self._matrices: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}

    def matrices(self, rows: int, columns: int) -> tuple[FloatArray, FloatArray]:
        """Stacked Toeplitz matrices for a window of (rows, columns).

        The convolution of a window q is the sum over terms of first[term] @ q @ second[term].

        Returns:
            The first matrices, shape (terms * rows, rows), and the second, shape (terms * columns, columns).
        """
        key = (rows, columns)
        if key not in self._matrices:
            if len(self._matrices) >= _KEPT:
                self._matrices.clear()
            self._matrices[key] = (_build_toeplitz(self._along, rows), _build_toeplitz(self._across, columns))
        return self._matrices[key]


def _build_toeplitz(factor: FloatArray, size: int) -> FloatArray:
    """Symmetric Toeplitz matrix of each term, stacked, shape (terms * size, size)."""
    padded = np.zeros((len(factor), max(size, factor.shape[1])))
    padded[:, : factor.shape[1]] = factor
    distance = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    return np.ascontiguousarray(padded[:, distance].reshape(-1, size))
