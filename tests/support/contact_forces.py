"""MuJoCo's contact forces, contact by contact: the slow oracle of every reader."""

import mujoco
import numpy as np


def sum_pushes(model, data):
    """Sum of the vertical components of all contact forces, each counted as a push [N]."""
    total, force = 0.0, np.zeros(6)
    for k, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, k, force)
        total += abs((contact.frame.reshape(3, 3).T @ force[:3])[2])
    return total


def measure_force(model, data, prefix="sensor/"):
    """Vertical force of all contacts on the geoms of a sensor, given by the prefix of their names, downwards [N]."""
    total, force = 0.0, np.zeros(6)
    for k, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, k, force)
        for geom, sign in zip(contact.geom, (1, -1), strict=True):
            if geom >= 0 and model.geom(int(geom)).name.startswith(prefix):
                total += sign * (contact.frame.reshape(3, 3).T @ force[:3])[2]
    return total
