import dataclasses

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import Batch, FastModelError
from fastmodel.errors import LifeCycleError
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec

#: Counts at rest are not zero, so that they show the noise.
NOISY = parameters(electronics=dataclasses.replace(parameters().electronics, offset=100.0, noise=0.01))


def world(method):
    """A block over an array on a fixed holder, and a second array that nothing touches."""
    spec = make_spec()
    sensors = [
        fastmodel.attach(spec, "world", NOISY, name=name, position=place, contact=method)
        for name, place in (("one", (0, 0, 0)), ("two", (0.1, 0, 0)))
    ]
    add_body(spec, "box", [5e-3, 4e-3, 3e-3], [0, 0, 6e-3], free=True, mass=0.1)
    return spec.compile(), sensors


def push(number, data):
    """Every world is pushed its own way."""
    data.xfrc_applied[1, :3] = [0.1 * np.sin(number + 20 * data.time), 0.05, -4.0]


def lift(number, data, sensors):
    """Every world starts at its own height; return the latest counts of the second array."""
    data.qpos[2] += 1e-4 * number
    return sensors[1].frame().counts


def step_alone(model, sensors, number, steps, seed):
    """The frames of one world, without a batch."""
    data = mujoco.MjData(model)
    own = [sensor.twin().bind(model) for sensor in sensors]
    for sensor in own:
        sensor.reset(seed=np.random.SeedSequence(seed).spawn(number + 1)[number])
    frames = [[], []]
    for _ in range(steps):
        push(number, data)
        mujoco.mj_step(model, data)
        for new, sensor in zip(frames, own, strict=True):
            if sensor.step(data):
                new.append(sensor.frame())
    return frames


def assert_equal(some, others):
    assert len(some) == len(others) > 10
    for one, other in zip(some, others, strict=True):
        assert one.time == other.time
        assert np.array_equal(one.texel_forces, other.texel_forces)
        assert np.array_equal(one.counts, other.counts)


@pytest.mark.parametrize("method", ["boxes", pytest.param("cover", marks=pytest.mark.slow)])
@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_many_worlds_give_bit_for_bit_what_each_gives_alone(method, processes):
    model, sensors = world(method)
    with Batch(model, sensors, 5, processes=processes, seed=8) as batch:
        together = [
            [[*a, *b] for a, b in zip(*both, strict=True)]
            for both in zip(batch.step(60, push), batch.step(60, push), strict=True)
        ]
        assert batch.images().shape == (5, 14, 6)
        assert batch.images().any()
        last = batch.visit(lift)
        changed = batch.step(1)
        batch.reset(seed=8)
        again = batch.step(120, push)
    for number in range(5):
        alone = step_alone(model, sensors, number, 120, 8)
        for mine, repeated, theirs in zip(together[number], again[number], alone, strict=True):
            assert_equal(mine, theirs)
            assert_equal(repeated, theirs)
        assert np.array_equal(last[number], alone[1][-1].counts)
        assert alone[0][-1].texel_forces.sum() > 3
    assert len({mine[0][-1].texel_forces.tobytes() for mine in together}) == 5
    assert len(changed) == 5


@pytest.mark.slow
def test_noise_differs_between_worlds_sensors_seeds_and_episodes():
    model, sensors = world("boxes")
    counts = []
    for seed in (None, 4):
        batch = Batch(model, sensors, 4, seed=seed)
        for _ in range(2):
            counts += [new[1][0].counts for new in batch.step(5)]
            batch.reset()
    assert len({each.tobytes() for each in counts}) == 16
    batch.reset(seed=4)
    assert np.array_equal(batch.step(5)[2][1][0].counts, counts[10])
    first = batch.step(60)[0]
    assert (first[0][-1].counts != first[1][-1].counts).any()


def stop(number, data):
    raise ValueError(f"world {number} stops")


@pytest.mark.slow
def test_an_error_in_another_process_arrives():
    model, sensors = world("boxes")
    with Batch(model, sensors, 2, processes=2) as batch:
        with pytest.raises(ValueError, match="world 0 stops"):
            batch.step(1, stop)
        with pytest.raises(FastModelError, match="no lambdas"):
            batch.visit(lambda number, data, sensors: number)
        assert len(batch.step(10)) == 2


def test_wrong_arguments_and_a_closed_batch_are_refused_in_words():
    model, sensors = world("boxes")
    for change, message in (
        ({"worlds": 0}, "must be a whole number from 1 on"),
        ({"worlds": float("nan")}, "whole number"),
        ({"processes": 0}, "must be a whole number from 1 on"),
        ({"seed": -1}, "negative"),
        ({"sensors": [sensors[0], sensors[0]]}, "the same sensor is given twice"),
        ({"sensors": ["x"]}, "sensors must be sensors"),
        ({"model": mujoco.MjSpec().compile(), "processes": 2}, "is not in this model"),
    ):
        with pytest.raises(FastModelError, match=message):
            Batch(**{"model": model, "sensors": sensors, "worlds": 2, **change})
    batch = Batch(model, sensors, 1)
    for call, message in (
        (lambda: batch.step(-1), "steps must be a whole number from 0 on"),
        (lambda: batch.step(1.5), "steps must be a whole number from 0 on"),
        (lambda: batch.step(1, "x"), "control must be a function"),
        (lambda: batch.images(7), "must be the index of one of"),
    ):
        with pytest.raises(FastModelError, match=message):
            call()
    batch.close()
    with pytest.raises(LifeCycleError, match="closed"):
        batch.step()
