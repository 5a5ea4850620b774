"""The ROS 2 messages of a recording: conversion to and from CDR bytes, the ROS 2 wire format.

Images, diagnostics, temperatures and forces use standard message types, so that Foxglove and ROS 2 tools show them.
No standard type holds a frame with the clocks of host and device.  The definition of the type used here is stored in
every file, as ROS 2 recordings do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from validation.errors import MissingExtraError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

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
#: Level of a diagnostic message that is a warning.
_WARNING = 1
_NANOSECONDS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FrameMessage:
    """Content of a frame message.

    Attributes:
        host_monotonic: Monotonic clock of the host [ns].
        ticks: Clock of the device [ticks].
        counts: Shape (n,) [-].
        texel_forces: Shape (n,) [N]; shape (0,) for a real sensor.
    """

    host_monotonic: int
    ticks: int
    counts: npt.NDArray[np.uint16]
    texel_forces: npt.NDArray[np.float64]


def define_type(name: str) -> bytes:
    """Definition of a message type and of all types in it, as ROS 2 recordings store it."""
    return bytes(_load_types().generate_msgdef(name, ros_version=2)[0].encode())


def encode_image(time: int, name: str, counts: npt.NDArray[np.uint16], columns: int) -> bytes:
    """Write an image whose pixels are the counts: encoding mono16, row 0 at the smallest y.

    Args:
        time: UTC since 1970 [ns].
        name: Frame of reference.
        counts: Shape (n,) [-].
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
    """Write a frame with its clocks.

    Args:
        time: UTC since 1970 [ns].
        name: Frame of reference.
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
    """Read the bytes that `encode_frame` wrote."""
    message = _decode(data, FRAME)
    return FrameMessage(
        host_monotonic=message.host_monotonic,
        ticks=message.device_ticks,
        counts=message.counts,
        texel_forces=message.texel_forces,
    )


def encode_diagnostics(time: int, name: str, text: str) -> bytes:
    """Write one warning.

    Args:
        time: UTC since 1970 [ns].
        name: Subject of the warning.
        text: The warning.
    """
    status = _make(
        "diagnostic_msgs/msg/DiagnosticStatus", level=_WARNING, name=name, message=text, hardware_id="", values=[]
    )
    return _encode(DIAGNOSTICS, header=_make_header(time, name), status=[status])


def decode_diagnostics(data: bytes) -> list[str]:
    """Read the texts that `encode_diagnostics` wrote."""
    return [status.message for status in _decode(data, DIAGNOSTICS).status]


def encode_bytes(data: bytes) -> bytes:
    """Write bytes as they are."""
    return _encode(BYTES, layout=_make_layout(), data=np.frombuffer(data, dtype=np.uint8))


def encode_numbers(values: npt.ArrayLike) -> bytes:
    """Write numbers, shape (n,)."""
    return _encode(NUMBERS, layout=_make_layout(), data=np.array(values, dtype=np.float64).ravel())


def decode_numbers(data: bytes) -> npt.NDArray[np.float64]:
    """Read the numbers that `encode_numbers` wrote, shape (n,)."""
    return np.array(_decode(data, NUMBERS).data, dtype=np.float64)


def encode_force(time: int, name: str, newtons: float) -> bytes:
    """Write a force along the normal of the array as the z component of a wrench.

    Args:
        time: UTC since 1970 [ns].
        name: Frame of reference.
        newtons: The force [N].
    """
    force, torque = (_make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=z) for z in (newtons, 0.0))
    wrench = _make("geometry_msgs/msg/Wrench", force=force, torque=torque)
    return _encode(WRENCH, header=_make_header(time, name), wrench=wrench)


def decode_force(data: bytes) -> float:
    """Read the force that `encode_force` wrote [N]."""
    return float(_decode(data, WRENCH).wrench.force.z)


def encode_text(text: str) -> bytes:
    """Write a text."""
    return _encode(TEXT, data=text)


def decode_text(data: bytes) -> str:
    """Read the text that `encode_text` wrote."""
    return str(_decode(data, TEXT).data)


@cache
def _load_types() -> Typestore:
    """All message types by name."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError("device", "rosbags") from error
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(_FRAME_DEFINITION, FRAME))
    return types


def _make(kind: str, /, **fields: Any) -> Any:  # noqa: ANN401 -- rosbags creates message types at run time
    return _load_types().types[kind](**fields)


def _encode(kind: str, /, **fields: Any) -> bytes:  # noqa: ANN401 -- the fields depend on the type
    return bytes(_load_types().serialize_cdr(_make(kind, **fields), kind))


def _decode(data: bytes, name: str) -> Any:  # noqa: ANN401 -- rosbags creates message types at run time
    return _load_types().deserialize_cdr(data, name)


def _make_header(time: int, name: str) -> object:
    seconds, nanoseconds = divmod(time, _NANOSECONDS_PER_SECOND)
    stamp = _make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return _make("std_msgs/msg/Header", stamp=stamp, frame_id=name)


def _make_layout() -> object:
    return _make("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
