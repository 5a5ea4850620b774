"""Tactile images and forces as part of a Gymnasium observation.

The environment runs the physics, and the wrapper steps the sensors after every physics step.  So sampling of
contact forces, filter and frames do not depend on the number of physics steps per environment step.  The observation
contains the image of the latest frame.  If environment steps are more frequent than frames, the same image is observed
several times.  If frames are more frequent, `info["frames"]` contains all frames since the previous environment step.

    spec = mujoco.MjSpec.from_file("hand.xml")
    sensor = fastmodel.attach(spec, "fingertip", parameters)
    env = TactileObservation(HandEnv(spec.compile()), sensor)        # env.unwrapped.model, env.unwrapped.data
    observation, info = env.reset(seed=0)
    observation["tactile"]                                           # (rows, columns) uint8
    new = info["frames"]["tactile"]
    new["images"][: new["made"]]                                     # images since the previous step

All arrays keep their shapes from step to step, as vector environments and other wrappers require.  `reset(seed=...)`
also seeds the noise of the sensors; later episodes continue with other noise until a new seed is given.  A copy of the
wrapper (`copy.deepcopy`, `pickle`) is independent of the original.  A copy of an environment that derives from
`gymnasium.utils.EzPickle`, as most environments of Gymnasium do, starts anew and needs a `reset`.

Environments derived from `gymnasium.envs.mujoco.MujocoEnv` or gymnasium-robotics' `MujocoRobotEnv` load a model file,
which `spec.to_file` writes from the edited spec.  This module needs the extra `gym`.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError, LifeCycleError, check_count, check_type, name_unknown
from fastmodel.sensor import Sensor
from fastmodel.signal.frame import Frame
from meshes import TexelArray
from meshes.array_types import FloatArray

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise ImportError(
        "gymnasium is not installed; run in a clone of softcover: python -m pip install -e '.[gym]'", name="gymnasium"
    ) from error

#: Function of an environment and a callback, which makes the environment call the callback after every physics step.
Listen = Callable[[Any, Callable[[mujoco.MjData], None]], None]
#: Methods in which environments of a common base class make all physics steps of an environment step, and attributes
#: with the number of these steps.  The entries are for gymnasium's `MujocoEnv` and gymnasium-robotics'
#: `MujocoRobotEnv`.
_STEPPERS = {"_step_mujoco_simulation": "frame_skip", "_mujoco_step": "n_substeps"}
#: Quantities that can be observed.
QUANTITIES = ("image", "texel_forces", "pressures", "tangential", "wrench")
#: Fields of a `Frame` whose name in `info` differs, by this name.
_FIELDS = {"times": "time", "images": "image", "net_forces": "net_force", "net_torques": "net_torque"}
#: Relative tolerance on the number of frames in a time; it allows for rounding [-].
_TOLERANCE = 1e-6


@dataclass(frozen=True, kw_only=True)
class Variation:
    """Spread of sensors between worlds and episodes, for training; `reset` draws new values for every texel.

    Attributes:
        gain: Standard deviation of the gain of each texel about 1 [-].
        offset: Standard deviation of a constant force that is added on each texel [N].  With a gain, offset or dead
            texel, images are made anew from the changed forces, without hysteresis.
        dead: Probability that a texel measures nothing [-].
        latency: Largest number of frames by which observations are late; each number from 0 on is equally likely [-].
    """

    gain: float = 0.0
    offset: float = 0.0
    dead: float = 0.0
    latency: int = 0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            FastModelError: If a number is negative or not finite, or `dead` exceeds 1.
        """
        check_count("latency", self.latency, 0)
        for name, most in (("gain", math.inf), ("offset", math.inf), ("dead", 1.0)):
            if not (0 <= (value := getattr(self, name)) <= most and value < math.inf):
                raise FastModelError(f"{name} of a Variation must lie in 0..{most:g}, not {value}")


class TactileObservation(gymnasium.Wrapper[dict[str, Any], Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """Wrapper of an environment that adds the latest tactile frame of one or several sensors to every observation.

    The observation is a dict.  If the observation of the wrapped environment is a dict, its entries are kept; otherwise
    that observation is stored under the key `observation`.  A sensor's entry has the name of the sensor, or, if several
    quantities are observed, one entry for each of them has the name `sensor/quantity`:

    - `image`, shape (rows, columns), uint8, row 0 at the smallest y;
    - `texel_forces` [N] and `pressures` [Pa], shape (rows, columns), float32, before the electronics;
    - `tangential`, shape (2, rows, columns), float32: see `Frame.tangential` [N];
    - `wrench`, shape (6,), float32: net force [N] and net torque [N m] on the array in its frame.

    `info["frames"]` contains, by sensor, the frames of the step, oldest first, in arrays with room for m frames:
    simulation `times` of their samples, shape (m,) [s], `counts`, shape (m, n) [-], `images`, shape (m, rows, columns)
    [-], `texel_forces`, shape (m, n) [N], `tangential`, shape (m, n, 2) [N], and `net_forces` [N] and `net_torques`
    [N m] on the array in its frame (see `Frame`), shape (m, 3).  The number `made` says how many entries are filled;
    the others are zero.  If a step makes more than m frames, the latest m are kept, and `dropped` is the number of the
    others, else 0.

    Attributes:
        sensors: The sensors of this environment, by name.

    Args:
        env: The environment.
        sensors: A sensor, observed as `tactile`, or several sensors by name.  Twins (unbound copies) of them are bound
            to the environment's model, so that several environments can be made from one sensor.  They are bound again
            if `reset` compiles another model.
        simulation: Function from the environment to its model and data; by default `env.unwrapped.model` and `.data`.
        listen: Function that makes the environment call a callback after every physics step; the wrapper calls this
            function once.  By default a `MujocoEnv` or `MujocoRobotEnv` is modified to call back, and any other
            environment must make one physics step per environment step.
        frames: Number m of frames of a step for which `info["frames"]` has room [-].  By default the largest number
            possible with the environment's physics steps; 1 with `listen`.  Frames of a sensor without filter that find
            no room are not computed if a `MujocoEnv` or `MujocoRobotEnv` shows how many physics steps follow.
        observe: The quantities to observe, one of `QUANTITIES` or several.
        history: Number of past frames to observe with the latest one [-].  Each entry then has a first axis of length
            history + 1, oldest first; after a reset, frames that were not made yet are those of the unloaded array.
        variation: Spread of the sensors, drawn anew at every reset from its seed; `info` holds the frames without it.
        key: Name of the entry of `info` that replaces `frames`, for environments whose `info` already has an entry
            `frames`.  Nested wrappers share one entry if their sensors have different names.

    Raises:
        FastModelError: If an argument has a wrong type, or a quantity is unknown or not computed by the contact method.
        FastModelError: If the environment has no attributes `model` and `data`, the observation already has the name of
            a sensor, there is no sensor, or `frames` is not a positive whole number; from `reset` and `step`, if the
            environment's `info` already has an entry named `key`.
        LifeCycleError: From the constructor, if the model was compiled without a sensor; from `step`, if the
            environment made physics steps without calling the callback, or is a copy that was not reset.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        sensors: Sensor | Mapping[str, Sensor],
        *,
        simulation: Callable[[Any], tuple[mujoco.MjModel, mujoco.MjData]] | None = None,
        listen: Listen | None = None,
        frames: int | None = None,
        observe: str | Sequence[str] = "image",
        history: int = 0,
        variation: Variation | None = None,
        key: str = "frames",
    ) -> None:
        settings: dict[str, Any] = {"simulation": simulation, "listen": listen, "frames": frames, "key": key}
        settings |= {"observe": observe, "history": history, "variation": variation}
        given = {"tactile": sensors} if isinstance(sensors, Sensor) else sensors
        _check_arguments(env, given, settings)
        gymnasium.utils.RecordConstructorArgs.__init__(self, sensors=sensors, **settings, _disable_deepcopy=True)
        gymnasium.Wrapper.__init__(self, env)
        self._key, self._history, self._variation = key, history, variation or Variation()
        self._observed = (observe,) if isinstance(observe, str) else tuple(observe)
        self.sensors = {name: sensor.twin() for name, sensor in given.items()}
        self._simulation = simulation or _find_simulation
        self._made: dict[str, list[Frame]] = {name: [] for name in self.sensors}
        self._drawn: dict[str, tuple[FloatArray, FloatArray, np.random.Generator]] = {}
        self._seen: dict[str, deque[dict[str, Any]]] = {}
        self._seeds: np.random.SeedSequence | None = None
        self._stepping = False
        self._time = math.nan
        self._model: mujoco.MjModel | None = None
        self._bind()
        self.observation_space = self._extend_space(env.observation_space)
        self._stepper = None if listen else next((name for name in _STEPPERS if hasattr(env.unwrapped, name)), None)
        self._steps_once = listen is None and self._stepper is None
        rates = {name: sensor.parameters.electronics.rate_hz for name, sensor in self.sensors.items()}
        self._room = {name: frames or self._count_frames(rate) for name, rate in rates.items()}
        if listen is not None:
            listen(env, self._step_sensors)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], Any]:
        """Reset the environment and the sensors; the sensors ignore physics steps during the reset.

        Args:
            seed: Seed of the environment and of the noise of the sensors.  Without a seed, the first reset draws one,
                and later resets continue with other noise.
            options: Options of the environment.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self._bind()
        if seed is not None or self._seeds is None:
            self._seeds = np.random.SeedSequence(self._find_seed() if seed is None else seed)
        for (name, sensor), child in zip(self.sensors.items(), self._seeds.spawn(len(self.sensors)), strict=True):
            sensor.reset(seed=child)
            self._fill(name, child.spawn(1)[0])
        self._time = self._simulation(self.env)[1].time
        return self._observe(observation), self._inform(info)

    def step(self, action: Any) -> tuple[dict[str, Any], Any, bool, bool, dict[str, Any]]:  # noqa: ANN401 -- as gymnasium's
        """Step the environment, and add the tactile images after the step to the observation.

        Raises:
            LifeCycleError: If the environment made physics steps without calling the sensors, or is a copy that was not
                reset.
        """
        model, data = self._simulation(self.env)
        if model is not self._model:
            raise LifeCycleError("the environment has another model than at the last reset, as copies have; call reset")
        self._stepping = True
        try:
            with _step_singly(self.env.unwrapped, self._stepper, self._step_sensors):
                observation, reward, terminated, truncated, info = self.env.step(action)
            if self._steps_once:
                self._step_sensors(data)
        except LifeCycleError as error:
            advice = ". This environment makes several physics steps per environment step: give listen=, a function "
            advice += "that makes it call back after each physics step"
            raise LifeCycleError(f"{error}{advice if self._steps_once else ''}") from error
        finally:
            self._stepping = False
        if data.time != self._time:
            raise LifeCycleError(
                f"the environment went from {self._time:g} s to {data.time:g} s without calling back after each "
                "physics step; check the function listen="
            )
        return self._observe(observation), reward, terminated, truncated, self._inform(info)

    def _find_seed(self) -> int:
        """Return the seed of the environment's `np_random`; if it has no seed, draw one from it."""
        inner = self.env.unwrapped
        seed = inner.np_random_seed
        return int(inner.np_random.integers(2**32)) if seed is None or seed < 0 else seed

    def _bind(self) -> None:
        """Bind the sensors to the environment's model, unless they are already bound to this model."""
        model, _ = self._simulation(self.env)
        if model is not self._model:
            for sensor in self.sensors.values():
                sensor.bind(model)
            self._model = model

    def _step_sensors(self, data: mujoco.MjData, left: int = 0) -> None:
        """Update the sensors after a physics step of an environment step with `left` more, and store new frames.

        Frames that have no place in observation and info, because enough later ones come, are not computed.
        """
        if not self._stepping:
            return
        self._time = data.time
        for name, sensor in self.sensors.items():
            wanted = max(self._room[name], self._seen[name].maxlen or 1)
            later = int(left * data.model.opt.timestep * sensor.parameters.electronics.rate_hz * (1 - _TOLERANCE))
            if sensor.step(data, skip=later >= wanted):
                self._made[name].append(sensor.frame())

    def _count_frames(self, rate_hz: float) -> int:
        """Return the largest number of frames that a sensor of a given rate can make in one step of the environment."""
        if self._stepper is None:
            return 1
        steps = int(getattr(self.env.unwrapped, _STEPPERS[self._stepper]))
        period = steps * self._simulation(self.env)[0].opt.timestep
        return min(steps, int(period * rate_hz * (1 + _TOLERANCE)) + 1)

    def _inform(self, info: dict[str, Any]) -> dict[str, Any]:
        """Return the info of the environment with the frames since the previous call, and those of a nested wrapper."""
        frames, theirs = {}, info.get(self._key, {})
        for name, made in self._made.items():
            frames[name] = _stack_frames(made, self.sensors[name].parameters.array, self._room[name])
            made.clear()
        if not isinstance(theirs, Mapping) or theirs.keys() & frames.keys():
            raise FastModelError(
                f"the environment's info has an entry {self._key!r} already; give key= another name for the frames"
            )
        return {**info, self._key: {**theirs, **frames}}

    def _observe(self, observation: Any) -> dict[str, Any]:  # noqa: ANN401 -- whatever the environment observes
        """Add the latest image of each sensor to an observation of the environment."""
        own = dict(observation) if isinstance(self.env.observation_space, spaces.Dict) else {"observation": observation}
        for name, made in self._made.items():
            self._seen[name].extend(self._look(name, frame) for frame in made[-(self._seen[name].maxlen or 1) :])
        return own | {key: values for name in self.sensors for key, values in self._list_entries(name)}

    def _fill(self, name: str, seed: np.random.SeedSequence | None = None) -> None:
        """Draw the variation of a sensor, and fill its observed frames with its latest frame."""
        vary, draw, array = self._variation, np.random.default_rng(seed), self.sensors[name].parameters.array
        count = array.count
        alive = array.active & (draw.random(count) >= vary.dead)
        gain, offset = 1 + vary.gain * draw.standard_normal(count), vary.offset * draw.standard_normal(count)
        self._drawn[name] = (alive * gain, alive * offset, draw)
        self._made[name].clear()
        length = self._history + 1 + int(draw.integers(vary.latency + 1))
        self._seen[name] = deque([self._look(name, self.sensors[name].frame())] * length, maxlen=length)

    def _look(self, name: str, frame: Frame) -> dict[str, npt.NDArray[Any]]:
        """Return the observed quantities of a frame of a sensor, by name, with the variation of the sensor."""
        parameters, (gain, offset, draw) = self.sensors[name].parameters, self._drawn[name]
        array, electronics = parameters.array, parameters.electronics
        forces = gain * np.asarray(frame.texel_forces) + offset
        found = {"image": frame.image, "texel_forces": array.image(forces)}
        found["pressures"] = array.image(forces / (frame.texel_area or 1.0))
        if self._variation != Variation(latency=self._variation.latency):
            counts = np.where(array.active, electronics.counts(forces, draw), 0)
            found["image"] = array.image(electronics.image(counts))
        if frame.net_force is not None and frame.net_torque is not None and frame.tangential is not None:
            found["tangential"] = array.image(gain * frame.tangential.T)
            found["wrench"] = np.concatenate([frame.net_force, frame.net_torque])
        if missing := sorted(set(self._observed) - found.keys()):
            raise FastModelError(f"the contact method computes no {missing[0]!r}; observe {', '.join(found)}")
        return {each: found[each].astype(np.uint8 if each == "image" else np.float32) for each in self._observed}

    def _list_entries(self, name: str) -> Iterator[tuple[str, npt.NDArray[Any]]]:
        """Yield key and values of each entry of a sensor in the observation; users may write to the values."""
        frames = list(self._seen[name])[: self._history + 1]
        for quantity in self._observed:
            values = np.stack([frame[quantity] for frame in frames])
            yield name if len(self._observed) == 1 else f"{name}/{quantity}", values if self._history else values[0]

    def _extend_space(self, space: spaces.Space[Any]) -> spaces.Dict:
        """Add one image per sensor to the observation space of the environment."""
        own = dict(space.spaces) if isinstance(space, spaces.Dict) else {"observation": space}
        if not self.sensors:
            raise FastModelError("there is no sensor to observe; give one, or several by name")
        added: dict[str, spaces.Space[Any]] = {}
        for name in self.sensors:
            self._fill(name)
            for key, values in self._list_entries(name):
                low, high = (0, 255) if values.dtype == np.uint8 else (-np.inf, np.inf)
                added[key] = spaces.Box(low, high, shape=values.shape, dtype=values.dtype.type)
        if taken := sorted(own.keys() & added.keys()):
            raise FastModelError(f"the environment observes {taken[0]!r} already; give the sensor another name")
        return spaces.Dict(own | added)


def _stack_frames(frames: Sequence[Frame], array: TexelArray, room: int) -> dict[str, Any]:
    """Stack the values of frames to arrays of fixed shapes, see `TactileObservation`.

    Args:
        frames: The frames, oldest first.
        array: The texels of the sensor.
        room: Length of the arrays.
    """
    kept = frames[-room:]
    arrays: dict[str, npt.NDArray[Any]] = {
        "times": np.zeros(room),
        "counts": np.zeros((room, array.count), dtype=np.int64),
        "images": np.zeros((room, array.rows, array.columns), dtype=np.uint8),
        "texel_forces": np.zeros((room, array.count)),
        "tangential": np.zeros((room, array.count, 2)),
        "net_forces": np.zeros((room, 3)),
        "net_torques": np.zeros((room, 3)),
    }
    for name, values in arrays.items():
        each = [getattr(frame, _FIELDS.get(name, name)) for frame in kept]
        if kept and each[0] is not None:
            values[: len(kept)] = each
    return {"made": len(kept), "dropped": len(frames) - len(kept), **arrays}


def _check_arguments(env: object, sensors: Mapping[str, Sensor], settings: Mapping[str, Any]) -> None:
    """Check the types of the arguments of `TactileObservation`.

    Args:
        env: The environment.
        sensors: The sensors by name.
        settings: The other arguments by name.
    """
    check_type("env", env, gymnasium.Env, "a gymnasium.Env")
    check_type("sensors", sensors, Mapping, "a fastmodel.Sensor, or a dict of them by name")
    for name, sensor in sensors.items():
        check_type("the name of a sensor", name, str, "a str")
        check_type(f"sensors[{name!r}]", sensor, Sensor, "a fastmodel.Sensor")
    function: Any = (Callable, type(None))
    check_type("simulation", settings["simulation"], function, "a function from the environment to its model and data")
    check_type("listen", settings["listen"], function, "a function of the environment and a callback")
    check_type("key", settings["key"], str, "a str")
    if settings["frames"] is not None:
        check_count("frames", settings["frames"], 1)
    check_count("history", settings["history"], 0)
    check_type("variation", settings["variation"], (Variation, type(None)), "a Variation or None")
    observe = settings["observe"]
    check_type("observe", observe, Sequence, f"one or several of {', '.join(QUANTITIES)}")
    for quantity in [observe] if isinstance(observe, str) else observe or [""]:
        if quantity not in QUANTITIES:
            raise name_unknown("quantity", quantity, QUANTITIES)


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


@contextlib.contextmanager
def _step_singly(inner: Any, stepper: str | None, callback: Callable[[mujoco.MjData, int], None]) -> Iterator[None]:  # noqa: ANN401
    """Make an environment call back after every physics step, in the body of the `with` statement.

    The environment holds no reference to the callback before and after, so that copies of it are independent.

    Args:
        inner: The innermost environment.
        stepper: Name of its method that makes all physics steps, see `_STEPPERS`; None to do nothing.
        callback: Function of the state after a physics step, and of the number of steps that follow.
    """
    if stepper is None:
        yield
        return
    before, step_several, count = vars(inner).get(stepper), getattr(inner, stepper), _STEPPERS[stepper]

    def step_each(control: Any, *frames: int) -> None:  # noqa: ANN401 -- an array
        usual = getattr(inner, count)
        setattr(inner, count, 1)
        try:
            for left in reversed(range(*(frames or (usual,)))):
                step_several(control, *(1 for _ in frames))  # `MujocoEnv` gives the number of steps, others do not
                callback(inner.data, left)
        finally:
            setattr(inner, count, usual)

    setattr(inner, stepper, step_each)
    try:
        yield
    finally:
        if before is None:
            delattr(inner, stepper)
        else:
            setattr(inner, stepper, before)
