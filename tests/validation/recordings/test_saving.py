"""What is opened, relabelled and saved: options at their limits, and the times and values in a saved file."""

import errno
import os
import re
import struct
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from meshes import TexelArray
from tests.support.mcap_bytes import take_apart
from tests.support.ros_bags import write_bag
from validation.recordings import RecordingError
from validation.recordings.importing import add_forces, open_recording, relabel, save
from validation.recordings.mcap_writer import StorageError
from validation.recordings.recording import Recording, Setup, SimulatedForces, make_array

US = timedelta(microseconds=1)
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
SECOND = 10**9


def put(folder, text, name="a.csv"):
    (folder / name).write_text(text)
    return folder / name


def make(times=(0.0, 0.25), started=1000.5, **options):
    count = len(times)
    counts = np.arange(2 * count, dtype=np.int32).reshape(count, 2)
    return Recording(**{
        "path": Path("made"), "sha256": "", "serial": "S5", "started": EPOCH + round(started * 1e6) * US,
        "times": np.array(times, dtype=float), "arrays": (make_array(1, 2, counts, full_scale=70),),
        "setup": Setup(load=2.5), **options,
    })  # fmt: skip


def list_messages(path, topic):
    """Times of logging and publishing [ns] and data of the messages of a topic."""
    return [each[2:] for each in take_apart(path.read_bytes()).messages if each[0] == topic]


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("a.csv", {"rows": 10_001}, "--rows: accepted: 1..10000, not 10001"),
        ("a.csv", {"columns": 0}, "--columns: accepted: 1..10000, not 0"),
        ("none.csv", {}, "none.csv: no such file; accepted: .dsa, .csv, .mcap, .bag (ROS 1), a folder"),
        ("a.csv", {"topic": "/x"}, "--topic: {0}/a.csv has no topics; leave the option out"),
        ("a.DSA", {"topic": "/x"}, "--topic: {0}/a.DSA has no topics; leave the option out"),
        ("a.DSA", {"axis": "x"}, "--axis: {0}/a.DSA has one count per texel; leave the option out"),
        ("a.mcap", {"axis": "x"}, "--axis: {0}/a.mcap has one count per texel; leave the option out"),
        ("a.txt", {}, "{0}/a.txt: not a recording; accepted: .dsa"),
        ("a.DSA", {}, "{0}/a.DSA: truncated"),
        ("a.MCAP", {}, "{0}/a.MCAP: not an MCAP file"),
        ("a.MCAP", {"topic": "/x"}, "{0}/a.MCAP: not a ROS bag, or damaged"),
        ("a.db3", {}, "{0}/a.db3: not a ROS bag, or damaged"),
        ("a.bag", {}, "{0}/a.bag: not a ROS bag, or damaged"),
    ],
)
def test_what_cannot_be_opened_is_named_with_its_option(tmp_path, name, options, words):
    for each in ("a.csv", "a.DSA", "a.mcap", "a.txt", "a.MCAP", "a.db3", "a.bag"):
        (tmp_path / each).touch()
    with pytest.raises(RecordingError, match="^.*" + re.escape(words.format(tmp_path))):
        open_recording(tmp_path / name, **options)


def test_endings_are_read_in_capitals_too(tmp_path):
    path = put(tmp_path, "time,x,y,z\n5,1,2,3\n", "a.CSV")
    assert open_recording(str(path), axis="y", rows=1, columns=1).arrays[0].counts.tolist() == [[2]]
    forces = put(tmp_path, "time,force\n0,4\n", "f.CSV")
    assert add_forces(open_recording(path, axis="y", rows=1), forces).forces.tolist() == [4]


@pytest.mark.parametrize(("first", "covers"), [(1e8, False), (1e8 + 0.25, True)])
def test_times_of_forces_count_from_1970_beyond_1973(tmp_path, first, covers):
    made = make(started=1e8)
    forces = put(tmp_path, f"time_s,force\n{first!r},4\n{first + 1!r},5\n")
    if covers:
        assert add_forces(made, forces).force_times == pytest.approx([0.25, 1.25])
    else:
        with pytest.raises(
            RecordingError, match=r"forces from 100000000\.00 s to 100000001\.00 s do not cover .* 0\.25 s"
        ):
            add_forces(made, forces)


def test_arrays_without_a_pitch_take_that_of_a_sensor_of_their_size(tmp_path):
    """A bag of two arrays of 14 x 6 texels states no pitch."""
    path = write_bag(tmp_path / "a.bag", {"/pad": "schunk_sdh/msg/TactileSensor"}, first=True)
    sensor = TexelArray.grid(14, 6, (5e-3, 4e-3), texel_size=(2e-3, 1e-3), active=np.arange(84) != 3, name="mine")
    found = open_recording(path, sensor=sensor)
    assert [each.texels.name for each in found.arrays] == ["/pad/0", "/pad/1"]
    for each in found.arrays:
        assert (each.texels.pitch, each.texels.texel_size) == ((5e-3, 4e-3), (2e-3, 1e-3))
        assert each.texels.active.tolist() == sensor.active.tolist()
    assert found.setup.other == {}
    turned = open_recording(path, sensor=TexelArray.grid(6, 14, 5e-3))
    assert [each.texels.pitch for each in turned.arrays] == [(3.4e-3, 3.4e-3)] * 2
    stated = put(tmp_path, "# rows = 1\n# columns = 2\n# pitch = 0.002\n# x = 1\ntime,a,b\n0,1,2\n")
    kept = open_recording(stated, sensor=TexelArray.grid(1, 2, 5e-3))
    assert (kept.arrays[0].texels.pitch, kept.setup.other) == ((2e-3, 2e-3), {"x": "1"})


def test_labels_that_are_given_replace_those_before_one_by_one():
    old = Setup(indenter="i", load=2.0, note="n", source="s", device={"gain": 1}, other={"a": "b"})
    made = make(setup=old)
    assert relabel(made, Setup()).setup == old
    assert relabel(made, Setup(indenter="j")).setup == replace(old, indenter="j")
    assert relabel(made, Setup(load=0.0)).setup == replace(old, load=0.0)
    assert relabel(made, Setup(note="m", source="t", other={"c": "d"})).setup == replace(old, note="m")
    assert relabel(made, Setup()).times is made.times


def test_a_saved_file_has_the_times_and_values_of_its_recording(tmp_path):
    """It starts at 1000.5 s; times count from there."""
    made = make(gaps=("one", "two"), forces=np.array([1.5, -2.5]), force_times=np.array([-0.5, 0.125]),
                temperatures=np.array([[20.5, 30.5]]), temperature_times=np.array([0.75]),
                host_monotonic=np.array([7, 8]), ticks=np.array([3, 4]))  # fmt: skip
    assert save(made, tmp_path / "a.mcap") == 2
    at = 1_000_500_000_000
    assert [each[:2] for each in list_messages(tmp_path / "a.mcap", "/diagnostics")] == [(at, at)] * 2
    assert [each[0] for each in list_messages(tmp_path / "a.mcap", "/force")] == [
        at - 5 * SECOND // 10,
        at + SECOND // 8,
    ]
    assert [each[0] for each in list_messages(tmp_path / "a.mcap", "/temperatures")] == [at + 3 * SECOND // 4]
    frames = list_messages(tmp_path / "a.mcap", "/tactile/frame")
    assert [each[:2] for each in frames] == [(at, at), (at + SECOND // 4,) * 2]
    back = open_recording(tmp_path / "a.mcap")
    assert (back.host_monotonic.tolist(), back.ticks.tolist(), back.gaps) == ([7, 8], [3, 4], ("one", "two"))
    assert (back.forces.tolist(), back.temperatures.tolist(), back.serial) == ([1.5, -2.5], [[20.5, 30.5]], "S5")
    assert (back.started, back.setup, back.arrays[0].full_scale) == (made.started, made.setup, 70)
    with pytest.raises(StorageError, match="cannot be written: File exists; name a new file"):
        save(made, tmp_path / "a.mcap")
    assert open_recording(tmp_path / "a.mcap").times.tolist() == [0, 0.25]


def test_unknown_clocks_are_zero_and_a_recording_without_frames_is_saved(tmp_path):
    save(make(), tmp_path / "a.mcap")
    back = open_recording(tmp_path / "a.mcap")
    assert (back.host_monotonic.tolist(), back.ticks.tolist()) == ([0, 0], [0, 0])
    assert save(make(times=()), tmp_path / "b.mcap") == 0
    back = open_recording(tmp_path / "b.mcap")
    assert (back.started.timestamp(), len(back.times)) == (1000.5, 0)


@pytest.mark.parametrize(
    ("started", "earliest", "start"),  # [s, s, us since 1970]
    [(0.0, -2.25e-6, 3), (0.0, -2e-6, 2), (0.0, 1.0, 0), (5e-6, -2.25e-6, 5), (5e-6, -7.5e-6, 8)],
)
@pytest.mark.parametrize("kind", ["forces", "temperatures"])
def test_no_reading_lies_before_1970(tmp_path, started, earliest, start, kind):
    if kind == "forces":
        given = {"forces": np.ones(1), "force_times": np.array([earliest])}
    else:
        given = {"temperatures": np.ones((1, 1)), "temperature_times": np.array([earliest])}
    save(make(started=started, **given), tmp_path / "a.mcap")
    assert list_messages(tmp_path / "a.mcap", "/tactile/frame")[0][1] == 1000 * start
    topic = "/force" if kind == "forces" else "/temperatures"
    assert list_messages(tmp_path / "a.mcap", topic)[0][1] == 1000 * start + round(1e9 * earliest)


@pytest.mark.parametrize("kind", ["forces", "temperatures", "times"])
def test_each_kind_of_time_must_fit(tmp_path, kind):
    late = np.array([2.0**31])
    given = {
        "forces": {"forces": np.ones(1), "force_times": late},
        "temperatures": {"temperatures": np.ones((1, 1)), "temperature_times": late},
        "times": {"times": (0.0, 2.0**31)},
    }[kind]
    with pytest.raises(RecordingError, match=r"made: times up to 2\.147e\+09 s do not fit an MCAP file"):
        save(make(**given), tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_each_array_is_saved_with_its_own_offset_and_forces(tmp_path):
    forces = SimulatedForces(
        texel_forces=np.array([[0.5, 0.25], [0.75, 1.5]]), pressures=np.full((2, 2), np.nan),
        net_force=np.arange(6.0).reshape(2, 3), net_torque=np.arange(6.0).reshape(2, 3) + 10,
        tangential=np.full((2, 2, 2), np.nan),
    )  # fmt: skip
    plain, low = make_array(1, 2, np.array([[5, 6], [7, 8]])), make_array(1, 2, np.array([[-4, 65531], [-2, 0]]))
    save(make(arrays=(plain, low, replace(plain, simulated=forces))), tmp_path / "a.mcap")
    back = open_recording(tmp_path / "a.mcap").arrays
    assert [each.counts.tolist() for each in back] == [[[5, 6], [7, 8]], [[-4, 65531], [-2, 0]], [[5, 6], [7, 8]]]
    assert [each.offset for each in back] == [0, 4, 0]
    assert [each.simulated is None for each in back] == [True, True, False]
    assert back[2].simulated.texel_forces.tolist() == [[0.5, 0.25], [0.75, 1.5]]
    assert back[2].simulated.net_torque.tolist() == [[10, 11, 12], [13, 14, 15]]
    stored = list_messages(tmp_path / "a.mcap", "/tactile_1/frame")[0][2]
    assert struct.pack("<2H", 0, 65535) in stored


@pytest.mark.parametrize("existed", [True, False])
def test_a_file_that_cannot_be_completed_is_removed_unless_it_was_there(tmp_path, monkeypatch, existed):
    path = tmp_path / "a.mcap"
    if existed:
        path.write_bytes(b"old")
    write = os.write

    def fail(handle, data):
        if path.exists() and path.stat().st_size > 0 and not existed:
            raise OSError(errno.ENOSPC, "No space left")
        return write(handle, data)

    monkeypatch.setattr(os, "write", fail)
    words = "name a new file" if existed else r"cannot be written: No space left: .*a\.mcap"
    with pytest.raises(StorageError, match=words):
        save(make(), path)
    assert path.exists() == existed
