"""Compute residual and tangent of mixed displacement-pressure elements at finite strain.

Total Lagrangian formulation with displacement u and mean pressure p as unknowns.  The energy per reference volume is
W = W_iso(F) - p (J - 1) - p^2 / (2 K), with the deformation gradient F, J = det F, the isochoric energy W_iso and the
bulk modulus K; the stress is P = dW/dF.  In the undeformed state the tangent equals the matrix of linear elasticity.

A part k < K of the bulk modulus may act on the displacements directly: W = W_iso(F) + k (J - 1)^2 / 2 - q (J - 1) -
q^2 / 2 (K - k), with the mean pressure p = q - k (J - 1).  The exact solution does not depend on k.  Under mean
pressures of many shear moduli, Taylor-Hood elements with k = 0 have false instabilities (Auricchio et al. 2010, The
importance of the exact satisfaction of the incompressibility constraint in nonlinear elasticity).  The tangent may take
k (J - 1) from J linearised at the previous Newton iteration, which lets Newton's method converge from farther away
(Magisano, Leonetti and Garcea 2017, How to improve efficiency and robustness of the Newton method in geometrically
non-linear structural problems discretized via displacement-based finite elements).
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
from fem_reference.materials import Energy, Invariant, Response, create_finite_strain_energy, volume_ratio
from meshes import Cover
from meshes.array_types import FloatArray

#: Number of quadrature points that are evaluated together, so small that their tensors fit in the processor cache [-].
_POINTS = 1152
#: Largest displacement gradient to which a state is scaled down, so that the stress of the hyperelastic law is that of
#: linear elasticity [-].
_LINEAR_STRAIN = 1e-6


class InvertedElementError(ConvergenceError):
    """The deformation has a negative volume ratio at a quadrature point, because a Newton step was too long."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """Hyperelastic solid: finite elements with the material of each region.

    Attributes:
        elements: Finite elements of the solid.
        energies: Isochoric stored energy of each region.
        bulk_compliance: Reciprocal bulk modulus 1 / K of each region; 0 for incompressible materials [1/Pa].
        pattern: Sparsity pattern of the tangent.
        direct_bulk: Part k of the bulk modulus of each region that acts on the displacements [Pa].
    """

    elements: MixedElements
    energies: Sequence[Energy]
    bulk_compliance: FloatArray
    pattern: Pattern
    direct_bulk: FloatArray

    @classmethod
    def from_cover(cls, elements: MixedElements, cover: Cover, units: Units, *, direct: float = 0.0) -> Solid:
        """Create the solid of a cover from a mesh and the materials of the layers.

        Args:
            elements: Elements whose regions are the layers of the cover, bottom first, in `units`.
            cover: Cover with its materials; a small-strain material becomes neo-Hookean with the same moduli.
            units: Units of length and stress of the elements and of the solid.
            direct: Part of the bulk modulus that acts on the displacements, in shear moduli of each layer, limited to
                half the bulk modulus [-].
        """
        materials = [layer.material for layer in cover.layers]
        return cls(
            elements=elements,
            energies=[create_finite_strain_energy(m, units.stress) for m in materials],
            bulk_compliance=np.array([units.stress / m.bulk_modulus for m in materials]),
            pattern=Pattern(elements),
            direct_bulk=np.array([min(direct * m.shear_modulus, m.bulk_modulus / 2) for m in materials]) / units.stress,
        )

    def linearise(self, state: FloatArray, expected: FloatArray | None = None) -> tuple[FloatArray, sp.csr_matrix]:
        """Compute the residual of equilibrium without external forces, and its tangent.

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).
            expected: J - 1 in the direct part of the pressure in the tangent, from `predict_volume`, shape (e, q); that
                of the state if None [-].

        Returns:
            Internal forces [N], then volume residuals [m3], shape (n,), and their derivatives with respect to the
            state, a symmetric matrix, shape (n, n).

        Raises:
            InvertedElementError: If an element is turned inside out.
        """
        e = self.elements
        (n, i), b = e.unknowns.shape, e.pressure_cells.shape[1]
        found = tuple(np.empty(shape) for shape in ((n, i), (n, b), (n, i, i), (n, i, b), (n, b, b)))
        size = max(1, _POINTS // e.weight.shape[1])
        parts = [slice(start, start + size) for start in range(0, len(e.cells), size)]
        with ThreadPoolExecutor(min(_count_threads(), len(parts))) as pool:
            list(pool.map(partial(self._fill, state, expected, found), parts))
        forces, volumes, stiff, couple, squeeze = found
        residual = np.bincount(e.unknowns.ravel(), forces.ravel(), minlength=len(state)).astype(np.float64)
        rows = e.pressure_cells + e.displacements
        residual += np.bincount(rows.ravel(), volumes.ravel(), minlength=len(state))
        return residual, self.pattern.assemble(stiff, couple, squeeze)

    def _fill(self, state: FloatArray, expected: FloatArray | None, found: tuple[FloatArray, ...], part: slice) -> None:
        """Compute residuals and matrices of some elements and write them into arrays over all elements.

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).
            expected: J - 1 in the direct part of the pressure in the tangent, as for `linearise` [-].
            found: Output arrays: forces, volume residuals, and the stiffness, coupling and pressure blocks of the
                element matrices.
            part: Range of elements to compute.
        """
        e, (forces, volumes, stiff, couple, squeeze) = self.elements, found
        F, J, p = self._evaluate_fields(state, part)
        response = self._evaluate_isochoric(F, J, part)
        w, shape = e.weight[part], e.pressure_shape[part]
        inverse, direct = self._split_bulk(part)
        q, p = p, p - direct * (J.value - 1)
        stress = (response.stress - p[..., None] * J.first) * w[..., None]
        forces[part] = e.integrate_force(stress, part)
        volumes[part] = -np.einsum("eqb,eq->eb", shape, (J.value - 1 + q * inverse) * w)
        volume = direct[..., None, None] * J.first[..., :, None] * J.first[..., None, :]
        held = p if expected is None else q - direct * expected[part]
        moduli = (response.tangent - held[..., None, None] * J.second + volume) * w[..., None, None]
        stiff[part] = e.integrate_stiffness(moduli, part)
        couple[part] = -e.integrate_coupling(J.first * w[..., None], part)
        squeeze[part] = -np.matmul(shape.transpose(0, 2, 1), shape * (w * inverse)[..., None])

    def predict_volume(self, before: FloatArray, state: FloatArray) -> FloatArray | None:
        """Compute J - 1 at a state from J linearised at another state, shape (e, q); None if it is not needed [-].

        Args:
            before: State at which J is linearised, shape (n,).
            state: State at which J is wanted, shape (n,).
        """
        if not self.direct_bulk.any():
            return None
        _, J, _ = self._evaluate_fields(before, slice(None))
        change = self.elements.compute_gradient(state - before)
        return np.asarray(J.value - 1 + np.einsum("eqg,eqg->eq", J.first, change))

    def linearise_at_rest(self) -> SmallStrainSolid:
        """Return the small-strain solid whose stiffness matrix is the tangent of this solid in the undeformed state."""
        undeformed = np.zeros(self.elements.displacements + self.elements.pressures)
        return SmallStrainSolid(elements=self.elements, stiffness=self.linearise(undeformed)[1])

    def energy(self, state: FloatArray) -> float:
        """Integrate W over the solid; in equilibrium the integral is the stored elastic energy [J].

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).
        """
        whole = slice(None)
        F, J, p = self._evaluate_fields(state, whole)
        inverse, direct = self._split_bulk(whole)
        volume = direct * (J.value - 1) ** 2 / 2 - p * (J.value - 1) - p**2 * inverse / 2
        density = self._evaluate_isochoric(F, J, whole).energy + volume
        return float((density * self.elements.weight).sum())

    def cauchy_stress(self, state: FloatArray, *, linear: bool = False) -> FloatArray:
        """Compute the Cauchy stress at the quadrature points, P F^T / J, shape (e, q, 3, 3) [Pa].

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).
            linear: Whether to return the stress of linear elasticity, the limit of a small factor on the state.
        """
        factor = _LINEAR_STRAIN / np.abs(self.elements.compute_gradient(state)).max() if linear else 1.0
        e, q = self.elements.weight.shape
        out = np.zeros((e, q, 3, 3))
        size = max(1, _POINTS // q)
        for part in (slice(start, start + size) for start in range(0, e, size)):
            F, J, p = self._evaluate_fields(factor * state, part)
            flat = self._evaluate_isochoric(F, J, part).stress
            flat = flat - (p - self._split_bulk(part)[1] * (J.value - 1))[..., None] * J.first
            first = np.zeros_like(F)
            for g, (i, j) in enumerate(self.elements.places):
                first[..., i, j] = flat[..., g]
            out[part] = np.einsum("eqik,eqjk,eq->eqij", first, F, 1 / (factor * J.value))
        return out

    def _evaluate_fields(self, state: FloatArray, part: slice) -> tuple[FloatArray, Invariant, FloatArray]:
        """Compute deformation gradient, its determinant and mean pressure at the quadrature points of some elements."""
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

    def _split_bulk(self, part: slice) -> tuple[FloatArray, FloatArray]:
        """Split the bulk modulus K of some elements into the part k that acts on the displacements and the rest.

        Returns:
            1 / (K - k) [1/Pa] and k [Pa], shape (e, 1) each.
        """
        region = self.elements.region[part]
        compliance, direct = self.bulk_compliance[region, None], self.direct_bulk[region, None]
        return compliance / (1 - direct * compliance), direct

    def _evaluate_isochoric(self, F: FloatArray, J: Invariant, part: slice) -> Response:
        """Compute isochoric energy, stress and tangent moduli of some elements at their quadrature points.

        Args:
            F: Deformation gradients, shape (e, q, 3, 3) [-].
            J: Determinants of F with derivatives.
            part: Range of the elements.
        """
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
    """Linear elastic solid, whose stiffness matrix does not depend on the displacements.

    Attributes:
        elements: Finite elements of the solid.
        stiffness: Symmetric matrix over displacement and pressure unknowns, shape (n, n).
    """

    elements: MixedElements
    stiffness: sp.csr_matrix

    def linearise(self, state: FloatArray, _expected: FloatArray | None = None) -> tuple[FloatArray, sp.csr_matrix]:
        """Compute the residual of equilibrium and the constant stiffness matrix; see `Solid.linearise`."""
        return np.asarray(self.stiffness @ state), self.stiffness

    def predict_volume(self, _before: FloatArray, _state: FloatArray) -> None:
        """Return None, because the stiffness matrix does not depend on the state; see `Solid.predict_volume`."""

    def energy(self, state: FloatArray) -> float:
        """Compute the elastic energy stored in equilibrium [J]; see `Solid.energy`."""
        return float(state @ (self.stiffness @ state)) / 2


def _count_threads() -> int:
    """Return the number of threads for assembly: `OMP_NUM_THREADS` if set, else one per available processor core."""
    allowed = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if allowed.isdecimal() and int(allowed):
        return int(allowed)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
