"""MCAP recordings: frames come back, damage never reads as other numbers, a full disk keeps the frames before."""

import errno
import os
import signal
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder

from validation.recordings import capture, mcap_reader
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


@pytest.mark.parametrize("count", [60, pytest.param(240, marks=pytest.mark.slow)])
@pytest.mark.parametrize("finished", [True, False])
def test_a_damaged_file_is_refused_or_gives_the_true_frames(tmp_path, finished, count):
    """Bit flips and truncations: an error, or the true numbers, or the true numbers of a marked, shorter file."""
    frames = 20
    path = _write(tmp_path / "a.mcap", frames)
    data = path.read_bytes()
    if not finished:
        data = data[: data.rindex(b"\x0f" + (4).to_bytes(8, "little"))]
    random = Random(6)  # noqa: S311 -- reproducible, no secret
    refused = 0
    for trial in range(count):
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
        read = len(recording.times)
        assert (recording.arrays[0].counts == _truth(frames)[:read]).all()
        assert recording.ticks.tolist() == list(range(read))
        assert read == frames or not recording.complete
    assert refused > count / 4


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


def _open_writer(path, **options):
    return RecordingWriter(path, arrays=[capture.make_device_array(WTS_0614_34)], setup=SETUP, **options)


def test_counts_that_do_not_fit_are_refused(tmp_path):
    with _open_writer(tmp_path / "a.mcap") as writer:
        for counts in (np.full(84, -1), np.full(84, 70000)):
            with pytest.raises(ValueError, match="65535"):
                writer.add_frame(0, Clocks(1), counts)


def test_a_file_that_exists_or_has_no_folder_is_refused(tmp_path):
    with pytest.raises(StorageError, match="cannot be written"):
        _open_writer("/proc/no-such-place.mcap")
    path = tmp_path / "full.mcap"
    path.touch()
    with pytest.raises(StorageError, match="name a new file"):
        _open_writer(path)


@pytest.mark.parametrize("call", ["write", "fsync"])
def test_a_disk_failure_is_reported_once_and_the_chunks_before_are_kept(tmp_path, monkeypatch, call):
    path = tmp_path / "a.mcap"
    writer = _open_writer(path)
    for number in range(5):
        writer.add_frame(0, Clocks(number), np.full(84, number))
    writer._flush()

    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    writer.add_frame(0, Clocks(5), np.full(84, 5))
    monkeypatch.setattr(os, call, fail)
    with pytest.raises(StorageError, match=r"the disk takes no more \(No space left on device\)"):
        writer.close()
    monkeypatch.undo()
    writer.close()
    recording = mcap_reader.read(path)
    assert recording.arrays[0].counts[:5, 0].tolist() == [0, 1, 2, 3, 4]


def test_what_a_full_disk_took_of_a_chunk_is_removed(tmp_path, monkeypatch):
    path, write = tmp_path / "a.mcap", os.write
    writer = _open_writer(path)
    writer.add_frame(0, Clocks(0), np.full(84, 1))
    writer._flush()
    complete = path.read_bytes()

    def fill_up(descriptor, data):
        if path.stat().st_size > len(complete):
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(descriptor, data[:7])

    writer.add_frame(0, Clocks(1), np.full(84, 2))
    monkeypatch.setattr(os, "write", fill_up)
    with pytest.raises(StorageError, match="the disk takes no more"):
        writer.close()
    assert path.read_bytes() == complete


def test_a_recorder_killed_before_its_first_frame_leaves_no_file_or_one_with_its_setup(tmp_path, monkeypatch):
    path, sizes = tmp_path / "early.mcap", []
    write = os.write
    monkeypatch.setattr(os, "open", lambda *words, open_=os.open: sizes.append(path.exists()) or open_(*words))
    monkeypatch.setattr(os, "write", lambda *words: sizes.append(path.stat().st_size) or write(*words))
    writer = _open_writer(path, serial="7", start=10**18)
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("call", [1, 2])  # the image, the frame
def test_an_interrupt_within_a_record_tears_nothing(tmp_path, monkeypatch, number, call):
    finish, calls = RecordBuilder.finish_record, []

    def interrupted(builder):
        calls.append(builder)
        if len(calls) == call:
            signal.raise_signal(number)
        finish(builder)

    before = signal.signal(number, signal.default_int_handler)
    try:
        with _open_writer(tmp_path / "a.mcap") as writer:
            writer.add_frame(0, Clocks(10**18), np.arange(84))
            monkeypatch.setattr(RecordBuilder, "finish_record", interrupted)
            with pytest.raises(KeyboardInterrupt):
                writer.add_frame(0, Clocks(10**18 + 1), np.arange(84))
    finally:
        found = signal.signal(number, before)
    assert found is signal.default_int_handler
    assert len(mcap_reader.read(tmp_path / "a.mcap").times) == call
