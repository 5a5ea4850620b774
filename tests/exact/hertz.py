"""Contact of a rigid sphere with a half space: a^3 = 3 F R / 4 E*, depth = a^2 / R (Hertz; Johnson 1985, eq. 4.22)."""

from __future__ import annotations

from typing import NamedTuple

from meshes import Layer


class Hertz(NamedTuple):
    """Depth of the sphere [m] and radius of the contact [m]."""

    depth: float
    contact_radius: float


def hertz(layer: Layer, radius: float, force: float) -> Hertz:
    """Press a sphere of a radius [m] by a force [N] into a half space of a layer's material."""
    material = layer.material
    plane = material.youngs_modulus / (1 - material.poisson_ratio**2)
    contact = (3 * force * radius / (4 * plane)) ** (1 / 3)
    return Hertz(contact**2 / radius, contact)
