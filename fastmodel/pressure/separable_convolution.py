"""Convolutions on windows of cells as a few pairs of matrix products.

The kernels of a cover are smooth beyond a cell, so a handful of singular vectors hold them: K[i, j] = sum of
u_r[i] v_r[j].  Each term acts along rows and columns separately, and for the windows that contacts take two matrix
products over all terms beat a fast Fourier transform, without any set-up that depends on where the window stands.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def factors(kernel: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Row factors (terms, rows) and column factors (terms, columns) whose products sum to a kernel.

    Args:
        kernel: Shape (rows, columns).
        tolerance: Largest singular value that is left out, over the largest one [-].
    """
    rows, values, columns = np.linalg.svd(kernel)
    kept = int((values > tolerance * values[0]).sum())
    return (rows[:, :kept] * values[:kept]).T.copy(), columns[:kept].copy()


class SymmetricConvolution:
    """A kernel that depends on distances along rows and columns, over windows of any size."""

    def __init__(self, quarter: FloatArray, tolerance: float = 3e-5) -> None:
        """Factorise.

        Args:
            quarter: Kernel at distances [i, j] >= 0, zero beyond, shape (rows, columns).
            tolerance: Relative error of the kernel [-].
        """
        mirrored = np.concatenate([quarter[:0:-1], quarter])
        full = np.concatenate([mirrored[:, :0:-1], mirrored], axis=1)
        along, across = factors(full, tolerance)
        self._along, self._across = along[:, len(quarter) - 1 :], across[:, quarter.shape[1] - 1 :]
        self._made: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}

    def matrices(self, rows: int, columns: int) -> tuple[FloatArray, FloatArray]:
        """Stacked Toeplitz matrices of a window: (terms * rows, rows) and (terms * columns, columns).

        With a window q, the convolution is the sum over terms of first[term] @ q @ second[term].
        """
        key = (rows, columns)
        if key not in self._made:
            if len(self._made) >= 32:  # noqa: PLR2004 -- windows come in few sizes; this bounds the memory
                self._made.clear()
            self._made[key] = (_toeplitz(self._along, rows), _toeplitz(self._across, columns))
        return self._made[key]


def _toeplitz(factor: FloatArray, size: int) -> FloatArray:
    """Symmetric Toeplitz matrices of each term, stacked, shape (terms * size, size)."""
    padded = np.zeros((len(factor), max(size, factor.shape[1])))
    padded[:, : factor.shape[1]] = factor
    distance = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    return np.ascontiguousarray(padded[:, distance].reshape(-1, size))
