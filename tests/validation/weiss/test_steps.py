"""Gaps and stamps of streams of a few frames, computed by hand at and beside each rule."""

import numpy as np
import pytest

from validation.weiss.stream import Continuity, DeviceClock, Gap, Residual

MS = 10**6
HALF = 2**31


def follow(clock, skipped=None):
    """Gaps by the number of the frame at which they become known; at the end, None."""
    continuity, found = Continuity(), []
    for number, ticks in enumerate(clock):
        gaps = continuity.add(ticks, skipped=(skipped or {}).get(number, 0), host_time=100 + number)
        found += [(number, gap) for gap in gaps]
    return found + [(None, gap) for gap in continuity.finish()]


def tell(clock, skipped=None):
    return [(number, gap.kind, gap.frames) for number, gap in follow(clock, skipped)]


def march(*steps, start=0):
    return [start, *(start + np.cumsum(steps)).tolist()]


@pytest.mark.parametrize(
    ("gap", "text", "step"),
    [
        (Gap(kind="silence", host_time=0), "silence", 0),
        (Gap(kind="silence", host_time=0, after=0, seconds=1.256), "silence, after tick 0, 1.26 s", 0),
        (Gap(kind="overflow", host_time=0, before=9, skipped=3, frames=2), "overflow, 2 frames, 3 bytes", 0),
        (Gap(kind="frames missing", host_time=0, after=7, before=19), "frames missing, after tick 7", 12),
        (
            Gap(kind="frames missing", host_time=0, after=2**32 - 3, before=5),
            "frames missing, after tick 4294967293",
            8,
        ),
    ],
)
def test_a_gap_states_what_is_known(gap, text, step):
    assert (str(gap), gap.step) == (text, step)


@pytest.mark.parametrize(
    ("period", "known"),  # steps until 8 steps and 250 ticks have passed
    [(100, 8), (32, 8), (31, 9), (25, 10), (26, 10), (24, 11), (10, 25)],
)
def test_the_period_is_known_after_eight_steps_and_250_ticks(period, known):
    """The second frame comes after a lost one, which is told when the period is known."""
    clock = march(2 * period, *[period] * 40)
    assert tell(clock) == [(known + 1, "frames missing", 1)]
    (gap,) = (gap for _, gap in follow(clock))
    assert (gap.after, gap.before, gap.host_time, gap.skipped) == (0, 2 * period, 101, 0)


def test_after_512_pairs_one_step_is_enough():
    repeated = [0, 4, *[4] * 511]
    assert tell(repeated) == [(512, "frame repeated", 0)] * 511
    assert {number for number, *_ in tell([0, 4, *[4] * 510])} == {None}


LEARNT = [10] * 25


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        ([15], []),
        ([16], [(26, "frames missing", 1)]),
        ([24], [(26, "frames missing", 1)]),
        ([26], [(26, "frames missing", 2)]),
        ([76, 15], [(26, "frames missing", 7), (27, "frames missing", 1)]),  # 8 frames: a period of 326 / 33 = 9.9
        ([86, 15], [(26, "frames missing", 8)]),  # 9 frames leave the period as it was
        ([84, 15], [(26, "frames missing", 7)]),  # a period of 334 / 33 = 10.1
        ([0], [(26, "frame repeated", 0)]),
        ([HALF], [(26, "clock set back", 0)]),
        ([HALF - 1], [(26, "frames missing", round((HALF - 1) / 10) - 1)]),
        ([4] * 5 + [16], [(31, "frames missing", 1)]),  # 0.4 of a period is no frame
    ],
)
def test_gaps_after_the_period_is_known(steps, told):
    assert tell(march(*LEARNT, *steps)) == told


@pytest.mark.parametrize(("count", "told"), [(255, True), (256, False), (257, False)])
def test_the_period_is_the_mean_of_the_last_256_steps(count, told):
    """A step of 21 is one and a half of 14, and more of (10 + 255 x 14) / 256."""
    assert bool(tell(march(*[10] * 300, *[14] * count, 21))) == told


def test_the_first_eighth_of_the_steps_may_be_too_short():
    assert tell(march(10, *[20] * 8)) == []
    assert [each[1:] for each in tell(march(10, *[20] * 6))] == [("frames missing", 1)] * 6  # seven steps: the first
    assert tell(march(10, 10, *[20] * 8))[0][1:] == ("frames missing", 1)  # ten steps, of which two are short
    assert tell(march(*[20] * 8, 30)) == []
    assert [each[1:] for each in tell(march(*[20] * 8, 31))] == [("frames missing", 1)]


def test_bytes_before_the_first_frame_and_between_frames_are_told():
    found = follow(march(*LEARNT, 10, 10), {0: 5, 3: 6, 26: 7})
    assert [(number, gap.kind, gap.after, gap.before, gap.skipped) for number, gap in found] == [
        (0, "bytes skipped", None, 0, 5), (25, "bytes skipped", 20, 30, 6), (26, "bytes skipped", 250, 260, 7),
    ]  # fmt: skip
    assert tell([7]) == []
    assert tell([]) == []


def test_a_stream_that_ended_starts_to_learn_again_only_without_a_step():
    continuity = Continuity()
    continuity.add(5, skipped=0, host_time=0)
    assert continuity.finish() == []
    continuity.add(15, skipped=0, host_time=0)
    assert continuity.finish() == []
    (gap,) = continuity.add(35, skipped=0, host_time=0)  # one step of 10 is known now
    assert (gap.kind, gap.frames) == ("frames missing", 1)


# Stamps: ticks of 1 ms, arrivals in ms after a start.

START = 7 * 10**12


def stamp(*frames, ticks=100):
    """Stamps in ms after the start, and the clock."""
    clock = DeviceClock()
    return [(clock.stamp(ticks + each, START + round(at * MS)) - START) / MS for each, at in frames], clock


@pytest.mark.parametrize(
    ("frames", "stamps"),
    [
        ([(0, 0), (4, 10), (8, 9)], [0, 4, 8]),
        ([(0, 0), (4, 1), (8, 8)], [0, 1, 5]),  # one came 3 ms before: the others were late
        ([(0, 0), (4, 4), (4, 6)], [0, 4, 4.001]),  # a microsecond after the last
        ([(0, 0), (4, 4), (3, 6)], [0, 4, 4.001]),
        ([(0, 0), (4, 2004)], [0, 4]),
        ([(0, 0), (4, 2004.001), (8, 9)], [0, 2004.001, 2004.002]),
        ([(0, 0), (2004, 4)], [0, 4]),
        ([(0, 0), (2010, 4), (2020, 14)], [0, 4, 14]),  # 2.006 s too early: its clock is wrong
    ],
)
def test_a_stamp_is_the_time_of_the_device_after_the_earliest_arrival(frames, stamps):
    assert stamp(*frames)[0] == pytest.approx(stamps, abs=2e-6)
    assert stamp(*frames, ticks=2**32 - 2)[0][:1] == [0]


def test_ticks_begin_again_after_32_bits():
    clock = DeviceClock()
    stamps = [clock.stamp((2**32 - 2 + each) % 2**32, START + (each + 1) * MS) for each in (0, 4, 9)]
    assert [(each - stamps[0]) / MS for each in stamps] == pytest.approx([0, 4, 9])


def test_the_delays_of_frames_are_counted():
    frames = [(0, 0), (10, 11), (20, 24), (30, 39), (40, 60)]
    _, clock = stamp(*frames)
    found, delays = clock.residual, np.array([0, 1, 4, 9, 20]) * 1e-3
    assert (found.median, found.p95, found.largest) == pytest.approx(np.percentile(delays, [50, 95, 100]))
    assert (found.tick, found.unfitted, found.restarts) == (1e-3, 0, 0)


def test_the_third_frame_outside_starts_the_clock_anew():
    wrong = [(50_000, 20), (50_010, 30), (50_020, 45), (50_030, 50)]
    stamps, clock = stamp((0, 0), (10, 10), *wrong)
    assert stamps == pytest.approx([0, 10, 20, 30, 45, 50])
    assert (clock.residual.unfitted, clock.residual.restarts) == (2, 1)
    assert stamp((0, 0), (10, 10), *wrong, (50_050, 80))[0][-1] == pytest.approx(70)  # 50 + 20 ticks
    stamps, clock = stamp((0, 0), *wrong[:2], (35, 35), *[(each, at + 10) for each, at in wrong[2:]])
    assert (clock.residual.unfitted, clock.residual.restarts) == (4, 0)


@pytest.mark.parametrize(("count", "tick"), [(4, 1e-3), (5, 1.005e-3), (9, 1.005e-3)])
def test_a_tick_is_fitted_from_four_half_seconds(count, tick):
    _, clock = stamp(*[(500 * number, 502.5 * number) for number in range(count)])
    assert clock.residual.tick == pytest.approx(tick, rel=1e-9)


@pytest.mark.parametrize(
    ("tick", "words"),
    [(1.0049, "which follow the device's clock with 1.004900 ms per tick"), (0.9951, "with 0.995100 ms per tick"),
     (1.0149, "which may be wrong: a tick of the device lasts 1.01 ms, not 1 ms"), (0.985, "lasts 0.985 ms, not 1 ms")],
)  # fmt: skip
def test_a_tick_that_differs_by_more_than_a_percent_is_told(tick, words):
    stamps, clock = stamp(*[(250 * number, 250 * tick * number) for number in range(40)])
    assert clock.residual.tick == pytest.approx(1e-3 * tick)
    assert words in str(clock.residual)
    assert (abs(stamps[-1] - 250 * 39 * tick) > 1e-3) == (tick > 1.01)  # the slope of a stamp is at most 1 %


@pytest.mark.parametrize(("frames", "shift"), [(122, -300), (123, 0)])
def test_the_last_120_half_seconds_are_fitted(frames, shift):
    """The second frame came 300 ms before the others; the last frame lies 120 or 121 blocks after it."""
    stamps, _ = stamp(*[(500 * number, 500 * number + 0.1 - 300 * (number == 1)) for number in range(frames)])
    assert stamps[-1] == pytest.approx(500 * (frames - 1) + 0.1 + shift, abs=0.01)


def test_delays_are_told_in_milliseconds():
    text = str(Residual(1.25e-3, 2.5e-3, 10.04e-3, 1.001e-3, 0, 0))
    assert text == (
        "frames arrived 1.2 ms (median), 2.5 ms (95 %) and at most 10.0 ms after their stamps, which follow the "
        "device's clock with 1.001000 ms per tick"
    )
    odd = str(Residual(1e-3, 2e-3, 3e-3, 2e-3, 4, 5))
    assert odd.endswith(
        "which may be wrong: a tick of the device lasts 2 ms, not 1 ms; 4 frames did not fit and are stamped by their "
        "arrival; the clock was set anew 5 times"
    )
