"""Grippers of other people: a short version of `benchmarks/grippers.py` with its bounds."""

import importlib

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("name", "thing"), [("fetch", "sphere"), ("panda", "mug"), ("fetch", "flex")])
def test_arrays_on_a_gripper_read_the_force_of_mujoco_and_images_are_steady(benchmarks, name, thing):
    grippers = importlib.import_module("grippers")
    package = grippers.GRIPPERS[name].package
    if grippers.find_package(package) is None:
        pytest.skip(f"{package} is not installed")
    scene = grippers.Scene(grippers.GRIPPERS[name], thing)
    records, _ = grippers.run(scene)
    found = grippers.measure(records, 0.0)
    assert found["grip"] > 5
    assert found["net"] < (1e-3 if thing == "flex" else 1e-6)
    assert max(record.carried[-1] for record in records) == 0  # dropped
    if thing != "flex":
        assert found["steps"] > 1000
        assert found["change"] < 0.05
