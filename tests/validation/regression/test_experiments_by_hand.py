"""Experiments of the regression check on other sensors than the built-in one, against closed forms."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from fastmodel import Butterworth, Electronics, Gaussian, Parameters
from meshes import TexelArray
from validation.regression import experiments
from validation.regression.experiments import (
    face,
    find_origin,
    lay_ball,
    lay_block,
    lay_flat,
    lay_letter_h,
    list_methods,
    make_oblong,
    measure_characteristic,
    measure_frames,
    measure_load_step,
)
from validation.regression.reading import Subject

ACTIVE = np.arange(12) != 4
ARRAY = TexelArray.grid(4, 3, (2e-3, 3e-3), active=ACTIVE, name="pad")
ELECTRONICS = Electronics(
    rate_hz=40.0, sensitivity=500.0, offset=-10.0, output_max=800, bits=10, noise=0.02,
    calibrated="through the cover, tip 1 mm", tip_share=0.8,
)  # fmt: skip
PAD = Parameters(array=ARRAY, spread=Gaussian(sigma_x=0.5, sigma_y=0.4, ksize_x=3, ksize_y=3), electronics=ELECTRONICS)


def flatten(reading):
    """Numbers of a reading by label, alone where there is one."""
    return {label: row[0] if len(row) == 1 else row for label, row in reading.numbers.items()}


def change(**electronics):
    return Subject(parameters=replace(PAD, electronics=replace(ELECTRONICS, **electronics)))


@pytest.mark.parametrize("offset", [-10.0, 300.0])
def test_the_characteristic_is_that_of_a_line_with_rounded_counts(offset):
    """500 counts/N of the force through the cover: the count k is reached at 0.8 (k - 0.5 - offset) / 500 N."""
    found = measure_characteristic(change(offset=offset))
    forces = {
        level: max(0.8 * (math.ceil(8 * level) - 0.5 - offset) / 500, 1e-6) for level in (1, 25, 50, 75, 99)
    }  # fmt: skip
    assert flatten(found["force"]) == {
        f"{level} % of full scale": pytest.approx(1e3 * force, rel=2e-5) for level, force in forces.items()
    }
    assert flatten(found["sensitivity"]) == {"": pytest.approx(400 / (forces[75] - forces[25]), rel=2e-5)}
    assert flatten(found["largest count (saturation)"]) == {"": 800}
    rows = [(400.0, 400.0, 400.0), (400.0, 0.0, 400.0), (400.0, 400.0, 400.0), (400.0, 400.0, 400.0)]
    assert list(found["counts of each texel"].numbers.values()) == rows
    assert (flatten(found["frame rate"]), flatten(found["noise"])) == ({"": 40.0}, {"": 20.0})
    assert (found["largest count (saturation)"].tolerance, found["counts of each texel"].tolerance) == (1.5, 1.5)


def test_a_sensor_whose_counts_stay_zero_has_no_characteristic():
    with pytest.raises(ValueError, match="no force gives a count"):
        measure_characteristic(change(gains=(0.0,) * 12))


@pytest.mark.parametrize(
    ("rate", "times", "per_second"),
    [
        (40.0, [25, 50, 75, 100, 125, 150, 175, 200], 40.0), (70.0, [15, 29, 43, 58, 72, 86, 100, 115], 69.96),
        (1600.0, [1, 2, 3, 4, 5, 6, 7, 8], 1000.0),
    ],
)  # fmt: skip
def test_frames_come_at_the_first_step_of_each_period(rate, times, per_second):
    found = measure_frames(change(rate_hz=rate))
    assert flatten(found["time of the first frames"]) == {
        f"frame {k}": pytest.approx(time, abs=1e-6) for k, time in enumerate(times)
    }
    assert flatten(found["frames per second"]) == {"": pytest.approx(per_second, rel=1e-4)}
    assert abs(flatten(found["delay of the force"])[""]) < 0.3
    assert flatten(found["delay of the time"]) == {"": pytest.approx(0, abs=1e-6)}


class Responding:
    """A sensor whose total force answers a step of 2 N after 0.15 s with a given function of time."""

    def __init__(self, made, answer, **parts):
        self.parts, self.answer, self.steps = SimpleNamespace(**parts), answer, 0
        self.pushed = []
        made.append(self)

    def bind(self, model):
        self.timestep = model.opt.timestep
        return self

    def step(self, data):
        self.steps += 1
        self.pushed.append(-data.xfrc_applied[-1, 2])
        return True

    def frame(self):
        return SimpleNamespace(texel_forces=np.array([0.5, 0.25]))

    def outside(self):
        time = self.timestep * self.steps - 0.15 - self.timestep
        return 1.25 + (2 * self.answer(time) if time >= -1e-9 else 0.0)


@pytest.mark.parametrize(
    ("own", "timestep", "duration"),
    [
        (None, 1e-3, 0.3), (Butterworth(cutoff_hz=80.0, order=1), 0.625e-3, 0.3),
        (Butterworth(cutoff_hz=62.5, order=3), 0.8e-3, 0.3), (Butterworth(cutoff_hz=20.0, order=2), 1e-3, 0.4),
    ],
)  # fmt: skip
def test_sensors_in_a_load_step_make_a_frame_at_each_step_long_enough_for_their_own_filter(
    monkeypatch, own, timestep, duration
):
    made = []
    monkeypatch.setattr(
        experiments, "Sensor", lambda **parts: Responding(made, lambda t: -math.expm1(-t / 4e-3), **parts)
    )
    found = measure_load_step(Subject(parameters=replace(PAD, filter=own)))
    assert [each.parts.parameters.filter for each in made] == [
        own, *(Butterworth(cutoff_hz=20.0, order=order) for order in (1, 2, 3, 4))
    ]  # fmt: skip
    for each in made:
        assert each.timestep == pytest.approx(timestep)
        assert each.parts.parameters.electronics.rate_hz == pytest.approx(1 / timestep)
        assert each.steps == pytest.approx(duration / timestep, abs=1.01)
        rest = round(0.15 / timestep)
        assert (each.pushed[:rest], each.pushed[rest:]) == ([0.0] * rest, [2.0] * (each.steps - rest))
    names = ["own filter", *(f"order {order}" for order in (1, 2, 3, 4))]
    # From 10 % to 90 % in ln 9 time constants; interpolation between steps makes up to a few percent.
    assert flatten(found["rise time"]) == {name: pytest.approx(4 * math.log(9), rel=0.02) for name in names}
    assert flatten(found["force after the step"]) == {name: pytest.approx(4.0, rel=1e-5) for name in names}
    assert flatten(found["overshoot"]) == {name: pytest.approx(0, abs=1e-3) for name in names}
    assert found["overshoot"].tolerance == 0.2


@pytest.mark.parametrize(
    ("answer", "rise", "overshoot", "end"),
    [
        (lambda t: 1.2 if t < 0.01 else 1.0, 0.0, 20, 4.0), (lambda t: 0.95 if t < 0.01 else 0.975, 0.0, -2.5, 3.95),
        (lambda t: min(t / 0.05, 1.0), 40.0, 0, 4.0), (lambda t: 0.90625 if t < 0.0095 else 1.0, 0.0, 0, 4.0),
        (lambda t: 0.875 if t < 0.0095 else 1.0, 9.2, 0, 4.0),
        (lambda t: min(t / 0.02, 1.5), 16.0, 50, 5.0),
    ],
)  # fmt: skip
def test_a_response_that_begins_above_its_end_does_not_rise(monkeypatch, answer, rise, overshoot, end):
    made = []
    monkeypatch.setattr(experiments, "Sensor", lambda **parts: Responding(made, answer, **parts))
    found = measure_load_step(Subject(parameters=PAD))
    for name, expected in (("rise time", rise), ("overshoot", overshoot), ("force after the step", end)):
        assert [*flatten(found[name]).values()] == pytest.approx([expected] * 5, abs=2e-3)


def test_the_h_is_as_large_as_the_array_allows_and_stands_beside_the_centre():
    small, wide = TexelArray.grid(4, 3, (2e-3, 3e-3)), TexelArray.grid(20, 10, (2e-3, 3e-3))
    letter, load, at, yaw = lay_letter_h(small)
    assert letter.size == pytest.approx((0.55 * 3 * 2e-3, 0.55 * 4 * 3e-3))
    assert letter.bar == pytest.approx(0.3 * 3.3e-3)
    assert load == pytest.approx(34e3 * (2 * 0.99 * 6.6 + (3.3 - 2 * 0.99) * 0.99) * 1e-6)
    assert at == pytest.approx((0.1 * 6e-3, 0.13 * 12e-3))
    assert yaw == 0.17
    letter, _, at, _ = lay_letter_h(wide)
    assert letter.size == pytest.approx((3.5 * 2e-3, 4.7 * 3e-3))
    assert at == pytest.approx((0.1 * 20e-3, 0.13 * 60e-3))


def test_ball_and_block_press_beside_the_middle_texel():
    array = TexelArray.grid(3, 5, (4e-3, 3e-3))
    array = replace(array, centres=np.add(array.centres, [5e-3, -7e-3, 2e-3]))
    ball, load, pose = lay_ball(array)
    assert (ball.radius, load) == (pytest.approx(9e-3), pytest.approx(34e3 * 12e-6))
    middle = array.centres[7] + [0.2 * 4e-3, -0.3 * 3e-3, 0.0]
    assert pose.point == pytest.approx(middle)
    assert pose.yaw == 0
    block, load, pose = lay_block(array)
    assert block.size == pytest.approx((6.8e-3, 6.9e-3, 6.8e-3))
    assert load == pytest.approx(34e3 * 6.8e-3 * 6.9e-3)
    assert (pose.point, pose.yaw) == (pytest.approx(middle), 0.17)


def test_an_indenter_faces_a_texel_of_a_curved_array():
    normals = np.array([[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [-0.6, 0.0, 0.8]])
    centres = np.array([[5e-3, 1e-3, 0.0], [0.0, 1e-3, 2e-3], [-5e-3, 1e-3, 0.0]])
    curved = replace(TexelArray.grid(1, 3, (5e-3, 4e-3)), centres=centres, normals=normals)
    assert find_origin(curved) == pytest.approx(centres[1])
    assert find_origin(ARRAY) == pytest.approx(np.zeros(3))
    pose = face(curved, 0, origin=centres[0], at=(2e-3, 3e-3), yaw=0.4)
    away = np.array(pose.point) - centres[0]
    assert pose.direction == pytest.approx((-0.6, 0.0, -0.8))
    assert (away @ normals[0], np.linalg.norm(away)) == (
        pytest.approx(0, abs=1e-12),
        pytest.approx(math.hypot(2e-3, 3e-3)),
    )
    assert (away[1], pose.yaw) == (pytest.approx(3e-3), 0.4)
    assert face(curved, 1, origin=np.zeros(3), at=(2e-3, 3e-3)).yaw == 0


@dataclass(frozen=True)
class Sensing:
    """Parameters with an array and the methods of a surface."""

    array: TexelArray
    surface: object


@pytest.mark.parametrize(
    ("methods", "listed", "kept"),
    [
        (None, ("boxes", "foundation"), True), (("cover", "boxes"), ("boxes", "foundation", "cover"), True),
        (("curved",), ("curved",), False),
    ],
)  # fmt: skip
def test_contact_methods_follow_from_the_surface_and_a_curved_one_is_laid_flat(methods, listed, kept):
    raised = replace(ARRAY, centres=np.add(ARRAY.centres, [0.0, 0.0, 3e-3]))
    sensor = Sensing(raised, None if methods is None else SimpleNamespace(methods=methods))
    assert list_methods(sensor) == listed
    flat = lay_flat(sensor)
    if kept:
        assert flat is sensor
        return
    assert flat.surface is None
    assert flat.array.centres == pytest.approx(TexelArray.grid(4, 3, (2e-3, 3e-3)).centres)
    assert (flat.array.active.tolist(), flat.array.name, flat.array.pitch) == (ACTIVE.tolist(), "pad", (2e-3, 3e-3))


def test_the_oblong_array_has_a_cover_by_formulas():
    """Compliance a / r exp(-r / 2 mm), r^2 + (0.5 mm)^2 of the distance of cells; shares of a Gaussian of 1.2 mm."""
    found = make_oblong((2e-3, 3e-3))
    array, cover = found.array, found.surface
    assert (array.rows, array.columns, array.pitch) == (6, 5, (2e-3, 3e-3))
    assert np.flatnonzero(~array.active).tolist() == [0]
    assert (cover.per_texel, cover.cell) == (4, pytest.approx((0.5e-3, 0.75e-3)))
    assert cover.compliance.shape == (48, 40)
    for row, column in ((0, 0), (2, 5), (7, 1), (47, 39)):
        r = math.sqrt((0.75e-3 * row) ** 2 + (0.5e-3 * column) ** 2 + 0.5e-3**2)
        expected = 2.4e-7 * 0.5e-3 * 0.75e-3 / r * math.exp(-r / 2e-3)
        assert cover.compliance[row, column] == pytest.approx(expected, rel=1e-5)
    assert cover.influence.shape == (16, 16)
    for row, column in ((0, 3), (6, 6), (7, 9), (15, 8)):
        shares = []
        for index, cell, pitch in ((column, 0.5e-3, 2e-3), (row, 0.75e-3, 3e-3)):
            middle = (index - 6 + 0.5) * cell
            upper, lower = ((edge - middle) / 1.2e-3 / math.sqrt(2) for edge in (pitch, 0.0))
            shares.append((math.erf(upper) - math.erf(lower)) / 2)
        assert cover.influence[row, column] == pytest.approx(shares[0] * shares[1], rel=1e-4, abs=1e-9)
    assert (cover.thickness, cover.top_compliance) == (2e-3, 2.4e-7)
    assert make_oblong().array.pitch == (3e-3, 4.5e-3)
