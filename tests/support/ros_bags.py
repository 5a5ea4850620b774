"""ROS bags as public tactile drivers write them."""

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

#: When the messages were received [ns]; their headers tell 4 ms from one to the next.
START = 1_600_000_000_000_000_000
#: Counts of the five frames in a bag, shape (5, 84).
COUNTS = np.arange(5)[:, None] * 100 + np.arange(84)
SIDES = {"rows": 14, "columns": 6}


def _load_types(kind):
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


def _make_header(store, number, *, first):
    stamp = store.types["builtin_interfaces/msg/Time"](sec=1_600_000_000, nanosec=number * 4_000_000)
    extra = {"seq": number} if first else {}
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="pad", **extra)


def _make_message(store, kind, number, *, first):
    types, header = store.types, _make_header(store, number, first=first)
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
    if kind == "std_msgs/msg/UInt8MultiArray":
        sides = [types["std_msgs/msg/MultiArrayDimension"](label=n, size=s, stride=1) for n, s in SIDES.items()]
        layout = types["std_msgs/msg/MultiArrayLayout"](dim=sides, data_offset=0)
        return types[kind](layout=layout, data=counts.astype(np.uint8))
    padded = np.zeros((14, 16), dtype=np.uint8)
    padded[:, :12] = counts.astype(">u2").view(np.uint8).reshape(14, 12)
    return types[kind](
        header=header, height=14, width=6, encoding="mono16", is_bigendian=1, step=16, data=padded.ravel()
    )


def write_bag(path, kinds, *, first, plugin=StoragePlugin.SQLITE3, compressed=False):
    """Write five messages on each topic, given with its type, as a ROS 1 file (`first`) or a ROS 2 folder."""
    store = _load_types(Stores.ROS1_NOETIC if first else Stores.ROS2_JAZZY)
    bag = Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugin)
    if compressed:
        bag.set_compression(Writer1.CompressionFormat.BZ2)
    with bag as writer:
        for topic, kind in kinds.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for number in range(5):
                message = _make_message(store, kind, number, first=first)
                data = store.serialize_ros1(message, kind) if first else store.serialize_cdr(message, kind)
                writer.write(connection, START + number, data)
    return path
