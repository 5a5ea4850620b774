"""Many worlds of one model, each a simulation with its own state and sensors, in one process or in several.

The worlds share only the model, which stepping does not change.  The results of each world are therefore bit for bit
equal to those of the same world simulated alone, for any number of processes.

Python holds a lock during most of a step, so threads do not make a batch faster.  Processes divide the processor time:
each process owns some of the worlds, receives functions and returns frames.  With two processes, the slower one took
0.5 to 0.6 of the processor time of a single process (`benchmarks/many_worlds.py`, 8 worlds).  The wall time decreases
only if a processor is free for every process.  Many steps per call and several worlds per process keep the cost of
communication small.
"""

from __future__ import annotations

import multiprocessing
import pickle
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, Self, TypeVar

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.check import OptionWarning
from fastmodel.errors import FastModelError, LifeCycleError, check_count, check_type
from fastmodel.sensor import Sensor
from fastmodel.signal.frame import Frame
from fastmodel.state import make_generator

_T = TypeVar("_T")

#: Function that is called before every physics step, with the index of the world and its state.
Control = Callable[[int, mujoco.MjData], None]
#: Function of the index of a world, its state and its sensors.
Visit = Callable[[int, mujoco.MjData, Sequence[Sensor]], _T]


class Batch:
    """Several simulations (worlds) of one model with the same sensors.

    With several processes, a script must create the batch below `if __name__ == "__main__":`, and functions given to
    the batch must be importable (no lambdas). `close` ends the processes; a `with` statement calls it.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        sensors: Sequence[Sensor],
        worlds: int,
        *,
        processes: int = 1,
        seed: int | None = None,
    ) -> None:
        """Make a state and bound copies of the sensors for each world.

        Args:
            model: The compiled model.
            sensors: Sensors that were attached to the spec of the model; each world has its own copies.
            worlds: Number of worlds [-].
            processes: Number of processes that step the worlds at the same time [-].  Useful up to the number of free
                processors.  With 1, the present process steps the worlds.
            seed: Seed of the noise, which differs between worlds and sensors; by default each sensor's
                `Electronics.seed`.

        Raises:
            FastModelError: If an argument has a wrong type.
            FastModelError: If `worlds` or `processes` is not a positive whole number, or the seed is negative.
            LifeCycleError: If the model was not compiled from the spec with these sensors.
        """
        check_type("model", model, mujoco.MjModel, "a mujoco.MjModel, as spec.compile() returns it")
        check_type("sensors", sensors, Sequence, "a sequence of sensors, as fastmodel.attach returns them")
        for sensor in sensors:
            check_type("sensors", sensor, Sensor, "sensors, as fastmodel.attach returns them")
        if len({id(sensor) for sensor in sensors}) < len(sensors):
            raise FastModelError("the same sensor is given twice; attach each sensor once")
        worlds, processes = check_count("worlds", worlds, 1), check_count("processes", processes, 1)
        _check_seed(seed)
        # The sensors are bound once in this process, so that `bind` gives its warnings and errors here, and kernels are
        # compiled before other processes start.
        twins = [sensor.twin().bind(model).twin() for sensor in sensors]
        parts = np.array_split(np.arange(worlds), min(processes, worlds))
        self._closed, self._sensors = False, len(sensors)
        self._workers: list[ProcessPoolExecutor] = []
        self._own = _Worlds(model, twins, parts[0].tolist()) if len(parts) == 1 else None
        if self._own is None:
            methods = multiprocessing.get_all_start_methods()
            # A fork of this process might copy locks that other threads hold.
            context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
            self._workers = [ProcessPoolExecutor(1, mp_context=context) for _ in parts]
            made = [
                worker.submit(_make_worlds, model, twins, part.tolist())
                for worker, part in zip(self._workers, parts, strict=True)
            ]
            for each in made:
                each.result()
        self._call("seed", seed)

    def step(self, steps: int = 1, control: Control | None = None) -> list[list[list[Frame]]]:
        """Make some physics steps in every world.

        Args:
            steps: Number of physics steps [-].
            control: Function that is called before every step, in the process of the world, with the index of the world
                and its state.

        Returns:
            Frames made by the sensors in these steps, `[world][sensor][frame]`.

        Raises:
            FastModelError: If there are several processes, and the function cannot be imported.
            LifeCycleError: If the physics of a world was stepped without its sensors before.
            FastModelError: If a contact force is not finite.
        """
        steps = check_count("steps", steps, 0)
        check_type("control", control, (Callable, type(None)), "a function of the index of a world and its state")  # type: ignore[arg-type]
        return self._call("step", steps, control)

    def visit(self, function: Visit[_T]) -> list[_T]:
        """Call a function for every world, for example to set or read its state, and return the results.

        Args:
            function: Function of the index of the world, its state and its sensors, called in the process of the
                world.

        Raises:
            FastModelError: If there are several processes, and the function cannot be imported.
        """
        accepted = "a function of the index of a world, its state and its sensors"
        check_type("function", function, Callable, accepted)  # type: ignore[arg-type]  # isinstance takes it
        return self._call("visit", function)

    def reset(self, seed: int | None = None) -> None:
        """Reset the state and the sensors of every world.

        Args:
            seed: Seed from which the noise restarts; by default the noise continues.
        """
        _check_seed(seed)
        self._call("reset")
        if seed is not None:
            self._call("seed", seed)

    def images(self, sensor: int = 0) -> npt.NDArray[np.uint8]:
        """Return the latest image of one sensor in every world, shape (worlds, rows, columns) [-].

        Args:
            sensor: Index of the sensor [-].
        """
        if check_count("sensor", sensor, 0) >= self._sensors:
            raise FastModelError(f"sensor must be the index of one of {self._sensors} sensors, not {sensor}")
        return np.stack(self._call("images", int(sensor)))

    def close(self) -> None:
        """End the processes; the batch cannot be used afterwards."""
        self._closed = True
        for worker in self._workers:
            worker.shutdown()

    def __enter__(self) -> Self:
        """Return the batch."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the processes."""
        self.close()

    def _call(self, method: str, *arguments: Any) -> list[Any]:  # noqa: ANN401 -- arguments of the method
        """Call a method of `_Worlds` in all processes, and join the results, one for each world."""
        if self._closed:
            raise LifeCycleError("this batch is closed; make another one")
        if self._own is not None:
            return list(getattr(self._own, method)(*arguments))
        try:
            pickle.dumps(arguments)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise FastModelError(
                f"several processes take only functions that can be imported, no lambdas and no local ones: {error}"
            ) from error
        started = [worker.submit(_call_worlds, method, *arguments) for worker in self._workers]
        return [result for each in started for result in each.result()]


class _Worlds:
    """Worlds that one process owns.  Every method returns one result for each world."""

    def __init__(self, model: mujoco.MjModel, sensors: Sequence[Sensor], numbers: Sequence[int]) -> None:
        """Make a simulation state and bound sensors for each of some worlds.

        Args:
            model: The compiled model.
            sensors: Sensors that are copied for each world.
            numbers: Numbers of the worlds in the whole batch.
        """
        self._model, self._numbers = model, numbers
        self._data = [mujoco.MjData(model) for _ in numbers]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OptionWarning)
            self._sensors = [[sensor.twin().bind(model) for sensor in sensors] for _ in numbers]

    def seed(self, seed: int | None) -> list[None]:
        """Restart all sensors with noise that differs between worlds; `seed` is None for each sensor's own seed."""
        for number, sensors in zip(self._numbers, self._sensors, strict=True):
            for sensor in sensors:
                chosen = sensor.parameters.electronics.seed if seed is None else seed
                sensor.reset(seed=np.random.SeedSequence(chosen, spawn_key=(number,)))
        return [None] * len(self._numbers)

    def reset(self) -> list[None]:
        """Reset the simulation state and the sensors of each world."""
        for data, sensors in zip(self._data, self._sensors, strict=True):
            mujoco.mj_resetData(self._model, data)
            for sensor in sensors:
                sensor.reset()
        return [None] * len(self._numbers)

    def visit(self, function: Visit[_T]) -> list[_T]:
        """Call a function for each world with its number, its state and its sensors, and return the results."""
        worlds = zip(self._numbers, self._data, self._sensors, strict=True)
        return [function(number, data, sensors) for number, data, sensors in worlds]

    def images(self, sensor: int) -> list[npt.NDArray[np.uint8]]:
        """Return the latest tactile image of one sensor, given by its index, in each world."""
        return [sensors[sensor].frame().image for sensors in self._sensors]

    def step(self, steps: int, control: Control | None) -> list[list[list[Frame]]]:
        """Make some physics steps in every world, and return the new frames, `[world][sensor][frame]`."""
        made = []
        for number, data, sensors in zip(self._numbers, self._data, self._sensors, strict=True):
            frames: list[list[Frame]] = [[] for _ in sensors]
            for _ in range(steps):
                if control is not None:
                    control(number, data)
                mujoco.mj_step(self._model, data)
                for new, sensor in zip(frames, sensors, strict=True):
                    if sensor.step(data):
                        new.append(sensor.frame())
            made.append(frames)
        return made


def _check_seed(seed: int | None) -> None:
    """Check that a seed is a non-negative integer or None."""
    if seed is not None:
        make_generator(seed, "")


#: Worlds that this process owns, if a `Batch` started it.
_OWNED: list[_Worlds] = []


def _make_worlds(model: mujoco.MjModel, sensors: Sequence[Sensor], numbers: Sequence[int]) -> None:
    """Make the worlds that this process owns, in a process that a `Batch` started."""
    _OWNED.append(_Worlds(model, sensors, numbers))


def _call_worlds(method: str, *arguments: Any) -> list[Any]:  # noqa: ANN401 -- arguments of the method
    """Call a method of the worlds that this process owns, by its name, and return one result for each world."""
    return list(getattr(_OWNED[0], method)(*arguments))
