"""Base classes of rigid indenters; each shape has a file of its own in this folder.

A shape is defined once and serves both models.  The reference model reads `gap`, the height of the lower surface.  The
fast model reads `primitives`, convex solids that become geoms of a MuJoCo model.  In the indenter's frame the origin
lies on the axis, at the height of the lowest point, and z points away from the cover.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A convex solid in the indenter's frame.

    Attributes:
        kind: Kind of solid; a hull is the convex hull of its vertices.
        size: Sphere: (radius,); cylinder and capsule: (radius, half length), along z; box: half edge lengths
            (x, y, z); hull: empty [m].
        vertices: Vertices of a hull, shape (n, 3); empty for other kinds [m].
        position: Centre of the solid; of a hull, the origin of its vertices [m].
        quaternion: Orientation, scalar first [-].
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
        """Whether the lower surface is a plane, so that its outline bounds the contact."""
        return False

    @property
    @abstractmethod
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the lower surface is its own mirror image in the plane x = 0, and in the plane y = 0."""

    @property
    @abstractmethod
    def footprint(self) -> tuple[float, float]:
        """Half widths, along x and y, of the rectangle around the axis that holds every point of finite gap [m]."""

    @abstractmethod
    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the lower surface over the plane through its lowest point; inf beside the shape.

        Args:
            x: Positions in the indenter's frame, any shape [m].
            y: Positions of the same shape [m].

        Returns:
            Heights of the same shape [m].
        """

    @abstractmethod
    def primitives(self) -> tuple[Primitive, ...]:
        """Convex solids whose union has the indenter's lower surface."""


class FlatPunch(Indenter):
    """An indenter whose lower surface is a plane with a sharp outline."""

    @property
    def is_flat(self) -> bool:
        """Always true."""
        return True

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Zero inside the outline and on it, inf outside [m]."""
        return np.where(self.signed_distance(x, y) >= 0, 0.0, np.inf)

    @abstractmethod
    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the outline, positive inside and negative outside.

        Args:
            x: Positions in the indenter's frame, any shape [m].
            y: Positions of the same shape [m].

        Returns:
            Distances of the same shape [m].
        """

    @abstractmethod
    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the points of the face that lie deeper inside the outline than an inset; zero on them.

        Args:
            inset: Least depth inside the outline [m].
            x: Positions in the indenter's frame, any shape [m].
            y: Positions of the same shape [m].

        Returns:
            Distances of the same shape [m].

        Raises:
            ValueError: If no point lies that deep inside.
        """


def quantity_field(quantity: Literal["length", "angle"], **options: Any) -> Any:  # noqa: ANN401 -- as `field`
    """Make a dataclass field whose metadata names the quantity that it holds, so that it can be read from text."""
    return field(metadata={"quantity": quantity}, **options)


@dataclass(frozen=True, kw_only=True)
class AxisymmetricIndenter(Indenter):
    """An indenter whose surface is one of revolution; `radius` is its largest [m]."""

    axisymmetric: ClassVar[bool] = True
    radius: float = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the radius.

        Raises:
            ValueError: If it is not positive.
        """
        require_positive(self, self.radius)

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Always true in both planes."""
        return (True, True)

    @property
    def footprint(self) -> tuple[float, float]:
        """The radius, along x and y [m]."""
        return (self.radius, self.radius)


def require_positive(shape: object, *lengths: float) -> None:
    """Check that lengths of a shape are finite and positive.

    Raises:
        ValueError: If one is not.
    """
    if not all(np.isfinite(length) and length > 0 for length in lengths):
        raise ValueError(f"{type(shape).__name__} needs positive lengths, not {lengths}")


def require_remainder(inset: float, greatest_depth: float) -> None:
    """Check that points of a face lie deeper inside its outline than an inset.

    Args:
        inset: Depth inside the outline [m].
        greatest_depth: Depth of the point that lies deepest inside [m].

    Raises:
        ValueError: If none does.
    """
    if not inset < greatest_depth:
        raise ValueError(
            f"an inset of {inset:.3g} m leaves nothing of a face whose middle lies {greatest_depth:.3g} m inside"
        )
