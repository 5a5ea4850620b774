"""Compute isochoric invariants of the deformation gradient F and their derivatives.

F has shape (..., 3, 3).  Derivatives are taken only with respect to the components of F that can differ from those of
the unit matrix: all nine in three dimensions, five in axisymmetric states.  First derivatives have shape (..., g) and
second ones (..., g, g), in the order of `places`.  The invariants are J^(-2/3) tr C and J^(-4/3) (tr^2 C - tr C^2) / 2
with C = F^T F (Holzapfel, Nonlinear Solid Mechanics, section 6.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.array_types import FloatArray

#: Row and column of each selected component of a 3 x 3 tensor.
Places = tuple[tuple[int, int], ...]

#: Row and column of all nine components of a 3 x 3 tensor, row by row.
EVERY_PLACE: Places = tuple((i, j) for i in range(3) for j in range(3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Invariant:
    """Invariant of the deformation gradient F, with its derivatives with respect to g components of F.

    Attributes:
        value: Value of the invariant, shape (...) [-].
        first: First derivatives, shape (..., g) [-].
        second: Second derivatives, shape (..., g, g) [-].
        places: Row and column in F of each of the g components.
    """

    value: FloatArray
    first: FloatArray
    second: FloatArray
    places: Places


def pick_components(tensor: FloatArray, places: Places) -> FloatArray:
    """Select g components, given by row and column, of tensors of shape (..., 3, 3); the result has shape (..., g)."""
    i, j = np.array(places).T
    return np.asarray(tensor[..., i, j])


def volume_ratio(F: FloatArray, places: Places = EVERY_PLACE) -> Invariant:
    """Compute J = det F with its first derivatives (cofactors of F) and second derivatives (signed entries of F)."""
    cofactor = {place: _minor(F, *place) for place in {*places, (0, 0), (0, 1), (0, 2)}}
    second = np.zeros((*F.shape[:-2], len(places), len(places)))
    for a, (i, j) in enumerate(places):
        for b, (k, m) in enumerate(places):
            if i != k and j != m:
                second[..., a, b] = _sign(i, k) * _sign(j, m) * F[..., 3 - i - k, 3 - j - m]
    return Invariant(
        value=sum((F[..., 0, j] * cofactor[0, j] for j in range(3)), np.zeros(F.shape[:-2])),
        first=np.stack([cofactor[place] for place in places], axis=-1),
        second=second,
        places=places,
    )


def first_isochoric(F: FloatArray, J: Invariant) -> Invariant:
    """Compute the first isochoric invariant J^(-2/3) tr C with its derivatives."""
    trace = Invariant(
        value=np.einsum("...ij,...ij->...", F, F),
        first=2 * pick_components(F, J.places),
        second=2 * np.eye(len(J.places)),
        places=J.places,
    )
    return _multiply_by_power(trace, J, -2 / 3)


def second_isochoric(F: FloatArray, J: Invariant) -> Invariant:
    """Compute the second isochoric invariant J^(-4/3) (tr^2 C - tr C^2) / 2 with its derivatives."""
    C = F.swapaxes(-1, -2) @ F
    b = F @ F.swapaxes(-1, -2)
    trace = np.einsum("...ii->...", C)
    i, j = np.array(J.places).T
    k, m = i, j  # component of F of the second differentiation, along the last axis
    i, j = i[:, None], j[:, None]
    flat = pick_components(F, J.places)
    second = (
        4 * flat[..., :, None] * flat[..., None, :]
        + 2 * trace[..., None, None] * ((i == k) & (j == m))
        - 2 * (i == k) * C[..., m, j]
        - 2 * F[..., i, m] * F[..., k, j]
        - 2 * b[..., i, k] * (j == m)
    )
    plain = Invariant(
        value=(trace**2 - np.einsum("...ij,...ij->...", C, C)) / 2,
        first=2 * (trace[..., None] * flat - pick_components(F @ C, J.places)),
        second=second,
        places=J.places,
    )
    return _multiply_by_power(plain, J, -4 / 3)


def _multiply_by_power(plain: Invariant, J: Invariant, power: float) -> Invariant:
    """Multiply an invariant by a power of J; the derivatives of the product follow from the product rule."""
    scale = J.value**power
    slope = power * scale / J.value
    curve = (power - 1) * slope / J.value * plain.value
    mixed = (slope[..., None] * plain.first)[..., :, None] * J.first[..., None, :]
    second = (curve[..., None] * J.first)[..., :, None] * J.first[..., None, :]
    second += mixed
    second += mixed.swapaxes(-1, -2)
    second += (slope * plain.value)[..., None, None] * J.second
    second += scale[..., None, None] * plain.second
    return Invariant(
        value=scale * plain.value,
        first=scale[..., None] * plain.first + (slope * plain.value)[..., None] * J.first,
        second=second,
        places=J.places,
    )


def _minor(F: FloatArray, i: int, j: int) -> FloatArray:
    """Compute the cofactor of F_ij."""
    k, m, p, q = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return np.asarray(F[..., k, p] * F[..., m, q] - F[..., k, q] * F[..., m, p])


def _sign(i: int, k: int) -> int:
    """Return the sign of the permutation (i, k, remaining index) of (0, 1, 2)."""
    return 1 if (k - i) % 3 == 1 else -1
