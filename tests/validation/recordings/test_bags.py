"""Bags of other programs: frames and forces are read; hostile, damaged and compressed bags are refused."""

import contextlib
import os
import resource
import signal
import sqlite3
import struct
import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from mcap.stream_reader import zstandard
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.support.bounded import bounded
from tests.support.ros_bags import COUNTS, write_bag
from validation.recordings import RecordingError, bags
from validation.recordings import recording as recordings
from validation.recordings.importing import add_forces, open_recording
from validation.recordings.mcap_writer import encode


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


def write_messages(path, messages, compression=None):
    """Write a ROS 2 folder of messages of standard types: topic, type, time [ns] and fields."""
    store = get_typestore(Stores.ROS2_JAZZY)
    writer, topics = Writer(path, version=9), {}
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        for topic, kind, time, fields in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], time, encode(kind, **fields))
    return path


def lay_out(*sides):
    return {"dim": [{"label": "", "size": size, "stride": 1} for size in sides], "data_offset": 0}


def write_flat(path, sides=()):
    """Write two messages of 12 counts, whose layout may state the rows and columns."""
    kind, counts = "std_msgs/msg/UInt16MultiArray", np.arange(12)
    values = {time: (counts + 100 * time).astype(np.uint16) for time in (7, 5)}
    return write_messages(
        path, [("/pad", kind, time, {"layout": lay_out(*sides), "data": data}) for time, data in values.items()]
    )


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


@pytest.mark.parametrize("lost", ["wts_driver%", "%"])
def test_topics_of_unknown_type_are_left_out_and_public_types_need_no_definition(tmp_path, lost):
    """Before ROS 2 Iron, bags define no types."""
    kinds = {"/own": "wts_driver/msg/Frame", "/pad": "sensor_msgs/msg/Image", "/rig": "geometry_msgs/msg/WrenchStamped"}
    folder = write_bag(tmp_path / "bag", kinds, first=False)
    (stored,) = folder.glob("*.db3")
    with contextlib.closing(sqlite3.connect(stored)) as base, base:
        base.execute("DELETE FROM message_definitions WHERE topic_type LIKE ?", (lost,))
    recording = open_recording(folder)
    assert [array.texels.name for array in recording.arrays] == ["/pad"]
    assert np.array_equal(recording.arrays[0].counts, COUNTS)
    assert recording.forces.tolist() == [0, 0.5, 1, 1.5, 2]


#: More than any bag of these sizes may unpack to [bytes].
BOMB = 2**30


def pack_zeros(size):
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    return b"".join([packer.compress(bytes(2**24)) for _ in range(size // 2**24)]) + packer.flush()


def record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def text(value):
    return struct.pack("<I", len(value)) + value


def write_mcap_bomb(path, content=None):
    """Write an MCAP file of another program, whose only chunk unpacks to `BOMB` zeros, or to the given bytes."""
    schema = record(3, struct.pack("<H", 1) + text(b"x/msg/Y") + text(b"ros2msg") + text(b"uint8 a"))
    channel = record(4, struct.pack("<HH", 1, 1) + text(b"/pad") + text(b"cdr") + text(b""))
    size = BOMB if content is None else len(content)
    packed = pack_zeros(BOMB) if content is None else zstandard.compress(content)
    chunk = record(6, struct.pack("<QQQI", 0, 1, size, 0) + text(b"zstd") + struct.pack("<Q", len(packed)) + packed)
    head, end = b"\x89MCAP0\r\n", record(15, bytes(4)) + record(2, bytes(20))
    path.write_bytes(head + record(1, text(b"ros2") + text(b"other")) + schema + channel + chunk + end + head)


@pytest.mark.slow
def test_reading_ends_at_the_limit_of_its_time_and_leaves_no_timer(tmp_path, monkeypatch):
    """A chunk of millions of empty records: a library reads them for minutes."""
    write_mcap_bomb(tmp_path / "slow.mcap", content=bytes(9 * 2**20))
    monkeypatch.setattr(recordings, "LIMITS", replace(recordings.LIMITS, seconds=0.3))
    before = signal.getsignal(signal.SIGPROF)
    refused = r"slow\.mcap: takes more than the \d+ s of processor time accepted"
    with bounded(150), pytest.raises(RecordingError, match=refused):
        open_recording(tmp_path / "slow.mcap")
    assert (signal.getitimer(signal.ITIMER_PROF)[0], signal.getsignal(signal.SIGPROF)) == (0.0, before)


def write_one(path, kind, definition, message, *, times=(5,)):
    """Write a ROS 1 bag of one topic with a message type of its own."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(definition, kind))
    with Writer1(path) as writer:
        connection = writer.add_connection("/pad", kind, typestore=store)
        for time in times:
            writer.write(connection, time, store.serialize_ros1(store.types[kind](**message), kind))
    return path


@pytest.mark.slow
def test_a_chunk_that_unpacks_to_a_gigabyte_is_refused_within_the_memory_for_its_size(tmp_path):
    """In a process of its own, to see its peak."""
    write_mcap_bomb(tmp_path / "bomb.mcap")
    assert (tmp_path / "bomb.mcap").stat().st_size < 2**20
    script = """
import resource, sys
from validation.recordings import RecordingError, recording
from validation.recordings.importing import open_recording
import rosbags.highlevel
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    open_recording(sys.argv[1])
except RecordingError as error:
    print(error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024, resource.getrlimit(resource.RLIMIT_AS)[0])
"""
    words = [sys.executable, "-c", script, str(tmp_path / "bomb.mcap")]
    out = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()  # noqa: S603 -- this test's own script
    assert "unpacks to more than the 40" in out[0]
    added, limit = out[1].split()
    assert float(added) < 500
    assert int(limit) == resource.getrlimit(resource.RLIMIT_AS)[0]


@pytest.mark.parametrize(
    "mode",
    [CompressionMode.FILE, pytest.param(CompressionMode.MESSAGE, marks=pytest.mark.slow)],
    ids=["file", "message"],
)
def test_a_compressed_folder_is_read_and_one_that_unpacks_to_a_gigabyte_is_refused(tmp_path, mode):
    values = np.arange(6, dtype=np.uint8)
    fields = {"layout": lay_out(3, 2), "data": values}
    write_messages(tmp_path / "bag", [("/pad", "std_msgs/msg/UInt8MultiArray", 5, fields)], mode)
    assert open_recording(tmp_path / "bag").arrays[0].counts.tolist() == [values.tolist()]
    (stored,) = (file for file in (tmp_path / "bag").iterdir() if file.name != "metadata.yaml")
    if mode is CompressionMode.FILE:
        stored.write_bytes(pack_zeros(BOMB))
    else:
        with contextlib.closing(sqlite3.connect(stored)) as base, base:
            base.execute("UPDATE messages SET data = ?", (pack_zeros(BOMB),))
    with pytest.raises(RecordingError, match=r"unpacks to more than the|File too large"):
        open_recording(tmp_path / "bag")
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != stored.stat().st_size


def test_a_pipe_in_a_folder_is_refused_and_never_waited_for(tmp_path):
    folder = write_bag(tmp_path / "bag", {"/pad": "wts_driver/msg/Frame"}, first=False)
    os.mkfifo(folder / "pipe")
    with pytest.raises(RecordingError, match="is no regular file"):
        open_recording(folder)


def test_large_bags_are_refused_before_they_are_opened(tmp_path):
    with (tmp_path / "a.bag").open("wb") as file:
        file.truncate(2**32 + 1)
    folder = write_bag(tmp_path / "bag", {"/pad": "wts_driver/msg/Frame"}, first=False)
    (folder / "metadata.yaml").write_text((folder / "metadata.yaml").read_text() + "# " + "x" * 2**18)
    many = tmp_path / "many"
    many.mkdir()
    for number in range(1001):
        (many / f"{number}.db3").touch()
    good = open_recording(write_flat(tmp_path / "good", sides=(3, 4)))
    for path in (tmp_path / "a.bag", folder, many):
        for read in (open_recording, partial(add_forces, good)):
            with pytest.raises(RecordingError, match="too large; accepted: 4096 MiB in 1000 files"):
                read(path)


def test_deep_metadata_is_refused_before_it_is_parsed(tmp_path):
    folder = write_bag(tmp_path / "bag", {"/pad": "wts_driver/msg/Frame"}, first=False)
    good = (folder / "metadata.yaml").read_text()
    for depth, refused in ((30, False), (2000, True)):
        (folder / "metadata.yaml").write_text(f"{good}\nmore: {'[' * depth}{']' * depth}\n")
        if refused:
            with pytest.raises(RecordingError, match=r"metadata\.yaml: has brackets more than 32 deep"):
                open_recording(folder)
        else:
            assert np.array_equal(open_recording(folder).arrays[0].counts, COUNTS)


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("uint32 rows\nuint32 cols\nuint32[] data", {"rows": 1, "cols": 1, "data": np.array([2**31], np.uint32)}),
        ("string rows\nuint8 cols\nuint8[] data", {"rows": "3", "cols": 2, "data": np.arange(6, dtype=np.uint8)}),
        ("uint8 rows\nuint8 cols\nfloat64[] data", {"rows": 1, "cols": 1, "data": np.array([1e300])}),
        ("uint8 rows\nuint8 cols\nuint8[] data", {"rows": 0, "cols": 0, "data": np.zeros(0, np.uint8)}),
        ("uint32 rows\nuint32 cols\nuint8[] data", {"rows": 101, "cols": 100, "data": np.zeros(10_100, np.uint8)}),
        ("string encoding\nstring height\nstring width\nstring step\nuint8 is_bigendian\nuint8[] data",
         {"encoding": "mono8", "height": "a", "width": "b", "step": "c", "is_bigendian": 0,
          "data": np.zeros(1, np.uint8)}),
        ("uint8[] encoding\nuint8[] data", {"encoding": np.zeros(3, np.uint8), "data": np.zeros(1, np.uint8)}),
    ],
    ids=["count", "type", "float", "empty", "texels", "image", "encoding"],
)  # fmt: skip
def test_messages_of_wrong_types_and_sizes_are_refused_in_one_line(tmp_path, definition, message):
    path = write_one(tmp_path / "a.bag", "x/msg/Y", definition, message)
    with pytest.raises(RecordingError) as caught:
        open_recording(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "definition"),
    [
        ("x/msg/Y", "uint8 a; open({!r}, 'w')"),
        ("x/msg/Y", "uint8[open({!r}, 'w')] a"),
        ("x/msg/Y", "string S='\\' + str(open({!r}, 'w')) + '\nuint8 a"),
        ("x/msg/Y", 'string S="""; open({!r}, "w")\nuint8 a'),
        ("x/msg/Y:\n    open({!r}, 'w')\nclass Z", "uint8 a"),
        ("x/msg/Y' + str(open({!r}, 'w')) + '", "uint8 a"),
    ],
)
def test_definitions_of_messages_run_no_code_of_theirs(tmp_path, kind, definition):
    made = tmp_path / "made"
    with Writer1(tmp_path / "a.bag") as writer:
        texts = (text.replace("{!r}", repr(str(made))) for text in (kind, definition))
        connection = writer.add_connection("/pad", next(texts), msgdef=next(texts), md5sum="0" * 32)
        writer.write(connection, 5, b"\x01")
    with pytest.raises(RecordingError):
        open_recording(tmp_path / "a.bag")
    assert not made.exists()


def test_a_camera_beside_the_array_is_left_out(tmp_path):
    def image(topic, rows, columns):
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
        size = {"height": rows, "width": columns, "step": columns, "data": np.zeros(rows * columns, np.uint8)}
        return topic, "sensor_msgs/msg/Image", 5, {"header": header, "encoding": "mono8", "is_bigendian": 0, **size}

    write_messages(tmp_path / "bag", [image("/camera", 240, 320), image("/pad", 14, 6)])
    (array,) = open_recording(tmp_path / "bag").arrays
    assert array.counts.shape == (1, 84)


PIXELS = [[0, 1, 513], [3, 4, 65535]]


@pytest.mark.parametrize(
    ("encoding", "kind", "step", "big"),
    [
        pytest.param("mono16", "<u2", 6, 0, marks=pytest.mark.slow),
        ("16UC1", ">u2", 6, 1),
        pytest.param("mono16", "<u2", 8, 0, marks=pytest.mark.slow),
        pytest.param("mono8", "u1", 3, 0, marks=pytest.mark.slow),
        pytest.param("8UC1", "u1", 5, 1, marks=pytest.mark.slow),
    ],
)
def test_images_are_read_in_both_orders_of_bytes_and_without_padding(tmp_path, encoding, kind, step, big):
    pixels = (np.array(PIXELS) % 2 ** (8 * np.dtype(kind).itemsize)).astype(kind)
    lines = np.zeros((2, step), dtype=np.uint8)
    lines[:, : 3 * pixels.itemsize] = pixels.view(np.uint8)
    wrench = {"force": dict(zip("xyz", (7.0, 8.0, -1.5), strict=True)), "torque": dict.fromkeys("xyz", 9.0)}

    def header(seconds):
        return {"stamp": {"sec": seconds, "nanosec": 500_000_000 * (seconds > 0)}, "frame_id": ""}

    size = {"height": 2, "width": 3, "step": step, "encoding": encoding, "is_bigendian": big, "data": lines.ravel()}
    messages = [  # received at 1 and 9 s; the stamps, if any, state 3.5 and 4.5 s
        ("/pad", "sensor_msgs/msg/Image", 9 * 10**9, {"header": header(4), **size}),
        ("/pad", "sensor_msgs/msg/Image", 1 * 10**9, {"header": header(3), **size}),
        ("/rig", "geometry_msgs/msg/WrenchStamped", 6 * 10**9, {"header": header(0), "wrench": wrench}),
    ]
    found = bags.read(write_messages(tmp_path / "bag", messages))
    assert found.arrays[0].counts.tolist() == [pixels.ravel().tolist()] * 2
    assert (found.arrays[0].texels.rows, found.arrays[0].texels.columns) == (2, 3)
    assert found.started.timestamp() == 3.5
    assert (found.times.tolist(), found.forces.tolist(), found.force_times.tolist()) == ([0, 1], [-1.5], [2.5])
    times, forces = bags.read_forces(tmp_path / "bag")
    assert (times.tolist(), forces.tolist()) == ([6.0], [-1.5])
    short = [(*messages[0][:3], {**messages[0][3], "step": 3 * pixels.itemsize - 1})]
    with pytest.raises(RecordingError, match="an image of 2 x 3 pixels has"):
        bags.read(write_messages(tmp_path / "short", short))
