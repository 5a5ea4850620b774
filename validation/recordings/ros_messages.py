"""Encodes and decodes the ROS 2 messages of a recording in CDR, the binary format of ROS 2 messages.

Images, diagnostics, temperatures and forces use standard message types, so that Foxglove and ROS 2 tools display them.
No standard message type holds a frame with the clocks of host and device.  A message type of this program holds such
frames; its definition is stored in every file, as is usual in ROS 2 recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from validation.extras import MissingExtraError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

#: Names of the ROS 2 message types in a recording.
IMAGE = "sensor_msgs/msg/Image"
FRAME = "softcover_msgs/msg/TactileFrame"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
BYTES = "std_msgs/msg/UInt8MultiArray"
TEXT = "std_msgs/msg/String"
NUMBERS = "std_msgs/msg/Float64MultiArray"
WRENCH = "geometry_msgs/msg/WrenchStamped"

#: Definition of the message type `FRAME` in the notation of ROS 2.
_FRAME_DEFINITION = """std_msgs/Header header
uint64 host_monotonic
uint32 device_ticks
uint16[] counts
float64[] texel_forces
"""
#: Level of a ROS diagnostic status that marks a warning.
_WARNING = 1
_NANOSECONDS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FrameMessage:
    """Content of a frame message, without its header.

    Attributes:
        host_monotonic: Time of the frame on the monotonic clock of the host [ns].
        ticks: Time of the frame on the clock of the device [ticks].
        counts: Counts of the n texels, shape (n,) [-].
        texel_forces: Forces on the texels from a simulation, shape (n,) [N]; shape (0,) for a real sensor.
    """

    host_monotonic: int
    ticks: int
    counts: npt.NDArray[np.uint16]
    texel_forces: npt.NDArray[np.float64]


def define_type(name: str) -> bytes:
    """Return the definition of a message type and of all types in it, as stored in ROS 2 recordings."""
    return bytes(_load_types().generate_msgdef(name, ros_version=2)[0].encode())


def decode(data: bytes, name: str) -> Any:  # noqa: ANN401 -- rosbags creates message types at run time
    """Decode the CDR bytes of a message of the type `name`."""
    return _load_types().deserialize_cdr(data, name)


def encode_image(time: int, name: str, counts: npt.NDArray[np.uint16], columns: int) -> bytes:
    """Encode counts as an image message with the encoding mono16, whose first row has the smallest y.

    Args:
        time: Time of the frame, UTC since 1970 [ns].
        name: Name of the coordinate frame in the header of the message.
        counts: Counts of the n texels, shape (n,) [-].
        columns: Number of pixels in a row [-].
    """
    pixels = np.ascontiguousarray(counts, dtype="<u2")
    return _encode(
        IMAGE,
        header=_make_header(time, name),
        height=pixels.size // columns,
        width=columns,
        encoding="mono16",
        is_bigendian=0,
        step=2 * columns,
        data=pixels.view(np.uint8),
    )


def encode_frame(time: int, name: str, frame: FrameMessage) -> bytes:
    """Encode a frame with its clocks as a frame message.

    Args:
        time: Time of the frame, UTC since 1970 [ns].
        name: Name of the coordinate frame in the header of the message.
        frame: Clocks, counts and texel forces.
    """
    return _encode(
        FRAME,
        header=_make_header(time, name),
        host_monotonic=frame.host_monotonic,
        device_ticks=frame.ticks,
        counts=np.ascontiguousarray(frame.counts, dtype=np.uint16),
        texel_forces=frame.texel_forces,
    )


def decode_frame(data: bytes) -> FrameMessage:
    """Decode a frame message that `encode_frame` encoded."""
    message = decode(data, FRAME)
    return FrameMessage(
        host_monotonic=message.host_monotonic,
        ticks=message.device_ticks,
        counts=message.counts,
        texel_forces=message.texel_forces,
    )


def encode_diagnostics(time: int, name: str, text: str) -> bytes:
    """Encode a warning as a diagnostics message.

    Args:
        time: Time of the warning, UTC since 1970 [ns].
        name: Subject of the warning.
        text: Text of the warning.
    """
    status = _make(
        "diagnostic_msgs/msg/DiagnosticStatus", level=_WARNING, name=name, message=text, hardware_id="", values=[]
    )
    return _encode(DIAGNOSTICS, header=_make_header(time, name), status=[status])


def encode_bytes(data: bytes) -> bytes:
    """Encode bytes as a message that holds an array of bytes."""
    return _encode(
        BYTES,
        layout=_make("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0),
        data=np.frombuffer(data, dtype=np.uint8),
    )


def encode_numbers(values: npt.ArrayLike, label: str = "") -> bytes:
    """Encode numbers of any shape as a message that holds an array of floating-point numbers.

    Args:
        values: The numbers.
        label: Meaning of the numbers, which is written as the label of their first dimension; without a label, the
            message does not state the dimensions.
    """
    numbers = np.asarray(values, dtype=np.float64)
    sizes = [1, *numbers.shape][bool(numbers.ndim) :] if label else []
    dimensions = [
        _make(
            "std_msgs/msg/MultiArrayDimension",
            label="" if axis else label,
            size=size,
            stride=int(np.prod(sizes[axis:])),
        )
        for axis, size in enumerate(sizes)
    ]
    layout = _make("std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
    return _encode(NUMBERS, layout=layout, data=numbers.ravel())


def encode_wrench(time: int, name: str, force: npt.ArrayLike, torque: npt.ArrayLike = (0.0, 0.0, 0.0)) -> bytes:
    """Encode a force and a torque as a wrench message.

    Args:
        time: Time of the values, UTC since 1970 [ns].
        name: Name of the coordinate frame in the header of the message.
        force: The force, shape (3,) [N].
        torque: The torque about the origin of the coordinate frame, shape (3,) [N m].
    """
    vectors = [
        _make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, np.asarray(each)), strict=True)))
        for each in (force, torque)
    ]
    wrench = _make("geometry_msgs/msg/Wrench", force=vectors[0], torque=vectors[1])
    return _encode(WRENCH, header=_make_header(time, name), wrench=wrench)


def decode_wrench(data: bytes) -> npt.NDArray[np.float64]:
    """Decode a wrench message; return force and torque, shape (6,) [N, N m]."""
    wrench = decode(data, WRENCH).wrench
    return np.array([getattr(vector, axis) for vector in (wrench.force, wrench.torque) for axis in "xyz"])


def encode_text(text: str) -> bytes:
    """Encode a text as a string message."""
    return _encode(TEXT, data=text)


@cache
def _load_types() -> Typestore:
    """Load the standard ROS 2 message types, and register the type of frame messages with them."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError("rosbags") from error
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(_FRAME_DEFINITION, FRAME))
    return types


def _make(kind: str, /, **fields: Any) -> Any:  # noqa: ANN401 -- rosbags creates message types at run time
    """Make a message of the type `kind` from its fields."""
    return _load_types().types[kind](**fields)


def _encode(kind: str, /, **fields: Any) -> bytes:  # noqa: ANN401 -- the fields depend on the type
    """Make a message of the type `kind` from its fields, and return its CDR bytes."""
    return bytes(_load_types().serialize_cdr(_make(kind, **fields), kind))


def _make_header(time: int, name: str) -> object:
    """Make the header of a message from a UTC time since 1970 [ns] and the name of a coordinate frame."""
    seconds, nanoseconds = divmod(time, _NANOSECONDS_PER_SECOND)
    stamp = _make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return _make("std_msgs/msg/Header", stamp=stamp, frame_id=name)
