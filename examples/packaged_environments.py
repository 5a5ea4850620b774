"""Arrays in environments of other packages: gymnasium-robotics, robosuite and dm_control.

    python -m pip install -e '.[gym]' gymnasium-robotics      # in a clone of softcover
    python examples/packaged_environments.py adroit

An environment of a package loads its own model file.  `edit_models` adds arrays to the model while the environment is
made.  The observation then holds the texel forces, and the program prints the largest of them at every tenth step.

The environments themselves need these versions of MuJoCo; the arrays work with all of them:

    adroit      gymnasium-robotics 1.4.2    any
    fetch       gymnasium-robotics 1.4.2    at most 3.10
    robosuite   robosuite 1.5.2             at most 3.10
    dm_control  dm_control 1.0.50           3.17; shimmy 2.0.1 makes it an environment of Gymnasium
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import gymnasium
import mujoco
import numpy as np

import fastmodel
from fastmodel.adapters.gymnasium import TactileObservation
from meshes import TexelArray

#: The cover of a published sensor on arrays of other sizes, with the frame rate of a policy [1/s].
WTS = fastmodel.load("wts-0614-34")
RATE_HZ = 50.0
#: Orientations of arrays that face along -y and +y of their body (quaternions).
FACING = {-1: (np.sqrt(0.5), np.sqrt(0.5), 0, 0), 1: (np.sqrt(0.5), -np.sqrt(0.5), 0, 0)}


def make_parameters(rows: int, columns: int, margin: float = 0.0) -> fastmodel.Parameters:
    """Parameters of an array under the cover of the WTS 0614-34; margin [m]."""
    array = TexelArray.grid(rows, columns, WTS.array.pitch, margin=margin)
    electronics = dataclasses.replace(WTS.electronics, rate_hz=RATE_HZ)
    return dataclasses.replace(WTS, array=array, electronics=electronics, tables={})


@contextlib.contextmanager
def edit_models(edit: Callable[[mujoco.MjSpec], None]) -> Iterator[None]:
    """Pass every model that is loaded in the body of the `with` statement through a function of its spec."""

    def load(read: Callable[..., mujoco.MjSpec]) -> Callable[..., mujoco.MjModel]:
        def load_edited(source: str, assets: dict[str, bytes] | None = None) -> mujoco.MjModel:
            spec = read(source, include=assets or {}, assets=assets or {})
            fastmodel.recommend_options(spec)
            edit(spec)
            return spec.compile()

        return load_edited

    with (
        mock.patch.object(mujoco.MjModel, "from_xml_path", load(mujoco.MjSpec.from_file)),
        mock.patch.object(mujoco.MjModel, "from_xml_string", load(mujoco.MjSpec.from_string)),
    ):
        yield


def follow(run: Callable[..., None], callback: Callable[[], None]) -> Callable[..., None]:
    """A function that calls a callback after another function."""

    def run_and_call(*arguments: object) -> None:
        run(*arguments)
        callback()

    return run_and_call


def make_adroit() -> gymnasium.Env[Any, Any]:
    """The Adroit hand at a door, with an array in its palm."""
    import gymnasium_robotics

    gymnasium.register_envs(gymnasium_robotics)
    sensors = {}

    def edit(spec: mujoco.MjSpec) -> None:
        place = {"position": (0, -0.015, 0.06), "quaternion": FACING[-1]}
        sensors["palm"] = fastmodel.attach(spec, "palm", make_parameters(8, 8), name="palm_array", **place)

    with edit_models(edit):
        env = gymnasium.make("AdroitHandDoor-v1")
    return TactileObservation(env, sensors, observe="texel_forces")


def make_fetch() -> gymnasium.Env[Any, Any]:
    """The Fetch robot with an array on each finger."""
    import gymnasium_robotics

    gymnasium.register_envs(gymnasium_robotics)
    sensors = {}

    def edit(spec: mujoco.MjSpec) -> None:
        spec.delete(next(each for each in spec.excludes if "gripper_finger" in each.bodyname1 + each.bodyname2))
        for side, sign in (("r", -1), ("l", 1)):
            finger = f"robot0:{side}_gripper_finger_link"
            place = {"position": (0.02, 0.015 * sign, 0), "quaternion": FACING[sign], "replaces": finger}
            sensors[side] = fastmodel.attach(spec, finger, make_parameters(4, 6), name=f"{side}_array", **place)

    with edit_models(edit):
        env = gymnasium.make("FetchPickAndPlace-v4")
    return TactileObservation(env, sensors, observe="texel_forces")


def make_robosuite() -> gymnasium.Env[Any, Any]:
    """A Panda that lifts a cube, with an array in the place of each finger pad."""
    import robosuite
    from robosuite.wrappers import GymWrapper

    sensors = {}

    def edit(spec: mujoco.MjSpec) -> None:
        for side, sign in (("1", -1), ("2", 1)):
            pad = spec.geom(f"gripper0_right_finger{side}_pad_collision")
            place = {"position": (0, 0.0105 * sign, -0.015), "quaternion": FACING[sign], "replaces": pad}
            sensors[side] = fastmodel.attach(spec, pad.parent, make_parameters(4, 4), name=f"array{side}", **place)

    def find_simulation(env: Any) -> tuple[mujoco.MjModel, mujoco.MjData]:  # noqa: ANN401 -- of robosuite
        return env.unwrapped.sim.model._model, env.unwrapped.sim.data._data  # noqa: SLF001

    def listen(env: Any, callback: Callable[[mujoco.MjData], None]) -> None:  # noqa: ANN401 -- of robosuite
        sim = env.unwrapped.sim
        for name in ("step", "step2"):
            setattr(sim, name, follow(getattr(sim, name), lambda: callback(sim.data._data)))  # noqa: SLF001

    settings = {"has_renderer": False, "has_offscreen_renderer": False, "use_camera_obs": False, "hard_reset": False}
    with edit_models(edit):
        env = GymWrapper(robosuite.make("Lift", robots="Panda", use_object_obs=True, control_freq=RATE_HZ, **settings))
    return TactileObservation(env, sensors, simulation=find_simulation, listen=listen, observe="texel_forces")


def make_dm_control() -> gymnasium.Env[Any, Any]:
    """The finger of dm_control that turns a spinner, with an array on the tip."""
    from dm_control import suite
    from shimmy import DmControlCompatibilityV0

    sensors = {}

    def edit(spec: mujoco.MjSpec) -> None:
        place = {"position": (0, 0, -0.193), "quaternion": (0, 1, 0, 0)}
        sensors["tip"] = fastmodel.attach(spec, "distal", make_parameters(4, 4), name="tip_array", **place)

    with edit_models(edit):
        env = suite.load("finger", "spin")
    physics = env.physics  # a step of this object makes several physics steps
    physics.legacy_step = False  # otherwise positions belong to the next step already, and forces are not computed

    def listen(_: object, callback: Callable[[mujoco.MjData], None]) -> None:
        def step(count: int = 1, run: Callable[[], None] = physics.step) -> None:
            for _ in range(count):
                run()
                callback(physics.data.ptr)

        physics.step = step

    return TactileObservation(
        DmControlCompatibilityV0(env),
        sensors,
        simulation=lambda _: (physics.model.ptr, physics.data.ptr),
        listen=listen,
        observe="texel_forces",
    )


MAKERS = {"adroit": make_adroit, "fetch": make_fetch, "robosuite": make_robosuite, "dm_control": make_dm_control}


def main() -> None:
    """Run random actions in one of the environments, and print the largest texel force of each array."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environment", choices=MAKERS)
    env = MAKERS[parser.parse_args().environment]()
    env.reset(seed=0)
    env.action_space.seed(0)
    for step in range(50):
        observation, *_ = env.step(env.action_space.sample())
        if step % 10 == 0:
            largest = {name: f"{observation[name].max():.3f} N" for name in env.sensors}
            print(f"step {step}: {largest}")


if __name__ == "__main__":
    main()
