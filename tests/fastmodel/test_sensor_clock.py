"""When a sensor samples and makes frames, what it leaves out, and with which values it starts."""

import copy
import dataclasses
import re
import warnings

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import Butterworth, ChainFunctions, FastModelError, OptionWarning
from fastmodel.errors import LifeCycleError
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.state import make_generator
from tests.support.cover_data import WTS, cells, parameters
from tests.support.scenes import add_body, bind, make_spec, run

PLAIN = parameters(filter=None)
RATE = PLAIN.electronics.rate_hz


def change(given=PLAIN, **electronics):
    return dataclasses.replace(given, electronics=dataclasses.replace(given.electronics, **electronics))


def build(given=PLAIN, *, timestep=1e-3, contact="foundation", name="sensor", enable=0, **settings):
    """A block of 100 g on a slide that rocks on an array under a changing push; sensor, model and data."""
    spec = make_spec(timestep, enableflags=enable)
    sensor = fastmodel.attach(spec, "world", given, contact=contact, name=name, **settings)
    add_body(spec, "box", [4e-3, 3e-3, 3e-3], [1e-3, 2e-3, 3e-3], slides="z", mass=0.1, damping=1.0)
    model = spec.compile()
    return bind(sensor, model), model, mujoco.MjData(model)


def advance(model, data):
    data.qfrc_applied[0] = -1 - 0.8 * np.sin(60 * data.time)
    mujoco.mj_step(model, data)


@pytest.mark.parametrize(("timestep", "start"), [(1e-3, 3.21), (4e-3, 0.0), (10e-3, 3.21)])
def test_frames_are_those_of_the_chain_at_the_times_at_which_they_are_due(timestep, start):
    """Also where several are due within a step, so that forces creep for several intervals; clocks may start late."""
    electronics = {"creep": 0.15, "noise": 0.01, "hysteresis_share": 0.3, "hysteresis_width": 0.05, "tip_share": 0.8}
    given = change(parameters(surface=None, filter=None), offset=0.0, **electronics)
    sensor, model, data = build(given, timestep=timestep)
    data.time = start
    functions, noise = ChainFunctions(given, 1 / timestep), make_generator(0, "sensor")
    state, made, count = functions.settle(np.zeros(WTS.count)), 0, 0
    for step in range(1, 25):
        advance(model, data)
        new = sensor.step(data)
        due = int(step * timestep * RATE + 1e-3)
        assert new == (due > made)
        if not new:
            continue
        assert sensor.frame().time == data.time
        state = functions.take(state, sensor.contact_forces())
        state, output = functions.frame(state, noise, frames=due - made)
        np.testing.assert_array_equal(sensor.frame().counts, output.counts)
        forces = given.spread.operator(WTS) @ sensor.contact_forces()
        np.testing.assert_allclose(sensor.frame().texel_forces, forces, atol=1e-12)
        made, count = due, count + 1
    assert count == min(24, made)
    assert sensor.frame().counts.max() > 200


@pytest.mark.parametrize(
    ("changes", "settings", "waits"),
    [
        ({}, {}, True),
        ({}, {"every": 1}, False),
        ({"filter": Butterworth(cutoff_hz=100.0)}, {}, False),
        ({}, {"contact": "boxes"}, False),
    ],
)
def test_costly_contacts_without_filter_are_read_when_a_frame_is_due(changes, settings, waits):
    sensor, model, data = build(dataclasses.replace(PLAIN, **changes), **settings)
    stale, loads = 0, []
    for _ in range(30):
        advance(model, data)
        new, before = sensor.step(data), loads[-1] if loads else None
        loads.append(sensor.carried())
        stale += not new and before == loads[-1]
    frames = int(0.030 * RATE)
    assert (stale >= 30 - frames - 1) == waits


@pytest.mark.parametrize(
    ("given", "left_out"),
    [
        (PLAIN, True),
        (dataclasses.replace(PLAIN, filter=Butterworth(cutoff_hz=60.0)), False),
        (change(hysteresis_share=0.2, hysteresis_width=0.05), False),
        (change(creep=0.1), False),
        (change(high_pass_hz=2.0), False),
    ],
)
def test_a_frame_that_is_left_out_changes_no_later_one(given, left_out):
    (plain, *one), (hasty, *two) = build(given), build(given)
    for step in range(34):
        for model, data in (one, two):
            advance(model, data)
        before = hasty.frame()
        skip = step % 16 < 12
        new = hasty.step(two[1], skip=skip)
        assert plain.step(one[1]) == new
        if new and skip:
            assert (hasty.frame() is before) == left_out
        elif new:
            assert hasty.frame().time == plain.frame().time
            np.testing.assert_array_equal(hasty.frame().counts, plain.frame().counts)
            np.testing.assert_allclose(hasty.frame().texel_forces, plain.frame().texel_forces, atol=1e-12)


def test_a_body_that_sleeps_on_the_array_still_presses():
    """Bodies that sleep have no contacts in MuJoCo; the reading stays until they wake."""
    sensor, model, data = build(enable=int(mujoco.mjtEnableBit.mjENBL_SLEEP))
    for _ in range(400):
        mujoco.mj_step(model, data)
        sensor.step(data)
    assert (data.tree_asleep >= 0).all()
    assert not data.ncon
    assert sensor.carried() == pytest.approx(0.981, rel=1e-2)
    assert sensor.frame().texel_forces.sum() > 0.8 * 0.981
    data.qfrc_applied[0] = 3.0
    for _ in range(60):
        mujoco.mj_step(model, data)
        sensor.step(data)
    assert (data.tree_asleep < 0).all()
    assert sensor.carried() == 0
    assert not sensor.frame().texel_forces.any()


def test_noise_belongs_to_seed_and_name():
    given = change(noise=0.02, offset=0.0)

    def show(sensor, model, data):
        found = []
        for _ in range(8):
            advance(model, data)
            if sensor.step(data):
                found.append(sensor.frame().counts)
        mujoco.mj_resetData(model, data)
        return np.array(found)

    one, other = build(given), build(given, name="other")
    first, second = show(*one), show(*other)
    assert (first != second).any()
    one[0].reset()
    assert (show(*one) != first).any()  # the noise continues
    one[0].reset(seed=0)
    np.testing.assert_array_equal(show(*one), first)
    one[0].reset(seed=np.random.SeedSequence(5))
    third = show(*one)
    one[0].reset(seed=5)
    np.testing.assert_array_equal(show(*one), third)
    for seed, message in ((-1, "must not be negative"), (0.5, "seed must be a whole number")):
        with pytest.raises(FastModelError, match=message):
            one[0].reset(seed=seed)
    seeded = build(change(given, seed=5))
    np.testing.assert_array_equal(show(*seeded), third)


def test_a_sensor_starts_under_given_forces_on_all_texels_or_on_each():
    given = dataclasses.replace(PLAIN, filter=Butterworth(cutoff_hz=20.0))
    sensor, _, _ = build(given)
    base = CellGrid.over(WTS, 4, 1).build_base_forces(cells(), WTS)
    for forces in (0.02, np.linspace(0, 0.1, WTS.count), [0.0] * 83 + [0.5]):
        sensor.reset(forces)
        whole = np.broadcast_to(np.array(forces, dtype=float), (WTS.count,))
        frame = sensor.frame()
        np.testing.assert_allclose(sensor.contact_forces(), whole)
        np.testing.assert_allclose(frame.texel_forces, base.from_texels(whole), atol=1e-12)
        assert sensor.carried() == pytest.approx(whole.sum())
        assert sensor.outside() == frame.outside == pytest.approx(whole.sum() - frame.texel_forces.sum())
        np.testing.assert_allclose(sensor.pressures(), frame.texel_forces / np.prod(WTS.texel_size))
        np.testing.assert_array_equal(sensor.texel_forces(), frame.texel_forces)
        assert frame.time == 0
    for wrong in (-1e-9, np.nan, np.inf, np.zeros(83), "much", [[0.0]] * 84):
        with pytest.raises(FastModelError, match=re.escape("a number or one force for each of 84 texels")):
            sensor.reset(wrong)


def test_a_second_frame_before_the_first_step_is_warned_of_once():
    sensor, model, data = build()
    assert not sensor.frame().counts.any()
    with pytest.warns(OptionWarning, match="frame is that of the unloaded array: step"):
        sensor.frame()
    sensor.frame()  # once
    advance(model, data)
    sensor.step(data)
    sensor.frame()
    sensor.reset(0.01)
    sensor.frame()
    sensor.frame()  # it is loaded


def test_a_contact_at_the_end_of_the_plate_is_warned_of_once():
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", PLAIN, contact="foundation")
    add_body(spec, "box", [3e-3, 3e-3, 3e-3], [13.6e-3, 0, 3e-3], slides="z", mass=0.1, damping=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    bind(sensor, model)
    with pytest.warns(
        fastmodel.RangeWarning, match="sensor 'sensor': a contact reaches the end of the plate"
    ) as caught:
        run(sensor, model, data, 40)
    assert len(caught) == 1


@pytest.mark.parametrize(("late", "refused"), [(0.9e-6, False), (1.1e-6, True), (-0.9e-6, False), (-1.1e-6, True)])
def test_time_may_differ_from_a_step_by_a_thousandth_of_it(late, refused):
    sensor, model, data = build()
    for _ in range(3):
        advance(model, data)
        sensor.step(data)
    advance(model, data)
    data.time += late
    if refused:
        with pytest.raises(LifeCycleError, match=r"time went from 0\.003 s to"):
            sensor.step(data)
    else:
        sensor.step(data)


@pytest.mark.parametrize("timestep", [1e-3, 4e-3])
def test_a_step_whose_frame_is_left_out_is_counted_as_any_other(timestep):
    """A stored state begins with the numbers of steps and frames; a sensor that was stepped shows no unloaded array."""
    (plain, *one), (hasty, *two) = build(timestep=timestep), build(timestep=timestep)
    for step in range(1, 11):
        for (model, data), sensor, skip in ((one, plain, False), (two, hasty, step != 7)):
            advance(model, data)
            sensor.step(data, skip=skip)
        clock = hasty.get_state()["clock"]
        np.testing.assert_array_equal(clock[:4], plain.get_state()["clock"][:4])
        assert clock[0] == step
        assert clock[1] == int(step * timestep * RATE + 1e-3)


def test_a_first_step_whose_frame_is_left_out_is_a_step():
    sensor, model, data = build(timestep=4e-3)
    advance(model, data)
    assert sensor.step(data, skip=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sensor.frame().time == sensor.frame().time == 0


@pytest.mark.parametrize(
    ("cutoff", "rate", "settings", "interval"),
    [
        (50.0, 100.0, {}, 5), (40.0, 271.0, {}, 3), (100.0, 100.0, {}, 2), (400.0, 100.0, {}, 1),
        # 4 samples per period of the cut-off; a thousandth more than three steps is accepted
        (83.4, 100.0, {}, 3), (83.5, 100.0, {}, 2), (None, 40.0, {"high_pass_hz": 2.0}, 1),
        (50.0, 100.0, {"contact": "boxes"}, 1), (50.0, 100.0, {"every": 4}, 4),
    ],
)  # fmt: skip
def test_filtered_contacts_are_sampled_as_often_as_frames_and_filter_need(cutoff, rate, settings, interval):
    own = {name: settings[name] for name in settings if name == "high_pass_hz"}
    given = dataclasses.replace(
        change(rate_hz=rate, **own), filter=None if cutoff is None else Butterworth(cutoff_hz=cutoff)
    )
    sensor, model, data = build(given, **{name: settings[name] for name in settings if name not in own})
    loads = []
    for _ in range(31):
        advance(model, data)
        sensor.step(data)
        loads.append(sensor.carried())
    new = np.flatnonzero(np.diff(loads[15:])) + 16
    assert set(np.diff(new)) == {interval}
    assert new[0] % interval == 0


def test_a_reset_sensor_without_a_step_warns_anew():
    sensor, _, _ = build()
    for _ in range(2):
        sensor.frame()
        with pytest.warns(OptionWarning, match="frame is that of the unloaded array"):
            sensor.frame()
        sensor.reset()


def test_the_noise_continues_over_a_reset_that_follows_another_timestep():
    given = change(noise=0.02, offset=0.0)

    def show(sensor, model, data):
        mujoco.mj_resetData(model, data)
        found = []
        for _ in range(6):
            advance(model, data)
            if sensor.step(data):
                found.append(sensor.frame().counts)
        return np.array(found)

    fresh, (sensor, model, data) = build(given, timestep=3e-3), build(given)
    model.opt.timestep = 3e-3
    sensor.reset()
    np.testing.assert_array_equal(show(sensor, model, data), first := show(*fresh))  # nothing was drawn yet
    model.opt.timestep = 2e-3
    sensor.reset()
    model.opt.timestep = 3e-3
    sensor.reset()
    assert (show(sensor, model, data) != first).any()
    sensor.reset(seed=0)
    np.testing.assert_array_equal(show(sensor, model, data), first)


@pytest.mark.parametrize("kind", ["twin", "copy", "unbound copy"])
def test_twins_and_copies_sample_as_often_as_their_sensor(kind):
    sensor, model, data = build(every=4, name="pad")
    if kind == "twin":
        other = bind(sensor.twin(), model)
    else:
        other = copy.deepcopy(sensor if kind == "copy" else sensor.twin())
        other = other if kind == "copy" else bind(other, model)
    assert (other.name, other.parameters is sensor.parameters) == ("pad", kind == "twin")
    for _ in range(30):
        advance(model, data)
        assert sensor.step(data) == other.step(data)
        assert sensor.carried() == other.carried()
    assert sensor.carried() > 0


def test_a_sensor_that_is_not_found_under_other_names_stays_bound_as_it_was():
    sensor, model, data = build()
    advance(model, data)
    sensor.step(data)
    for options in ({"prefix": "left_"}, {"suffix": "_1"}):
        with pytest.raises(LifeCycleError):
            sensor.bind(model, **options)
        advance(model, data)
        sensor.step(data)
        assert sensor.texel_poses(data).positions.shape == (84, 3)
        sensor.check(model)
    assert sensor.get_state()["clock"][0] == 3
