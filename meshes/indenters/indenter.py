"""Rigid indenters: each shape is defined once and serves both models.

The reference model reads `gap`, the height of the lower surface; the fast model reads `primitives`, convex
solids it makes geoms from.  Indenter frame: origin on the axis at the height of the lowest point, z away from
the cover.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A convex solid in the indenter frame.

    Attributes:
        kind: Which solid.
        size: sphere: (radius,); cylinder, capsule: (radius, half length) along z; box: half
            edges (x, y, z); hull: nothing [m].
        vertices: hull: points whose convex hull is the solid [m].
        position: Centre; hull: origin of the vertices [m].
        quaternion: Orientation, scalar first [-].
    """

    kind: Literal["sphere", "cylinder", "capsule", "box", "hull"]
    size: tuple[float, ...] = ()
    vertices: tuple[tuple[float, float, float], ...] = ()
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


class Indenter(Protocol):
    """What every shape offers."""

    @property
    def axisymmetric(self) -> bool:
        """Whether turning the shape about its axis changes nothing."""

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y of the rectangle that holds every point with a finite gap [m]."""

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the lower surface over the plane through its lowest point; inf where there is none.

        Args:
            x: Positions in the indenter frame, any shape [m].
            y: Positions of the same shape [m].

        Returns:
            Heights of the same shape [m].
        """

    def primitives(self) -> tuple[Primitive, ...]:
        """Convex solids whose union is the indenter."""


@runtime_checkable
class Flat(Protocol):
    """A shape whose lower surface is a plane with a sharp outline."""

    def inside(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the outline, positive inside, negative outside, any shape [m]."""

    def beyond(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance outside of what is left of the face when an inset is taken off all along its outline, >= 0 [m].

        Raises:
            ValueError: If the inset leaves nothing.
        """


def length() -> Any:  # noqa: ANN401 -- dataclasses.field returns Any
    """A field that holds lengths [m]."""
    return field(metadata={"quantity": "length"})


def _angle() -> Any:  # noqa: ANN401 -- dataclasses.field returns Any
    return field(metadata={"quantity": "angle"})


@dataclass(frozen=True, kw_only=True)
class _Round:
    """What shapes of revolution that are as wide as their radius share."""

    radius: float = length()

    def __post_init__(self) -> None:
        """Check the radius."""
        require_positive(self, self.radius)

    axisymmetric = True

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.radius, self.radius)


@dataclass(frozen=True, kw_only=True)
class Sphere(_Round):
    """A ball.

    Attributes:
        radius: Radius [m].
    """

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """R - sqrt(R^2 - r^2) inside the radius [m]."""
        return _ball_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """One sphere."""
        return (Primitive(kind="sphere", size=(self.radius,), position=(0, 0, self.radius)),)


@dataclass(frozen=True, kw_only=True)
class RoundedTip(_Round):
    """A rod with a hemispherical end (the 1 mm calibration tool of the 2015 report).

    Attributes:
        radius: Radius of rod and end [m].
    """

    radius: float = field(default=1e-3, metadata={"quantity": "length"})

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """R - sqrt(R^2 - r^2) inside the radius [m]."""
        return _ball_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """One capsule, four diameters long."""
        half = 3 * self.radius
        return (Primitive(kind="capsule", size=(self.radius, half), position=(0, 0, self.radius + half)),)


@dataclass(frozen=True, kw_only=True)
class Cylinder(_Round):
    """An upright cylinder with a flat, sharp-edged end.

    Attributes:
        radius: Radius [m].
    """

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Zero inside the radius [m]."""
        return _flat_gap(self.inside(x, y))

    def inside(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the circle, positive inside [m]."""
        return np.asarray(self.radius - np.hypot(x, y))

    def beyond(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance outside of the smaller circle [m].

        Raises:
            ValueError: If the inset leaves nothing.
        """
        _require_rest(inset, self.radius)
        return np.maximum(np.hypot(x, y) - self.radius + inset, 0.0)

    def primitives(self) -> tuple[Primitive, ...]:
        """One cylinder, one diameter tall."""
        return (Primitive(kind="cylinder", size=(self.radius, self.radius), position=(0, 0, self.radius)),)


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box with a flat, sharp-edged lower face.

    Attributes:
        size: Edge lengths along x, y and z [m].
    """

    size: tuple[float, float, float] = length()

    def __post_init__(self) -> None:
        """Check the edges."""
        require_positive(self, *self.size)

    axisymmetric = False

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.size[0] / 2, self.size[1] / 2)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Zero inside the lower face [m]."""
        return _flat_gap(self.inside(x, y))

    def inside(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the rectangle, positive inside [m]."""
        dx, dy = np.abs(x) - self.size[0] / 2, np.abs(y) - self.size[1] / 2
        beyond = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))
        return np.asarray(-beyond - np.minimum(np.maximum(dx, dy), 0))

    def beyond(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance outside of the smaller rectangle [m].

        Raises:
            ValueError: If the inset leaves nothing.
        """
        _require_rest(inset, min(self.footprint))
        dx, dy = np.abs(x) - self.size[0] / 2 + inset, np.abs(y) - self.size[1] / 2 + inset
        return np.asarray(np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)))

    def primitives(self) -> tuple[Primitive, ...]:
        """One box."""
        half = (self.size[0] / 2, self.size[1] / 2, self.size[2] / 2)
        return (Primitive(kind="box", size=half, position=(0, 0, half[2])),)


@dataclass(frozen=True, kw_only=True)
class Roller:
    """A cylinder lying on its side, its axis along y.

    Attributes:
        radius: Radius [m].
        length: Length along y [m].
    """

    radius: float = length()
    length: float = length()

    def __post_init__(self) -> None:
        """Check the lengths."""
        require_positive(self, self.radius, self.length)

    axisymmetric = False

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.radius, self.length / 2)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """R - sqrt(R^2 - x^2) along the length [m]."""
        return np.where(np.abs(y) <= self.length / 2, _ball_gap(self.radius, x, np.zeros_like(y)), np.inf)

    def primitives(self) -> tuple[Primitive, ...]:
        """One cylinder, turned about x."""
        turn = (float(np.sqrt(0.5)), float(np.sqrt(0.5)), 0.0, 0.0)
        size = (self.radius, self.length / 2)
        return (Primitive(kind="cylinder", size=size, position=(0, 0, self.radius), quaternion=turn),)


@dataclass(frozen=True, kw_only=True)
class Cone:
    """A cone standing on its tip.

    Attributes:
        angle: Full angle at the tip [rad].
        radius: Radius where it ends [m].
    """

    angle: float = _angle()
    radius: float = length()

    def __post_init__(self) -> None:
        """Check angle and radius."""
        require_positive(self, self.radius)
        if not 0 < self.angle < np.pi:
            raise ValueError(f"Cone needs an angle between 0 and 180 degrees, not {np.degrees(self.angle):g}")

    axisymmetric = True

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.radius, self.radius)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the axis over tan(angle / 2), inside the radius [m]."""
        r = np.hypot(x, y)
        return np.where(r <= self.radius, r / np.tan(self.angle / 2), np.inf)

    def primitives(self) -> tuple[Primitive, ...]:
        """A pyramid of 96 sides, whose faces lie up to 0.05 % above the cone's."""
        turn = np.arange(96) * 2 * np.pi / 96
        height = self.radius / np.tan(self.angle / 2)
        rim = [(float(self.radius * np.cos(t)), float(self.radius * np.sin(t))) for t in turn]
        ends = [(x, y, z) for z in (height, height + self.radius) for x, y in rim]
        return (Primitive(kind="hull", vertices=((0.0, 0.0, 0.0), *ends)),)


def require_positive(shape: object, *values: float) -> None:
    """Check lengths.

    Raises:
        ValueError: If one is not positive.
    """
    if not all(np.isfinite(value) and value > 0 for value in values):
        raise ValueError(f"{type(shape).__name__} needs positive lengths, not {values}")


def _require_rest(inset: float, within: float) -> None:
    if not inset < within:
        raise ValueError(f"an inset of {inset:.3g} m leaves nothing of a face whose middle lies {within:.3g} m inside")


def _flat_gap(inside: FloatArray) -> FloatArray:
    return np.where(inside >= 0, 0.0, np.inf)


def _ball_gap(radius: float, x: FloatArray, y: FloatArray) -> FloatArray:
    squared = radius**2 - x**2 - y**2
    return np.where(squared >= 0, radius - np.sqrt(np.maximum(squared, 0)), np.inf)
