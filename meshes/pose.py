"""Pose of an indenter in space, in the frame of a texel array."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshes.array import TexelArray
from meshes.array_types import FloatArray

#: Largest deviation of a rotation matrix from orthogonality [-].
_ORTHOGONAL = 1e-9
#: Largest difference between a yaw and a multiple of 90 degrees that counts as rounding, over 90 degrees [-].
_ROUNDING = 1e-9
#: Largest tilt that counts as rounding [rad].
_UPRIGHT = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Pose:
    """Position and orientation of an indenter.

    Attributes:
        position: Origin of the indenter's frame, the lowest point on its axis, in the array's frame, shape (3,) [m].
        rotation: Rotation matrix whose columns are the indenter's x, y and z axes in the array's frame, shape (3, 3).
    """

    position: FloatArray
    rotation: FloatArray

    def __post_init__(self) -> None:
        """Check the position and the rotation.

        Raises:
            ValueError: If a shape is wrong, a number is not finite, or the matrix is no rotation.
        """
        position, rotation = np.array(self.position, dtype=float), np.array(self.rotation, dtype=float)
        if position.shape != (3,) or rotation.shape != (3, 3) or not np.isfinite([*position, *rotation.ravel()]).all():
            raise ValueError("a pose needs a position of 3 finite numbers and a rotation of 3 x 3")
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ORTHOGONAL or np.linalg.det(rotation) < 0:
            raise ValueError("the rotation of a pose must be a right-handed orthogonal matrix")
        # Adding zero removes the sign of zeros, which would give equal poses different keys in the result store.
        object.__setattr__(self, "position", position + 0.0)
        object.__setattr__(self, "rotation", rotation + 0.0)

    @classmethod
    def planar(
        cls, at: tuple[float, float] = (0.0, 0.0), yaw: float = 0.0, tilt: tuple[float, float] = (0.0, 0.0)
    ) -> Pose:
        """Place an indenter over a planar array, so that it looks along the normal, against z, unless it is tilted.

        The rotation is exact for yaws that are multiples of 90 degrees, so that mirrored poses remain mirror images.

        Args:
            at: Position (x, y) of the indenter's axis in the array's frame [m].
            yaw: Rotation of the indenter about its axis, counterclockwise as seen from above [rad].
            tilt: Rotation vector along the x and y axes of the indenter's frame, applied before the yaw [rad].
        """
        quarters = 2 * yaw / np.pi
        c, s = float(np.cos(yaw)), float(np.sin(yaw))
        if abs(quarters - round(quarters)) < _ROUNDING:
            c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return cls(position=np.array([*at, 0.0], dtype=float), rotation=turn @ rotate_by(tilt) if any(tilt) else turn)

    @classmethod
    def facing(cls, position: npt.ArrayLike, direction: npt.ArrayLike, *, spin: float = 0.0) -> Pose:
        """Place an indenter so that its lower side looks along a direction.

        Args:
            position: Position of the lowest point on its axis, shape (3,) [m].
            direction: Direction in which the indenter looks, against its z axis, any length, shape (3,).
            spin: Rotation about its z axis; at 0 the indenter's y axis is closest to the array's y axis [rad].

        Raises:
            ValueError: If the direction is zero.
        """
        towards = np.array(direction, dtype=float)
        length = float(np.linalg.norm(towards))
        if not (np.isfinite(length) and length > 0):
            raise ValueError("the direction of a pose must not be zero")
        z = -towards / length
        reference = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 1 - _ORTHOGONAL else np.array([0.0, 0.0, -np.sign(z[1])])
        y = reference - (reference @ z) * z
        y /= np.linalg.norm(y)
        x = np.cross(y, z)
        c, s = np.cos(spin), np.sin(spin)
        axes = np.stack([c * x + s * y, c * y - s * x, z], axis=1)
        return cls(position=np.array(position, dtype=float), rotation=axes)

    @property
    def at(self) -> tuple[float, float]:
        """Position (x, y) of the lowest point on the indenter's axis, in the array's frame [m]."""
        x, y, _ = self.position.tolist()
        return x, y

    @cached_property
    def heading(self) -> tuple[float, float]:
        """Cosine and sine of the yaw [-]."""
        turn = rotate_by(self._lean).T @ self.rotation if any(self._lean) else self.rotation
        c, s = float(turn[0, 0]), float(turn[1, 0])
        whole = (float(round(c)), float(round(s)))
        return whole if abs(c - whole[0]) + abs(s - whole[1]) < _ROUNDING else (c, s)

    @property
    def yaw(self) -> float:
        """Rotation about the normal of the array, which follows the tilt, in (-pi, pi] [rad]."""
        c, s = self.heading
        return float(np.arctan2(s, c))

    @property
    def tilt(self) -> tuple[float, float]:
        """Rotation vector against the normal of the array, along the x and y axes of the indenter, before the yaw.

        Components below 1e-12 are zero [rad].
        """
        c, s = self.heading
        x, y = self._lean
        about_x, about_y = (value if abs(value) > _UPRIGHT else 0.0 for value in (c * x + s * y, c * y - s * x))
        return about_x, about_y

    @cached_property
    def _lean(self) -> tuple[float, float]:
        """Rotation vector, along x and y of the array, that turns its normal to the axis of the indenter [rad]."""
        axis = self.rotation[:, 2]
        sine = float(np.hypot(axis[0], axis[1]))
        angle = float(np.arctan2(sine, axis[2]))
        if angle < _UPRIGHT:
            return 0.0, 0.0
        if sine == 0:
            return angle, 0.0
        return -angle * float(axis[1]) / sine, angle * float(axis[0]) / sine

    @property
    def upright(self) -> Pose:
        """The same pose over a planar array without its tilt."""
        c, s = self.heading
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Pose(position=self.position, rotation=turn)

    def moved(self, at: tuple[float, float]) -> Pose:
        """Return the same orientation at another position (x, y) [m]."""
        return Pose(position=np.array([*at, self.position[2]], dtype=float), rotation=self.rotation)

    @property
    def is_aligned(self) -> bool:
        """Whether the indenter's axes are parallel to those of a planar array: the yaw is a multiple of 90 degrees."""
        return 0.0 in self.heading

    def plan_to_array(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform points of a plan view from the indenter's frame to the array's frame.

        Args:
            x: x coordinates in the indenter's frame, any shape [m].
            y: y coordinates in the indenter's frame, same shape [m].

        Returns:
            x and y coordinates in the array's frame, each of the same shape [m].
        """
        c, s = self.heading
        at_x, at_y = self.at
        return at_x + c * x - s * y, at_y + s * x + c * y

    def plan_to_indenter(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform points of a plan view from the array's frame to the indenter's frame; inverts `plan_to_array`.

        Args:
            x: x coordinates in the array's frame, any shape [m].
            y: y coordinates in the array's frame, same shape [m].

        Returns:
            x and y coordinates in the indenter's frame, each of the same shape [m].
        """
        c, s = self.heading
        x, y = x - self.at[0], y - self.at[1]
        return c * x + s * y, c * y - s * x

    def to_indenter(self, points: FloatArray) -> FloatArray:
        """Transform points of the array's frame to the indenter's frame, shape (..., 3) [m]."""
        return (points - self.position) @ self.rotation

    def turn_to_indenter(self, vectors: FloatArray) -> FloatArray:
        """Turn vectors of the array's frame to the indenter's frame, shape (..., 3)."""
        return vectors @ self.rotation


def rotate_by(tilt: tuple[float, float]) -> FloatArray:
    """Return the matrix of a rotation about a horizontal axis, shape (3, 3) (Rodrigues' formula).

    Args:
        tilt: Components of the rotation vector along x and y [rad].
    """
    angle = float(np.hypot(*tilt))
    if angle == 0:
        return np.eye(3)
    x, y = np.array(tilt) / angle
    cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A texel array and the pose of an indenter over the array.

    Attributes:
        array: The texel array.
        pose: Pose of the indenter in the array's frame.
    """

    array: TexelArray
    pose: Pose
