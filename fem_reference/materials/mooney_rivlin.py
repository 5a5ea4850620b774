"""Mooney-Rivlin rubber."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.materials.energy import Response, respond_to_invariant
from fem_reference.materials.invariants import Invariant, first_isochoric, second_isochoric
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin:
    """W = c10 (I1 - 3) + c01 (I2 - 3), isochoric invariants (Mooney 1940, Rivlin 1948).

    Attributes:
        c10: First modulus [Pa].
        c01: Second modulus [Pa].
    """

    c10: float
    c01: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent."""
        I1, I2 = first_isochoric(F, J), second_isochoric(F, J)
        zero = np.zeros_like(I1.value)
        one = respond_to_invariant(I1, self.c10 * (I1.value - 3), zero + self.c10, zero)
        two = respond_to_invariant(I2, self.c01 * (I2.value - 3), zero + self.c01, zero)
        return Response(
            energy=one.energy + two.energy, stress=one.stress + two.stress, tangent=one.tangent + two.tangent
        )
