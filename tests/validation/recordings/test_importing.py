"""Recordings of every format are opened, labelled and saved as MCAP with the same values."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from tests.support.recordings import RECORDINGS, find_differences, recordings
from tests.support.ros_bags import write_bag
from validation.recordings import RecordingError, Setup
from validation.recordings.importing import add_forces, open_recording, relabel, save

FILES = [] if RECORDINGS is None else sorted(RECORDINGS.rglob("*.dsa"))
CSV = "# rows = 2\ntime,force,temperature,a,b,c,d\n10.0,0.1,30.5,0,1,2,3\n10.5,0.2,30.6,4,5,6,4095\n"


@settings(max_examples=25, deadline=None)
@given(recording=recordings())
def test_a_recording_saved_as_mcap_comes_back(tmp_path_factory, recording):
    path = tmp_path_factory.mktemp("mcap") / "a.mcap"
    assert save(recording, path) == len(recording.times)
    back = open_recording(path)
    assert find_differences(back, recording) == []
    assert (back.setup, back.gaps, back.complete) == (recording.setup, recording.gaps, True)
    assert back.ticks.tolist() == recording.ticks.tolist()
    assert back.host_monotonic.tolist() == recording.host_monotonic.tolist()


@pytest.mark.parametrize("kind", ["wts_driver/msg/Frame", "schunk_sdh/msg/TactileSensor"])
def test_a_bag_saved_as_mcap_comes_back(tmp_path, kind):
    topics = {"/pad": kind, "/rig/force": "geometry_msgs/msg/WrenchStamped"}
    recording = open_recording(write_bag(tmp_path / "bag", topics, first=False))
    save(recording, tmp_path / "a.mcap")
    assert find_differences(open_recording(tmp_path / "a.mcap"), recording) == []


def test_labels_that_are_given_replace_the_old_ones(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# load = 1.5\n# note = old\n" + CSV)
    changed = relabel(open_recording(path), Setup(indenter="sphere:radius=5mm", note="new")).setup
    assert (changed.indenter, changed.load, changed.note) == ("sphere:radius=5mm", 1.5, "new")
    assert changed.source == "a.csv"


def _save_and_open(file, folder):
    """A recording, and what is read after it was saved."""
    recording = relabel(open_recording(file), Setup(indenter="box:size=10.5mmx10.5mmx5mm", load=4.9, note="A"))
    frames = save(recording, folder / f"{file.stem}.mcap")
    assert frames == len(recording.times)
    return recording, open_recording(folder / f"{file.stem}.mcap")


@pytest.mark.skipif(not FILES, reason="the recordings are not here")
def test_a_recording_of_six_masked_arrays_saved_as_mcap_comes_back(tmp_path):
    recording, back = _save_and_open(next(file for file in FILES if file.name == "masked_matrix.dsa"), tmp_path)
    assert find_differences(back, recording) == []
    assert back.setup == replace(recording.setup, source_sha256=recording.sha256)


@pytest.mark.slow
@pytest.mark.skipif(not FILES, reason="the recordings are not here")
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_recording_saved_as_mcap_comes_back(file, tmp_path):
    recording, back = _save_and_open(file, tmp_path)
    assert find_differences(back, recording) == []
    assert back.setup == replace(recording.setup, source_sha256=recording.sha256)


def test_forces_of_a_file_of_their_own_are_put_beside_the_frames(tmp_path):
    bag = write_bag(tmp_path / "a.bag", {"/pad": "sensor_msgs/msg/Image"}, first=True)
    rig = write_bag(tmp_path / "rig.bag", {"/rig": "geometry_msgs/msg/WrenchStamped"}, first=True)
    table = tmp_path / "rig.csv"
    table.write_text("time,force\n-0.1,0\n0.2,3\n")
    recording = open_recording(bag)
    from_bag = add_forces(recording, rig)
    assert from_bag.forces.tolist() == [0, 0.5, 1, 1.5, 2]
    assert np.allclose(from_bag.force_times, recording.times, atol=1e-6)
    assert add_forces(recording, table, delay=0.05).force_times.tolist() == pytest.approx([-0.15, 0.15])
    table.write_text("time,force\n100,0\n101,3\n")
    with pytest.raises(RecordingError, match="do not cover the frames"):
        add_forces(recording, table)
    table.write_text("time,a\n100,0\n")
    with pytest.raises(RecordingError, match="no forces"):
        add_forces(recording, table)
    with pytest.raises(RecordingError, match="no forces"):
        add_forces(recording, bag)


def test_a_topic_of_a_softcover_recording_can_be_read_as_that_of_another_program(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(CSV)
    save(open_recording(path), tmp_path / "a.mcap")
    foreign = open_recording(tmp_path / "a.mcap", topic="/tactile/image")
    assert foreign.arrays[0].counts.tolist() == [[0, 1, 2, 3], [4, 5, 6, 4095]]


def test_files_that_are_no_recordings_are_refused(tmp_path):
    text = tmp_path / "a.txt"
    text.write_text("hello")
    for name, what in (
        (text, "not a recording; accepted: .dsa, .csv, .mcap"),
        (tmp_path / "none.bag", "no such file"),
        (tmp_path, "a folder with metadata.yaml"),
    ):
        with pytest.raises(RecordingError, match=what):
            open_recording(name)
    for suffix in ("bag", "mcap", "db3"):
        broken = tmp_path / f"b.{suffix}"
        broken.write_bytes(b"\x00nonsense")
        with pytest.raises(RecordingError, match=r"not a ROS bag|not an MCAP file"):
            open_recording(broken)
