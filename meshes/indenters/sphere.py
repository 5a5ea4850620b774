"""Indenter in the shape of a sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import AxisymmetricIndenter, FloatArray, Primitive


@dataclass(frozen=True, kw_only=True)
class Sphere(AxisymmetricIndenter):
    """A sphere.

    Attributes:
        radius: Radius R of the sphere [m].
    """

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface, R - sqrt(R^2 - x^2 - y^2); inf beyond the radius [m]."""
        return spherical_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one sphere."""
        return (Primitive(kind="sphere", size=(self.radius,), position=(0, 0, self.radius)),)


def spherical_gap(radius: float, x: FloatArray, y: FloatArray | float) -> FloatArray:
    """Compute the height of a sphere's lower surface over its lowest point, R - sqrt(R^2 - x^2 - y^2).

    Args:
        radius: Radius R of the sphere [m].
        x: x coordinates relative to the sphere's centre, any shape [m].
        y: y coordinates of a shape that broadcasts with that of `x`; zero for a cylinder along y [m].

    Returns:
        Heights, inf beyond the radius, in the broadcast shape [m].
    """
    squared = radius**2 - x**2 - y**2
    return np.where(squared >= 0, radius - np.sqrt(np.maximum(squared, 0)), np.inf)
