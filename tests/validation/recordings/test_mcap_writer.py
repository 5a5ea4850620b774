"""The files of recordings: what was written comes back, and damage never reads as other numbers."""

import os
from random import Random

import numpy as np
import pytest

from validation.recordings import capture, mcap_reader, ros_messages
from validation.recordings.importing import save
from validation.recordings.mcap_writer import Clocks, RecordingWriter, StorageError
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


def test_several_arrays(tmp_path):
    recording = mcap_reader.read(_write(tmp_path / "a.mcap", 20, arrays=3))
    assert [(array.counts - 1000 * n == _truth(20)).all() for n, array in enumerate(recording.arrays)] == [True] * 3


def test_counts_that_do_not_fit_are_refused(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap", arrays=[capture.make_device_array(WTS_0614_34)], setup=Setup()) as writer:
        for counts in (np.full(84, -1), np.full(84, 70000)):
            with pytest.raises(ValueError, match="65535"):
                writer.add_frame(0, Clocks(1), counts)


@pytest.mark.parametrize("finished", [True, False])
def test_damaged_files_never_give_wrong_numbers_silently(tmp_path, finished):
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


def test_lost_frames_inside_a_file_are_noticed(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, arrays=[capture.make_device_array(WTS_0614_34)], setup=Setup()) as writer:
        for number in (0, 1, 3):
            writer._sequence[0] = number
            writer.add_frame(0, Clocks(number), np.zeros(84, dtype=int))
    with pytest.raises(RecordingError, match="frame 3 of /tactile/frame follows frame 1"):
        mcap_reader.read(path)


def test_files_that_are_no_recordings(tmp_path):
    plain = tmp_path / "plain.mcap"
    plain.write_text("hello")
    for path, what in (
        (plain, "not an MCAP file"),
        (tmp_path / "none.mcap", "no such file"),
        (_foreign(tmp_path / "foreign.mcap"), "without the labels"),
    ):
        with pytest.raises(RecordingError, match=what):
            mcap_reader.read(path)


def _foreign(path):
    from mcap.writer import Writer

    writer = Writer(str(path))
    writer.start()
    writer.finish()
    return path


def test_messages_come_back():
    assert ros_messages.decode_text(ros_messages.encode_text("µ")) == "µ"
    assert ros_messages.decode_numbers(ros_messages.encode_numbers([1.5, -2])).tolist() == [1.5, -2]
    frame = ros_messages.FrameMessage(
        host_monotonic=1, ticks=2, counts=np.arange(3, dtype=np.uint16), texel_forces=np.array([0.5, 1, 2])
    )
    back = ros_messages.decode_frame(ros_messages.encode_frame(5, "x", frame))
    assert (back.host_monotonic, back.ticks) == (1, 2)
    assert back.texel_forces.tolist() == [0.5, 1, 2]


def test_a_file_system_without_room(tmp_path):
    with pytest.raises(StorageError, match="cannot be written"):
        _write("/proc/no-such-place.mcap", 1)
    if not os.path.exists("/dev/full"):  # noqa: PTH110 -- a device
        pytest.skip("no /dev/full here")
    path = tmp_path / "full.mcap"
    path.touch()
    with pytest.raises(StorageError, match="name a new file"):
        _write(path, 1)


def test_a_recorder_killed_before_its_first_frame_leaves_no_file_or_one_with_its_setup(tmp_path, monkeypatch):
    path, sizes = tmp_path / "early.mcap", []
    write = os.write
    monkeypatch.setattr(os, "open", lambda *words, open_=os.open: sizes.append(path.exists()) or open_(*words))
    monkeypatch.setattr(os, "write", lambda *words: sizes.append(path.stat().st_size) or write(*words))
    options = {"arrays": [capture.make_device_array(WTS_0614_34)], "setup": SETUP, "serial": "7", "start": 10**18}
    writer = RecordingWriter(path, **options)
    assert sizes == [False, 0]
    monkeypatch.undo()
    left = path.read_bytes()
    writer.close()
    path.write_bytes(left)
    recording = mcap_reader.read(path)
    assert (recording.setup, recording.serial) == (SETUP, "7")
    assert not recording.complete
    assert (len(recording.times), recording.seconds) == (0, 0.0)
    assert recording.arrays[0].counts.shape == (0, 84)
    assert recording.arrays[0].texels.rows == 14
    assert recording.started.timestamp() == 10**9
    assert mcap_reader.recover(path)
    assert mcap_reader.read(path).complete
    assert save(recording, tmp_path / "again.mcap") == 0
    assert mcap_reader.read(tmp_path / "again.mcap").setup == SETUP
