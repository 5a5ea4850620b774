"""What two arrays cost in an environment for training, and a policy that is trained on their texel forces.

    python -m pip install -e '.[gym]' stable-baselines3
    OMP_NUM_THREADS=1 python benchmarks/training.py --steps 20000

Two fingers hold a free box between arrays of 8 x 8 texels.  One step of the environment has 10 physics steps of 2 ms.
The script prints the processor time of a step with and without arrays, then trains PPO of Stable-Baselines3 in two
processes of Gymnasium's `AsyncVectorEnv`, started anew (`spawn`), once on the joints alone and once on the texel forces
of both arrays too, and prints the steps per second of both.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import time
import warnings
from typing import Any

import gymnasium
import mujoco
import numpy as np

import fastmodel
from fastmodel.adapters.gymnasium import TactileObservation
from meshes import TexelArray

#: Physics steps in a step of the environment [-], their length [s], and steps of an episode [-].
SUBSTEPS, TIMESTEP, EPISODE = 10, 2e-3, 100
#: Force with which the arrays should hold the box [N].
WANTED = 4.0
#: Frame rates: one frame for each step of the environment, and that of the sensor [1/s].
RATES = (1 / (SUBSTEPS * TIMESTEP), 271.0)


def build(rate_hz: float = RATES[0]) -> tuple[mujoco.MjModel, dict[str, fastmodel.Sensor]]:
    """The model of the two fingers, and a sensor for each of them."""
    wts = fastmodel.load("wts-0614-34")
    skin = dataclasses.replace(
        wts,
        array=TexelArray.grid(8, 8, wts.array.pitch, margin=1e-3),
        electronics=dataclasses.replace(wts.electronics, rate_hz=rate_hz),
        tables={},
    )
    finger = mujoco.MjSpec.from_string("""<mujoco><worldbody><body name="finger">
        <joint name="slide" type="slide" axis="0 0 1" damping="5"/>
        <geom name="bone" type="box" size="0.015 0.015 0.005" pos="0 0 -0.01" mass="0.05"/></body></worldbody>
        <actuator><motor name="push" joint="slide" ctrlrange="0 10"/></actuator></mujoco>""")
    sensor = fastmodel.attach(finger, "finger", skin, name="skin")
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = TIMESTEP
    box = spec.worldbody.add_body(name="box")
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.01, 0.008, 0.009], mass=0.1)
    for side, sign in (("left", -1), ("right", 1)):
        frame = spec.worldbody.add_frame(pos=[sign * 0.0101, 0, 0], quat=[1, 0, -sign, 0])
        spec.attach(finger.copy(), prefix=f"{side}_", frame=frame)
    return spec.compile(), {side: sensor.twin(prefix=f"{side}_") for side in ("left", "right")}


class Hold(gymnasium.Env[Any, Any]):
    """Holds the box with a wanted force; the method of its physics steps has the name of gymnasium-robotics'."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data, self.n_substeps, self.steps = model, mujoco.MjData(model), SUBSTEPS, 0
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape=(model.nq,), dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-1, 1, shape=(2,), dtype=np.float32)

    def _mujoco_step(self, action: Any) -> None:  # noqa: ANN401 -- an array
        self.data.ctrl[:] = 5 + 5 * np.asarray(action)
        mujoco.mj_step(self.model, self.data, self.n_substeps)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset the simulation."""
        super().reset(seed=seed, options=options)
        mujoco.mj_resetData(self.model, self.data)
        self.steps = 0
        return self.data.qpos.astype(np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:  # noqa: ANN401 -- an array
        """Push with 5 N and 5 N times the action on each finger."""
        self._mujoco_step(action)
        self.steps += 1
        reward = -float(np.abs(self.data.ctrl - WANTED).sum())
        return self.data.qpos.astype(np.float32), reward, False, self.steps >= EPISODE, {}


def make(*, with_arrays: bool = True, rate_hz: float = RATES[0], frames: int = 1) -> gymnasium.Env[Any, Any]:
    """The environment, with or without arrays in its observation; the arrays are in the model anyway.

    `frames` is the number of frames of a step that `info` has room for.
    """
    model, sensors = build(rate_hz)
    env = Hold(model)
    return TactileObservation(env, sensors, observe="texel_forces", frames=frames) if with_arrays else env


def measure_step(env: gymnasium.Env[Any, Any], steps: int = 300) -> float:
    """Median processor time of a step under forces that change by a fifth [s]."""
    env.reset(seed=0)
    draw, times = np.random.default_rng(0), []
    for _ in range(steps):
        action = draw.uniform(-0.2, 0.2, 2)
        start = time.process_time()
        env.step(action)
        times.append(time.process_time() - start)
        env.unwrapped.steps = 0
    return float(np.median(times[20:]))


def adapt(envs: gymnasium.vector.VectorEnv[Any, Any, Any]) -> Any:  # noqa: ANN401 -- of Stable-Baselines3
    """Make a vector environment of Gymnasium, with resets in the same step, one of Stable-Baselines3."""
    from stable_baselines3.common.vec_env import VecEnv

    class Adapted(VecEnv):
        def reset(self) -> Any:  # noqa: ANN401
            return envs.reset(seed=0)[0]

        def step_async(self, actions: Any) -> None:  # noqa: ANN401
            envs.step_async(actions)

        def step_wait(self) -> Any:  # noqa: ANN401
            observation, rewards, terminated, truncated, info = envs.step_wait()
            done, infos = terminated | truncated, [{} for _ in range(envs.num_envs)]
            for number in np.flatnonzero(done):
                last = info["final_obs"][number]
                infos[number] = {"terminal_observation": last, "TimeLimit.truncated": bool(truncated[number])}
            return observation, rewards, done, infos

        def close(self) -> None:
            envs.close()

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ANN401, ARG002
            return [None] * envs.num_envs

        def set_attr(self, *_: Any) -> None:  # noqa: ANN401
            raise NotImplementedError

        def env_method(self, *_: Any, **__: Any) -> list[Any]:  # noqa: ANN401
            raise NotImplementedError

        def env_is_wrapped(self, *_: Any) -> list[bool]:  # noqa: ANN401
            return [False] * envs.num_envs

    return Adapted(envs.num_envs, envs.single_observation_space, envs.single_action_space)


def train(steps: int, *, with_arrays: bool, processes: int = 2) -> float:
    """Train a policy, and return the steps of the environments per second of real time."""
    from stable_baselines3 import PPO

    envs = gymnasium.vector.AsyncVectorEnv(
        [functools.partial(make, with_arrays=with_arrays)] * processes,
        context="spawn",
        autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP,
    )
    adapted = adapt(envs)
    try:
        policy = "MultiInputPolicy" if with_arrays else "MlpPolicy"
        model = PPO(policy, adapted, n_steps=min(512, max(steps // processes, 2)), batch_size=64, seed=0, device="cpu")
        model.learn(64 * processes)  # the processes compile and start
        start = time.perf_counter()
        model.learn(steps)
        assert all(bool(np.isfinite(each.detach().numpy()).all()) for each in model.policy.parameters())
        return steps / (time.perf_counter() - start)
    finally:
        adapted.close()


def main() -> None:
    """Print both costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=20_000)
    steps = parser.parse_args().steps
    bare = measure_step(make(with_arrays=False))
    print(f"step without arrays {1e6 * bare:.0f} us of processor time")
    for rate, frames in ((RATES[0], 1), (RATES[1], 1), (RATES[1], 6)):
        cost = measure_step(make(rate_hz=rate, frames=frames))
        print(
            f"step with two arrays at {rate:.0f} frames/s, {frames} of them in info: {1e6 * cost:.0f} us, "
            f"{cost / bare:.1f} times as much"
        )
    for with_arrays in (False, True):
        print(f"PPO, arrays {with_arrays}: {train(steps, with_arrays=with_arrays):.0f} steps/s over {steps} steps")


if __name__ == "__main__":
    warnings.simplefilter("ignore", fastmodel.OptionWarning)
    main()
