"""Linear elastic solid of a curved cover, with one factorisation for many loads and prescribed motions of the base.

Displacements are quadratic and the mean stress is linear and continuous (Taylor-Hood), on hexahedra with quadratic
geometry or on tetrahedra, so that Poisson ratios up to 0.5 are possible.  The unknowns are the displacements along x of
all nodes, then along y, then along z, then the mean stresses.  The matrix is assembled with lengths over the thickness
and stresses over the shear modulus: with SI units the pivots of the mean stress would be lost in rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem

from fem_reference.elements.taylor_hood import MixedElements, prepare_elements
from fem_reference.sparse_solver import SymmetricFactors
from meshes import Material
from meshes.array_types import FloatArray, IntArray
from meshes.solids.solid_mesh import SolidMesh, compute_volume, measure_area

#: Number of right-hand sides that are solved at once, to limit the memory [-].
_COLUMNS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class DisplacementNodes:
    """Nodes of the quadratic displacement on a solid mesh.

    Attributes:
        elements: Elements of the mesh.
        base: Indices of the nodes of the facets of the base, shape (b, 9) or (b, 6).
        top: Indices of the nodes of the facets of the top, shape (t, 9) or (t, 6).
    """

    elements: MixedElements
    base: IntArray
    top: IntArray

    @classmethod
    def on(cls, mesh: SolidMesh) -> DisplacementNodes:
        """Place the nodes: those of the mesh on hexahedra; corners and middles of edges on tetrahedra."""
        if mesh.is_hexahedral:
            return cls(elements=_prepare_hexahedra(mesh), base=mesh.base, top=mesh.top)
        elements = prepare_elements(skfem.MeshTet1(mesh.nodes.T.copy(), mesh.cells.T.copy()))
        base, top = (_add_middles(elements, facets) for facets in (mesh.base, mesh.top))
        return cls(elements=elements, base=base, top=top)


class CoverSolid:
    """Factorised linear elastic cover, bonded to its base, with a free surface elsewhere.

    Args:
        mesh: Mesh of the cover.
        material: Material; hyperelastic materials are linearised at zero load.
    """

    def __init__(self, mesh: SolidMesh, material: Material) -> None:
        self.mesh, self.material = mesh, material
        self.layout = DisplacementNodes.on(mesh)
        self.nodes = self.layout.elements.nodes
        self._length = compute_volume(mesh) / measure_area(mesh, "base")
        self._force = material.shear_modulus * self._length**2
        stiffness_ratio = material.shear_modulus / material.bulk_modulus
        upper = assemble_upper(scale_elements(self.layout.elements, 1 / self._length), 1.0, stiffness_ratio)
        self.base = np.unique(self.layout.base)
        self.top = np.unique(self.layout.top)
        count = len(self.nodes)
        fixed = (np.arange(3)[:, None] * count + self.base).ravel()
        self._free = np.setdiff1d(np.arange(upper.shape[0]), fixed)
        self._upper, self._diagonal = upper, upper.diagonal()

    @property
    def unknowns(self) -> int:
        """Number of free unknowns [-]."""
        return len(self._free)

    @cached_property
    def _factors(self) -> SymmetricFactors:
        inner = self._upper[self._free][:, self._free].tocsr()
        inner.sort_indices()
        return SymmetricFactors().factorise(inner)

    def solve(self, nodes: IntArray, *, forces: FloatArray | None = None, base: FloatArray | None = None) -> FloatArray:
        """Solve for the displacements of some nodes under k loads or motions of the base.

        Args:
            nodes: Indices of the m nodes whose displacements are wanted, shape (m,).
            forces: Forces on all n nodes, shape (k, n, 3) [N]; None for none.
            base: Displacements of the nodes of the base, shape (k, nodes of the base, 3) [m]; None for a fixed base.

        Returns:
            Displacements, shape (k, m, 3) [m].
        """
        cases = len(forces if forces is not None else base)  # type: ignore[arg-type]
        out = np.empty((cases, len(nodes), 3))
        for start in range(0, cases, _COLUMNS):
            part = slice(start, min(start + _COLUMNS, cases))
            whole = self._solve_block(
                part.stop - start, None if forces is None else forces[part], None if base is None else base[part]
            )
            out[part] = whole[:, nodes]
        return out

    def solve_fully(self, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Solve for the displacements under one load and the reactions of the base.

        Args:
            forces: Forces on all n nodes, shape (n, 3) [N].

        Returns:
            Displacements of all n nodes, shape (n, 3) [m], and forces of the base on the cover at the nodes of the
            base, shape (nodes of the base, 3) [N].
        """
        count = len(self.nodes)
        right, out = np.zeros((2, self._upper.shape[0]))
        right[: 3 * count] = forces.T.ravel() / self._force
        out[self._free] = self._factors.solve(right[self._free])
        reaction = (self._multiply(out[:, None])[:, 0] - right)[: 3 * count].reshape(3, count).T[self.base]
        return out[: 3 * count].reshape(3, count).T * self._length, reaction * self._force

    def _solve_block(self, cases: int, forces: FloatArray | None, base: FloatArray | None) -> FloatArray:
        """Solve for the displacements of all n nodes under k loads, shape (k, n, 3) [m]."""
        count = len(self.nodes)
        right, out = np.zeros((2, self._upper.shape[0], cases))
        if forces is not None:
            right[: 3 * count] = forces.transpose(2, 1, 0).reshape(3 * count, cases) / self._force
        if base is not None:
            for axis in range(3):
                out[axis * count + self.base] = base[:, :, axis].T / self._length
            right -= self._multiply(out)
        out[self._free] = self._factors.solve(right[self._free])
        return np.asarray(out[: 3 * count].reshape(3, count, cases).transpose(2, 1, 0) * self._length)

    def _multiply(self, x: FloatArray) -> FloatArray:
        """Multiply the whole matrix with the columns of x."""
        return np.asarray(self._upper @ x + self._upper.T @ x - self._diagonal[:, None] * x)


def assemble_upper(elements: MixedElements, shear_modulus: float, bulk_compliance: float) -> sp.csr_matrix:
    """Assemble the upper triangle of the matrix of a cover of one material, node by node (see `assemble_linear`).

    With D_ik the integral of mu d_i a d_k b, the block of displacement components i and k is
    delta_ik (D_xx + D_yy + D_zz) + D_ki - 2/3 D_ik.  All blocks share the sparsity pattern of the nodes.

    Args:
        elements: Elements of the mesh.
        shear_modulus: Shear modulus mu [Pa].
        bulk_compliance: 1 / K, 0 for an incompressible material [1/Pa].

    Returns:
        Upper triangle; every diagonal entry is stored, shape (unknowns, unknowns).
    """
    slope = elements.slope.transpose(3, 0, 2, 1)  # component, element, function, point
    weighted = slope * (shear_modulus * elements.weight)[:, None, :]
    product = {(i, k): weighted[i] @ slope[k].transpose(0, 2, 1) for i in range(3) for k in range(i, 3)}
    trace = product[0, 0] + product[1, 1] + product[2, 2]
    nodes, pressures = elements.cells, elements.pressure_cells
    size = len(elements.nodes), elements.pressures
    square = _Scatter(nodes, nodes, (size[0], size[0]))
    mixed = _Scatter(nodes, pressures, size)
    shape = elements.pressure_shape
    volume = (shape * elements.weight[..., None]).transpose(0, 2, 1) @ shape * -bulk_compliance
    blocks: list[list[sp.csr_matrix | None]] = [[None] * 4 for _ in range(4)]
    for i in range(3):
        blocks[i][i] = sp.triu(square.sum(trace + product[i, i] / 3), format="csr")
        for k in range(i + 1, 3):
            blocks[i][k] = square.sum(product[i, k].transpose(0, 2, 1) - 2 / 3 * product[i, k])
        divergence = (slope[i] * elements.weight[:, None, :]) @ shape
        blocks[i][3] = mixed.sum(-divergence)
    blocks[3][3] = sp.triu(_Scatter(pressures, pressures, (size[1], size[1])).sum(volume), format="csr")
    upper: Any = sp.bmat(blocks, format="csr")
    upper.sort_indices()
    return sp.csr_matrix(upper)


def scale_elements(elements: MixedElements, factor: float) -> MixedElements:
    """Scale the size of three-dimensional elements; their basis keeps its size."""
    return replace(
        elements,
        nodes=elements.nodes * factor,
        slope=elements.slope / factor,
        weight=elements.weight * factor**3,
    )


class _Scatter:
    """Sum of element matrices into a sparse matrix; the pattern is computed once for several sums.

    Args:
        rows: Row of each of a functions of e elements, shape (e, a).
        columns: Column of each of b functions, shape (e, b).
        shape: Shape of the sparse matrix.
    """

    def __init__(self, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> None:
        keys, self._slot = np.unique(rows[:, :, None] * shape[1] + columns[:, None, :], return_inverse=True)
        self._indices = (keys % shape[1]).astype(np.int32)
        self._pointer = np.searchsorted(keys // shape[1], np.arange(shape[0] + 1)).astype(np.int32)
        self._shape = shape

    def sum(self, values: FloatArray) -> sp.csr_matrix:
        """Sum element matrices, shape (e, a, b); zeros are stored."""
        data = np.bincount(self._slot.ravel(), values.ravel(), minlength=len(self._indices))
        return sp.csr_matrix((data, self._indices, self._pointer), shape=self._shape)


def _prepare_hexahedra(mesh: SolidMesh) -> MixedElements:
    """Prepare elements with quadratic geometry whose displacement nodes are the nodes of the mesh."""
    corners = np.round(2 * skfem.ElementHex1().doflocs) @ [1, 3, 9]
    order = (np.round(2 * skfem.ElementHex2().doflocs) @ [1, 3, 9]).astype(np.int64)
    used, vertices = np.unique(mesh.cells[:, corners.astype(np.int64)], return_inverse=True)
    straight = skfem.MeshHex1(
        np.ascontiguousarray(mesh.nodes[used].T), vertices.reshape(len(mesh.cells), 8).T.copy(), validate=False
    )
    curved = skfem.MeshHex2.from_mesh(straight)
    cells = mesh.cells[:, order]
    places = np.empty_like(curved.doflocs)
    places[:, curved.dofs.element_dofs.ravel()] = mesh.nodes[cells.T.ravel()].T
    elements = prepare_elements(replace(curved, doflocs=places))
    return replace(elements, nodes=mesh.nodes, cells=cells)


def _add_middles(elements: MixedElements, facets: IntArray) -> IntArray:
    """Add the nodes in the middles of the sides to triangles of 3 corners; returns indices of shape (f, 6)."""
    pairs = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))  # order of scikit-fem's edge functions
    count = len(elements.nodes)
    ends = np.sort(np.stack([elements.cells[:, list(pair)] for pair in pairs], axis=1), axis=2)
    keys, first = np.unique((ends[..., 0] * count + ends[..., 1]).ravel(), return_index=True)
    middle = elements.cells[:, 4:].ravel()[first]
    sides = np.sort(np.stack([facets[:, list(pair)] for pair in ((0, 1), (1, 2), (2, 0))], axis=1), axis=2)
    found = np.searchsorted(keys, sides[..., 0] * count + sides[..., 1])
    return np.concatenate([facets, middle[found]], axis=1)
