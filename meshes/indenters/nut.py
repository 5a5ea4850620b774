"""Indenter in the shape of a hexagonal nut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import Primitive, quantity_field, require_positive
from meshes.indenters.polygonal_punch import PolygonalPunch
from meshes.indenters.polygons import Polygon, make_hexagon

#: Height of the nut over its width across flats.  The value has no effect on results, because only the lower face
#: touches the cover [-].
_HEIGHT = 0.8


@dataclass(frozen=True, kw_only=True)
class Nut(PolygonalPunch):
    """A hexagonal nut lying flat, with two of its six side faces perpendicular to x.

    The round bore is replaced by a hexagon of the same area, so that six convex prisms make up the nut exactly.

    Attributes:
        across: Width across flats, the distance between opposite side faces [m].
        bore: Diameter of the round bore [m].
    """

    across: float = quantity_field("length")
    bore: float = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the lengths.

        Raises:
            ValueError: If a length is not positive, or the bore is so wide that no wall is left.
        """
        require_positive(self, self.across, self.bore)
        if not match_hexagon(self.bore) < self.across:
            raise ValueError(f"Nut needs a bore that leaves a wall, not {self.bore} m in {self.across} m")

    @property
    def polygons(self) -> tuple[Polygon, ...]:
        """Outer hexagon, and the hexagon that replaces the bore [m]."""
        return (make_hexagon(self.across), make_hexagon(match_hexagon(self.bore)))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return six convex prisms, one at each side face of the nut."""
        outer, inner = self.polygons
        sectors = [(outer[k], outer[k - 1], inner[k], inner[k - 1]) for k in range(6)]
        return tuple(
            Primitive(kind="hull", vertices=tuple((x, y, z) for z in (0.0, _HEIGHT * self.across) for x, y in corners))
            for corners in sectors
        )


def match_hexagon(diameter: float) -> float:
    """Compute the width across flats w of the hexagon that has the area of a circle: sqrt(3) / 2 w^2 = pi / 4 d^2 [m].

    Args:
        diameter: Diameter d of the circle [m].
    """
    return diameter * float(np.sqrt(np.pi / (2 * np.sqrt(3))))
