"""A sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import AxisymmetricIndenter, FloatArray, Primitive


@dataclass(frozen=True, kw_only=True)
class Sphere(AxisymmetricIndenter):
    """A sphere.

    Attributes:
        radius: Radius R [m].
    """

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """R - sqrt(R^2 - x^2 - y^2) within the radius [m]."""
        return spherical_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """One sphere."""
        return (Primitive(kind="sphere", size=(self.radius,), position=(0, 0, self.radius)),)


def spherical_gap(radius: float, x: FloatArray, y: FloatArray | float) -> FloatArray:
    """Height of a sphere over its lowest point: R - sqrt(R^2 - x^2 - y^2), inf where the root has no value [m].

    Args:
        radius: R [m].
        x: Positions relative to the lowest point, any shape [m].
        y: Positions of a shape that broadcasts with it; zero for the section of a cylinder [m].
    """
    squared = radius**2 - x**2 - y**2
    return np.where(squared >= 0, radius - np.sqrt(np.maximum(squared, 0)), np.inf)
