"""Commands: requests and answers of every documented command, and their values in SI units."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.commands import (
    LAYOUTS,
    Command,
    Layout,
    MatrixInfo,
    Status,
    decode_answer,
    decode_matrix_info,
    decode_request,
    decode_system_info,
    decode_temperature,
    describe_status,
    encode_answer,
    encode_matrix_info,
    encode_request,
    encode_temperature,
)
from validation.weiss.frames import encode_frame
from validation.weiss.messages import Message, encode_message
from validation.weiss.parser import Parser

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


def _find_message(data):
    parser = Parser()
    (message,) = parser.feed(data) + parser.finish()
    return message


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
    assert decode_answer(_find_message(encode_answer(command, Status.SUCCESS, *answered))) == (0, answered)
    assert decode_answer(_find_message(encode_answer(command, Status.ACCESS_DENIED))) == (16, ())


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
        decode_answer(_find_message(encode_message(0x7F, b"\0\0")))
    with pytest.raises(KeyError, match="0x00"):
        decode_request(Message(Command.PERIODIC_FRAME, b""))
    with pytest.raises(ValueError, match="status"):
        decode_answer(_find_message(encode_message(0x30, b"\0")))
    with pytest.raises(ValueError, match="layout"):
        decode_answer(_find_message(encode_message(0x30, b"\0\0\0")))
