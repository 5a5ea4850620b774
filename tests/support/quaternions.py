"""Quaternions with the scalar first."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation


def multiply(first, second):
    """The rotation by the second, then by the first."""
    product = np.zeros(4)
    mujoco.mju_mulQuat(product, first, second)
    return product


def make_z_rotation(angle):
    """A rotation about z [rad]."""
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def rotate(quaternion, vectors):
    """Rotate vectors, shape (n, 3), by a quaternion with the scalar first."""
    return Rotation.from_quat(quaternion, scalar_first=True).apply(vectors)
