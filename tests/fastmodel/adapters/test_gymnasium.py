import dataclasses
import subprocess
import sys
import warnings

import mujoco
import numpy as np
import pytest
import scipy.stats

import fastmodel
from fastmodel import FastModelError
from fastmodel.errors import LifeCycleError
from tests.support.ball_environment import (
    PARAMETERS,
    BallEnv,
    build_pushed_ball,
    list_frames,
    listen,
    run,
    simulate_by_hand,
    wrap_ball,
)

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402 -- only where gymnasium is

from fastmodel.adapters.gymnasium import QUANTITIES, TactileObservation, Variation  # noqa: E402 -- only where gymnasium is


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_every_observation_lies_in_the_space():
    env = wrap_ball(physics_steps=5)
    check_env(env, skip_render_check=True)
    assert env.observation_space["tactile"].shape == (14, 6)


@pytest.mark.parametrize("physics_steps", [pytest.param(1, marks=pytest.mark.slow), 20])
def test_frames_are_those_of_the_bare_simulation_at_the_sensors_own_rate(physics_steps):
    env = wrap_ball(physics_steps=physics_steps)
    env.reset(seed=3)
    times, counts, images = [], [], []
    for _ in range(400 // physics_steps):
        observation, _, _, _, info = env.step(np.array([-0.5]))
        for known, new in zip((times, counts, images), list_frames(info), strict=True):
            known.extend(new)
        if images:
            assert np.array_equal(observation["tactile"], images[-1])
    expected = simulate_by_hand(400, -0.5)
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


def test_of_frames_beyond_the_room_the_latest_are_kept_and_the_others_counted():
    spec, sensor = build_pushed_ball()
    env = TactileObservation(BallEnv(spec.compile(), physics_steps=20), sensor, listen=listen, frames=2)
    env.reset(seed=3)
    new = env.step(np.array([-0.5]))[4]["frames"]["tactile"]
    assert (new["made"], new["dropped"]) == (2, 3)
    assert wrap_ball().reset()[1]["frames"]["tactile"]["dropped"] == 0
    assert new["times"].tolist() == [frame.time for frame in simulate_by_hand(20, -0.5)][-2:]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"env": 3}, "env must be a gymnasium.Env, not int"),
        ({"env": gymnasium.make("CartPole-v1")}, "shows no MuJoCo model and data; give simulation="),
        ({"env": BallEnv(mujoco.MjSpec().compile())}, "is not in this model"),
        ({"sensors": None}, "sensors must be a fastmodel.Sensor, or a dict of them by name"),
        ({"sensors": ["skin"]}, "sensors must be .* not list"),
        ({"sensors": {"skin": 3}}, r"sensors\['skin'\] must be a fastmodel.Sensor, not int"),
        ({"sensors": {}}, "there is no sensor to observe"),
        ({"simulation": "env.sim"}, "simulation must be a function"),
        ({"listen": True}, "listen must be a function"),
        ({"key": 1}, "key must be a str"),
        ({"frames": "6"}, "frames must be a whole number, not str"),
        ({"frames": 0}, "frames must be a whole number from 1 on, not 0"),
        ({"observe": "forces"}, "no quantity named 'forces'; valid names: image"),
        ({"observe": []}, "no quantity named ''"),
        ({"observe": 5}, "observe must be one or several of"),
        ({"history": -1}, "history must be a whole number from 0 on, not -1"),
        ({"variation": 0.1}, "variation must be a Variation or None"),
        ({"frames": np.nan}, "frames must be a whole number from 1 on, not nan"),
    ],
)
def test_wrong_arguments_are_named(wrong, message):
    spec, sensor = build_pushed_ball()
    with pytest.raises(FastModelError, match=message):
        TactileObservation(**{"env": BallEnv(spec.compile()), "sensors": sensor, **wrong})


def test_an_entry_of_the_environments_own_info_is_not_overwritten():
    class CountingEnv(BallEnv):
        def step(self, action):
            *others, info = super().step(action)
            return *others, {**info, "frames": self.steps}

    spec, sensor = build_pushed_ball()
    model = spec.compile()
    env = TactileObservation(CountingEnv(model), sensor)
    env.reset()
    with pytest.raises(FastModelError, match="has an entry 'frames' already; give key="):
        env.step(np.array([-0.5]))
    env = TactileObservation(CountingEnv(model), sensor, key="touches")
    env.reset()
    *_, info = env.step(np.array([-0.5]))
    assert info["frames"] == 1
    assert info["touches"]["tactile"]["images"].shape == (1, 14, 6)


#: Counts at rest are not zero, so that they show the noise.
NOISY = dataclasses.replace(PARAMETERS, electronics=dataclasses.replace(PARAMETERS.electronics, offset=100.0))


def floating_ball():
    """An environment in which nothing touches the two arrays."""
    spec, sensor = build_pushed_ball(NOISY)
    second = fastmodel.attach(spec, "world", NOISY, name="second", position=[0.1, 0, 0])
    spec.option.gravity = [0, 0, 0]
    return TactileObservation(BallEnv(spec.compile()), {"near": sensor, "far": second})


def noise_of(env, seed=None):
    """All counts of an episode, shape (frames, sensors, texels)."""
    env.reset(seed=seed)
    infos = [env.step(np.array([0.0]))[4] for _ in range(40)]
    return np.concatenate(
        [np.stack([list_frames(info, name)[1] for name in ("near", "far")], axis=1) for info in infos]
    )


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


def test_physics_steps_outside_a_step_of_the_environment_make_no_frames():
    """Neither those before the first reset, nor those of a reset that lets the ball settle."""

    class SettlingEnv(BallEnv):
        def reset(self, **given):
            found = super().reset(**given)
            super().step(np.array([0.0]))
            return found

    spec, sensor = build_pushed_ball()
    inner = SettlingEnv(spec.compile(), physics_steps=20)
    env = TactileObservation(inner, sensor, listen=listen, frames=9)
    inner.reset()
    for _ in range(2):
        frames = env.reset(seed=3)[1]["frames"]["tactile"]
        assert (frames["made"], frames["dropped"]) == (0, 0)
        frames = env.step(np.array([-0.5]))[4]["frames"]["tactile"]
        assert frames["made"] in {5, 6}  # 271 frames/s in 20 ms
        assert (frames["times"][: frames["made"]] > 0.02).all()


def test_dicts_keep_their_keys_and_several_sensors_their_names():
    spec, sensor = build_pushed_ball()
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
    spec, sensor = build_pushed_ball()
    inner = BallEnv(spec.compile())
    hidden = inner.model, inner.data
    asked = []
    env = TactileObservation(inner, sensor, simulation=lambda env: asked.append(env) or hidden)
    env.reset()
    assert asked
    assert all(each is inner for each in asked)


@pytest.mark.parametrize(
    ("unheard", "message"), [({"listen": lambda env, callback: None}, "without calling back"), ({}, "give listen=")]
)
def test_physics_steps_that_the_sensors_miss_are_refused(unheard, message):
    spec, sensor = build_pushed_ball()
    env = TactileObservation(BallEnv(spec.compile(), physics_steps=5), sensor, **unheard)
    env.reset()
    with pytest.raises(LifeCycleError, match=message):
        run(env, 2)


def test_a_recompiled_model_is_bound_again():
    env = wrap_ball()
    env.reset()
    env.step(np.array([-0.5]))
    env.unwrapped.model = build_pushed_ball()[0].compile()
    env.unwrapped.data = mujoco.MjData(env.unwrapped.model)
    env.reset()
    for _ in range(200):
        observation, *_ = env.step(np.array([-0.5]))
    assert observation["tactile"].any()


@pytest.mark.slow
def test_the_package_loads_no_gymnasium_and_its_absence_raises_a_clear_error():
    code = (
        "import sys, fastmodel\n"
        "assert 'gymnasium' not in sys.modules\n"
        "sys.modules['gymnasium'] = None\n"
        "import fastmodel.adapters.gymnasium\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert "pip install -e '.[gym]'" in done.stderr


def observe_ball(**settings):
    """A ball that is pushed onto an array within 300 steps of 1 ms, and the environment after one more step."""
    spec, sensor = build_pushed_ball()
    env = TactileObservation(BallEnv(spec.compile()), sensor, **settings)
    env.reset(seed=4)
    for _ in range(300):
        observation, *_, info = env.step(np.array([-0.5]))
    return env, observation, info


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_every_quantity_of_a_frame_can_be_observed():
    env, seen, _ = observe_ball(observe=QUANTITIES)
    frame = env.sensors["tactile"].frame()
    wanted = {
        "image": frame.image,
        "texel_forces": frame.texel_forces.reshape(14, 6),
        "pressures": frame.texel_forces.reshape(14, 6) / 3.4e-3**2,
        "tangential": frame.tangential.T.reshape(2, 14, 6),
        "wrench": np.concatenate([frame.net_force, frame.net_torque]),
    }
    assert sorted(set(seen) - {"observation"}) == sorted(f"tactile/{name}" for name in wanted)
    for name, values in wanted.items():
        assert np.abs(values).max() > 0
        np.testing.assert_array_equal(seen[f"tactile/{name}"], values.astype(seen[f"tactile/{name}"].dtype))
    assert seen["tactile/wrench"][2] == pytest.approx(-0.2 * 9.81 - 0.5, rel=0.02)
    check_env(env, skip_render_check=True)


def test_the_history_is_the_latest_frames_oldest_first_and_info_has_their_forces():
    spec, sensor = build_pushed_ball()
    model = spec.compile()
    env = TactileObservation(
        BallEnv(model, physics_steps=20), sensor, listen=listen, frames=6, observe="texel_forces", history=3
    )
    before = env.reset(seed=3)[0]["tactile"]
    assert before.shape == env.observation_space["tactile"].shape == (4, 14, 6)
    assert not before.any()
    for _ in range(15):
        seen, *_, info = env.step(np.array([-0.5]))
    expected = np.array([frame.texel_forces for frame in simulate_by_hand(300, -0.5)])
    np.testing.assert_array_equal(seen["tactile"].reshape(4, 84), expected[-4:].astype(np.float32))
    new = info["frames"]["tactile"]
    np.testing.assert_array_equal(new["texel_forces"][: new["made"]], expected[-new["made"] :])
    assert new["tangential"].shape == (6, 84, 2)
    assert (np.diff(expected[-4:].sum(axis=1)) != 0).all()


def test_gains_offsets_and_dead_texels_vary_with_the_seed_of_the_reset_alone():
    variation = Variation(gain=0.2, offset=0.03, dead=0.25)
    env, seen, info = observe_ball(observe=("texel_forces", "tangential", "image"), variation=variation)
    again = observe_ball(observe=("texel_forces", "tangential", "image"), variation=variation)[1]
    assert all(np.array_equal(seen[name], again[name]) for name in seen)
    frame = env.sensors["tactile"].frame()
    true, forces = frame.texel_forces, seen["tactile/texel_forces"].ravel()
    alive = forces != 0
    assert 0.1 < 1 - alive.mean() < 0.4  # 84 texels, each dead with probability 1/4
    rest = env.reset(seed=4)[0]["tactile/texel_forces"].ravel()  # the offsets alone
    assert rest[alive].std() == pytest.approx(0.03, rel=0.25)
    pressed = alive & (true > 0.01 * true.max())
    gains = (forces - rest)[pressed] / true[pressed]
    assert gains == pytest.approx(1, abs=0.8)
    assert gains.std() > 0.05
    share = (
        seen["tactile/tangential"].reshape(2, -1)[:, pressed]
        / np.where(frame.tangential, frame.tangential, 1).T[:, pressed]
    )
    found = np.abs(share) > 1e-12
    np.testing.assert_allclose(share[found], np.broadcast_to(gains, share.shape)[found], rtol=1e-3)
    assert seen["tactile/image"].ravel()[~alive].max() == 0
    assert not np.array_equal(env.reset()[0]["tactile/texel_forces"].ravel(), rest)
    np.testing.assert_array_equal(
        info["frames"]["tactile"]["texel_forces"][0] * info["frames"]["tactile"]["made"],
        true * info["frames"]["tactile"]["made"],
    )


def test_gains_of_texels_are_normally_distributed_about_one():
    """In each of thirty episodes a ball lies on the array from the beginning."""
    spec, sensor = build_pushed_ball(dataclasses.replace(PARAMETERS, filter=None))
    spec.body("ball").pos[2] = 5.6e-3
    env = TactileObservation(
        BallEnv(spec.compile()), sensor, observe="texel_forces", variation=Variation(gain=0.3, dead=0.1)
    )
    gains = []
    for seed in range(30):
        env.reset(seed=seed)
        seen = run(env, 5)[-1].ravel()
        true = env.sensors["tactile"].frame().texel_forces
        gains.append((seen / np.where(true, true, 1))[true > 1e-3 * true.max()])
    gains = np.array(gains)
    assert (gains == 0).mean() == pytest.approx(0.1, abs=4 * (0.09 / gains.size) ** 0.5)
    alive = gains[gains != 0]
    assert alive.size > 400
    assert scipy.stats.kstest(alive, scipy.stats.norm(1.0, 0.3).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(gains[:-1].ravel(), gains[1:].ravel())[0, 1]) < 4 / gains.size**0.5


def test_late_observations_are_those_of_earlier_frames():
    spec, sensor = build_pushed_ball()
    env = TactileObservation(BallEnv(spec.compile()), sensor, observe="texel_forces", variation=Variation(latency=3))
    found = set()
    for seed in range(12):
        env.reset(seed=seed)
        forces = [np.zeros(84)] * 4
        for _ in range(150):
            seen, *_, info = env.step(np.array([-0.5]))
            new = info["frames"]["tactile"]
            forces += list(new["texel_forces"][: new["made"]])
        late = [k for k in range(4) if np.array_equal(seen["tactile"].ravel(), forces[-1 - k].astype(np.float32))]
        assert len(late) == 1
        found |= set(late)
    assert found == {0, 1, 2, 3}
    for wrong in ({"gain": -1}, {"dead": 1.1}, {"offset": np.nan}, {"latency": 0.5}):
        with pytest.raises(FastModelError, match=next(iter(wrong))):
            Variation(**wrong)


def test_a_warning_of_a_sensor_is_given_once_for_all_environments():
    spec, sensor = build_pushed_ball()
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        sensor.bind(spec.compile())
        told = [str(each.message) for each in given]
        for _ in range(2):
            env = TactileObservation(BallEnv(spec.compile()), sensor)
            env.unwrapped.model = spec.compile()
            env.unwrapped.data = mujoco.MjData(env.unwrapped.model)
            env.reset(seed=1)
    assert told
    assert [str(each.message) for each in given] == told
