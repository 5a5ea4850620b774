"""Tactile images as part of a Gymnasium observation.

The environment runs the physics, and the wrapper steps the sensors after every physics step.  So sampling of
contact forces, filter and frames do not depend on the number of physics steps per environment step.  The observation
contains the image of the latest frame.  If environment steps are more frequent than frames, the same image is observed
several times.  If frames are more frequent, `info["frames"]` contains all frames since the previous environment step.

    spec = mujoco.MjSpec.from_file("hand.xml")
    sensor = fastmodel.attach(spec, "fingertip", parameters)
    env = TactileObservation(HandEnv(spec.compile()), sensor)        # env.unwrapped.model, env.unwrapped.data
    observation, info = env.reset()
    observation["tactile"]                                           # (rows, columns) uint8

Environments derived from `gymnasium.envs.mujoco.MujocoEnv` load a file; `spec.to_file` writes the edited spec.
This module needs the extra `gym`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from fastmodel.errors import FastModelError, LifeCycleError
from fastmodel.sensor import Sensor
from fastmodel.signal.frame import Frame

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise ImportError(
        "gymnasium is not installed; run: python -m pip install 'softcover[gym]'", name="gymnasium"
    ) from error

#: Function of an environment and a callback, which makes the environment call the callback after every physics step.
Listen = Callable[[Any, Callable[[mujoco.MjData], None]], None]


class TactileObservation(gymnasium.Wrapper[dict[str, Any], Any, Any, Any]):
    """Wrapper of an environment that adds the latest tactile image of one or several sensors to every observation.

    The observation is a dict.  If the observation of the wrapped environment is a dict, its entries are kept; otherwise
    that observation is stored under the key `observation`.  Each image has shape (rows, columns), uint8, row 0 at the
    smallest y.  `info["frames"]` contains the m frames of the step, by sensor and oldest first: simulation `times` of
    their samples, shape (m,) [s], `counts`, shape (m, n) [-], and `images`, shape (m, rows, columns) [-].

    Args:
        env: The environment.
        sensors: A sensor, observed as `tactile`, or several sensors by name.  They are bound to the environment's
            model, and bound again if `reset` compiles another model.
        simulation: Function from the environment to its model and data; by default `env.unwrapped.model` and `.data`.
        listen: Function that makes the environment call a callback after every physics step.  By default this is done
            for a `MujocoEnv`, and any other environment must make one physics step per environment step.

    Raises:
        FastModelError: If the environment has no attributes `model` and `data`, the observation has the name of a
            sensor already, or there is no sensor.
        LifeCycleError: From the constructor, if the model was compiled without a sensor; from `step`, if the
            environment made several physics steps without calling the callback.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        sensors: Sensor | Mapping[str, Sensor],
        *,
        simulation: Callable[[Any], tuple[mujoco.MjModel, mujoco.MjData]] | None = None,
        listen: Listen | None = None,
    ) -> None:
        super().__init__(env)
        self._sensors = {"tactile": sensors} if isinstance(sensors, Sensor) else dict(sensors)
        self._simulation = simulation or _find_simulation
        self._frames: dict[str, list[Frame]] = {name: [] for name in self._sensors}
        self._resetting = False
        self._model: mujoco.MjModel | None = None
        self._bind()
        self.observation_space = self._extend_space(env.observation_space)
        self._calls_back = listen is not None or hasattr(env.unwrapped, "_step_mujoco_simulation")
        if self._calls_back:
            (listen or _listen_to_mujoco_env)(env, self._step_sensors)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], Any]:
        """Reset the environment and the sensors; the sensors ignore physics steps during the reset."""
        self._resetting = True
        try:
            observation, info = self.env.reset(seed=seed, options=options)
        finally:
            self._resetting = False
        self._bind()
        for sensor in self._sensors.values():
            sensor.reset()
        return self._observe(observation), {**info, "frames": self._take_frames()}

    def step(self, action: Any) -> tuple[dict[str, Any], Any, bool, bool, dict[str, Any]]:  # noqa: ANN401 -- as gymnasium's
        """Step the environment, and add the images after the step to the observation."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if not self._calls_back:
            self._step_sensors_once()
        return self._observe(observation), reward, terminated, truncated, {**info, "frames": self._take_frames()}

    def _bind(self) -> None:
        """Bind the sensors to the environment's model unless they are bound to it already."""
        model, _ = self._simulation(self.env)
        if model is not self._model:
            for sensor in self._sensors.values():
                sensor.bind(model)
            self._model = model

    def _step_sensors(self, data: mujoco.MjData) -> None:
        """Update the sensors after one physics step, and store new frames."""
        if self._resetting:
            return
        for name, sensor in self._sensors.items():
            if sensor.step(data):
                self._frames[name].append(sensor.frame())

    def _step_sensors_once(self) -> None:
        """Update the sensors after the only physics step of an environment step."""
        _, data = self._simulation(self.env)
        try:
            self._step_sensors(data)
        except LifeCycleError as error:
            raise LifeCycleError(
                f"{error}. This environment makes several physics steps per environment step: give listen=, a function "
                "that makes it call back after each physics step"
            ) from error

    def _take_frames(self) -> dict[str, dict[str, np.ndarray]]:
        """Return the frames since the previous call as arrays, by sensor, and discard the stored frames."""
        stacked = {name: _stack_frames(frames, self._sensors[name].frame()) for name, frames in self._frames.items()}
        for frames in self._frames.values():
            frames.clear()
        return stacked

    def _observe(self, observation: Any) -> dict[str, Any]:  # noqa: ANN401 -- whatever the environment observes
        """Add the latest image of each sensor to an observation of the environment."""
        own = dict(observation) if isinstance(self.env.observation_space, spaces.Dict) else {"observation": observation}
        # Frames are read-only, but users may write to an observation.
        return own | {name: sensor.frame().image.copy() for name, sensor in self._sensors.items()}

    def _extend_space(self, space: spaces.Space[Any]) -> spaces.Dict:
        """Add one image per sensor to the observation space of the environment."""
        own = dict(space.spaces) if isinstance(space, spaces.Dict) else {"observation": space}
        if not self._sensors:
            raise FastModelError("there is no sensor to observe; give one, or several by name")
        if taken := sorted(own.keys() & self._sensors.keys()):
            raise FastModelError(f"the environment observes {taken[0]!r} already; give the sensor another name")
        images = {
            name: spaces.Box(0, 255, shape=sensor.frame().image.shape, dtype=np.uint8)
            for name, sensor in self._sensors.items()
        }
        return spaces.Dict(own | images)


def _stack_frames(frames: Sequence[Frame], latest: Frame) -> dict[str, np.ndarray]:
    """Stack the values of frames to arrays, which Gymnasium can compare and batch.

    Args:
        frames: The frames.
        latest: The latest frame, whose shapes are used if there are no frames.
    """
    return {
        "times": np.array([frame.time for frame in frames]),
        "counts": np.array([frame.counts for frame in frames], dtype=np.int64).reshape(-1, *latest.counts.shape),
        "images": np.array([frame.image for frame in frames], dtype=np.uint8).reshape(-1, *latest.image.shape),
    }


def _find_simulation(env: gymnasium.Env[Any, Any]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return the attributes `model` and `data` of the innermost environment."""
    inner = env.unwrapped
    try:
        return inner.model, inner.data  # type: ignore[attr-defined]
    except AttributeError as error:
        raise FastModelError(
            f"{type(inner).__name__} shows no MuJoCo model and data; give simulation=, a function from the environment "
            "to both"
        ) from error


def _listen_to_mujoco_env(env: Any, callback: Callable[[mujoco.MjData], None]) -> None:  # noqa: ANN401 -- MujocoEnv
    """Make a `MujocoEnv` call the callback after every physics step."""
    inner = env.unwrapped
    step_several = inner._step_mujoco_simulation  # noqa: SLF001 -- the only function in which a MujocoEnv steps

    def step_singly(control: Any, frames: int) -> None:  # noqa: ANN401 -- an array
        for _ in range(frames):
            step_several(control, 1)
            callback(inner.data)

    inner._step_mujoco_simulation = step_singly  # noqa: SLF001 -- on this instance alone
