"""The joints between a body and the array: they decide whether the body is free to tilt or slide.

The moments of a body say where it presses only if the body is free to tilt against the array; a guide would take them
up.
"""

from __future__ import annotations

import mujoco
import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Cosine of the angle between a hinge's axis and the array's normal above which the hinge does not tilt a body [-].
_UPRIGHT = 1 - 1e-6


class Joints:
    """The joints between the body that carries the array and all other bodies."""

    def __init__(self, model: mujoco.MjModel, body: int) -> None:
        """Remember the ancestors of the body that carries the array.

        Args:
            model: The compiled model.
            body: Id of that body.
        """
        self._model = model
        self._own = self._find_ancestors(body)
        self._tilting: dict[int, bool] = {}
        self._slides: dict[int, IntArray] = {}

    def let_tilt(self, data: mujoco.MjData, body: int, normal: FloatArray) -> bool:
        """Whether any joint between a body and the array lets the body tilt against the array.

        Args:
            data: The state; the answer is found in the first call for each body and kept.
            body: Id of the body.
            normal: The array's normal in the world, shape (3,) [-].
        """
        if body not in self._tilting:
            joints = self._find_between(body)
            kinds = self._model.jnt_type[joints]
            upright = (kinds == mujoco.mjtJoint.mjJNT_HINGE) & (np.abs(data.xaxis[joints] @ normal) >= _UPRIGHT)
            self._tilting[body] = bool((~upright & (kinds != mujoco.mjtJoint.mjJNT_SLIDE)).any())
        return self._tilting[body]

    def find_slides(self, data: mujoco.MjData, body: int) -> FloatArray:
        """Axes in the world of the slide joints between a body and the array, shape (k, 3) [-]."""
        if body not in self._slides:
            joints = self._find_between(body)
            self._slides[body] = joints[self._model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE]
        return np.asarray(data.xaxis[self._slides[body]])

    def _find_between(self, body: int) -> IntArray:
        """Ids of the joints on the path through the kinematic tree from a body to the array, shape (k,)."""
        path = self._own ^ self._find_ancestors(body)
        return np.isin(self._model.jnt_bodyid, list(path)).nonzero()[0]

    def _find_ancestors(self, body: int) -> set[int]:
        """A body and all its ancestors but the world."""
        chain = set()
        while body:
            chain.add(body)
            body = int(self._model.body_parentid[body])
        return chain
