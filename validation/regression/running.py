"""Experiments on running sensors in MuJoCo: load step, frames under a ramp, noise, reset, image of an off-centre H.

Under load step, ramp and noise, a ball of known weight rests on the middle texel, and a further force on the ball is
prescribed at every step.  Several sensors read the same simulation, each with another filter or other electronics.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel import (
    METHODS,
    Butterworth,
    Electronics,
    OptionWarning,
    Parameters,
    Sensor,
    add_indenter,
    attach,
    recommend_options,
)
from fastmodel.signal.frame import Frame
from meshes import Sphere
from meshes.array_types import FloatArray
from validation.regression.pressing import LETTER_PRESSURE, lay_letter_h
from validation.regression.subject import Subject, Values, list_rows

#: Weight of the ball [N].
_WEIGHT = 2.0
#: Longest timestep [s], and timesteps per period of the sensor's own filter, if that gives a shorter one [-].
_TIMESTEP, _PER_PERIOD = 1e-3, 20.0
#: Time for the ball to come to rest, and duration of the load step [s]; of the latter also in periods of the sensor's
#: own filter [-].
_REST, _STEP, _PERIODS = 0.15, 0.15, 5.0
#: Cut-off [Hz] and orders [-] of the filters that are measured besides the sensor's own one.
_CUTOFF, _ORDERS = 20.0, (1, 2, 3, 4)
#: Number of frames under the ramp [-].
_FRAMES = 8
#: Smallest number of noisy counts; their standard deviation then has a relative error of 0.7 % [-].
_SAMPLES = 10_000
#: Standard deviation of the noise that is measured besides the sensor's own one [N].
_NOISE = 0.1
#: Electronics with a count per millinewton, which neither saturate nor reach zero in these experiments.
_WIDE = Electronics(rate_hz=1 / _TIMESTEP, sensitivity=1000.0, offset=20_000.0, output_max=2**20, bits=24)
#: Half width of the hysteresis of the sensor that is reset, and force on each texel before and after [N].
_PLAY = 0.5
_RESET_LOADS = (1.0, 3.0, 1.0)
#: Time for which the H rests before its image is taken [s], and grey level of the mean force on a texel below it [-].
_LETTER_TIME, _LETTER_GREY = 0.25, 120.0
_NAME = "sensor"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Recorded:
    """What one sensor delivered after each of the steps.

    Attributes:
        frames: Latest frame after every step.
        new: Whether the step made a new frame, shape (steps,).
        totals: Sum of texel forces and force outside in the latest frame, shape (steps,) [N].
    """

    frames: Sequence[Frame]
    new: npt.NDArray[np.bool_]
    totals: FloatArray


def measure_load_step(subject: Subject) -> Values:
    """Measure rise time and overshoot of the total force after a load step, with the own filter and with fixed ones."""
    own = subject.parameters.filter
    period = 0.0 if own is None else 1.0 / own.cutoff_hz
    timestep = min(_TIMESTEP, period / _PER_PERIOD or _TIMESTEP)
    rest, steps = round(_REST / timestep), round(max(_STEP, _PERIODS * period) / timestep)
    filters = {"own filter": own}
    filters |= {f"order {order}": Butterworth(cutoff_hz=_CUTOFF, order=order) for order in _ORDERS}
    electronics = replace(_WIDE, rate_hz=1 / timestep)
    sensors = {
        name: replace(subject.parameters, filter=each, electronics=electronics) for name, each in filters.items()
    }
    loads = np.repeat([0.0, _WEIGHT], [rest, steps])
    responses = {
        name: recorded.totals[rest:] / _WEIGHT - 1.0
        for name, recorded in _simulate(subject.parameters, sensors, loads, timestep).items()
    }
    return {
        "rise time": {name: timestep * _count_rise(response) for name, response in responses.items()},
        "overshoot": {name: float(response.max()) - 1.0 for name, response in responses.items()},
        "force after the step": {name: _WEIGHT * (1 + float(response[-1])) for name, response in responses.items()},
    }


def measure_frames(subject: Subject) -> Values:
    """Measure times of frames, and by how much the forces in them lag behind a load that rises at a constant rate."""
    rate = subject.parameters.electronics.rate_hz
    rest, ramp = round(_REST / _TIMESTEP), max(round(_FRAMES / rate / _TIMESTEP), _FRAMES) + 1
    loads = np.append(np.zeros(rest), np.arange(1, ramp + 1) * _WEIGHT / ramp)
    sensors = {"own": replace(subject.parameters, filter=None)}
    own = _simulate(subject.parameters, sensors, loads, _TIMESTEP)["own"]
    made = np.flatnonzero(own.new)
    times = np.array([own.frames[step].time for step in made.tolist()])
    late = made[made >= rest + 1]
    slope = _WEIGHT / ramp / _TIMESTEP
    lags = (_WEIGHT + loads[late] - own.totals[late]) / slope
    return {
        "time of the first frames": {f"frame {number}": time for number, time in enumerate(times[:_FRAMES].tolist())},
        "frames per second": 1.0 / float(np.diff(times).mean()),
        "delay of the force": float(lags.mean()),
        "delay of the time": float((_TIMESTEP * (made + 1) - times).max()),
    }


def measure_noise(subject: Subject) -> Values:
    """Measure the noise of running sensors: its size, and whether it depends on seed, sensor, texel and frame."""
    array = subject.parameters.array
    steps = -(-_SAMPLES // array.count)
    quiet = replace(subject.parameters, filter=None, electronics=_WIDE)
    noisy = replace(quiet, electronics=replace(_WIDE, noise=_NOISE))
    sensors = {"quiet": quiet, "noisy": noisy, "same seed": noisy, "other seed": noisy}
    seed = subject.seed
    seeds = {"noisy": seed, "same seed": seed, "other seed": seed + 1}
    loads = np.zeros(steps)
    runs = _simulate(subject.parameters, sensors, loads, _TIMESTEP, seeds=seeds)
    counts = {name: np.array([frame.counts for frame in run.frames]) for name, run in runs.items()}
    active = array.active
    first, same, other = ((counts[name] - counts["quiet"])[:, active] / _WIDE.sensitivity for name in seeds)
    return {
        "standard deviation": float(first.std()),
        "mean": float(first.mean()),
        "difference for the same seed": float(np.abs(first - same).max()),
        "correlation": {
            "of two seeds": _correlate(first, other),
            "of two frames": _correlate(first[1:], first[:-1]),
            "of two texels": _correlate(first[:, 1:], first[:, :-1]) if first.shape[1] > 1 else 0.0,
        },
    }


def measure_reset(subject: Subject) -> Values:
    """Measure counts after resets of a sensor with hysteresis and filter; the first and the last are at equal load."""
    electronics = replace(_WIDE, hysteresis_share=0.5, hysteresis_width=_PLAY)
    parameters = replace(subject.parameters, filter=Butterworth(cutoff_hz=_CUTOFF), electronics=electronics)
    _, (sensor,) = _build(subject.parameters, [parameters], _TIMESTEP)
    means = []
    for load in _RESET_LOADS:
        sensor.reset(load)
        means.append(float(sensor.frame().counts[subject.parameters.array.active].mean()))
    return {"counts after a reset": means[0], "trace of the load before": means[2] - means[0]}


def measure_letter(subject: Subject) -> Values:
    """Press an off-centre, turned H on the sensor by the default method, and take its image and net force."""
    parameters = subject.parameters
    indenter, load, at, yaw = lay_letter_h(parameters.array)
    below = LETTER_PRESSURE * float(np.prod(parameters.array.pitch))
    electronics = Electronics(rate_hz=100.0, sensitivity=_LETTER_GREY / below, output_max=255, bits=8)
    spec = _make_spec(_TIMESTEP)
    height = float(parameters.array.centres[:, 2].max())
    add_indenter(spec, indenter, load, at=at, height=height, yaw=yaw)
    sensor = attach(spec, "world", replace(parameters, electronics=electronics, filter=None), name=_NAME)
    model = _compile(spec)
    data = mujoco.MjData(model)
    _bind(sensor, model)
    for _ in range(round(_LETTER_TIME / _TIMESTEP)):
        mujoco.mj_step(model, data)
        sensor.step(data)
    frame = sensor.frame()
    force, torque = (np.zeros(3) if each is None else each for each in (frame.net_force, frame.net_torque))
    return {
        "image": list_rows(frame.image),
        "net force": dict(zip("xyz", force.tolist(), strict=True)),
        "net torque": dict(zip("xyz", torque.tolist(), strict=True)),
        "force outside": sensor.outside() / load,
    }


def _simulate(
    parameters: Parameters,
    sensors: Mapping[str, Parameters],
    loads: FloatArray,
    timestep: float,
    *,
    seeds: Mapping[str, int] | None = None,
) -> dict[str, _Recorded]:
    """Simulate the ball under a prescribed force, and record what several sensors deliver.

    Args:
        parameters: The array.
        sensors: Parameters of the sensors, by name.
        loads: Force on the ball besides its weight at every step, shape (steps,) [N].
        timestep: Timestep [s].
        seeds: Seeds of the noise by name of the sensor.
    """
    model, bound = _build(parameters, list(sensors.values()), timestep)
    data = mujoco.MjData(model)
    ball = model.body(_NAME + "-ball").id
    for name, sensor in zip(sensors, bound, strict=True):
        if seeds and name in seeds:
            sensor.reset(seed=seeds[name])
    frames: list[list[Frame]] = [[] for _ in bound]
    new: list[list[bool]] = [[] for _ in bound]
    totals: list[list[float]] = [[] for _ in bound]
    for load in loads.tolist():
        data.xfrc_applied[ball, 2] = -load
        mujoco.mj_step(model, data)
        for index, sensor in enumerate(bound):
            new[index].append(sensor.step(data))
            frame = sensor.frame()
            frames[index].append(frame)
            forces = 0.0 if frame.texel_forces is None else float(frame.texel_forces.sum())
            totals[index].append(forces + sensor.outside())
    return {
        name: _Recorded(frames=frames[index], new=np.array(new[index]), totals=np.array(totals[index]))
        for index, name in enumerate(sensors)
    }


def _build(
    parameters: Parameters, sensors: Sequence[Parameters], timestep: float
) -> tuple[mujoco.MjModel, list[Sensor]]:
    """Build the model of the ball on the middle texel, and bind the sensors, which are all at the same place."""
    array = parameters.array
    spec = _make_spec(timestep)
    x, y, height = array.centres[array.middle].tolist()
    add_indenter(spec, Sphere(radius=min(array.pitch)), _WEIGHT, at=(x, y), height=height, name=_NAME + "-ball")
    attach(spec, "world", parameters, name=_NAME, contact="boxes")
    model = _compile(spec)
    method = METHODS["boxes"]
    return model, [_bind(Sensor(name=_NAME, parameters=each, contact=method, every=1), model) for each in sensors]


def _bind(sensor: Sensor, model: mujoco.MjModel) -> Sensor:
    """Bind a sensor without warnings of limited accuracy: measurements of two versions are compared, not with truth."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OptionWarning)
        return sensor.bind(model)


def _make_spec(timestep: float) -> mujoco.MjSpec:
    """Make a spec with the recommended options."""
    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = timestep
    return spec


def _compile(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a spec without friction, as the simulated bench tests do."""
    for geom in spec.geoms:
        geom.condim = 1
    return spec.compile()


def _count_rise(response: FloatArray) -> float:
    """Count the steps, interpolated, from 10 to 90 % of a response that ends at 1 [-]."""
    rising = response[: int(response.argmax()) + 1]
    if response.argmax() == 0 or rising[0] >= 0.9:  # noqa: PLR2004 -- 90 %
        return 0.0
    first, last = (float(np.interp(level, rising, np.arange(len(rising)))) for level in (0.1, 0.9))
    return last - first


def _correlate(one: FloatArray, other: FloatArray) -> float:
    """Return the coefficient of correlation of two arrays of numbers [-]; 0 if one is constant."""
    a, b = one.ravel() - one.mean(), other.ravel() - other.mean()
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale > 0 else 0.0
