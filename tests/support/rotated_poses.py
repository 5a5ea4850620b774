"""Poses of indenters that are given by rotation matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from meshes.pose import Pose


def rotated_pose(point: npt.ArrayLike, rotation: npt.ArrayLike, direction: npt.ArrayLike | None = None) -> Pose:
    """Place an indenter that is given by a rotation matrix.

    Args:
        point: Position of the lowest point on its axis, shape (3,) [m].
        rotation: Matrix whose columns are the indenter's axes in the array's frame, shape (3, 3).
        direction: Direction of motion, of any length, shape (3,) [-]; opposite to the indenter's z axis if None.
    """
    axes = np.array(rotation, dtype=float)
    upright = Pose.facing(point, -axes[:, 2] if direction is None else direction)
    turn = upright.rotation.T @ axes
    # The rotation from the upright pose is a tilt about a horizontal axis, followed by a rotation about z.
    sine = float(np.hypot(turn[2, 0], turn[2, 1]))
    per_sine = float(np.arctan2(sine, turn[2, 2])) / sine if sine else 0.0
    tilt = (per_sine * float(turn[2, 1]), -per_sine * float(turn[2, 0])) if direction is not None else (0.0, 0.0)
    spun = turn @ replace(upright, direction=(0.0, 0.0, -1.0), tilt=tilt).rotation.T
    return replace(upright, yaw=float(np.arctan2(spun[1, 0], spun[0, 0])), tilt=tilt)
