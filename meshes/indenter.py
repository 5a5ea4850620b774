"""Rigid indenters: each shape is defined once and serves both models.

The reference model reads `gap`, the height of the lower surface; the fast model reads `primitives`, convex
solids it makes geoms from.  Indenter frame: origin at the lowest point on the axis, z away from the
cover.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
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
            edges (x, y, z) [m].
        position: Centre [m].
        quaternion: Orientation, scalar first [-].
    """

    kind: Literal["sphere", "cylinder", "capsule", "box"]
    size: tuple[float, ...]
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


def _length() -> Any:  # noqa: ANN401 -- dataclasses.field returns Any
    return field(metadata={"quantity": "length"})


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A ball.

    Attributes:
        radius: Radius [m].
    """

    radius: float = _length()

    def __post_init__(self) -> None:
        """Check the radius."""
        _positive(self, self.radius)

    axisymmetric = True

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.radius, self.radius)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """R - sqrt(R^2 - r^2) inside the radius [m]."""
        return _ball_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """One sphere."""
        return (Primitive(kind="sphere", size=(self.radius,), position=(0, 0, self.radius)),)


@dataclass(frozen=True, kw_only=True)
class RoundedTip:
    """A rod with a hemispherical end (the 1 mm calibration tool of the 2015 report).

    Attributes:
        radius: Radius of rod and end [m].
    """

    radius: float = field(default=1e-3, metadata={"quantity": "length"})

    def __post_init__(self) -> None:
        """Check the radius."""
        _positive(self, self.radius)

    axisymmetric = True

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.radius, self.radius)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """R - sqrt(R^2 - r^2) inside the radius [m]."""
        return _ball_gap(self.radius, x, y)

    def primitives(self) -> tuple[Primitive, ...]:
        """One capsule, four diameters long."""
        half = 3 * self.radius
        return (Primitive(kind="capsule", size=(self.radius, half), position=(0, 0, self.radius + half)),)


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """An upright cylinder with a flat, sharp-edged end.

    Attributes:
        radius: Radius [m].
    """

    radius: float = _length()

    def __post_init__(self) -> None:
        """Check the radius."""
        _positive(self, self.radius)

    axisymmetric = True

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.radius, self.radius)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Zero inside the radius [m]."""
        return _flat_gap(self.inside(x, y))

    def inside(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the circle, positive inside [m]."""
        return np.asarray(self.radius - np.hypot(x, y))

    def primitives(self) -> tuple[Primitive, ...]:
        """One cylinder, one diameter tall."""
        return (Primitive(kind="cylinder", size=(self.radius, self.radius), position=(0, 0, self.radius)),)


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box with a flat, sharp-edged lower face.

    Attributes:
        size: Edge lengths along x, y and z [m].
    """

    size: tuple[float, float, float] = _length()

    def __post_init__(self) -> None:
        """Check the edges."""
        _positive(self, *self.size)

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

    def primitives(self) -> tuple[Primitive, ...]:
        """One box."""
        half = (self.size[0] / 2, self.size[1] / 2, self.size[2] / 2)
        return (Primitive(kind="box", size=half, position=(0, 0, half[2])),)


#: Shapes by the name that sensor files and the command line use.
SHAPES: Mapping[str, type[Any]] = MappingProxyType(
    {"sphere": Sphere, "cylinder": Cylinder, "box": Box, "tip": RoundedTip}
)


def _positive(shape: object, *values: float) -> None:
    if not all(np.isfinite(value) and value > 0 for value in values):
        raise ValueError(f"{type(shape).__name__} needs positive lengths, not {values}")


def _flat_gap(inside: FloatArray) -> FloatArray:
    return np.where(inside >= 0, 0.0, np.inf)


def _ball_gap(radius: float, x: FloatArray, y: FloatArray) -> FloatArray:
    squared = radius**2 - x**2 - y**2
    return np.where(squared >= 0, radius - np.sqrt(np.maximum(squared, 0)), np.inf)
