"""Assemble Taylor-Hood hexahedra on tensor-product meshes from matrices of line elements.

On a tensor-product mesh every element integral is a product of three line integrals.  The blocks of the stiffness
matrix are therefore sums of Kronecker products of matrices along x, y and z.  The matrix equals that of `taylor_hood`
except for rounding, at a hundredth of the computing time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from fem_reference.elements.line import Line, line_matrix
from meshes.array_types import FloatArray, IntArray

#: Term of a sum of Kronecker products: its factor, and its three line matrices along x, y and z.
Term = tuple[float, Any, Any, Any]

#: Index of the displacement along z among the four fields: displacements along x, y and z, and pressure.
_NORMAL = 2
#: Index of the pressure among the four fields.
_PRESSURE = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class TensorSolid:
    """Linear elastic rectangular block of horizontal layers on a tensor-product mesh.

    The n unknowns are the displacements along x, then along y, then along z, then the mean pressure; within each of
    these four fields, the nodes along z vary fastest, then those along y.

    Attributes:
        edges: Element edges along x, y and z [m].
        layer: Index of the layer of each of the e elements along z, shape (e,).
        shear_modulus: Shear modulus of each layer [Pa].
        bulk_compliance: Reciprocal bulk modulus 1 / K of each layer, 0 for an incompressible material [1/Pa].
        order: Polynomial order of the displacement, one higher than that of the pressure [-].
        first: Index of the first unconstrained node along z for displacements along x, y and z: 1 for a fixed base.
        breaks: Indices of elements along x and along y at whose lower edge the pressure may jump.
    """

    edges: tuple[FloatArray, FloatArray, FloatArray]
    layer: IntArray
    shear_modulus: FloatArray
    bulk_compliance: FloatArray
    order: int = 2
    first: tuple[int, int, int] = (0, 0, 0)
    breaks: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())

    @cached_property
    def lines(self) -> tuple[Line, Line, Line]:
        """One-dimensional elements of the displacement along x, y and z."""
        x, y, z = (Line(edges=edges, order=self.order) for edges in self.edges)
        return x, y, z

    @cached_property
    def pressure_lines(self) -> tuple[Line, Line, Line]:
        """One-dimensional elements of the pressure along x, y and z; the pressure may jump between layers."""
        x, y = (
            Line(edges=edges, order=self.order - 1, jumps=jumps)
            for edges, jumps in zip(self.edges[:2], self.breaks, strict=True)
        )
        jumps = tuple(int(i) + 1 for i in np.flatnonzero(np.diff(self.layer)))
        return x, y, Line(edges=self.edges[2], order=self.order - 1, jumps=jumps)

    def field_shape(self, field: int) -> tuple[int, int, int]:
        """Count the free nodes along x, y and z of field 0 to 2 (displacement along x, y, z) or 3 (pressure)."""
        lines = self.pressure_lines if field == _PRESSURE else self.lines
        lowest = 0 if field == _PRESSURE else self.first[field]
        return lines[0].count, lines[1].count, lines[2].count - lowest

    @cached_property
    def offsets(self) -> IntArray:
        """Index of the first unknown of each of the four fields, then the number of unknowns, shape (5,)."""
        return np.cumsum([0, *(int(np.prod(self.field_shape(field))) for field in range(4))])

    def assemble_upper(self) -> sp.csr_matrix:
        """Assemble the upper triangle of the stiffness matrix; zeros inside its pattern are stored, shape (n, n)."""
        rows, columns, values = [], [], []
        for i in range(4):
            for j in range(i, 4):
                row, column, value = self._expand_block(i, j)
                rows.append(row + self.offsets[i])
                columns.append(column + self.offsets[j])
                values.append(value)
        size = int(self.offsets[-1])
        parts = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return sp.coo_matrix(parts, shape=(size, size)).tocsr()

    def compute_base_forces(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the forces on the free unknowns when the base is displaced along z by f(x) g(y).

        Args:
            x: Values of k functions f at the nodes along x, shape (k, nodes along x) [m].
            y: Values of k functions g at the nodes along y, shape (k, nodes along y) [-].

        Returns:
            Forces on the n free unknowns for each of the k displacements, shape (n, k).
        """
        out = np.zeros((int(self.offsets[-1]), len(x)))
        for field in range(4):
            terms = self._list_terms(min(field, _NORMAL), max(field, _NORMAL))
            if field > _NORMAL:
                terms = [(factor, a.T, b.T, c.T) for factor, a, b, c in terms]
            lowest = 0 if field == _PRESSURE else self.first[field]
            part = sum(
                factor * np.einsum("xk,yk,z->xyzk", a @ x.T, b @ y.T, c[lowest:, [0]].toarray()[:, 0], optimize=True)
                for factor, a, b, c in terms
            )
            out[self.offsets[field] : self.offsets[field + 1]] = np.asarray(part).reshape(-1, len(x))
        return out

    def _expand_block(self, i: int, j: int) -> tuple[IntArray, IntArray, FloatArray]:
        """Compute rows, columns and values of the matrix block of fields i <= j; for i = j only its upper triangle."""
        start = [0 if field == _PRESSURE else self.first[field] for field in (i, j)]
        value: FloatArray = np.zeros(1)
        place: list[Any] = []
        for factor, a, b, full in self._list_terms(i, j):
            c = full[start[0] :, start[1] :]
            value = value + factor * np.multiply.outer(a.data, np.multiply.outer(b.data, c.data)).ravel()
            place = [matrix.tocoo() for matrix in (a, b, c)]
        row, column = (
            _number_nodes([p.coords[side] for p in place], self.field_shape((i, j)[side])) for side in (0, 1)
        )
        keep = slice(None) if i != j else row <= column
        return row[keep], column[keep], value[keep]

    def _list_terms(self, i: int, j: int) -> list[Term]:
        """List the Kronecker products whose sum is the stiffness matrix between fields i <= j.

        With sigma = 2 mu dev(eps) - p I, the stiffness between displacement i with shape function a and displacement j
        with shape function b is the integral of mu (delta_ij grad a . grad b + d_j a d_i b - 2/3 d_i a d_j b).
        """
        if i == j == _PRESSURE:
            return [(-1.0, *self._select("pressure"))]
        if j == _PRESSURE:
            return [(-1.0, *self._select("volume", {i: "divergence"}))]
        if i == j:
            return [(4 / 3 if k == i else 1.0, *self._select("mass", {k: "stiffness"})) for k in range(3)]
        return [
            (1.0, *self._select("mass", {i: "right", j: "left"})),
            (-2 / 3, *self._select("mass", {i: "left", j: "right"})),
        ]

    def _select(self, usual: str, special: dict[int, str] | None = None) -> tuple[Any, Any, Any]:
        """Select the matrices of the one-dimensional elements along x, y and z by name.

        Args:
            usual: Name of the matrix for all axes that are not in `special`.
            special: Name of the matrix by axis.
        """
        x, y, z = (self._matrices[axis][(special or {}).get(axis, usual)] for axis in range(3))
        return x, y, z

    @cached_property
    def _matrices(self) -> list[dict[str, sp.csr_matrix]]:
        """Matrices of the one-dimensional elements of each axis, by name.

        The moduli vary only along z, so that they are factors of the matrices along z.
        """
        out = []
        for axis, (u, p) in enumerate(zip(self.lines, self.pressure_lines, strict=True)):
            one = np.ones(len(u.edges) - 1)
            mu = self.shear_modulus[self.layer] if axis == _NORMAL else one
            soft = self.bulk_compliance[self.layer] if axis == _NORMAL else one
            out.append(
                {
                    "mass": line_matrix(u, u, (0, 0), mu),
                    "stiffness": line_matrix(u, u, (1, 1), mu),
                    "left": line_matrix(u, u, (1, 0), mu),
                    "right": line_matrix(u, u, (0, 1), mu),
                    "divergence": line_matrix(u, p, (1, 0), one),
                    "volume": line_matrix(u, p, (0, 0), one),
                    "pressure": line_matrix(p, p, (0, 0), soft),
                }
            )
        return out


def _number_nodes(parts: list[Any], shape: tuple[int, int, int]) -> IntArray:
    """Compute the node numbers of all combinations of node indices along x, y and z.

    Args:
        parts: Node indices along x, along y and along z.
        shape: Number of nodes along x, y and z.

    Returns:
        Node numbers, in the order in which z varies fastest.
    """
    x, y, z = (np.asarray(part, dtype=np.int64) for part in parts)
    across = (x[:, None] * shape[1] + y) * shape[2]
    return np.asarray((across.ravel()[:, None] + z).ravel())
