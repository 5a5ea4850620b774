"""Indenter in the shape of an upright rod with a hemispherical end."""

from __future__ import annotations

from dataclasses import dataclass

from meshes.indenters.indenter import AxisymmetricIndenter, FloatArray, Primitive, quantity_field
from meshes.indenters.sphere import spherical_gap


@dataclass(frozen=True, kw_only=True)
class RoundedTip(AxisymmetricIndenter):
    """An upright rod with a hemispherical end (the 1 mm calibration tool of the 2015 report).

    Attributes:
        radius: Radius R of the rod and of its end [m].
    """

    radius: float = quantity_field("length", default=1e-3)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface, R - sqrt(R^2 - x^2 - y^2); inf beyond the radius [m]."""
        return spherical_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one capsule, four diameters long."""
        half_length = 3 * self.radius
        position = (0, 0, self.radius + half_length)
        return (Primitive(kind="capsule", size=(self.radius, half_length), position=position),)
