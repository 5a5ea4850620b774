"""The simulation that `softcover view` shows: an indenter comes down on the array, then slides in a circle.

The weight of the indenter rests on the cover.  A guide moves it sideways.  A damper limits its speed of descent, so
that the force on the sensor rises smoothly from zero to the weight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

import fastmodel
from fastmodel import Parameters
from fastmodel.bench import add_indenter
from fastmodel.contact.interface import TexelContact
from meshes import Indenter
from meshes.constants import STANDARD_GRAVITY

#: Time step of the simulation that `softcover view` shows [s].
TIMESTEP = 1e-3
#: Gap between indenter and array at the start [m].
GAP = 2e-3
#: Speed at which the indenter comes down through the gap [m/s].
FALLING_SPEED = 5e-3
#: Simulated time at which the indenter begins to slide [s].
SLIDE_START = 1.0
#: Time in which the sliding indenter moves from the array's centre out to its circle [s].
RAMP_TIME = 1.0
#: Time of one revolution of the indenter on its circle [s].
REVOLUTION_TIME = 4.0
#: Radius of the circle on which the indenter slides, over the array's shorter side [-].
RADIUS_FRACTION = 0.2
#: Colour of the indenter: red, green, blue and opacity, each 0..1 [-].  The array remains visible through the indenter.
COLOUR = [0.85, 0.5, 0.2, 0.6]


class Scene:
    """A MuJoCo simulation of one tactile array and one indenter.

    Args:
        parameters: Parameters of the sensor's fast model.
        indenter: Shape of the indenter.
        load: Weight of the indenter [N].
        method: Contact method of the fast model, given by its name or as an object with its settings.

    Attributes:
        model: The compiled MuJoCo model.
        data: State of the simulation.
        sensor: The simulated sensor, bound to `model`.

    Raises:
        FastModelError: If the contact method needs data that the parameters lack.
    """

    def __init__(
        self, parameters: Parameters, indenter: Indenter, *, load: float, method: str | TexelContact = "default"
    ) -> None:
        array = parameters.array
        spec = mujoco.MjSpec()
        fastmodel.recommend_options(spec)
        spec.option.timestep = TIMESTEP
        spec.option.gravity[:] = [0, 0, -STANDARD_GRAVITY]
        spec.visual.headlight.ambient[:] = [0.4, 0.4, 0.4]
        skybox, gradient = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
        sky: dict[str, Any] = {"type": skybox, "builtin": gradient}
        spec.add_texture(name="sky", **sky, rgb1=[0.9, 0.93, 0.96], rgb2=[0.6, 0.65, 0.7], width=64, height=64)
        self.sensor = fastmodel.attach(spec, "world", parameters, contact=method)
        self._radius = RADIUS_FRACTION * float((np.ptp(array.centres[:, :2], axis=0) + array.texel_size).min())
        body = add_indenter(spec, indenter, load, height=float(array.centres[:, 2].max()) + GAP)
        (vertical,) = body.joints
        # Newer versions of MuJoCo represent the damping of a joint by coefficients of a polynomial, older ones by a
        # number.
        damping = load / FALLING_SPEED
        vertical.damping = [damping, 0.0, 0.0] if np.ndim(vertical.damping) else damping
        for axis in ((1, 0, 0), (0, 1, 0)):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        for geom in body.geoms:
            geom.condim = 1
            geom.rgba = COLOUR
        self.model: mujoco.MjModel = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.sensor.bind(self.model)

    @property
    def position(self) -> tuple[float, float]:
        """Position (x, y) of the indenter's axis in the array's frame [m]."""
        return float(self.data.qpos[1]), float(self.data.qpos[2])

    @property
    def texel_forces(self) -> npt.NDArray[np.float64]:
        """Forces on the n texels in the latest frame of the sensor, shape (n,) [N]."""
        return np.asarray(self.sensor.frame().texel_forces)

    def run(self, seconds: float = math.inf) -> Iterator[float]:
        """Run the simulation, and yield the time of each new frame of the sensor [s].

        Args:
            seconds: Simulated time at which to stop [s].
        """
        while self.data.time < seconds:
            # The indenter's position and velocity along x and y are prescribed; only its height follows from forces.
            here, next_ = self._guide(self.data.time), self._guide(self.data.time + TIMESTEP)
            self.data.qpos[1:] = here
            self.data.qvel[1:] = (next_ - here) / TIMESTEP
            mujoco.mj_step(self.model, self.data)
            if self.sensor.step(self.data):
                yield self.sensor.frame().time

    def restart(self) -> None:
        """Reset the simulation to its start, with the indenter above the array."""
        mujoco.mj_resetData(self.model, self.data)
        self.sensor.reset()

    def _guide(self, time: float) -> npt.NDArray[np.float64]:
        """Return the prescribed position (x, y) of the indenter's axis at a time, shape (2,) [m].

        The axis starts over the centre of the array, and moves out to the circle while it revolves.

        Args:
            time: Simulated time [s].
        """
        since = max(0.0, time - SLIDE_START)
        share = min(1.0, since / RAMP_TIME)
        radius = self._radius * share**2 * (3 - 2 * share)
        angle = 2 * math.pi * since / REVOLUTION_TIME
        return radius * np.array([math.cos(angle), math.sin(angle)])
