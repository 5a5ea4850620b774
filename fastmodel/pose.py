"""Rotations of vectors by quaternions with the scalar first, as in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np

from meshes.array_types import FloatArray


def make_quaternions(matrices: FloatArray) -> FloatArray:
    """Convert n rotation matrices, shape (n, 3, 3), to unit quaternions, shape (n, 4) [-]."""
    found = np.empty((len(matrices), 4))
    for quaternion, matrix in zip(found, matrices, strict=True):
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
    return found


def rotate(quaternion: FloatArray, vectors: FloatArray) -> FloatArray:
    """Rotate n vectors by a unit quaternion; return them, shape (n, 3) [unit of the vectors].

    With scalar w and vector part u of the quaternion, v becomes v + 2 u x (u x v + w v).

    Args:
        quaternion: Unit quaternion, shape (4,) [-].
        vectors: Vectors v, shape (n, 3) [any unit].
    """
    w, u = quaternion[0], quaternion[1:]
    return np.asarray(vectors + 2 * np.cross(u, np.cross(u, vectors) + w * vectors))
