"""Find the stretch at which a rubber-like material loses its stability."""

from __future__ import annotations

import numpy as np

from fem_reference.materials import create_energy
from fem_reference.materials.invariants import EVERY_PLACE, volume_ratio
from meshes import Material
from meshes.array_types import FloatArray

#: Homogeneous deformations of incompressible material by name: logarithms of the principal stretches, over that of the
#: stretch that is stated.  Planar compression is planar tension along another axis.
_MODES = {
    "uniaxial tension": (1.0, -0.5, -0.5),
    "uniaxial compression": (-1.0, 0.5, 0.5),
    "equibiaxial tension": (1.0, 1.0, -2.0),
    "equibiaxial compression": (-1.0, -1.0, 2.0),
    "planar tension": (1.0, -1.0, 0.0),
}
#: Modes in which the thickness of a pressed cover shrinks, and the exponent of their stretch in the thickness [-].
_SQUEEZING = {"uniaxial compression": 1.0, "equibiaxial tension": -2.0, "planar tension": -1.0}
#: Largest stretch, or reciprocal of the smallest, that is examined, and number of stretches up to it [-].
_LARGEST, _STRETCHES = 8.0, 600


def find_unstable_stretches(material: Material) -> dict[str, float]:
    """Find the stretches at which an incompressible material loses its stability.

    A material is stable as long as true stress rises with logarithmic strain (Drucker's criterion, as finite-element
    programs apply it to fits of rubber).  The volume is held constant, so that the result is exact for Poisson ratio
    0.5.

    Args:
        material: Material; `linear-elastic` is always stable.

    Returns:
        The stretch nearest to 1 at which stability is lost, by kind of deformation, for the kinds that lose it at
        stretches between 1/8 and 8 [-].
    """
    if material.small_strain_only:
        return {}
    strain = np.linspace(0, np.log(_LARGEST), _STRETCHES)[1:]
    out = {}
    for mode, direction in _MODES.items():
        falls = np.flatnonzero(np.diff(_measure_stress(material, strain, np.array(direction))) <= 0)
        if falls.size:
            out[mode] = float(np.exp(direction[0] * strain[falls[0]]))
    return out


def describe_instability(material: Material) -> str:
    """Say in words at which stretches a material loses its stability; empty if it does not up to a stretch of 8."""
    found = find_unstable_stretches(material)
    listed = ", ".join(f"{mode} at a stretch of {stretch:.3g}" for mode, stretch in found.items())
    return f"the material {material.name} loses stability in {listed}" if found else ""


def warn_of_instability(material: Material, thickness: float) -> str:
    """Say in words that a pressed material is beyond its stability; empty if it is not.

    The mean compression of the cover under the indenter is compared with the stretches of `find_unstable_stretches`.
    Local strains are larger, so a result without this warning may also contain unstable places.

    Args:
        material: Material of a layer.
        thickness: Thickness of the pressed cover over the undeformed thickness [-].
    """
    found = find_unstable_stretches(material)
    beyond = [mode for mode, power in _SQUEEZING.items() if mode in found and thickness < found[mode] ** power]
    if not beyond:
        return ""
    return f"{describe_instability(material)}; the cover is pressed to {thickness:.0%} of its thickness, beyond that"


def _measure_stress(material: Material, strain: FloatArray, direction: FloatArray) -> FloatArray:
    """Compute the derivative of the stored energy along principal logarithmic strains `strain * direction` [Pa].

    Args:
        material: Material with a stored energy.
        strain: Strains, shape (n,) [-].
        direction: Principal strains per strain, with sum 0, shape (3,) [-].
    """
    stretch = np.exp(np.outer(strain, direction))
    F = stretch[:, :, None] * np.eye(3)
    first = create_energy(material).isochoric(F, volume_ratio(F, EVERY_PLACE)).stress.reshape(-1, 3, 3)
    return np.asarray((np.einsum("nii->ni", first) * stretch) @ direction)
