"""Indenter in the shape of an upright cylinder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import AxisymmetricIndenter, FlatPunch, FloatArray, Primitive, require_remainder


@dataclass(frozen=True, kw_only=True)
class Cylinder(AxisymmetricIndenter, FlatPunch):
    """An upright cylinder with a flat, sharp-edged end.

    Attributes:
        radius: Radius of the cylinder [m].
    """

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the circular outline, positive inside and negative outside [m]."""
        return np.asarray(self.radius - np.hypot(x, y))

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the disk whose radius is smaller by the inset.

        Returns:
            Distances, zero inside the smaller disk, shape of `x` and `y` [m].

        Raises:
            ValueError: If the inset is not smaller than the radius.
        """
        require_remainder(inset, self.radius)
        return np.maximum(np.hypot(x, y) - self.radius + inset, 0.0)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one cylinder, one diameter tall."""
        return (Primitive(kind="cylinder", size=(self.radius, self.radius), position=(0, 0, self.radius)),)
