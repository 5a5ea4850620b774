"""Every format comes into one labelled form with the same numbers."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from validation.recordings import tables
from validation.recordings.importing import add_forces, open_recording, relabel, save
from validation.recordings.recording import RecordingError, Setup

FOLDER = Path(os.environ.get("SOFTCOVER_RECORDINGS", "../shared/recordings"))
FILES = sorted(FOLDER.rglob("*.dsa"))
START = 1_600_000_000_000_000_000
COUNTS = np.arange(5)[:, None] * 100 + np.arange(84)


def _differences(back, recording):
    """What of a recording did not come back as it was."""
    same = {
        "times": np.allclose(back.times, recording.times, rtol=0, atol=1e-8),
        "started": back.started == recording.started,
        "serial": back.serial == recording.serial,
        "temperatures": np.array_equal(back.temperatures, recording.temperatures),
        "temperature_times": np.allclose(back.temperature_times, recording.temperature_times, rtol=0, atol=1e-6),
    }
    for number, (mine, theirs) in enumerate(zip(back.arrays, recording.arrays, strict=True)):
        same[f"counts {number}"] = np.array_equal(mine.counts, theirs.counts)
        same[f"enabled {number}"] = np.array_equal(mine.enabled, theirs.enabled)
        same[f"layout {number}"] = mine.has_layout_of(theirs.texels)
        for name in ("full_scale", "centre", "rotation"):
            same[f"{name} {number}"] = getattr(mine, name) == getattr(theirs, name)
    return [name for name, kept in same.items() if not kept]


def _through_mcap(file, folder):
    """A recording, and the same after it went through a file of ours."""
    recording = relabel(open_recording(file), Setup(indenter="box:size=10.5mmx10.5mmx5mm", load=4.9, note="A"))
    frames = save(recording, folder / f"{file.stem}.mcap")
    assert frames == len(recording.times)
    return recording, open_recording(folder / f"{file.stem}.mcap")


@pytest.mark.skipif(not FILES, reason="the recordings are not here")
def test_a_recording_of_six_masked_arrays_goes_through_mcap(tmp_path):
    recording, back = _through_mcap(next(file for file in FILES if file.name == "masked_matrix.dsa"), tmp_path)
    assert _differences(back, recording) == []
    assert back.setup == replace(recording.setup, source_sha256=recording.sha256)


@pytest.mark.slow
@pytest.mark.skipif(not FILES, reason="the recordings are not here")
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_recording_goes_through_mcap(file, tmp_path):
    recording, back = _through_mcap(file, tmp_path)
    assert _differences(back, recording) == []
    assert back.setup == replace(recording.setup, source_sha256=recording.sha256)


CSV = """# rows = 2
# columns = 3
# load = 1.5
# indenter = sphere:radius=5mm
time,force,temperature,a,b,c,d,e,f
10.0,0.1,30.5,0,1,2,3,4,5
10.5,0.2,30.6,6,7,8,9,10,4095
"""


def test_csv(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(CSV)
    recording = open_recording(path)
    assert recording.arrays[0].counts.tolist() == [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, 4095]]
    assert recording.times.tolist() == [0, 0.5]
    assert recording.forces.tolist() == [0.1, 0.2]
    assert recording.temperatures.tolist() == [[30.5], [30.6]]
    assert (recording.setup.load, recording.setup.indenter) == (1.5, "sphere:radius=5mm")
    save(recording, tmp_path / "a.mcap")
    back = open_recording(tmp_path / "a.mcap")
    assert _differences(back, recording) == []
    assert back.forces.tolist() == [0.1, 0.2]
    assert np.allclose(back.force_times, [0, 0.5])
    tables.write(back, tmp_path / "b.csv")
    again = open_recording(tmp_path / "b.csv")
    assert np.array_equal(again.arrays[0].counts, recording.arrays[0].counts)
    assert again.setup.load == 1.5


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("10.5,0.2", "9.5,0.2", "line 7: time 9.5 s comes before"),
        ("9,10,4095", "9,10,x", "line 7: not a number"),
        ("9,10,4095", "9,10", "line 7: 8 columns; expected 9"),
        ("9,10,4095", "9,10,-1", "line 7: counts must be whole"),
        ("9,10,4095", "9,10,0.5", "line 7: counts must be whole"),
        ("9,10,4095", "9,10,nan", "line 7: counts must be whole"),
        ("time,force", "force,time", "line 5: expected the columns"),
        ("# rows = 2\n", "# rows = 4\n", "6 texels are not 4 rows x 3 columns"),
        ("# rows = 2\n# columns = 3\n", "", "name both"),
        ("# load = 1.5", "# load = heavy", "not a number"),
    ],
)
def test_csv_faults_name_their_line(tmp_path, old, new, what):
    path = tmp_path / "a.csv"
    path.write_text(CSV.replace(old, new))
    with pytest.raises(RecordingError, match=what):
        open_recording(path)


def _store(kind):
    store = get_typestore(kind)
    store.register(
        get_types_from_msg(
            "std_msgs/Header header\nuint8 rows\nuint8 cols\nfloat32 cell_width\nuint16[] data", "wts_driver/msg/Frame"
        )
    )
    store.register(
        get_types_from_msg(
            "int32 matrix_id\nint32 cells_x\nint32 cells_y\nint16[] tactile_array", "schunk_sdh/msg/TactileMatrix"
        )
    )
    store.register(
        get_types_from_msg(
            "std_msgs/Header header\nschunk_sdh/TactileMatrix[] tactile_matrix", "schunk_sdh/msg/TactileSensor"
        )
    )
    return store


def _header(store, number, *, first):
    stamp = store.types["builtin_interfaces/msg/Time"](sec=1_600_000_000, nanosec=number * 4_000_000)
    extra = {"seq": number} if first else {}
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="pad", **extra)


def _message(store, kind, number, *, first):
    types, header = store.types, _header(store, number, first=first)
    counts = COUNTS[number]
    if kind == "wts_driver/msg/Frame":
        data = counts.astype(np.uint16)
        return types[kind](header=header, rows=14, cols=6, cell_width=3.4, data=data)
    if kind == "schunk_sdh/msg/TactileSensor":
        part = types["schunk_sdh/msg/TactileMatrix"]
        parts = [
            part(matrix_id=n, cells_x=6, cells_y=14, tactile_array=(counts + n).astype(np.int16)) for n in range(2)
        ]
        return types[kind](header=header, tactile_matrix=parts)
    if kind == "geometry_msgs/msg/WrenchStamped":
        vector = types["geometry_msgs/msg/Vector3"]
        wrench = types["geometry_msgs/msg/Wrench"](
            force=vector(x=1.0, y=2.0, z=0.5 * number), torque=vector(x=0, y=0, z=0)
        )
        return types[kind](header=header, wrench=wrench)
    padded = np.zeros((14, 16), dtype=np.uint8)
    padded[:, :12] = counts.astype(">u2").view(np.uint8).reshape(14, 12)
    return types[kind](
        header=header, height=14, width=6, encoding="mono16", is_bigendian=1, step=16, data=padded.ravel()
    )


def _bag(path, kinds, *, first):
    store = _store(Stores.ROS1_NOETIC if first else Stores.ROS2_JAZZY)
    with Writer1(path) if first else Writer2(path, version=9) as writer:
        for topic, kind in kinds.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for number in range(5):
                message = _message(store, kind, number, first=first)
                data = store.serialize_ros1(message, kind) if first else store.serialize_cdr(message, kind)
                writer.write(connection, START + number, data)
    return path


@pytest.mark.parametrize("first", [True, False], ids=["ros1", "ros2"])
@pytest.mark.parametrize("kind", ["wts_driver/msg/Frame", "schunk_sdh/msg/TactileSensor", "sensor_msgs/msg/Image"])
def test_bags_of_other_programs(tmp_path, first, kind):
    kinds = {"/pad": kind, "/rig/force": "geometry_msgs/msg/WrenchStamped"}
    path = _bag(tmp_path / ("a.bag" if first else "bag"), kinds, first=first)
    recording = open_recording(path)
    assert np.array_equal(recording.arrays[0].counts, COUNTS)
    assert recording.times.tolist() == pytest.approx([0, 0.004, 0.008, 0.012, 0.016])
    assert recording.forces.tolist() == [0, 0.5, 1, 1.5, 2]
    if kind == "schunk_sdh/msg/TactileSensor":
        assert np.array_equal(recording.arrays[1].counts, COUNTS + 1)
    save(recording, tmp_path / "a.mcap")
    assert _differences(open_recording(tmp_path / "a.mcap"), replace(recording, serial="")) == []


def test_a_force_sensor_with_a_file_of_its_own(tmp_path):
    bag = _bag(tmp_path / "a.bag", {"/pad": "sensor_msgs/msg/Image"}, first=True)
    rig = _bag(tmp_path / "rig.bag", {"/rig": "geometry_msgs/msg/WrenchStamped"}, first=True)
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


def test_a_choice_of_topics(tmp_path):
    path = _bag(tmp_path / "a.bag", {"/left": "sensor_msgs/msg/Image", "/right": "wts_driver/msg/Frame"}, first=True)
    with pytest.raises(RecordingError, match="name one of /left, /right"):
        open_recording(path)
    assert np.array_equal(open_recording(path, topic="/right").arrays[0].counts, COUNTS)
    with pytest.raises(RecordingError, match="no tactile frames on /nowhere"):
        open_recording(path, topic="/nowhere")


def test_our_own_images_can_be_read_as_foreign_ones(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(CSV)
    save(open_recording(path), tmp_path / "a.mcap")
    foreign = open_recording(tmp_path / "a.mcap", topic="/tactile/image")
    assert foreign.arrays[0].counts.tolist() == [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, 4095]]


def test_bad_input(tmp_path):
    text = tmp_path / "a.txt"
    text.write_text("hello")
    for name, what in (
        (text, "not a recording; accepted: .dsa, .csv, .mcap"),
        (tmp_path / "none.bag", "no such file"),
        (tmp_path, "not a ROS bag"),
    ):
        with pytest.raises(RecordingError, match=what):
            open_recording(name)
    for suffix in ("bag", "mcap", "db3"):
        broken = tmp_path / f"b.{suffix}"
        broken.write_bytes(b"\x00nonsense")
        with pytest.raises(RecordingError, match=r"not a ROS bag|not an MCAP file"):
            open_recording(broken)
    with pytest.raises(ValueError, match="0 N or more"):
        Setup(load=-1)
