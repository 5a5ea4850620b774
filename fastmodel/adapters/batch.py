"""Many worlds at once: copies of one model, each with its own state and sensors, stepped on all cores.

Worlds share nothing but the model, which stepping does not change, so a world's results do not depend on how many
others run beside it: they are those of the same world alone, bit by bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError
from fastmodel.sensor import Sensor
from fastmodel.signal.frame import Frame

#: Called before every physics step with the world's number and its MjData.
Control = Callable[[int, Any], None]


class Batch:
    """Worlds of one model with the same sensors.

    Attributes:
        data: The `mujoco.MjData` of each world; set states there.
        sensors: The sensors of each world, `[world][sensor]`.
    """

    def __init__(
        self,
        model: Any,  # noqa: ANN401 -- MjModel
        sensors: Sequence[Sensor],
        worlds: int,
        *,
        threads: int | None = None,
    ) -> None:
        """Make the worlds.

        Args:
            model: The compiled model.
            sensors: What was attached to its spec; each world gets its own copy.
            worlds: Number of worlds [-].
            threads: Worlds that run at the same time; the number of cores when not given [-].

        Raises:
            FastModelError: If a number is not a positive whole one.
            LifeCycleError: If the model was not compiled from the spec with these sensors.
        """
        count = os.cpu_count() or 1 if threads is None else threads
        if worlds < 1 or count < 1 or worlds != int(worlds) or count != int(count):
            raise FastModelError(f"worlds and threads must be whole numbers from 1 on, not {worlds} and {threads}")
        self._model = model
        self._threads = min(count, worlds)
        self.data = [mujoco.MjData(model) for _ in range(worlds)]
        self.sensors = [[sensor.twin().bind(model) for sensor in sensors] for _ in range(worlds)]

    def step(self, steps: int = 1, control: Control | None = None) -> list[list[list[Frame]]]:
        """Step every world.

        Args:
            steps: Physics steps [-].
            control: Called before every step with the world's number and its data, from the world's thread.

        Returns:
            The frames that fell due, `[world][sensor][frame]`.

        Raises:
            LifeCycleError: If a world was stepped apart from its sensors.
            StateError: If a contact force is not finite.
        """
        worlds = range(len(self.data))
        if self._threads == 1:
            return [self._run(world, steps, control) for world in worlds]
        with ThreadPoolExecutor(self._threads) as pool:
            return list(pool.map(lambda world: self._run(world, steps, control), worlds))

    def images(self, sensor: int = 0) -> npt.NDArray[np.uint8]:
        """The latest image of one sensor in every world, shape (worlds, rows, columns) [-]."""
        return np.stack([sensors[sensor].frame().image for sensors in self.sensors])

    def _run(self, world: int, steps: int, control: Control | None) -> list[list[Frame]]:
        data, sensors = self.data[world], self.sensors[world]
        frames: list[list[Frame]] = [[] for _ in sensors]
        for _ in range(steps):
            if control is not None:
                control(world, data)
            mujoco.mj_step(self._model, data)
            for taken, sensor in zip(frames, sensors, strict=True):
                if sensor.step(data):
                    taken.append(sensor.frame())
        return frames
