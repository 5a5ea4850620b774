"""Counts of a texel by hand: line, temperature, creep, threshold, saturation and seat, and the same as electronics."""

from dataclasses import astuple, replace
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import RoundedTip
from validation.calibration.model import CountCurve, Placement, Pose, make_reference_method, seat_unevenly
from validation.sensor_file import load

NAN, LN2 = np.nan, np.log(2)
#: 500 counts/N with a dead force of 0.1 N at 20 degC; gains 1 and 2.
LINE = CountCurve(
    sensitivity=500.0, dead_force=0.1, gain_temperature=0.01, dead_temperature=0.02, reference_temperature=20.0,
    creep=0.1, output_max=np.inf, saturation_band=0.0, gains=np.array([1.0, 2.0]), heights=np.zeros(2),
)  # fmt: skip
AGED = replace(LINE, reference_age=8.0)
BENT = replace(LINE, output_max=300.0, saturation_band=100.0)


@pytest.mark.parametrize(
    ("curve", "state", "expected"),  # temperature, age and threshold; counts of both texels under 0.4 N each
    [
        (LINE, (20.0, 2.0, 0.0), (150, 300)),
        (LINE, (NAN, NAN, 0.0), (150, 300)),
        # 10 K: gain 1.1, dead force 0.3 N
        (LINE, (30.0, 2.0, 0.0), (55, 110)),
        (LINE, (10.0, 2.0, 0.0), (225, 450)),
        (LINE, (20.0, 8.0, 0.0), (150 * (1 + 0.2 * LN2), 300 * (1 + 0.2 * LN2))),
        (LINE, (20.0, 1.0, 0.0), (150 * (1 - 0.1 * LN2), 300 * (1 - 0.1 * LN2))),
        (AGED, (20.0, NAN, 0.0), (150, 300)),
        (AGED, (20.0, 2.0, 0.0), (150 / (1 + 0.2 * LN2), 300 / (1 + 0.2 * LN2))),
        # the dead force is that of a texel of gain one: gain 2 doubles what stands for the threshold
        (LINE, (20.0, 2.0, 40.0), (150, 340)),
        # creep multiplies the counts before the threshold is subtracted
        (LINE, (20.0, 8.0, 40.0), (190 * (1 + 0.2 * LN2) - 40, 380 * (1 + 0.2 * LN2) - 40)),
        # the knee of 200 counts
        (BENT, (20.0, 2.0, 0.0), (150, 300 - 100 * np.exp(-1))),
        (BENT, (10.0, 2.0, 0.0), (300 - 100 * np.exp(-0.25), 300 - 100 * np.exp(-2.5))),
    ],
)  # fmt: skip
def test_counts_follow_the_formula_of_the_module(curve, state, expected):
    temperature, age, threshold = (np.array([each]) for each in state)
    found = curve.predict(np.full((1, 2), 0.4), temperatures=temperature, ages=age, thresholds=threshold)
    assert found[0] == pytest.approx(expected)
    none = curve.predict(np.full((1, 2), 0.09), temperatures=np.array([20.0]), ages=age, thresholds=threshold)
    assert none[0, 0] == 0  # below the dead force
    electronics = curve.electronics(50.0, temperature=state[0], age=state[1], threshold=state[2])
    assert electronics.counts(np.full(2, 0.4)) == pytest.approx(expected, abs=0.5)
    assert (electronics.rate_hz, electronics.threshold) == (50.0, state[2])


@pytest.mark.parametrize(
    ("output_max", "stated"), [(np.inf, (4095, 12, 0.0)), (4095.4, (4095, 12, 80.0)), (4096.0, (4096, 13, 80.0)),
                               (70_000.0, (70_000, 17, 80.0))]
)  # fmt: skip
def test_electronics_have_bits_for_their_largest_count(output_max, stated):
    curve = replace(LINE, output_max=output_max, saturation_band=80.0)
    found = curve.electronics(50.0, temperature=20.0, age=2.0, threshold=0.0)
    assert (found.output_max, found.bits, found.saturation_band) == stated
    assert found.gains == (1.0, 2.0)


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ((0.0, 0.0), (3.0, 1.0)),
        ((0.5, 0.5), (3.0, 1.0)),  # the same height of all changes nothing
        ((0.0, 2.0), (3.375, 0.625)),  # approach p: 0.75 p + 0.25 (p - 2) = 4
        ((0.0, 6.0), (4.0, 0.0)),  # the second texel is never reached
        ((2.0, 0.0), (2.625, 1.375)),
        ((16.0, 0.0), (0.0, 4.0)),  # p = 16 with the second texel alone
        ((15.0, 0.0), (0.1875, 3.8125)),  # p = 15.25
    ],
)
def test_an_uneven_seat_is_a_row_of_springs_under_one_approach(heights, expected):
    found = seat_unevenly(np.array([[3.0, 1.0], [0.0, 0.0]]), np.array(heights))
    assert found[0] == pytest.approx(expected)
    assert not found[1].any()
    seated = replace(LINE, dead_force=0.0, heights=np.array(heights), gains=np.ones(2))
    state = {"temperatures": np.array([20.0]), "ages": np.array([2.0]), "thresholds": np.zeros(1)}
    assert seated.predict(np.array([[3.0, 1.0]]), **state)[0] == pytest.approx(500 * np.array(expected))


def test_a_pose_is_known_only_if_all_of_it_is():
    whole = {"name": "a", "indenter": RoundedTip(radius=1e-3), "at": (1e-3, 2e-3), "yaw": 0.3, "tilt": (0.01, 0.02)}
    pose = Placement(**whole).pose
    assert astuple(pose) == (1e-3, 2e-3, 0.3, 0.01, 0.02)
    assert pose.named() == {"x_m": 1e-3, "y_m": 2e-3, "yaw_rad": 0.3, "tilt_x_rad": 0.01, "tilt_y_rad": 0.02}
    assert [Placement(**whole | {part: None}).pose for part in ("at", "yaw", "tilt")] == [None] * 3
    assert Placement(name="a", indenter=whole["indenter"], at=(0.0, 0.0), yaw=0.0).pose == Pose(0.0, 0.0)


def test_the_contact_of_finite_elements_is_binned_turned_and_moved(monkeypatch):
    """Three forces and a pull: two lie in one square of a tenth of a pitch, and count as one at their centroid."""
    sensor, tip = load("wts-0614-34"), RoundedTip(radius=1e-3)
    edge, solved, spreads = 0.1 * min(sensor.array.pitch), [], []
    points = np.array([[0.2, 0.5, 0.0], [0.6, 0.5, 0.0], [4.5, 2.5, 0.0], [9.5, 9.5, 0.0]]) * edge
    contact = SimpleNamespace(contact_points=points, contact_forces=np.outer([-1.0, -3.0, -4.0, 2.0], [0, 0, 1.0]))

    def press(_cover, _array, _tip, *, load, pose):
        solved.append((load, pose))
        return contact

    def spread(_cover):
        spreads.append(1)
        return SimpleNamespace(texel_influence=lambda _array, places: np.hstack([places, np.ones((len(places), 1))]))

    monkeypatch.setattr("fem_reference.press", press)
    monkeypatch.setattr("fem_reference.point_spread", spread)
    method = make_reference_method(sensor.cover, sensor.array)
    level = method.solve(tip, 5.0, Pose(0.0, 0.0))
    centroids = np.array([[0.5, 0.5], [4.5, 2.5]]) * edge  # each carries half of the load
    assert level == pytest.approx([*(5 * centroids.mean(axis=0)), 5.0])
    x, y = centroids.mean(axis=0)
    turned = method.solve(tip, 5.0, Pose(1e-3, 2e-3, yaw=np.pi / 2))
    assert turned == pytest.approx([5 * (1e-3 - y), 5 * (2e-3 + x), 5.0])
    assert (len(solved), len(spreads)) == (1, 1)  # position and yaw change no contact
    for load_n, tilt in ((6.0, (0.0, 0.0)), (5.0, (0.01, 0.0)), (5.0, (0.0, 0.01))):
        method.solve(tip, load_n, Pose(0.0, 0.0, 0.0, *tilt))
    assert (len(solved), len(spreads)) == (4, 1)
    assert [pressed for pressed, _ in solved] == [5.0, 6.0, 5.0, 5.0]
