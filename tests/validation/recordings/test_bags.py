"""ROS 1 and ROS 2 recordings of other programs."""

import numpy as np
import pytest

from tests.support.ros_bags import COUNTS, write_bag
from validation.recordings import RecordingError, bags


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
