"""Indenter in the shape of a prism of any outline, which presses with its flat, sharp-edged face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from meshes.indenters.convex_parts import split_into_convex_parts
from meshes.indenters.indenter import FloatArray, Primitive
from meshes.indenters.polygonal_punch import PolygonalPunch
from meshes.indenters.polygons import check_polygon

Outline = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Prism(PolygonalPunch):
    """A prism whose face is bounded by one or several polygons; its axis goes through the point (0, 0).

    Attributes:
        points: Corners (x, y) of the outer outline, clockwise or counterclockwise, shape (n, 2) [m].
        holes: Further outlines, each a sequence of corners (x, y).  An outline inside the outer outline bounds a hole;
            an outline beside it bounds another piece of the face.  Points inside an odd number of outlines are solid
            [m].
    """

    points: Outline = field(metadata={"quantity": "points"})
    holes: tuple[Outline, ...] = ()

    def __post_init__(self) -> None:
        """Check the outlines.

        Raises:
            ValueError: If an outline is not a simple polygon, or the axis lies outside the shape's bounding rectangle.
        """
        object.__setattr__(self, "points", _as_floats(self.points))
        object.__setattr__(self, "holes", tuple(_as_floats(hole) for hole in self.holes))
        for polygon in self.polygons:
            check_polygon(polygon)
        require_axis_inside(np.concatenate([np.array(polygon) for polygon in self.polygons]))

    @property
    def polygons(self) -> tuple[Outline, ...]:
        """Outer outline and further outlines [m]."""
        return (self.points, *self.holes)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return convex prisms that make up the prism, as tall as the larger half width of its footprint."""
        height = max(self.footprint)
        return tuple(
            Primitive(kind="hull", vertices=tuple((float(x), float(y), z) for z in (0.0, height) for x, y in part))
            for part in split_into_convex_parts(self.polygons)
        )


def require_axis_inside(points: FloatArray) -> None:
    """Check that the indenter's axis, at (0, 0), lies within the bounding rectangle of the shape.

    Args:
        points: Points (x, y) of the shape, shape (n, 2) [m].

    Raises:
        ValueError: If the axis lies outside the rectangle.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if (low > 0).any() or (high < 0).any():
        (a, b), (c, d) = 1e3 * low, 1e3 * high
        raise ValueError(
            f"the axis, at (0, 0), must stand within the shape's extent, x {a:.4g}..{c:.4g} mm, y {b:.4g}..{d:.4g} mm; "
            "move the shape"
        )


def _as_floats(outline: Outline) -> Outline:
    return tuple((float(x), float(y)) for x, y in outline)
