"""The run-length code of a frame in a `.dsa` file."""

import struct

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from validation.recordings.dsa import decode_counts

FULL_SCALE = 4095
#: Counts of a frame, with runs of zeros as real frames have them.
_COUNTS = st.integers(1, FULL_SCALE).map(lambda count: [count])
_ZEROS = st.integers(1, 30).map(lambda length: [0] * length)
FRAMES = st.lists(_COUNTS | _ZEROS)


class RefusedError(Exception):
    """The frame was refused."""


def _fail(fault):
    raise RefusedError(fault)


def _encode(parts):
    """Hexadecimal tokens of a frame whose runs of zeros are given as parts."""
    tokens = [-float(len(part)) if part[0] == 0 else float(part[0]) for part in parts]
    return "".join(struct.pack(">f", token).hex() for token in tokens)


@given(FRAMES, st.integers(1, 70))
def test_encoded_frames_come_back_however_lines_are_broken(parts, width):
    text = _encode(parts)
    broken = "\n ".join(text[start : start + width] for start in range(0, len(text), width))
    counts = [count for part in parts for count in part]
    limits = np.full(len(counts), FULL_SCALE, dtype=np.int16)
    assert decode_counts(broken, limits, _fail).tolist() == counts


@given(FRAMES.filter(bool), st.data())
def test_a_count_above_the_limit_of_its_texel_is_refused(parts, data):
    counts = np.array([count for part in parts for count in part])
    limits = np.full(len(counts), FULL_SCALE, dtype=np.int16)
    place = data.draw(st.integers(0, len(counts) - 1))
    limits[place] = counts[place] - 1
    with pytest.raises(RefusedError, match=f"texel {place} reads {counts[place]}; expected at most {limits[place]}"):
        decode_counts(_encode(parts), limits, _fail)


@example(bytes.fromhex("000000007f800001"), 2)  # a signalling NaN
@given(st.binary(max_size=40), st.integers(0, 50))
def test_any_tokens_are_refused_or_give_possible_counts(data, texels):
    limits = np.full(texels, FULL_SCALE, dtype=np.int16)
    try:
        counts = decode_counts(data.hex(), limits, _fail)
    except RefusedError:
        return
    assert counts.shape == (texels,)
    assert ((counts >= 0) & (counts <= FULL_SCALE)).all()
