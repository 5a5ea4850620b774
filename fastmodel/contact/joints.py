"""The joints between a body and the array: they decide whether the body is free to tilt or slide.

The moments of a body say where it presses only if the body is free to tilt against the array; a guide would take them
up.
"""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

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
        self._own = set(self._find_ancestors(body))
        self._tilting: dict[int, bool] = {}
        self._slides: dict[int, list[int]] = {}

    def let_tilt(self, data: mujoco.MjData, body: int, normal: FloatArray) -> bool:
        """Whether any joint between a body and the array lets the body tilt against the array.

        Args:
            data: The state; the answer is found in the first call for each body and kept.
            body: Id of the body.
            normal: The array's normal in the world, shape (3,) [-].
        """
        if body not in self._tilting:
            self._tilting[body] = any(self._lets_tilt(data, joint, normal) for joint in self._find_between(body))
        return self._tilting[body]

    def find_slides(self, data: mujoco.MjData, body: int) -> FloatArray:
        """Axes in the world of the slide joints between a body and the array, shape (k, 3) [-]."""
        if body not in self._slides:
            kinds, slide = self._model.jnt_type, mujoco.mjtJoint.mjJNT_SLIDE
            self._slides[body] = [joint for joint in self._find_between(body) if kinds[joint] == slide]
        return np.asarray(data.xaxis[self._slides[body]]).reshape(-1, 3)

    def _find_between(self, body: int) -> list[int]:
        """Joints on the path through the kinematic tree from a body to the array."""
        return [joint for each in sorted(self._own ^ set(self._find_ancestors(body))) for joint in self._list_of(each)]

    def _find_ancestors(self, body: int) -> list[int]:
        """A body and all its ancestors but the world."""
        chain = []
        while body:
            chain.append(body)
            body = int(self._model.body_parentid[body])
        return chain

    def _list_of(self, body: int) -> range:
        """Joints between a body and its parent."""
        first = int(self._model.body_jntadr[body])
        return range(first, first + int(self._model.body_jntnum[body])) if first >= 0 else range(0)

    def _lets_tilt(self, data: mujoco.MjData, joint: int, normal: FloatArray) -> bool:
        kind = mujoco.mjtJoint(self._model.jnt_type[joint])
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            return abs(float(data.xaxis[joint] @ normal)) < _UPRIGHT
        return bool(kind != mujoco.mjtJoint.mjJNT_SLIDE)
