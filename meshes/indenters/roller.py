"""Indenter in the shape of a cylinder lying on its side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import FloatArray, Indenter, Primitive, quantity_field, require_positive
from meshes.indenters.sphere import spherical_gap


@dataclass(frozen=True, kw_only=True)
class Roller(Indenter):
    """A cylinder lying on its side, along y.

    Attributes:
        radius: Radius R of the cylinder [m].
        length: Length of the cylinder along y [m].
    """

    radius: float = quantity_field("length")
    length: float = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the lengths.

        Raises:
            ValueError: If a length is not positive.
        """
        require_positive(self, self.radius, self.length)

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Symmetry about the planes x = 0 and y = 0: always true."""
        return (True, True)

    @property
    def footprint(self) -> tuple[float, float]:
        """Half edge lengths of the shape in plan: the radius along x and half the length along y [m]."""
        return (self.radius, self.length / 2)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface, R - sqrt(R^2 - x^2); inf beyond the radius or the length [m]."""
        return np.where(np.abs(y) <= self.length / 2, spherical_gap(self.radius, x, 0.0), np.inf)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one cylinder, rotated by 90 degrees about x."""
        rotation = (float(np.sqrt(0.5)), float(np.sqrt(0.5)), 0.0, 0.0)
        size = (self.radius, self.length / 2)
        return (Primitive(kind="cylinder", size=size, position=(0, 0, self.radius), quaternion=rotation),)
