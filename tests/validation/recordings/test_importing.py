"""Recordings of every format are opened, labelled and saved as MCAP with the same values."""

import errno
import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from meshes import TexelArray
from meshes.catalogue import ARRAYS
from tests.support.recordings import RECORDINGS, find_differences, recordings
from tests.support.ros_bags import write_bag
from validation.recordings import RecordingError, Setup
from validation.recordings.importing import add_forces, open_recording, relabel, save
from validation.recordings.mcap_writer import StorageError
from validation.recordings.recording import make_array

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


@pytest.mark.parametrize("kind", ["mcap", "bag"])
def test_a_recording_without_a_pitch_has_that_of_the_sensor(tmp_path, kind):
    """A bag, and a CSV file that was converted before anyone named the sensor."""
    path = tmp_path / f"a.{kind}"
    if kind == "mcap":
        (tmp_path / "a.csv").write_text(CSV)
        save(open_recording(tmp_path / "a.csv"), path)
    else:
        path = write_bag(tmp_path / "bag", {"/pad": "wts_driver/msg/Frame"}, first=False)
    assumed = open_recording(path)
    texels = assumed.arrays[0].texels
    assert (texels.pitch, assumed.setup.other["pitch assumed"]) == ((3.4e-3, 3.4e-3), "3.4 mm")
    sensor = TexelArray.grid(texels.rows, texels.columns, (4e-3, 5e-3))
    found = open_recording(path, sensor=sensor)
    assert found.arrays[0].has_layout_of(sensor)
    assert "pitch assumed" not in found.setup.other
    np.testing.assert_array_equal(found.arrays[0].counts, assumed.arrays[0].counts)
    other = TexelArray.grid(texels.rows + 1, texels.columns, (4e-3, 5e-3))
    assert open_recording(path, sensor=other).arrays[0].texels.rows == texels.rows


def test_an_import_that_fills_the_disk_leaves_no_file(tmp_path, monkeypatch, softcover):
    (tmp_path / "a.csv").write_text(CSV)
    (tmp_path / "b.mcap").write_text("mine")

    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", fail)
    with pytest.raises(StorageError, match="cannot be written: No space left on device"):
        save(open_recording(tmp_path / "a.csv"), tmp_path / "a.mcap")
    with pytest.raises(StorageError, match="name a new file"):
        save(open_recording(tmp_path / "a.csv"), tmp_path / "b.mcap")
    monkeypatch.undo()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.mcap"]
    assert (tmp_path / "b.mcap").read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        ["materials", "pet", "--out", "a.csv/c.csv"],
        ["datasheet", "wts-0614-34", "--out", "a.csv/c.md"],
        ["export", "wts-0614-34", "--out", "a.csv/c"],
        ["import", "a.csv", "--out", "a.csv/c.mcap"],
        ["init", "a.csv/c.toml"],
    ],
)
def test_a_path_below_a_file_is_refused_with_what_to_do(tmp_path, softcover, words):
    (tmp_path / "a.csv").write_text(CSV)
    status, out, errors = softcover(*words)
    assert (status, out, len(errors.splitlines())) == (2, "", 1)
    assert "a file stands where a folder is needed; name another place" in errors


MASKED = [file for file in FILES if file.name == "masked_matrix.dsa"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "file", [*MASKED, *(pytest.param(file, marks=pytest.mark.slow) for file in FILES[::6])], ids=lambda file: file.stem
)
def test_a_recording_of_six_masked_arrays_saved_as_mcap_comes_back(tmp_path, file):
    recording = relabel(open_recording(file), Setup(indenter="box:size=10.5mmx10.5mmx5mm", load=4.9, note="A"))
    assert save(recording, tmp_path / "a.mcap") == len(recording.times)
    back = open_recording(tmp_path / "a.mcap")
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


@pytest.mark.parametrize("delay", [0.1234567, 0.1234564, 3e-7])
def test_times_finer_than_a_microsecond_before_the_first_frame_are_kept(tmp_path, delay):
    (tmp_path / "a.csv").write_text("# rows = 1\n# columns = 1\ntime,a\n0,1\n1,2\n")
    (tmp_path / "f.csv").write_text("time,force\n0,1\n1,2\n2,3\n")
    save(add_forces(open_recording(tmp_path / "a.csv"), tmp_path / "f.csv", delay=delay), tmp_path / "a.mcap")
    assert open_recording(tmp_path / "a.mcap").force_times == pytest.approx([-delay, 1 - delay, 2 - delay], abs=2e-9)


def test_readings_before_1970_are_kept_and_times_after_2038_are_refused(tmp_path):
    """A force sensor may begin before the first frame, and a file may count from 0; milliseconds do not fit."""
    (tmp_path / "a.csv").write_text("# rows = 1\n# columns = 1\ntime,a\n0,1\n1,2\n")
    (tmp_path / "f.csv").write_text("time,force\n0,1\n1,2\n2,3\n")
    recording = add_forces(open_recording(tmp_path / "a.csv"), tmp_path / "f.csv", delay=0.5)
    save(recording, tmp_path / "a.mcap")
    back = open_recording(tmp_path / "a.mcap")
    assert back.force_times.tolist() == [-0.5, 0.5, 1.5]
    assert back.times.tolist() == [0, 1]
    (tmp_path / "late.csv").write_text("# rows = 1\n# columns = 1\ntime,a\n0,1\n2147483648,2\n")
    with pytest.raises(RecordingError, match=r"times up to 2\.147e\+09 s do not fit.*write seconds since 1970"):
        save(open_recording(tmp_path / "late.csv"), tmp_path / "late.mcap")
    assert not (tmp_path / "late.mcap").exists()


@pytest.mark.parametrize(
    ("line", "options", "message"),
    [
        ("", {"rows": 0}, "--rows: accepted: 1..10000, not 0"),
        ("", {"columns": -2}, "--columns: accepted: 1..10000, not -2"),
        ("", {"topic": "/pad"}, "has no topics; leave the option out"),
        ("# columns = 0\n", {}, "# columns = 0: expected a whole number of 1 to 10000"),
        ("# full_scale = 0\n", {}, "# full_scale = 0: expected a whole number of 1 to"),
        ("# load = 1_0\n", {}, "# load = 1_0: not a number"),
    ],
)
def test_options_and_keys_without_a_meaning_are_refused_and_not_ignored(tmp_path, line, options, message):
    (tmp_path / "a.csv").write_text(line + CSV)
    with pytest.raises(RecordingError, match=message):
        open_recording(tmp_path / "a.csv", **options)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--force-delay", "0.5"], "--force-delay: is for the force sensor's recording"),
        (["--force", "a.csv", "--force-delay", "nan"], "--force-delay: 'nan' is not a finite time"),
        (["--out", "b.csv"], "--out: b.csv does not end in .mcap, so it could not be read again; write b.mcap"),
    ],
)
def test_import_refuses_options_that_would_have_no_effect_or_a_wrong_one(softcover, tmp_path, words, message):
    (tmp_path / "a.csv").write_text(CSV)
    status, _, err = softcover("import", "a.csv", *words)
    assert status == 2
    assert message in err
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("load", [-1.0, float("nan"), float("inf")])
def test_an_impossible_load_is_refused(load):
    with pytest.raises(ValueError, match="0 N or more"):
        Setup(load=load)


def test_layouts_are_compared_by_position_size_and_mask():
    array = make_array(13, 6)
    assert not array.has_layout_of(ARRAYS["sdh2-distal"])  # some of its texels are missing
    assert array.has_layout_of(TexelArray.grid(13, 6, 3.4e-3))
    assert not array.has_layout_of(TexelArray.grid(6, 13, 3.4e-3))
    assert not array.has_layout_of(TexelArray.grid(13, 6, 3.41e-3))
