"""Linear elastic solid of a curved cover, with one factorisation for many loads and prescribed motions of the base.

Displacements are quadratic and the mean stress is linear and continuous (Taylor-Hood), on hexahedra or tetrahedra with
quadratic geometry.  Poisson ratios up to 0.5 are therefore possible.  The matrix is assembled with lengths divided by
the thickness and stresses divided by the shear modulus of the top layer.  With SI units the pivots of the mean stress
would be lost in rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import skfem

from fem_reference.elements.taylor_hood import MixedElements, assemble_linear, prepare_elements
from fem_reference.finite_strain.loading_path import Units
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover
from meshes.array_types import FloatArray, IntArray
from meshes.layer import Layers, scale_layers
from meshes.solids.solid_mesh import SolidMesh, assign_layers, measure_thickness

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
    def on(cls, mesh: SolidMesh, layers: Layers) -> DisplacementNodes:
        """Place the displacement nodes, which are the nodes of the mesh; the layers are the regions of the elements."""
        return cls(elements=_prepare_elements(mesh, assign_layers(mesh, layers)), base=mesh.base, top=mesh.top)


class CoverSolid:
    """Factorised linear elastic cover, bonded to its base, with a free surface elsewhere.

    Args:
        mesh: Mesh of the cover.
        layers: Material or layers; hyperelastic materials are linearised at zero load.
    """

    def __init__(self, mesh: SolidMesh, layers: Layers) -> None:
        self.mesh = mesh
        self.layers = scale_layers(layers, measure_thickness(mesh))
        self.layout = DisplacementNodes.on(mesh, self.layers)
        self.nodes = self.layout.elements.nodes
        self.base, self.top = np.unique(self.layout.base), np.unique(self.layout.top)
        self._units = Units.of(Cover(layers=self.layers))
        self._system = ConstrainedSystem((3 * self.base[:, None] + np.arange(3)).ravel())

    @property
    def unknowns(self) -> int:
        """Number of unknown displacements and pressures of the cover, without the displacements of the base [-]."""
        return self.nodes.size + self.layout.elements.pressures - 3 * len(self.base)

    @cached_property
    def _factors(self) -> ConstrainedSystem:
        """Factorised stiffness matrix, with lengths and stresses in units of the cover."""
        elements = self.layout.elements
        elements = replace(
            elements,
            nodes=elements.nodes / self._units.length,
            slope=elements.slope * self._units.length,
            weight=elements.weight / self._units.length**3,
        )
        moduli = self._units.scale_moduli(Cover(layers=self.layers))
        return self._system.factorise(assemble_linear(elements, *moduli))

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
            motion = 0.0 if base is None else base[part].reshape(count, -1).T / self._units.length
            moved = self._factors.solve(load, motion)[: self.nodes.size]
            out[part] = moved.T.reshape(count, -1, 3)[:, nodes] * self._units.length
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
        return displacement * self._units.length, reaction[self.base] * self._units.force

    def _load(self, forces: FloatArray) -> FloatArray:
        """Convert forces on all n nodes, shape (k, n, 3) [N], to scaled right-hand sides, shape (unknowns, k)."""
        load = np.zeros((self.nodes.size + self.layout.elements.pressures, len(forces)))
        load[: self.nodes.size] = forces.reshape(len(forces), -1).T / self._units.force
        return load


def _prepare_elements(mesh: SolidMesh, region: IntArray) -> MixedElements:
    """Prepare elements with quadratic geometry whose displacement nodes are the nodes of the mesh."""
    if mesh.is_hexahedral:
        linear, quadratic = skfem.MeshHex1, skfem.MeshHex2
        corners, order = (
            (np.round(2 * each().doflocs) @ [1, 3, 9]).astype(np.int64)
            for each in (skfem.ElementHex1, skfem.ElementHex2)
        )
    else:  # scikit-fem has the same order
        linear, quadratic = skfem.MeshTet1, skfem.MeshTet2
        corners, order = np.arange(4), np.arange(10)
    used, vertices = np.unique(mesh.cells[:, corners], return_inverse=True)
    straight = linear(
        np.ascontiguousarray(mesh.nodes[used].T), vertices.reshape(len(mesh.cells), -1).T.copy(), validate=False
    )
    curved = quadratic.from_mesh(straight)
    cells = mesh.cells[:, order]
    places = np.empty_like(curved.doflocs)
    places[:, curved.dofs.element_dofs.ravel()] = mesh.nodes[cells.T.ravel()].T
    elements = prepare_elements(replace(curved, doflocs=places), region=region)
    return replace(elements, nodes=mesh.nodes, cells=cells)
