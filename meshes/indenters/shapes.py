"""Indenters of simple shapes: sphere, rounded tip, upright cylinder, cone, lying cylinder and box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.array_types import FloatArray
from meshes.indenters.indenter import (
    AxisymmetricIndenter,
    FlatPunch,
    Indenter,
    Primitive,
    quantity_field,
    require_positive,
    require_remainder,
)

#: Number of sides of the pyramid that replaces a cone in the fast model: the middles of its faces lie up to
#: 1 / cos(pi / 96) - 1 = 0.05 % above the cone, its edges on the cone [-].
_PYRAMID_SIDES = 96


@dataclass(frozen=True, kw_only=True)
class Sphere(AxisymmetricIndenter):
    """A sphere.

    Attributes:
        radius: Radius R of the sphere [m].
    """

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface, R - sqrt(R^2 - x^2 - y^2); inf beyond the radius [m]."""
        return spherical_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one sphere."""
        return (Primitive(kind="sphere", size=(self.radius,), position=(0, 0, self.radius)),)


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
        turn = np.arange(_PYRAMID_SIDES) * 2 * np.pi / _PYRAMID_SIDES
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


@dataclass(frozen=True, kw_only=True)
class Box(FlatPunch):
    """A box with a flat, sharp-edged lower face.

    Attributes:
        size: Edge lengths along x, y and z [m].
    """

    size: tuple[float, float, float] = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the edges.

        Raises:
            ValueError: If the size is not three positive edge lengths.
        """
        if np.shape(self.size) != (3,):
            raise ValueError(f"Box needs three edge lengths, not {self.size}")
        require_positive(self, *self.size)

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Symmetry about the planes x = 0 and y = 0: always true."""
        return (True, True)

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
        """Return the distance of points from the rectangle that is smaller by the inset on each side.

        Returns:
            Distances, zero inside the smaller rectangle, shape of `x` and `y` [m].

        Raises:
            ValueError: If the inset is not smaller than half the shorter edge.
        """
        require_remainder(inset, min(self.footprint))
        dx, dy = np.abs(x) - self.size[0] / 2 + inset, np.abs(y) - self.size[1] / 2 + inset
        return np.asarray(np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one box."""
        half = (self.size[0] / 2, self.size[1] / 2, self.size[2] / 2)
        return (Primitive(kind="box", size=half, position=(0, 0, half[2])),)
