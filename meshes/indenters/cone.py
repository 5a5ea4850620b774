"""Indenter in the shape of a cone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import AxisymmetricIndenter, FloatArray, Primitive, quantity_field

#: Number of sides of the pyramid that replaces the cone in the fast model.  The edges of the pyramid lie on the cone;
#: the middles of its faces are up to 1 / cos(pi / 96) - 1 = 0.05 % higher [-].
_SIDES = 96


@dataclass(frozen=True, kw_only=True)
class Cone(AxisymmetricIndenter):
    """A cone standing on its tip.

    Attributes:
        angle: Angle at the tip, between opposite sides of the cone [rad].
        radius: Radius of the cone's upper end [m].
    """

    angle: float = quantity_field("angle")

    def __post_init__(self) -> None:
        """Check the radius and the angle.

        Raises:
            ValueError: If the radius is not positive, or the angle not between 0 and 180 degrees.
        """
        super().__post_init__()
        if not 0 < self.angle < np.pi:
            raise ValueError(f"Cone needs an angle between 0 and 180 degrees, not {np.degrees(self.angle):g}")

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the cone over its tip, r / tan(angle / 2) at distance r from the axis [m].

        Beyond the radius of the upper end the height is inf.
        """
        r = np.hypot(x, y)
        return np.where(r <= self.radius, r / np.tan(self.angle / 2), np.inf)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one hull: a pyramid of `_SIDES` sides on its tip, and on the pyramid a prism as tall as the radius."""
        turn = np.arange(_SIDES) * 2 * np.pi / _SIDES
        height = self.radius / np.tan(self.angle / 2)
        rim = [(float(self.radius * np.cos(t)), float(self.radius * np.sin(t))) for t in turn]
        ends = [(x, y, z) for z in (height, height + self.radius) for x, y in rim]
        return (Primitive(kind="hull", vertices=((0.0, 0.0, 0.0), *ends)),)
