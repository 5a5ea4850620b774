"""An indenter that comes down on the array and then slides in a circle, for ever: something to look at.

Its weight rests on the cover; a guide lowers it and leads it sideways.  The guide's damper keeps it from falling, so
that what the sensor feels grows from nothing to the weight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from fastmodel import Parameters, Sensor, add_geoms, attach, recommend_options
from fastmodel.contact.interface import TexelContact
from meshes import Indenter, TexelArray
from meshes.constants import STANDARD_GRAVITY

_TIMESTEP = 1e-3
#: Gap above the array at the start [m], and speed of coming down [m/s].
_GAP, _SPEED = 2e-3, 5e-3
#: When sliding begins, how long it takes to reach the circle, and the time of one round [s].
_DOWN, _OUT, _ROUND = 1.0, 1.0, 4.0
#: Colour of the indenter; the array shows through.
_COLOUR = [0.85, 0.5, 0.2, 0.6]
#: Radius of the circle over the array's shorter side [-].
_RADIUS = 0.2


class Sliding:
    """The scene: an array, an indenter over it, and their simulation.

    Args:
        parameters: The sensor.
        indenter: What presses.
        load: Its weight [N].
        method: Contact method, by name or as settings.

    Attributes:
        model: The compiled `mujoco.MjModel`.
        data: Its `mujoco.MjData`.
        sensor: The bound sensor.

    Raises:
        FastModelError: If the contact method does not go with the parameters.
    """

    def __init__(
        self, parameters: Parameters, indenter: Indenter, *, load: float, method: str | TexelContact = "default"
    ) -> None:
        spec = mujoco.MjSpec()
        recommend_options(spec)
        spec.option.timestep = _TIMESTEP
        spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
        spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
        sky = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT}
        spec.add_texture(name="sky", **sky, rgb1=[0.9, 0.93, 0.96], rgb2=[0.6, 0.65, 0.7], width=64, height=64)
        self.sensor: Sensor = attach(spec, "world", parameters, contact=method)
        self._radius = _RADIUS * min(_extent(parameters.array))
        _hang(spec, indenter, load, height=float(parameters.array.centres[:, 2].max()) + _GAP)
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        self.sensor.bind(self.model)

    @property
    def place(self) -> tuple[float, float]:
        """Where the indenter's axis is in the array's frame [m]."""
        return float(self.data.qpos[0]), float(self.data.qpos[1])

    def step(self) -> bool:
        """One physics step; whether a new frame is there."""
        # The guide leads: position and speed sideways are given, only the height is left to the forces.
        time = self.data.time
        here, soon = self._way(time), self._way(time + _TIMESTEP)
        self.data.qpos[:2] = here
        self.data.qvel[:2] = (soon - here) / _TIMESTEP
        mujoco.mj_step(self.model, self.data)
        return self.sensor.step(self.data)

    def restart(self) -> None:
        """Begin again, with the indenter above the array."""
        mujoco.mj_resetData(self.model, self.data)
        self.sensor.reset()

    def run(self, seconds: float = math.inf) -> Iterator[float]:
        """Simulate; the time of each new frame [s].

        Args:
            seconds: How long [s].
        """
        while self.data.time < seconds:
            if self.step():
                yield self.sensor.frame().time

    def _way(self, time: float) -> np.ndarray:
        """Where the guide is, shape (2,) [m]: the middle at first, then out to the circle and round."""
        since = max(0.0, time - _DOWN)
        share = min(1.0, since / _OUT)
        radius = self._radius * share**2 * (3 - 2 * share)
        angle = 2 * math.pi * since / _ROUND
        return radius * np.array([math.cos(angle), math.sin(angle)])


def _extent(array: TexelArray) -> tuple[float, float]:
    x, y = np.ptp(array.centres[:, :2], axis=0) + np.array(array.texel_size)
    return float(x), float(y)


def _hang(spec: Any, indenter: Indenter, load: float, *, height: float) -> None:  # noqa: ANN401 -- MjSpec
    """Hang an indenter of the mass of its load over the array."""
    body = spec.worldbody.add_body(name="indenter", pos=[0, 0, height])
    for axis in np.eye(3):
        joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    # The last slide is the upright one: its damper lets the weight down at a steady speed.
    # (Newer versions of MuJoCo take a polynomial of the speed for it.)
    joint.damping = [load / _SPEED, 0.0, 0.0] if np.ndim(joint.damping) else load / _SPEED
    mass = load / STANDARD_GRAVITY
    body.mass, body.inertia, body.explicitinertial = mass, [1e-6 * mass] * 3, True
    add_geoms(spec, body, indenter)
    for geom in body.geoms:
        geom.condim = 1
        geom.rgba = _COLOUR
