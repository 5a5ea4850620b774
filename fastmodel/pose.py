"""Poses of rigid frames, and operations on quaternions with the scalar first, as in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Mount:
    """Position and orientation of one frame in another frame.

    Attributes:
        position: Origin of the first frame in the other, shape (3,) [m].
        quaternion: Orientation of the first frame as a unit quaternion, scalar first, shape (4,) [-].
    """

    position: FloatArray
    quaternion: FloatArray

    @classmethod
    def of(cls, position: npt.ArrayLike, quaternion: npt.ArrayLike) -> Mount:
        """Make a pose from numbers, and normalise the quaternion.

        Args:
            position: Origin of the frame, shape (3,) [m].
            quaternion: Orientation of the frame, scalar first, of any length but zero, shape (4,) [-].

        Raises:
            FastModelError: If position or quaternion are not numbers.
            FastModelError: If a shape is wrong, a number not finite, or the quaternion zero.
        """
        try:
            origin, rotation = np.array(position, dtype=np.float64), np.array(quaternion, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise FastModelError(
                f"a pose takes 3 and 4 numbers, [m] and [-], not {position!r} and {quaternion!r}"
            ) from error
        if origin.shape != (3,) or rotation.shape != (4,):
            raise FastModelError(f"a pose takes 3 and 4 numbers, not shapes {origin.shape} and {rotation.shape}")
        length = np.linalg.norm(rotation)
        if not (np.isfinite(origin).all() and np.isfinite(length) and length > 0):
            raise FastModelError(
                f"a pose takes finite numbers and a quaternion other than zero, not {origin} and {rotation}"
            )
        return cls(position=origin, quaternion=rotation / length)

    def transform(self, inner: Mount) -> Mount:
        """Return the pose, in the other frame, of a frame whose pose in the first frame is given.

        Args:
            inner: Mount in the first frame.
        """
        return Mount(
            position=self.position + rotate(self.quaternion, inner.position[None])[0],
            quaternion=multiply(self.quaternion, inner.quaternion),
        )


def make_quaternions(matrices: FloatArray) -> FloatArray:
    """Convert n rotation matrices to unit quaternions, shape (n, 4) [-].

    Args:
        matrices: Rotation matrices, shape (n, 3, 3) [-].
    """
    found = np.empty((len(matrices), 4))
    for quaternion, matrix in zip(found, matrices, strict=True):
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
    return found


def multiply(first: FloatArray, second: FloatArray) -> FloatArray:
    """Compute the Hamilton product of quaternions, shape (4,) or (n, 4) [-].

    As a rotation, the product applies the second factor first, then the first factor.

    Args:
        first: First factor, shape (4,) or (n, 4) [-].
        second: Second factor, shape (4,) or (n, 4) [-].
    """
    w, x, y, z = np.moveaxis(np.asarray(first), -1, 0)
    a, b, c, d = np.moveaxis(np.asarray(second), -1, 0)
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
    """Rotate n vectors by a unit quaternion; return them, shape (n, 3) [unit of the vectors].

    With scalar w and vector part u of the quaternion, v becomes v + 2 u x (u x v + w v).

    Args:
        quaternion: Unit quaternion, shape (4,) [-].
        vectors: Vectors v, shape (n, 3) [any unit].
    """
    w, u = quaternion[0], quaternion[1:]
    return np.asarray(vectors + 2 * np.cross(u, np.cross(u, vectors) + w * vectors))


def make_z_rotation(angle: float) -> FloatArray:
    """Make the unit quaternion of a rotation about the z axis, shape (4,) [-].

    Args:
        angle: Angle of the rotation [rad].
    """
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
