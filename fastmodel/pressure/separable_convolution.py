"""Convolutions on windows (rectangles of cells of the contact grid) by low-rank factorisation of the kernel.

The compliance of a cover as a function of the distance between cells is smooth beyond one cell, so that a kernel is
well approximated by a sum of few terms, K[i, j] = sum over r of u_r[i] v_r[j], from its singular value decomposition.
Each term acts along rows and columns separately.  For windows of the size of a contact, two matrix products over all
terms are faster than a fast Fourier transform, and the matrices do not depend on the position of the window.
"""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray

#: Number of sizes of windows whose matrices are kept in memory at most [-]; this limits the use of memory.
_KEPT = 32


def factorise(kernel: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Compute a low-rank factorisation of a kernel by its singular value decomposition.

    Args:
        kernel: The kernel, shape (rows, columns) [any unit].
        tolerance: Singular values up to this share of the largest singular value are omitted [-].

    Returns:
        Row factors, shape (terms, rows) [unit of the kernel], and column factors, shape (terms, columns) [-].  The sum
        of their products over the terms approximates the kernel.
    """
    rows, values, columns = np.linalg.svd(kernel)
    kept = int((values > tolerance * values[0]).sum())
    return (rows[:, :kept] * values[:kept]).T.copy(), columns[:kept].copy()


class SymmetricConvolution:
    """Convolution with a kernel that depends only on the absolute distances along rows and along columns."""

    def __init__(self, quarter: FloatArray, tolerance: float = 3e-5) -> None:
        """Factorise the kernel.

        Args:
            quarter: Kernel at distances of i rows and j columns, entry `[i, j]`; zero at larger distances, shape (rows,
                columns) [any unit].
            tolerance: Tolerance of the low-rank factorisation, see `factorise` [-].
        """
        mirrored = np.concatenate([quarter[:0:-1], quarter])
        full = np.concatenate([mirrored[:, :0:-1], mirrored], axis=1)
        along, across = factorise(full, tolerance)
        self._along, self._across = along[:, len(quarter) - 1 :], across[:, quarter.shape[1] - 1 :]
        self._matrices: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}

    def matrices(self, rows: int, columns: int) -> tuple[FloatArray, FloatArray]:
        """Build the matrices that convolve a window of the given numbers of rows and columns.

        The convolution of a window q is the sum over the terms of first[term] @ q @ second[term].

        Returns:
            Stacked Toeplitz matrices `first`, shape (terms * rows, rows), and `second`, shape (terms * columns,
            columns).
        """
        key = (rows, columns)
        if key not in self._matrices:
            if len(self._matrices) >= _KEPT:
                self._matrices.clear()
            self._matrices[key] = (_build_toeplitz(self._along, rows), _build_toeplitz(self._across, columns))
        return self._matrices[key]


def _build_toeplitz(factor: FloatArray, size: int) -> FloatArray:
    """Build the symmetric Toeplitz matrices of the factors of all terms, stacked, shape (terms * size, size)."""
    padded = np.zeros((len(factor), max(size, factor.shape[1])))
    padded[:, : factor.shape[1]] = factor
    distance = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    return np.ascontiguousarray(padded[:, distance].reshape(-1, size))
