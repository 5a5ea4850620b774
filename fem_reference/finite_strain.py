"""Residual and tangent of mixed finite-strain elements.

Total Lagrangian: for each point W = isochoric(F) - p (J - 1) - p^2 / 2 K with displacement u and mean pressure p as
unknowns; stress P = dW/dF.  At rest the tangent is exactly the matrix of linear elasticity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference.elements import MixedElements, Pattern
from fem_reference.materials import Energy, bulk_compliance, finite_strain_energy
from fem_reference.materials.energy import Response, Scaled
from fem_reference.materials.invariants import Invariant, volume_ratio
from fem_reference.units import Units
from meshes import Cover

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """Elements with their materials.

    Attributes:
        elements: Prepared elements.
        energies: Isochoric energy of each region.
        bulk_compliance: 1 / K of each region; 0 when incompressible [1/Pa].
        pattern: Sparsity of the tangent, computed once.
    """

    elements: MixedElements
    energies: Sequence[Energy]
    bulk_compliance: FloatArray
    pattern: Pattern

    @classmethod
    def of_cover(cls, elements: MixedElements, cover: Cover, units: Units) -> Solid:
        """The cover's materials on elements whose regions are its layers, bottom first, in the given units."""
        materials = [layer.material for layer in cover.layers]
        return cls(
            elements=elements,
            energies=[Scaled(energy=finite_strain_energy(m), factor=1 / units.stress) for m in materials],
            bulk_compliance=np.array([bulk_compliance(m) * units.stress for m in materials]),
            pattern=Pattern(elements),
        )

    def linearise(self, state: FloatArray) -> tuple[FloatArray, sp.csr_matrix]:
        """Residual and tangent.

        Args:
            state: Displacements, then mean pressures, shape (n,) [m], [Pa].

        Returns:
            Internal forces [N] and volume residuals [m3], shape (n,), and the symmetric tangent.

        Raises:
            InvertedError: If an element is turned inside out.
        """
        e = self.elements
        F, J, p = self._fields(state)
        response = self._response(F, J)
        stress, tangent = _components(e, response.stress), _components(e, response.tangent)
        cofactor, second = _components(e, J.first), _components(e, J.second)
        w = e.weight
        residual = np.zeros_like(state)
        total = (stress - p[..., None] * cofactor) * w[..., None]
        np.add.at(residual, e.unknowns, e.transposed(total).sum(axis=1))
        inverse = self.bulk_compliance[e.region][:, None]
        volume = -(J.value - 1 + p * inverse) * w
        np.add.at(residual, e.pressure_cells + e.displacements, np.einsum("eqb,eq->eb", e.pressure_shape, volume))
        moduli = (tangent - p[..., None, None] * second) * w[..., None, None]
        along = e.transposed(cofactor * w[..., None])
        couple = -np.matmul(along.transpose(0, 2, 1), e.pressure_shape)
        weighted = e.pressure_shape * (w * inverse)[..., None]
        block = -np.matmul(e.pressure_shape.transpose(0, 2, 1), weighted)
        return residual, self.pattern.assemble(e.stiffness(moduli), couple, block)

    def energy(self, state: FloatArray) -> float:
        """Total stored energy with the pressure as a Lagrange multiplier [J]."""
        F, J, p = self._fields(state)
        inverse = self.bulk_compliance[self.elements.region][:, None]
        density = self._response(F, J).energy - p * (J.value - 1) - p**2 * inverse / 2
        return float((density * self.elements.weight).sum())

    def _fields(self, state: FloatArray) -> tuple[FloatArray, Invariant, FloatArray]:
        e = self.elements
        flat = e.displacement_gradient(state[: e.displacements])
        F = np.zeros((*flat.shape[:2], 3, 3))
        for g, (i, j) in enumerate(e.places):
            F[..., i, j] = flat[..., g] + (i == j)
        J = volume_ratio(F)
        if not (J.value > 0).all():
            raise InvertedError("an element is turned inside out")
        p = np.einsum("eqb,eb->eq", e.pressure_shape, state[e.pressure_cells + e.displacements])
        return F, J, p

    def _response(self, F: FloatArray, J: Invariant) -> Response:
        if len(self.energies) == 1:
            return self.energies[0].isochoric(F, J)
        energy, stress, tangent = np.zeros_like(J.value), np.zeros_like(F), np.zeros((*F.shape, 3, 3))
        for index, material in enumerate(self.energies):
            mine = self.elements.region == index
            part = material.isochoric(
                F[mine], Invariant(value=J.value[mine], first=J.first[mine], second=J.second[mine])
            )
            energy[mine], stress[mine], tangent[mine] = part.energy, part.stress, part.tangent
        return Response(energy=energy, stress=stress, tangent=tangent)


class InvertedError(ArithmeticError):
    """A deformation has a negative volume: the step was too long."""


def _components(elements: MixedElements, tensor: FloatArray) -> FloatArray:
    """The components that the mesh can have: (e, q, 3, 3) to (e, q, g), (e, q, 3, 3, 3, 3) to (e, q, g, g)."""
    i, j = np.array(elements.places).T
    if tensor.ndim == 4:  # noqa: PLR2004 -- a second-order tensor at each point
        return tensor[:, :, i, j]
    return np.ascontiguousarray(tensor[:, :, i[:, None], j[:, None], i, j])
