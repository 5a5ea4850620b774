"""Linear elastic solid of a curved cover, with one factorisation for many loads and prescribed motions of the base.

Displacements are quadratic and the mean stress is linear and continuous (Taylor-Hood), on hexahedra with quadratic
geometry or on tetrahedra.  Poisson ratios up to 0.5 are therefore possible.  The matrix is assembled with lengths
divided by the thickness and stresses divided by the shear modulus.  With SI units the pivots of the mean stress would
be lost in rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import skfem

from fem_reference.elements.taylor_hood import MixedElements, assemble_linear, prepare_elements
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Material
from meshes.array_types import FloatArray, IntArray
from meshes.solids.solid_mesh import SolidMesh, measure_thickness

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
        """Place the displacement nodes: nodes of the mesh on hexahedra; corners and edge midpoints on tetrahedra."""
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
        self.base, self.top = np.unique(self.layout.base), np.unique(self.layout.top)
        self._length = measure_thickness(mesh)
        self._force = material.shear_modulus * self._length**2
        self._system = ConstrainedSystem((3 * self.base[:, None] + np.arange(3)).ravel())

    @property
    def unknowns(self) -> int:
        """Number of unknown displacements and pressures of the cover, without the displacements of the base [-]."""
        return self.nodes.size + self.layout.elements.pressures - 3 * len(self.base)

    @cached_property
    def _factors(self) -> ConstrainedSystem:
        """Factorised stiffness matrix, with lengths over the thickness and stresses over the shear modulus."""
        elements = self.layout.elements
        elements = replace(
            elements,
            nodes=elements.nodes / self._length,
            slope=elements.slope * self._length,
            weight=elements.weight / self._length**3,
        )
        ratio = self.material.shear_modulus / self.material.bulk_modulus
        return self._system.factorise(assemble_linear(elements, np.ones(1), np.array([ratio])))

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
            count = part.stop - start
            load = self._load(np.zeros((count, *self.nodes.shape)) if forces is None else forces[part])
            motion = 0.0 if base is None else base[part].reshape(count, -1).T / self._length
            moved = self._factors.solve(load, motion)[: self.nodes.size]
            out[part] = moved.T.reshape(count, -1, 3)[:, nodes] * self._length
        return out

    def solve_fully(self, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Solve for the displacements under one load and the reactions of the base.

        Args:
            forces: Forces on all n nodes, shape (n, 3) [N].

        Returns:
            Displacements of all n nodes, shape (n, 3) [m], and forces of the base on the cover at the nodes of the
            base, shape (nodes of the base, 3) [N].
        """
        load = self._load(forces[None])[:, 0]
        moved = self._factors.solve(load)
        displacement, reaction = (
            each[: self.nodes.size].reshape(-1, 3) for each in (moved, self._factors.reaction(moved, load))
        )
        return displacement * self._length, reaction[self.base] * self._force

    def _load(self, forces: FloatArray) -> FloatArray:
        """Convert forces on all n nodes, shape (k, n, 3) [N], to scaled right-hand sides, shape (unknowns, k)."""
        load = np.zeros((self.nodes.size + self.layout.elements.pressures, len(forces)))
        load[: self.nodes.size] = forces.reshape(len(forces), -1).T / self._force
        return load


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
    """Extend triangles of 3 corners by the displacement nodes at the midpoints of their sides.

    Args:
        elements: Tetrahedra with quadratic displacements.
        facets: Indices of the corners of f triangles, shape (f, 3).

    Returns:
        Indices of corners and midpoints, shape (f, 6).
    """
    pairs = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))  # order of scikit-fem's edge functions
    count = len(elements.nodes)
    ends = np.sort(np.stack([elements.cells[:, list(pair)] for pair in pairs], axis=1), axis=2)
    keys, first = np.unique((ends[..., 0] * count + ends[..., 1]).ravel(), return_index=True)
    middle = elements.cells[:, 4:].ravel()[first]
    sides = np.sort(np.stack([facets[:, list(pair)] for pair in ((0, 1), (1, 2), (2, 0))], axis=1), axis=2)
    found = np.searchsorted(keys, sides[..., 0] * count + sides[..., 1])
    return np.concatenate([facets, middle[found]], axis=1)
