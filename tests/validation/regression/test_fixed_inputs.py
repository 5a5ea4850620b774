"""Experiments of the regression check on sensors with a filter and masked texels, and on made-up data."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtr

from fastmodel import Butterworth, Electronics, Gaussian, Parameters
from meshes import TexelArray
from validation.regression import experiments, made_up
from validation.regression.experiments import (
    make_oblong,
    measure_characteristic,
    measure_frames,
    measure_letter,
    measure_noise,
    measure_reset,
    press_edge,
)
from validation.regression.made_up import make_recording
from validation.regression.reading import Subject

#: Texels of which the first and the last are masked, under a filter.
ARRAY = TexelArray.grid(20, 25, (2e-3, 3e-3), active=~np.isin(np.arange(500), (0, 499)))
PAD = Parameters(
    array=ARRAY, spread=Gaussian(sigma_x=0.5, sigma_y=0.4, ksize_x=3, ksize_y=3), filter=Butterworth(cutoff_hz=1.0),
    electronics=Electronics(rate_hz=40.0, sensitivity=500.0, offset=-10.0, noise=0.02),
)  # fmt: skip
SMALL = replace(PAD, array=TexelArray.grid(4, 3, (2e-3, 3e-3), active=~np.isin(np.arange(12), (0, 11))))


def flatten(reading):
    """Numbers of a reading by label, alone where there is one."""
    return {label: row[0] if len(row) == 1 else row for label, row in reading.numbers.items()}


class Noisy:
    """A sensor whose counts are 100 and, with noise, a sequence by its seed; frames and texels are alike in part."""

    def __init__(self, made, **parts):
        self.parts, self.steps, self.seed = SimpleNamespace(**parts), 0, None
        made.append(self)

    def bind(self, model):
        self.timestep = model.opt.timestep
        return self

    def reset(self, *, seed):
        self.seed = seed

    def step(self, data):
        self.steps += 1
        return True

    def frame(self):
        parameters = self.parts.parameters
        counts = np.full(parameters.array.count, 100)
        if parameters.electronics.noise:
            counts += draw_counts(self.seed, self.steps, len(counts))
        return SimpleNamespace(texel_forces=None, counts=counts)

    def outside(self):
        return 0.0


def draw_counts(seed, step, texels):
    """Whole numbers about 7, of which a part is that of all seeds, of the frame before and of the texel before."""
    own, before, common = (
        np.random.default_rng(key).normal(size=texels) for key in ((seed, step), (seed, step - 1), 1)
    )
    mixed = own + 0.5 * before + 0.4 * common
    found = np.rint(7 + 60 * (mixed + 0.6 * np.roll(mixed, 1))).astype(int)
    found[[0, -1]] = 10_000  # on the masked texels
    return found


def test_the_noise_is_that_of_active_texels_without_the_filter_of_the_sensor(monkeypatch):
    """20 frames of 500 texels are ten thousand counts; a count is a millinewton."""
    made = []
    monkeypatch.setattr(experiments, "Sensor", lambda **parts: Noisy(made, **parts))
    found = measure_noise(Subject(parameters=PAD, seed=3))
    assert [each.parts.parameters.electronics.noise for each in made] == [0, 0.1, 0.1, 0.1]
    assert [each.seed for each in made] == [None, 3, 3, 4]
    assert [each.parts.parameters.filter for each in made] == [None] * 4
    assert {each.parts.parameters.electronics.sensitivity for each in made} == {1000.0}
    assert {each.steps for each in made} == {20}
    first, other = (np.array([draw_counts(seed, k, 500)[1:-1] for k in range(1, 21)]) for seed in (3, 4))
    assert flatten(found["standard deviation"]) == {"": pytest.approx(first.std(), rel=1e-3)}
    assert flatten(found["mean"]) == {"": pytest.approx(first.mean(), abs=5e-3)}
    assert flatten(found["difference for the same seed"]) == {"": 0}
    pairs = {"seeds": (first, other), "frames": (first[1:], first[:-1]), "texels": (first[:, 1:], first[:, :-1])}
    expected = {f"of two {name}": np.corrcoef(a.ravel(), b.ravel())[0, 1] for name, (a, b) in pairs.items()}
    assert min(expected.values()) > 0.1
    assert flatten(found["correlation"]) == {name: pytest.approx(value, abs=2e-4) for name, value in expected.items()}


def test_the_number_of_noisy_frames_is_rounded_up_and_a_single_texel_has_no_neighbour(monkeypatch):
    made = []
    monkeypatch.setattr(experiments, "Sensor", lambda **parts: Noisy(made, **parts))
    monkeypatch.setattr(experiments, "_SAMPLES", 20)
    array = TexelArray.grid(1, 3, (2e-3, 3e-3), active=[0, 1, 0])
    found = measure_noise(Subject(parameters=replace(PAD, array=array)))
    assert {each.steps for each in made} == {7}
    assert flatten(found["correlation"])["of two texels"] == 0


def test_counts_after_a_reset_are_those_of_half_the_force_behind_the_play():
    """One count per millinewton from 20 000 on; half of the force passes a play operator of 0.5 N from rest."""
    found = measure_reset(Subject(parameters=SMALL))
    forces = SMALL.spread.operator(SMALL.array).sum(axis=1)[SMALL.array.active]
    assert forces.min() < 0.95 < forces.max()
    expected = 20_000 + 1e3 * (0.5 * forces + 0.5 * np.maximum(forces - 0.5, 0)).mean()
    assert flatten(found["counts after a reset"]) == {"": pytest.approx(expected, abs=0.5)}
    assert flatten(found["trace of the load before"]) == {"": 0}


def test_an_image_of_the_h_has_a_grey_level_of_120_at_the_mean_pressure_whatever_the_filter():
    readings = [measure_letter(Subject(parameters=replace(SMALL, filter=each))) for each in (None, SMALL.filter)]
    assert readings[0] == readings[1]
    found = readings[0]
    image = np.array(list(found["image"].numbers.values()))
    # a frame of bars of 0.99 mm in 3.3 x 6.6 mm at 34 kPa; what is not outside reads 120 per 34 kPa on 6 mm2
    load = 34e3 * (2 * 0.99 * 6.6 + (3.3 - 2 * 0.99) * 0.99) * 1e-6
    measured = 1 - flatten(found["force outside"])[""] / 100
    assert image.sum() == pytest.approx(120 * load * measured / (34e3 * 6e-6), abs=4)
    assert flatten(found["net force"]) == {"x": 0, "y": 0, "z": pytest.approx(-load, rel=2e-3)}
    torque = flatten(found["net torque"])  # r x F [N mm], where the H stands, within half a pitch
    assert torque["x"] == pytest.approx(-0.13 * 12 * load, abs=1.5 * load)
    assert torque["y"] == pytest.approx(0.1 * 6 * load, abs=1.0 * load)
    assert torque["x"] < 0 < torque["y"]


@pytest.fixture
def pressed(monkeypatch):
    """Presses that are asked for; their results are made-up forces."""
    asked = []

    def indent(parameters, indenter, *, load, pose, contact):
        asked.append((parameters, indenter, load, pose, contact))
        forces = np.arange(float(parameters.array.count))
        return SimpleNamespace(
            texel_forces=1e-3 * forces, contact_forces=2e-3 * forces, total_force=0.75, outside=0.25 * load, depth=3e-4
        )

    monkeypatch.setattr(experiments, "indent", indent)
    return asked


def test_a_ball_at_the_edge_stands_beside_the_last_active_texel(pressed):
    found = press_edge(Subject(parameters=SMALL))
    ((parameters, ball, load, pose, contact),) = pressed
    assert (parameters, contact) == (SMALL, "foundation")
    assert (ball.radius, load) == (pytest.approx(6e-3), pytest.approx(34e3 * 6e-6))
    assert pose.point == pytest.approx(SMALL.array.centres[10] + [0.4 * 2e-3, 0, 0])
    assert flatten(found["foundation, force of each texel"])["row 1"] == (3, 4, 5)
    assert flatten(found["foundation, largest force after spread"]) == {"": 11}
    assert flatten(found["foundation, load carried"]) == {"": 0.75}
    assert flatten(found["foundation, force outside"]) == {"": 25}
    assert flatten(found["foundation, depth"]) == {"": pytest.approx(0.3)}


def test_forces_of_boxes_are_read_before_the_spread(pressed):
    found = experiments.press_letter(Subject(parameters=SMALL))
    assert [each[-1] for each in pressed] == ["boxes", "foundation"]
    assert [each[3].yaw for each in pressed] == [0.17] * 2
    assert pressed[0][3].point == pytest.approx((0.1 * 6e-3, 0.13 * 12e-3, 0))
    for method, factor in (("boxes", 2), ("foundation", 1)):
        rows = flatten(found[f"{method}, force of each texel"])
        assert rows["row 2"] == (6 * factor, 7 * factor, 8 * factor)
        assert flatten(found[f"{method}, largest force after spread"]) == {"": 11}


def test_a_block_stands_turned_on_the_oblong_array_for_every_sensor(pressed):
    experiments.press_oblong(Subject(parameters=None))
    assert [each[-1] for each in pressed] == ["boxes", "foundation", "cover"]
    for parameters, block, load, pose, _ in pressed:
        assert parameters.array.pitch == (3e-3, 4.5e-3)
        assert (block.size, load) == ((5e-3, 9e-3, 4e-3), 3.0)
        assert (pose.point, pose.yaw) == (pytest.approx((1.1e-3, 3.4e-3, 0)), 0.3)


def test_the_oblong_array_has_electronics_and_a_point_spread_of_its_own():
    found = make_oblong()
    assert found.electronics == Electronics(rate_hz=100.0, sensitivity=1000.0)
    assert found.spread == Gaussian(sigma_x=0.5, sigma_y=0.35, ksize_x=3, ksize_y=3)
    assert (found.filter, found.array.name, found.surface.source) == (None, "oblong", "a formula")


def integrate(edges, at, size):
    """Share of a uniform pressure, spread by 1.2 mm, between edges: differences of its second integral."""

    def twice(x):
        return x * ndtr(x / 1.2e-3) + 1.2e-3 * np.exp(-0.5 * (x / 1.2e-3) ** 2) / math.sqrt(2 * math.pi)

    return np.diff(twice(edges - at + size / 2) - twice(edges - at - size / 2)) / size


@pytest.mark.parametrize(("load", "at", "number"), [(8.5, (0.4e-3, -0.7e-3), 5), (2.5, (1.6e-3, 1.9e-3), 1)])
def test_all_counts_of_a_recording_are_rounded_and_noise_is_on_what_passes_the_threshold(load, at, number):
    array = TexelArray.grid(6, 5, (4e-3, 4e-3), active=np.arange(30) != 3)
    found = make_recording(array, load, at, number)
    (recorded,) = found.arrays
    assert (recorded.texels.pitch, np.flatnonzero(~recorded.texels.active).tolist()) == ((4e-3, 4e-3), [3])
    along = integrate(4e-3 * (np.arange(6) - 2.5), at[0], 8e-3), integrate(4e-3 * (np.arange(7) - 3.0), at[1], 12e-3)
    texel, times = np.arange(30), 0.25 * np.arange(44)[:, None]
    force = (times >= 2) * load * (1 + 0.01 * math.sin(5 * number)) * np.outer(along[1], along[0]).ravel()
    growth = (1 + 0.008 * (4 * (number % 3) - 4)) * (1 + 0.03 * np.log(np.maximum(times - 2, 0.1) / 2))
    signal = (1 + 0.2 * np.sin(2.1 * texel)) * (2000 * growth * (force - 0.02) + 60) - 60
    noise = 3 * np.sin(12.9898 * (np.arange(44)[:, None] + 7 * number) + 78.233 * texel)
    expected = 300 + 15 * texel + np.where(signal > 0, signal + noise, 0)
    certain = np.abs(signal) > 1
    apart = np.abs(recorded.counts.reshape(44, 30) - expected)[certain]
    assert apart.max() < 0.5 + 2e-4 * 2000 * load * 0.3
    assert 0.2 < apart[apart > 0].mean() < 0.3  # of rounding, a quarter


def test_made_up_scores_are_decided_where_the_cases_suffice_and_nothing_is_missing():
    """The mean of 2, 5, 1, 8 and 3 % has an interval up to 8.7 %; limits are 3, 5 and 9 %, or 5 % for each case."""
    found = made_up.judge_fixed_scores(Subject(parameters=None))
    verdicts = {name: row if isinstance(row, tuple) else (row,) for name, row in flatten(found["verdict"]).items()}
    assert verdicts == {
        "mean above the limit": (-1, -1), "interval beyond the limit": (0, 0), "interval below the limit": (1, 1),
        "one case above its limit": (-1, 1, 1, -1, 1, -1, 1), "every case below its limit": (1,) * 7,
        "four cases": (0, 0), "a fault in the campaign": (0, 1), "interrupted": (0, 1),
        "inaccurate reference": (0, 1), "no limit": (0,),
    }  # fmt: skip
    means = flatten(found["mean misplaced force"])
    assert set(means) == {f"{name}, mean over the cases" for name in verdicts if name != "no limit"}
    for name, (mean, low, high) in means.items():
        assert mean == pytest.approx(0.04 if name.startswith("four") else 0.038)
        assert low < mean < high


@pytest.mark.parametrize("measure", [measure_characteristic, measure_frames])
def test_frames_and_characteristic_do_not_depend_on_the_filter(measure):
    """Its cut-off is above half of the frame rate, so that it could not run at that rate."""
    found = [measure(Subject(parameters=replace(SMALL, filter=each))) for each in (None, Butterworth(cutoff_hz=30.0))]
    assert found[0] == found[1]
