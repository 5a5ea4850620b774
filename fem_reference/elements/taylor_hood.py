"""Mixed displacement-pressure elements (Taylor-Hood): quadratic displacement, linear pressure.

scikit-fem gives meshes, shape functions, mappings and quadrature.  The tensors are contracted here by array operations
on all elements at once, which is much faster than scikit-fem's assembly of vector-valued forms.  The pressure is
continuous inside a region and may jump between regions, because the mean stress jumps where two materials meet.

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

from fem_reference.materials.invariants import EVERY_PLACE
from meshes.array_types import FloatArray, IntArray

#: Displacement and pressure elements on each kind of mesh.
_ELEMENTS = {
    skfem.MeshTri1: (skfem.ElementTriP2, skfem.ElementTriP1),
    skfem.MeshQuad1: (skfem.ElementQuad2, skfem.ElementQuad1),
    skfem.MeshTet1: (skfem.ElementTetP2, skfem.ElementTetP1),
    skfem.MeshHex1: (skfem.ElementHex2, skfem.ElementHex1),
}
#: Row and column of each component of an axisymmetric displacement gradient: rr, rz, zr, zz, tt.
_AXISYMMETRIC = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))
#: All elements.
_ALL = slice(None)


@dataclass(frozen=True, kw_only=True, eq=False)
class MixedElements:
    """Data for assembly, as arrays over elements e, quadrature points q, local nodes a and pressure unknowns b.

    Attributes:
        dimension: Displacement components per node, 2 or 3 [-].
        nodes: Displacement nodes, shape (n, dimension) [m].
        cells: Displacement nodes of each element, shape (e, a).
        pressure_cells: Pressure unknowns of each element, shape (e, b).
        region: Index of each element's material, shape (e,).
        slope: Derivatives of the displacement shape functions, shape (e, q, a, dimension) [1/m].
        hoop: Shape functions over the radius when axisymmetric, shape (e, q, a) [1/m]; None otherwise.
        pressure_shape: Pressure shape functions, shape (e, q, b) [-].
        weight: Quadrature weight times volume, 2 pi r included when axisymmetric, shape (e, q) [m3].
        basis: scikit-fem basis of the scalar displacement space.
        places: Row and column in the 3 x 3 displacement gradient of each stored component g.
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
        """Number of displacement unknowns; unknown `dimension * node + component` [-]."""
        return self.nodes.size

    @property
    def pressures(self) -> int:
        """Number of pressure unknowns; they follow the displacements [-]."""
        return int(self.pressure_cells.max()) + 1

    @cached_property
    def unknowns(self) -> IntArray:
        """Displacement unknowns of each element, shape (e, a * dimension)."""
        each = self.dimension * self.cells[:, :, None] + np.arange(self.dimension)
        return each.reshape(len(self.cells), -1)

    def compute_gradient(self, displacement: FloatArray, part: slice = _ALL) -> FloatArray:
        """Compute the components of grad u at all quadrature points, shape (e, q, g) [-].

        Args:
            displacement: Nodal displacements, which pressures may follow, shape (n,) [m].
            part: Elements to compute, here and in the methods below.
        """
        u = displacement[self.unknowns[part]].reshape(-1, self.cells.shape[1], self.dimension)
        e, q, _, _ = self.slope[part].shape
        flat = np.matmul(u.transpose(0, 2, 1)[:, None], self.slope[part]).reshape(e, q, -1)
        if self.hoop is None:
            return np.asarray(flat)
        return np.concatenate([flat, np.matmul(self.hoop[part], u[..., :1])], axis=2)

    def integrate_force(self, stress: FloatArray, part: slice = _ALL) -> FloatArray:
        """Integrate a stress to nodal forces, the transpose of the gradient.

        Args:
            stress: Components times quadrature weights, shape (e, q, g) [N m].
            part: Elements that the stress belongs to.

        Returns:
            Forces on the local unknowns, shape (e, a * dimension) [N].
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
        """Integrate a stress times each pressure shape function to nodal forces.

        Args:
            stress: Components times quadrature weights, shape (e, q, g).
            part: Elements that the stress belongs to.

        Returns:
            Shape (e, a * dimension, b).
        """
        d = self.dimension
        square = stress[..., : d * d].reshape(*stress.shape[:2], d, d)
        out = np.matmul(self.slope[part], square.transpose(0, 1, 3, 2))
        if self.hoop is not None:
            out[..., 0] += self.hoop[part] * stress[..., -1:]
        along = out.reshape(*stress.shape[:2], -1)
        return np.asarray(np.matmul(along.transpose(0, 2, 1), self.pressure_shape[part]))

    def integrate_stiffness(self, moduli: FloatArray, part: slice = _ALL) -> FloatArray:
        """Integrate moduli to element stiffnesses.

        Args:
            moduli: Derivatives of stress by displacement gradient, symmetric, times quadrature weights, shape
                (e, q, g, g) [N m].
            part: Elements that the moduli belong to.

        Returns:
            Stiffness between the local unknowns, shape (e, a * dimension, a * dimension) [N/m].
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
                block = _contract(slope, np.ascontiguousarray(tensor[:, :, i, :, k, :]), right)
                out[:, :, i, :, k] = block
                out[:, :, k, :, i] = block.transpose(0, 2, 1)
        return out.reshape(e, a * d, a * d)


def mesh_layers(across: Sequence[FloatArray], heights: FloatArray, layer: IntArray) -> tuple[skfem.Mesh, IntArray]:
    """Tensor mesh of a layered block.

    Args:
        across: Element edges along the radius, or along x and along y [m].
        heights: Element edges along z [m].
        layer: Layer of each element along z.

    Returns:
        Quadrilaterals or hexahedra, and the layer of each.
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
        mesh: Linear triangles, quadrilaterals, tetrahedra or hexahedra [m].
        region: Material index of each element, shape (e,); all 0 when not given.
        axisymmetric: Read the coordinates of a two-dimensional mesh as (r, z).
        order: Polynomial order that quadrature integrates exactly [-].

    Raises:
        ValueError: If no elements are defined for the kind of mesh, a two-dimensional mesh is not axisymmetric, or a
            three-dimensional one is.
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
    slope = np.stack([np.asarray(basis.basis[a][0].grad) for a in range(basis.Nbfun)], axis=-1)  # (d, e, q, a)
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
    """Assemble linear elasticity in displacement and mean pressure, for Poisson ratios from 0 to 0.5 inclusive.

    sigma = 2 mu dev(eps) - p I and p = -K div u with K = 2 mu (1 + nu) / 3 (1 - 2 nu).  With p as an unknown only 1 / K
    appears, which is 0 for an incompressible material (Hughes, The Finite Element Method, section 4.4).

    Args:
        elements: Prepared elements.
        shear_modulus: Of each region [Pa].
        bulk_compliance: 1 / K of each region, 0 when incompressible [1/Pa].

    Returns:
        Symmetric indefinite matrix over displacements, then pressures.
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
    """Positions of element matrices in the global sparse matrix, computed once for many assemblies.

    Args:
        elements: Prepared elements.
    """

    def __init__(self, elements: MixedElements) -> None:
        rows = np.concatenate([elements.unknowns, elements.pressure_cells + elements.displacements], axis=1)
        self._split = elements.unknowns.shape[1]
        self._block = (len(rows), rows.shape[1], rows.shape[1])
        size = elements.displacements + elements.pressures
        i = np.broadcast_to(rows[:, :, None], self._block).ravel()
        j = np.broadcast_to(rows[:, None, :], self._block).ravel()
        keys, self._slot = np.unique(i * size + j, return_inverse=True)
        pointer = np.searchsorted(keys // size, np.arange(size + 1))
        self._shape = (size, size)
        self._index = (keys % size).astype(np.int32), pointer.astype(np.int32)

    def assemble(self, stiff: FloatArray, couple: FloatArray, volume: FloatArray) -> sp.csr_matrix:
        """Sum element matrices into one symmetric matrix.

        Args:
            stiff: Between displacements, shape (e, i, i).
            couple: Between displacements and pressures, shape (e, i, b).
            volume: Between pressures, shape (e, b, b).
        """
        n = self._split
        block = np.empty(self._block)
        block[:, :n, :n] = stiff
        block[:, :n, n:] = couple
        block[:, n:, :n] = couple.transpose(0, 2, 1)
        block[:, n:, n:] = volume
        index, pointer = self._index
        data = np.bincount(self._slot, block.ravel(), minlength=len(index))
        return sp.csr_matrix((data, index.copy(), pointer.copy()), shape=self._shape)


def _build_deviator(places: tuple[tuple[int, int], ...]) -> FloatArray:
    """Matrix from the components of grad u to those of its symmetric deviator, shape (g, g) [-]."""
    out = np.zeros((len(places), len(places)))
    for row, (i, j) in enumerate(places):
        for column, (k, m) in enumerate(places):
            symmetric = ((i, j) == (k, m)) / 2 + ((i, j) == (m, k)) / 2
            out[row, column] = symmetric - (i == j) * (k == m) / 3
    return out


def evaluate_shapes(basis: skfem.CellBasis) -> FloatArray:
    """Shape functions at quadrature points, shape (e, q, a)."""
    each = [np.broadcast_to(np.asarray(basis.basis[a][0]), basis.dx.shape) for a in range(basis.Nbfun)]
    return np.stack(each, axis=-1)


def _build_axisymmetric_gradient(slope: FloatArray, hoop: FloatArray) -> FloatArray:
    """Axisymmetric gradient operator as a dense array, shape (e, q, 5, a * 2) [1/m]."""
    e, q, a, _ = slope.shape
    out = np.zeros((e, q, 5, a, 2))
    out[:, :, 0, :, 0] = slope[..., 0]
    out[:, :, 1, :, 0] = slope[..., 1]
    out[:, :, 2, :, 1] = slope[..., 0]
    out[:, :, 3, :, 1] = slope[..., 1]
    out[:, :, 4, :, 0] = hoop
    return out.reshape(e, q, 5, 2 * a)


def _contract(slope: FloatArray, tensor: FloatArray, right: FloatArray) -> FloatArray:
    """Sum slope times tensor times slope transposed over points, as one batched matrix product.

    Args:
        slope: Shape (e, q, a, J).
        tensor: Shape (e, q, J, L).
        right: Slope with points and directions as rows, shape (e, q * L, b).

    Returns:
        Shape (e, a, b).
    """
    e, q, a, d = slope.shape
    left = np.matmul(slope, tensor).transpose(0, 2, 1, 3).reshape(e, a, q * d)
    return np.asarray(np.matmul(left, right))


def _split_by_region(cells: IntArray, region: IntArray) -> IntArray:
    """Number pressure unknowns by vertex and region, so that the pressure may jump between regions, shape (e, b)."""
    pairs = cells + region[:, None] * (cells.max() + 1)
    return np.unique(pairs, return_inverse=True)[1].reshape(cells.shape).astype(np.int64)
