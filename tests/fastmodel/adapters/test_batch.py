import warnings

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import Batch, FastModelError, OptionWarning
from tests.support.cover_data import parameters


def world(method):
    """A block over an array on a fixed holder, and a second array that nothing touches."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = 1e-3
    sensors = [
        fastmodel.attach(spec, "world", parameters(), name=name, position=place, contact=method)
        for name, place in (("one", (0, 0, 0)), ("two", (0.1, 0, 0)))
    ]
    body = spec.worldbody.add_body(name="block", pos=[0, 0, 6e-3])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[5e-3, 4e-3, 3e-3], mass=0.1)
    return spec.compile(), sensors


def push(number, data):
    """Every world is pushed its own way."""
    data.xfrc_applied[1, :3] = [0.1 * np.sin(number + 20 * data.time), 0.05, -4.0]


@pytest.mark.parametrize("method", ["boxes", "cover"])
def test_many_worlds_give_bit_for_bit_what_each_gives_alone(method):
    model, sensors = world(method)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OptionWarning)
        together = Batch(model, sensors, 6, threads=4)
        alone = Batch(model, sensors, 6, threads=1)
    for _ in range(3):
        several = together.step(60, push)
        single = alone.step(60, push)
    assert len(several[0][0]) == len(single[0][0]) > 10
    for a, b in zip(several, single, strict=True):
        for mine, theirs in zip(a[0] + a[1], b[0] + b[1], strict=True):
            assert np.array_equal(mine.texel_forces, theirs.texel_forces)
            assert np.array_equal(mine.counts, theirs.counts)
            assert mine.time == theirs.time
    images = together.images()
    assert images.shape == (6, 14, 6)
    assert len({mine[0][-1].texel_forces.tobytes() for mine in several}) == 6
    assert all(mine[0][-1].texel_forces.sum() > 3 for mine in several)
    assert images.any()
    assert not together.images(1).any()


def test_impossible_numbers_of_worlds_and_threads_are_refused():
    model, sensors = world("cover")
    with pytest.raises(FastModelError, match="worlds and threads"):
        Batch(model, sensors, 0)
