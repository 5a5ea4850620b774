"""Neo-Hookean rubber."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.materials.energy import Response, respond_to_invariant
from fem_reference.materials.invariants import Invariant, first_isochoric
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class NeoHookean:
    """W = mu / 2 (I1 - 3), I1 isochoric (Treloar 1943).

    Attributes:
        shear_modulus: mu [Pa].
    """

    shear_modulus: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent."""
        I1 = first_isochoric(F, J)
        slope = np.full_like(I1.value, self.shear_modulus / 2)
        return respond_to_invariant(I1, slope * (I1.value - 3), slope, np.zeros_like(slope))
