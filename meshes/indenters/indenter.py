"""Base classes of rigid indenters, the bodies that press on a cover; each shape has a file of its own in this folder.

A shape is defined once and serves two models.  The finite-element model (`fem_reference`) reads `gap`, the height of
the indenter's lower surface.  The fast model (`fastmodel`) reads `primitives`, convex solids that become geoms of a
MuJoCo model.  In the indenter's frame the origin lies on the indenter's axis, at the height of its lowest point, and z
points away from the cover.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from meshes.array_types import is_positive

FloatArray = npt.NDArray[np.float64]


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
    @abstractmethod
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the lower surface is symmetric about the plane x = 0, and whether about the plane y = 0."""

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
        """Estimate how far facets deviate from the smooth surface that they stand for; 0 for shapes without facets [m].

        Args:
            height: Height above the lowest point up to which facets are considered [m].
            turn: Rotation matrix of the body, shape (3, 3); None if it stands upright.
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
        """Return the distance of points from the outline of the face, positive inside and negative outside.

        Args:
            x: x coordinates in the indenter's frame, any shape [m].
            y: y coordinates in the indenter's frame, same shape [m].

        Returns:
            Signed distances, same shape [m].
        """

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


@dataclass(frozen=True, kw_only=True)
class AxisymmetricIndenter(Indenter):
    """An indenter whose surface is a surface of revolution.

    Attributes:
        radius: Largest distance of the surface from the axis [m].
    """

    axisymmetric: ClassVar[bool] = True
    radius: float = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the radius.

        Raises:
            ValueError: If the radius is not positive.
        """
        require_positive(self, self.radius)

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Symmetry about the planes x = 0 and y = 0: always true."""
        return (True, True)

    @property
    def footprint(self) -> tuple[float, float]:
        """Half edge lengths along x and y of the square that bounds the shape in plan: the radius [m]."""
        return (self.radius, self.radius)


def require_positive(shape: object, *lengths: float) -> None:
    """Check that lengths of a shape are finite and positive.

    Args:
        shape: The shape, whose class name appears in the error message.
        lengths: Lengths to check [m].

    Raises:
        ValueError: If a length is not finite or not positive.
    """
    if not all(map(is_positive, lengths)):
        raise ValueError(f"{type(shape).__name__} needs positive lengths, not {lengths}")


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
