"""The cover's first shear resonance, which bounds how fast a quasi-static press may change."""

from __future__ import annotations

import math

from meshes import Cover, SolidCover

#: Density of rubber [kg/m3].
_DENSITY = 1100.0
#: Share of the first shear resonance up to which the inertia of the cover is negligible [-].
SLOW = 0.1
#: Bandwidth of a change times the time that it takes [-].
BANDWIDTH = 0.35


def find_resonance(cover: Cover | SolidCover) -> float:
    """Compute the frequency of the first shear resonance of a cover bonded to a rigid base, sqrt(G / rho) / (4 h) [Hz].

    A stack of layers is taken as one layer with the mean shear compliance; the density is that of rubber.
    """
    compliance = sum(layer.thickness / layer.material.shear_modulus for layer in cover.layers) / cover.thickness
    return float(math.sqrt(1 / (compliance * _DENSITY)) / (4 * cover.thickness))


def warn_of_inertia(fastest: float, resonance: float) -> tuple[str, ...]:
    """Return a warning if a press changes at frequencies [Hz] at which the cover's inertia counts; else none."""
    if fastest <= SLOW * resonance:
        return ()
    sentence = (
        f"load or place change at up to {fastest:.3g} Hz, above a tenth of the cover's first shear resonance of "
        f"{resonance:.3g} Hz: its inertia, which is neglected, counts"
    )
    return (sentence,)
