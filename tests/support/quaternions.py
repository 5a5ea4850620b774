"""Quaternions with the scalar first."""

import mujoco
import numpy as np


def multiply(first, second):
    """The rotation by the second, then by the first."""
    product = np.zeros(4)
    mujoco.mju_mulQuat(product, first, second)
    return product


def make_z_rotation(angle):
    """A rotation about z [rad]."""
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
