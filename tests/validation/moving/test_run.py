"""Scores of moving cases, from states in closed form and by the finite elements."""

import dataclasses
import re

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import fastmodel
from fastmodel import Butterworth
from tests.support.histories import make_case
from validation.campaign.bench import LayeredBench
from validation.campaign.plan import Budget
from validation.campaign.results import OUT_OF_BUDGET, predict
from validation.errors import InputError
from validation.moving.inertia import find_resonance
from validation.moving.results import average, measure_delay, measure_error, measure_misplaced
from validation.moving.run import RATE, find_touches, hold, record_fall, run_moving, score_moving
from validation.regression.made_up import make_case_result
from validation.sensor_file import BUILT_IN

SENSOR = BUILT_IN["wts-0614-34"]
PARAMETERS = dataclasses.replace(fastmodel.load("wts-0614-34"), filter=Butterworth(cutoff_hz=20.0, order=2))
BENCH = LayeredBench(cover=SENSOR.cover, parameters=PARAMETERS)
CENTRES = PARAMETERS.array.centres[:, :2]


def spread(load, at, sigma):
    """Texel forces of a bell around a place whose width grows with the cube root of the load, shape (n,) [N]."""
    width = sigma * (1 + 0.3 * np.cbrt(load))
    bell = np.exp(-((CENTRES - at) ** 2).sum(axis=1) / (2 * width**2))
    return load * PARAMETERS.array.pitch[0] ** 2 * bell / (2 * np.pi * width**2)


def solve(state, factor=1.1):
    """A state whose model spreads 1.1 times as wide as the truth."""
    true, model = (spread(state.load, state.pose.at, sigma) for sigma in (4e-3, factor * 4e-3))
    found = make_case_result(state, true, model, PARAMETERS)
    zeros = predict(found.reference, {"zeros": (0 * model, 0.0)}, state.load, PARAMETERS)
    return dataclasses.replace(found, predictions={**found.predictions, **zeros})


def score(case):
    curves = case.divide(PARAMETERS.array.pitch[0])
    return score_moving(BENCH, case, curves, {state: solve(state) for curve in curves for state in curve.cases})


@pytest.mark.parametrize(
    "case",
    [
        make_case((0.0, 0.05, 0.25, 0.4), (0.0, 0.0, 3.0, 1.0), [(1e-3, -2e-3)] * 4),
        pytest.param(
            make_case((0.0, 0.1, 0.4), (2.0, 2.0, 2.0), [(-3e-3, 0.0), (-3e-3, 0.0), (5e-3, 7e-3)]),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            make_case((0.0, 0.2, 0.4), (1.0, 3.0, 1.0), [(0.0, 0.0), (6e-3, 2e-3), (0.0, 0.0)], repeat=2),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["load", "slide", "slide under a growing load"],
)
def test_forces_between_the_states_and_scores_are_those_of_every_instant(case):
    found, samples = score(case), case.sample(RATE)
    within = np.where(samples.times < case.duration, samples.times % case.times[-1], case.times[-1])
    loads = np.interp(within, case.times, case.values)
    places = np.stack([np.interp(within, case.times, [pose.at[k] for pose in case.poses]) for k in (0, 1)], axis=1)
    true, model = (
        np.array([spread(load, at, sigma) for load, at in zip(loads, places, strict=True)]) for sigma in (4e-3, 4.4e-3)
    )
    every = 1 if len(true) < 500 else 2
    assert found.totals["truth"] == pytest.approx(true.sum(axis=1)[::every], abs=2e-3)
    assert found.times == pytest.approx(samples.times[::every])
    sections = butter(2, 20.0, fs=RATE, output="sos")
    passed = sosfilt(sections, np.concatenate([np.repeat(model[:1], 3000, axis=0), model]), axis=0)[3000:]
    frames = np.floor(samples.times * 271 + 1e-9) / 271
    held = passed[np.floor(frames * RATE + 1e-9).astype(int)]
    fast = next(each for each in found.scores if each.model == "fast")
    assert fast.error == pytest.approx(np.linalg.norm(held - true) / np.linalg.norm(true), rel=0.01, abs=2e-4)
    assert fast.overshoot == pytest.approx(held.sum(axis=1).max() / true.sum(axis=1).max() - 1, abs=1e-3)
    assert found.interpolation_error < 0.01


@pytest.mark.parametrize("texel", [0, 40, -1])
def test_overshoot_and_delay_count_every_texel(texel):
    """All force on one texel, of which the model has 1.3 times as much, and the true sum falls after 0.2 s."""
    bench = dataclasses.replace(BENCH, parameters=dataclasses.replace(PARAMETERS, filter=None))
    case = make_case((0.0, 0.2, 0.4), (3.0, 3.0, 1.0), [(0.0, 0.0)] * 3)
    one = np.eye(len(CENTRES))[texel]
    curves = case.divide(PARAMETERS.array.pitch[0])
    solved = {
        state: make_case_result(state, 0.5 * state.load * one, 0.65 * state.load * one, PARAMETERS)
        for curve in curves
        for state in curve.cases
    }
    found = score_moving(bench, case, curves, solved)
    fast = next(each for each in found.scores if each.model == "fast")
    assert fast.overshoot == pytest.approx(0.3, abs=1e-6)
    assert fast.delay == pytest.approx(0.5 / 271 + 0.5 / RATE, abs=0.5e-3)
    assert found.totals["truth"][[0, -1]] == pytest.approx([1.5, 0.5])
    assert fast.misplaced == pytest.approx(0.15, abs=1e-6)  # half of the load lies outside, and 0.35 of the model's


@pytest.mark.slow
def test_a_slow_ramp_comes_late_by_the_group_delay_of_filter_samples_and_frames():
    """sqrt(2) / (2 pi fc) of a second-order filter, half a frame, and half a sample of a frame's age."""
    found = score(make_case((0.0, 3.0), (0.5, 3.0), [(0.0, 0.0)] * 2))
    rows = {each.model: each for each in found.scores}
    expected = np.sqrt(2) / (2 * np.pi * 20) + 0.5 / 271 + 0.5 / RATE
    assert rows["exact spread"].delay == pytest.approx(expected, abs=0.3e-3)
    assert rows["fast"].delay == pytest.approx(expected, abs=0.3e-3)
    assert rows["truth at each frame"].delay == pytest.approx(0.5 / 271 + 0.5 / RATE, abs=0.2e-3)
    assert np.isnan(rows["zeros"].delay)
    assert np.isnan(rows["fast"].latency)


def test_null_models_misplace_nothing_and_the_wide_spread_does():
    found = score(make_case((0.0, 0.05, 1.0), (0.0, 0.0, 2.0), [(0.0, 0.0)] * 3))
    rows = {each.model: each for each in found.scores}
    assert rows["truth at each frame"].misplaced < 0.005
    one, other = (spread(1.0, (0.0, 0.0), sigma) for sigma in (4e-3, 4.4e-3))
    about = 0.5 * (np.abs(one - other).sum() + abs(one.sum() - other.sum()))
    assert rows["fast"].misplaced == pytest.approx(about, rel=0.15)


def test_latency_is_the_time_to_the_threshold_and_half_a_frame():
    """A ramp of 10 N/s; the largest texel passes the dead zone of the electronics at a force in closed form."""
    bench = dataclasses.replace(BENCH, parameters=dataclasses.replace(PARAMETERS, filter=None))
    case = make_case((0.0, 0.1, 0.4), (0.0, 0.0, 3.0), [(0.0, 0.0)] * 3)
    curves = case.divide(PARAMETERS.array.pitch[0])
    found = score_moving(bench, case, curves, {state: solve(state) for curve in curves for state in curve.cases})
    loads = np.linspace(0, 3, 3001)[1:]
    forces = np.array([spread(load, (0.0, 0.0), 4e-3) for load in loads])
    first = loads[np.argmax(np.asarray(PARAMETERS.electronics.counts(forces)).any(axis=1))]
    rows = {each.model: each for each in found.scores}
    assert rows["truth at each frame"].latency == pytest.approx(first / 10 + 0.5 / 271, abs=1.5e-3)
    assert rows["truth at each frame"].latency_worst - rows["truth at each frame"].latency == pytest.approx(0.5 / 271)
    assert np.isnan(rows["zeros"].latency)


@pytest.mark.parametrize("late", [-4.2e-3, 0.0, 7.3e-3, 120e-3])
def test_the_delay_of_a_shifted_signal_is_found_between_samples(late):
    times = np.arange(3000) / RATE
    given, found = (np.exp(-((times - 1 - shift) ** 2) / 0.02)[:, None] * [1.0, 3.0] for shift in (0.0, late))
    assert measure_delay(given, found, 1 / RATE) == pytest.approx(late, abs=0.05e-3)


def test_the_delay_of_a_periodic_signal_is_less_than_a_period():
    """50 Hz through frames of 271 Hz: half a frame, half a sample, and no whole periods of 20 ms."""
    times = np.arange(500) / RATE
    given = np.abs(np.sin(np.pi * 50 * times))[:, None]
    assert measure_delay(given, hold(given, 271.0), 1 / RATE) == pytest.approx(0.5 / 271 + 0.5 / RATE, abs=0.3e-3)


@pytest.mark.parametrize(("slow", "late"), [(0.2, 10e-3), (0.452, 30e-3), (2.0, 30e-3)])
def test_of_the_shifts_that_are_nearly_as_close_the_smallest_is_the_delay(slow, late):
    """A wave of 20 ms, 30 ms late: a period less is 1.2, 2.0 and 20 times as far, by a second wave of 400 ms."""
    k = np.arange(2000)

    def signal(at):
        return np.sin(2 * np.pi * at / 20) + slow * np.sin(2 * np.pi * at / 400)

    found = signal(k - 30) + 0.1 * (-1.0) ** k
    assert measure_delay(signal(k)[:, None], found[:, None], 1e-3) == pytest.approx(late, abs=1e-3)


def test_misplaced_force_compares_shapes_where_there_is_force():
    true = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]])
    found = np.array([[9.0, 0.0, 0.0], [2.0, 1.0, 1.0], [0.01, 0.01, 0.0]])
    assert measure_misplaced(true, found) == pytest.approx(np.array([np.nan, 0.25, np.nan]), nan_ok=True)


def test_contact_made_and_lost_and_slides_are_listed_apart():
    """Planted: the model is 30 % too wide where it slides, and exact otherwise."""
    case = make_case(
        (0.0, 0.1, 0.11, 0.3, 0.5, 0.7, 0.71, 0.8), (0.0, 0.0, 2.0, 2.0, 2.0, 2.0, 0.0, 0.0),
        [(0.0, 0.0)] * 4 + [(6e-3, 0.0)] * 4,
    )  # fmt: skip
    curves = case.divide(PARAMETERS.array.pitch[0])
    bench = dataclasses.replace(BENCH, parameters=dataclasses.replace(PARAMETERS, filter=None))
    solved = {state: solve(state, 1.0) for curve in curves for state in curve.cases}
    solved |= {state: solve(state, 1.3) for state in curves[1].cases[1:-1]}
    found = score_moving(bench, case, curves, solved)
    (fast,) = (each for each in found.scores if each.model == "fast")
    assert fast.sliding > 0.05
    assert fast.misplaced < 0.2 * fast.sliding
    assert fast.misplaced_high < 0.02
    assert fast.touching < 0.05
    assert any("made or lost: 2" in each for each in found.warnings)


@pytest.mark.parametrize("first", [0.0, 1.0])
def test_samples_within_20_ms_of_contact_are_near_it(first):
    loads = np.concatenate([np.full(50, first), np.ones(100), np.zeros(30)])
    near = np.flatnonzero(find_touches(loads))
    expected = [*range(30, 71), *range(130, 171)] if first == 0 else [*range(130, 171)]
    assert near.tolist() == expected


def test_every_tap_loses_contact_for_a_moment():
    """25 taps: 24 instants between them at which the load comes to zero, each lost and made, and the first and last."""
    found = score(make_case((0.0, 0.01, 0.02), (0.0, 2.0, 0.0), [(0.0, 0.0)] * 3, repeat=25))
    assert any("made or lost: 50;" in each for each in found.warnings)
    rows = {each.model: each for each in found.scores}
    assert np.isnan(rows["fast"].misplaced)
    assert rows["fast"].touching > 0.03


def test_a_falling_ball_hits_the_cover_after_the_time_of_its_fall_and_comes_to_rest():
    """sqrt(2 h / g), within two steps; its momentum m sqrt(2 g h) is the integral of the force over its weight."""
    from meshes import Pose
    from meshes.constants import STANDARD_GRAVITY

    case = dataclasses.replace(make_case((0.0, 0.4), (0.5, 0.5), [(0.7e-3, 1.1e-3)] * 2), fall=3e-3)
    found = record_fall(case, PARAMETERS)
    loads, fallen = np.array(found.values), np.sqrt(2 * 3e-3 / STANDARD_GRAVITY)
    assert found.times[np.argmax(loads > 0)] == pytest.approx(fallen, abs=2.1e-3)
    assert loads[-1] == pytest.approx(0.5, rel=1e-3)
    assert 1e-3 * (loads.sum() - 0.5 * len(loads)) == pytest.approx(0.0, abs=0.5 * 3e-3)
    assert set(found.poses) == {Pose.planar(at=(0.7e-3, 1.1e-3))}
    assert loads.max() > 0.75
    beside = dataclasses.replace(case, poses=(Pose.planar(at=(0.2, 0.0)),) * 2)
    moved = run_moving(BENCH, [beside])
    assert "beside the array" in moved.skipped[0].reason


def test_a_fall_through_the_contacts_is_refused_with_a_height_that_works():
    case = dataclasses.replace(make_case((0.0, 0.3), (0.5, 0.5), [(0.0, 0.0)] * 2), fall=0.1)
    with pytest.raises(InputError, match="fall: a body that falls by 100 mm does not rest") as found:
        record_fall(case, PARAMETERS)
    height = float(re.findall("write fall = '(.*) mm'", str(found.value))[0])
    loads = record_fall(dataclasses.replace(case, fall=1e-3 * height), PARAMETERS).values
    assert np.sum(loads) * 1e-3 == pytest.approx(0.5 * 0.3, rel=0.02)
    with pytest.raises(InputError, match="end the history later"):
        record_fall(dataclasses.replace(case, times=(0.0, 0.03), fall=3e-3), PARAMETERS)


def test_the_impact_is_limited_and_not_the_weight():
    """Its force is proportional to the weight, so that the lowered fall is the fall of the lower weight."""
    case = dataclasses.replace(make_case((0.0, 0.2), (0.5, 0.5), [(0.0, 0.0)] * 2), fall=2e-3)
    limited = record_fall(dataclasses.replace(case, most=1.0), PARAMETERS)
    assert max(limited.values) == pytest.approx(1.0)
    lighter = dataclasses.replace(case, values=(0.5 / max(record_fall(case, PARAMETERS).values),) * 2)
    assert limited.values == pytest.approx(record_fall(lighter, PARAMETERS).values, rel=1e-6, abs=1e-9)
    assert any("lowered for `deepest`" in each for each in score(limited).warnings)


def test_a_landing_says_what_it_does_not_know():
    case = record_fall(dataclasses.replace(make_case((0.0, 0.2), (0.5, 0.5), [(0.0, 0.0)] * 2), fall=2e-3), PARAMETERS)
    words = " ".join(score(case).warnings)
    for each in ("inertia", "MuJoCo's contacts", "made or lost"):
        assert each in words


@pytest.mark.slow
def test_friction_in_slides_and_unloading_is_named():
    bench = dataclasses.replace(BENCH, friction=0.4)
    case = make_case((0.0, 0.1, 0.4), (2.0, 1.0, 1.0), [(0.0, 0.0), (0.0, 0.0), (5e-3, 0.0)])
    curves = case.divide(PARAMETERS.array.pitch[0])
    solved = {state: solve(state) for curve in curves for state in curve.cases}
    words = " ".join(score_moving(bench, case, curves, solved).warnings)
    assert "slides" in words
    assert "unloading" in words
    assert not score_moving(BENCH, case, curves, solved).warnings


def test_frames_hold_the_latest_sample():
    assert hold(np.arange(9.0), 250.0).tolist() == [0, 0, 0, 0, 4, 4, 4, 4, 8]


def test_the_resonance_is_that_of_a_shear_layer():
    """sqrt(G / rho) / (4 h) with G = E / (2 (1 + nu)), 1 MPa, nu 0.49, 2 mm, 1100 kg/m3."""
    assert find_resonance(BENCH.cover) == pytest.approx(np.sqrt(1e6 / 2.98 / 1100) / 8e-3)


def test_fast_changes_of_the_load_are_warned_of():
    found = score(make_case((0.0, 1e-3, 0.1), (0.0, 2.0, 2.0), [(0.0, 0.0)] * 3))
    assert "inertia" in found.warnings[0]
    assert not score(make_case((0.0, 0.1), (1.0, 2.0), [(0.0, 0.0)] * 2)).warnings


def test_a_short_pulse_is_scored():
    """Ten samples and less: no shift is longer than the history."""
    found = score(make_case((0.0, 0.002, 0.006), (0.0, 2.0, 0.0), [(0.0, 0.0)] * 3))
    assert len(found.times) == 7
    assert np.isfinite(found.scores[0].error)


@pytest.mark.slow
def test_a_fast_slide_is_warned_of():
    """16 mm in 1 ms: a millimetre takes 1 / 16 ms."""
    found = score(make_case((0.0, 1e-3, 0.05), (2.0, 2.0, 2.0), [(0.0, 0.0), (16e-3, 0.0), (16e-3, 0.0)]))
    assert found.fastest == pytest.approx(0.35 * 16e3)
    assert "inertia" in found.warnings[0]


def test_an_interrupted_or_expensive_run_keeps_what_is_finished(monkeypatch):
    cases = [make_case((0.0, 0.1), (2.0, 2.0), [(0.0, 0.0)] * 2)] * 2
    calls = []

    def solve_once(_bench, state, _progress):
        calls.append(state)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return solve(state)

    monkeypatch.setattr(LayeredBench, "solve", solve_once)
    found = run_moving(BENCH, cases)
    assert found.interrupted
    assert len(found.results) == 1
    assert [each.reason for each in found.skipped] == ["interrupted"]
    found = run_moving(BENCH, cases, budget=Budget(seconds=-1.0))
    assert not found.results
    assert not found.interrupted
    assert [each.reason for each in found.skipped] == [OUT_OF_BUDGET] * 2


@pytest.mark.slow
def test_finite_elements_between_the_states_agree_with_a_press_at_that_load():
    from fem_reference.indentation.press import press

    bench = LayeredBench(cover=SENSOR.cover, parameters=fastmodel.load("wts-0614-34"))
    case = make_case((0.0, 0.4), (0.0, 2.0), [(0.7e-3, 1.1e-3)] * 2)
    ((found,), skipped, _) = run_moving(bench, [case])
    assert not skipped
    for instant in (100, 250, 333):
        direct = press(SENSOR.cover, PARAMETERS.array, case.indenter, load=2.0 * instant / 400, pose=case.poses[0])
        assert found.totals["truth"][instant] == pytest.approx(direct.texel_forces.sum(), rel=1e-4)
    fast = next(each for each in found.scores if each.model == "fast")
    assert fast.misplaced < 0.03


def follow_with(bench, case):
    curves = case.divide(PARAMETERS.array.pitch[0])
    solved = {state: solve(state) for curve in curves for state in curve.cases}
    return score_moving(bench, case, curves, solved), curves


@pytest.mark.parametrize(
    ("design", "high", "words"),
    [
        pytest.param(
            Butterworth(cutoff_hz=20.0, order=2), None, "order 2, 20 Hz, frames at 271 Hz", marks=pytest.mark.slow
        ),
        (Butterworth(cutoff_hz=35.0, order=3), 0.5, "order 3, 35 Hz, above 0.5 Hz, frames at 271 Hz"),
        pytest.param(None, 0.5, "above 0.5 Hz, frames at 271 Hz", marks=pytest.mark.slow),
        pytest.param(None, None, "frames at 271 Hz", marks=pytest.mark.slow),
    ],
)
def test_rows_name_what_the_models_do_in_time(design, high, words):
    electronics = dataclasses.replace(PARAMETERS.electronics, high_pass_hz=high)
    parameters = dataclasses.replace(PARAMETERS, filter=design, electronics=electronics)
    case = make_case((0.0, 0.1, 0.4), (0.0, 2.0, 2.0), [(0.0, 0.0)] * 3)
    found, curves = follow_with(dataclasses.replace(BENCH, parameters=parameters), case)
    rows = {each.model: each for each in found.scores}
    assert (rows["fast"].chain, rows["exact spread"].chain) == (words, words)
    assert rows["truth at each frame"].chain == "frames at 271 Hz"
    assert found.states == sum(len(curve.cases) for curve in curves)
    last = found.totals["exact spread"][-1] / found.totals["truth"][-1]
    assert last == pytest.approx(np.exp(-2 * np.pi * 0.5 * 0.35) if high else 1.0, abs=0.02)


@pytest.mark.parametrize("rate", [271.0, 31.0, 1000.0, 333.3])
def test_a_frame_holds_the_latest_sample_until_the_next_frame(rate):
    forces = np.arange(200.0)[:, None] * [1.0, 2.0]
    frames = np.arange(0, 0.2, 1 / rate)
    wanted = [int(frames[frames <= k / RATE + 1e-9].max() * RATE + 1e-6) for k in range(200)]
    assert hold(forces, rate)[:, 0].tolist() == wanted
    assert hold(forces, rate)[:, 1].tolist() == [2 * each for each in wanted]


@pytest.mark.parametrize(
    ("shares", "level", "wanted"),
    [
        ([0.1, 0.3, np.nan], None, 0.2),
        (list(range(101)), 0.95, 95.0),
        ([np.nan, 4.0], 0.95, 4.0),
        ([np.nan], None, np.nan),
    ],
)
def test_means_and_quantiles_leave_undefined_instants_out(shares, level, wanted):
    assert average(np.array(shares, dtype=float), level) == pytest.approx(wanted, nan_ok=True)


@pytest.mark.parametrize(("found", "wanted"), [([[3.0, 4.0]], 0.0), ([[0.0, 0.0]], 1.0), ([[3.0, 9.0]], 1.0)])
def test_the_error_is_a_share_of_the_true_rms(found, wanted):
    assert measure_error(np.array([[3.0, 4.0]]), np.array(found)) == pytest.approx(wanted)


@pytest.mark.parametrize(("faint", "wanted"), [(0.0, [0.5, 0.25]), (0.1, [np.nan, 0.25])])
def test_misplaced_force_is_left_out_below_a_share_of_the_largest(faint, wanted):
    true, found = np.array([[0.1, 0.0], [2.0, 2.0]]), np.array([[0.1, 0.1], [3.0, 1.0]])
    assert measure_misplaced(true, found, faint) == pytest.approx(np.array(wanted), nan_ok=True)
