"""Tactile images as part of a Gymnasium observation.

The environment runs the physics; the wrapper listens after every physics step, so that contact forces, filter and
frames keep their own clocks however many physics steps one environment step makes.  What is observed is the latest
frame: an environment faster than the sensor sees the same image several times, a slower one finds the frames in
between under `info["frames"]`.

    spec = mujoco.MjSpec.from_file("hand.xml")
    sensor = fastmodel.attach(spec, "fingertip", parameters)
    env = TactileObservation(HandEnv(spec.compile()), sensor)        # env.unwrapped.model, env.unwrapped.data
    observation, info = env.reset()
    observation["tactile"]                                           # (rows, columns) uint8

Environments of `gymnasium.envs.mujoco.MujocoEnv` load a file: write the edited spec with `spec.to_file`.
Needs the extra `gym`; nothing else in this package imports gymnasium.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

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

#: Makes an environment call back after every physics step, with its `mujoco.MjData`.
Listen = Callable[[Any, Callable[[Any], None]], None]


class TactileObservation(gymnasium.Wrapper[dict[str, Any], Any, Any, Any]):
    """Adds the latest tactile image of one sensor or several to every observation.

    The observation becomes a dict: an environment that has dicts keeps its keys, any other observation comes under
    `observation`.  Each image has shape (rows, columns), uint8, row 0 at the smallest y.  `info["frames"]` holds, under
    the same names, the m frames that fell due during the step, oldest first: their true `times`, shape (m,) [s],
    `counts`, shape (m, n), and `images`, shape (m, rows, columns).

    Args:
        env: The environment.
        sensors: A sensor, observed as `tactile`, or several by the names that they are observed under. They are bound
            to the environment's model here, and again where `reset` compiles another one.
        simulation: Gives the environment's `MjModel` and `MjData`; `env.unwrapped.model` and `.data` when not given.
        listen: Makes the environment call back after every physics step. When not given, a `MujocoEnv` is listened to
            as it is, and any other environment must make one physics step per environment step.

    Raises:
        FastModelError: If the environment shows no model and data, a name is taken, or there is no sensor.
        LifeCycleError: From the constructor, if the model was compiled without a sensor; from `step`, if the
            environment made several physics steps unheard.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        sensors: Sensor | Mapping[str, Sensor],
        *,
        simulation: Callable[[Any], tuple[Any, Any]] | None = None,
        listen: Listen | None = None,
    ) -> None:
        super().__init__(env)
        self._sensors = {"tactile": sensors} if isinstance(sensors, Sensor) else dict(sensors)
        self._simulation = simulation or _model_and_data
        self._frames: dict[str, list[Frame]] = {name: [] for name in self._sensors}
        self._resetting = False
        self._model: Any = None
        self._bind()
        self.observation_space = self._space(env.observation_space)
        self._heard = listen is not None or hasattr(env.unwrapped, "_step_mujoco_simulation")
        if self._heard:
            (listen or _listen_to_mujoco_env)(env, self._sense)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], Any]:
        """Reset the environment and start the sensors again at rest, whatever the reset itself simulated."""
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
        """One step of the environment, and the images after it."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if not self._heard:
            self._sense_once()
        return self._observe(observation), reward, terminated, truncated, {**info, "frames": self._take_frames()}

    def _bind(self) -> None:
        """Bind the sensors to the environment's model, unless they are."""
        model, _ = self._simulation(self.env)
        if model is not self._model:
            for sensor in self._sensors.values():
                sensor.bind(model)
            self._model = model

    def _sense(self, data: Any) -> None:  # noqa: ANN401 -- MjData
        if self._resetting:
            return
        for name, sensor in self._sensors.items():
            if sensor.step(data):
                self._frames[name].append(sensor.frame())

    def _sense_once(self) -> None:
        _, data = self._simulation(self.env)
        try:
            self._sense(data)
        except LifeCycleError as error:
            raise LifeCycleError(
                f"{error}. This environment makes several physics steps in one of its own: give listen=, a function "
                "that makes it call back after each"
            ) from error

    def _take_frames(self) -> dict[str, dict[str, np.ndarray]]:
        taken = {name: _stacked(frames, self._sensors[name].frame()) for name, frames in self._frames.items()}
        for frames in self._frames.values():
            frames.clear()
        return taken

    def _observe(self, observation: Any) -> dict[str, Any]:  # noqa: ANN401 -- whatever the environment observes
        own = dict(observation) if isinstance(self.env.observation_space, spaces.Dict) else {"observation": observation}
        # A frame never changes; an observation belongs to who asked for it.
        return own | {name: sensor.frame().image.copy() for name, sensor in self._sensors.items()}

    def _space(self, space: spaces.Space[Any]) -> spaces.Dict:
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


def _stacked(frames: Sequence[Frame], latest: Frame) -> dict[str, np.ndarray]:
    """Frames as arrays, which Gymnasium can compare and batch; the latest one tells the shapes where there is none."""
    return {
        "times": np.array([frame.time for frame in frames]),
        "counts": np.array([frame.counts for frame in frames], dtype=np.int64).reshape(-1, *latest.counts.shape),
        "images": np.array([frame.image for frame in frames], dtype=np.uint8).reshape(-1, *latest.image.shape),
    }


def _model_and_data(env: gymnasium.Env[Any, Any]) -> tuple[Any, Any]:
    inner = env.unwrapped
    try:
        return inner.model, inner.data  # type: ignore[attr-defined]
    except AttributeError as error:
        raise FastModelError(
            f"{type(inner).__name__} shows no MuJoCo model and data; give simulation=, a function from the environment "
            "to both"
        ) from error


def _listen_to_mujoco_env(env: Any, callback: Callable[[Any], None]) -> None:  # noqa: ANN401 -- MujocoEnv
    """Let a `MujocoEnv` make its physics steps one at a time, each followed by the callback."""
    inner = env.unwrapped
    several = inner._step_mujoco_simulation  # noqa: SLF001 -- the one place where a MujocoEnv steps

    def one_at_a_time(control: Any, frames: int) -> None:  # noqa: ANN401 -- an array
        for _ in range(frames):
            several(control, 1)
            callback(inner.data)

    inner._step_mujoco_simulation = one_at_a_time  # noqa: SLF001 -- on this instance alone
