"""Pose and motion of an indenter in the frame of a texel array."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshes.array import TexelArray
from meshes.array_types import FloatArray

#: Largest deviation that counts as rounding [-].  It applies to a yaw near a multiple of 90 degrees, over 90 degrees,
#: and to the numbers of two poses [m, rad].
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Position, direction of motion and orientation of an indenter in the frame of a texel array.

    Without tilt the indenter's z axis points against the direction of motion.  At yaw 0 its y axis is as close as
    possible to the array's y axis.  The default is the pose on a flat cover above the middle of the array.

    Attributes:
        point: Position of the lowest point on the indenter's axis in the array's frame [m].  On a flat cover z is
            ignored, because the motion along z begins at first touch.
        direction: Unit direction of the motion; any length is accepted [-].
        yaw: Rotation of the indenter about the axis of the motion, counterclockwise as seen against it [rad].
        tilt: Rotation vector of the indenter along the x and y axes of its own frame, applied about the point before
            the yaw [rad].
    """

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    yaw: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Convert to tuples of floats and normalise the direction.

        Raises:
            ValueError: If a shape is wrong, a number is not finite, or the direction is zero.
        """
        shapes = {"point": 3, "direction": 3, "tilt": 2}
        values = {name: np.array(getattr(self, name), dtype=float) for name in shapes}
        for name, count in shapes.items():
            if values[name].shape != (count,) or not np.isfinite(values[name]).all():
                raise ValueError(f"the {name} of a pose must be {count} finite numbers, not {getattr(self, name)}")
        length = float(np.linalg.norm(values["direction"]))
        if not length > 0:
            raise ValueError("the direction of a pose must not be zero")
        if not np.isfinite(self.yaw):
            raise ValueError(f"the yaw of a pose must be finite, not {self.yaw}")
        values["direction"] /= length
        for name, value in values.items():
            object.__setattr__(self, name, tuple(value.tolist()))
        object.__setattr__(self, "yaw", float(self.yaw))

    @classmethod
    def planar(
        cls, at: tuple[float, float] = (0.0, 0.0), yaw: float = 0.0, tilt: tuple[float, float] = (0.0, 0.0)
    ) -> Pose:
        """Place an indenter above a flat cover, moving along -z.

        Args:
            at: Position (x, y) of the indenter's axis in the array's frame [m].
            yaw: Rotation of the indenter about its axis [rad].
            tilt: Rotations about the indenter's x and y axes, before the yaw [rad].
        """
        return cls(point=(at[0], at[1], 0.0), yaw=yaw, tilt=tilt)

    @classmethod
    def facing(cls, point: npt.ArrayLike, direction: npt.ArrayLike, *, spin: float = 0.0) -> Pose:
        """Place an indenter whose lower side faces its direction of motion.

        Args:
            point: Position of the lowest point on its axis, shape (3,) [m].
            direction: Direction of motion, of any length, shape (3,) [-].
            spin: Rotation about its axis [rad].

        Raises:
            ValueError: If a shape is wrong or the direction is zero.
        """
        place, towards = (tuple(np.array(each, dtype=float).tolist()) for each in (point, direction))
        return cls(point=place, direction=towards, yaw=spin)

    @property
    def at(self) -> tuple[float, float]:
        """Position (x, y) of the lowest point on the indenter's axis in the array's frame [m]."""
        return self.point[:2]

    @property
    def position(self) -> FloatArray:
        """Position of the lowest point on the indenter's axis in the array's frame, as an array of shape (3,) [m]."""
        return np.array(self.point)

    @property
    def towards(self) -> FloatArray:
        """Unit direction of the indenter's motion in the array's frame, as an array of shape (3,) [-]."""
        return np.array(self.direction)

    @cached_property
    def rotation(self) -> FloatArray:
        """Rotation matrix whose columns are the indenter's x, y and z axes in the array's frame, shape (3, 3)."""
        x, y, z = self._axes
        c, s = self.cosines
        axes = np.stack([c * x + s * y, c * y - s * x, z], axis=1)
        angle = float(np.hypot(*self.tilt))
        if angle == 0:
            return axes
        u, v = self.tilt[0] / angle, self.tilt[1] / angle
        # Rodrigues' formula for a rotation about a horizontal axis
        cross = np.array([[0, 0, v], [0, 0, -u], [-v, u, 0]])
        return np.asarray(axes @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross))

    @cached_property
    def _axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Axes x, y, z of an indenter that faces its direction of motion, before yaw and tilt, shape (3,) each [-]."""
        z = -self.towards
        reference = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 1 - _ROUNDING else np.array([0.0, 0.0, -np.sign(z[1])])
        y = reference - (reference @ z) * z
        y /= np.linalg.norm(y)
        return np.cross(y, z), y, z

    @property
    def is_planar(self) -> bool:
        """Whether the indenter moves along -z of the array's frame, as on a flat cover."""
        return self.direction == (0.0, 0.0, -1.0)

    @property
    def is_aligned(self) -> bool:
        """Whether the yaw is a multiple of 90 degrees."""
        quarters = 2 * self.yaw / np.pi
        return abs(quarters - round(quarters)) < _ROUNDING

    def is_close_to(self, other: Pose) -> bool:
        """Return whether this pose equals another one up to rounding: 1 nm in positions, 1e-9 rad in angles."""
        mine, others = ((*each.point, *each.direction, each.yaw, *each.tilt) for each in (self, other))
        return np.allclose(mine, others, rtol=0, atol=_ROUNDING)

    @property
    def cosines(self) -> tuple[float, float]:
        """Cosine and sine of the yaw [-].

        For multiples of 90 degrees the values are exact, so that mirrored poses remain mirror images.
        """
        if self.is_aligned:
            return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(2 * self.yaw / np.pi) % 4]
        return float(np.cos(self.yaw)), float(np.sin(self.yaw))

    def to_array(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform x and y of a planar pose from the indenter's frame to the array's frame, any shape each [m]."""
        c, s = self.cosines
        return self.point[0] + c * x - s * y, self.point[1] + s * x + c * y

    def to_indenter(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform x and y of a planar pose to the indenter's frame, any shape each [m]; inverse of `to_array`."""
        c, s = self.cosines
        x, y = x - self.point[0], y - self.point[1]
        return c * x + s * y, c * y - s * x

    def points_to_indenter(self, points: FloatArray) -> FloatArray:
        """Transform points of the array's frame to the indenter's frame, shape (..., 3) [m]."""
        return np.asarray((points - self.position) @ self.rotation)

    def vectors_to_indenter(self, vectors: FloatArray) -> FloatArray:
        """Rotate vectors from the array's frame to the indenter's frame, shape (..., 3)."""
        return np.asarray(vectors @ self.rotation)


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A texel array and the pose of an indenter over the array.

    Attributes:
        array: The texel array.
        pose: Pose of the indenter in the array's frame.
    """

    array: TexelArray
    pose: Pose
