"""Arrays in environments of other packages, where package and version of MuJoCo suit each other."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")
EXAMPLE = Path(__file__).parents[2] / "examples" / "packaged_environments.py"
VERSION = tuple(int(part) for part in mujoco.__version__.split(".")[:2])
#: Packages of each environment, the versions of MuJoCo that it runs with, and texels of its arrays.
NEEDS = {
    "adroit": (["gymnasium_robotics"], (3, 8), (9, 0), (8, 8)),
    "fetch": (["gymnasium_robotics"], (3, 8), (3, 10), (4, 6)),
    "robosuite": (["robosuite", "cv2", "h5py"], (3, 8), (3, 8), (4, 4)),
    "dm_control": (["dm_control", "shimmy"], (3, 17), (3, 17), (4, 4)),
}


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("packaged_environments", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", NEEDS)
def test_an_environment_of_a_package_observes_its_arrays(example, name):
    packages, first, last, shape = NEEDS[name]
    for package in packages:
        pytest.importorskip(package)
    if not first <= VERSION <= last:
        pytest.skip(f"{name} does not run with MuJoCo {mujoco.__version__}")
    env = example.MAKERS[name]()
    env.action_space.seed(0)
    observation, _ = env.reset(seed=0)
    data, made, times = env._simulation(env.env)[1], dict.fromkeys(env.sensors, 0), []
    start = data.time
    for _ in range(25):
        observation, *_, info = env.step(env.action_space.sample())
        for sensor in env.sensors:
            assert observation[sensor].shape == shape
            assert np.isfinite(observation[sensor]).all()
            new = info["frames"][sensor]
            made[sensor] += new["made"] + new["dropped"]
            times += new["times"][: new["made"]].tolist()
    # 50 frames in a second of simulated time, up to the last
    assert all(count == pytest.approx((data.time - start) * 50, abs=1) for count in made.values())
    assert max(times) == pytest.approx(data.time, abs=0.021)
