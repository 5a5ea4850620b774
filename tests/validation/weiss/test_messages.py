"""Bytes of messages against the published vectors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.commands import (
    LAYOUTS,
    Command,
    Layout,
    MatrixInfo,
    Status,
    answer,
    describe_status,
    matrix_info,
    matrix_values,
    read_answer,
    read_request,
    request,
    system_info,
    temperature,
)
from validation.weiss.frames import compress, decode_frame, encode_frame
from validation.weiss.messages import PREAMBLE, checksum, decode, encode

VECTORS = {
    "AA AA AA 01 02 00 12 34 6D 66": encode(0x01, b"\x12\x34"),
    "AA AA AA 01 00 00 E8 10": encode(0x01),
    "AA AA AA 06 00 00 97 26": request(Command.LOOP),
    "AA AA AA 20 01 00 00 8F 83": request(Command.READ_SINGLE_FRAME, 0),
    "AA AA AA 20 01 00 01 AE 93": request(Command.READ_SINGLE_FRAME, 1),
    "AA AA AA 21 03 00 00 00 00 F5 5C": request(Command.START_PERIODIC_FRAMES, 0, 0),
    "AA AA AA 21 03 00 01 00 00 57 36": request(Command.START_PERIODIC_FRAMES, 1, 0),
    "AA AA AA 22 00 00 0E 76": request(Command.STOP_PERIODIC_FRAMES),
    "AA AA AA 30 00 00 CA CF": request(Command.MATRIX_INFO),
    "AA AA AA 38 00 00 EA CF": request(Command.SENSOR_TYPE),
    "AA AA AA 46 00 00 86 B7": request(Command.TEMPERATURE),
    "AA AA AA 50 00 00 DB 87": request(Command.SYSTEM_INFO),
    "AA AA AA 52 00 00 9F 52": request(Command.GET_TAG),
    "AA AA AA 35 00 00 F1 2C": request(Command.GET_THRESHOLD),
    "AA AA AA 37 00 00 B5 F9": request(Command.GET_GAIN),
}


@pytest.mark.parametrize(("expected", "made"), VECTORS.items())
def test_published_messages(expected, made):
    assert made == bytes.fromhex(expected)
    assert encode(*_parts(decode(made))) == made
    assert checksum(made) == 0


def _parts(message):
    return message.identifier, message.payload


def test_published_checksum_values():
    assert checksum(PREAMBLE) == 0x50F5
    assert checksum(b"123456789") == 0x6EB4


def test_sizes_on_the_wire():
    image = np.full(84, 7, dtype=np.uint16)
    assert len(encode(0x00, encode_frame(1, image))) == 181
    single = answer(Command.READ_SINGLE_FRAME, Status.SUCCESS, encode_frame(1, image))
    assert len(single) == 183
    assert single[13:15] == b"\x07\x00"
    assert len(encode(0x00, encode_frame(1, np.zeros(84, dtype=np.uint16), run_length=True))) == 25
    assert len(answer(Command.READ_SINGLE_FRAME, Status.SUCCESS, encode_frame(1, image[:32]))) == 79


@given(st.binary(max_size=40), st.integers(0, 255).filter(lambda i: i != 0xAA), st.data())
def test_any_damage_within_one_byte_is_caught(payload, identifier, data):
    message = bytearray(encode(identifier, payload))
    place = data.draw(st.integers(0, len(message) - 1))
    message[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises(ValueError, match="message"):
        decode(bytes(message))


def test_checksum_is_weaker_than_its_16_bits():
    """A fact that readers must know: some damage of two bytes leaves the checksum as it was."""
    good = encode(0x06, b"\x00\x00\x00\x00")
    damaged = bytearray(good)
    damaged[7] ^= 0x89
    damaged[8] ^= 0xA1
    assert bytes(damaged) != good
    assert checksum(bytes(damaged)) == 0


@given(st.lists(st.integers(0, 4095), max_size=200), st.booleans(), st.integers(0, 2**32 - 1))
def test_frames_come_back(values, run_length, ticks):
    frame = decode_frame(encode_frame(ticks, values, run_length=run_length), texels=len(values))
    assert frame.counts.tolist() == values
    assert (frame.ticks, frame.run_length) == (ticks, run_length)


def test_run_lengths_are_fifteen_at_most():
    units = np.frombuffer(compress(np.repeat(np.array([5, 0], dtype=np.uint16), [31, 2])), dtype="<u2")
    assert [(unit & 0xFFF, unit >> 12) for unit in units.tolist()] == [(5, 15), (5, 15), (5, 1), (0, 2)]


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
    with pytest.raises(ValueError, match="texels"):
        decode_frame(encode_frame(0, [1, 2, 3]), texels=4)


def test_texel_values_beyond_12_bits_are_not_sent():
    with pytest.raises(ValueError, match="4095"):
        encode_frame(0, [4096])
    with pytest.raises(ValueError, match="4095"):
        encode_frame(0, [-1])


#: Values that fit each layout, to send every documented command once.
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


@pytest.mark.parametrize("command", LAYOUTS)
def test_every_command_goes_both_ways(command):
    layout: Layout = LAYOUTS[command]
    asked = request(command, *_VALUES[layout.request])
    assert read_request(decode(asked)) == (command, _VALUES[layout.request])
    told = answer(command, Status.SUCCESS, *_VALUES[layout.answer])
    assert read_answer(decode(told)) == (0, _VALUES[layout.answer])
    refused = answer(command, Status.ACCESS_DENIED)
    assert read_answer(decode(refused)) == (16, ())


def test_values_are_read_in_si():
    info = matrix_info((6, 14, 340, 340, 4095))
    assert info == MatrixInfo(columns=6, rows=14, cell_width=3.4e-3, cell_height=3.4e-3, full_scale=4095)
    assert matrix_values(info) == (6, 14, 340, 340, 4095)
    assert system_info((1, 3, 0x1203, 77)).firmware == "1.2.0.3"
    assert temperature((-125,)) == -12.5
    assert describe_status(12) == "no parameter expected (12)"
    assert describe_status(99) == "unknown status (99)"


def test_misuse_is_named():
    with pytest.raises(ValueError, match="0xAA"):
        encode(0xAA)
    with pytest.raises(ValueError, match="layout"):
        request(Command.SET_THRESHOLD, 70000)
    with pytest.raises(KeyError, match="0x7f"):
        read_answer(decode(encode(0x7F, b"\0\0")))
    with pytest.raises(ValueError, match="status"):
        read_answer(decode(encode(0x30, b"\0")))
    with pytest.raises(ValueError, match="layout"):
        read_answer(decode(encode(0x30, b"\0\0\0")))
