"""ROS 2 messages: what is encoded comes back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from validation.recordings import ros_messages

FLOATS = st.floats(allow_nan=False)
TIMES = st.integers(0, 2**31 * 10**9 - 1)


_FRAMES = st.builds(
    ros_messages.FrameMessage,
    host_monotonic=st.integers(0, 2**64 - 1),
    ticks=st.integers(0, 2**32 - 1),
    counts=arrays(np.uint16, st.integers(0, 100)),
    texel_forces=arrays(float, st.integers(0, 100), elements=FLOATS),
)
_TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]))


@given(_FRAMES, TIMES, _TEXTS)
def test_frames_come_back(frame, time, name):
    back = ros_messages.decode_frame(ros_messages.encode_frame(time, name, frame))
    assert (back.host_monotonic, back.ticks) == (frame.host_monotonic, frame.ticks)
    assert np.array_equal(back.counts, frame.counts)
    assert np.array_equal(back.texel_forces, frame.texel_forces)


@given(_TEXTS, TIMES)
def test_texts_come_back(text, time):
    assert ros_messages.decode_text(ros_messages.encode_text(text)) == text
    assert ros_messages.decode_diagnostics(ros_messages.encode_diagnostics(time, "gap", text)) == [text]


@given(st.lists(FLOATS), FLOATS, TIMES)
def test_numbers_come_back(values, force, time):
    assert ros_messages.decode_numbers(ros_messages.encode_numbers(values)).tolist() == values
    wrench = ros_messages.encode_wrench(time, "sensor", (1.0, force, 2.0), (force, 3.0, 4.0))
    assert ros_messages.decode_wrench(wrench).tolist() == [1.0, force, 2.0, force, 3.0, 4.0]
    labelled = ros_messages.encode_numbers(values, "numbers [m]")
    assert ros_messages.decode_numbers(labelled).tolist() == values
    assert ros_messages.decode_label(labelled) == "numbers [m]"
    assert ros_messages.decode_label(ros_messages.encode_numbers(values)) == ""
