"""Stored energies of rubber-like materials with their first and second derivatives."""

from __future__ import annotations

from fem_reference.materials.energy import Energy, Response
from fem_reference.materials.ogden import Ogden
from fem_reference.materials.polynomial import MooneyRivlin, NeoHookean, Yeoh
from meshes import Material

__all__ = [
    "Energy",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "Response",
    "Yeoh",
    "create_energy",
    "create_finite_strain_energy",
]


def create_energy(material: Material) -> Energy:
    """Create the isochoric stored energy of a material.

    Raises:
        ValueError: If the material is `linear-elastic`, which has no stored energy at finite strain.
    """
    p = material.number
    match material.model:
        case "neo-hookean":
            return NeoHookean(shear_modulus=p("shear_modulus"))
        case "mooney-rivlin":
            return MooneyRivlin(c10=p("c10"), c01=p("c01"))
        case "yeoh":
            return Yeoh(c1=p("c1"), c2=p("c2"), c3=p("c3"))
        case "ogden":
            return Ogden(moduli=material.terms("mu"), exponents=material.terms("alpha"))
        case _:
            raise ValueError(f"{material.model} is a small-strain model; take neo-hookean for finite strain")


def create_finite_strain_energy(material: Material) -> Energy:
    """Create the isochoric stored energy of a material; `linear-elastic` becomes neo-Hookean of equal shear modulus."""
    return NeoHookean(shear_modulus=material.shear_modulus) if material.small_strain_only else create_energy(material)
