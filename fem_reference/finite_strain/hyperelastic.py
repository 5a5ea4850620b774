"""Residual and tangent of mixed finite-strain elements.

Total Lagrangian formulation with displacement u and mean pressure p as unknowns.  The energy per reference volume is
W = W_iso(F) - p (J - 1) - p^2 / (2 K), with the deformation gradient F, J = det F, the isochoric energy W_iso and the
bulk modulus K; the stress is P = dW/dF.  In the undeformed state the tangent is
exactly the matrix of linear elasticity.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.sparse as sp

from fem_reference.elements.taylor_hood import MixedElements, Pattern
from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.loading_path import Units
from fem_reference.materials import Energy, create_finite_strain_energy
from fem_reference.materials.energy import Response, Scaled
from fem_reference.materials.invariants import Invariant, volume_ratio
from meshes import Cover
from meshes.array_types import FloatArray

#: Quadrature points that are evaluated together: few enough that their tensors stay in the processor's cache.
_POINTS = 1152


class InvertedElementError(ConvergenceError):
    """A deformation has a negative volume: the step was too long."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """Elements with their materials.

    Attributes:
        elements: Prepared elements.
        energies: Isochoric energy of each region.
        bulk_compliance: 1 / K of each region; 0 for incompressible materials [1/Pa].
        pattern: Sparsity of the tangent, computed once.
    """

    elements: MixedElements
    energies: Sequence[Energy]
    bulk_compliance: FloatArray
    pattern: Pattern

    @classmethod
    def from_cover(cls, elements: MixedElements, cover: Cover, units: Units) -> Solid:
        """Put a cover's materials on elements.

        Args:
            elements: Elements whose regions are the layers of the cover, bottom first.
            cover: The cover; a small-strain material becomes neo-Hookean with the same moduli.
            units: Units that the elements and the result are in.
        """
        materials = [layer.material for layer in cover.layers]
        return cls(
            elements=elements,
            energies=[Scaled(energy=create_finite_strain_energy(m), factor=1 / units.stress) for m in materials],
            bulk_compliance=np.array([units.stress / m.bulk_modulus for m in materials]),
            pattern=Pattern(elements),
        )

    def linearise(self, state: FloatArray) -> tuple[FloatArray, sp.csr_matrix]:
        """Return residual and tangent.

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).

        Returns:
            Internal forces [N], then volume residuals [m3], shape (n,), and the symmetric tangent, shape (n, n).

        Raises:
            InvertedElementError: If an element is turned inside out.
        """
        e = self.elements
        (n, i), b = e.unknowns.shape, e.pressure_cells.shape[1]
        found = tuple(np.empty(shape) for shape in ((n, i), (n, b), (n, i, i), (n, i, b), (n, b, b)))
        size = max(1, _POINTS // e.weight.shape[1])
        parts = [slice(start, start + size) for start in range(0, len(e.cells), size)]
        with ThreadPoolExecutor(min(_count_threads(), len(parts))) as pool:
            list(pool.map(partial(self._fill, state, found), parts))
        forces, volumes, stiff, couple, squeeze = found
        residual = np.bincount(e.unknowns.ravel(), forces.ravel(), minlength=len(state)).astype(np.float64)
        rows = e.pressure_cells + e.displacements
        residual += np.bincount(rows.ravel(), volumes.ravel(), minlength=len(state))
        return residual, self.pattern.assemble(stiff, couple, squeeze)

    def _fill(self, state: FloatArray, found: tuple[FloatArray, ...], part: slice) -> None:
        """Evaluate some elements.

        Args:
            state: As for `linearise`.
            found: Arrays over all elements that the results are written into: forces, volumes, and the stiffness,
                coupling and pressure blocks of the element matrices.
            part: Which elements.
        """
        e, (forces, volumes, stiff, couple, squeeze) = self.elements, found
        F, J, p = self._evaluate_fields(state, part)
        response = self._evaluate_isochoric(F, J, part)
        w, shape = e.weight[part], e.pressure_shape[part]
        inverse = self.bulk_compliance[e.region[part], None]
        stress = (response.stress - p[..., None] * J.first) * w[..., None]
        forces[part] = e.integrate_force(stress, part)
        volumes[part] = -np.einsum("eqb,eq->eb", shape, (J.value - 1 + p * inverse) * w)
        moduli = (response.tangent - p[..., None, None] * J.second) * w[..., None, None]
        stiff[part] = e.integrate_stiffness(moduli, part)
        couple[part] = -e.integrate_coupling(J.first * w[..., None], part)
        squeeze[part] = -np.matmul(shape.transpose(0, 2, 1), shape * (w * inverse)[..., None])

    def linearise_at_rest(self) -> SmallStrainSolid:
        """Return the same solid with the tangent of the undeformed state, for small strain."""
        undeformed = np.zeros(self.elements.displacements + self.elements.pressures)
        return SmallStrainSolid(elements=self.elements, stiffness=self.linearise(undeformed)[1])

    def energy(self, state: FloatArray) -> float:
        """Return the integral of W, which is the stored energy in equilibrium [J].

        Args:
            state: As for `linearise`.
        """
        whole = slice(None)
        F, J, p = self._evaluate_fields(state, whole)
        inverse = self.bulk_compliance[self.elements.region][:, None]
        density = self._evaluate_isochoric(F, J, whole).energy - p * (J.value - 1) - p**2 * inverse / 2
        return float((density * self.elements.weight).sum())

    def _evaluate_fields(self, state: FloatArray, part: slice) -> tuple[FloatArray, Invariant, FloatArray]:
        """Return deformation gradient, its determinant and mean pressure at the quadrature points of some elements."""
        e = self.elements
        flat = e.compute_gradient(state, part)
        F = np.zeros((*flat.shape[:2], 3, 3))
        for g, (i, j) in enumerate(e.places):
            F[..., i, j] = flat[..., g] + (i == j)
        J = volume_ratio(F, e.places)
        if not (J.value > 0).all():
            raise InvertedElementError("an element is turned inside out")
        p = np.einsum("eqb,eb->eq", e.pressure_shape[part], state[e.pressure_cells[part] + e.displacements])
        return F, J, p

    def _evaluate_isochoric(self, F: FloatArray, J: Invariant, part: slice) -> Response:
        """Return isochoric energy, stress and tangent at the quadrature points of some elements."""
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
    """Elements of linear elasticity, whose stiffness is the same in every state.

    Attributes:
        elements: Prepared elements.
        stiffness: The symmetric matrix.
    """

    elements: MixedElements
    stiffness: sp.csr_matrix

    def linearise(self, state: FloatArray) -> tuple[FloatArray, sp.csr_matrix]:
        """Return residual and tangent, as `Solid.linearise`."""
        return np.asarray(self.stiffness @ state), self.stiffness


def _count_threads() -> int:
    """Return the number of threads for assembly: that of linear algebra if set, else one per usable core."""
    allowed = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if allowed.isdecimal() and int(allowed):
        return int(allowed)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
