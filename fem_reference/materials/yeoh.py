"""Yeoh rubber."""

from __future__ import annotations

from dataclasses import dataclass

from fem_reference.materials.energy import Response, respond_to_invariant
from fem_reference.materials.invariants import Invariant, first_isochoric
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class Yeoh:
    """W = c1 x + c2 x^2 + c3 x^3, x = I1 - 3, I1 isochoric (Yeoh 1993).

    Attributes:
        c1: First modulus [Pa].
        c2: Second modulus [Pa].
        c3: Third modulus [Pa].
    """

    c1: float
    c2: float
    c3: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent."""
        I1 = first_isochoric(F, J)
        x = I1.value - 3
        return respond_to_invariant(
            I1,
            x * (self.c1 + x * (self.c2 + x * self.c3)),
            self.c1 + x * (2 * self.c2 + x * 3 * self.c3),
            2 * self.c2 + 6 * self.c3 * x,
        )
