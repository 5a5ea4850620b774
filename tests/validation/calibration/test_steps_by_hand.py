"""A step of the load: which frames and texels are used, exact edges of refusals, and intervals that are open."""

import numpy as np
import pytest
from scipy.signal import butter, step

from meshes import TexelArray
from validation.calibration.step_response import fit_step, respond, sum_pressed
from validation.errors import InputError
from validation.recordings.recording import RecordedArray


@pytest.fixture(autouse=True)
def _few_starts(monkeypatch):
    """Starts near the solution are enough, and take less time."""
    monkeypatch.setattr("validation.calibration.step_response._STARTS", 5)
    monkeypatch.setattr("validation.calibration.step_response._DELAYS", (0.0, 5e-3))


def pass_filter(order, cutoff, times, at, *, delay=0.0, low=500.0, high=2500.0):
    """Sums of counts behind an analogue filter after a step."""
    fine = np.linspace(0, 2 * np.pi * cutoff * 3, 4001)
    _, risen = step(butter(order, 1.0, analog=True), T=fine)
    phase = 2 * np.pi * cutoff * np.clip(times - at - delay, 0, None)
    return low + (high - low) * np.interp(phase, fine, risen, right=1.0)


def frame(rate, seconds=2.0):
    return np.arange(int(seconds * rate)) / rate


@pytest.mark.parametrize(("order", "cutoff", "delay"), [(4, 6.0, 0.02), (3, 3.0, 0.0), (1, 2.0, 0.01)])
def test_exact_counts_give_back_order_cut_off_and_delay(order, cutoff, delay):
    times = frame(60.0)
    noise = 0.5 * np.cos(np.arange(len(times)) ** 2)
    found = fit_step(times, pass_filter(order, cutoff, times, 1.003, delay=delay) + noise, 1.003)
    assert found.orders[0] == order
    assert found.cutoff.value == pytest.approx(cutoff, rel=0.01)
    assert found.delay.value == pytest.approx(delay, abs=1e-3)
    assert found.cutoff.low < cutoff * 1.001
    assert found.cutoff.high > cutoff * 0.999
    assert found.delay.low >= 0
    assert found.noise == pytest.approx(0.5 / 2**0.5, rel=0.2)


def test_frames_from_half_a_second_before_to_a_second_after_are_used():
    """Strange counts outside do not matter, and frames just at the ends lie outside."""
    times = frame(32.0, 3.0)
    sums = pass_filter(2, 5.0, times, 1.5)
    spoilt = np.where((times <= 1.0) | (times >= 2.5), 9e4, sums)
    plain, found = (fit_step(times, each, 1.5) for each in (sums, spoilt))
    assert found == plain
    assert found.frames == 47


@pytest.mark.parametrize(
    ("at", "said"),
    [
        (0.0, r"--step: 0 s lies outside the recording, 0 s to 1.983 s"),
        (1.9833333333333334, r"outside the recording"),
        (0.001, r"--step: fewer than 5 frames before or after 0.001 s; name the instant of the step"),
        (1.98, r"fewer than 5 frames before or after 1.98 s"),
        (0.3, r"the counts do not change at 0.3 s"),
    ],
)
def test_an_instant_is_refused_with_its_time(at, said):
    times = frame(60.0)
    with pytest.raises(InputError, match=said):
        fit_step(times, pass_filter(2, 5.0, times, 1.0) + np.cos(np.arange(120)), at)


@pytest.mark.parametrize(
    ("before", "after", "accepted"), [(5, 40, True), (4, 40, False), (40, 5, True), (40, 4, False)]
)
def test_five_frames_on_each_side_are_enough(before, after, accepted):
    times = np.arange(-before, after) / 50 + 0.01
    sums = pass_filter(1, 8.0, times, 0.0)
    if accepted:
        assert fit_step(times, sums, 0.0).frames == min(before, 25) + after
    else:
        with pytest.raises(InputError, match="fewer than 5 frames"):
            fit_step(times, sums, 0.0)


def test_constant_counts_are_no_step():
    with pytest.raises(InputError, match="do not change"):
        fit_step(frame(60.0), np.full(120, 700.0), 1.0)


def test_a_load_that_is_lifted_has_the_same_filter():
    times = frame(60.0)
    noise = 2 * np.cos(np.arange(len(times)) ** 2)
    up, down = (
        fit_step(times, pass_filter(2, 5.0, times, 1.0, low=low, high=high) + sign * noise, 1.0)
        for low, high, sign in ((500.0, 2500.0, 1), (2500.0, 500.0, -1))
    )
    assert down.orders == up.orders
    assert down.cutoff.value == pytest.approx(up.cutoff.value, rel=1e-4)
    assert (down.cutoff.low, down.cutoff.high) == pytest.approx((up.cutoff.low, up.cutoff.high), rel=1e-3)


def test_a_jump_between_two_frames_bounds_the_cut_off_from_below(monkeypatch):
    """A coarse grid of cut-offs takes less time; the bound is one of its values."""
    monkeypatch.setattr("validation.calibration.step_response._GRID", 9)
    monkeypatch.setattr("validation.calibration.step_response._ORDERS", (1, 2))
    times = frame(20.0)
    noise = 3 * np.cos(np.arange(len(times)) ** 2)
    found = fit_step(times, np.where(times > 1.01, 2500.0, 500.0) + noise, 1.01)
    assert np.isnan(found.cutoff.value)
    assert found.cutoff.high == np.inf
    assert np.abs(np.geomspace(0.2, 4 * 20, 9) - found.cutoff.low).min() < 1e-9
    assert 1 < found.cutoff.low < 40
    assert found.reason == (
        "frames every 50 ms do not tell the filter from a jump; more frames per second or a larger step over the noise "
        "would"
    )
    assert found.delay.low == 0
    assert found.delay.high < 3.2 / 20
    assert set(found.orders) == {1, 2}


def test_the_response_starts_after_the_step():
    for order in (1, 2, 3, 4):
        assert respond(order, np.array([-1.0, 0.0]))[:2].tolist() == [0, 0]
        assert respond(order, np.array([60.0]))[0] == pytest.approx(1, abs=1e-9)
        assert respond(order, np.array([2.0]), np.array([3.0, 0.0]))[0] == pytest.approx(
            respond(order, np.array([2.0]), np.array([3.0]))[0] + respond(order, np.array([2.0]))[0]
        )
    assert respond(1, np.array([0.7])) == pytest.approx([1 - np.exp(-0.7)])
    assert respond(1, np.array([0.7]), np.array([3.0])) == pytest.approx([(np.exp(-0.7) - np.exp(-2.1)) / 2])


def make(counts, **options):
    counts = np.array(counts, dtype=np.int32)
    return RecordedArray(counts=counts, full_scale=4095,
                         **{"enabled": np.ones(counts.shape[1], dtype=bool),
                            "texels": TexelArray.grid(1, counts.shape[1], pitch=3e-3)} | options)  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "kept"),
    [((100, 30, 29), [0, 1]), ((-100, 30, -31), [0, 1, 2]), ((20, 5, 100), [2]), ((7, 7, 1), [0, 1])],
)
def test_texels_from_thirty_percent_of_the_largest_change_on_are_summed(changes, kept):
    times = np.arange(40) / 50
    counts = 200 + np.outer(times > 0.41, changes)
    found, sums = sum_pressed(make(counts), times, 0.41)
    assert sums.tolist() == counts[:, kept].sum(axis=1).tolist()
    assert found.tolist() == times.tolist()


@pytest.mark.parametrize(("zeros", "side", "accepted"), [(15, 0, True), (16, 0, False), (15, 1, True), (16, 1, False)])
def test_five_frames_above_zero_on_each_side_are_needed(zeros, side, accepted):
    times = np.arange(40) / 50
    counts = 200 + np.outer(times > 0.39, (100, 90))
    counts[:zeros] *= 1 - (side == 0)
    counts[40 - zeros :, 1] *= 1 - (side == 1)
    if accepted:
        found, sums = sum_pressed(make(counts), times, 0.39)
        assert len(found) == len(sums) == 40 - zeros
        assert (sums > 0).all()
    else:
        with pytest.raises(InputError, match="the counts are zero on one side of the step, where a threshold hides"):
            sum_pressed(make(counts), times, 0.39)


def test_texels_that_are_off_take_no_part():
    times = np.arange(40) / 50
    counts = 200 + np.outer(times > 0.39, (500, 90, 80))
    found = sum_pressed(make(counts, enabled=np.array([False, True, True])), times, 0.39)[1]
    assert found.tolist() == counts[:, 1:].sum(axis=1).tolist()
    inactive = make(counts, texels=TexelArray.grid(1, 3, pitch=3e-3, active=[[0, 1, 1]]))
    assert sum_pressed(inactive, times, 0.39)[1].tolist() == found.tolist()
    for at in (-1.0, 5.0):  # no frame on one side: all texels, as they are
        assert sum_pressed(inactive, times, at)[1].tolist() == found.tolist()
