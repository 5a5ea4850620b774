"""Interface of stored energies of hyperelastic materials.

The energy per reference volume is W(F) = isochoric(F) - p (J - 1) - p^2 / 2 K, with the deformation gradient F and its
determinant J.  The mean pressure p is an independent unknown, so that an infinite bulk modulus K needs no special case
(Simo, Taylor and Pister 1985).  A material supplies only the isochoric part, which must not change when F is multiplied
by a number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fem_reference.materials.invariants import Invariant
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Stored energy, first Piola-Kirchhoff stress and tangent moduli at many points.

    Attributes:
        energy: Stored energy W per reference volume, shape (...) [J/m3].
        stress: dW/dF, the g components listed in `Invariant.places`, shape (..., g) [Pa].
        tangent: d2W/dF2, derivatives of these components with respect to the same components of F, shape (..., g, g)
            [Pa].
    """

    energy: FloatArray
    stress: FloatArray
    tangent: FloatArray


class Energy(Protocol):
    """Interface of an isochoric stored energy, which does not depend on the volume ratio."""

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli.

        Args:
            F: Deformation gradients, shape (..., 3, 3) [-].
            J: Determinants of F with derivatives, from `volume_ratio`; `J.places` selects the components of stress and
                tangent.
        """


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """Stored energy of another material times a constant factor, for a change of units.

    Attributes:
        energy: Energy that is multiplied.
        factor: Constant factor on the energy [-].
    """

    energy: Energy
    factor: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli, each times the factor; see `Energy.isochoric`."""
        plain = self.energy.isochoric(F, J)
        return Response(
            energy=plain.energy * self.factor, stress=plain.stress * self.factor, tangent=plain.tangent * self.factor
        )


def respond_to_invariant(invariant: Invariant, energy: FloatArray, slope: FloatArray, curve: FloatArray) -> Response:
    """Compute stress w' dI/dF and tangent w'' dI/dF x dI/dF + w' d2I/dF2 of an energy w(I) of one invariant I.

    Args:
        invariant: Invariant I with its derivatives with respect to F.
        energy: Energy w(I) at each point, shape (...) [J/m3].
        slope: First derivative w'(I), shape (...) [Pa].
        curve: Second derivative w''(I), shape (...) [Pa].
    """
    stress = slope[..., None] * invariant.first
    tangent = slope[..., None, None] * invariant.second
    if np.any(curve):
        tangent += (curve[..., None] * invariant.first)[..., :, None] * invariant.first[..., None, :]
    return Response(energy=energy, stress=stress, tangent=tangent)
