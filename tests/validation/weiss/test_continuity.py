"""Gaps that are found from the clock of the device."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.continuity import Continuity
from validation.weiss.parser import Parser
from validation.weiss.protocol import Command, decode_frame, encode_request
from validation.weiss.virtual import Misbehaviour, VirtualSensor, show_pattern


def test_missing_frames_are_counted_from_the_start_and_across_the_wrap_of_the_clock():
    continuity, gaps = Continuity(), []
    clock = [(2**32 - 10 + round(n * 3.69)) % 2**32 for n in range(30) if n not in (2, 20, 21)]
    for ticks in clock:
        gaps += continuity.add(ticks, skipped=0, host_time=0)
    gaps += continuity.finish()
    assert [(gap.kind, gap.frames) for gap in gaps] == [("frames missing", 1), ("frames missing", 2)]


@pytest.mark.parametrize("lost", [0.05, 0.2])
def test_many_frames_lost_from_the_start_are_not_taken_for_a_slow_stream(lost):
    unmarked = false = missing = 0
    for seed in range(300):
        random, continuity = Random(seed), Continuity()  # noqa: S311 -- reproducible, no secret
        sent = {int(number * 1000 / 271): number for number in range(60)}
        came = [ticks for ticks in sent if random.random() >= lost]
        marked = {gap.after for ticks in came for gap in continuity.add(ticks, skipped=0, host_time=0)}
        marked |= {gap.after for gap in continuity.finish()}
        neighbours = {before for before, after in pairwise(came) if sent[after] - sent[before] == 1}
        missing += len(came) - 1 - len(neighbours)
        unmarked += len(set(came[:-1]) - neighbours - marked)
        false += len(neighbours & marked)
    assert missing > 500
    assert (unmarked, false) == (0, 0)


def test_a_slow_stream_with_jitter_has_no_gaps():
    continuity = Continuity()
    gaps = [gap for n in range(40) for gap in continuity.add(n * 100 + n % 3, skipped=0, host_time=0)]
    assert gaps == []


def _follow(clock, skipped=None):
    """Gaps of a stream of frames with these clocks, and bytes skipped before each."""
    continuity = Continuity()
    skipped = skipped or [0] * len(clock)
    pairs = zip(clock, skipped, strict=True)
    gaps = [gap for ticks, count in pairs for gap in continuity.add(ticks, skipped=count, host_time=0)]
    return gaps + continuity.finish()


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 100_000),
    st.lists(st.booleans(), max_size=100),
)
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


def test_repeated_frames_and_a_restarted_clock_are_named():
    clock = [1000 + 4 * number for number in range(20)]
    assert [gap.kind for gap in _follow([*clock, clock[-1]])] == ["frame repeated"]
    assert [gap.kind for gap in _follow([*clock, 3])] == ["clock set back"]


def test_a_gap_is_described_in_one_line():
    (gap,) = _follow([*range(0, 60, 4), 100], [0] * 15 + [7])
    assert str(gap) == "frames missing, after tick 56, 10 frames, 7 bytes"


@pytest.mark.parametrize("rate", [271.0, 30.0, 271.3, 500.0])
@pytest.mark.parametrize("lost", [0.0, 0.25])
def test_long_gaps_are_told_within_one_percent(rate, lost):
    """Pauses of any length, the first one after ten frames; the truth is the number of frames that were not sent."""
    random = Random(round(rate))  # noqa: S311 -- reproducible, no secret
    pauses = [(10, 813), (1000, 813), (2100, 100), (3000, 8000), (11_500, 1000)]
    numbers = [
        number
        for number in range(13_000)
        if not any(start <= number < start + length for start, length in pauses)
        and not (lost and random.random() < lost)
    ]
    clock = {int(123.4 + number * 1000 / rate): number for number in numbers}
    gaps = {gap.after: gap.frames for gap in _follow(list(clock)) if gap.kind == "frames missing"}
    long = 0
    for (before, number), (_, following) in pairwise(clock.items()):
        missing = following - number - 1
        assert gaps.get(before, 0) == pytest.approx(missing, abs=max(0.01 * missing, 0.1)), (before, missing)
        long += missing >= 100
    assert long == len(pauses)


def test_a_pause_at_271_frames_is_told_exactly_by_the_emulated_device():
    """Steps of 3 and 4 ticks have the mean 3.69; with their median a pause of 813 frames was told as 750."""
    sensor = VirtualSensor(show_pattern("zero"), misbehaviour=Misbehaviour(pauses=((1.0, 4.0),)))
    parser = Parser(texels=84)
    sensor.receive(encode_request(Command.START_PERIODIC_FRAMES, 0, 0), 0.0)
    frames = [parser.feed(data)[0] for data in sensor.take_due_frames(6.0)]
    (gap,) = _follow([decode_frame(frame.payload).ticks for frame in frames])
    assert gap.frames == pytest.approx(813, abs=1)
