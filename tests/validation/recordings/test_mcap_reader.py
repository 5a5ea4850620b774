"""Reading MCAP recordings: frames come back, and damage never reads as other numbers."""

from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from validation.recordings import capture, mcap_reader
from validation.recordings.mcap_writer import Clocks, RecordingWriter
from validation.recordings.recording import RecordingError, Setup
from validation.weiss.virtual import WTS_0614_34

SETUP = Setup(indenter="sphere:radius=5mm", load=4.9, note="left palm, 3rd trial")


def _write(path, frames, arrays=1):
    described = [capture.make_device_array(WTS_0614_34)] * arrays
    with RecordingWriter(path, arrays=described, setup=Setup()) as writer:
        for number in range(frames):
            clocks = Clocks(10**18 + number * 4_000_000, number, number)
            for index in range(arrays):
                writer.add_frame(index, clocks, np.arange(84) + number + 1000 * index)
    return path


def _truth(frames):
    return np.arange(84) + np.arange(frames)[:, None]


def test_frames_of_several_arrays_come_back(tmp_path):
    recording = mcap_reader.read(_write(tmp_path / "a.mcap", 20, arrays=3))
    assert [(array.counts - 1000 * n == _truth(20)).all() for n, array in enumerate(recording.arrays)] == [True] * 3


@pytest.mark.parametrize("finished", [True, False])
def test_a_damaged_file_is_refused_or_gives_the_true_frames(tmp_path, finished):
    """Bit flips and truncations: an error, or the true numbers, or the true numbers of a marked, shorter file."""
    frames = 20
    path = _write(tmp_path / "a.mcap", frames)
    data = path.read_bytes()
    if not finished:
        data = data[: data.rindex(b"\x0f" + (4).to_bytes(8, "little"))]
    random = Random(6)  # noqa: S311 -- reproducible, no secret
    refused = 0
    for trial in range(160):
        damaged = bytearray(data)
        if trial % 4:
            damaged[random.randrange(len(data))] ^= 1 << random.randrange(8)
        else:
            del damaged[random.randrange(len(data)) :]
        path.write_bytes(damaged)
        try:
            recording = mcap_reader.read(path)
        except RecordingError as error:
            refused += str(path) in str(error)
            continue
        count = len(recording.times)
        assert (recording.arrays[0].counts == _truth(frames)[:count]).all()
        assert recording.ticks.tolist() == list(range(count))
        assert count == frames or not recording.complete
    assert refused > 40


def test_a_missing_frame_in_a_file_is_noticed(tmp_path):
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, arrays=[capture.make_device_array(WTS_0614_34)], setup=Setup()) as writer:
        for number in (0, 1, 3):
            writer._sequence[0] = number
            writer.add_frame(0, Clocks(number), np.zeros(84, dtype=int))
    with pytest.raises(RecordingError, match="frame 3 of /tactile/frame follows frame 1"):
        mcap_reader.read(path)


def test_files_that_are_no_recordings_are_refused(tmp_path):
    plain = tmp_path / "plain.mcap"
    plain.write_text("hello")
    for path, what in (
        (plain, "not an MCAP file"),
        (tmp_path / "none.mcap", "no such file"),
        (_write_other_program(tmp_path / "foreign.mcap"), "without the labels"),
    ):
        with pytest.raises(RecordingError, match=what):
            mcap_reader.read(path)


def _write_other_program(path):
    from mcap.writer import Writer

    writer = Writer(str(path))
    writer.start()
    writer.finish()
    return path


@settings(max_examples=30, deadline=None)
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_cut_off_recording_gives_its_first_frames_and_can_be_completed(tmp_path_factory, share):
    path = _write(tmp_path_factory.mktemp("cut") / "a.mcap", 12)
    content = path.read_bytes()
    path.write_bytes(content[: max(8, int(share * len(content)))])
    left, fault = None, ""
    try:
        left = mcap_reader.read(path)
    except RecordingError as error:
        fault = str(error)
    if left is None:
        assert "without the labels" in fault
        return
    assert not left.complete
    assert (left.arrays[0].counts == _truth(12)[: len(left.times)]).all()
    assert mcap_reader.recover(path)
    completed = mcap_reader.read(path)
    assert completed.complete
    assert np.array_equal(completed.arrays[0].counts, left.arrays[0].counts)
    assert [file.name for file in path.parent.iterdir()] == ["a.mcap"]
