"""Flat punches whose face is bounded by polygons: any prism, the letter H and a hexagonal nut."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from meshes.array_types import FloatArray
from meshes.indenters.indenter import FlatPunch, Primitive, quantity_field, require_positive
from meshes.indenters.polygons import (
    Polygon,
    check_polygon,
    compute_distance_from_inset,
    compute_signed_distance,
    find_inside,
    list_sides,
    make_hexagon,
    split_into_convex_parts,
)

Outline = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Numbers of the punches; an outline is symmetric if its image deviates by less than the sum of both tolerances."""

    #: Tolerance over the larger half width of the shape [-]; rounding in STL files of single precision.
    relative_tolerance: float = 1e-6
    #: Tolerance [m]; rounding in double precision.
    tolerance: float = 1e-9
    #: Height of a nut over its width across flats [-]; as of ISO 4032.  Only the lower face touches the cover.
    nut_height: float = 0.8


_NUMBERS = _Numbers()


class PolygonalPunch(FlatPunch):
    """A flat punch whose face is the set of points inside an odd number of polygons."""

    @property
    @abstractmethod
    def polygons(self) -> Sequence[Polygon]:
        """Closed polygons that bound the face, each a sequence of corners (x, y) [m]."""

    @property
    def footprint(self) -> tuple[float, float]:
        """Largest distance of a corner from the axis along x, and the same along y [m]."""
        half = np.abs(np.concatenate([np.array(polygon) for polygon in self.polygons])).max(axis=0)
        return (float(half[0]), float(half[1]))

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the outline is symmetric about the plane x = 0, and whether about the plane y = 0.

        The outline counts as symmetric if the mirror images of all corners and of the middles of all sides lie on it.
        """
        ends = list_sides(self.polygons)
        points = np.concatenate([ends[:, 0], ends.mean(axis=1)])
        tolerance = _NUMBERS.tolerance + _NUMBERS.relative_tolerance * max(self.footprint)
        in_x, in_y = (
            bool(np.abs(self.signed_distance(*(points * signs).T)).max() < tolerance) for signs in ((-1, 1), (1, -1))
        )
        return (in_x, in_y)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface: zero inside the outline and on it, inf outside [m]."""
        return np.where(find_inside(self.polygons, x, y), 0.0, np.inf)

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the outline, positive inside and negative outside [m]."""
        return compute_signed_distance(self.polygons, x, y)

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the part of the face that lies deeper inside the outline than the inset.

        Returns:
            Distances, zero inside that part, shape of `x` and `y` [m].

        Raises:
            ValueError: If no point lies deeper inside the outline than the inset.
            ModuleNotFoundError: If manifold3d is not installed.
        """
        return compute_distance_from_inset(self.polygons, inset, x, y)


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
            Primitive(
                kind="hull",
                vertices=tuple((x, y, z) for z in (0.0, _NUMBERS.nut_height * self.across) for x, y in corners),
            )
            for corners in sectors
        )


def match_hexagon(diameter: float) -> float:
    """Compute the width across flats w of the hexagon that has the area of a circle: sqrt(3) / 2 w^2 = pi / 4 d^2 [m].

    Args:
        diameter: Diameter d of the circle [m].
    """
    return diameter * float(np.sqrt(np.pi / (2 * np.sqrt(3))))
