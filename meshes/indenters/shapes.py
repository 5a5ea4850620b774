"""Rigid indenters, the bodies that press on a cover: the base classes, simple shapes, and punches bounded by polygons.

A shape is defined once and serves two models.  The finite-element model (`fem_reference`) reads `gap`, the height of
the indenter's lower surface.  The fast model (`fastmodel`) reads `primitives`, convex solids that become geoms of a
MuJoCo model.  In the indenter's frame the origin lies on the indenter's axis, at the height of its lowest point, and z
points away from the cover.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from meshes.array_types import FloatArray, describe_lengths, is_positive
from meshes.indenters.polygons import (
    Corner,
    Polygon,
    check_polygon,
    compute_distance_from_inset,
    compute_signed_distance,
    find_inside,
    list_sides,
    make_hexagon,
    split_into_convex_parts,
)

#: Corners (x, y) of a closed polygon as a tuple, which can be hashed [m].
Outline = tuple[Corner, ...]


@dataclass(frozen=True, kw_only=True)
class ShapeNumbers:
    """Constants of the shapes."""

    #: Sides of the pyramid that replaces a cone in the fast model [-].  The edges of the pyramid lie on the cone; the
    #: middles of its faces lie up to 1 / cos(pi / 96) - 1 = 0.05 % above it.
    pyramid_sides: int = 96
    #: Relative part of the tolerance of symmetry, over the larger half width of the shape [-]; the rounding of single
    #: precision in STL files.  An outline is symmetric if its mirror image deviates by less than the sum of both parts.
    relative_tolerance: float = 1e-6
    #: Absolute part of the tolerance of symmetry [m]; the rounding of double precision.
    tolerance: float = 1e-9
    #: Height of a nut over its width across flats [-], as in ISO 4032.  Only the lower face touches the cover.
    nut_height: float = 0.8


NUMBERS = ShapeNumbers()


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A convex solid, one part of an indenter, in the indenter's frame.

    Attributes:
        kind: Kind of solid; a hull is the convex hull of its vertices.
        size: Sphere: (radius,); cylinder and capsule: (radius, half length along the axis, which is z); box: half
            edge lengths (x, y, z); hull: empty [m].
        vertices: Vertices (x, y, z) of a hull, shape (n, 3); empty for other kinds [m].
        position: Centre of the solid in the indenter's frame; for a hull, the origin of its vertices [m].
        quaternion: Orientation of the solid in the indenter's frame, a unit quaternion with the scalar first [-].
    """

    kind: Literal["sphere", "cylinder", "capsule", "box", "hull"]
    size: tuple[float, ...] = ()
    vertices: tuple[tuple[float, float, float], ...] = ()
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


class Indenter(ABC):
    """A rigid body that presses on a cover along its axis, the z axis of its frame."""

    #: Whether a rotation about the axis leaves the shape unchanged.
    axisymmetric: ClassVar[bool] = False

    @property
    def is_flat(self) -> bool:
        """Whether the lower surface is a plane, so that its outline bounds the area of contact."""
        return False

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the lower surface is symmetric about the plane x = 0, and whether about the plane y = 0."""
        return True, True

    @property
    @abstractmethod
    def footprint(self) -> tuple[float, float]:
        """Half edge lengths along x and y of the rectangle, centred on the axis, that bounds the shape in plan [m]."""

    @abstractmethod
    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface over the horizontal plane through its lowest point.

        Args:
            x: x coordinates in the indenter's frame, any shape [m].
            y: y coordinates in the indenter's frame, same shape [m].

        Returns:
            Heights, inf at points beside the indenter, same shape [m].
        """

    @abstractmethod
    def primitives(self) -> tuple[Primitive, ...]:
        """Return convex solids whose union has the indenter's lower surface."""

    def measure_facets(self, height: float, turn: FloatArray | None = None) -> float:  # noqa: ARG002 -- as subclasses
        """Estimate how far facets deviate from the smooth surface [m]; 0 for shapes without facets.

        Args:
            height: Height above the lowest point up to which facets are considered [m].
            turn: Rotation matrix of the body, shape (3, 3); None if the body is not rotated.
        """
        return 0.0


class FlatPunch(Indenter):
    """An indenter whose lower surface is a plane with a sharp outline."""

    @property
    def is_flat(self) -> bool:
        """Whether the lower surface is a plane: always true for a flat punch."""
        return True

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface: zero inside the outline and on it, inf outside [m]."""
        return np.where(self.signed_distance(x, y) >= 0, 0.0, np.inf)

    @abstractmethod
    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the outline of the face, positive inside and negative outside [m]."""

    @abstractmethod
    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from a smaller face, which lies deeper inside the outline than an inset.

        Args:
            inset: Distance from the outline to the smaller face inside it [m].
            x: x coordinates in the indenter's frame, any shape [m].
            y: y coordinates in the indenter's frame, same shape [m].

        Returns:
            Distances from the smaller face, zero inside it, same shape [m].

        Raises:
            ValueError: If no point lies deeper inside the outline than the inset.
        """


def quantity_field(quantity: Literal["length", "angle"], **options: Any) -> Any:  # noqa: ANN401 -- as `field`
    """Make a dataclass field whose metadata names its quantity, so that its value can be parsed from text with a unit.

    Args:
        quantity: Quantity of the field's value.
        options: Further arguments of `dataclasses.field`.
    """
    return field(metadata={"quantity": quantity}, **options)


def require_positive(shape: object, *lengths: float) -> None:
    """Check that lengths of a shape [m], which the message names, are finite and positive.

    Raises:
        ValueError: If a length is not finite or not positive.
    """
    if not all(map(is_positive, lengths)):
        raise ValueError(f"{type(shape).__name__} needs positive lengths, not {describe_lengths(lengths)}")


def find_tolerance(footprint: tuple[float, float]) -> float:
    """Find the largest deviation of a shape from its mirror image that counts as rounding [m]."""
    return NUMBERS.tolerance + NUMBERS.relative_tolerance * max(footprint)


def require_remainder(inset: float, greatest_depth: float) -> None:
    """Check that something remains of a flat face when its outline is moved inwards by an inset.

    Args:
        inset: Distance by which the outline is moved inwards [m].
        greatest_depth: Greatest distance of a point of the face from the outline [m].

    Raises:
        ValueError: If nothing remains of the face.
    """
    if not inset < greatest_depth:
        raise ValueError(
            f"an inset of {inset:.3g} m leaves nothing of a face whose middle lies {greatest_depth:.3g} m inside"
        )


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


@dataclass(frozen=True, kw_only=True)
class AxisymmetricIndenter(Indenter):
    """An indenter whose surface is a surface of revolution, spherical unless a shape says otherwise.

    Attributes:
        radius: Largest distance of the surface from the axis, the radius R of a spherical end [m].
    """

    axisymmetric: ClassVar[bool] = True
    radius: float = quantity_field("length")

    def __post_init__(self) -> None:
        """Check that the radius is positive; raise a ValueError otherwise."""
        require_positive(self, self.radius)

    @property
    def footprint(self) -> tuple[float, float]:
        """Half edge lengths along x and y of the square that bounds the shape in plan: the radius [m]."""
        return (self.radius, self.radius)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface, R - sqrt(R^2 - x^2 - y^2); inf beyond the radius [m]."""
        return spherical_gap(self.radius, x, y)


@dataclass(frozen=True, kw_only=True)
class Sphere(AxisymmetricIndenter):
    """A sphere.

    Attributes:
        radius: Radius R of the sphere [m].
    """

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one sphere."""
        return (Primitive(kind="sphere", size=(self.radius,), position=(0, 0, self.radius)),)


@dataclass(frozen=True, kw_only=True)
class RoundedTip(AxisymmetricIndenter):
    """An upright rod with a hemispherical end (the 1 mm calibration tool of the 2015 report).

    Attributes:
        radius: Radius R of the rod and of its end [m].
    """

    radius: float = quantity_field("length", default=1e-3)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one capsule, four diameters long."""
        half_length = 3 * self.radius
        return (Primitive(kind="capsule", size=(self.radius, half_length), position=(0, 0, self.radius + half_length)),)


@dataclass(frozen=True, kw_only=True)
class Cylinder(FlatPunch, AxisymmetricIndenter):
    """An upright cylinder with a flat, sharp-edged end.

    Attributes:
        radius: Radius of the cylinder [m].
    """

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the circular outline, positive inside and negative outside [m]."""
        return np.asarray(self.radius - np.hypot(x, y))

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the disk with the radius `radius - inset`; see `FlatPunch` [m]."""
        require_remainder(inset, self.radius)
        return np.maximum(np.hypot(x, y) - self.radius + inset, 0.0)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one cylinder, one diameter tall."""
        return (Primitive(kind="cylinder", size=(self.radius, self.radius), position=(0, 0, self.radius)),)


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
        """Return one hull: a pyramid of 96 sides on its tip, and on it a prism as tall as the radius."""
        turn = np.arange(NUMBERS.pyramid_sides) * 2 * np.pi / NUMBERS.pyramid_sides
        height = self.radius / np.tan(self.angle / 2)
        rim = [(float(self.radius * np.cos(t)), float(self.radius * np.sin(t))) for t in turn]
        ends = [(x, y, z) for z in (height, height + self.radius) for x, y in rim]
        return (Primitive(kind="hull", vertices=((0.0, 0.0, 0.0), *ends)),)


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
        """Check that radius and length are positive; raise a ValueError otherwise."""
        require_positive(self, self.radius, self.length)

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


@dataclass(frozen=True, kw_only=True)
class Box(FlatPunch):
    """A box with a flat, sharp-edged lower face.

    Attributes:
        size: Edge lengths along x, y and z [m].
    """

    size: tuple[float, float, float] = quantity_field("length")

    def __post_init__(self) -> None:
        """Check that the size is three positive edge lengths; raise a ValueError otherwise."""
        if np.shape(self.size) != (3,):
            raise ValueError(f"Box needs three edge lengths, not {describe_lengths(self.size)}")
        require_positive(self, *self.size)

    @property
    def footprint(self) -> tuple[float, float]:
        """Half the edge lengths of the box along x and y [m]."""
        return (self.size[0] / 2, self.size[1] / 2)

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the rectangular outline, positive inside and negative outside [m]."""
        dx, dy = np.abs(x) - self.size[0] / 2, np.abs(y) - self.size[1] / 2
        outside = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))
        return np.asarray(-outside - np.minimum(np.maximum(dx, dy), 0))

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from a smaller rectangle; see `FlatPunch` [m].

        Each side of the smaller rectangle lies at the distance `inset` inside the side of the face.  Outside a corner
        the distance is that from the corner of the smaller rectangle.
        """
        require_remainder(inset, min(self.footprint))
        dx, dy = np.abs(x) - self.size[0] / 2 + inset, np.abs(y) - self.size[1] / 2 + inset
        return np.asarray(np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one box."""
        half = (self.size[0] / 2, self.size[1] / 2, self.size[2] / 2)
        return (Primitive(kind="box", size=half, position=(0, 0, half[2])),)


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
        tolerance = find_tolerance(self.footprint)
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
        """Return the distance of points from the part of the face deeper inside than `inset`; see `FlatPunch` [m].

        Raises:
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
        points, *holes = (tuple((float(x), float(y)) for x, y in each) for each in (self.points, *self.holes))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "holes", tuple(holes))
        for polygon in self.polygons:
            check_polygon(polygon)
        require_axis_inside(np.concatenate([np.array(polygon) for polygon in self.polygons]))

    @property
    def polygons(self) -> tuple[Outline, ...]:
        """Outer outline and further outlines [m]."""
        return (self.points, *self.holes)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return convex prisms that make up the prism, as tall as the larger half width of its footprint."""
        return tuple(_make_hull(part.tolist(), max(self.footprint)) for part in split_into_convex_parts(self.polygons))


def _make_hull(outline: Polygon, height: float) -> Primitive:
    """Make the upright prism on a convex outline, as a convex solid; outline and height in metres."""
    return Primitive(kind="hull", vertices=tuple((x, y, z) for z in (0.0, height) for x, y in outline))


def require_axis_inside(points: FloatArray) -> None:
    """Check that the indenter's axis, at (0, 0), lies within the bounding rectangle of a shape's points (x, y) [m].

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
            bar, size = describe_lengths(self.bar), describe_lengths(self.size)
            raise ValueError(f"LetterH needs a bar that leaves room between the legs, not {bar} in {size}")

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
            bore, across = describe_lengths(self.bore), describe_lengths(self.across)
            raise ValueError(f"Nut needs a bore that leaves a wall, not {bore} in {across}")

    @property
    def polygons(self) -> tuple[Polygon, ...]:
        """Outer hexagon, and the hexagon that replaces the bore [m]."""
        return (make_hexagon(self.across), make_hexagon(match_hexagon(self.bore)))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return six convex prisms, one at each side face of the nut."""
        outer, inner = self.polygons
        sectors = [(outer[k], outer[k - 1], inner[k], inner[k - 1]) for k in range(6)]
        return tuple(_make_hull(corners, NUMBERS.nut_height * self.across) for corners in sectors)


def match_hexagon(diameter: float) -> float:
    """Compute the width across flats w of the hexagon that has the area of a circle: sqrt(3) / 2 w^2 = pi / 4 d^2 [m].

    Args:
        diameter: Diameter d of the circle [m].
    """
    return diameter * float(np.sqrt(np.pi / (2 * np.sqrt(3))))
