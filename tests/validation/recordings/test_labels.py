"""Labels as JSON: what is written comes back, and anything else is refused."""

import json
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.recordings import LINES, compare_arrays, recorded_arrays, setups
from validation.recordings import RecordingError, Setup
from validation.recordings.mcap_writer import decode_labels, encode_labels
from validation.recordings.recording import make_array

PATH = Path("a.mcap")
TEXT = encode_labels(Setup(load=1.5), (make_array(2, 3),), serial="7", start=5, monotonic=6)
_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda children: st.lists(children, max_size=3) | st.dictionaries(st.text(max_size=5), children, max_size=3),
    max_leaves=5,
)


@given(setups(), st.lists(recorded_arrays(), max_size=3), LINES, st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1))
def test_labels_come_back(setup, arrays, serial, start, monotonic):
    text = encode_labels(setup, tuple(arrays), serial=serial, start=start, monotonic=monotonic)
    back, described = decode_labels(text, PATH)
    assert (back.setup, back.serial, back.clock.start_ns, back.clock.monotonic_ns) == (setup, serial, start, monotonic)
    assert all(all(compare_arrays(*pair).values()) for pair in zip(described, arrays, strict=True))


@given(key=st.sampled_from(["setup", "arrays", "serial", "clock"]), value=_JSON)
def test_labels_with_one_entry_replaced_are_refused_or_read(key, value):
    """A replaced entry never causes an error of another kind."""
    with suppress(RecordingError):
        decode_labels(json.dumps({**json.loads(TEXT), key: value}), PATH)


def test_another_version_and_text_that_is_no_json_are_refused():
    with pytest.raises(RecordingError, match=r"'softcover-recording/9'; accepted: 'softcover-recording/1'"):
        decode_labels(TEXT.replace("recording/1", "recording/9"), PATH)
    with pytest.raises(RecordingError, match=r"a\.mcap: its labels cannot be read"):
        decode_labels(TEXT[:-5], PATH)
