"""The training benchmark on a few steps."""

import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("stable_baselines3")

from benchmarks import training


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_policy_is_trained_on_texel_forces_in_processes_that_start_anew():
    assert training.train(256, with_arrays=True) > 10


def test_the_arrays_hold_the_box_with_the_force_of_the_action():
    env = training.make()
    env.reset(seed=0)
    for _ in range(10):
        observation, *_ = env.step([0.0, 0.0])  # 5 N on each finger
    for side in ("left", "right"):
        assert observation[side].shape == (8, 8)
        assert -env.sensors[side].frame().net_force[2] == pytest.approx(5, abs=0.05)
