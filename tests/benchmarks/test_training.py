"""The training benchmark on a few steps."""

import importlib

import numpy as np
import pytest

pytest.importorskip("gymnasium")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_policy_is_trained_on_texel_forces_in_processes_that_start_anew(benchmarks):
    pytest.importorskip("stable_baselines3")
    assert importlib.import_module("training").train(256, with_arrays=True) > 10


@pytest.mark.slow
def test_the_arrays_hold_the_box_with_the_force_of_the_action(benchmarks):
    env = importlib.import_module("training").make()
    env.reset(seed=0)
    for _ in range(10):
        observation, *_ = env.step(np.zeros(2))  # 5 N on each finger
    for side in ("left", "right"):
        assert observation[side].shape == (8, 8)
        assert -env.sensors[side].frame().net_force[2] == pytest.approx(5, abs=0.05)
