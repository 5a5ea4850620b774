"""Messages, commands and frames as bytes, and the parser on intact, damaged and endless streams."""

from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.support.virtual_port import hit
from validation.weiss import protocol
from validation.weiss.protocol import PREAMBLE, Command, MatrixInfo, Parser, Status, encode_frame, encode_message
from validation.weiss.stream import Continuity
from validation.weiss.virtual import FAULTS

PUBLISHED = {
    "AA AA AA 01 02 00 12 34 6D 66": encode_message(0x01, b"\x12\x34"),
    "AA AA AA 01 00 00 E8 10": encode_message(0x01),
    "AA AA AA 06 00 00 97 26": protocol.encode_request(Command.LOOP),
    "AA AA AA 20 01 00 00 8F 83": protocol.encode_request(Command.READ_SINGLE_FRAME, 0),
    "AA AA AA 20 01 00 01 AE 93": protocol.encode_request(Command.READ_SINGLE_FRAME, 1),
    "AA AA AA 21 03 00 00 00 00 F5 5C": protocol.encode_request(Command.START_PERIODIC_FRAMES, 0, 0),
    "AA AA AA 21 03 00 01 00 00 57 36": protocol.encode_request(Command.START_PERIODIC_FRAMES, 1, 0),
    "AA AA AA 22 00 00 0E 76": protocol.encode_request(Command.STOP_PERIODIC_FRAMES),
    "AA AA AA 30 00 00 CA CF": protocol.encode_request(Command.MATRIX_INFO),
    "AA AA AA 38 00 00 EA CF": protocol.encode_request(Command.SENSOR_TYPE),
    "AA AA AA 46 00 00 86 B7": protocol.encode_request(Command.TEMPERATURE),
    "AA AA AA 50 00 00 DB 87": protocol.encode_request(Command.SYSTEM_INFO),
    "AA AA AA 52 00 00 9F 52": protocol.encode_request(Command.GET_TAG),
    "AA AA AA 35 00 00 F1 2C": protocol.encode_request(Command.GET_THRESHOLD),
    "AA AA AA 37 00 00 B5 F9": protocol.encode_request(Command.GET_GAIN),
}
#: Identifiers of messages that hold no frame: of these a parser accepts any payload.
IDENTIFIERS = st.integers(0, 255).filter(lambda identifier: identifier not in (0x00, 0x20, 0xAA))
#: Values that fit each layout.
VALUES = {
    "": (),
    "<B": (3,),
    "<H": (500,),
    "<BH": (1, 10),
    "<5H": (6, 14, 340, 340, 4095),
    "<h": (-12,),
    "<BBHI": (1, 2, 0x1234, 99),
    None: (b"abc",),
}


def _parse(*pieces, texels=None):
    parser = Parser(texels=texels)
    return [message for piece in pieces for message in parser.feed(piece)] + parser.finish()


@pytest.mark.parametrize(("expected", "made"), PUBLISHED.items())
def test_messages_equal_the_published_examples(expected, made):
    assert made == bytes.fromhex(expected)
    assert protocol.compute_checksum(made) == 0


def test_checksums_equal_the_published_values():
    assert protocol.compute_checksum(PREAMBLE) == 0x50F5
    assert protocol.compute_checksum(b"123456789") == 0x6EB4


@pytest.mark.parametrize("command", Command)
def test_requests_and_answers_of_every_command_come_back(command):
    # the parser accepts only a possible frame as the answer to `read single frame`
    asked, answered = VALUES[command.request], VALUES[command.answer]
    answered = (encode_frame(5, [1, 2, 3]),) if command == Command.READ_SINGLE_FRAME else answered
    assert protocol.decode_request(command, protocol.encode_request(command, *asked)[6:-2]) == asked
    for status, expected in ((Status.SUCCESS, answered), (Status.ACCESS_DENIED, ())):
        (message,) = _parse(protocol.encode_answer(command, status, *answered))
        assert message.identifier == command
        assert protocol.decode_answer(command, message.payload) == (status, expected)


@given(st.tuples(*[st.integers(1, 65535)] * 5))
def test_any_description_of_an_array_comes_back(values):
    info = MatrixInfo.from_values(values)
    assert (info.cell_width, info.cell_height) == (values[2] / 100_000, values[3] / 100_000)
    assert info.values == values


def test_versions_and_statuses_are_told_in_words():
    found = protocol.SystemInfo.from_values((1, 3, 0x12A3, 77))
    assert (found.kind, found.hardware_revision, found.firmware, found.serial_number) == (1, 3, "1.2.10.3", 77)
    assert protocol.describe_status(12) == "no parameter expected (12)"
    assert protocol.describe_status(99) == "unknown status (99)"


@given(st.binary(max_size=40), IDENTIFIERS, st.data())
def test_any_damage_within_one_byte_is_detected(payload, identifier, data):
    message = bytearray(encode_message(identifier, payload))
    place = data.draw(st.integers(0, len(message) - 1))
    message[place] ^= data.draw(st.integers(1, 255))
    assert protocol.compute_checksum(bytes(message)) != 0
    assert all(found.payload != payload for found in _parse(bytes(message)))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        *[(lambda name=name: encode_message(name), r"0\.\.255 and not 0xAA") for name in (0xAA, -1, 256)],
        (lambda: encode_message(1, bytes(65536)), "at most 65535 bytes, not 65536"),
        (lambda: protocol.encode_request(Command.SET_THRESHOLD, 70000), "layout"),
        (lambda: protocol.decode_answer(Command.MATRIX_INFO, b"\0"), "status"),
        (lambda: protocol.decode_answer(Command.MATRIX_INFO, b"\0\0\0"), "layout"),
        *[(lambda count=count: encode_frame(0, [count]), "4095") for count in (4096, -1)],
        (lambda: protocol.decode_frame(encode_frame(0, [1, 2, 3]), texels=4), "4 texels, not 3"),
        (lambda: protocol.decode_frame(b""), "frame"),
        (lambda: protocol.decode_frame(b"\0\0\0\0\0\0"), "frame"),  # half a texel
        (lambda: protocol.decode_frame(b"\0\0\0\0\x02" + b"\0\0"), "frame"),  # an unknown flag
        (lambda: protocol.decode_frame(b"\0\0\0\0\0" + b"\xff\x1f"), "bits"),  # 13 bits
        (lambda: protocol.decode_frame(b"\0\0\0\0\x01" + b"\x05\x00"), "frame"),  # a run of length 0
    ],
)
def test_impossible_messages_and_frames_are_refused(make, reason):
    with pytest.raises(ValueError, match=reason):
        make()


COUNTS = st.integers(0, 4095)
#: Images with long runs of equal counts, which a run-length unit cannot hold at once.
RUNS = st.lists(st.tuples(COUNTS, st.integers(1, 70)), max_size=8)


@given(values=st.lists(COUNTS, max_size=200), run_length=st.booleans(), ticks=st.integers(0, 2**32 - 1))
@example(values=[0, 4095], run_length=False, ticks=0)
@example(values=[4095, 4095], run_length=True, ticks=2**32 - 1)
def test_encoded_frames_come_back(values, run_length, ticks):
    frame = protocol.decode_frame(encode_frame(ticks, values, run_length=run_length), texels=len(values))
    assert frame.counts.tolist() == values
    assert (frame.ticks, frame.run_length) == (ticks, run_length)


@given(RUNS)
def test_long_runs_come_back_and_take_no_more_units_than_needed(runs):
    values = np.array([count for count, length in runs for _ in range(length)], dtype=np.uint16)
    packed = encode_frame(0, values, run_length=True)
    assert np.array_equal(protocol.decode_frame(packed).counts, values)
    changes = np.flatnonzero(np.diff(values)) + 1
    lengths = [part.size for part in np.split(values, changes)] if values.size else []
    assert len(packed) - 5 == 2 * sum(-(-length // 15) for length in lengths)


@given(st.binary(max_size=60))
def test_any_bytes_either_are_refused_or_are_a_possible_frame(payload):
    try:
        frame = protocol.decode_frame(payload)
    except ValueError:
        return
    assert frame.counts.max(initial=0) <= 4095
    again = protocol.decode_frame(encode_frame(frame.ticks, frame.counts, run_length=frame.run_length))
    assert np.array_equal(again.counts, frame.counts)


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


def _fuzz(number, tally):
    """Damage one to three inner messages of a stream, parse it, and return a fault of the parser, or None."""
    random = Random(number)  # noqa: S311 -- reproducible, no secret
    sent = random.choice(_STREAMS)
    order, damaged = list(sent), {}
    for place in random.sample(range(3, FRAMES - 3), random.randint(1, 3)):
        name = random.choice(list(FAULTS))
        damaged[order[place]] = hit(name, sent[order[place]], random)
        tally[name] = tally.get(name, 0) + 1
    stream = b"".join((sent | damaged).values())

    continuity, marked, seen = Continuity(), set(), []
    for message in _parse(*_cut_into_pieces(stream, random), texels=TEXELS):
        if message.identifier != 0x00:
            return f"a message {message.identifier:#x} that was not sent"
        frame = protocol.decode_frame(message.payload)
        if sent.get(frame.ticks, b"")[6:-2] != message.payload:
            return "a frame that was not sent"
        seen.append(frame.ticks)
        marked |= {gap.after for gap in continuity.add(frame.ticks, skipped=message.skipped, host_time=0)}
    marked |= {gap.after for gap in continuity.finish()}
    for before, after in pairwise(seen):
        if order.index(after) - order.index(before) != 1 and before not in marked:
            return f"a gap after {before} that was not marked"
    lost = [ticks for ticks in order if ticks not in damaged and ticks not in seen]
    return f"{len(lost)} intact frames lost" if lost else None


@pytest.mark.parametrize("count", [400, pytest.param(5_000, marks=pytest.mark.slow)])
def test_damage_never_gives_false_frames_nor_hidden_gaps_nor_costs_intact_frames(count):
    tally = {}
    assert not [fault for number in range(count) if (fault := _fuzz(number, tally))]
    assert min(tally[name] for name in FAULTS) > count / 12


def test_the_fuzzer_notices_a_parser_that_trusts_heads(monkeypatch):
    monkeypatch.setattr(protocol, "compute_checksum", lambda _: 0)
    assert any(_fuzz(number, {}) for number in range(150))


@given(st.randoms(use_true_random=False))
def test_messages_do_not_depend_on_how_the_stream_is_cut(random):
    stream = b"".join(random.choice(_STREAMS).values())
    at_once = _parse(stream, texels=TEXELS)
    assert _parse(*_cut_into_pieces(stream, random), texels=TEXELS) == at_once
    assert len(at_once) == FRAMES


@given(st.binary(max_size=600))
def test_messages_found_in_noise_stand_in_it_byte_for_byte(noise):
    assert all(encode_message(message.identifier, message.payload) in noise for message in _parse(noise))


def test_more_than_three_aa_in_a_row_are_skipped():
    identifiers = [0x22, 0x30, 0x46, 0x50]
    messages = _parse(b"".join(b"\xaa" * n + encode_message(name) for n, name in enumerate(identifiers)))
    assert [message.identifier for message in messages] == identifiers
    assert [message.skipped for message in messages] == [0, 1, 2, 3]


def test_a_preamble_inside_a_frame_is_not_a_head():
    ten_times_2730 = encode_frame(0x00AAAAAA, [2730] * 20, run_length=True)
    assert PREAMBLE in ten_times_2730
    stream = encode_message(0x00, ten_times_2730) * 3
    assert len(_parse(stream, texels=20)) == 3
    assert len(_parse(stream[5:], texels=20)) == 2


def test_finish_ends_the_wait_for_a_payload_that_never_comes():
    parser = Parser(texels=TEXELS)
    assert parser.feed(PREAMBLE + b"\x00\x3c\x00" + encode_message(0x22, b"\0\0")) == []
    assert [message.identifier for message in parser.finish()] == [0x22]
    assert parser.bytes_skipped == 6


@pytest.mark.parametrize("kind", ["noise", pytest.param("preambles", marks=pytest.mark.slow), "heads"])
def test_memory_is_bounded_under_endless_garbage(kind):
    noise = Random(1).randbytes(4096)  # noqa: S311 -- reproducible, no secret
    piece = {"noise": noise, "preambles": b"\xaa" * 4096, "heads": (PREAMBLE + b"\x00\x20\x03") * 40}[kind]
    parser = Parser()
    for _ in range(50):
        parser.feed(piece)
        assert len(parser._buffer) <= parser.largest_payload + 8
