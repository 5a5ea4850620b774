"""Pose of an indenter in space, in the frame of a texel array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.array_types import FloatArray

#: Largest deviation of a rotation matrix from orthogonality [-].
_ORTHOGONAL = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class SpatialPose:
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
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "rotation", rotation)

    @classmethod
    def facing(cls, position: npt.ArrayLike, direction: npt.ArrayLike, *, spin: float = 0.0) -> SpatialPose:
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

    def to_indenter(self, points: FloatArray) -> FloatArray:
        """Transform points of the array's frame to the indenter's frame, shape (..., 3) [m]."""
        return (points - self.position) @ self.rotation

    def turn_to_indenter(self, vectors: FloatArray) -> FloatArray:
        """Turn vectors of the array's frame to the indenter's frame, shape (..., 3)."""
        return vectors @ self.rotation
