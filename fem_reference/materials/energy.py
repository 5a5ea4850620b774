"""What every stored energy offers, and the volumetric part that all of them share.

The energy per reference volume is split: W(F) = isochoric(F) + p (J - 1) - p^2 / 2 K, with the mean pressure -p as an
independent unknown, so that K = infinity is one more number (Simo, Taylor and Pister 1985).  Materials supply the
isochoric part alone; it must not change when F is multiplied by a number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fem_reference.materials.invariants import Invariant

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Energy, first Piola-Kirchhoff stress and its derivative.

    Attributes:
        energy: Shape (...) [J/m3].
        stress: dW/dF, components of `Invariant.places`, shape (..., g) [Pa].
        tangent: d2W/dF2, shape (..., g, g) [Pa].
    """

    energy: FloatArray
    stress: FloatArray
    tangent: FloatArray


class Energy(Protocol):
    """An isochoric stored energy."""

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Energy, stress and tangent.

        Args:
            F: Deformation gradients, shape (..., 3, 3) [-].
            J: Their determinants with derivatives, as `volume_ratio` gives them; its `places` are the response's.
        """


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """Another energy times a number, as a change of units needs it.

    Attributes:
        energy: The other energy.
        factor: The number [-].
    """

    energy: Energy
    factor: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Energy, stress and tangent, all scaled."""
        plain = self.energy.isochoric(F, J)
        return Response(
            energy=plain.energy * self.factor, stress=plain.stress * self.factor, tangent=plain.tangent * self.factor
        )


def of_invariant(invariant: Invariant, energy: FloatArray, slope: FloatArray, curve: FloatArray) -> Response:
    """Response of w(I): stress w' dI, tangent w'' dI x dI + w' d2I.

    Args:
        invariant: I with derivatives.
        energy: w(I) [J/m3].
        slope: w'(I) [Pa].
        curve: w''(I) [Pa].
    """
    stress = slope[..., None] * invariant.first
    tangent = slope[..., None, None] * invariant.second
    if np.any(curve):
        tangent += (curve[..., None] * invariant.first)[..., :, None] * invariant.first[..., None, :]
    return Response(energy=energy, stress=stress, tangent=tangent)
