"""Isochoric invariants of the deformation gradient and their derivatives.

Shapes: F is (..., 3, 3); a first derivative is (..., 3, 3), a second (..., 3, 3, 3, 3), [i, j, k, l] for F_ij, F_kl.
Formulas by differentiating J^(-2/3) tr C and J^(-4/3) (tr^2 C - tr C^2) / 2 (Holzapfel, Nonlinear Solid Mechanics,
section 6.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_EYE = np.eye(3)
_IDENTITY = np.einsum("ik,jl->ijkl", _EYE, _EYE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Invariant:
    """An invariant with its derivatives with respect to F.

    Attributes:
        value: Shape (...) [-].
        first: Shape (..., 3, 3) [-].
        second: Shape (..., 3, 3, 3, 3) [-].
    """

    value: FloatArray
    first: FloatArray
    second: FloatArray


def volume_ratio(F: FloatArray) -> Invariant:
    """J = det F; derivatives J F^-T and J (F^-T x F^-T - F^-T dF^T F^-T)."""
    J = np.linalg.det(F)
    inverse = np.linalg.inv(F)
    cofactor = J[..., None, None] * inverse.swapaxes(-1, -2)
    outer = np.einsum("...ji,...lk->...ijkl", inverse, inverse)
    crossed = np.einsum("...li,...jk->...ijkl", inverse, inverse)
    return Invariant(value=J, first=cofactor, second=J[..., None, None, None, None] * (outer - crossed))


def first_isochoric(F: FloatArray, J: Invariant) -> Invariant:
    """J^(-2/3) tr(F^T F)."""
    trace = Invariant(
        value=np.einsum("...ij,...ij->...", F, F),
        first=2 * F,
        second=np.broadcast_to(2 * _IDENTITY, (*F.shape, 3, 3)),
    )
    return _scaled(trace, J, -2 / 3)


def second_isochoric(F: FloatArray, J: Invariant) -> Invariant:
    """J^(-4/3) (tr^2 C - tr C^2) / 2."""
    C = np.einsum("...ki,...kj->...ij", F, F)
    b = np.einsum("...ik,...jk->...ij", F, F)
    trace = np.einsum("...ii->...", C)
    wide = trace[..., None, None]
    second = (
        4 * np.einsum("...ij,...kl->...ijkl", F, F)
        + 2 * wide[..., None, None] * _IDENTITY
        - 2 * np.einsum("ik,...lj->...ijkl", _EYE, C)
        - 2 * np.einsum("...il,...kj->...ijkl", F, F)
        - 2 * np.einsum("...ik,jl->...ijkl", b, _EYE)
    )
    plain = Invariant(
        value=(trace**2 - np.einsum("...ij,...ij->...", C, C)) / 2,
        first=2 * (wide * F - F @ C),
        second=second,
    )
    return _scaled(plain, J, -4 / 3)


def _scaled(plain: Invariant, J: Invariant, power: float) -> Invariant:
    """J^power times an invariant, by the product rule."""
    scale = J.value**power
    slope = power * scale / J.value
    curve = (power - 1) * slope / J.value
    one = slope[..., None, None] * J.first
    two = slope[..., None, None, None, None] * J.second
    two = two + curve[..., None, None, None, None] * np.einsum("...ij,...kl->...ijkl", J.first, J.first)
    mixed = np.einsum("...ij,...kl->...ijkl", one, plain.first)
    return Invariant(
        value=scale * plain.value,
        first=scale[..., None, None] * plain.first + plain.value[..., None, None] * one,
        second=scale[..., None, None, None, None] * plain.second
        + mixed
        + mixed.transpose(*range(mixed.ndim - 4), -2, -1, -4, -3)
        + plain.value[..., None, None, None, None] * two,
    )
