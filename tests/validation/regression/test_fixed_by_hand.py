"""Experiments of the regression check on fixed data: their inputs and readings against closed forms.

The long computations between inputs and readings, which have tests of their own, are replaced.
"""

import functools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr

import fastmodel
from meshes import TexelArray
from validation.regression import in_time, made_up, touches
from validation.regression.in_time import measure_time
from validation.regression.made_up import make_case_result, make_recording
from validation.regression.reading import Subject
from validation.regression.touches import measure_touches
from validation.resolution.channel import Channel

SUBJECT = Subject(parameters=None)


def flatten(reading):
    """Numbers of a reading by label, alone where there is one."""
    return {label: row[0] if len(row) == 1 else row for label, row in reading.numbers.items()}


@pytest.fixture
def timed(monkeypatch):
    """What the experiment in time asks for, and its readings."""
    asked = SimpleNamespace(steps=[], results=[], scored=[])

    def fit(times, sums, at):
        asked.steps.append((times, sums, at))
        cutoff = SimpleNamespace(value=12.5, low=11.0, high=14.0)
        return SimpleNamespace(cutoff=cutoff, delay=SimpleNamespace(value=4.5e-3))

    def make(state, true, found, parameters):
        asked.results.append((state, true, found, parameters))
        return state.name

    def score(bench, case, curves, solved):
        asked.scored.append((bench, case, curves, solved))
        names = ("error", "misplaced", "misplaced_high", "touching", "sliding", "overshoot")
        fast = {name: 0.01 * (k + 1) for k, name in enumerate(names)}
        fast |= {"model": "fast", "delay": 2e-3, "latency": 3e-3, "latency_worst": 5e-3}
        totals = {"truth": np.arange(400.0), "fast": 2 * np.arange(400.0), "other": np.zeros(400)}
        return SimpleNamespace(scores=[SimpleNamespace(model="other"), SimpleNamespace(**fast)], totals=totals)

    for name, function in (("fit_step", fit), ("make_case_result", make), ("score_moving", score)):
        monkeypatch.setattr(in_time, name, function)
    return asked, measure_time(SUBJECT)


def test_a_held_load_creeps_with_the_logarithm_of_time(timed):
    """1 + 0.12 ln(t / 2 s), by fifteen states of equal weight at half decades from 0.1 s to 1e6 s."""
    _, found = timed
    taus = 10.0 ** np.arange(-1, 6.5, 0.5)
    expected = {
        f"{age:g} s": 1 + 0.06 * math.log(10) * (np.exp(-2 / taus) - np.exp(-age / taus)).sum()
        for age in (1, 2, 10, 100)
    }
    held = flatten(found["creep of a held load"])
    assert held == {name: pytest.approx(value, rel=1e-5) for name, value in expected.items()}
    assert held["100 s"] == pytest.approx(1 + 0.12 * math.log(50), abs=2e-3)


def test_a_step_has_passed_published_filters_after_6_and_20_ms(timed):
    _, found = timed
    passed = flatten(found["step through published filters, after 6 and 20 ms"])
    left = 100 / 101
    expected = {
        "tegin-2005, y = 0.1 f + 0.9 y every 2.5 ms": (1 - 0.9**2, 1 - 0.9**8),
        "schunk, mean of 10 samples of 1 ms": (0.6, 1.0),
        "robworksim-later, tau 0.1 s, dt 1 ms": (1 - left**6, 1 - left**20),
        "genesis-taxel, no hysteresis": (1.0, 1.0),
        "genesis-taxel, hysteresis 0.5, 0.1 s": (1 + 0.5 * math.exp(-0.05), 1 + 0.5 * math.exp(-0.19)),
    }
    assert {name: passed[name] for name in expected} == {
        name: pytest.approx(value, rel=1e-5) for name, value in expected.items()
    }
    assert all(len(row) == 2 for row in passed.values())


def test_the_filter_is_fitted_to_a_delayed_step_of_second_order(timed):
    """1 - exp(-x / sqrt 2) (cos x / sqrt 2 + sin x / sqrt 2), x = 2 pi 12 Hz times the time after the delay."""
    asked, found = timed
    ((times, sums, at),) = asked.steps
    assert (len(times), at) == (542, 1.0013)
    assert times == pytest.approx(np.arange(542) / 271)
    x = np.maximum(2 * np.pi * 12 * (times - 1.0053), 0) / math.sqrt(2)
    step = 1 - np.exp(-x) * (np.cos(x) + np.sin(x))
    assert sums == pytest.approx(500 + 2000 * step + 5 * np.sin(1e4 * times), abs=1e-6)
    assert flatten(found["filter of a step"]) == {"cut-off": 12.5, "low": 11.0, "high": 14.0}
    assert flatten(found["delay of a step"]) == {"": pytest.approx(4.5)}
    assert (found["filter of a step"].unit, found["delay of a step"].unit) == ("Hz", "ms")


def test_a_moving_case_has_two_spreads_of_its_load(timed):
    asked, _ = timed
    ((bench, case, curves, solved),) = asked.scored
    assert (case.times, case.values) == ((0.0, 0.05, 0.1, 0.3, 0.6, 0.7), (0.0, 0.0, 3.0, 2.0, 2.0, 0.0))
    assert [pose.at for pose in case.poses] == [(0.0, 0.0)] * 4 + [(6e-3, 3e-3)] * 2
    assert case.indenter.radius == pytest.approx(5e-3)
    assert bench.parameters.array.pitch == pytest.approx((3.4e-3, 3.4e-3))
    states = [state for curve in curves for state in curve.cases]
    assert set(solved) == set(states)
    assert [each.cases for each in curves] == [each.cases for each in case.divide(3.4e-3)]
    centres = bench.parameters.array.centres
    for state, true, model, parameters in asked.results:
        (x, y), load = state.pose.at, state.load
        square = (centres[:, 0] - x) ** 2 + (centres[:, 1] - y) ** 2
        for forces, width in ((true, 4e-3), (model, 4.4e-3)):
            assert forces == pytest.approx(0.11 * load * np.exp(-square / (2 * width**2)), abs=1e-12)
        assert parameters is bench.parameters
        assert solved[state] == state.name


def test_scores_of_the_fast_model_in_time_are_read_in_percent_and_milliseconds(timed):
    _, found = timed
    names = ("error", "misplaced", "misplaced_high", "touching", "sliding", "overshoot")
    shares = found["scores of a moving case"]
    assert flatten(shares) == {name: pytest.approx(k + 1) for k, name in enumerate(names)}
    late = found["delay and latency of a moving case"]
    assert flatten(late) == {"delay": pytest.approx(2), "latency": pytest.approx(3), "worst": pytest.approx(5)}
    assert (shares.unit, shares.tolerance, late.unit, late.tolerance) == ("%", 0.02, "ms", 0.05)
    assert flatten(found["force on the texels of a moving case"]) == {
        "truth": (40, 100, 225, 325), "fast": (80, 200, 450, 650),
    }  # fmt: skip


class Touches:
    """A touch whose force is spread by 3 mm."""

    centres = fastmodel.load("wts-0614-34").array.centres
    origins = centres

    def forces(self, texel, places):
        assert texel == 38
        away = self.centres[:, :2] - self.centres[texel, :2] - places[0]
        return 0.2 * np.exp(-(away**2).sum(axis=1) / (2 * 3e-3**2))


class Study(SimpleNamespace):
    """A study with bounds of 0.2 mm and 0.3 mm."""

    def bound(self, places, size):
        assert (places.tolist(), size) == ([[1.2e-3, -1.0e-3]], 3)
        return np.diag([4e-8, 9e-8, 1.0])[None], None

    def respond(self, places):
        return self.touches.forces(38, places)[None]


class Locator:
    """A locator that finds a touch 0.1 mm and -0.2 mm from the true one."""

    def __init__(self, asked, **parts):
        self.asked = asked
        asked.located.append(parts)

    def find(self, reading, count):
        self.asked.located.append((reading, count))
        x, y = Touches.centres[38, :2] + (1.2e-3, -1.0e-3)
        along = SimpleNamespace(value=x + 1e-4, low=x - 1e-4, high=x + 4e-4)
        across = SimpleNamespace(value=y - 2e-4, low=y - 3e-4, high=y)
        return SimpleNamespace(touches=[SimpleNamespace(x=along, y=across)])


class Plan:
    """A plan of which two touches are chosen."""

    prior, roots = "prior", np.array([10, 20, 30, 40])

    def __init__(self, asked, *given, **options):
        self.asked = asked
        asked.plans.append((*given, options))

    def choose(self, start, count):
        self.asked.plans.append((start, count))
        return [3, 1]

    def add(self, start, roots):
        self.asked.plans.append((start, roots.tolist()))
        return "after"

    def expect(self, before, after):
        assert (before, after) == ("prior", "after")
        parts = {"gains": 0.02, "shift": 0.5, "thickness": 0.04}
        return [SimpleNamespace(name=name, after=value) for name, value in parts.items()]


@pytest.fixture
def touched(monkeypatch):
    """What the experiment on touches asks for, and its readings."""
    asked = SimpleNamespace(studies=[], errors=[], located=[], plans=[], designs=[])

    def study(**parts):
        asked.studies.append(Study(**parts))
        return asked.studies[-1]

    def find_error(one, frames):
        asked.errors.append((one.channel, frames))
        return 2e-4 if one.channel.electronics is None else 3e-4

    def find_designs(sensor, cover, **options):
        asked.designs.append((sensor, cover, options))
        return SimpleNamespace(designs=[SimpleNamespace(numbers={"force": 0.02, "none": None, "error_m": 1e-4})])

    replaced = {
        "find_touches": lambda *_: Touches(), "Study": study, "find_place_error": find_error,
        "Locator": functools.partial(Locator, asked), "Covers": lambda sensor: sensor,
        "Plan": functools.partial(Plan, asked), "find_designs": find_designs,
    }  # fmt: skip
    for name, each in replaced.items():
        monkeypatch.setattr(touches, name, each)
    return asked, measure_touches(SUBJECT)


def test_a_touch_is_studied_with_noise_alone_and_of_counts(touched):
    asked, found = touched
    alone, counted = (each.channel for each in asked.studies)
    assert (alone.electronics, alone.noise, counted.noise) == (None, 5e-3, 5e-3)
    assert counted.electronics.sensitivity == fastmodel.load("wts-0614-34").electronics.sensitivity
    assert [(each.texel, each.load) for each in asked.studies] == [(38, 1.8)] * 2
    assert asked.errors == [(alone, 4), (counted, 4)]
    assert flatten(found["bound of x and y"]) == {"noise alone": (pytest.approx(0.2), pytest.approx(0.3))}
    assert flatten(found["error of place"]) == {"noise alone": pytest.approx(0.2), "counts": pytest.approx(0.3)}
    shares = asked.studies[0].touches.forces(38, np.array([[1.2e-3, -1.0e-3]]))
    assert flatten(found["least force"]) == {
        name: pytest.approx(1e3 * channel.find_least_force(shares), rel=1e-4)
        for name, channel in (("noise alone", Channel(noise=5e-3)), ("counts", counted))
    }


def test_the_touch_is_located_by_its_exact_forces(touched):
    asked, found = touched
    shares = asked.studies[0].touches.forces(38, np.array([[1.2e-3, -1.0e-3]]))
    (first, (reading, count), second, _) = asked.located
    assert [each["radii"] for each in (first, second)] == [(0.0, 0.0)] * 2
    assert [each["channel"].noise for each in (first, second)] == [5e-3, 5e-3]
    assert count == 1
    assert reading.low.ravel() == pytest.approx(1.8 * shares)
    assert reading.high.ravel() == pytest.approx(1.8 * shares)
    assert flatten(found["located touch from the true one"]) == dict.fromkeys(
        ("noise alone", "counts"), (pytest.approx(0.1, abs=1e-6), pytest.approx(-0.2, abs=1e-6))
    )
    assert flatten(found["interval of x and y"]) == dict.fromkeys(
        ("noise alone", "counts"), (pytest.approx(0.5), pytest.approx(0.3))
    )
    assert found["located touch from the true one"].tolerance == 0.02


def test_twelve_touches_are_planned_on_nine_texels(touched):
    asked, found = touched
    (small, channel, errors, options), chosen, added = asked.plans
    assert (small.array.rows, small.array.columns, small.array.pitch) == (3, 3, pytest.approx((3.4e-3, 3.4e-3)))
    assert channel is asked.studies[1].channel
    assert (errors.place, errors.shift, errors.force) == (1e-4, 2e-4, 0.01)
    assert options == {"load": 1.8, "radius": 1e-3, "wanted": ("gains", "thickness", "poisson")}
    assert (chosen, added) == (("prior", 12), ("prior", [40, 20]))
    assert flatten(found["interval of planned gains and cover"]) == {"gains": 0.02, "thickness": 0.04}


def test_one_design_is_found_with_noise_and_load(touched):
    asked, found = touched
    ((sensor, cover, options),) = asked.designs
    (layer,) = cover.layers
    assert sensor.name == "wts-0614-34"
    assert (layer.thickness, layer.material.poisson_ratio) == (2e-3, 0.49)
    assert layer.material.youngs_modulus == pytest.approx(1e6)
    assert options == {
        "load": 1.8, "thicknesses": (3e-3,), "pitches": (2.5e-3,), "noise": 5e-3, "radius": None,
    }  # fmt: skip
    assert flatten(found["numbers of a design"]) == {"force": 0.02}


@pytest.mark.parametrize(("load", "at", "number"), [(4.0, (0.4e-3, -0.7e-3), 2), (1.5, (1.6e-3, 1.9e-3), 4)])
def test_a_recording_is_that_of_a_stamp_with_gain_zero_warmth_creep_and_threshold(load, at, number):
    """The share of a texel is the integral of the stamp's pressure, spread by 1.2 mm."""
    array = TexelArray.grid(6, 5, (4e-3, 4e-3))
    found = make_recording(array, load, at, number)
    (counts,) = (each.counts.reshape(44, 30) for each in found.arrays)
    assert found.times == pytest.approx(0.25 * np.arange(44))
    assert (found.temperatures.tolist(), found.setup.load) == ([[24 + 4 * (number % 3)]] * 2, load)
    assert found.temperature_times.tolist() == [0.0, 10.75]

    def share(middle, place, size):
        def pressure(x):
            return (ndtr((x - place + size / 2) / 1.2e-3) - ndtr((x - place - size / 2) / 1.2e-3)) / size

        return quad(pressure, middle - 2e-3, middle + 2e-3)[0]

    for texel in (6, 12, 17, 18):
        x, y = array.centres[texel, :2]
        force = load * (1 + 0.01 * math.sin(5.0 * number)) * share(x, at[0], 8e-3) * share(y, at[1], 12e-3)
        for frame in (8, 9, 16, 43):
            after = max(0.25 * frame - 2, 0.1)
            growth = (1 + 0.008 * (4 * (number % 3) - 4)) * (1 + 0.03 * math.log(after / 2))
            signal = (1 + 0.2 * math.sin(2.1 * texel)) * (2000 * growth * (force - 0.02) + 60) - 60
            noise = 3 * math.sin(12.9898 * (frame + 7 * number) + 78.233 * texel)
            expected = 300 + 15 * texel + (signal + noise if signal > 0 else 0)
            assert counts[frame, texel] == pytest.approx(expected, abs=1.5)
    assert (counts[:8] == 300 + 15 * np.arange(30)).all()


def test_a_case_is_scored_by_given_forces_on_their_way_outside():
    from validation.campaign.case import Case

    parameters = fastmodel.load("wts-0614-34")
    true, model = np.zeros(84), np.zeros(84)
    true[[20, 21]], model[[20, 22]] = (1.0, 1.5), (1.25, 1.5)
    found = make_case_result(Case.read("ball", "sphere:radius=5mm", "3 N"), true, model, parameters)
    assert (found.reference.outside, found.reference.total_force) == (0.5, 3.0)
    assert found.predictions["fast"].outside == 0.25
    # half of 0.25 + 1.5 + 1.5 on texels and 0.25 outside, over the load
    assert found.predictions["fast"].score.misplaced_force == pytest.approx(3.5 / 2 / 3)


@pytest.fixture
def written(monkeypatch):
    """What the experiments on made-up recordings write: place and load by name of the file, and the data sets."""
    written = SimpleNamespace(files={}, sets=[])

    def make(array, load, at, number):
        return SimpleNamespace(array=array, load=load, at=at, number=number)

    def write(recording, path):
        path.write_text("")
        written.files[f"{path.parent.name}/{path.name}"] = recording

    def read(data_set, array):
        written.sets.append((data_set, array))
        names = ("first 0.csv", "second 1.csv")
        return [SimpleNamespace(file=SimpleNamespace(name=name), total=7e3, noise=3.0) for name in names], ["a fault"]

    monkeypatch.setattr(made_up, "make_recording", make)
    monkeypatch.setattr(made_up.tables, "write", write)
    monkeypatch.setattr(made_up, "read_images", read)
    monkeypatch.setattr(made_up, "observe", lambda images: [each.file.name for each in images])
    return written


def test_calibrated_recordings_are_read(monkeypatch, written):
    asked = []

    def calibrate(observations, method, *, noise):
        asked.append((observations, noise))
        gains, widths = 1 + 0.01 * np.arange(30.0), 0.001 * np.arange(30.0)
        widths[4] = math.nan
        estimate = SimpleNamespace(unit="N", value=2.0, low=1.5, high=2.75)
        return SimpleNamespace(
            estimates={"dead force": estimate}, gains=gains, gain_half_widths=widths,
            poses={"first": {"x": [1e-3, 2e-3]}}, hold_out=SimpleNamespace(image_changed_percent=1.25),
            electronics=lambda: {"sensitivity": 1999.0, "name": "text"},
        )  # fmt: skip

    monkeypatch.setattr(made_up, "calibrate", calibrate)
    found = made_up.calibrate_fixed_recordings(SUBJECT)
    loads = (4.0, 1.5, 2.5, 5.5, 7.0, 8.5, 4.0)
    places = {"first": (0.4e-3, -0.7e-3), "second": (1.6e-3, 1.9e-3)}
    assert {name: (each.at, each.load, each.number) for name, each in written.files.items()} == {
        f"{series}/{number}.csv": (at, load, number)
        for series, at in places.items()
        for number, load in enumerate(loads)
    }
    ((data_set, array),) = written.sets
    assert (array.rows, array.columns, array.pitch, np.flatnonzero(~array.active).tolist()) == (6, 5, (4e-3, 4e-3), [0])
    assert (data_set.name, data_set.problems) == ("made up", ())
    kinds = {(each.series, each.window, each.threshold) for each in data_set.files}
    assert kinds == {("first", (3.0, 5.0), 60.0), ("second", (5.0, 8.0), 60.0)}
    placements = [each.placement for each in data_set.files]
    assert {(each.indenter.size, each.yaw, each.at) for each in placements} == {((8e-3, 12e-3, 5e-3), 0.0, None)}
    (split,) = data_set.splits
    parts = [[(each.series, each.least, each.most) for each in part] for part in (split.fit, split.place, split.score)]
    assert parts == [
        [("first", None, None)], [("second", 5.5, 5.5)], [("second", None, 4.0), ("second", 7.0, None)],
    ]  # fmt: skip
    assert asked == [(["first 0.csv", "second 1.csv"], [3.0, 3.0])]
    assert flatten(found["images"]) == {"first 0.csv": 7e3, "second 1.csv": 7e3}
    assert flatten(found["faults of recordings"]) == {"": 1.0}
    assert flatten(found["estimates"]) == {"dead force [N]": (2.0, 1.5, 2.75)}
    assert found["gains"].numbers["row 1"] == pytest.approx((1.05, 1.06, 1.07, 1.08, 1.09))
    assert found["half widths of gains"].numbers["row 0"] == pytest.approx((0.0, 0.001, 0.002, 0.003, 0.0))
    assert flatten(found["poses"]) == {"first, x": (1e-3, 2e-3)}
    assert flatten(found["left-out recordings"]) == {"": 1.25}
    assert flatten(found["electronics"]) == {"sensitivity": 1999.0}
    # one more fault is a change; gains are compared by their largest, 1.29 and 0.029, and the rest each by itself
    assert {name: (each.unit, each.relative, each.tolerance) for name, each in found.items()} == {
        "images": ("counts", True, 0.001), "faults of recordings": ("-", False, 0.5),
        "estimates": ("value and interval", True, 0.005), "gains": ("-", False, pytest.approx(0.00645, abs=1e-4)),
        "half widths of gains": ("-", False, pytest.approx(5.8e-4)),
        "poses": ("value and half width, SI", True, 0.01), "left-out recordings": ("% of white", True, 0.01),
        "electronics": ("of a sensor file", True, 0.005),
    }  # fmt: skip


def make_scores():
    """Scores of three rows on recordings, of which one is by boxes, and their errors."""
    metrics = ("image_changed_percent", "total_counts_error", "centre_of_pressure_m")
    rows = [
        SimpleNamespace(
            model=model, texel_gains=gains, pooled={name: SimpleNamespace(mean=(k + 1) * 1e-3) for name in metrics}
        )
        for k, (model, gains) in enumerate([("fast", True), ("fast", False), ("fast, boxes", False)])
    ]
    error = SimpleNamespace(case="second", quantity="sum", u_num=0.1, u_input=0.2, u_data=0.3)
    return SimpleNamespace(rows=rows, errors={"moved": [error]}, problems=["one", "two"])


def test_scored_recordings_are_read_and_judged(monkeypatch, written):
    asked, scores = [], make_scores()

    def score(data_set, sensor, parameters, *, inputs):
        asked.append((data_set.name, sensor.name, sensor.array is parameters.array, parameters, inputs.friction))
        return scores

    def judge(campaign, result, given, *, required, splits):
        asked.append((campaign.cases, result, given is scores, required, splits))
        (limit,) = required.values()
        word = "accepted" if limit > 0.1 else "not accepted"
        return SimpleNamespace(word=word, findings=[SimpleNamespace(status="met" if limit > 0 else "missed")])

    fitted = SimpleNamespace(parameters={"modulus": 2e6}, electronics={"sensitivity": 1900.0})
    monkeypatch.setattr(made_up, "score_recordings", score)
    monkeypatch.setattr(made_up, "judge", judge)
    monkeypatch.setattr(made_up, "find_difference", lambda rows: (fitted, None, [0.02, 0.01, 0.03]))
    assert made_up.score_fixed_recordings(SUBJECT) == {}
    assert written.files == {}
    found = made_up.score_fixed_recordings(SimpleNamespace(derivation="derived"))
    assert len(written.files) == 14
    assert asked[0][:3] == ("made up", "wts-0614-34", True)
    assert (asked[0][3].array.pitch, asked[0][4]) == ((4e-3, 4e-3), 0.0)
    assert [next(iter(each[3].values())) for each in asked[1:]] == [-0.2, 0.03, 0.3]
    assert all(each[:3] == ((), None, True) and each[4] == ["moved"] for each in asked[1:])
    assert flatten(found["image_changed_percent"]) == {"fast, texel gains": 0.001, "fast": 0.002}
    metrics = list(found.items())[:3]
    assert [(name, each.unit, each.tolerance) for name, each in metrics] == [
        ("image_changed_percent", "% of white", 0.01), ("total_counts_error", "%", 0.05),
        ("centre_of_pressure_m", "mm", 0.002),
    ]  # fmt: skip
    assert flatten(found["behind the best null"]) == {"": (0.02, 0.01, 0.03)}
    assert flatten(found["parameters"]) == {"modulus": 2e6}
    assert flatten(found["electronics"]) == {"sensitivity": 1900.0}
    assert flatten(found["uncertainties"]) == {"second, sum": (0.1, 0.2, 0.3)}
    assert flatten(found["verdict"]) == {
        "at most -0.2 % behind": (-1, -1), "at most 0.03 % behind": (-1, 1), "at most 0.3 % behind": (1, 1),
    }  # fmt: skip
    assert flatten(found["faults"]) == {"": 2.0}
    others = {name: (each.relative, each.tolerance) for name, each in list(found.items())[3:]}
    assert others == {
        "behind the best null": (False, 0.01), "parameters": (True, 0.01), "electronics": (True, 0.01),
        "uncertainties": (True, 0.02), "verdict": (False, 0.5), "faults": (False, 0.5),
    }  # fmt: skip
