"""ROS 1 and ROS 2 recordings of other programs."""

import contextlib
import sqlite3

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from tests.support.ros_bags import COUNTS, write_bag
from validation.recordings import RecordingError, bags
from validation.recordings.importing import open_recording


@pytest.mark.parametrize("first", [True, False], ids=["ros1", "ros2"])
@pytest.mark.parametrize("kind", ["wts_driver/msg/Frame", "schunk_sdh/msg/TactileSensor", "sensor_msgs/msg/Image"])
def test_frames_and_forces_of_public_drivers_are_read(tmp_path, first, kind):
    kinds = {"/pad": kind, "/rig/force": "geometry_msgs/msg/WrenchStamped"}
    path = write_bag(tmp_path / ("a.bag" if first else "bag"), kinds, first=first)
    recording = bags.read(path)
    assert np.array_equal(recording.arrays[0].counts, COUNTS)
    assert recording.times.tolist() == pytest.approx([0, 0.004, 0.008, 0.012, 0.016])
    assert recording.forces.tolist() == [0, 0.5, 1, 1.5, 2]
    if kind == "schunk_sdh/msg/TactileSensor":
        assert np.array_equal(recording.arrays[1].counts, COUNTS + 1)


def test_forces_alone_are_read_from_wrenches(tmp_path):
    rig = write_bag(tmp_path / "rig.bag", {"/rig": "geometry_msgs/msg/WrenchStamped"}, first=True)
    times, forces = bags.read_forces(rig)
    assert forces.tolist() == [0, 0.5, 1, 1.5, 2]
    assert np.allclose(np.diff(times), 0.004, atol=1e-6)
    with pytest.raises(RecordingError, match="no forces; expected a topic of wrenches"):
        bags.read_forces(write_bag(tmp_path / "a.bag", {"/pad": "sensor_msgs/msg/Image"}, first=True))


def test_one_of_several_topics_must_be_named(tmp_path):
    path = write_bag(
        tmp_path / "a.bag", {"/left": "sensor_msgs/msg/Image", "/right": "wts_driver/msg/Frame"}, first=True
    )
    with pytest.raises(RecordingError, match="name one of /left, /right"):
        bags.read(path)
    assert np.array_equal(bags.read(path, topic="/right").arrays[0].counts, COUNTS)
    with pytest.raises(RecordingError, match="no tactile frames on /nowhere"):
        bags.read(path, topic="/nowhere")


def write_flat(path, sides=()):
    """Write two messages of 12 counts, whose layout may state the rows and columns."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "std_msgs/msg/UInt16MultiArray"
    side = store.types["std_msgs/msg/MultiArrayDimension"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"](
        dim=[side(label="", size=size, stride=1) for size in sides], data_offset=0
    )
    with Writer(path, version=9) as writer:
        connection = writer.add_connection("/pad", kind, typestore=store)
        for time in (7, 5):
            data = (np.arange(12) + 100 * time).astype(np.uint16)
            writer.write(connection, time, store.serialize_cdr(store.types[kind](layout=layout, data=data), kind))
    return path


def test_rows_and_columns_that_a_message_does_not_state_are_taken_from_the_caller(tmp_path):
    flat = write_flat(tmp_path / "flat")
    for part in ({}, {"rows": 4}, {"columns": 3}):
        with pytest.raises(RecordingError, match="no tactile frames; known are"):
            open_recording(flat, **part)
    recording = open_recording(flat, rows=4, columns=3)
    (array,) = recording.arrays
    assert (array.texels.rows, array.texels.columns) == (4, 3)
    assert array.counts.tolist() == [list(range(500, 512)), list(range(700, 712))]  # in the order of time
    assert recording.times.tolist() == pytest.approx([0, 2e-9])
    assert (recording.setup.source, recording.setup.note) == ("flat", "from /pad")
    assert recording.setup.source_sha256 == recording.sha256
    stated = open_recording(write_flat(tmp_path / "stated", sides=(2, 6)), rows=4, columns=3).arrays[0].texels
    assert (stated.rows, stated.columns) == (2, 6)


def test_topics_of_unknown_type_are_left_out(tmp_path):
    folder = write_bag(tmp_path / "bag", {"/own": "wts_driver/msg/Frame", "/pad": "sensor_msgs/msg/Image"}, first=False)
    (stored,) = folder.glob("*.db3")
    with contextlib.closing(sqlite3.connect(stored)) as base, base:
        base.execute("DELETE FROM message_definitions WHERE topic_type LIKE 'wts_driver%'")
    assert [array.texels.name for array in open_recording(folder).arrays] == ["/pad"]


def test_public_types_are_known_to_bags_that_define_none_as_before_ros_2_iron(tmp_path):
    kinds = {"/pad": "sensor_msgs/msg/Image", "/rig/force": "geometry_msgs/msg/WrenchStamped"}
    folder = write_bag(tmp_path / "bag", kinds, first=False)
    (stored,) = folder.glob("*.db3")
    with contextlib.closing(sqlite3.connect(stored)) as base, base:
        base.execute("DELETE FROM message_definitions")
    recording = open_recording(folder)
    assert np.array_equal(recording.arrays[0].counts, COUNTS)
    assert recording.forces.tolist() == [0, 0.5, 1, 1.5, 2]
