"""The ROS 2 messages of a recording, to and from CDR bytes.

Images, diagnostics, temperatures and forces use the standard types, so that Foxglove and ROS 2 tools show them.  A
frame with both clocks has no standard type; its definition is stored in every file, as ROS 2 recordings do.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from validation.errors import MissingExtraError

IMAGE = "sensor_msgs/msg/Image"
FRAME = "softcover_msgs/msg/TactileFrame"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
BYTES = "std_msgs/msg/UInt8MultiArray"
TEXT = "std_msgs/msg/String"
NUMBERS = "std_msgs/msg/Float64MultiArray"
WRENCH = "geometry_msgs/msg/WrenchStamped"

_FRAME_DEFINITION = """std_msgs/Header header
uint64 host_monotonic
uint32 device_ticks
uint16[] counts
float64[] texel_forces
"""
_SECOND = 1_000_000_000
_NOTHING = np.empty(0, dtype=np.float64)


class FrameFields(NamedTuple):
    """What a frame message holds: host monotonic [ns], device's clock, counts and texel forces [N], both (n,)."""

    host_monotonic: int
    ticks: int
    counts: npt.NDArray[np.uint16]
    texel_forces: npt.NDArray[np.float64]


@cache
def store() -> Any:  # noqa: ANN401 -- types are made at run time
    """Every message type by name."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError("device", "rosbags") from error
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(_FRAME_DEFINITION, FRAME))
    return types


def definition(name: str) -> bytes:
    """Definition of a type with all that it uses, as ROS 2 recordings store it."""
    return bytes(store().generate_msgdef(name, ros_version=2)[0].encode())


def image(time: int, name: str, counts: npt.NDArray[np.uint16], columns: int) -> bytes:
    """An image whose pixels are the counts: mono16, row 0 at the smallest y.

    Args:
        time: UTC [ns].
        name: Frame of reference.
        counts: Shape (n,).
        columns: Pixels in a row.
    """
    pixels = np.ascontiguousarray(counts, dtype="<u2")
    return _encode(
        IMAGE,
        header=_header(time, name),
        height=pixels.size // columns,
        width=columns,
        encoding="mono16",
        is_bigendian=0,
        step=2 * columns,
        data=pixels.view(np.uint8),
    )


def frame(time: int, name: str, fields: FrameFields) -> bytes:
    """A frame with its clocks."""
    return _encode(
        FRAME,
        header=_header(time, name),
        host_monotonic=fields.host_monotonic,
        device_ticks=fields.ticks,
        counts=np.ascontiguousarray(fields.counts, dtype=np.uint16),
        texel_forces=fields.texel_forces,
    )


def read_frame(data: bytes) -> FrameFields:
    """Read what `frame` wrote."""
    message = _decode(data, FRAME)
    return FrameFields(message.host_monotonic, message.device_ticks, message.counts, message.texel_forces)


def diagnostics(time: int, name: str, text: str) -> bytes:
    """One warning."""
    status = _make("diagnostic_msgs/msg/DiagnosticStatus")
    entry = status(level=1, name=name, message=text, hardware_id="", values=[])
    return _encode(DIAGNOSTICS, header=_header(time, name), status=[entry])


def read_diagnostics(data: bytes) -> list[str]:
    """Read what `diagnostics` wrote."""
    return [status.message for status in _decode(data, DIAGNOSTICS).status]


def octets(data: bytes) -> bytes:
    """Bytes as they are."""
    return _encode(BYTES, layout=_layout(), data=np.frombuffer(data, dtype=np.uint8))


def read_octets(data: bytes) -> bytes:
    """Read what `octets` wrote."""
    return bytes(_decode(data, BYTES).data.tobytes())


def numbers(values: npt.ArrayLike) -> bytes:
    """A row of numbers."""
    return _encode(NUMBERS, layout=_layout(), data=np.array(values, dtype=np.float64).ravel())


def read_numbers(data: bytes) -> npt.NDArray[np.float64]:
    """Read what `numbers` wrote."""
    return np.array(_decode(data, NUMBERS).data, dtype=np.float64)


def force(time: int, name: str, newtons: float) -> bytes:
    """A force along the array's normal, as the z component of a wrench [N]."""
    vector = _make("geometry_msgs/msg/Vector3")
    wrench = _make("geometry_msgs/msg/Wrench")(
        force=vector(x=0.0, y=0.0, z=newtons), torque=vector(x=0.0, y=0.0, z=0.0)
    )
    return _encode(WRENCH, header=_header(time, name), wrench=wrench)


def read_force(data: bytes) -> float:
    """Read what `force` wrote [N]."""
    return float(_decode(data, WRENCH).wrench.force.z)


def text(value: str) -> bytes:
    """A text."""
    return _encode(TEXT, data=value)


def read_text(data: bytes) -> str:
    """Read what `text` wrote."""
    return str(_decode(data, TEXT).data)


def no_forces() -> npt.NDArray[np.float64]:
    """The texel forces of a real sensor: none."""
    return _NOTHING


def _make(name: str) -> Any:  # noqa: ANN401 -- types are made at run time
    return store().types[name]


def _encode(name: str, **fields: Any) -> bytes:  # noqa: ANN401 -- message fields
    return bytes(store().serialize_cdr(_make(name)(**fields), name))


def _decode(data: bytes, name: str) -> Any:  # noqa: ANN401 -- types are made at run time
    return store().deserialize_cdr(data, name)


def _header(time: int, name: str) -> Any:  # noqa: ANN401 -- types are made at run time
    stamp = _make("builtin_interfaces/msg/Time")(sec=time // _SECOND, nanosec=time % _SECOND)
    return _make("std_msgs/msg/Header")(stamp=stamp, frame_id=name)


def _layout() -> Any:  # noqa: ANN401 -- types are made at run time
    return _make("std_msgs/msg/MultiArrayLayout")(dim=[], data_offset=0)
