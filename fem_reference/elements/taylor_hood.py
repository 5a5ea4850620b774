"""Mixed displacement-pressure elements (Taylor-Hood): quadratic displacement, linear pressure.

scikit-fem provides meshes, shape functions, mappings and quadrature.  This module assembles element matrices by array
operations on all elements at once, which is much faster than scikit-fem's assembly of vector-valued forms.  A region is
the part of the mesh with one material. The pressure unknown is the mean stress.  It is continuous inside a region and
may be discontinuous between regions, because the mean stress is discontinuous where two materials meet.

The displacement gradient at a point is stored as a vector of components: (rr, rz, zr, zz, tt) for axisymmetric meshes
with coordinates (r, z), and the nine entries of the 3 x 3 matrix, row by row, in three dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import skfem

from fem_reference.materials import EVERY_PLACE
from meshes.array_types import FloatArray, IntArray

#: Elements of scikit-fem for displacement and for pressure, by the kind of mesh.
_ELEMENTS = {
    skfem.MeshTri1: (skfem.ElementTriP2, skfem.ElementTriP1),
    skfem.MeshQuad1: (skfem.ElementQuad2, skfem.ElementQuad1),
    skfem.MeshTet1: (skfem.ElementTetP2, skfem.ElementTetP1),
    skfem.MeshTet2: (skfem.ElementTetP2, skfem.ElementTetP1),
    skfem.MeshHex1: (skfem.ElementHex2, skfem.ElementHex1),
    skfem.MeshHex2: (skfem.ElementHex2, skfem.ElementHex1),
}
#: Row and column of each component of an axisymmetric displacement gradient: rr, rz, zr, zz, tt.
_AXISYMMETRIC = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))
#: Slice that selects all elements of a mesh.
_ALL = slice(None)


@dataclass(frozen=True, kw_only=True, eq=False)
class MixedElements:
    """Taylor-Hood elements of a mesh, as arrays for assembly.

    Shapes are written with e elements, q quadrature points per element, a displacement nodes per element, b pressure
    unknowns per element and g stored components of the displacement gradient.

    Attributes:
        dimension: Displacement components per node, 2 or 3 [-].
        nodes: Positions of the n displacement nodes, shape (n, dimension) [m].
        cells: Indices of the displacement nodes of each element, shape (e, a).
        pressure_cells: Indices of the pressure unknowns of each element, shape (e, b).
        region: Index of the material of each element, shape (e,).
        slope: Derivatives of the displacement shape functions, shape (e, q, a, dimension) [1/m].
        hoop: Displacement shape functions over the radius in axisymmetric meshes, shape (e, q, a) [1/m]; else None.
        pressure_shape: Values of the pressure shape functions, shape (e, q, b) [-].
        weight: Volume of each quadrature point, with the factor 2 pi r in axisymmetric meshes, shape (e, q) [m3].
        basis: scikit-fem basis of one displacement component.
        places: Row and column of each stored component in the 3 x 3 displacement gradient.
    """

    dimension: int
    nodes: FloatArray
    cells: IntArray
    pressure_cells: IntArray
    region: IntArray
    slope: FloatArray
    hoop: FloatArray | None
    pressure_shape: FloatArray
    weight: FloatArray
    basis: skfem.CellBasis
    places: tuple[tuple[int, int], ...]

    @property
    def displacements(self) -> int:
        """Number of displacement unknowns; the index of one is `dimension * node + component` [-]."""
        return self.nodes.size

    @property
    def pressures(self) -> int:
        """Number of pressure unknowns; their indices follow those of the displacement unknowns [-]."""
        return int(self.pressure_cells.max()) + 1

    @cached_property
    def unknowns(self) -> IntArray:
        """Indices of the displacement unknowns of each element, shape (e, a * dimension)."""
        each = self.dimension * self.cells[:, :, None] + np.arange(self.dimension)
        return each.reshape(len(self.cells), -1)

    def compute_gradient(self, displacement: FloatArray, part: slice = _ALL) -> FloatArray:
        """Compute the stored components of the displacement gradient at the quadrature points, shape (e, q, g) [-].

        Args:
            displacement: Displacement unknowns, which pressure unknowns may follow, shape (unknowns,) [m].
            part: Elements for which to compute the gradient.
        """
        u = displacement[self.unknowns[part]].reshape(-1, self.cells.shape[1], self.dimension)
        e, q, _, _ = self.slope[part].shape
        flat = np.matmul(u.transpose(0, 2, 1)[:, None], self.slope[part]).reshape(e, q, -1)
        if self.hoop is None:
            return np.asarray(flat)
        return np.concatenate([flat, np.matmul(self.hoop[part], u[..., :1])], axis=2)

    def integrate_force(self, stress: FloatArray, part: slice = _ALL) -> FloatArray:
        """Integrate a stress field to nodal forces of each element (the transpose of `compute_gradient`).

        Args:
            stress: Stress components times quadrature weights, shape (e, q, g) [N m].
            part: Elements that the stress belongs to.

        Returns:
            Force on each displacement unknown of each element, shape (e, a * dimension) [N].
        """
        e, q, _ = stress.shape
        d = self.dimension
        square = stress[..., : d * d].reshape(e, q, d, d).transpose(0, 1, 3, 2)
        slope = self.slope[part].transpose(0, 2, 1, 3).reshape(e, -1, q * d)
        out = np.matmul(slope, square.reshape(e, q * d, d))
        if self.hoop is not None:
            out[..., 0] += np.matmul(self.hoop[part].transpose(0, 2, 1), stress[..., -1:])[..., 0]
        return np.asarray(out.reshape(e, -1))

    def integrate_coupling(self, stress: FloatArray, part: slice = _ALL) -> FloatArray:
        """Integrate a stress per unit pressure, times each pressure shape function, to nodal forces of each element.

        Args:
            stress: Stress components per pressure times quadrature weights, shape (e, q, g) [m3].
            part: Elements that the stress belongs to.

        Returns:
            Force on each displacement unknown per pressure unknown, shape (e, a * dimension, b) [m2].
        """
        d = self.dimension
        square = stress[..., : d * d].reshape(*stress.shape[:2], d, d)
        out = np.matmul(self.slope[part], square.transpose(0, 1, 3, 2))
        if self.hoop is not None:
            out[..., 0] += self.hoop[part] * stress[..., -1:]
        along = out.reshape(*stress.shape[:2], -1)
        return np.asarray(np.matmul(along.transpose(0, 2, 1), self.pressure_shape[part]))

    def integrate_stiffness(self, moduli: FloatArray, part: slice = _ALL) -> FloatArray:
        """Integrate tangent moduli to the stiffness matrix of each element.

        Args:
            moduli: Derivatives of stress with respect to displacement gradient, symmetric, times quadrature weights,
                shape (e, q, g, g) [N m].
            part: Elements that the moduli belong to.

        Returns:
            Stiffness between the displacement unknowns of each element, shape (e, a * dimension, a * dimension) [N/m].
        """
        slope = self.slope[part]
        if self.hoop is not None:
            gradient = _build_axisymmetric_gradient(slope, self.hoop[part])
            e, q, g, i = gradient.shape
            left = gradient.reshape(e, q * g, i).transpose(0, 2, 1)
            return np.asarray(np.matmul(left, np.matmul(moduli, gradient).reshape(e, q * g, i)))
        e, q, a, d = slope.shape
        right = slope.transpose(0, 1, 3, 2).reshape(e, q * d, a)
        out = np.empty((e, a, d, a, d))
        tensor = moduli.reshape(*slope.shape[:2], d, d, d, d)
        for i in range(d):
            for k in range(i, d):
                # Gradient times moduli times gradient, summed over the points of each element as one batched product.
                left = np.matmul(slope, np.ascontiguousarray(tensor[:, :, i, :, k, :]))
                block = np.matmul(left.transpose(0, 2, 1, 3).reshape(e, a, q * d), right)
                out[:, :, i, :, k] = block
                out[:, :, k, :, i] = block.transpose(0, 2, 1)
        return out.reshape(e, a * d, a * d)


def mesh_layers(across: Sequence[FloatArray], heights: FloatArray, layer: IntArray) -> tuple[skfem.Mesh, IntArray]:
    """Build the tensor-product mesh of a layered cover.

    Args:
        across: Element edges along the radius, or along x and along y [m].
        heights: Element edges along z [m].
        layer: Index of the layer of each element along z.

    Returns:
        Mesh of quadrilaterals or hexahedra, and index of the layer of each element of the mesh.
    """
    kind = skfem.MeshQuad if len(across) == 1 else skfem.MeshHex
    mesh = kind.init_tensor(*across, heights)
    row = np.searchsorted(heights, mesh.p[-1][mesh.t].mean(axis=0)) - 1
    return mesh, layer[row]


def prepare_elements(
    mesh: skfem.Mesh, *, region: IntArray | None = None, axisymmetric: bool = False, order: int = 4
) -> MixedElements:
    """Prepare Taylor-Hood elements on a mesh.

    Args:
        mesh: Linear triangles, quadrilaterals, tetrahedra or hexahedra, or quadratic tetrahedra or hexahedra [m].
        region: Index of the material of each of the e elements, shape (e,); None for one material.
        axisymmetric: Whether the mesh lies in the r-z plane of an axisymmetric body.
        order: Largest polynomial order that the quadrature integrates exactly [-].

    Raises:
        ValueError: If no elements are defined for the kind of mesh, a two-dimensional mesh is not axisymmetric, or a
            three-dimensional mesh is axisymmetric.
    """
    if type(mesh) not in _ELEMENTS:
        raise ValueError(f"no mixed element for {type(mesh).__name__}; use {[m.__name__ for m in _ELEMENTS]}")
    if (mesh.dim() == 2) != axisymmetric:  # noqa: PLR2004
        raise ValueError("two-dimensional meshes must be axisymmetric, three-dimensional ones must not")
    quadratic, linear = _ELEMENTS[type(mesh)]
    basis = skfem.Basis(mesh, quadratic(), intorder=order)
    pressure = skfem.Basis(mesh, linear(), intorder=order)
    material = np.zeros(mesh.nelements, dtype=np.int64) if region is None else np.asarray(region, np.int64)
    shape = evaluate_shapes(basis)
    # The axes of this array are dimension, element, quadrature point and node.
    slope = np.stack([np.asarray(basis.basis[a][0].grad) for a in range(basis.Nbfun)], axis=-1)
    position = np.asarray(basis.global_coordinates())
    return MixedElements(
        dimension=mesh.dim(),
        nodes=np.ascontiguousarray(basis.doflocs.T),
        cells=basis.element_dofs.T.astype(np.int64),
        pressure_cells=_split_by_region(pressure.element_dofs.T.astype(np.int64), material),
        region=material,
        slope=np.ascontiguousarray(slope.transpose(1, 2, 3, 0)),
        hoop=shape / position[0][:, :, None] if axisymmetric else None,
        pressure_shape=evaluate_shapes(pressure),
        weight=basis.dx * (2 * np.pi * position[0] if axisymmetric else 1.0),
        basis=basis,
        places=_AXISYMMETRIC if axisymmetric else EVERY_PLACE,
    )


def assemble_linear(elements: MixedElements, shear_modulus: FloatArray, bulk_compliance: FloatArray) -> sp.csr_matrix:
    """Assemble the matrix of linear elasticity in displacement and mean pressure, for Poisson ratios from 0 to 0.5.

    sigma = 2 mu dev(eps) - p I and p = -K div u with K = 2 mu (1 + nu) / 3 (1 - 2 nu).  With p as an unknown only 1 / K
    appears, which is 0 for an incompressible material (Hughes, The Finite Element Method, section 4.4).

    Args:
        elements: Elements of the mesh.
        shear_modulus: Shear modulus mu of each region [Pa].
        bulk_compliance: 1 / K of each region, 0 for an incompressible material [1/Pa].

    Returns:
        Symmetric indefinite matrix; displacement unknowns come first, then pressure unknowns.
    """
    mu = np.asarray(shear_modulus)[elements.region]
    inverse = np.asarray(bulk_compliance)[elements.region]
    w = elements.weight
    moduli = (2 * mu[:, None] * w)[:, :, None, None] * _build_deviator(elements.places)
    identity = np.broadcast_to(np.array([float(i == j) for i, j in elements.places]), (*w.shape, len(elements.places)))
    couple = -elements.integrate_coupling(identity * w[..., None])
    volume = -np.einsum(
        "eqa,eqb,eq->eab",
        elements.pressure_shape,
        elements.pressure_shape,
        w * inverse[:, None],
        optimize=True,
    )
    return Pattern(elements).assemble(elements.integrate_stiffness(moduli), couple, volume)


class Pattern:
    """Sparsity pattern of the global matrix and positions of the element matrices, computed once for many assemblies.

    Args:
        elements: Elements of the mesh.
    """

    def __init__(self, elements: MixedElements) -> None:
        d, nodes, size = elements.dimension, len(elements.nodes), elements.displacements + elements.pressures
        self._split, self._shape = elements.unknowns.shape[1], (size, size)
        # Points are displacement nodes with d unknowns each, followed by pressure unknowns.  Pairs of points are far
        # fewer than pairs of unknowns.
        points = np.concatenate([elements.cells, elements.pressure_cells + nodes], axis=1)
        count = nodes + elements.pressures
        width = np.where(np.arange(count) < nodes, d, 1)
        first = np.cumsum(width) - width
        pairs = points[:, :, None] * count + points[:, None, :]
        # `return_index` makes numpy sort by merging, which takes half the time because these keys are partly sorted.
        keys, _, slot = np.unique(pairs, return_index=True, return_inverse=True)
        row, column = np.divmod(keys, count)
        before = np.cumsum(width[column]) - width[column]
        # Number of matrix entries that precede the pair in its row.
        along = before - before[np.searchsorted(row, np.arange(count))][row]
        length = np.bincount(row, width[column], minlength=count).astype(np.int64)
        pointer = np.concatenate([[0], np.cumsum(np.repeat(length, width))])
        local = np.repeat(np.arange(points.shape[1]), width[points[0]])
        component = np.arange(len(local)) - np.searchsorted(local, local)
        place = (pointer[first[row]] + along)[slot.reshape(pairs.shape)][:, local][:, :, local]
        self._slot = place + component[:, None] * length[points[:, local]][:, :, None] + component
        index = np.empty(pointer[-1], dtype=np.int32)
        index[self._slot] = (first[points[:, local]] + component)[:, None, :]
        self._index = index, pointer.astype(np.int32)

    def assemble(self, stiff: FloatArray, couple: FloatArray, volume: FloatArray) -> sp.csr_matrix:
        """Sum the matrices of e elements into the global symmetric matrix.

        Args:
            stiff: Blocks between the i displacement unknowns of each element, shape (e, i, i).
            couple: Blocks between displacement and pressure unknowns, shape (e, i, b).
            volume: Blocks between the b pressure unknowns of each element, shape (e, b, b).

        Returns:
            Matrix over all displacement unknowns, then all pressure unknowns.
        """
        n = self._split
        block = np.empty(self._slot.shape)
        block[:, :n, :n] = stiff
        block[:, :n, n:] = couple
        block[:, n:, :n] = couple.transpose(0, 2, 1)
        block[:, n:, n:] = volume
        index, pointer = self._index
        data = np.bincount(self._slot.ravel(), block.ravel(), minlength=len(index))
        return sp.csr_matrix((data, index.copy(), pointer.copy()), shape=self._shape)


def _build_deviator(places: tuple[tuple[int, int], ...]) -> FloatArray:
    """Build the matrix that maps a displacement gradient of g components to the deviatoric strain, shape (g, g) [-]."""
    out = np.zeros((len(places), len(places)))
    for row, (i, j) in enumerate(places):
        for column, (k, m) in enumerate(places):
            symmetric = ((i, j) == (k, m)) / 2 + ((i, j) == (m, k)) / 2
            out[row, column] = symmetric - (i == j) * (k == m) / 3
    return out


def evaluate_shapes(basis: skfem.CellBasis) -> FloatArray:
    """Evaluate the a shape functions of e elements at their q quadrature points, shape (e, q, a)."""
    each = [np.broadcast_to(np.asarray(basis.basis[a][0]), basis.dx.shape) for a in range(basis.Nbfun)]
    return np.stack(each, axis=-1)


def _build_axisymmetric_gradient(slope: FloatArray, hoop: FloatArray) -> FloatArray:
    """Build the matrices from nodal displacements to the five components of the axisymmetric displacement gradient.

    Args:
        slope: Derivatives of the a shape functions of e elements at q points, shape (e, q, a, 2) [1/m].
        hoop: Shape functions over the radius, shape (e, q, a) [1/m].

    Returns:
        One matrix per point, shape (e, q, 5, a * 2) [1/m].
    """
    e, q, a, _ = slope.shape
    out = np.zeros((e, q, 5, a, 2))
    out[:, :, 0, :, 0] = slope[..., 0]
    out[:, :, 1, :, 0] = slope[..., 1]
    out[:, :, 2, :, 1] = slope[..., 0]
    out[:, :, 3, :, 1] = slope[..., 1]
    out[:, :, 4, :, 0] = hoop
    return out.reshape(e, q, 5, 2 * a)


def _split_by_region(cells: IntArray, region: IntArray) -> IntArray:
    """Number the pressure unknowns by vertex and region, so that the pressure may jump between regions.

    Args:
        cells: Indices of the b vertices of each of the e elements, shape (e, b).
        region: Index of the material of each element, shape (e,).

    Returns:
        Index of the pressure unknown at each vertex of each element, shape (e, b).
    """
    pairs = cells + region[:, None] * (cells.max() + 1)
    return np.unique(pairs, return_inverse=True)[1].reshape(cells.shape).astype(np.int64)
