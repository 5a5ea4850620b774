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


ARRAY = {
    "name": "left", "rows": 2, "columns": 3, "pitch_m": [4e-3, 3e-3], "texel_size_m": [3.5e-3, 2.5e-3],
    "active": "111101", "enabled": "101111", "full_scale": 900, "offset": 7, "unit": "mV",
    "centre_m": [0.01, -0.02, 0.03], "rotation_rad": [0.1, 0.2, -0.3],
}  # fmt: skip
LABELS = {
    "format": "softcover-recording/1", "serial": "S7", "arrays": [ARRAY],
    "clock": {"start_ns": 5, "monotonic_ns": 6},
    "setup": {"indenter": "i", "load": 1.5, "note": "n", "source": "s", "source_sha256": "h",
              "device": {"gain": 3, "warm": True}, "other": {"mass": "5"}},
}  # fmt: skip


def change(key, value):
    """Labels with one value replaced: of the array, or of the clock."""
    if key in LABELS["clock"]:
        return {**LABELS, "clock": {**LABELS["clock"], key: value}}
    return {**LABELS, "arrays": [{**ARRAY, key: value}]}


def test_labels_written_by_hand_are_read_field_by_field():
    labels, (array,) = decode_labels(json.dumps(LABELS), PATH)
    texels = array.texels
    assert (labels.serial, labels.clock.start_ns, labels.clock.monotonic_ns) == ("S7", 5, 6)
    assert labels.setup == Setup(indenter="i", load=1.5, note="n", source="s", source_sha256="h",
                                 device={"gain": 3, "warm": True}, other={"mass": "5"})  # fmt: skip
    assert (texels.name, texels.rows, texels.columns, texels.pitch) == ("left", 2, 3, (4e-3, 3e-3))
    assert texels.texel_size == (3.5e-3, 2.5e-3)
    assert texels.active.tolist() == [True, True, True, True, False, True]
    assert array.enabled.tolist() == [True, False, True, True, True, True]
    assert (array.full_scale, array.offset, array.unit, array.counts.shape) == (900, 7, "mV", (0, 6))
    assert (array.centre, array.rotation) == ((0.01, -0.02, 0.03), (0.1, 0.2, -0.3))
    without = {key: value for key, value in ARRAY.items() if key != "offset"}
    assert decode_labels(json.dumps({**LABELS, "arrays": [without]}), PATH)[1][0].offset == 0


@pytest.mark.parametrize(
    ("key", "good", "bad", "words"),
    [
        ("full_scale", [1, 2**31 - 1], [0, 2**31], "arrays.0.full_scale"),
        ("offset", [0, 65535], [-1, 65536], "arrays.0.offset"),
        ("centre_m", [[1000.0, 0, 0], [0, 0, -1000.0]], [[1000.1, 0, 0], [0, 0, -1000.1], [0, 0]], "arrays.0.centre_m"),
        ("pitch_m", [[0.1, 0.2]], [[0.1], [0.1, 1000.5]], "arrays.0.pitch_m"),
        ("rotation_rad", [[0, 3, 0]], [[0, None, 0]], "arrays.0.rotation_rad.1"),
        ("start_ns", [0, 2**63 - 1], [-1], "clock.start_ns"),
        ("monotonic_ns", [0, 2**63 - 1], [-1], "clock.monotonic_ns"),
        ("enabled", ["000000"], ["1" * 5, "1" * 7], "texels; expected 2 x 3"),
        ("active", ["000001"], ["1" * 5, "1" * 7], "its labels cannot be read"),
        ("rows", [2], [3, 0, -2], "its labels cannot be read"),
    ],
)
def test_values_of_labels_at_and_beyond_their_limits(key, good, bad, words):
    for value in good:
        decode_labels(json.dumps(change(key, value)), PATH)
    for value in bad:
        with pytest.raises(RecordingError) as caught:
            decode_labels(json.dumps(change(key, value)), PATH)
        assert str(caught.value).startswith("a.mcap: its labels cannot be read: ")
        assert words in str(caught.value)
        assert str(caught.value).endswith("; expected 'softcover-recording/1'")


def test_labels_of_64_arrays_and_a_million_characters_are_the_most():
    assert len(decode_labels(json.dumps({**LABELS, "arrays": [ARRAY] * 64}), PATH)[1]) == 64
    with pytest.raises(RecordingError, match="65 arrays; at most 64 are accepted"):
        decode_labels(json.dumps({**LABELS, "arrays": [ARRAY] * 65}), PATH)
    text = json.dumps(LABELS)
    assert decode_labels(text + " " * (2**20 - len(text)), PATH)[0].serial == "S7"
    with pytest.raises(RecordingError, match="its labels have 1048577 characters; at most 1048576 are accepted"):
        decode_labels(text + " " * (2**20 + 1 - len(text)), PATH)


@pytest.mark.parametrize(("count", "words"), [(1000, "setup.other.k0: Input"), (1001, "faults everywhere")])
def test_of_more_than_a_thousand_faults_none_is_named(count, words):
    other = {f"k{number}": 1 for number in range(count)}
    with pytest.raises(RecordingError, match=f"its labels cannot be read: {words}"):
        decode_labels(json.dumps({**LABELS, "setup": {"other": other}}), PATH)


def test_clocks_and_a_serial_number_that_are_not_known_are_zero_and_empty():
    labels, arrays = decode_labels(encode_labels(Setup(), ()), PATH)
    assert (labels.serial, labels.clock.start_ns, labels.clock.monotonic_ns, arrays) == ("", 0, 0, ())
