"""Lagrange elements and Gauss quadrature along one direction.

On a tensor-product mesh every element integral is a product of integrals along lines; `tensor_product` builds its
matrices from the line matrices of this module.  The base nodes lie on one line (axisymmetric meshes) or on a grid of
two lines; `recover_pressure` computes the base pressure from the nodal forces at these nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """Lagrange elements along one direction.

    Attributes:
        edges: Element edges, ascending, shape (e + 1,) [m].
        order: Polynomial order of the shape functions [-].
        jumps: Indices of elements at whose lower edge functions may be discontinuous; the node at this edge is doubled.
    """

    edges: FloatArray
    order: int
    jumps: tuple[int, ...] = ()

    @cached_property
    def index(self) -> IntArray:
        """Indices of the nodes of each of the e elements of the line, shape (e, order + 1)."""
        element = np.arange(len(self.edges) - 1)
        extra = np.isin(element, self.jumps).cumsum()
        return np.asarray((element * self.order + extra)[:, None] + np.arange(self.order + 1), dtype=np.int64)

    @property
    def count(self) -> int:
        """Number of nodes on the line [-]."""
        return int(self.index[-1, -1]) + 1

    @cached_property
    def reference(self) -> FloatArray:
        """Nodes of the reference element -1..1: its ends and the Legendre polynomial's extrema, shape (order + 1,)."""
        inner = np.polynomial.legendre.Legendre.basis(self.order).deriv().roots()
        return np.concatenate([[-1.0], np.asarray(inner.real, dtype=float), [1.0]])

    @property
    def nodes(self) -> FloatArray:
        """Positions of all nodes on the line, shape (count,) [m]."""
        out = np.zeros(self.count)
        start, length = self.edges[:-1, None], np.diff(self.edges)[:, None]
        out[self.index] = start + length * (self.reference + 1) / 2
        return out

    def shape(self, points: FloatArray, derivative: int = 0) -> FloatArray:
        """Evaluate the shape functions of the reference element -1..1, or their first derivatives.

        Args:
            points: Positions on the reference element, shape (points,) [-].
            derivative: 1 for the first derivatives, 0 for the functions.

        Returns:
            Values, shape (points, order + 1) [-].
        """
        coefficients = np.linalg.inv(np.vander(self.reference, increasing=True))
        powers = np.vander(points, self.order + 1, increasing=True)
        if derivative:
            powers = np.column_stack([np.zeros(len(points)), powers[:, :-1] * np.arange(1, self.order + 1)])
        return np.asarray(powers @ coefficients)

    def find(self, places: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find the element at each of k positions on the line, shape (k,) [m].

        Returns:
            Indices of the nodes of the element and values of its shape functions, shape (k, order + 1) each.
        """
        element = np.clip(np.searchsorted(self.edges, places, side="right") - 1, 0, len(self.edges) - 2)
        start, length = self.edges[element], np.diff(self.edges)[element]
        return self.index[element], self.shape(2 * (places - start) / length - 1)

    def at(self, places: FloatArray) -> FloatArray:
        """Evaluate the shape functions of all nodes at k positions on the line, shape (k, count)."""
        out = np.zeros((len(places), self.count))
        nodes, values = self.find(places)
        np.put_along_axis(out, nodes, values, axis=1)
        return out

    def integral(self, low: float, high: float) -> FloatArray:
        """Integrate the shape functions of all nodes over the interval from `low` to `high`, shape (count,) [m]."""
        start, end = np.clip(low, self.edges[:-1], self.edges[1:]), np.clip(high, self.edges[:-1], self.edges[1:])
        points, weights = np.polynomial.legendre.leggauss(self.order + 1)
        x = start[:, None] + np.maximum(end - start, 0)[:, None] * (points + 1) / 2
        local = 2 * (x - self.edges[:-1, None]) / np.diff(self.edges)[:, None] - 1
        values = self.shape(local.ravel()).reshape(*x.shape, -1)
        part = np.einsum("eqa,q,e->ea", values, weights / 2, np.maximum(end - start, 0))
        out = np.zeros(self.count)
        np.add.at(out, self.index, part)
        return out


def interpolation_matrix(x_line: Line, y_line: Line, x: FloatArray, y: FloatArray) -> sp.csr_matrix:
    """Create the matrix that interpolates nodal values on the grid of two lines at k positions.

    Args:
        x_line: Elements along x, with m nodes.
        y_line: Elements along y, with n nodes.
        x: x coordinates of the positions, shape (k,) [m].
        y: y coordinates of the positions, shape (k,) [m].

    Returns:
        Matrix for nodal values of shape (m, n), flattened, shape (k, m * n).
    """
    (along_x, in_x), (along_y, in_y) = x_line.find(x), y_line.find(y)
    nodes = (along_x[:, :, None] * y_line.count + along_y[:, None, :]).ravel()
    values = (in_x[:, :, None] * in_y[:, None, :]).ravel()
    rows = np.repeat(np.arange(len(x)), in_x.shape[1] * in_y.shape[1])
    return sp.csr_matrix((values, (rows, nodes)), shape=(len(x), x_line.count * y_line.count))


def line_matrix(
    test: Line,
    trial: Line,
    derivatives: tuple[int, int] = (0, 0),
    weight: FloatArray | float = 1.0,
    *,
    axisymmetric: bool = False,
) -> sp.csr_matrix:
    """Integrate the products of test and trial functions along a line.

    Args:
        test: Elements whose shape functions belong to the rows.
        trial: Elements whose shape functions belong to the columns, with the same element edges.
        derivatives: 1 to differentiate the test or the trial functions, 0 not to.
        weight: Factor on the integrals over each of the e elements, shape (e,), or one factor for all elements.
        axisymmetric: Whether the line is a radius, so that the integrand is multiplied by 2 pi r.

    Returns:
        Matrix of the integrals, shape (test nodes, trial nodes).  Zeros between functions of one element are stored.
    """
    points, weights = np.polynomial.legendre.leggauss(max(test.order, trial.order) + 1)
    left, right = test.shape(points, derivatives[0]), trial.shape(points, derivatives[1])
    half = np.diff(test.edges)[:, None] / 2
    ring = 2 * np.pi * (test.edges[:-1, None] + half * (points + 1)) if axisymmetric else 1.0
    factor = np.reshape(weight, (-1, 1)) * half ** (1 - sum(derivatives)) * weights * ring
    block = np.einsum("eq,qa,qb->eab", factor, left, right)
    return sum_blocks(block, test.index, trial.index, (test.count, trial.count))


def sum_blocks(blocks: FloatArray, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> sp.csr_matrix:
    """Sum the matrices of e elements into one sparse matrix; zeros in the matrices are stored.

    Args:
        blocks: Matrix of every element, shape (e, a, b).
        rows: Row of the sparse matrix to which each row of an element's matrix is added, shape (e, a).
        columns: Column of the sparse matrix for each column of an element's matrix, shape (e, b).
        shape: Shape of the sparse matrix.
    """
    i, j = (np.broadcast_to(each, blocks.shape).ravel() for each in (rows[:, :, None], columns[:, None, :]))
    return sp.coo_matrix((blocks.ravel(), (i, j)), shape=shape).tocsr()


def recover_pressure(lines: Sequence[Line], forces: FloatArray, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the continuous pressure on the base whose consistent nodal forces are given.

    The mass matrix of the base faces on a tensor-product mesh is the Kronecker product of one line mass matrix per
    direction, so the line mass matrices are inverted one after the other.

    Args:
        lines: Elements along each direction of the base.
        forces: Nodal forces on the base, one array axis for each line [N].
        axisymmetric: Whether the only line is a radius and the forces are those of whole rings.

    Returns:
        Nodal pressures, shape of `forces` [Pa].
    """
    value = forces
    for axis, line in enumerate(lines):
        mass = line_matrix(line, line, axisymmetric=axisymmetric).toarray()
        value = np.moveaxis(np.linalg.solve(mass, np.moveaxis(value, axis, 0)), 0, axis)
    return value


def gauss_points(edges: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Compute Gauss points and weights on each interval between neighbouring edges.

    Args:
        edges: Ends of the e intervals, ascending, shape (e + 1,) [m].
        count: Number of points in each interval [-].

    Returns:
        Points and weights, shape (e * count,) each [m].
    """
    points, weights = np.polynomial.legendre.leggauss(count)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (points + 1)).ravel(), (half * weights).ravel()
