import copy
import dataclasses
import pickle
import warnings

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import Butterworth, FastModelError
from fastmodel.errors import LifeCycleError
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec

#: An array whose frames depend on filter, hysteresis and noise.
PARAMETERS = dataclasses.replace(
    parameters(),
    filter=Butterworth(cutoff_hz=30.0, order=3),
    electronics=dataclasses.replace(
        parameters().electronics, offset=0.0, noise=0.01, hysteresis_share=0.4, hysteresis_width=0.05
    ),
)
METHODS = ("boxes", "cover")
#: All of MuJoCo's state that the next step depends on.
EVERYTHING = mujoco.mjtState.mjSTATE_INTEGRATION
PLACES = {"one": (0, 0, 0), "two": (0.1, 0, 0)}


def scene(method, array=PARAMETERS, names=("one",)):
    """A block that slides and rocks on an array, and a ball beside it: model, data, sensors bound to the model."""
    spec = make_spec()
    sensors = [
        fastmodel.attach(spec, "world", array, name=name, position=PLACES[name], contact=method) for name in names
    ]
    add_body(spec, "box", [5e-3, 4e-3, 3e-3], [0, 0, 3.5e-3], free=True, mass=0.1)
    add_body(spec, "sphere", [4e-3], [2e-3, 14e-3, 4.5e-3], free=True, mass=0.1)
    model = spec.compile()
    return model, mujoco.MjData(model), [sensor.bind(model) for sensor in sensors]


def run(model, data, sensors, steps, pushed=0.3):
    """Frames of all sensors while the bodies are pushed about until a time [s], then left at rest."""
    frames = []
    for _ in range(steps):
        slope = np.sin(40 * data.time) if data.time < pushed else 0.0
        data.xfrc_applied[1:3, :3] = [0.2 * slope, 0.1 * slope, -2.0]
        mujoco.mj_step(model, data)
        frames += [sensor.frame() for sensor in sensors if sensor.step(data)]
    return frames


def assert_equal(some, others):
    assert len(some) == len(others) > 10
    for one, other in zip(some, others, strict=True):
        assert one.time == other.time
        np.testing.assert_array_equal(one.counts, other.counts)
        np.testing.assert_array_equal(one.texel_forces, other.texel_forces)
        np.testing.assert_array_equal(one.image, other.image)


#: A cover that becomes half as soft at 1 N, and a sheet bent to a radius of 20 mm.
FOIL = dataclasses.replace(
    PARAMETERS,
    surface=dataclasses.replace(
        PARAMETERS.surface,
        loads=np.array([1.0, 2.0]),
        load_depths=np.array([0.1e-3, 0.15e-3]),
        loaded_compliance=np.array([PARAMETERS.surface.compliance / 2] * 2),
        loaded_influence=np.array([0.8 * PARAMETERS.surface.influence] * 2),
    ),
)
ANGLE = np.repeat((np.arange(14) - 6.5) * 3.4e-3 / 20e-3, 6)
SHEET = dataclasses.replace(
    PARAMETERS,
    array=dataclasses.replace(
        PARAMETERS.array,
        centres=np.column_stack([PARAMETERS.array.centres[:, 0], 20e-3 * np.sin(ANGLE), 20e-3 * (np.cos(ANGLE) - 1)]),
        normals=np.column_stack([np.zeros(84), np.sin(ANGLE), np.cos(ANGLE)]),
    ),
)
CASES = [
    *((method, PARAMETERS) for method in METHODS[:2]),
    pytest.param("cover", FOIL, id="foil"),
    pytest.param("cover", SHEET, id="sheet", marks=pytest.mark.slow),
    pytest.param("foundation", PARAMETERS, marks=pytest.mark.slow),
]


@pytest.mark.parametrize("after", [150, pytest.param(600, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("method", "array"), CASES)
def test_after_going_back_the_next_frames_are_the_same(method, array, after, tmp_path):
    """While sliding (150 ms) and at rest (600 ms); through a file."""
    model, data, sensors = scene(method, array)
    run(model, data, sensors, after)
    physics = np.empty(mujoco.mj_stateSize(model, EVERYTHING))
    mujoco.mj_getState(model, data, physics, EVERYTHING)
    np.savez(tmp_path / "state.npz", **sensors[0].get_state())
    before = sensors[0].frame()
    first = run(model, data, sensors, 300)
    assert sum(frame.counts.any() for frame in first) > 10
    mujoco.mj_setState(model, data, physics, EVERYTHING)
    with np.load(tmp_path / "state.npz") as stored:
        sensors[0].set_state(dict(stored))
    np.testing.assert_array_equal(sensors[0].frame().counts, before.counts)
    assert_equal(run(model, data, sensors, 300), first)


def test_a_state_without_fields_that_came_later_takes_their_defaults():
    model, data, (sensor,) = scene("cover")
    run(model, data, [sensor], 30)
    whole = sensor.get_state()
    later = {name for name in whole if name.endswith(("/at_end", "/tangential_source"))}
    assert "reading/at_end" in later
    sensor.set_state({name: array for name, array in whole.items() if name not in later})
    assert later <= sensor.get_state().keys()
    assert len(run(model, data, [sensor], 100)) > 10


@pytest.mark.parametrize(
    "duplicate",
    [copy.deepcopy, pytest.param(lambda each: pickle.loads(pickle.dumps(each)), marks=pytest.mark.slow)],  # noqa: S301
)
@pytest.mark.parametrize("method", METHODS)
def test_copies_of_model_data_and_sensors_belong_together_and_to_nothing_else(method, duplicate):
    original = scene(method, names=("one", "two"))
    run(*original, 150)
    twin = duplicate(original)
    forces = original[2][0].contact_forces()
    mine = run(*original, 200)
    np.testing.assert_array_equal(twin[2][0].contact_forces(), forces)
    assert_equal(run(*twin, 200), mine)
    other = duplicate(original)
    other[0].body_mass[1] *= 2  # of the model that steps the copied data, whatever model the data hold themselves
    assert len(run(*other, 40)) > 10


def test_a_sensor_copied_apart_from_its_data_takes_data_of_an_equal_model_only():
    model, data, sensors = scene("cover")
    run(model, data, sensors, 100)
    other_model, other = copy.deepcopy((model, data))
    twin = copy.deepcopy(sensors[0])
    assert_equal(run(other_model, other, [twin], 100), run(model, data, sensors, 100))
    heavier = copy.deepcopy(model)
    heavier.body_mass[1] *= 2
    with pytest.raises(LifeCycleError, match="another model"):
        sensors[0].step(mujoco.MjData(heavier))


def test_an_unbound_sensor_is_copied_unbound():
    spec = make_spec()
    twin = copy.deepcopy(fastmodel.attach(spec, "world", PARAMETERS))
    with pytest.raises(LifeCycleError, match="not bound"):
        twin.frame()
    assert not twin.bind(spec.compile()).frame().counts.any()


def noise_of(sensor, model, steps=40):
    """Counts of all frames of an unloaded array."""
    data = mujoco.MjData(model)
    data.qpos[[2, 9]] = 1.0
    counts = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        if sensor.step(data):
            counts.append(sensor.frame().counts)
    return np.array(counts)


def test_seeds_determine_the_noise_and_episodes_without_a_seed_continue_it():
    noisy = dataclasses.replace(PARAMETERS, electronics=dataclasses.replace(PARAMETERS.electronics, seed=5))
    model, _, (one, two) = scene("boxes", noisy, names=("one", "two"))
    runs = {}
    for name, seed in (("bound", None), ("next", None), ("five", 5), ("six", 6), ("six again", 6), ("later", None)):
        if name != "bound":
            one.reset(seed=seed)
            two.reset(seed=seed)
        runs[name] = noise_of(one, model)
        assert (runs[name] != noise_of(two, model)).any()
    assert runs["bound"].any()
    np.testing.assert_array_equal(runs["bound"], runs["five"])  # Electronics.seed is the default
    np.testing.assert_array_equal(runs["six"], runs["six again"])
    kinds = [runs[name] for name in ("bound", "next", "six", "later")]
    assert all((first != second).any() for k, first in enumerate(kinds) for second in kinds[:k])
    one.reset(seed=np.random.SeedSequence(6))
    np.testing.assert_array_equal(noise_of(one, model), runs["six"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, "must not be negative"),
        ({"seed": "one"}, "whole number"),
        *(({"contact_forces": wrong}, "contact.forces") for wrong in (-1.0, np.nan, np.zeros(3), "x")),
    ],
)
def test_bad_starts_are_refused(arguments, message):
    _, _, (sensor,) = scene("boxes")
    with pytest.raises(FastModelError, match=message):
        sensor.reset(**arguments)


def test_a_state_that_does_not_fit_leaves_the_sensor_as_it_was():
    model, data, (sensor,) = scene("cover")
    run(model, data, [sensor], 15)
    old = sensor.get_state()
    run(model, data, [sensor], 15)
    good = sensor.get_state()
    other, moved, (boxes,) = scene("boxes")
    run(other, moved, [boxes], 30)
    parts = [name for name in old if name.startswith(("chain", "clock", "contact/last", "contact/reach"))]
    assert len(parts) > 5
    bad = [({key: array for key, array in old.items() if key != name}, name.split("/")[-1]) for name in parts]
    for change, message in (
        ({"chain/play": np.zeros(3)}, "this sensor has"),
        ({"reading/type": np.array("SensorWithAnotherName")}, "not one of"),
        ({"reading/carried": np.array(np.nan)}, "reading or frame is not complete or not finite"),
        ({"reading/carried": np.array(np.inf)}, "reading or frame is not complete or not finite"),
        ({"frame/counts": np.full(84, np.nan)}, "'frame/counts' is not finite"),
        ({"frame/counts": np.full(84, np.inf)}, "'frame/counts' is not finite"),
        ({"reading/type": np.array("Frame")}, "state: "),
        ({"frame/type": np.array("Reading")}, "state: "),
        ({"method": np.array("BoxReader")}, "it belongs to a sensor with a BoxReader; this sensor has a "),
        ({"contact/last": np.zeros(4)}, "state"),
        ({"contact/reach": np.array("far")}, "state"),
        ({"chain/noise": np.array(["a"] * 6)}, "state"),
        ({"clock": np.full(5, np.inf)}, "state: "),
        ({"reading/contact_forces": np.full_like(old["reading/contact_forces"], np.nan)}, "state: "),
        (boxes.get_state(), "state: "),
    ):
        bad.append((old | change, message))
    bad.append(({key: value for key, value in old.items() if not key.startswith("reading/type")}, "state: "))
    bad.append(({key: value for key, value in old.items() if "type" not in key}, "state: "))
    bad.append((None, "state must be a dict"))
    for state, message in bad:
        with pytest.raises(FastModelError, match=message):
            sensor.set_state(state)
        found = sensor.get_state()
        assert found.keys() == good.keys()
        for key, value in found.items():
            np.testing.assert_array_equal(value, good[key])


def test_copies_and_twins_do_not_repeat_the_warnings_of_their_sensor():
    spec = mujoco.MjSpec()
    sensor = fastmodel.attach(spec, "world", PARAMETERS)
    model = spec.compile()
    with pytest.warns(fastmodel.OptionWarning) as first:
        sensor.bind(model)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        copied = copy.deepcopy(sensor)
        twin = sensor.twin().bind(model)
        twin.twin().bind(model)
    with pytest.warns(fastmodel.OptionWarning) as again:
        sensor.bind(model)
    assert [str(each.message) for each in again] == [str(each.message) for each in first]
    assert len(first) == len(sensor.check(model)) > 0
    assert (copied.name, twin.name, copied.carried(), twin.carried()) == ("sensor", "sensor", 0, 0)
