"""Indenter in the shape of the letter H."""

from __future__ import annotations

from dataclasses import dataclass

from meshes.indenters.indenter import Primitive, quantity_field, require_positive
from meshes.indenters.polygonal_punch import PolygonalPunch
from meshes.indenters.polygons import Polygon


@dataclass(frozen=True, kw_only=True)
class LetterH(PolygonalPunch):
    """A block in the shape of the letter H, with its legs along y.

    Attributes:
        size: Edge lengths of the whole letter along x and y [m].
        bar: Width of the legs, and of the bar between them [m].
    """

    size: tuple[float, float] = quantity_field("length")
    bar: float = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the lengths.

        Raises:
            ValueError: If a length is not positive, or the bar is so wide that the letter fills its whole rectangle.
        """
        require_positive(self, *self.size, self.bar)
        if not (2 * self.bar < self.size[0] and self.bar < self.size[1]):
            raise ValueError(
                f"LetterH needs a bar that leaves room between the legs, not {self.bar} m in {self.size} m"
            )

    @property
    def polygons(self) -> tuple[Polygon]:
        """Outline of the letter, one polygon, counterclockwise [m]."""
        half_x, half_y = self.size[0] / 2, self.size[1] / 2
        leg, bar = half_x - self.bar, self.bar / 2
        quarter = [(half_x, half_y), (leg, half_y), (leg, bar)]
        half = quarter + [(-x, y) for x, y in reversed(quarter)]
        return (half + [(-x, -y) for x, y in half],)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return three boxes, two legs and the bar, as tall as the legs are long."""
        half_x, half_y = self.size[0] / 2, self.size[1] / 2
        bar = self.bar / 2
        parts = ((bar, half_y, half_x - bar), (bar, half_y, bar - half_x), (half_x - self.bar, bar, 0.0))
        return tuple(Primitive(kind="box", size=(a, b, half_y), position=(x, 0, half_y)) for a, b, x in parts)
