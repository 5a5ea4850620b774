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
        ({"time": ["0 s", "0 s"]}, "must come at least 1 ms after 0 s"),
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
        ({"fall": "3 mm"}, "moving[0].fall: a body falls once"),
        ({"fall": "3 mm", "load": "1 N", "time": ["0 s", "20 ms"]}, "the fall lasts 0.0247 s; end the history later"),
        ({"fall": "-3 mm", "load": "1 N"}, "moving[0].fall"),
    ],
)
def test_a_fault_is_one_line_with_its_place_and_costs_its_case(changes, words):
    cases, faults = read(TAP | changes, TAP | {"name": "other"})
    assert [case.name for case in cases] == ["other"]
    assert len(faults) == 1
    assert words in faults[0]


def write(folder, text):
    (folder / "h.csv").write_text(text)
    return {key: value for key, value in TAP.items() if key not in ("time", "load")} | {"history": "h.csv"}


def read_in(folder, table):
    found = parse_campaign({"moving": [table]}, PLACES, source="file", folder=folder)
    return found.moving, found.left_out


def test_a_file_of_loads_is_the_history(tmp_path):
    """A force sensor's file in milliseconds since its start; other keys of the table remain."""
    (case,), _ = read_in(tmp_path, write(tmp_path, "time_ms,force\n5000,0\n5010,2.5\n5040,1\n") | {"at": "1mm,2mm"})
    assert case.times == pytest.approx((0.0, 0.01, 0.04))
    assert case.values == (0.0, 2.5, 1.0)
    assert {pose.at for pose in case.poses} == {(1e-3, 2e-3)}
    assert case.fastest == pytest.approx(0.35 / 0.01)


def test_a_recorded_way_is_one_curve_between_its_corners_and_its_speed_changes_nothing(tmp_path):
    """A quarter of a circle of 6 mm at varying speed, and back along the chord: two curves."""
    times = np.arange(301) / 300
    angles = 0.5 * np.pi * times**2
    rows = [f"{t},2,{6e-3 * np.cos(a)},{6e-3 * np.sin(a)}" for t, a in zip(times, angles, strict=True)]
    (case,), faults = read_in(tmp_path, write(tmp_path, "\n".join(["time,load,x,y", *rows, "1.5,2,6e-3,0"])))
    assert not faults
    arc, chord = case.divide(2e-3)
    assert [len(arc.cases), len(chord.cases)] == [20, 18]
    radii = [np.hypot(*state.pose.at) for state in arc.cases]
    assert radii == pytest.approx([6e-3] * 20, rel=1e-4)
    samples = case.sample(300.0)
    assert samples.positions[150] == pytest.approx(0.25, abs=1e-3)
    assert samples.moves[150]
    assert samples.curves[[10, 440]].tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "changes", "words"),
    [
        ("time,load\n0,1\n2,1\n1,1\n", {}, "line 4: time 1 s comes before 2 s"),
        ("time,load\n0,1\n0.1,-1\n", {}, "moving[0].load[1]"),
        ("time,load\n0,1\n0.1,x\n", {}, "line 3: not a number"),
        ("time,load\n0,1\n0.0005,1\n", {}, "at least 1 ms"),
        ("time,load\n", {}, "expected `time` [s] with `load`, or"),
        ("time,depth\n0,1\n", {}, "columns time, depth"),
        ("time,load\n0,1\n1,1\n", {"history": "no.csv"}, "no.csv: no such file; expected a CSV file with a h"),
        ("load,time\n1,0\n", {}, "line 1: 2 columns between commas, 'load, time'...; expected, between commas, "),
        ("time,load,force\n0,1,1\n", {}, "or tabs, `time` [s] with `load`, or"),
        ("time,load\n0,1\n1,1\n", {"history": "../h.csv"}, "moving[0].history: must lie below the folder of the file"),
        ("time,load\n0,1\n1,1\n", {"time": ["0 s", "1 s"]}, "remove one of the two"),
        ("time,force\n5,0\n6,2\n", {"load": "1 N"}, "moving[0].load: the file of `history` states"),
        ("time,x,y\n0,0,0\n1,1e-3,0\n", {"load": "1 N", "at": "1mm,0mm"}, "moving[0].at: the file of `history`"),
        ("time,load\n0,1\n1,1\n", {"fall": "3 mm"}, "moving[0].fall: the file of `history` states"),
        ("time,x,y\n0,0,0\n1,1e-3,0\n", {}, "moving[0].load: is missing"),
    ],
)
def test_a_fault_in_a_file_is_one_line(tmp_path, text, changes, words):
    table = write(tmp_path, text) | changes
    found = parse_campaign({"moving": [table, TAP | {"name": "other"}]}, PLACES, source="file", folder=tmp_path)
    assert len(found.left_out) == 1
    assert words in found.left_out[0]
    assert found.left_out[0].startswith("file: moving[0]")


def test_a_way_with_many_corners_is_refused(tmp_path):
    rows = [f"{0.01 * k},{1e-4 * (k % 2)},{1e-4 * k}" for k in range(150)]
    _, (fault,) = read_in(tmp_path, write(tmp_path, "\n".join(["time,x,y", *rows])) | {"load": "1 N"})
    assert "149 corners" in fault


@pytest.mark.slow
def test_loads_are_lowered_as_those_of_other_cases():
    soft = stack_layers((2e-3, 1e5, 0.49))
    places = dataclasses.replace(PLACES, cover=soft)
    (case,) = parse_campaign({"moving": [TAP | {"load": ["0 N", "5 N"]}], "deepest": "10 %"}, places, source="x").moving
    table = {"name": "x", "indenter": TAP["indenter"], "load": "5 N"}
    (static,) = parse_campaign({"case": [table], "deepest": "10 %"}, places, source="x").cases
    assert 0 < static.load < 2
    assert case.values == pytest.approx((0.0, static.load))
    fall = TAP | {"load": "0.01 N", "fall": "3 mm", "time": ["0 s", "0.4 s"]}
    (falling,) = parse_campaign({"moving": [fall], "deepest": "10 %"}, places, source="x").moving
    assert falling.most == pytest.approx(static.load, rel=0.05)


def test_two_cases_of_one_name_are_refused():
    cases, faults = read(TAP, TAP)
    assert len(cases) == 1
    assert "moving[1].name" in faults[0]


def test_the_built_in_campaigns_read_without_a_fault():
    moving = read_campaign(Path("moving"), PLACES)
    assert not moving.left_out
    assert len(moving.moving) == 9
    assert [case.fall for case in moving.moving if case.fall] == [3e-3, 3e-3]
    assert {case.repeat for case in moving.moving} == {1, 3, 10, 25}
    report = read_campaign(Path("report-2015"), PLACES)
    assert not report.left_out
    assert len(report.cases) == 34
    turned = [case.name for case in report.cases if "nut" in case.name]
    assert turned == ["hexagonal nut 100 g", "hexagonal nut 100 g 90", "hexagonal nut 500 g", "hexagonal nut 500 g 90"]
    assert {round(case.load, 2) for case in report.cases} == {0.98, 1.96, 4.9}


@pytest.mark.parametrize(("degrees", "curves"), [(0, 1), (18, 1), (22, 2), (90, 2)])
def test_a_way_is_divided_at_bends_of_more_than_20_degrees(degrees, curves):
    turn = np.radians(degrees)
    places = [(0.0, 0.0), (4e-3, 0.0), (4e-3 + 3.1e-3 * np.cos(turn), 3.1e-3 * np.sin(turn))]
    found = make_case((0.0, 1.0, 2.0), (2.0, 2.0, 2.0), places).divide(2e-3)
    assert len(found) == curves
    assert sum(len(each.cases) for each in found) == (16 if curves == 1 else 9 + 8)


def test_turns_and_places_of_a_table_are_those_of_all_states():
    (case,), faults = read(TAP | {"yaw": "30deg", "tilt": "1deg,2deg", "at": "2mm,-3mm"})
    assert not faults
    assert {(each.at, round(each.yaw, 6)) for each in case.poses} == {((2e-3, -3e-3), round(np.radians(30), 6))}
    assert case.poses[0].tilt == pytest.approx((np.radians(1), np.radians(2)))
    (curve,) = case.divide(2e-3)
    assert {each.pose for each in curve.cases} == {case.poses[0]}
    assert [each.name for each in curve.cases][-2:] == ["tap, 1.34 N", "tap, 2 N"]
    assert (case.heaviest.name, case.heaviest.load) == ("tap", 2.0)


def test_a_load_that_comes_to_zero_in_a_slide_has_states_of_a_small_load():
    """The smallest is 1/512 of the largest, the cube of 1/8."""
    (curve,) = make_case((0.0, 1.0), (5.12, 0.0), [(0.0, 0.0), (4e-3, 0.0)]).divide(4e-3)
    assert [each.load for each in curve.cases] == pytest.approx([5.12, 3.84, 2.56, 1.28, 0.01])
    assert curve.positions.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
