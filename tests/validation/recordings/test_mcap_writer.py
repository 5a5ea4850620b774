"""Writing MCAP recordings: what is refused, and what a killed recorder or a full disk leaves."""

import errno
import os

import numpy as np
import pytest

from validation.recordings import capture, mcap_reader
from validation.recordings.importing import save
from validation.recordings.mcap_writer import Clocks, RecordingWriter, StorageError
from validation.recordings.recording import Setup
from validation.weiss.virtual import WTS_0614_34

SETUP = Setup(indenter="sphere:radius=5mm", load=4.9, note="left palm, 3rd trial")


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
