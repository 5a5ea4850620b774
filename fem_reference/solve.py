"""Direct solution of sparse symmetric systems."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import scipy.sparse.linalg as spla

FloatArray = npt.NDArray[np.float64]


class ConstrainedSystem:
    """A symmetric system with prescribed unknowns, factorised once.

    Args:
        matrix: Symmetric, shape (n, n).
        fixed: Indices of prescribed unknowns.
    """

    def __init__(self, matrix: sp.csr_matrix, fixed: npt.NDArray[np.int64]) -> None:
        self._matrix = matrix
        self._fixed = np.unique(fixed)
        self._free = np.setdiff1d(np.arange(matrix.shape[0]), self._fixed)
        self._factor: Any = spla.splu(matrix[self._free][:, self._free].tocsc())

    def solve(self, load: FloatArray, prescribed: FloatArray | float = 0.0) -> FloatArray:
        """Unknowns for a load, prescribed values included.

        Args:
            load: Right-hand side, shape (n,) or (n, m).
            prescribed: Values of the fixed unknowns, in ascending order of their index.
        """
        out = np.zeros_like(load)
        out[self._fixed] = prescribed
        right = load[self._free] - self._matrix[self._free][:, self._fixed] @ out[self._fixed]
        out[self._free] = self._factor.solve(np.ascontiguousarray(right))
        return out

    def reaction(self, solution: FloatArray, load: FloatArray) -> FloatArray:
        """Forces that hold the fixed unknowns, zero elsewhere, shape of `load`."""
        out = np.zeros_like(load)
        rows = self._fixed
        out[rows] = self._matrix[rows] @ solution - load[rows]
        return out
