"""Which bodies are free to tilt against an array, so that their moments say where they press."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: Cosine of the angle to the normal above which a hinge turns a body in the array's plane only [-].
_UPRIGHT = 1 - 1e-6


class Joints:
    """The joints between one body and all others."""

    def __init__(self, model: Any, body: int) -> None:  # noqa: ANN401 -- MjModel
        """Remember the chain of the body that carries the array."""
        self._model = model
        self._own = set(self._chain(body))
        self._known: dict[int, bool] = {}
        self._slides: dict[int, list[int]] = {}

    def tilts(self, data: Any, body: int, normal: FloatArray) -> bool:  # noqa: ANN401 -- MjData
        """Whether a joint between a body and the array lets the one tilt against the other.

        Args:
            data: The model's state; the first call for a body decides.
            body: Its id.
            normal: The array's normal in the world, shape (3,) [-].
        """
        if body not in self._known:
            self._known[body] = any(self._tilts(data, joint, normal) for joint in self._between(body))
        return self._known[body]

    def slides(self, data: Any, body: int) -> FloatArray:  # noqa: ANN401 -- MjData
        """Axes in the world of the slides between a body and the array, shape (k, 3) [-]."""
        if body not in self._slides:
            kinds, slide = self._model.jnt_type, mujoco.mjtJoint.mjJNT_SLIDE
            self._slides[body] = [joint for joint in self._between(body) if kinds[joint] == slide]
        return np.asarray(data.xaxis[self._slides[body]]).reshape(-1, 3)

    def _between(self, body: int) -> list[int]:
        """Joints between a body and the array."""
        return [joint for each in sorted(self._own ^ set(self._chain(body))) for joint in self._of(each)]

    def _chain(self, body: int) -> list[int]:
        chain = []
        while body:
            chain.append(body)
            body = int(self._model.body_parentid[body])
        return chain

    def _of(self, body: int) -> range:
        first = int(self._model.body_jntadr[body])
        return range(first, first + int(self._model.body_jntnum[body])) if first >= 0 else range(0)

    def _tilts(self, data: Any, joint: int, normal: FloatArray) -> bool:  # noqa: ANN401 -- MjData
        kind = mujoco.mjtJoint(self._model.jnt_type[joint])
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            return abs(float(data.xaxis[joint] @ normal)) < _UPRIGHT
        return bool(kind != mujoco.mjtJoint.mjJNT_SLIDE)
