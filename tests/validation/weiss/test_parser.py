"""The parser on intact, damaged and endless streams."""

from dataclasses import replace
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss import continuity
from validation.weiss.continuity import Continuity
from validation.weiss.parser import Parser
from validation.weiss.protocol import PREAMBLE, decode_frame, encode_frame, encode_message
from validation.weiss.virtual import FAULTS

TEXELS = 24
FRAMES = 14


def _make_stream(random):
    """Messages of a stream at 271 frames/s, by the clock of their frames [ms]."""
    start = random.choice((0, 1000, 2**32 - 20))
    frames = {}
    for number in range(FRAMES):
        ticks = (start + round(number * 1000 / 271)) % 2**32
        counts = [random.randrange(4096) for _ in range(TEXELS)] if random.random() < 0.5 else [0] * TEXELS
        frames[ticks] = encode_message(0x00, encode_frame(ticks, counts, run_length=random.random() < 0.5))
    return frames


_STREAMS = [_make_stream(Random(seed)) for seed in range(200)]  # noqa: S311 -- reproducible, no secret


def _cut_into_pieces(stream, random):
    position = 0
    while position < len(stream):
        size = random.choice((1, 7, 64, 300, 5000))
        yield stream[position : position + size]
        position += size


def _parse(stream, random):
    parser = Parser(texels=TEXELS)
    messages = []
    for piece in _cut_into_pieces(stream, random):
        messages += parser.feed(piece)
    return messages + parser.finish(), parser


def _fuzz(number, tally):
    """Damage one to three inner messages of a stream, parse it, and return a fault of the parser, or None."""
    random = Random(number)  # noqa: S311 -- reproducible, no secret
    sent = random.choice(_STREAMS)
    order = list(sent)
    damaged = {}
    for place in random.sample(range(3, FRAMES - 3), random.randint(1, 3)):
        name = random.choice(list(FAULTS))
        damaged[order[place]] = FAULTS[name](sent[order[place]], random)
        tally[name] = tally.get(name, 0) + 1
    stream = b"".join(damaged.get(ticks, sent[ticks]) for ticks in order)
    messages, parser = _parse(stream, random)
    assert parser.pending == 0

    continuity, marked, seen = Continuity(), set(), []
    for message in messages:
        if message.identifier != 0x00:
            return f"a message {message.identifier:#x} that was not sent"
        frame = decode_frame(message.payload)
        if sent.get(frame.ticks) != encode_message(0x00, message.payload):
            return "a frame that was not sent"
        seen.append(frame.ticks)
        marked |= {gap.after for gap in continuity.add(frame.ticks, skipped=message.skipped, host_time=0)}
    marked |= {gap.after for gap in continuity.finish()}
    for before, after in pairwise(seen):
        if order.index(after) - order.index(before) != 1 and before not in marked:
            return f"a gap after {before} that was not marked"
    lost = [ticks for ticks in order if ticks not in damaged and ticks not in seen]
    if len(lost) > 2 * len(damaged):
        return f"{len(lost)} intact frames lost"
    tally["intact lost"] = tally.get("intact lost", 0) + len(lost)
    return None


def _fuzz_streams(streams):
    tally, wrong = {}, {}
    for number in streams:
        fault = _fuzz(number, tally)
        if fault:
            wrong[number] = fault
    return tally, wrong


def test_damage_never_gives_false_frames_nor_hidden_gaps():
    tally, wrong = _fuzz_streams(range(2000))
    assert not wrong
    assert min(tally[name] for name in FAULTS) > 100
    assert tally["intact lost"] == 0


@pytest.mark.slow
def test_damage_of_100_000_streams_never_gives_false_frames_nor_hidden_gaps():
    tally, wrong = _fuzz_streams(range(100_000))
    assert not wrong
    assert tally["intact lost"] == 0


def test_the_fuzzer_notices_a_parser_that_trusts_heads(monkeypatch):
    monkeypatch.setattr("validation.weiss.parser.compute_checksum", lambda data: 0)
    _, wrong = _fuzz_streams(range(300))
    assert wrong


def test_the_fuzzer_notices_unmarked_gaps(monkeypatch):
    monkeypatch.setattr(continuity, "_RULES", replace(continuity._RULES, long_step=100))
    _, wrong = _fuzz_streams(range(300))
    assert any("not marked" in fault for fault in wrong.values())


@given(st.randoms(use_true_random=False))
def test_messages_do_not_depend_on_how_the_stream_is_cut(random):
    stream = b"".join(random.choice(_STREAMS).values())
    at_once = Parser(texels=TEXELS).feed(stream)
    assert _parse(stream, random)[0] == at_once
    assert len(at_once) == FRAMES


@given(st.binary(max_size=600))
def test_messages_found_in_noise_stand_in_it_byte_for_byte(noise):
    parser = Parser()
    for message in parser.feed(noise) + parser.finish():
        assert encode_message(message.identifier, message.payload) in noise
    counters = parser.counters
    assert counters.bytes_seen == len(noise)
    assert counters.skipped <= len(noise)


@given(st.randoms(use_true_random=False), st.sampled_from(sorted(FAULTS)), st.integers(1, FRAMES - 1))
def test_after_a_fault_every_intact_frame_is_found(random, fault, place):
    sent = list(random.choice(_STREAMS).values())
    arrived = [FAULTS[fault](message, random) if number == place else message for number, message in enumerate(sent)]
    found = [encode_message(message.identifier, message.payload) for message in _parse(b"".join(arrived), random)[0]]
    intact = [message for number, message in enumerate(sent) if number != place]
    assert [message for message in found if message != sent[place]] == intact


def test_more_than_three_aa_in_a_row_are_skipped():
    identifiers = [0x22, 0x30, 0x46, 0x50]
    messages = Parser().feed(b"".join(b"\xaa" * n + encode_message(name) for n, name in enumerate(identifiers)))
    assert [message.identifier for message in messages] == identifiers
    assert [message.skipped for message in messages] == [0, 1, 2, 3]


def test_a_preamble_inside_a_frame_is_not_a_head():
    ten_times_2730 = encode_frame(0x00AAAAAA, [2730] * 20, run_length=True)
    assert PREAMBLE in ten_times_2730
    stream = encode_message(0x00, ten_times_2730) * 3
    assert len(Parser(texels=20).feed(stream)) == 3
    assert len(Parser(texels=20).feed(stream[5:])) == 2


def test_finish_ends_the_wait_for_a_payload_that_never_comes():
    parser = Parser(texels=TEXELS)
    message = encode_message(0x22, b"\0\0")
    assert parser.feed(PREAMBLE + b"\x00\x3c\x00" + message) == []
    assert [message.identifier for message in parser.finish()] == [0x22]
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
