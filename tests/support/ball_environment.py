"""An environment of Gymnasium without any code for sensors: a motor pushes a ball onto an array."""

import dataclasses

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Butterworth, Gaussian, Parameters
from meshes.catalogue import ARRAYS

gymnasium = pytest.importorskip("gymnasium")

from fastmodel.adapters.gymnasium import TactileObservation  # noqa: E402 -- only where gymnasium is

ARRAY = ARRAYS["wts-0614-34"]
PARAMETERS = Parameters(
    array=ARRAY,
    spread=Gaussian.from_sigma(0.6),
    electronics=dataclasses.replace(WTS_0614_34, noise=0.002),
    filter=Butterworth(cutoff_hz=40.0, order=2),
)


def build_pushed_ball(parameters=PARAMETERS):
    """A 200 g ball on a slide, pushed onto an array by a motor: the spec and its sensor."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = 1e-3
    sensor = fastmodel.attach(spec, "world", parameters)
    ball = spec.worldbody.add_body(name="ball", pos=[0.5e-3, 1e-3, 7e-3])
    ball.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[6e-3, 0, 0], mass=0.2)
    motor = spec.add_actuator(name="push", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.ctrlrange = [-1, 0]
    return spec, sensor


class BallEnv(gymnasium.Env):
    """An environment without any code for sensors, whose episodes end after a number of steps."""

    def __init__(self, model, *, physics_steps=1, dicts=False, length=None):
        self.model, self.data = model, mujoco.MjData(model)
        self.physics_steps, self.listeners, self.dicts, self.length = physics_steps, [], dicts, length
        height = gymnasium.spaces.Box(-np.inf, np.inf, shape=(1,), dtype=np.float64)
        self.observation_space = gymnasium.spaces.Dict({"height": height}) if dicts else height
        self.action_space = gymnasium.spaces.Box(-1, 0, shape=(1,), dtype=np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.steps = 0
        return self.observe(), {}

    def step(self, action):
        self.data.ctrl[:] = action
        for _ in range(self.physics_steps):
            mujoco.mj_step(self.model, self.data)
            for listener in self.listeners:
                listener(self.data)
        self.steps += 1
        return self.observe(), 0.0, False, self.steps == self.length, {"time": self.data.time}

    def observe(self):
        height = self.data.qpos.copy()
        return {"height": height} if self.dicts else height


def listen(env, callback):
    env.unwrapped.listeners.append(callback)


def simulate_by_hand(steps, push):
    """The frames of the same motion without any environment, with the noise of seed 3."""
    spec, sensor = build_pushed_ball()
    model = spec.compile()
    data = mujoco.MjData(model)
    sensor.bind(model)
    sensor.reset(seed=np.random.SeedSequence(3).spawn(1)[0])
    frames = []
    for _ in range(steps):
        data.ctrl[:] = push
        mujoco.mj_step(model, data)
        if sensor.step(data):
            frames.append(sensor.frame())
    return frames


def wrap_ball(**settings):
    """A wrapped environment; with several physics steps per step, up to 6 frames at 271 Hz."""
    spec, sensor = build_pushed_ball()
    several = {"listen": listen, "frames": 6} if settings.get("physics_steps", 1) > 1 else {}
    return TactileObservation(BallEnv(spec.compile(), **settings), sensor, **several)


def list_frames(info, name="tactile"):
    """The frames of a step: times, counts and images."""
    new = info["frames"][name]
    return [new[each][: new["made"]] for each in ("times", "counts", "images")]


def run(env, steps, push=-0.5):
    return [env.step(np.array([push]))[0]["tactile"] for _ in range(steps)]
