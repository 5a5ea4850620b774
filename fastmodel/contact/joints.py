"""The joints between a body and the array, which determine whether the body is free to tilt or slide.

The moments of the contact forces determine where a body presses only if the body is free to tilt relative to the array.
Otherwise a guide of the body takes up moments.
"""

from __future__ import annotations

import mujoco
import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Cosine of the angle between the axis of a hinge joint and the array's normal, from which on the axis counts as
#: parallel to the normal: rotation about the hinge then does not tilt a body [-].  It differs from 1 by rounding only.
_UPRIGHT = 1 - 1e-6


class Joints:
    """The joints of a model between the body that carries the array and any other body."""

    def __init__(self, model: mujoco.MjModel, body: int) -> None:
        """Find the ancestors of the body that carries the array.

        Args:
            model: The compiled model.
            body: Id of the body that carries the array.
        """
        self._model = model
        self._own = self._find_ancestors(body)
        self._turning: dict[int, tuple[bool, IntArray]] = {}
        self._slides: dict[int, IntArray] = {}

    def let_tilt(self, data: mujoco.MjData, body: int, normal: FloatArray) -> bool:
        """Return whether any joint between a body and the array lets the body tilt relative to the array.

        Args:
            data: State of the simulation.
            body: Id of the body.
            normal: The array's normal in the world, shape (3,) [-].
        """
        if body not in self._turning:
            joints = self._find_between(body)
            kinds = self._model.jnt_type[joints]
            hinges = joints[kinds == mujoco.mjtJoint.mjJNT_HINGE]
            free = bool(np.isin(kinds, [int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)]).any())
            self._turning[body] = free, hinges
        always, hinges = self._turning[body]
        return always or bool((np.abs(data.xaxis[hinges] @ normal) < _UPRIGHT).any())

    def find_slides(self, data: mujoco.MjData, body: int) -> FloatArray:
        """Find the axes, in the world, of the k slide joints between a body and the array, shape (k, 3) [-]."""
        if body not in self._slides:
            joints = self._find_between(body)
            self._slides[body] = joints[self._model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE]
        return np.asarray(data.xaxis[self._slides[body]])

    def _find_between(self, body: int) -> IntArray:
        """Find the ids of the k joints in the kinematic tree between a body and the array, shape (k,)."""
        path = self._own ^ self._find_ancestors(body)
        return np.isin(self._model.jnt_bodyid, list(path)).nonzero()[0]

    def _find_ancestors(self, body: int) -> set[int]:
        """Return the ids of a body and of all its ancestors in the kinematic tree except the world."""
        chain = set()
        while body:
            chain.add(body)
            body = int(self._model.body_parentid[body])
        return chain
