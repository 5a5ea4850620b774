"""Gaps and stamps that are found from the clock of the device."""

from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.stream import Continuity, DeviceClock


@pytest.mark.parametrize("lost", [pytest.param(0.05, marks=pytest.mark.slow), 0.2])
def test_many_frames_lost_from_the_start_are_not_taken_for_a_slow_stream(lost):
    missing = 0
    for seed in range(100):
        random = Random(seed)  # noqa: S311 -- reproducible, no secret
        sent = {int(number * 1000 / 271): number for number in range(60)}
        came = [ticks for ticks in sent if random.random() >= lost]
        before_gaps = [before for before, after in pairwise(came) if sent[after] - sent[before] > 1]
        assert [gap.after for gap in _follow(came)] == before_gaps
        missing += len(before_gaps)
    assert missing > 160


def _follow(clock, skipped=None):
    """Gaps of a stream of frames with these clocks, and bytes skipped before each."""
    continuity = Continuity()
    skipped = skipped or [0] * len(clock)
    pairs = zip(clock, skipped, strict=True)
    gaps = [gap for ticks, count in pairs for gap in continuity.add(ticks, skipped=count, host_time=0)]
    return gaps + continuity.finish()


@given(st.integers(0, 2**32 - 1), st.integers(1, 100_000), st.lists(st.booleans(), max_size=100))
def test_lost_frames_are_counted_exactly_at_any_rate(start, period, arrives):
    """Nine frames let the step be learnt; then frames are lost in any pattern, the last one arrives."""
    arrives = [True] * 9 + arrives + [True]
    clock = [(start + number * period) % 2**32 for number, came in enumerate(arrives) if came]
    gaps = _follow(clock)
    assert sum(gap.frames for gap in gaps) == arrives.count(False)
    assert {gap.kind for gap in gaps} <= {"frames missing"}


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 50)), min_size=1, max_size=80))
def test_all_skipped_bytes_are_reported_for_any_clock(frames):
    clock, skipped = zip(*frames, strict=True)
    assert sum(gap.skipped for gap in _follow(clock, skipped)) == sum(skipped)


@pytest.mark.parametrize(
    ("clock", "skipped", "told"),
    [
        ([n * 100 + n % 3 for n in range(40)], None, []),  # a slow stream with jitter
        ([*range(1000, 1080, 4), 1076], None, ["frame repeated, after tick 1076"]),
        ([*range(1000, 1080, 4), 3], None, ["clock set back, after tick 1076"]),
        ([*range(0, 60, 4), 100], [0] * 15 + [7], ["frames missing, after tick 56, 10 frames, 7 bytes"]),
    ],
)
def test_a_gap_is_described_in_one_line(clock, skipped, told):
    assert [str(gap) for gap in _follow(clock, skipped)] == told


@pytest.mark.parametrize("rate", [271.0, 30.0, 271.3, 500.0])
@pytest.mark.parametrize("lost", [0.0, 0.25])
def test_long_gaps_are_told_within_one_percent(rate, lost):
    """Pauses of any length, the first one after ten frames; the truth is the number of frames that were not sent."""
    random = Random(round(rate))  # noqa: S311 -- reproducible, no secret
    pauses = [(10, 813), (1000, 813), (2100, 100), (3000, 8000), (11_500, 1000)]
    paused = {number for start, length in pauses for number in range(start, start + length)}
    numbers = [number for number in range(13_000) if number not in paused and random.random() >= lost]
    clock = [int(123.4 + number * 1000 / rate) for number in numbers]
    gaps = {gap.after: gap.frames for gap in _follow(clock) if gap.kind == "frames missing"}
    told, missing = np.array([gaps.get(ticks, 0) for ticks in clock[:-1]]), np.diff(numbers) - 1
    assert (np.abs(told - missing) <= np.maximum(0.01 * missing, 0.1)).all()
    assert (missing >= 100).sum() == len(pauses)


_RATE = 271.0
_BASE = 5_000_000_000_000


def _arrive(rng, seconds, *, drift, start=0, pauses=()):
    """Times at which frames are taken [s], their ticks, and their arrival [ns].

    Delays are exponential with mean 2 ms, with stops of the host of up to 0.3 s in which frames wait.
    """
    taken = np.arange(0, seconds, 1 / _RATE)
    for first, last in pauses:
        taken = taken[(taken < first) | (taken >= last)]
    ticks = (start + np.floor(taken * (1 + drift) * 1000).astype(np.int64)) % 2**32
    arrival = taken + 3e-4 + rng.exponential(2e-3, taken.size)
    for stop in np.arange(2.5, seconds, 7.0):
        late = (arrival > stop) & (arrival < stop + rng.uniform(0.05, 0.3))
        if late.any():
            arrival[late] = arrival[late].max()
    return taken, ticks, _BASE + np.round(np.maximum.accumulate(arrival) * 1e9).astype(np.int64)


def _find_errors(clock, taken, ticks, arrival):
    """Errors of the stamps [s], without the constant part of the delay, which no fit can find."""
    stamps = np.array([clock.stamp(*each) for each in zip(ticks.tolist(), arrival.tolist(), strict=True)])
    assert (np.diff(stamps) > 0).all()
    errors = (stamps - _BASE) * 1e-9 - taken
    return errors - np.median(errors)


@pytest.mark.parametrize(
    "drift",
    [
        pytest.param(0.0, marks=pytest.mark.slow),
        pytest.param(1e-4, marks=pytest.mark.slow),
        pytest.param(-1e-4, marks=pytest.mark.slow),
        pytest.param(3e-3, marks=pytest.mark.slow),
        -3e-3,
    ],
)
def test_stamps_follow_the_device_within_two_milliseconds(drift):
    rng = np.random.default_rng(1)
    clock = DeviceClock()
    taken, ticks, arrival = _arrive(rng, 60, drift=drift, start=2**32 - 20_000, pauses=[(20, 23)])
    errors = _find_errors(clock, taken, ticks, arrival)
    assert np.quantile(np.abs(errors), 0.95) < 2e-3
    late = (arrival - _BASE) * 1e-9 - taken
    assert np.quantile(np.abs(late - np.median(late)), 0.95) > 5e-3  # the arrivals alone are far worse
    residual = clock.residual
    assert residual.unfitted == residual.restarts == 0
    assert residual.p95 == pytest.approx(np.quantile(late, 0.95), abs=1.5e-3)
    assert residual.largest == pytest.approx(late.max(), abs=5e-3)
    assert residual.tick == pytest.approx(1e-3 / (1 + drift), rel=5e-5)
    assert "which follow the device's clock" in str(residual)


def _start_again(ticks):
    half = len(ticks) // 2
    ticks[half:] -= ticks[half]


@pytest.mark.parametrize(
    ("damage", "counted", "text"),
    [
        (lambda ticks: np.put(ticks, [900, 1800, 1801], [7, 2**31, 4_000_000]), (3, 0), "3 frames did not fit"),
        (_start_again, (2, 1), "set anew 1 times"),
    ],
)
def test_wrong_times_of_the_device_change_few_stamps(damage, counted, text):
    taken, ticks, arrival = _arrive(np.random.default_rng(3), 20, drift=1e-4)
    damage(ticks)
    clock = DeviceClock()
    errors = _find_errors(clock, taken, ticks, arrival)
    assert np.quantile(np.abs(errors), 0.95) < 2e-3
    assert (clock.residual.unfitted, clock.residual.restarts) == counted
    assert text in str(clock.residual)


def test_a_clock_with_another_tick_is_told():
    """The unit of the clock is assumed: 1 ms.  Stamps must stay near the arrivals if it is another one."""
    arrival = _BASE + np.arange(2000) * 3_690_000
    for factor in (0.1, 10.0):
        clock = DeviceClock()
        stamps = [clock.stamp(int(n * 3.69 * factor), each) for n, each in enumerate(arrival.tolist())]
        assert np.abs(np.array(stamps) - arrival).max() < 2.1e9
        assert f"a tick of the device lasts {1 / factor:.3g} ms, not 1 ms" in str(clock.residual)


def test_frames_with_a_clock_that_stands_are_stamped():
    clock = DeviceClock()
    stamps = [clock.stamp(5, _BASE + n * 1_000_000_000) for n in range(20)]
    assert (np.diff(stamps) > 0).all()
    assert np.isnan(DeviceClock().residual.p95)
