import dataclasses
import subprocess
import sys

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Butterworth, FastModelError, Gaussian, LifeCycleError, Parameters
from meshes.catalogue import ARRAYS

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402 -- only where gymnasium is

from fastmodel.adapters.gymnasium import TactileObservation  # noqa: E402 -- only where gymnasium is

ARRAY = ARRAYS["wts-0614-34"]
PARAMETERS = Parameters(
    array=ARRAY,
    spread=Gaussian.from_sigma(0.6),
    electronics=dataclasses.replace(WTS_0614_34, noise=0.002),
    filter=Butterworth(cutoff_hz=40.0, order=2),
)


def pushed_ball():
    """A 200 g ball on a slide, pushed onto an array by a motor: the spec and its sensor."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = 1e-3
    sensor = fastmodel.attach(spec, "world", PARAMETERS)
    ball = spec.worldbody.add_body(name="ball", pos=[0.5e-3, 1e-3, 7e-3])
    ball.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[6e-3, 0, 0], mass=0.2)
    motor = spec.add_actuator(name="push", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.ctrlrange = [-1, 0]
    return spec, sensor


class BallEnv(gymnasium.Env):
    """An environment without any code for sensors."""

    def __init__(self, model, *, physics_steps=1, dicts=False):
        self.model, self.data = model, mujoco.MjData(model)
        self.physics_steps, self.listeners, self.dicts = physics_steps, [], dicts
        height = gymnasium.spaces.Box(-np.inf, np.inf, shape=(1,), dtype=np.float64)
        self.observation_space = gymnasium.spaces.Dict({"height": height}) if dicts else height
        self.action_space = gymnasium.spaces.Box(-1, 0, shape=(1,), dtype=np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        return self.observe(), {}

    def step(self, action):
        self.data.ctrl[:] = action
        for _ in range(self.physics_steps):
            mujoco.mj_step(self.model, self.data)
            for listener in self.listeners:
                listener(self.data)
        return self.observe(), 0.0, False, False, {"time": self.data.time}

    def observe(self):
        height = self.data.qpos.copy()
        return {"height": height} if self.dicts else height


def listen(env, callback):
    env.unwrapped.listeners.append(callback)


def by_hand(steps, push):
    """The frames of the same motion without any environment."""
    spec, sensor = pushed_ball()
    model = spec.compile()
    data = mujoco.MjData(model)
    sensor.bind(model)
    frames = []
    for _ in range(steps):
        data.ctrl[:] = push
        mujoco.mj_step(model, data)
        if sensor.step(data):
            frames.append(sensor.frame())
    return frames


def wrapped(**settings):
    spec, sensor = pushed_ball()
    several = settings.get("physics_steps", 1) > 1
    return TactileObservation(BallEnv(spec.compile(), **settings), sensor, listen=listen if several else None)


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_every_observation_lies_in_the_space():
    env = wrapped(physics_steps=5)
    check_env(env, skip_render_check=True)
    assert env.observation_space["tactile"].shape == (14, 6)


@pytest.mark.parametrize("physics_steps", [1, 20])
def test_frames_are_those_of_the_bare_simulation_at_the_sensors_own_rate(physics_steps):
    env = wrapped(physics_steps=physics_steps)
    env.reset()
    times, counts, images = [], [], []
    for _ in range(400 // physics_steps):
        observation, _, _, _, info = env.step(np.array([-0.5]))
        new = info["frames"]["tactile"]
        times, counts, images = [*times, *new["times"]], [*counts, *new["counts"]], [*images, *new["images"]]
        if images:
            assert np.array_equal(observation["tactile"], images[-1])
    expected = by_hand(400, -0.5)
    assert times == [frame.time for frame in expected]
    assert len(times) == int(0.4 * 271)
    assert np.array_equal(counts, [frame.counts for frame in expected])
    assert np.array_equal(images, [frame.image for frame in expected])
    assert observation["tactile"].max() > 50


def test_a_fast_environment_observes_each_image_until_the_next_frame():
    env = wrapped()
    env.reset()
    new = [len(env.step(np.array([-0.5]))[4]["frames"]["tactile"]["times"]) for _ in range(100)]
    assert set(new) == {0, 1}
    assert sum(new) == 27


def test_reset_clears_the_image_and_repeats_the_run_exactly():
    env = wrapped(physics_steps=10)
    runs = []
    for _ in range(2):
        observation, _ = env.reset()
        assert not observation["tactile"].any()
        runs.append([env.step(np.array([-0.5]))[0]["tactile"] for _ in range(30)])
    assert runs[0][-1].any()
    assert np.array_equal(*runs)


def test_dicts_keep_their_keys_and_several_sensors_their_names():
    spec, sensor = pushed_ball()
    second = fastmodel.attach(spec, "world", PARAMETERS, name="second", position=[0.1, 0, 0])
    env = TactileObservation(BallEnv(spec.compile(), dicts=True), {"near": sensor, "far": second})
    observation, _ = env.reset()
    assert observation.keys() == {"height", "near", "far"}
    for _ in range(300):
        observation, *_ = env.step(np.array([-0.5]))
    assert observation in env.observation_space
    assert observation["near"].any()
    assert not observation["far"].any()
    with pytest.raises(FastModelError, match="observes 'height' already"):
        TactileObservation(BallEnv(env.unwrapped.model, dicts=True), {"height": sensor})


def test_an_accessor_finds_a_hidden_simulation():
    spec, sensor = pushed_ball()
    inner = BallEnv(spec.compile())
    hidden = inner.model, inner.data
    TactileObservation(inner, sensor, simulation=lambda _: hidden).reset()
    with pytest.raises(FastModelError, match="shows no MuJoCo model and data; give simulation="):
        TactileObservation(gymnasium.make("CartPole-v1"), sensor)


def test_missed_physics_steps_and_a_model_without_the_array_are_refused():
    spec, sensor = pushed_ball()
    env = TactileObservation(BallEnv(spec.compile(), physics_steps=5), sensor)
    env.reset()
    env.step(np.array([0.0]))
    with pytest.raises(LifeCycleError, match="give listen="):
        env.step(np.array([0.0]))
    with pytest.raises(LifeCycleError):
        TactileObservation(BallEnv(mujoco.MjSpec().compile()), sensor)


def test_a_recompiled_model_is_bound_again():
    env = wrapped()
    env.reset()
    env.step(np.array([-0.5]))
    env.unwrapped.model = pushed_ball()[0].compile()
    env.unwrapped.data = mujoco.MjData(env.unwrapped.model)
    env.reset()
    for _ in range(200):
        observation, *_ = env.step(np.array([-0.5]))
    assert observation["tactile"].any()


def test_a_mujoco_env_needs_no_callback_of_its_own(tmp_path):
    pytest.importorskip("imageio")  # gymnasium's own renderer imports it
    from gymnasium.envs.mujoco import MujocoEnv

    class FileEnv(MujocoEnv):
        metadata = {"render_modes": ["human", "rgb_array", "depth_array", "rgbd_tuple"]}  # noqa: RUF012 -- gymnasium's

        def step(self, action):
            self.do_simulation(action, self.frame_skip)
            return self.data.qpos.copy(), 0.0, False, False, {}

        def reset_model(self):
            return self.data.qpos.copy()

    spec, sensor = pushed_ball()
    spec.compile()
    spec.to_file(str(tmp_path / "ball.xml"))
    height = gymnasium.spaces.Box(-np.inf, np.inf, shape=(1,), dtype=np.float64)
    env = TactileObservation(FileEnv(str(tmp_path / "ball.xml"), 20, height), sensor)
    env.reset()
    for _ in range(20):
        observation, _, _, _, info = env.step(np.array([-0.5]))
    assert np.array_equal(observation["tactile"], by_hand(400, -0.5)[-1].image)
    assert len(info["frames"]["tactile"]["times"]) in {5, 6}


def test_the_package_loads_no_gymnasium_and_its_absence_raises_a_clear_error():
    code = (
        "import sys, fastmodel\n"
        "assert 'gymnasium' not in sys.modules\n"
        "sys.modules['gymnasium'] = None\n"
        "import fastmodel.adapters.gymnasium\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert "pip install 'softcover[gym]'" in done.stderr
