"""Solve sparse symmetric linear systems, definite or indefinite, by direct factorisation.

Three backends give the same solution.  `pardiso` (pypardiso, an optional dependency) is the fastest on large systems.
`metis` is SuperLU with the unknowns ordered by nested dissection of METIS; unknowns with the same neighbours in the
matrix are ordered as one node.  `plain` is SuperLU with its default order, for machines without pymetis.

Mixed displacement-pressure matrices are quasi-definite for Poisson ratios below 0.5.  In tests with Poisson ratios up
to 0.5 and ratios of the layers' moduli up to 1000, pivots on the diagonal were sufficient, and the default pivoting
threshold of SuperLU tripled the fill.  Every solution is refined iteratively until its residual is at the level of
rounding.

The environment variable `SOFTCOVER_SOLVER` names a backend for the whole process.
"""

from __future__ import annotations

import copy
import os
import sys
import weakref
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class SparseSettings:
    """Constants for the choice of a solver of sparse linear systems, and for the check of its solutions."""

    #: Non-zero entries in the upper triangle of a matrix from which pardiso is chosen.  Loading pardiso takes longer
    #: than solving a smaller system (2000 unknowns in 2-D, 600 in 3-D) with SuperLU [-].
    small: int = 40_000
    #: A diagonal pivot of SuperLU is replaced by an off-diagonal one if it is smaller than this fraction of the
    #: largest entry of its column [-].
    pivot: float = 1e-8
    #: Residual over the largest entry of the right-hand side below which refinement of a solution stops, near double
    #: precision [-].
    rounding: float = 1e-13
    #: Largest number of steps of iterative refinement of a solution [-].
    refinements: int = 2
    #: Residual after refinement, over the largest entry of the right-hand side, above which the matrix counts as
    #: singular [-].
    wrong: float = 1e-6


_SETTINGS = SparseSettings()


#: Names of the backends, the libraries that can solve sparse linear systems; see the top of this file.
BACKENDS = ("pardiso", "metis", "plain")


class SymmetricFactors:
    """Direct factorisation of a sparse symmetric matrix, which is given by its upper triangle.

    Args:
        backend: One of `BACKENDS`.  If None, `SOFTCOVER_SOLVER`, or else the fastest installed backend, is used.
    """

    def __init__(self, *, backend: str | None = None) -> None:
        self._wanted = backend
        self._upper = sp.csr_matrix((0, 0))
        self._engine: _Pardiso | _SuperLU

    def factorise(self, upper: sp.csr_matrix) -> SymmetricFactors:
        """Factorise a matrix; ordering and symbolic analysis are reused if its sparsity pattern has not changed.

        Args:
            upper: Upper triangle of the matrix of n unknowns, column indices ascending, every diagonal entry stored
                even where it is 0, shape (n, n).

        Returns:
            This object.

        Raises:
            ValueError: If the backend is unknown.
            ImportError: If the backend is not installed.
            numpy.linalg.LinAlgError: If the matrix is singular.
        """
        known = self._upper
        if not (np.array_equal(known.indptr, upper.indptr) and np.array_equal(known.indices, upper.indices)):
            self.backend = _choose_backend(self._wanted, upper.nnz)
            self._engine = _Pardiso(upper) if self.backend == "pardiso" else _SuperLU(upper, self.backend)
        self._upper, self._diagonal = upper, upper.diagonal()
        self._engine.factorise(upper)
        return self

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve the factorised system with iterative refinement.

        Args:
            right: One right-hand side of n unknowns or m right-hand sides, shape (n,) or (n, m).

        Returns:
            The solution, shape of `right`.

        Raises:
            numpy.linalg.LinAlgError: If the residual shows that the matrix is singular.
        """
        columns = right.reshape(len(right), -1)
        out = self._engine.solve(columns)
        size = np.abs(columns).max(initial=0.0)
        for _ in range(_SETTINGS.refinements):
            residual = columns - self._multiply(out)
            if not np.abs(residual).max(initial=0.0) > _SETTINGS.rounding * size:
                break
            out += self._engine.solve(residual)
        else:
            residual = columns - self._multiply(out)
        if not np.abs(residual).max(initial=0.0) <= _SETTINGS.wrong * size:
            raise np.linalg.LinAlgError("the system is singular: a part can move without force")
        return out.reshape(right.shape)

    def _multiply(self, x: FloatArray) -> FloatArray:
        """Multiply the whole symmetric matrix, given by its upper triangle, with the columns of x, shape (n, m)."""
        return np.asarray(self._upper @ x + self._upper.T @ x - self._diagonal[:, None] * x)


class ConstrainedSystem:
    """Symmetric linear system in which some unknowns have prescribed values; its matrix may be replaced.

    Args:
        fixed: Indices of the f prescribed unknowns, shape (f,).
        backend: One of `BACKENDS`.  If None, `SOFTCOVER_SOLVER`, or else the fastest installed backend, is used.
    """

    def __init__(self, fixed: IntArray, *, backend: str | None = None) -> None:
        self._fixed = np.unique(fixed)
        self._factors = SymmetricFactors(backend=backend)

    def factorise(self, matrix: sp.csr_matrix) -> ConstrainedSystem:
        """Factorise a symmetric matrix for `solve` and `reaction`, and return this object.

        Ordering and symbolic analysis are reused if the sparsity pattern of the matrix has not changed.

        Args:
            matrix: Whole matrix, prescribed unknowns included, shape (n, n).
        """
        self._matrix = matrix
        self._free = np.setdiff1d(np.arange(matrix.shape[0]), self._fixed)
        self._factors.factorise(_select_upper(matrix[self._free][:, self._free]))
        return self

    def solve(self, load: FloatArray, prescribed: FloatArray | float = 0.0) -> FloatArray:
        """Solve the system for the unknowns that are not prescribed.

        Args:
            load: One right-hand side of n unknowns or m right-hand sides, shape (n,) or (n, m).
            prescribed: Values of the f prescribed unknowns in ascending order of their index, shape (f,) or (f, m).

        Returns:
            Values of all unknowns, prescribed ones included, shape of `load`.
        """
        out = np.zeros_like(load)
        values = np.asarray(prescribed, dtype=float)
        out[self._fixed] = values[:, None] if values.ndim == 1 and load.ndim > 1 else values
        right = load - self._matrix @ out if values.any() else load
        out[self._free] = self._factors.solve(right[self._free])
        return out

    def reaction(self, solution: FloatArray, load: FloatArray) -> FloatArray:
        """Compute reactions at prescribed unknowns, matrix times `solution` less `load`; zero at all other unknowns."""
        out = np.zeros_like(load)
        rows = self._fixed
        out[rows] = self._matrix[rows] @ solution - load[rows]
        return out


class _Pardiso:
    """LDL^T factorisation of symmetric indefinite matrices by MKL's pardiso (matrix type -2).

    pypardiso provides one solver object for the whole process, which holds one factorisation.  Here each system has a
    copy with its own handle; the memory of the factors is released when this object is deleted.  The order of sums is
    fixed for a number of threads (MKL's conditional numerical reproducibility), so that results are equal bit by bit.
    """

    def __init__(self, upper: sp.csr_matrix) -> None:
        # MKL reads this variable at its first call.
        os.environ.setdefault("MKL_CBWR", "AUTO")
        import pypardiso

        # Creating a PyPardisoSolver searches the disk for MKL (0.2 s); copying the existing solver avoids the search.
        self._solver = copy.copy(pypardiso.ps)
        self._solver.pt = np.zeros_like(pypardiso.ps.pt)
        self._solver.iparm = np.zeros_like(pypardiso.ps.iparm)
        self._solver.set_matrix_type(-2)
        # Parameters of pardiso by index. 1: no defaults. 2: nested dissection. 8: no iterative refinement, because
        # `SymmetricFactors` refines. 10: perturb pivots below 1e-8. 11, 13: neither scaling nor matching, because these
        # need the values of the matrix before the symbolic analysis. 21: Bunch-Kaufman pivots. 34: number of threads
        # for which the order of sums is fixed.
        threads = pypardiso.ps.libmkl.MKL_Get_Max_Threads()
        for index, value in ((1, 1), (2, 2), (8, 0), (10, 8), (11, 0), (13, 0), (21, 1), (34, threads)):
            self._solver.set_iparm(index, value)
        weakref.finalize(self, self._solver.free_memory, everything=True).atexit = False
        self._upper = upper
        self._run(11, np.zeros((upper.shape[0], 1)))

    def factorise(self, upper: sp.csr_matrix) -> None:
        """Factorise the symmetric matrix with this upper triangle, shape (n, n)."""
        self._upper = upper
        self._run(22, np.zeros((upper.shape[0], 1)))

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for the m right-hand sides in the columns of `right`, shape (n, m)."""
        return self._run(33, right)

    def _run(self, phase: int, right: FloatArray) -> FloatArray:
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._solver.set_phase(phase)
        try:
            return np.asarray(self._solver._call_pardiso(self._upper, np.asfortranarray(right)))  # noqa: SLF001
        except PyPardisoError as error:
            raise np.linalg.LinAlgError(f"pardiso cannot factorise the system: {error}") from error


class _SuperLU:
    """LU factorisation of the whole matrix by SuperLU, with the unknowns ordered by METIS or by SuperLU."""

    def __init__(self, upper: sp.csr_matrix, order: str) -> None:
        count = upper.nnz
        slots = sp.csr_matrix((np.arange(1.0, count + 1), upper.indices, upper.indptr), shape=upper.shape)
        full = (slots + sp.triu(slots, 1).T).tocsr()
        full.sort_indices()
        self._order = _order_nodes(full) if order == "metis" else np.arange(full.shape[0])
        permuted = full[self._order][:, self._order].tocsc()
        self._slot = permuted.data.astype(np.int64) - 1
        self._pattern = permuted.indices, permuted.indptr
        self._options: dict[str, Any] = {}
        if order == "metis":
            self._options = {"permc_spec": "NATURAL", "diag_pivot_thresh": _SETTINGS.pivot}

    def factorise(self, upper: sp.csr_matrix) -> None:
        matrix = sp.csc_matrix((upper.data[self._slot], *self._pattern), shape=upper.shape)
        try:
            self._factor = spla.splu(matrix, **self._options)
        except RuntimeError as error:
            raise np.linalg.LinAlgError(f"SuperLU cannot factorise the system: {error}") from error

    def solve(self, right: FloatArray) -> FloatArray:
        out = np.empty_like(right)
        out[self._order] = self._factor.solve(np.ascontiguousarray(right[self._order]))
        return out


def _choose_backend(backend: str | None, entries: int) -> str:
    """Choose the backend: the given name, else `SOFTCOVER_SOLVER`, else by the number of entries of the matrix."""
    wanted = backend or os.environ.get("SOFTCOVER_SOLVER")
    if wanted:
        if wanted not in BACKENDS:
            raise ValueError(f"unknown solver {wanted!r}; known solvers: {', '.join(BACKENDS)}")
        return wanted
    if entries >= _SETTINGS.small and _can_load_pardiso():
        return "pardiso"
    return "metis" if find_spec("pymetis") else "plain"


@cache
def _can_load_pardiso() -> bool:
    """Return whether pypardiso is installed and finds the MKL library."""
    library = next(Path(sys.prefix).glob("lib/libmkl_rt*"), None)
    if library is not None:
        # Without this variable pypardiso searches the disk for the library, which takes 0.5 s.
        os.environ.setdefault("PYPARDISO_MKL_RT", str(library))
    try:
        import pypardiso  # noqa: F401
    except (ImportError, OSError):
        return False
    return True


def _select_upper(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Return the upper triangle of a matrix; every diagonal entry is stored, also zeros (incompressible materials)."""
    entries = matrix.tocoo()
    keep = entries.row <= entries.col
    every = np.arange(matrix.shape[0], dtype=entries.row.dtype)
    row, column = np.r_[entries.row[keep], every], np.r_[entries.col[keep], every]
    data = np.r_[entries.data[keep], np.zeros(len(every))]
    return sp.coo_matrix((data, (row, column)), shape=matrix.shape).tocsr()


def _order_nodes(matrix: sp.csr_matrix) -> IntArray:
    """Order the unknowns of a matrix by METIS's nested dissection (Karypis and Kumar 1998).

    Unknowns with the same neighbours in the matrix form one node of the graph that METIS orders.

    Returns:
        Indices of the unknowns in their new order, shape (n,).
    """
    import pymetis

    n = matrix.shape[0]
    label = np.random.default_rng(0).integers(0, 2**63, n, dtype=np.uint64)
    # Each column has a random label.  Rows with entries in the same columns have equal sums of labels, modulo 2^64.
    mark = np.add.reduceat(label[matrix.indices], matrix.indptr[:-1])
    group = np.unique(mark, return_inverse=True)[1]
    gather = sp.csr_matrix((np.ones(n), (group, np.arange(n))), shape=(group.max() + 1, n))
    linked = sp.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    graph = (gather @ linked @ gather.T).tocsr()
    graph.setdiag(0)
    graph.eliminate_zeros()
    order = np.asarray(pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))[0])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return np.lexsort((np.arange(n), rank[group]))
