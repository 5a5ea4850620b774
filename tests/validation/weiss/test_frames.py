"""Frames: counts that are encoded come back, and impossible payloads are refused."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from validation.weiss.commands import Command, Status, encode_answer
from validation.weiss.frames import compress, decode_frame, encode_frame
from validation.weiss.messages import encode_message

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
