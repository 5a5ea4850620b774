"""Histories of moving cases: their samples, their static states and their faults."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.support.histories import make_case
from tests.support.rubber import stack_layers
from validation.campaign.campaign_file import parse_campaign, read_campaign
from validation.moving.history import interpolate
from validation.places import FlatPlaces
from validation.sensor_file import BUILT_IN

PLACES = FlatPlaces(array=BUILT_IN["wts-0614-34"].array)
TAP = {"name": "tap", "indenter": "sphere:radius=5mm", "time": ["0 s", "0.1 s"], "load": ["0 N", "2 N"]}


def read(*tables):
    found = parse_campaign({"moving": list(tables)}, PLACES, source="file")
    return found.moving, found.left_out


def test_loads_are_linear_in_time_and_repeat():
    case = make_case((0.0, 0.02, 0.05), (0.0, 3.0, 0.0), [(0.0, 0.0)] * 3, repeat=3)
    found = case.sample(1000.0)
    assert len(found.times) == 151
    within = found.times % 0.05
    within[-1] = 0.05
    assert found.loads == pytest.approx(np.interp(within, (0, 0.02, 0.05), (0, 3, 0)), abs=1e-9)
    assert found.positions == pytest.approx(np.cbrt(found.loads / 3), abs=1e-9)
    assert case.duration == pytest.approx(0.15)
    assert case.fastest == pytest.approx(0.35 / 0.02)


def test_states_along_a_load_are_cubes_and_are_shared_by_all_ramps_at_a_place():
    case = make_case((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 4.0, 4.0, 1.0, 4.0), [(1e-3, 0.0)] * 5)
    (curve,) = case.divide(3.4e-3)
    assert [state.load for state in curve.cases] == pytest.approx([4 * (k / 8) ** 3 for k in range(1, 9)], rel=1e-5)
    assert {state.pose.at for state in curve.cases} == {(1e-3, 0.0)}


def test_states_along_a_motion_stand_within_a_quarter_of_the_pitch():
    case = make_case((0.0, 1.0, 2.0), (2.0, 2.0, 1.0), [(0.0, 0.0), (0.0, 0.0), (6e-3, 8e-3)])
    hold, slide = case.divide(2e-3)
    assert len(hold.cases) == 1
    assert hold.cases[0] in slide.cases
    points = np.array([state.pose.at for state in slide.cases])
    assert points == pytest.approx(np.linspace((0, 0), (6e-3, 8e-3), 21))
    assert [state.load for state in slide.cases] == pytest.approx(np.linspace(2, 1, 21).tolist(), rel=1e-5)
    samples = case.sample(10.0)
    assert samples.positions[15] == pytest.approx(0.5)
    assert (samples.curves == 1).sum() == 11


def test_the_interpolation_is_exact_for_cubics_and_constant_below_the_first_state():
    (curve,) = make_case((0.0, 1.0), (0.0, 8.0), [(0.0, 0.0)] * 2).divide(3e-3)
    shares = np.stack([curve.positions**3, 1 - curve.positions**2], axis=1)
    places = np.array([0.0, 0.3, 0.77, 1.0])
    found = interpolate(curve, shares, places)
    kept = np.clip(places, 0.125, 1)
    assert found == pytest.approx(np.stack([kept**3, 1 - kept**2], axis=1))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"time": ["0.1 s", "0.2 s"]}, "moving[0].time[0]: the history must begin at 0 s"),
        ({"time": ["0 s", "0 s"]}, "must come at least 1 ms, one sample, after 0 s"),
        ({"time": ["0 s", "0.5 ms"]}, "at least 1 ms"),
        ({"time": ["0 s", "-1 s"]}, "moving[0].time[1]"),
        ({"time": ["0 s"]}, "moving[0].time"),
        ({"time": ["0 s", "0.1 s", "0.2 s"]}, "moving[0].load: 2 values for 3 instants"),
        ({"load": "0 N"}, "nothing presses"),
        ({"load": ["1 N", "2 mm"]}, "moving[0].load[1]"),
        ({"load": ["1 N", "-2 N"]}, "moving[0].load[1]"),
        ({"at": ["0mm,0mm", "1mm"]}, "moving[0].at"),
        ({"at": ["0mm,0mm"] * 3}, "moving[0].at: 3 values for 2 instants"),
        ({"at": ["0mm,0mm", "2m,0mm"]}, "at most 0.5 m"),
        ({"repeat": 3}, "moving[0].repeat: the history must end with the load"),
        ({"load": "2 N", "repeat": 1001}, "moving[0].repeat"),
        ({"time": ["0 s", "15 s"], "load": "1 N", "repeat": 3}, "at most 20 s"),
        ({"time": ["0 s", "30 s"]}, "moving[0].time[1]"),
        ({"indenter": "ball:radius=5mn"}, "moving[0].indenter"),
        ({"speed": "1 mm/s"}, "moving[0].speed: unknown key"),
        ({"yaw": "45"}, "yaw"),
    ],
)
def test_a_fault_is_one_line_with_its_place_and_costs_its_case(changes, words):
    cases, faults = read(TAP | changes, TAP | {"name": "other"})
    assert [case.name for case in cases] == ["other"]
    assert len(faults) == 1
    assert words in faults[0]


def test_loads_are_lowered_as_those_of_other_cases():
    soft = stack_layers((2e-3, 1e5, 0.49))
    places = dataclasses.replace(PLACES, cover=soft)
    (case,) = parse_campaign({"moving": [TAP | {"load": ["0 N", "5 N"]}], "deepest": "10 %"}, places, source="x").moving
    table = {"name": "x", "indenter": TAP["indenter"], "load": "5 N"}
    (static,) = parse_campaign({"case": [table], "deepest": "10 %"}, places, source="x").cases
    assert 0 < static.load < 2
    assert case.loads == pytest.approx((0.0, static.load))


def test_two_cases_of_one_name_are_refused():
    cases, faults = read(TAP, TAP)
    assert len(cases) == 1
    assert "moving[1].name" in faults[0]


def test_the_built_in_campaigns_read_without_a_fault():
    moving = read_campaign(Path("moving"), PLACES)
    assert not moving.left_out
    assert len(moving.moving) == 7
    assert {case.repeat for case in moving.moving} == {1, 3, 10, 25}
    report = read_campaign(Path("report-2015"), PLACES)
    assert not report.left_out
    assert len(report.cases) == 33
    turned = [case.name for case in report.cases if "nut" in case.name]
    assert turned == ["hexagonal nut 100 g", "hexagonal nut 100 g 90", "hexagonal nut 500 g", "hexagonal nut 500 g 90"]
    assert {round(case.load, 2) for case in report.cases} == {0.98, 4.9}
