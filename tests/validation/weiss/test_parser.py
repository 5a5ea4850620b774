"""The parser and the gap finder on whole, damaged and endless streams."""

from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.continuity import Continuity
from validation.weiss.faults import FAULTS
from validation.weiss.frames import decode_frame, encode_frame
from validation.weiss.messages import PREAMBLE, encode
from validation.weiss.parser import Parser

TEXELS = 24
FRAMES = 14


def _frames(random):
    """Messages of a stream at 271 frames/s whose clock ticks in ms, by clock."""
    start = random.choice((0, 1000, 2**32 - 20))
    frames = {}
    for number in range(FRAMES):
        ticks = (start + round(number * 1000 / 271)) % 2**32
        counts = [random.randrange(4096) for _ in range(TEXELS)] if random.random() < 0.5 else [0] * TEXELS
        frames[ticks] = encode(0x00, encode_frame(ticks, counts, run_length=random.random() < 0.5))
    return frames


_POOL = [_frames(Random(seed)) for seed in range(200)]  # noqa: S311 -- reproducible, no secret


def _pieces(stream, random):
    position = 0
    while position < len(stream):
        size = random.choice((1, 7, 64, 300, 5000))
        yield stream[position : position + size]
        position += size


def _received(stream, random):
    parser = Parser(texels=TEXELS)
    messages = []
    for piece in _pieces(stream, random):
        messages += parser.feed(piece)
    return messages + parser.finish(), parser


def _fuzz(number, tally):
    """One stream: sound at both ends, one to three faults between; returns what must never happen."""
    random = Random(number)  # noqa: S311 -- reproducible, no secret
    sent = random.choice(_POOL)
    order = list(sent)
    damaged = {}
    for place in random.sample(range(3, FRAMES - 3), random.randint(1, 3)):
        name = random.choice(list(FAULTS))
        damaged[order[place]] = FAULTS[name](sent[order[place]], random)
        tally[name] = tally.get(name, 0) + 1
    stream = b"".join(damaged.get(ticks, sent[ticks]) for ticks in order)
    messages, parser = _received(stream, random)
    assert parser.pending == 0

    continuity, flagged, seen = Continuity(), set(), []
    for message in messages:
        assert message.identifier in (0x00, 0x20) or message.identifier not in sent
        if message.identifier != 0x00:
            return f"a message {message.identifier:#x} that nobody sent"
        frame = decode_frame(message.payload)
        if sent.get(frame.ticks) != encode(0x00, message.payload):
            return "a frame that nobody sent"
        seen.append(frame.ticks)
        flagged |= {gap.after for gap in continuity.next(frame.ticks, skipped=message.skipped, host_time=0)}
    flagged |= {gap.after for gap in continuity.finish()}
    for before, after in pairwise(seen):
        if order.index(after) - order.index(before) != 1 and before not in flagged:
            return f"a gap after {before} that was not marked"
    lost = [ticks for ticks in order if ticks not in damaged and ticks not in seen]
    if len(lost) > 2 * len(damaged):
        return f"{len(lost)} intact frames lost"
    tally["intact lost"] = tally.get("intact lost", 0) + len(lost)
    return None


def _run(streams):
    tally, wrong = {}, {}
    for number in streams:
        what = _fuzz(number, tally)
        if what:
            wrong[number] = what
    return tally, wrong


def test_fuzzed_streams():
    tally, wrong = _run(range(2000))
    assert not wrong
    assert min(tally[name] for name in FAULTS) > 100
    assert tally["intact lost"] == 0


@pytest.mark.slow
def test_fuzzed_streams_in_full():
    tally, wrong = _run(range(100_000))
    assert not wrong
    assert tally["intact lost"] == 0


def test_the_fuzzer_notices_a_parser_that_trusts_heads(monkeypatch):
    monkeypatch.setattr("validation.weiss.parser.checksum", lambda data: 0)
    _, wrong = _run(range(300))
    assert wrong


def test_the_fuzzer_notices_unmarked_gaps(monkeypatch):
    monkeypatch.setattr("validation.weiss.continuity._LONG", 100)
    _, wrong = _run(range(300))
    assert any("not marked" in what for what in wrong.values())


@given(st.randoms(use_true_random=False))
def test_pieces_do_not_matter(random):
    stream = b"".join(random.choice(_POOL).values())
    whole = Parser(texels=TEXELS).feed(stream)
    assert _received(stream, random)[0] == whole
    assert len(whole) == FRAMES


@given(st.binary(max_size=600))
def test_noise_neither_raises_nor_passes_unchecked(noise):
    parser = Parser()
    for message in parser.feed(noise) + parser.finish():
        assert encode(message.identifier, message.payload) in noise
    counters = parser.counters
    assert counters.bytes_seen == len(noise)
    assert counters.skipped <= len(noise)


def test_more_than_three_aa_in_a_row():
    stream = encode(0x22) + b"\xaa" + encode(0x30) + b"\xaa\xaa" + encode(0x46) + b"\xaa\xaa\xaa" + encode(0x50)
    messages = Parser().feed(stream)
    assert [m.identifier for m in messages] == [0x22, 0x30, 0x46, 0x50]
    assert [m.skipped for m in messages] == [0, 1, 2, 3]


def test_preambles_inside_frames_do_no_harm():
    ten_times_2730 = encode_frame(0x00AAAAAA, [2730] * 20, run_length=True)
    assert PREAMBLE in ten_times_2730
    stream = encode(0x00, ten_times_2730) * 3
    assert len(Parser(texels=20).feed(stream)) == 3
    assert len(Parser(texels=20).feed(stream[5:])) == 2


def test_a_frame_before_the_answer_to_stop():
    frame = encode(0x00, encode_frame(5, [1] * TEXELS))
    messages = Parser(texels=TEXELS).feed(frame + encode(0x22, b"\0\0") + frame)
    assert [m.identifier for m in messages] == [0x00, 0x22, 0x00]


def test_a_promise_that_is_not_kept_is_given_up():
    parser = Parser(texels=TEXELS)
    message = encode(0x22, b"\0\0")
    assert parser.feed(PREAMBLE + b"\x00\x3c\x00" + message) == []
    assert [m.identifier for m in parser.finish()] == [0x22]
    assert parser.counters.skipped == 6


@pytest.mark.parametrize("kind", ["noise", "preambles", "heads"])
def test_memory_is_bounded_under_endless_garbage(kind):
    random = Random(1)  # noqa: S311 -- reproducible, no secret
    parser = Parser()
    pieces = {
        "noise": lambda: random.randbytes(4096),
        "preambles": lambda: b"\xaa" * 4096,
        "heads": lambda: (PREAMBLE + b"\x00\x20\x03") * 40,
    }
    for _ in range(50):
        parser.feed(pieces[kind]())
        assert parser.pending <= parser.largest_payload + 8
    assert parser.counters.messages == 0


def test_clock_wraps_and_steps_are_judged_from_the_start():
    continuity, gaps = Continuity(), []
    clock = [(2**32 - 10 + round(n * 3.69)) % 2**32 for n in range(30) if n not in (2, 20, 21)]
    for ticks in clock:
        gaps += continuity.next(ticks, skipped=0, host_time=0)
    gaps += continuity.finish()
    assert [(gap.kind, gap.frames) for gap in gaps] == [("frames missing", 1), ("frames missing", 2)]


@pytest.mark.parametrize("lost", [0.05, 0.2])
def test_many_frames_lost_from_the_start_are_not_taken_for_a_slow_stream(lost):
    unmarked = false = missing = 0
    for seed in range(300):
        random, continuity = Random(seed), Continuity()  # noqa: S311 -- reproducible, no secret
        sent = {int(number * 1000 / 271): number for number in range(60)}
        came = [ticks for ticks in sent if random.random() >= lost]
        marked = {gap.after for ticks in came for gap in continuity.next(ticks, skipped=0, host_time=0)}
        marked |= {gap.after for gap in continuity.finish()}
        whole = {before for before, after in pairwise(came) if sent[after] - sent[before] == 1}
        missing += len(came) - 1 - len(whole)
        unmarked += len(set(came[:-1]) - whole - marked)
        false += len(whole & marked)
    assert missing > 500
    assert (unmarked, false) == (0, 0)


def test_a_slow_stream_has_no_gaps():
    continuity = Continuity()
    gaps = [gap for n in range(40) for gap in continuity.next(n * 100 + n % 3, skipped=0, host_time=0)]
    assert gaps == []


def test_counts_stay_what_they_are():
    counts = np.arange(TEXELS) * 7
    (message,) = Parser(texels=TEXELS).feed(encode(0x00, encode_frame(1, counts)))
    assert decode_frame(message.payload).counts.tolist() == counts.tolist()
