"""Poses and quaternions, scalar first, as MuJoCo writes them."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pose:
    """Where one frame stands in another.

    Attributes:
        position: Origin, shape (3,) [m].
        quaternion: Orientation, scalar first, shape (4,) [-].
    """

    position: FloatArray
    quaternion: FloatArray

    @classmethod
    def of(cls, position: npt.ArrayLike, quaternion: npt.ArrayLike) -> Pose:
        """Check and normalise.

        Raises:
            ValueError: If a shape is wrong, a number not finite, or the quaternion zero.
        """
        place, turn = np.array(position, dtype=np.float64), np.array(quaternion, dtype=np.float64)
        if place.shape != (3,) or turn.shape != (4,):
            raise ValueError(f"a pose takes 3 and 4 numbers, not shapes {place.shape} and {turn.shape}")
        length = np.linalg.norm(turn)
        if not (np.isfinite(place).all() and np.isfinite(length) and length > 0):
            raise ValueError(f"a pose needs finite numbers and a quaternion, not {place} and {turn}")
        return cls(position=place, quaternion=turn / length)


def quaternions(matrices: FloatArray) -> FloatArray:
    """Quaternions of rotation matrices, shape (n, 3, 3) to (n, 4) [-]."""
    turns = np.empty((len(matrices), 4))
    for turn, matrix in zip(turns, matrices, strict=True):
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(matrix).ravel())
    return turns


def multiply(first: FloatArray, then: FloatArray) -> FloatArray:
    """Hamilton product first * then, each of shape (4,) or (n, 4) [-]."""
    w, x, y, z = np.moveaxis(np.asarray(first), -1, 0)
    a, b, c, d = np.moveaxis(np.asarray(then), -1, 0)
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=-1,
    )


def rotate(quaternion: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors v turned by one unit quaternion (w, u): v + 2 u x (u x v + w v), shape (n, 3) [any]."""
    w, u = quaternion[0], quaternion[1:]
    return np.asarray(vectors + 2 * np.cross(u, np.cross(u, vectors) + w * vectors))


def about_z(angle: float) -> FloatArray:
    """Quaternion of a turn about z, shape (4,) [-].

    Args:
        angle: Angle [rad].
    """
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
