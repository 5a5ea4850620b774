import copy
import dataclasses
import pickle
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


def pushed_ball(parameters=PARAMETERS):
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


def by_hand(steps, push):
    """The frames of the same motion without any environment, with the noise of seed 3."""
    spec, sensor = pushed_ball()
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


def wrapped(**settings):
    """A wrapped environment; with several physics steps per step, up to 6 frames at 271 Hz."""
    spec, sensor = pushed_ball()
    several = {"listen": listen, "frames": 6} if settings.get("physics_steps", 1) > 1 else {}
    return TactileObservation(BallEnv(spec.compile(), **settings), sensor, **several)


def frames_of(info, name="tactile"):
    """The frames of a step: times, counts and images."""
    new = info["frames"][name]
    return [new[each][: new["made"]] for each in ("times", "counts", "images")]


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_every_observation_lies_in_the_space():
    env = wrapped(physics_steps=5)
    check_env(env, skip_render_check=True)
    assert env.observation_space["tactile"].shape == (14, 6)


@pytest.mark.parametrize("physics_steps", [1, 20])
def test_frames_are_those_of_the_bare_simulation_at_the_sensors_own_rate(physics_steps):
    env = wrapped(physics_steps=physics_steps)
    env.reset(seed=3)
    times, counts, images = [], [], []
    for _ in range(400 // physics_steps):
        observation, _, _, _, info = env.step(np.array([-0.5]))
        for known, new in zip((times, counts, images), frames_of(info), strict=True):
            known.extend(new)
        if images:
            assert np.array_equal(observation["tactile"], images[-1])
    expected = by_hand(400, -0.5)
    assert times == [frame.time for frame in expected]
    assert len(times) == int(0.4 * 271)
    assert np.array_equal(counts, [frame.counts for frame in expected])
    assert np.array_equal(images, [frame.image for frame in expected])
    assert observation["tactile"].max() > 50
    new = info["frames"]["tactile"]
    for made, frame in zip(range(new["made"]), expected[len(expected) - new["made"] :], strict=True):
        np.testing.assert_array_equal(new["net_forces"][made], frame.net_force)
        np.testing.assert_array_equal(new["net_torques"][made], frame.net_torque)
    assert new["net_forces"].shape == new["net_torques"].shape == (len(new["times"]), 3)
    assert (new["net_forces"][: new["made"], 2] < -0.1).all()


def test_a_fast_environment_observes_each_image_until_the_next_frame():
    env = wrapped()
    env.reset()
    new = [env.step(np.array([-0.5]))[4]["frames"]["tactile"]["made"] for _ in range(100)]
    assert set(new) == {0, 1}
    assert sum(new) == 27


def test_frames_beyond_the_room_are_counted_and_the_latest_kept():
    spec, sensor = pushed_ball()
    env = TactileObservation(BallEnv(spec.compile(), physics_steps=20), sensor, listen=listen, frames=2)
    env.reset(seed=3)
    new = env.step(np.array([-0.5]))[4]["frames"]["tactile"]
    assert new["made"] == 5
    assert new["times"].tolist() == [frame.time for frame in by_hand(20, -0.5)][-2:]
    with pytest.raises(FastModelError, match="frames must be a whole number"):
        TactileObservation(env.env, sensor, frames=0)


#: Counts at rest are not zero, so that they show the noise.
NOISY = dataclasses.replace(PARAMETERS, electronics=dataclasses.replace(PARAMETERS.electronics, offset=100.0))


def floating_ball():
    """An environment in which nothing touches the two arrays."""
    spec, sensor = pushed_ball(NOISY)
    second = fastmodel.attach(spec, "world", NOISY, name="second", position=[0.1, 0, 0])
    spec.option.gravity = [0, 0, 0]
    return TactileObservation(BallEnv(spec.compile()), {"near": sensor, "far": second})


def noise_of(env, seed=None):
    """All counts of an episode, shape (frames, sensors, texels)."""
    env.reset(seed=seed)
    infos = [env.step(np.array([0.0]))[4] for _ in range(40)]
    return np.concatenate([np.stack([frames_of(info, name)[1] for name in ("near", "far")], axis=1) for info in infos])


def test_the_seed_of_reset_seeds_the_sensors_and_episodes_without_one_differ():
    env = floating_ball()
    one, other, later, again = (noise_of(env, seed) for seed in (1, 2, None, 1))
    assert one.any()
    assert np.array_equal(one, again)
    assert (one != other).any()
    assert (later != other).any()
    unseeded = [noise_of(floating_ball()) for _ in range(2)]
    assert (unseeded[0] != unseeded[1]).any()
    assert (one[:, 0] != one[:, 1]).any()  # two sensors
    given = []
    for seed in (4, 4, 5):
        env = floating_ball()
        env.unwrapped.np_random = np.random.default_rng(seed)
        given.append(noise_of(env))
    assert np.array_equal(given[0], given[1])
    assert (given[0] != given[2]).any()


def test_reset_clears_the_image_and_the_same_seed_repeats_the_run_exactly():
    env = wrapped(physics_steps=10)
    runs = []
    for _ in range(2):
        observation, info = env.reset(seed=4)
        assert not observation["tactile"].any()
        assert info["frames"]["tactile"]["made"] == 0
        runs.append([env.step(np.array([-0.5]))[0]["tactile"] for _ in range(30)])
    assert runs[0][-1].any()
    assert np.array_equal(*runs)


def short_episodes(length):
    """A function that makes an environment with episodes of this many steps, as vector environments take it."""
    return lambda: wrapped(physics_steps=7, length=length)


@pytest.mark.parametrize("vector", ["SyncVectorEnv", "AsyncVectorEnv"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_environments_whose_episodes_end_at_different_steps_run_as_a_vector(vector, mode):
    lengths = (3, 5, 50)
    # a process must not be forked once JAX, which has threads, was imported by another test
    settings = {"context": "spawn"} if vector == "AsyncVectorEnv" and "jax" in sys.modules else {}
    envs = getattr(gymnasium.vector, vector)(
        [short_episodes(length) for length in lengths],
        autoreset_mode=gymnasium.vector.AutoresetMode(mode),
        **settings,
    )
    singles = [short_episodes(None)() for _ in lengths]
    try:
        observation, _ = envs.reset(seed=[7, 8, 9])
        for k, single in enumerate(singles):
            single.reset(seed=7 + k)
        for step in range(1, 25):
            observation, _, _, ended, infos = envs.step(np.full((3, 1), -0.5))
            new = infos["frames"]["tactile"]
            assert observation["tactile"].shape == (3, 14, 6)
            assert new["counts"].shape == (3, 6, 84)
            assert new["made"].shape == (3,)
            assert ended.tolist() == [False] * 3 or step >= 3
            for k, single in enumerate(singles):
                if step < lengths[k]:  # the first episode, before any reset
                    alone, *_, info = single.step(np.array([-0.5]))
                    assert np.array_equal(observation["tactile"][k], alone["tactile"])
                    assert new["made"][k] == info["frames"]["tactile"]["made"]
                    assert np.array_equal(new["counts"][k], info["frames"]["tactile"]["counts"])
        assert observation["tactile"][2].any()
    finally:
        envs.close()


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_wrappers_of_gymnasium_take_the_observations():
    from gymnasium.wrappers import FlattenObservation, FrameStackObservation, RecordEpisodeStatistics, TimeLimit

    env = RecordEpisodeStatistics(FrameStackObservation(TimeLimit(wrapped(physics_steps=5), 100), 4))
    check_env(env, skip_render_check=True)
    env.reset(seed=0)
    images = []
    for _ in range(100):
        observation, _, _, ended, info = env.step(np.array([-0.5]))
        images.append(observation["tactile"][-1])
    assert observation["tactile"].shape == (4, 14, 6)
    assert np.array_equal(observation["tactile"], images[-4:])
    assert images[-1].any()
    assert ended
    assert info["episode"]["l"] == 100
    assert FlattenObservation(wrapped()).reset()[0].shape == (1 + 84,)


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_a_registered_environment_is_made_again_with_its_sensors():
    spec, sensor = pushed_ball()
    model = spec.compile()
    gymnasium.register("softcover-test/Ball-v0", entry_point=lambda: BallEnv(model), max_episode_steps=100)
    try:
        env = TactileObservation(gymnasium.make("softcover-test/Ball-v0"), {"skin": sensor})
        check_env(env, skip_render_check=True)
        again = env.spec.make()
        assert again.observation_space == env.observation_space
        env.reset(seed=3)
        again.reset(seed=3)
        assert np.array_equal(*[[each.step(np.array([-0.5]))[0]["skin"] for _ in range(50)] for each in (env, again)])
    finally:
        gymnasium.registry.pop("softcover-test/Ball-v0")


def test_several_environments_may_be_made_from_one_sensor():
    spec, sensor = pushed_ball()
    envs = [TactileObservation(BallEnv(spec.compile()), sensor) for _ in range(2)]
    images = []
    for env in envs:
        env.reset(seed=3)
    for _ in range(200):
        images = [env.step(np.array([-0.5]))[0]["tactile"] for env in envs]
    assert images[0].any()
    assert np.array_equal(*images)
    assert envs[0].sensors["tactile"].carried() == pytest.approx(0.2 * 9.81 + 0.5, rel=1e-2)


def run(env, steps, push=-0.5):
    return [env.step(np.array([push]))[0]["tactile"] for _ in range(steps)]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])  # noqa: S301
@pytest.mark.parametrize("physics_steps", [1, 10])
def test_a_copy_continues_as_the_original_and_leaves_it_alone(physics_steps, duplicate):
    env = wrapped(physics_steps=physics_steps)
    env.reset(seed=3)
    run(env, 300 // physics_steps)
    twin, time = duplicate(env), env.unwrapped.data.time
    theirs = run(twin, 100 // physics_steps)
    assert env.unwrapped.data.time == time
    assert np.array_equal(run(env, 100 // physics_steps), theirs)
    assert theirs[-1].any()
    assert np.array_equal(theirs[-1], by_hand(400, -0.5)[-1].image)
    twin.reset(seed=5)
    assert env.unwrapped.data.time > time


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


def test_an_environment_that_does_not_call_back_is_refused():
    spec, sensor = pushed_ball()
    env = TactileObservation(BallEnv(spec.compile(), physics_steps=5), sensor, listen=lambda env, callback: None)
    env.reset()
    with pytest.raises(LifeCycleError, match="without calling back"):
        env.step(np.array([0.0]))


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


@pytest.fixture
def ball_file(tmp_path):
    spec, sensor = pushed_ball()
    spec.compile()
    spec.to_file(str(tmp_path / "ball.xml"))
    return str(tmp_path / "ball.xml"), sensor


def file_env(path, *bases):
    """An environment of gymnasium's own base class, which makes 20 physics steps per step."""
    pytest.importorskip("imageio")  # gymnasium's own renderer imports it
    from gymnasium.envs.mujoco import MujocoEnv

    class FileEnv(MujocoEnv, *bases):
        metadata = {"render_modes": ["human", "rgb_array", "depth_array", "rgbd_tuple"]}  # noqa: RUF012 -- gymnasium's

        def __init__(self):
            for base in bases:
                base.__init__(self)
            height = gymnasium.spaces.Box(-np.inf, np.inf, shape=(1,), dtype=np.float64)
            MujocoEnv.__init__(self, path, 20, height)

        def step(self, action):
            self.do_simulation(action, self.frame_skip)
            return self.data.qpos.copy(), 0.0, False, False, {}

        def reset_model(self):
            return self.data.qpos.copy()

    return FileEnv()


def test_a_mujoco_env_needs_no_callback_of_its_own(ball_file):
    path, sensor = ball_file
    env = TactileObservation(file_env(path), sensor)
    env.reset(seed=3)
    made = 0
    for _ in range(20):
        observation, _, _, _, info = env.step(np.array([-0.5]))
        made += info["frames"]["tactile"]["made"]
        assert info["frames"]["tactile"]["times"].shape == (6,)
    assert np.array_equal(observation["tactile"], by_hand(400, -0.5)[-1].image)
    assert made == int(0.4 * 271)


def test_a_copied_mujoco_env_is_independent_and_two_wrappers_may_be_nested(ball_file):
    path, sensor = ball_file
    env = TactileObservation(TactileObservation(file_env(path), sensor), {"again": sensor.twin()})
    env.reset(seed=3)
    run(env, 15)
    twin = copy.deepcopy(env)
    theirs = run(twin, 5)
    assert env.unwrapped.data.time == pytest.approx(0.3)
    mine = [env.step(np.array([-0.5]))[0] for _ in range(5)]
    assert np.array_equal([each["tactile"] for each in mine], theirs)
    assert mine[-1]["again"].any()
    assert "_step_mujoco_simulation" not in vars(env.unwrapped)


def test_a_copy_that_starts_anew_needs_a_reset(ball_file):
    path, sensor = ball_file
    env = TactileObservation(file_env(path, gymnasium.utils.EzPickle), sensor)
    env.reset(seed=3)
    mine = run(env, 20)
    twin = copy.deepcopy(env)
    with pytest.raises(LifeCycleError, match="call reset"):
        twin.step(np.array([-0.5]))
    twin.reset(seed=3)
    assert np.array_equal(run(twin, 20), mine)


@pytest.mark.slow
def test_an_environment_of_gymnasium_robotics_needs_no_callback_of_its_own(ball_file):
    robotics = pytest.importorskip("gymnasium_robotics.envs.robot_env")
    path, sensor = ball_file

    class RobotEnv(robotics.MujocoRobotEnv):
        metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 -- gymnasium's

        def _set_action(self, action):
            self.data.ctrl[:] = action

        def _get_obs(self):
            return {"observation": self.data.qpos.copy(), "achieved_goal": np.zeros(1), "desired_goal": np.zeros(1)}

        def _sample_goal(self):
            return np.zeros(1)

        def _is_success(self, achieved, desired):
            return False

        def compute_reward(self, achieved, desired, info):
            return 0.0

        def compute_terminated(self, achieved, desired, info):
            return False

        def compute_truncated(self, achieved, desired, info):
            return False

    inner = RobotEnv(model_path=path, initial_qpos={}, n_actions=1, n_substeps=20)
    env = TactileObservation(inner, sensor)
    env.reset(seed=3)
    assert np.array_equal(run(env, 20)[-1], by_hand(400, -0.5)[-1].image)
    assert inner.n_substeps == 20


def test_the_package_loads_no_gymnasium_and_its_absence_raises_a_clear_error():
    code = (
        "import sys, fastmodel\n"
        "assert 'gymnasium' not in sys.modules\n"
        "sys.modules['gymnasium'] = None\n"
        "import fastmodel.adapters.gymnasium\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert "pip install 'softcover[gym]'" in done.stderr
