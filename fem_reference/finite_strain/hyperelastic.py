"""Residual and tangent of mixed finite-strain elements.

Total Lagrangian: for each point W = isochoric(F) - p (J - 1) - p^2 / 2 K with displacement u and mean pressure p as
unknowns; stress P = dW/dF.  At rest the tangent is exactly the matrix of linear elasticity.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference.elements.scaling import Units
from fem_reference.elements.taylor_hood import MixedElements, Pattern
from fem_reference.materials import Energy, create_finite_strain_energy
from fem_reference.materials.energy import Response, Scaled
from fem_reference.materials.invariants import Invariant, volume_ratio
from meshes import Cover

FloatArray = npt.NDArray[np.float64]

#: Quadrature points treated at once: few enough that their tensors stay in the cache.
_POINTS = 1152


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
            energies=[Scaled(energy=create_finite_strain_energy(m), factor=1 / units.stress) for m in materials],
            bulk_compliance=np.array([units.stress / m.bulk_modulus for m in materials]),
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
        found = tuple(np.empty(shape) for shape in self._block_shapes)
        size = max(1, _POINTS // e.weight.shape[1])
        parts = [slice(start, start + size) for start in range(0, len(e.cells), size)]
        with ThreadPoolExecutor(min(_threads(), len(parts))) as pool:
            list(pool.map(partial(self._fill, state, found), parts))
        forces, volumes, stiff, couple, squeeze = found
        residual = np.bincount(e.unknowns.ravel(), forces.ravel(), minlength=len(state)).astype(np.float64)
        rows = e.pressure_cells + e.displacements
        residual += np.bincount(rows.ravel(), volumes.ravel(), minlength=len(state))
        return residual, self.pattern.assemble(stiff, couple, squeeze)

    def _fill(self, state: FloatArray, found: tuple[FloatArray, ...], part: slice) -> None:
        """Forces, volumes and the three blocks of the matrices of some elements, written into the arrays of all."""
        e, (forces, volumes, stiff, couple, squeeze) = self.elements, found
        F, J, p = self._fields(state, part)
        response = self._response(F, J, part)
        w, shape = e.weight[part], e.pressure_shape[part]
        inverse = self.bulk_compliance[e.region[part], None]
        stress = (response.stress - p[..., None] * J.first) * w[..., None]
        forces[part] = e.integrate_force(stress, part)
        volumes[part] = -np.einsum("eqb,eq->eb", shape, (J.value - 1 + p * inverse) * w)
        moduli = (response.tangent - p[..., None, None] * J.second) * w[..., None, None]
        stiff[part] = e.integrate_stiffness(moduli, part)
        couple[part] = -e.integrate_coupling(J.first * w[..., None], part)
        squeeze[part] = -np.matmul(shape.transpose(0, 2, 1), shape * (w * inverse)[..., None])

    @property
    def at_rest(self) -> SmallStrainSolid:
        """The same solid where strain is small."""
        nothing = np.zeros(self.elements.displacements + self.elements.pressures)
        return SmallStrainSolid(elements=self.elements, stiffness=self.linearise(nothing)[1])

    def energy(self, state: FloatArray) -> float:
        """Total stored energy with the pressure as a Lagrange multiplier [J]."""
        whole = slice(None)
        F, J, p = self._fields(state, whole)
        inverse = self.bulk_compliance[self.elements.region][:, None]
        density = self._response(F, J, whole).energy - p * (J.value - 1) - p**2 * inverse / 2
        return float((density * self.elements.weight).sum())

    @property
    def _block_shapes(self) -> list[tuple[int, ...]]:
        """Of element forces and volumes, and of the three blocks of element matrices."""
        (e, i), b = self.elements.unknowns.shape, self.elements.pressure_cells.shape[1]
        return [(e, i), (e, b), (e, i, i), (e, i, b), (e, b, b)]

    def _fields(self, state: FloatArray, part: slice) -> tuple[FloatArray, Invariant, FloatArray]:
        e = self.elements
        flat = e.compute_gradient(state, part)
        F = np.zeros((*flat.shape[:2], 3, 3))
        for g, (i, j) in enumerate(e.places):
            F[..., i, j] = flat[..., g] + (i == j)
        J = volume_ratio(F, e.places)
        if not (J.value > 0).all():
            raise InvertedError("an element is turned inside out")
        p = np.einsum("eqb,eb->eq", e.pressure_shape[part], state[e.pressure_cells[part] + e.displacements])
        return F, J, p

    def _response(self, F: FloatArray, J: Invariant, part: slice) -> Response:
        region = self.elements.region[part]
        if (region == region[0]).all():
            return self.energies[int(region[0])].isochoric(F, J)
        energy, stress, tangent = np.empty_like(J.value), np.empty_like(J.first), np.empty_like(J.second)
        for index in np.unique(region):
            mine = region == index
            of_mine = Invariant(value=J.value[mine], first=J.first[mine], second=J.second[mine], places=J.places)
            found = self.energies[int(index)].isochoric(F[mine], of_mine)
            energy[mine], stress[mine], tangent[mine] = found.energy, found.stress, found.tangent
        return Response(energy=energy, stress=stress, tangent=tangent)


@dataclass(frozen=True, kw_only=True, eq=False)
class SmallStrainSolid:
    """Elements of linear elasticity: one stiffness for every state.

    Attributes:
        elements: Prepared elements.
        stiffness: The symmetric matrix.
    """

    elements: MixedElements
    stiffness: sp.csr_matrix

    def linearise(self, state: FloatArray) -> tuple[FloatArray, sp.csr_matrix]:
        """Residual and tangent, as `Solid.linearise`."""
        return np.asarray(self.stiffness @ state), self.stiffness


def _threads() -> int:
    """Threads that assemble: as many as the linear algebra is allowed, else one for each core this process may use."""
    allowed = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if allowed.isdecimal() and int(allowed):
        return int(allowed)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class InvertedError(ArithmeticError):
    """A deformation has a negative volume: the step was too long."""
