"""The example of the adaptive grasp: fingers stop at a touch, and the sum of the arrays is held."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest

from tests.support.shadow_hand import NEEDS_HAND

pytestmark = NEEDS_HAND


@pytest.fixture(scope="module")
def example():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parents[2] / "examples")
        yield importlib.import_module("adaptive_grasp")


@pytest.fixture(scope="module")
def grasp(example):
    example.run(seconds=0.05)
    return example.run()


def test_every_finger_closes_until_its_arrays_are_touched(example, grasp):
    assert set(grasp.hand.touched) == set(example.FINGERS)
    assert all(example.START <= when < example.START + example.PATIENCE for when in grasp.hand.touched.values())
    assert len(set(grasp.hand.touched.values())) == 4  # each at its own time


def test_the_sum_of_the_arrays_is_held_through_a_step_and_a_turn(example, grasp):
    before = (grasp.times > example.STEP - 0.3) & (grasp.times < example.STEP)
    np.testing.assert_allclose(grasp.reading[before], example.WANTED, rtol=0.05)
    assert grasp.settling() < 0.5
    np.testing.assert_allclose(grasp.reading[grasp.times > 6.0], example.MORE, rtol=0.02)
    np.testing.assert_allclose(grasp.reading, grasp.arrays.sum(axis=1))
    # Texels of the palm saturate, so that the true force is larger than the reading.
    assert (grasp.true[grasp.times > 4] > 1.2 * grasp.reading[grasp.times > 4]).all()


def test_the_grip_is_still_held_upside_down(grasp):
    palm, grip = grasp.hand.data.body("robot0:palm"), grasp.hand.data.body("grip")
    assert 0.02 < palm.xpos[2] - grip.xpos[2] < 0.08


@pytest.mark.bench
def test_the_grasp_runs_three_times_faster_than_real_time(example, grasp):
    assert example.SECONDS / grasp.seconds > 3
