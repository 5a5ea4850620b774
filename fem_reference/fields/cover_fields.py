"""Displacement and stress in a cover at the corners of its elements.

The stress is known at the quadrature points of the elements.  Its nodal values define the field that is piecewise
linear and continuous within each layer and closest to the known stress in the least-squares sense (an L2 projection per
layer).  The stress may be discontinuous between layers, so that the nodes on an interface occur once for each layer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.linalg import splu

from fem_reference.elements.line import sum_blocks
from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.loading_path import Units
from meshes.array_types import FloatArray, IntArray
from meshes.pose import Pose

#: Corners of a quadrilateral in the order of VTK; for each corner 1 if it is the upper one along a direction, else 0.
_QUADRILATERAL = ((0, 0), (1, 0), (1, 1), (0, 1))
#: Corners of a hexahedron in the order of VTK; for each corner 1 if it is the upper one along a direction, else 0.
_HEXAHEDRON = tuple((*corner, height) for height in (0, 1) for corner in _QUADRILATERAL)
#: Index of the axis of an axisymmetric mesh for each of the axes x, y and z.  The axes of the mesh are r, z and hoop,
#: with the indices 0, 1 and 2.  Thus x is r, y is the hoop direction and z is z.
_RADIAL = (0, 2, 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverFields:
    """Displacement and stress in a cover under an indenter, in the frame of the array, with z from the base up.

    An axisymmetric solution is given in one half plane through the axis of the indenter, with constant y, on the side
    of larger x.  It is the same in every half plane through this axis.  The direction y is then the hoop direction.

    Attributes:
        position: Positions of n nodes in the undeformed cover, shape (n, 3) [m].
        displacement: Displacements of the nodes, shape (n, 3) [m].
        stress: Cauchy stress tensors at the nodes, tension positive, shape (n, 3, 3) [Pa].
        cells: Nodes of e elements in the order of VTK, quadrilaterals, shape (e, 4), or hexahedra, shape (e, 8).
        layer: Index of the layer of each element, bottom first, shape (e,).
        axisymmetric: Whether the solution is axisymmetric.
        error: Largest distance between the top and the indenter where they touch, over the depth; NaN where it is not
            known [-].  The contact may be solved on finer grids than the fields.
    """

    position: FloatArray
    displacement: FloatArray
    stress: FloatArray
    cells: IntArray
    layer: IntArray
    axisymmetric: bool
    error: float = np.nan

    @property
    def von_mises(self) -> FloatArray:
        """Von Mises stress at the nodes, shape (n,) [Pa]."""
        deviator = self.stress - np.trace(self.stress, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
        return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))))

    def scale(self, displacement: float, stress: float) -> CoverFields:
        """Multiply all displacements by the factor `displacement` and all stresses by the factor `stress`."""
        return replace(self, displacement=self.displacement * displacement, stress=self.stress * stress)

    def unfold(self, symmetric: tuple[bool, bool]) -> CoverFields:
        """Extend the fields of a half or quarter by mirror images; nodes on a plane of symmetry occur twice.

        Args:
            symmetric: Whether x = 0 and y = 0 are planes of symmetry.
        """
        whole = self
        for axis in range(2):
            if symmetric[axis]:
                whole = whole._mirror(axis)
        return whole

    def _mirror(self, axis: int) -> CoverFields:
        """Add the mirror image of the fields at the plane x = 0 (axis 0) or y = 0 (axis 1)."""
        sign = np.ones(3)
        sign[axis] = -1.0
        corners = _HEXAHEDRON
        flipped = [tuple(1 - bit if i == axis else bit for i, bit in enumerate(corner)) for corner in corners]
        order = [corners.index(corner) for corner in flipped]
        return CoverFields(
            position=np.concatenate([self.position, self.position * sign]),
            displacement=np.concatenate([self.displacement, self.displacement * sign]),
            stress=np.concatenate([self.stress, self.stress * np.outer(sign, sign)]),
            cells=np.concatenate([self.cells, self.cells[:, order] + len(self.position)]),
            layer=np.concatenate([self.layer, self.layer]),
            axisymmetric=False,
        )

    def to_array(self, pose: Pose) -> CoverFields:
        """Transform fields from the frame of an indenter to the frame of the array."""
        c, s = (1.0, 0.0) if self.axisymmetric else pose.cosines
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(
            self,
            position=self.position @ turn.T + [*pose.at, 0.0],
            displacement=self.displacement @ turn.T,
            stress=np.einsum("ij,njk,lk->nil", turn, self.stress, turn),
        )


def recover_fields(
    solid: Solid, state: FloatArray, units: Units, *, load_scale: float = 1.0, linear: bool = False
) -> CoverFields:
    """Compute the fields of a solved state, in the frame of the mesh and for the meshed part only.

    Args:
        solid: Elements and materials in `units`; the mesh is a tensor product along the axes.
        state: Displacements, then mean pressures, shape (n,) [units of computation].
        units: Units of length and stress of the solid.
        load_scale: Factor on the load with which the state was solved, by which the fields are divided [-].
        linear: Whether the stress is that of linear elasticity.
    """
    elements = solid.elements
    mesh = elements.basis.mesh
    vertex = np.empty(elements.pressures, dtype=np.int64)
    vertex[elements.pressure_cells] = mesh.t.T
    flat = mesh.p[:, vertex].T
    node = np.asarray(elements.basis.nodal_dofs[0])[vertex]
    moved = state[: elements.displacements].reshape(-1, elements.dimension)[node]
    stress = _project(elements, solid.cauchy_stress(state, linear=linear))
    axisymmetric = elements.hoop is not None
    if axisymmetric:
        stress = stress[:, _RADIAL][:, :, _RADIAL]
        flat, moved = (np.insert(each, 1, 0.0, axis=1) for each in (flat, moved))
    return CoverFields(
        position=flat * units.length,
        displacement=moved * (units.length / load_scale),
        stress=stress * (units.stress / load_scale),
        cells=_order_corners(elements),
        layer=elements.region,
        axisymmetric=axisymmetric,
    )


def _project(elements: MixedElements, values: FloatArray) -> FloatArray:
    """Compute nodal values of a tensor field that is known at the quadrature points, by an L2 projection per layer.

    Args:
        elements: Elements of the cover.
        values: Tensors at q quadrature points of e elements, shape (e, q, 3, 3).

    Returns:
        Tensors at the n corners of the elements, which occur once for each layer, shape (n, 3, 3).
    """
    rows, shape = elements.pressure_cells, elements.pressure_shape
    weighted = shape * elements.weight[..., None]
    mass = np.einsum("eqa,eqb->eab", weighted, shape)
    n = elements.pressures
    right = np.zeros((n, 9))
    np.add.at(right, rows, np.einsum("eqa,eqij->eaij", weighted, values).reshape(*rows.shape, 9))
    matrix = sum_blocks(mass, rows, rows, (n, n)).tocsc()
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return np.asarray(factors.solve(right)).reshape(n, 3, 3)


def _order_corners(elements: MixedElements) -> IntArray:
    """Return the corners of every element in the order of VTK, as indices of pressure unknowns."""
    mesh = elements.basis.mesh
    # The axes of this array are dimension, corner and element.
    corner = mesh.p[:, mesh.t]
    upper = corner > corner.mean(axis=1, keepdims=True)
    wanted = np.array(_HEXAHEDRON if elements.dimension == 3 else _QUADRILATERAL)  # noqa: PLR2004
    code = 2 ** np.arange(elements.dimension)
    # Corners of each element, sorted by a code of the directions along which a corner is the upper one.  The axes are
    # corner and element.
    found = np.argsort(np.tensordot(code, upper.astype(int), 1), axis=0)
    return np.take_along_axis(elements.pressure_cells, found[wanted @ code].T, axis=1)
