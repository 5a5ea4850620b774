"""Messages, commands and frames: published examples, and what is sent comes back."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from validation.weiss.parser import Parser
from validation.weiss.protocol import (
    LAYOUTS,
    PREAMBLE,
    Command,
    Layout,
    MatrixInfo,
    Message,
    Status,
    compress,
    compute_checksum,
    decode_answer,
    decode_frame,
    decode_matrix_info,
    decode_request,
    decode_system_info,
    decode_temperature,
    describe_status,
    encode_answer,
    encode_frame,
    encode_matrix_info,
    encode_message,
    encode_request,
    encode_temperature,
)

PUBLISHED = {
    "AA AA AA 01 02 00 12 34 6D 66": encode_message(0x01, b"\x12\x34"),
    "AA AA AA 01 00 00 E8 10": encode_message(0x01),
    "AA AA AA 06 00 00 97 26": encode_request(Command.LOOP),
    "AA AA AA 20 01 00 00 8F 83": encode_request(Command.READ_SINGLE_FRAME, 0),
    "AA AA AA 20 01 00 01 AE 93": encode_request(Command.READ_SINGLE_FRAME, 1),
    "AA AA AA 21 03 00 00 00 00 F5 5C": encode_request(Command.START_PERIODIC_FRAMES, 0, 0),
    "AA AA AA 21 03 00 01 00 00 57 36": encode_request(Command.START_PERIODIC_FRAMES, 1, 0),
    "AA AA AA 22 00 00 0E 76": encode_request(Command.STOP_PERIODIC_FRAMES),
    "AA AA AA 30 00 00 CA CF": encode_request(Command.MATRIX_INFO),
    "AA AA AA 38 00 00 EA CF": encode_request(Command.SENSOR_TYPE),
    "AA AA AA 46 00 00 86 B7": encode_request(Command.TEMPERATURE),
    "AA AA AA 50 00 00 DB 87": encode_request(Command.SYSTEM_INFO),
    "AA AA AA 52 00 00 9F 52": encode_request(Command.GET_TAG),
    "AA AA AA 35 00 00 F1 2C": encode_request(Command.GET_THRESHOLD),
    "AA AA AA 37 00 00 B5 F9": encode_request(Command.GET_GAIN),
}
#: Identifiers of messages that hold no frame: of these a parser accepts any payload.
IDENTIFIERS = st.integers(0, 255).filter(lambda identifier: identifier not in (0x00, 0x20, 0xAA))


def _find_messages(data):
    parser = Parser()
    return parser.feed(data) + parser.finish()


@pytest.mark.parametrize(("expected", "made"), PUBLISHED.items())
def test_messages_equal_the_published_examples(expected, made):
    assert made == bytes.fromhex(expected)
    assert compute_checksum(made) == 0


def test_checksums_equal_the_published_values():
    assert compute_checksum(PREAMBLE) == 0x50F5
    assert compute_checksum(b"123456789") == 0x6EB4


@given(st.binary(max_size=60), st.integers(0, 60))
def test_a_checksum_can_be_continued_from_the_bytes_before(data, cut):
    assert compute_checksum(data[cut:], compute_checksum(data[:cut])) == compute_checksum(data)


@given(st.binary(max_size=200), IDENTIFIERS)
def test_encoded_messages_are_found_again(payload, identifier):
    (message,) = _find_messages(encode_message(identifier, payload))
    assert (message.identifier, message.payload, message.skipped) == (identifier, payload, 0)


@given(st.binary(max_size=40), IDENTIFIERS, st.data())
def test_any_damage_within_one_byte_is_detected(payload, identifier, data):
    message = bytearray(encode_message(identifier, payload))
    place = data.draw(st.integers(0, len(message) - 1))
    message[place] ^= data.draw(st.integers(1, 255))
    assert compute_checksum(bytes(message)) != 0
    assert all(found.payload != payload for found in _find_messages(bytes(message)))


def test_some_damage_of_two_bytes_keeps_the_checksum():
    """The reason why the parser checks the content of frames as well."""
    good = encode_message(0x06, b"\x00\x00\x00\x00")
    damaged = bytearray(good)
    damaged[7] ^= 0x89
    damaged[8] ^= 0xA1
    assert bytes(damaged) != good
    assert compute_checksum(bytes(damaged)) == 0


def test_impossible_messages_are_refused():
    for identifier in (0xAA, -1, 256):
        with pytest.raises(ValueError, match=r"0\.\.255 and not 0xAA"):
            encode_message(identifier)
    with pytest.raises(ValueError, match="at most 65535 bytes, not 65536"):
        encode_message(1, bytes(65536))


#: Values that fit each layout.
_VALUES = {
    "": (),
    "<B": (3,),
    "<H": (500,),
    "<BH": (1, 10),
    "<5H": (6, 14, 340, 340, 4095),
    "<h": (-12,),
    "<BBHI": (1, 2, 0x1234, 99),
    None: (b"abc",),
}


def _choose_values(command, layout):
    """Values that fit a layout; the parser accepts only a possible frame as the answer to `read single frame`."""
    if command == Command.READ_SINGLE_FRAME and layout is None:
        return (encode_frame(5, [1, 2, 3]),)
    return _VALUES[layout]


@pytest.mark.parametrize("command", LAYOUTS)
def test_requests_and_answers_of_every_command_come_back(command):
    layout: Layout = LAYOUTS[command]
    asked, answered = (_choose_values(command, part) for part in (layout.request, layout.answer))
    assert decode_request(Message(command, encode_request(command, *asked)[6:-2])) == (command, asked)
    assert decode_answer(*_find_messages(encode_answer(command, Status.SUCCESS, *answered))) == (0, answered)
    assert decode_answer(*_find_messages(encode_answer(command, Status.ACCESS_DENIED))) == (16, ())


def test_values_are_read_in_si_units():
    assert decode_system_info((1, 3, 0x1203, 77)).firmware == "1.2.0.3"
    assert decode_matrix_info((6, 14, 340, 340, 4095)).cell_width == pytest.approx(3.4e-3)
    assert decode_temperature((-125,)) == -12.5
    assert encode_temperature(-12.5) == (-125,)


@given(*[st.integers(1, 65535)] * 3, *[st.integers(1, 65535)] * 2)
def test_any_description_of_an_array_comes_back(columns, rows, full_scale, width, height):
    info = MatrixInfo(
        columns=columns, rows=rows, cell_width=width / 100_000, cell_height=height / 100_000, full_scale=full_scale
    )
    assert decode_matrix_info(encode_matrix_info(info)) == info
    assert info.texels == rows * columns


def test_a_status_is_described_in_words():
    assert describe_status(12) == "no parameter expected (12)"
    assert describe_status(99) == "unknown status (99)"


def test_misuse_is_refused_with_its_reason():
    with pytest.raises(ValueError, match="layout"):
        encode_request(Command.SET_THRESHOLD, 70000)
    with pytest.raises(KeyError, match="0x7f"):
        decode_answer(*_find_messages(encode_message(0x7F, b"\0\0")))
    with pytest.raises(KeyError, match="0x00"):
        decode_request(Message(Command.PERIODIC_FRAME, b""))
    with pytest.raises(ValueError, match="status"):
        decode_answer(*_find_messages(encode_message(0x30, b"\0")))
    with pytest.raises(ValueError, match="layout"):
        decode_answer(*_find_messages(encode_message(0x30, b"\0\0\0")))


COUNTS = st.integers(0, 4095)
#: Images with long runs of equal counts, which a run-length unit cannot hold at once.
RUNS = st.lists(st.tuples(COUNTS, st.integers(1, 70)), max_size=8)


@given(values=st.lists(COUNTS, max_size=200), run_length=st.booleans(), ticks=st.integers(0, 2**32 - 1))
@example(values=[0, 4095], run_length=False, ticks=0)
@example(values=[4095, 4095], run_length=True, ticks=2**32 - 1)
def test_encoded_frames_come_back(values, run_length, ticks):
    frame = decode_frame(encode_frame(ticks, values, run_length=run_length), texels=len(values))
    assert frame.counts.tolist() == values
    assert (frame.ticks, frame.run_length) == (ticks, run_length)


@given(RUNS)
def test_long_runs_come_back_and_take_no_more_units_than_needed(runs):
    values = np.array([count for count, length in runs for _ in range(length)], dtype=np.uint16)
    packed = encode_frame(0, values, run_length=True)
    assert np.array_equal(decode_frame(packed).counts, values)
    changes = np.flatnonzero(np.diff(values)) + 1
    lengths = [part.size for part in np.split(values, changes)] if values.size else []
    assert len(compress(values)) == 2 * sum(-(-length // 15) for length in lengths)


@given(st.binary(max_size=60))
def test_any_bytes_either_are_refused_or_are_a_possible_frame(payload):
    try:
        frame = decode_frame(payload)
    except ValueError:
        return
    assert frame.counts.max(initial=0) <= 4095
    again = decode_frame(encode_frame(frame.ticks, frame.counts, run_length=frame.run_length))
    assert np.array_equal(again.counts, frame.counts)


def test_a_run_length_unit_holds_fifteen_texels():
    units = np.frombuffer(compress(np.repeat(np.array([5, 0], dtype=np.uint16), [31, 2])), dtype="<u2")
    assert [(unit & 0xFFF, unit >> 12) for unit in units.tolist()] == [(5, 15), (5, 15), (5, 1), (0, 2)]


def test_sizes_on_the_line_are_the_documented_ones():
    image = np.full(84, 7, dtype=np.uint16)
    assert len(encode_message(0x00, encode_frame(1, image))) == 181
    single = encode_answer(Command.READ_SINGLE_FRAME, Status.SUCCESS, encode_frame(1, image))
    assert len(single) == 183
    assert single[13:15] == b"\x07\x00"
    assert len(encode_message(0x00, encode_frame(1, np.zeros(84, dtype=np.uint16), run_length=True))) == 25
    assert len(encode_answer(Command.READ_SINGLE_FRAME, Status.SUCCESS, encode_frame(1, image[:32]))) == 79


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\0\0\0\0\0\0",  # half a texel
        b"\0\0\0\0\x02" + b"\0\0",  # an unknown flag
        b"\0\0\0\0\0" + b"\xff\x1f",  # 13 bits
        b"\0\0\0\0\x01" + b"\x05\x00",  # a run of length 0
    ],
)
def test_impossible_frames_are_refused(payload):
    with pytest.raises(ValueError, match=r"frame|bits"):
        decode_frame(payload)


def test_a_frame_of_another_array_is_refused():
    with pytest.raises(ValueError, match="4 texels, not 3"):
        decode_frame(encode_frame(0, [1, 2, 3]), texels=4)


@pytest.mark.parametrize("count", [4096, -1])
def test_counts_beyond_12_bits_are_not_sent(count):
    with pytest.raises(ValueError, match="4095"):
        encode_frame(0, [count])
