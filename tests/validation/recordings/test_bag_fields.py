"""Messages of other programs' bags: names of fields, shapes, times, forces, and limits, written by hand."""

import hashlib
import re

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from validation.recordings import RecordingError, bags
from validation.recordings import recording as recordings

SECOND = 10**9
#: Definition of a message by its type; numbers of rows and columns have public names of drivers.
DEFINITIONS = {
    "a/msg/Rows": "uint8 rows\nuint8 columns\nuint8 cells_y\nuint16[] counts\nuint8[] data",
    "a/msg/Cols": "uint8 height\nuint8 cols\nuint8 width\nint32[] values",
    "a/msg/Cells": "uint8 cells_y\nuint8 cells_x\nint16[] tactile_array\nint16[] values",
    "a/msg/Size": "uint8 height\nuint8 width\nfloat32[] data",
    "a/msg/Stamped": "std_msgs/Header header\nuint8 rows\nuint8 cols\nuint8[] data",
    "a/msg/Wide": "uint32 rows\nuint32 cols\nint64[] data",
    "a/msg/Half": "uint8 rows\nuint8[] data",
    "a/msg/One": "uint8 rows\nuint8 cols\nuint8 data",
    "a/msg/Part": "uint8 rows\nuint8 cols\nuint8[] data\nstring matrix_id",
    "a/msg/Parts": "a/Part[] tactile_matrix",
    "a/msg/Nameless": "uint8 rows\nuint8 cols\nuint8[] data",
    "a/msg/NamelessParts": "a/Nameless[] tactile_matrix",
    "a/msg/Push": "geometry_msgs/Vector3 force",
    "a/msg/Named": "a/Push wrench",
}
STORE = get_typestore(Stores.ROS1_NOETIC)
for _kind, _definition in DEFINITIONS.items():
    STORE.register(get_types_from_msg(_definition, _kind))


def make(kind, **fields):
    return STORE.types[kind](**fields)


def write(folder, *messages, name="a.bag"):
    """Write a ROS 1 bag of messages: topic, time at which it was received [ns], and message."""
    topics = {}
    with Writer(folder / name) as writer:
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(topics[topic], time, STORE.serialize_ros1(message, kind))
    return folder / name


def stamped(seconds, nanoseconds, counts, *, rows=1):
    time = make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    header = make("std_msgs/msg/Header", seq=0, stamp=time, frame_id="x")
    return make("a/msg/Stamped", header=header, rows=rows, cols=len(counts) // rows, data=np.array(counts, np.uint8))


def wide(counts, rows=1):
    return make("a/msg/Wide", rows=rows, cols=len(counts) // rows, data=np.array(counts, np.int64))


SIX = np.arange(6) + 10
TWELVE = np.arange(12)


@pytest.mark.parametrize(
    ("message", "shape", "counts"),
    [
        (make("a/msg/Rows", rows=2, columns=3, cells_y=6, counts=SIX.astype(np.uint16), data=np.zeros(6, np.uint8)),
         (2, 3), SIX),
        (make("a/msg/Cols", height=3, cols=2, width=9, values=SIX.astype(np.int32)), (3, 2), SIX),
        (make("a/msg/Cells", cells_y=6, cells_x=1, tactile_array=SIX.astype(np.int16), values=np.ones(6, np.int16)),
         (6, 1), SIX),
        (make("a/msg/Size", height=2, width=3, data=SIX.astype(np.float32)), (2, 3), SIX),
        (wide([2**31 - 1, 0]), (1, 2), [2**31 - 1, 0]),
    ],
    ids=["rows", "cols", "cells", "size", "wide"],
)  # fmt: skip
def test_fields_with_public_names_are_read_in_their_order(tmp_path, message, shape, counts):
    path = write(tmp_path, ("/pad/x", 5 * SECOND, message))
    found = bags.read(str(path))
    (array,) = found.arrays
    assert (array.texels.rows, array.texels.columns, array.texels.name) == (*shape, "/pad/x")
    assert array.counts.tolist() == [list(counts)]
    assert array.counts.dtype == np.int32
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert (found.path, found.sha256, found.started.timestamp()) == (path, digest, 5)
    assert (found.setup.source, found.setup.source_sha256, found.setup.note) == ("a.bag", digest, "from /pad/x")
    assert found.setup.other == {"pitch assumed": "3.4 mm"}
    assert (array.full_scale, array.texels.pitch) == (4095, (3.4e-3, 3.4e-3))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (make("a/msg/Size", height=1, width=2, data=np.array([1, 2.5], np.float32)), "values are no counts"),
        (make("a/msg/Size", height=1, width=2, data=np.array([1, -1], np.float32)), "values are no counts"),
        (make("a/msg/Size", height=1, width=2, data=np.array([1, np.nan], np.float32)), "values are no counts"),
        (make("a/msg/Size", height=1, width=2, data=np.array([1, np.inf], np.float32)), "values are no counts"),
        (wide([1, 2**31]), "/pad: a count of 2147483648; at most 2147483647 are accepted"),
        (make("a/msg/Size", height=1, width=3, data=np.array([1, 2], np.float32)), "no tactile frames; known are"),
        (make("a/msg/Size", height=0, width=3, data=np.array([], np.float32)), "no tactile frames"),
        (make("a/msg/One", rows=1, cols=1, data=5), "no tactile frames"),
        (make("a/msg/Half", rows=1, data=np.ones(1, np.uint8)), "no tactile frames"),
        (make("a/msg/NamelessParts", tactile_matrix=[make("a/msg/Nameless", rows=1, cols=1, data=np.ones(1, np.uint8))
                                                     for _ in range(65)]),
         "/pad: holds 65 arrays; at most 64 are accepted"),
    ],
    ids=range(10),
)  # fmt: skip
def test_messages_that_hold_no_counts_are_refused(tmp_path, message, words):
    path = write(tmp_path, ("/pad", 5, message))
    with pytest.raises(RecordingError, match=re.escape(words)) as caught:
        bags.read(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_rows_and_columns_of_the_caller_serve_messages_that_state_one_or_none(tmp_path):
    path = write(tmp_path, ("/pad", 5, make("a/msg/Half", rows=9, data=SIX.astype(np.uint8))))
    texels = bags.read(path, rows=3, columns=2).arrays[0].texels
    assert (texels.rows, texels.columns) == (3, 2)
    for options in ({"rows": 3}, {"columns": 2}, {"rows": 3, "columns": 3}):
        with pytest.raises(RecordingError, match=r"a\.bag: no tactile frames; known are images and grids of at most"):
            bags.read(path, **options)


def test_ten_thousand_texels_are_the_most(tmp_path):
    assert bags.read(write(tmp_path, ("/pad", 5, wide([1] * 10_000, rows=100)))).arrays[0].counts.shape == (1, 10_000)
    with pytest.raises(RecordingError, match="grids of at most 10000 texels"):
        bags.read(write(tmp_path, ("/pad", 5, wide([1] * 10_001)), name="b.bag"))


def test_frames_are_ordered_by_their_stamp_or_the_time_of_reception(tmp_path):
    path = write(
        tmp_path,
        ("/pad", 30 * SECOND, stamped(7, 500_000_000, [3, 4])),
        ("/pad", 20 * SECOND, stamped(6, 250_000_000, [1, 2])),
        ("/pad", 8 * SECOND, stamped(0, 999, [5, 6])),  # no stamp
    )
    found = bags.read(path)
    assert found.arrays[0].counts.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert (found.started.timestamp(), found.times.tolist()) == (6.25, [0, 1.25, 1.75])
    assert (found.forces.shape, found.force_times.shape) == ((0,), (0,))


def push(kind, z):
    force = make("geometry_msgs/msg/Vector3", x=10.0, y=20.0, z=z)
    if kind == "a/msg/Push":
        return make(kind, force=force)
    if kind == "a/msg/Named":
        return make(kind, wrench=make("a/msg/Push", force=force))
    torque = make("geometry_msgs/msg/Vector3", x=30.0, y=40.0, z=50.0)
    return make(kind, force=force, torque=torque)


@pytest.mark.parametrize("kind", ["a/msg/Push", "a/msg/Named", "geometry_msgs/msg/Wrench"])
def test_the_third_part_of_a_force_is_read(tmp_path, kind):
    messages = [
        ("/f", 9 * SECOND, push(kind, -1.5)),
        ("/f", 4 * SECOND, push(kind, 2.5)),
        ("/pad", 5 * SECOND, wide([1])),
    ]
    path = write(tmp_path, *messages)
    found = bags.read(path)
    assert (found.forces.tolist(), found.force_times.tolist()) == ([2.5, -1.5], [-1, 4])
    times, forces = bags.read_forces(str(path))
    assert (times.tolist(), forces.tolist()) == ([4, 9], [2.5, -1.5])


def parts(*arrays, named=True):
    one = "a/msg/Part" if named else "a/msg/Nameless"
    made = [
        make(one, rows=1, cols=len(counts), data=np.array(counts, np.uint8), **({"matrix_id": name} if named else {}))
        for name, counts in arrays
    ]
    return make("a/msg/Parts" if named else "a/msg/NamelessParts", tactile_matrix=made)


@pytest.mark.parametrize("named", [True, False])
def test_parts_of_a_message_are_arrays_by_their_name_or_number(tmp_path, named):
    first, second = (
        parts(("left", [1, 2]), ("right", [3]), named=named),
        parts(("left", [4, 5]), ("right", [6]), named=named),
    )
    found = bags.read(write(tmp_path, ("/pad", 5, first), ("/pad", 6, second)))
    assert [each.counts.tolist() for each in found.arrays] == [[[1, 2], [4, 5]], [[3], [6]]]
    names = ["/pad/left", "/pad/right"] if named else ["/pad/0", "/pad/1"]
    assert [each.texels.name for each in found.arrays] == names
    assert found.setup.note == f"from {', '.join(names)}"


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([("/pad", 5, wide([1, 2])), ("/pad", 6, wide([1, 2, 3]))],
         "/pad: the array changes from 1 x 2 to 1 x 3 texels; expected the same size in all frames"),
        ([("/pad", 5, wide([1, 2])), ("/pad", 6, wide([1, 2], rows=2))], "the array changes from 1 x 2 to 2 x 1"),
        ([("/b", 5, wide([1])), ("/a", 6, wide([2]))], "frames on several topics; name one of /a, /b"),
        ([("/x/b", 5, wide([1])), ("/x/a", 6, wide([2])), ("/x/a", 7, wide([2]))], "name one of /x/a, /x/b"),
        ([(f"/x/p{number}", 5, wide([1])) for number in range(65)], "holds frames of more than 64 arrays"),
    ],
    ids=range(5),
)  # fmt: skip
def test_arrays_that_do_not_belong_together_are_refused(tmp_path, messages, words):
    with pytest.raises(RecordingError, match=re.escape(words)):
        bags.read(write(tmp_path, *messages))


def test_topics_below_one_with_as_many_frames_are_one_recording(tmp_path):
    path = write(tmp_path, *[(f"/x/p{number}", 5, wide([number])) for number in range(64)])
    assert sorted(each.counts.item() for each in bags.read(path).arrays) == list(range(64))
    (one,) = bags.read(path, topic="/x/p7").arrays
    assert one.counts.tolist() == [[7]]
    with pytest.raises(RecordingError, match="no tactile frames on /x/p99; known are"):
        bags.read(path, topic="/x/p99")


def image(rows, columns, step, size, encoding="mono8"):
    time = make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    header = make("std_msgs/msg/Header", seq=0, stamp=time, frame_id="x")
    return make("sensor_msgs/msg/Image", header=header, height=rows, width=columns, encoding=encoding, is_bigendian=0,
                step=step, data=(np.arange(size) % 251).astype(np.uint8))  # fmt: skip


@pytest.mark.parametrize(
    ("message", "counts"),
    [
        (image(2, 3, 3, 6), [0, 1, 2, 3, 4, 5]),
        (image(2, 2, 4, 8), [0, 1, 4, 5]),
        (image(2, 2, 5, 10, "mono16"), [256, 3 * 256 + 2, 6 * 256 + 5, 8 * 256 + 7]),
        (image(2, 2, 4, 8, "16UC1"), [256, 770, 5 * 256 + 4, 7 * 256 + 6]),
        (image(1, 2, 2, 2, "8UC1"), [0, 1]),
        (image(100, 100, 100, 10_000), None),
        (image(2, 3, 2, 4), "/pad: an image of 2 x 3 pixels has 4 bytes; expected 2 rows of 2 bytes"),
        (image(2, 2, 3, 6, "mono16"), "an image of 2 x 2 pixels has 6 bytes; expected 2 rows of 3 bytes"),
        (image(2, 3, 3, 7), "an image of 2 x 3 pixels has 7 bytes; expected 2 rows of 3 bytes"),
        (image(101, 100, 100, 10_100), "no tactile frames"),
        (image(2, 3, 3, 6, "rgb8"), "no tactile frames"),
    ],
    ids=range(11),
)
def test_images_are_read_row_by_row(tmp_path, message, counts):
    path = write(tmp_path, ("/pad", 5, message))
    if isinstance(counts, str):
        with pytest.raises(RecordingError, match=counts):
            bags.read(path)
    else:
        assert bags.read(path).arrays[0].counts[0].tolist() == (counts or (np.arange(10_000) % 251).tolist())


def test_paths_that_are_no_bags_are_refused_by_name(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.bag").write_bytes(b"no bag")
    for path, words in (
        (tmp_path / "none.bag", "no such file; expected a ROS bag"),
        (tmp_path / "empty", "no recording of ROS 2, which is a folder with metadata.yaml"),
        (tmp_path / "a.bag", "not a ROS bag, or damaged; accepted: an intact bag of ROS 1 or ROS 2"),
        (tmp_path / "a.bag" / "b", "no such file; expected a ROS bag"),
    ):
        for read in (bags.read, bags.read_forces):
            with pytest.raises(RecordingError) as caught:
                read(path)
            assert str(caught.value) == f"{path}: {words}"


def test_each_message_of_a_bag_counts_toward_its_limits(tmp_path, monkeypatch):
    path = write(tmp_path, *[("/pad", 5 + number, wide([number])) for number in range(4)])
    size = path.stat().st_size
    data = 4 * (4 + 4 + 4 + 8)  # rows, columns, length and one number each
    for limits, words in (
        ({"records": 4 - size}, None),
        ({"records": 3 - size}, "far more messages"),
        ({"kept": data + 4 * 300, "ratio": 0}, None),
        ({"kept": data + 4 * 300 - 1, "ratio": 0}, "far more messages"),
    ):
        monkeypatch.setattr(recordings, "LIMITS", recordings.Limits(**limits))
        if words is None:
            assert len(bags.read(path).times) == 4
        else:
            with pytest.raises(RecordingError, match=words):
                bags.read(path)


@pytest.mark.parametrize(("depth", "refused"), [(32, False), (33, True)])
def test_brackets_of_metadata_are_at_most_32_deep(tmp_path, depth, refused):
    (tmp_path / "metadata.yaml").write_text(f"a: []\n{'[{' * (depth // 2)}{'[' * (depth % 2)}")
    with pytest.raises(RecordingError) as caught:
        bags.read(tmp_path)
    assert ("has brackets more than 32 deep" in str(caught.value)) == refused
