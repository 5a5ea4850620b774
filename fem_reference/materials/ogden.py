"""Stored energy of Ogden's model of rubber, with any number of terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.materials.energy import Response
from fem_reference.materials.invariants import Invariant, pick_components
from meshes.array_types import FloatArray

#: Relative difference of two principal stretches below which divided differences of the stresses are replaced by their
#: limit for equal stretches, to avoid cancellation [-].
_EQUAL = 1e-5


@dataclass(frozen=True, kw_only=True)
class Ogden:
    """Ogden energy W = sum 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) (Ogden 1972).

    l1, l2 and l3 are the isochoric principal stretches.  The small-strain shear modulus is the sum of the mu.
    Derivatives are computed in the frame of the singular value decomposition F = U diag(l) V^T.  In this frame the
    stress is diagonal, and the tangent couples each pair of axes through divided differences (Smith, De Goes and Kim,
    Analytic eigensystems for isotropic distortion energies, 2019), which are finite for equal stretches.

    Attributes:
        moduli: Modulus mu of each term [Pa].
        exponents: Exponent alpha of each term, not zero [-].
    """

    moduli: tuple[float, ...]
    exponents: tuple[float, ...]

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        U, stretch, Vt = np.linalg.svd(F)
        energy, slope, curve = self._differentiate_principal(stretch, J.value)
        i, j = np.array(J.places).T
        tangent = _rotate(U, stretch, Vt, slope, curve)[..., i[:, None], j[:, None], i, j]
        return Response(
            energy=energy, stress=pick_components((U * slope[..., None, :]) @ Vt, J.places), tangent=tangent
        )

    def _differentiate_principal(self, stretch: FloatArray, J: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute the energy, its gradient and its Hessian with respect to the three principal stretches.

        Args:
            stretch: Principal stretches, shape (..., 3) [-].
            J: Volume ratios, shape (...) [-].

        Returns:
            Energy, shape (...) [J/m3], gradient, shape (..., 3) [Pa], and Hessian, shape (..., 3, 3) [Pa].
        """
        energy = np.zeros_like(J)
        slope = np.zeros_like(stretch)
        curve = np.zeros((*stretch.shape, 3))
        inverse = 1 / stretch
        for mu, alpha in zip(self.moduli, self.exponents, strict=True):
            powers = stretch**alpha * (J ** (-alpha / 3))[..., None]
            total = powers.sum(axis=-1, keepdims=True)
            energy += 2 * mu / alpha**2 * (total[..., 0] - 3)
            part = 2 * mu / alpha * (powers - total / 3)  # l dW/dl
            slope += part * inverse
            cross = -powers[..., :, None] / 3 - powers[..., None, :] / 3 + total[..., None] / 9
            block = 2 * mu * cross * inverse[..., :, None] * inverse[..., None, :]
            diagonal = (2 * mu * powers - part) * inverse**2
            curve += block + diagonal[..., None] * np.eye(3)
        return energy, slope, curve


def _rotate(U: FloatArray, stretch: FloatArray, Vt: FloatArray, slope: FloatArray, curve: FloatArray) -> FloatArray:
    """Compute the tangent moduli d2W/dF2 from gradient and Hessian of the energy W in the singular values of F.

    Args:
        U: Left singular vectors of F, shape (..., 3, 3) [-].
        stretch: Singular values of F, shape (..., 3) [-].
        Vt: Transposed right singular vectors of F, shape (..., 3, 3) [-].
        slope: Gradient of the energy, shape (..., 3) [Pa].
        curve: Hessian of the energy, shape (..., 3, 3) [Pa].

    Returns:
        Tangent moduli, shape (..., 3, 3, 3, 3) [Pa].
    """
    local = np.zeros((*stretch.shape, 3, 3, 3))
    for a in range(3):
        for b in range(3):
            local[..., a, a, b, b] += curve[..., a, b]
            if a < b:
                plus, minus = _divide_differences(stretch, slope, curve, a, b)
                for i, j in ((a, b), (b, a)):
                    local[..., i, j, i, j] += (minus + plus) / 2
                    local[..., i, j, j, i] += (minus - plus) / 2
    turned = np.einsum("...ia,...bj,...abcd,...kc,...dl->...ijkl", U, Vt, local, U, Vt, optimize=True)
    return np.asarray(turned)


def _divide_differences(
    stretch: FloatArray, slope: FloatArray, curve: FloatArray, a: int, b: int
) -> tuple[FloatArray, FloatArray]:
    """Compute (Wa + Wb) / (la + lb) and (Wa - Wb) / (la - lb); Wa is the derivative of the energy in the stretch la.

    Where la and lb are equal, the second quotient is replaced by its limit.
    """
    gap = stretch[..., a] - stretch[..., b]
    close = np.abs(gap) < _EQUAL * stretch[..., a]
    limit = (curve[..., a, a] + curve[..., b, b]) / 2 - curve[..., a, b]
    minus = np.where(close, limit, (slope[..., a] - slope[..., b]) / np.where(close, 1.0, gap))
    plus = (slope[..., a] + slope[..., b]) / (stretch[..., a] + stretch[..., b])
    return plus, minus
