"""Stored energies of rubber that are polynomials of the isochoric invariants I1 and I2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.materials.energy import Response, respond_to_invariant
from fem_reference.materials.invariants import Invariant, first_isochoric, second_isochoric
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class NeoHookean:
    """Neo-Hookean energy W = mu / 2 (I1 - 3) (Treloar 1943).

    Attributes:
        shear_modulus: Shear modulus mu [Pa].
    """

    shear_modulus: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1 = first_isochoric(F, J)
        slope = np.full_like(I1.value, self.shear_modulus / 2)
        return respond_to_invariant(I1, slope * (I1.value - 3), slope, np.zeros_like(slope))


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin:
    """Mooney-Rivlin energy W = c10 (I1 - 3) + c01 (I2 - 3) (Mooney 1940, Rivlin 1948).

    Attributes:
        c10: Modulus of the term in I1 [Pa].
        c01: Modulus of the term in I2 [Pa].
    """

    c10: float
    c01: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1, I2 = first_isochoric(F, J), second_isochoric(F, J)
        zero = np.zeros_like(I1.value)
        one = respond_to_invariant(I1, self.c10 * (I1.value - 3), zero + self.c10, zero)
        two = respond_to_invariant(I2, self.c01 * (I2.value - 3), zero + self.c01, zero)
        return Response(
            energy=one.energy + two.energy, stress=one.stress + two.stress, tangent=one.tangent + two.tangent
        )


@dataclass(frozen=True, kw_only=True)
class Yeoh:
    """Yeoh energy W = c1 x + c2 x^2 + c3 x^3 with x = I1 - 3 (Yeoh 1993).

    Attributes:
        c1: Modulus of the linear term [Pa].
        c2: Modulus of the quadratic term [Pa].
        c3: Modulus of the cubic term [Pa].
    """

    c1: float
    c2: float
    c3: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1 = first_isochoric(F, J)
        x = I1.value - 3
        return respond_to_invariant(
            I1,
            x * (self.c1 + x * (self.c2 + x * self.c3)),
            self.c1 + x * (2 * self.c2 + x * 3 * self.c3),
            2 * self.c2 + 6 * self.c3 * x,
        )
