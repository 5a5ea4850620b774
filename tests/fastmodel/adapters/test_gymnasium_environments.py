"""Environments of Gymnasium's own classes, vector environments, wrappers and copies, with tactile images."""

import copy
import pickle
import sys

import mujoco
import numpy as np
import pytest

from fastmodel.contact.plate import CellReader
from fastmodel.errors import LifeCycleError
from tests.support.ball_environment import (
    BallEnv,
    build_pushed_ball,
    run,
    simulate_by_hand,
    wrap_ball,
)
from tests.support.cover_data import parameters as cover_parameters

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402 -- only where gymnasium is

from fastmodel.adapters.gymnasium import TactileObservation  # noqa: E402 -- only where gymnasium is


def short_episodes(length):
    """A function that makes an environment with episodes of this many steps, as vector environments take it."""
    return lambda: wrap_ball(physics_steps=7, length=length)


@pytest.mark.parametrize("vector", ["SyncVectorEnv", pytest.param("AsyncVectorEnv", marks=pytest.mark.slow)])
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

    env = RecordEpisodeStatistics(FrameStackObservation(TimeLimit(wrap_ball(physics_steps=5), 100), 4))
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
    assert FlattenObservation(wrap_ball()).reset()[0].shape == (1 + 84,)


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_a_registered_environment_is_made_again_with_its_sensors():
    spec, sensor = build_pushed_ball()
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


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])  # noqa: S301
@pytest.mark.parametrize("physics_steps", [1, 10])
def test_a_copy_continues_as_the_original_and_leaves_it_alone(physics_steps, duplicate):
    env = wrap_ball(physics_steps=physics_steps)
    env.reset(seed=3)
    run(env, 300 // physics_steps)
    twin, time = duplicate(env), env.unwrapped.data.time
    theirs = run(twin, 100 // physics_steps)
    assert env.unwrapped.data.time == time
    assert np.array_equal(run(env, 100 // physics_steps), theirs)
    assert theirs[-1].any()
    assert np.array_equal(theirs[-1], simulate_by_hand(400, -0.5)[-1].image)
    twin.reset(seed=5)
    assert env.unwrapped.data.time > time


@pytest.fixture
def ball_file(tmp_path):
    spec, sensor = build_pushed_ball()
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
    assert np.array_equal(observation["tactile"], simulate_by_hand(400, -0.5)[-1].image)
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
    info = env.step(np.array([-0.5]))[4]
    assert info["frames"].keys() == {"tactile", "again"}
    assert np.array_equal(info["frames"]["tactile"]["images"], info["frames"]["again"]["images"])
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


class StepperEnv(BallEnv):
    """An environment with the method of physics steps of gymnasium-robotics' base class."""

    n_substeps = 20

    def _mujoco_step(self, action):
        self.data.ctrl[:] = action
        for _ in range(self.n_substeps):
            mujoco.mj_step(self.model, self.data)

    def step(self, action):
        self._mujoco_step(action)
        return self.observe(), 0.0, False, False, {}


@pytest.mark.parametrize("filtered", [False, True])
def test_frames_without_room_are_not_read_unless_a_filter_needs_them(filtered, monkeypatch):
    """Of 5 or 6 frames in 20 ms one has room; forces of `cover` with and without the others differ by its accuracy."""
    wanted = cover_parameters() if filtered else cover_parameters(filter=None)
    spec, sensor = build_pushed_ball(wanted)
    model, read, counts = spec.compile(), CellReader.read, []
    monkeypatch.setattr(CellReader, "read", lambda *arguments: (counts.append(1), read(*arguments))[1])
    seen = []
    for settings in ({}, {"frames": 1}):
        env = TactileObservation(StepperEnv(model), sensor, observe="texel_forces", **settings)
        env.reset(seed=3)
        counts.clear()
        for _ in range(15):
            observation, *_, info = env.step(np.array([-0.5]))
        new = info["frames"]["tactile"]
        seen.append((observation["tactile"], new["times"][new["made"] - 1], new["made"] + new["dropped"], len(counts)))
    (all_forces, last, made, readings), (forces, time, count, few) = seen
    assert (time, count) == (last, made)
    np.testing.assert_allclose(forces, all_forces, atol=2e-3 * all_forces.sum())
    assert all_forces.sum() > 1
    if filtered:
        assert few == readings
    else:
        assert 15 <= few <= 30
        assert readings >= 75
