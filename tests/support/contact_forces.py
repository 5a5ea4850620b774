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
