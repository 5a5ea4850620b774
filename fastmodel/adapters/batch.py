"""Many worlds of one model, each a simulation with its own state and sensors, stepped in threads.

The worlds share only the model, which stepping does not change.  So the results of each world are bit for bit equal to
those of the same world simulated alone.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError, check_type
from fastmodel.sensor import Sensor
from fastmodel.signal.frame import Frame

#: Function that is called before every physics step, with the index of the world and its state.
Control = Callable[[int, mujoco.MjData], None]


class Batch:
    """Several simulations (worlds) of one model with the same sensors.

    Attributes:
        data: The state of each world; change an entry to set the state of a world.
        sensors: The sensors of each world, `[world][sensor]`.
    """

    def __init__(
        self, model: mujoco.MjModel, sensors: Sequence[Sensor], worlds: int, *, threads: int | None = None
    ) -> None:
        """Make a state and bound copies of the sensors for each world.

        Args:
            model: The compiled model.
            sensors: The sensors that were attached to the spec of the model; each world gets its own copies.
            worlds: Number of worlds [-].
            threads: Number of worlds that run at the same time, by default the number of cores [-].

        Raises:
            ArgumentTypeError: If an argument has a wrong type.
            FastModelError: If `worlds` or `threads` is not a positive whole number.
            LifeCycleError: If the model was not compiled from the spec with these sensors.
        """
        check_type("model", model, mujoco.MjModel, "a mujoco.MjModel, as spec.compile() returns it")
        check_type("sensors", sensors, Sequence, "a sequence of sensors, as fastmodel.attach returns them")
        count = os.cpu_count() or 1 if threads is None else threads
        for name, number in (("worlds", worlds), ("threads", count)):
            check_type(name, number, (int, float, np.integer), "a whole number")
        if worlds < 1 or count < 1 or worlds != int(worlds) or count != int(count):
            raise FastModelError(f"worlds and threads must be whole numbers from 1 on, not {worlds} and {threads}")
        self._model = model
        self._threads = min(count, worlds)
        self.data = [mujoco.MjData(model) for _ in range(worlds)]
        self.sensors = [[sensor.twin().bind(model) for sensor in sensors] for _ in range(worlds)]

    def step(self, steps: int = 1, control: Control | None = None) -> list[list[list[Frame]]]:
        """Make some physics steps in every world.

        Args:
            steps: Number of physics steps [-].
            control: Function that is called before every step, in the thread of the world, with the index of the world
                and its state.

        Returns:
            The frames that the sensors made in these steps, `[world][sensor][frame]`.

        Raises:
            LifeCycleError: If the physics of a world was stepped without its sensors before.
            StateError: If a contact force is not finite.
        """
        worlds = range(len(self.data))
        if self._threads == 1:
            return [self._run(world, steps, control) for world in worlds]
        with ThreadPoolExecutor(self._threads) as pool:
            return list(pool.map(lambda world: self._run(world, steps, control), worlds))

    def images(self, sensor: int = 0) -> npt.NDArray[np.uint8]:
        """Return the latest image of one sensor in every world, shape (worlds, rows, columns) [-].

        Args:
            sensor: Index of the sensor [-].
        """
        return np.stack([sensors[sensor].frame().image for sensors in self.sensors])

    def _run(self, world: int, steps: int, control: Control | None) -> list[list[Frame]]:
        """Make some physics steps in one world, and return the new frames, `[sensor][frame]`."""
        data, sensors = self.data[world], self.sensors[world]
        frames: list[list[Frame]] = [[] for _ in sensors]
        for _ in range(steps):
            if control is not None:
                control(world, data)
            mujoco.mj_step(self._model, data)
            for new, sensor in zip(frames, sensors, strict=True):
                if sensor.step(data):
                    new.append(sensor.frame())
        return frames
