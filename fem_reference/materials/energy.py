"""Interface of stored energies.

The energy per reference volume is split into W(F) = isochoric(F) + p (J - 1) - p^2 / 2 K.  The mean stress p is an
independent unknown, so that an infinite bulk modulus K needs no special case (Simo, Taylor and Pister 1985).  A
material supplies the isochoric part only, which must not change when F is multiplied by a number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fem_reference.materials.invariants import Invariant
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Energy, first Piola-Kirchhoff stress and tangent at many points.

    Attributes:
        energy: Shape (...) [J/m3].
        stress: dW/dF, the components g listed in `Invariant.places`, shape (..., g) [Pa].
        tangent: d2W/dF2, shape (..., g, g) [Pa].
    """

    energy: FloatArray
    stress: FloatArray
    tangent: FloatArray


class Energy(Protocol):
    """An isochoric stored energy."""

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent.

        Args:
            F: Deformation gradients, shape (..., 3, 3) [-].
            J: Their determinants with derivatives, from `volume_ratio`; its `places` select the components of stress
                and tangent.
        """


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """Another energy times a number, for a change of units.

    Attributes:
        energy: The other energy.
        factor: The number [-].
    """

    energy: Energy
    factor: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent, each times the factor."""
        plain = self.energy.isochoric(F, J)
        return Response(
            energy=plain.energy * self.factor, stress=plain.stress * self.factor, tangent=plain.tangent * self.factor
        )


def respond_to_invariant(invariant: Invariant, energy: FloatArray, slope: FloatArray, curve: FloatArray) -> Response:
    """Evaluate an energy w(I) that depends on one invariant: stress w' dI, tangent w'' dI x dI + w' d2I.

    Args:
        invariant: The invariant I with its derivatives.
        energy: w(I) [J/m3].
        slope: w'(I) [Pa].
        curve: w''(I) [Pa].
    """
    stress = slope[..., None] * invariant.first
    tangent = slope[..., None, None] * invariant.second
    if np.any(curve):
        tangent += (curve[..., None] * invariant.first)[..., :, None] * invariant.first[..., None, :]
    return Response(energy=energy, stress=stress, tangent=tangent)
