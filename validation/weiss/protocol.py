"""Format of the messages of a Weiss WTS sensor: commands, answers and frames as bytes.

A message on the serial line is `AA AA AA`, identifier, payload size, payload, checksum.  The identifier is one byte;
payload size and checksum are unsigned 16-bit numbers, little-endian.  An answer has the identifier of its command, and
its payload starts with a status (16 bits, unsigned, little-endian).  A frame holds the counts of all texels at one
instant, raw or run-length encoded; frames that the sensor sends periodically have no status.

The checksum is a 16-bit cyclic redundancy check (CRC) with the polynomial 0x1021 and the initial value 0xFFFF over the
message from the first AA on.  The device combines the table of the normal (non-reflected) CRC with the shift direction
of the reflected CRC.  This update is not invertible: after a few bytes the checksum takes only 8192 different values.
Errors confined to one byte are always detected.  Of random errors in a payload, one in 8192 is not detected; a standard
CRC would miss one in 65536.  Functions that decode frames therefore also check the content of the frames.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from validation.weiss.unconfirmed import (
    GAIN_FORMAT,
    MASK_BIT_ORDER,
    RUN_LENGTH_FLAG,
    RUN_LENGTH_VALUE_BITS,
    THRESHOLD_FORMAT,
    TICK,
)

CountArray = npt.NDArray[np.uint16]

#: First bytes of every message.
PREAMBLE = b"\xaa\xaa\xaa"
#: Number of bytes of a message before its payload, and after its payload.
HEAD_SIZE, CHECKSUM_SIZE = 6, 2
#: Largest size of a payload that the 16-bit field in the head can state [bytes].
_LARGEST_PAYLOAD = 0xFFFF
#: Table of the CRC: checksum of each single byte, by the normal (non-reflected) CRC with the polynomial 0x1021, which
#: `crc_hqx` computes.
_TABLE = tuple(crc_hqx(bytes([byte]), 0) for byte in range(256))


@dataclass(frozen=True, slots=True)
class Message:
    """A complete message that a sensor or its client has sent.

    Attributes:
        identifier: Identifier of the command, 0..255 but never 0xAA.
        payload: Content of the message without head and checksum.
        skipped: Number of bytes between the previous message and this message that belong to no message [-].
    """

    identifier: int
    payload: bytes
    skipped: int = 0


def compute_checksum(data: bytes, state: int = 0xFFFF) -> int:
    """Compute the checksum of the bytes of a message; it is 0 for a complete message that includes its checksum.

    Args:
        data: Bytes of the message, from the first AA on.
        state: Checksum of the bytes of the message before `data`; the initial value if there are none.
    """
    for byte in data:
        state = _TABLE[(state ^ byte) & 0xFF] ^ (state >> 8)
    return state


#: Checksum of the preamble, from which the checksum of every message continues.
_PREAMBLE_CHECKSUM = compute_checksum(PREAMBLE)


def encode_message(identifier: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a message with an identifier and a payload.

    Raises:
        ValueError: If the identifier is not a byte or is 0xAA, which a receiver would take for the preamble, or if the
            payload is too long.
    """
    if not 0 <= identifier <= 0xFF or identifier == PREAMBLE[0]:  # noqa: PLR2004 -- a byte
        raise ValueError(f"a message identifier is 0..255 and not 0xAA, not {identifier:#x}")
    if len(payload) > _LARGEST_PAYLOAD:
        raise ValueError(f"a payload holds at most {_LARGEST_PAYLOAD} bytes, not {len(payload)}")
    body = bytes([identifier]) + len(payload).to_bytes(2, "little") + payload
    return PREAMBLE + body + compute_checksum(body, _PREAMBLE_CHECKSUM).to_bytes(CHECKSUM_SIZE, "little")


#: Layout of the status at the start of the payload of an answer: unsigned, 16 bits, little-endian.
_STATUS = struct.Struct("<H")
#: Units of the device per metre [1/m] and per kelvin [1/K]: the device gives lengths in 0.01 mm, temperatures in 0.1 K.
_LENGTH_UNITS_PER_METRE, _TEMPERATURE_UNITS_PER_KELVIN = 100_000, 10

#: Largest length of a text in a request or an answer, such as a sensor type or a tag [bytes].
LONGEST_TEXT = 64

#: Values in the payload of a request or an answer, in the order of the command's `Layout`.
Values = tuple[int | bytes, ...]


class Command(IntEnum):
    """Identifiers of the documented commands."""

    PERIODIC_FRAME = 0x00
    LOOP = 0x06
    READ_SINGLE_FRAME = 0x20
    START_PERIODIC_FRAMES = 0x21
    STOP_PERIODIC_FRAMES = 0x22
    TARE = 0x23
    MATRIX_INFO = 0x30
    SET_MASK_WINDOW = 0x31
    SET_ADVANCED_MASK = 0x32
    GET_MASK = 0x33
    SET_THRESHOLD = 0x34
    GET_THRESHOLD = 0x35
    SET_GAIN = 0x36
    GET_GAIN = 0x37
    SENSOR_TYPE = 0x38
    TEMPERATURE = 0x46
    SYSTEM_INFO = 0x50
    SET_TAG = 0x51
    GET_TAG = 0x52


class Status(IntEnum):
    """Documented values of the status in an answer."""

    SUCCESS = 0
    NOT_AVAILABLE = 1
    NO_SENSOR = 2
    NOT_INITIALIZED = 3
    ALREADY_RUNNING = 4
    FEATURE_NOT_SUPPORTED = 5
    INCONSISTENT_DATA = 6
    TIMEOUT = 7
    READ_ERROR = 8
    WRITE_ERROR = 9
    INSUFFICIENT_RESOURCES = 10
    CHECKSUM_ERROR = 11
    NO_PARAMETER_EXPECTED = 12
    NOT_ENOUGH_PARAMETERS = 13
    COMMAND_UNKNOWN = 14
    COMMAND_FORMAT_ERROR = 15
    ACCESS_DENIED = 16
    ALREADY_OPEN = 17
    COMMAND_FAILED = 18
    COMMAND_ABORTED = 19
    INVALID_HANDLE = 20
    NOT_FOUND = 21
    NOT_OPEN = 22
    INPUT_OUTPUT_ERROR = 23
    INVALID_PARAMETER = 24
    INDEX_OUT_OF_BOUNDS = 25
    COMMAND_PENDING = 26
    OVERRUN = 27
    RANGE_ERROR = 28
    AXIS_BLOCKED = 29
    FILE_EXISTS = 30


@dataclass(frozen=True, slots=True)
class Layout:
    """Layouts of the payloads of a command's request and answer.

    Attributes:
        request: `struct` format of the payload of the request; None for raw bytes.
        answer: `struct` format of the payload of the answer after the status; None for raw bytes.
    """

    request: str | None = ""
    answer: str | None = ""


#: Layout of every command that a host can send.
LAYOUTS: Mapping[Command, Layout] = MappingProxyType(
    {
        Command.LOOP: Layout(None, None),
        Command.READ_SINGLE_FRAME: Layout("<B", None),
        Command.START_PERIODIC_FRAMES: Layout("<BH"),
        Command.STOP_PERIODIC_FRAMES: Layout(),
        Command.TARE: Layout("<B"),
        Command.MATRIX_INFO: Layout("", "<5H"),
        Command.SET_MASK_WINDOW: Layout(None),
        Command.SET_ADVANCED_MASK: Layout(None),
        Command.GET_MASK: Layout("", None),
        Command.SET_THRESHOLD: Layout(THRESHOLD_FORMAT),
        Command.GET_THRESHOLD: Layout("", THRESHOLD_FORMAT),
        Command.SET_GAIN: Layout(GAIN_FORMAT),
        Command.GET_GAIN: Layout("", GAIN_FORMAT),
        Command.SENSOR_TYPE: Layout("", None),
        Command.TEMPERATURE: Layout("", "<h"),
        Command.SYSTEM_INFO: Layout("", "<BBHI"),
        Command.SET_TAG: Layout(None),
        Command.GET_TAG: Layout("", None),
    }
)


@dataclass(frozen=True, kw_only=True)
class MatrixInfo:
    """Description of the texel array, as reported by the device.

    Attributes:
        columns: Number of texels along x [-].
        rows: Number of texels along y [-].
        cell_width: Pitch of the texels along x [m].
        cell_height: Pitch of the texels along y [m].
        full_scale: Largest count of a texel [-].
    """

    columns: int
    rows: int
    cell_width: float
    cell_height: float
    full_scale: int

    @property
    def texels(self) -> int:
        """Number of texels of the array, rows times columns [-]."""
        return self.columns * self.rows


@dataclass(frozen=True, kw_only=True)
class SystemInfo:
    """Description of the device, as reported by the device.

    Attributes:
        kind: Code of the kind of device: 0 for unknown, 1 for WTS.
        hardware_revision: Number of the hardware revision.
        firmware: Version of the firmware as major.minor.sub.release-type.
        serial_number: Serial number of the device.
    """

    kind: int
    hardware_revision: int
    firmware: str
    serial_number: int


def encode_request(command: Command, *values: int | bytes) -> bytes:
    """Return the message that requests a command with the given values.

    Raises:
        ValueError: If the values do not fit the command's layout.
    """
    return encode_message(command, _pack(command, LAYOUTS[command].request, values))


def encode_answer(command: Command, status: Status, *values: int | bytes) -> bytes:
    """Return the message that answers a command; the values are left out unless the status is success.

    Raises:
        ValueError: If the values do not fit the command's layout.
    """
    data = _pack(command, LAYOUTS[command].answer, values) if status == Status.SUCCESS else b""
    return encode_message(command, _STATUS.pack(status) + data)


def decode_request(message: Message) -> tuple[Command, Values]:
    """Return the command and the values of a request message.

    Raises:
        KeyError: If the command is unknown.
        ValueError: If the payload does not fit the command's layout.
    """
    command = _find_command(message.identifier)
    return command, _unpack(command, LAYOUTS[command].request, message.payload)


def decode_answer(message: Message) -> tuple[int, Values]:
    """Return the status and the values of an answer message; the values are empty unless the status is 0 (success).

    Raises:
        KeyError: If the command is unknown.
        ValueError: If the payload does not fit the command's layout.
    """
    command = _find_command(message.identifier)
    if len(message.payload) < _STATUS.size:
        raise ValueError(f"the answer to {command.name} has no status; expected {_STATUS.size} bytes or more")
    (status,) = _STATUS.unpack_from(message.payload)
    if status != Status.SUCCESS:
        return status, ()
    return status, _unpack(command, LAYOUTS[command].answer, message.payload[_STATUS.size :])


def describe_status(status: int) -> str:
    """Return the meaning of a status in words, with its number."""
    try:
        return f"{Status(status).name.lower().replace('_', ' ')} ({status})"
    except ValueError:
        return f"unknown status ({status})"


def join_bytes(values: Values) -> bytes:
    """Join the raw bytes among the values of a request or an answer."""
    return b"".join(value for value in values if isinstance(value, bytes))


def encode_matrix_info(info: MatrixInfo) -> tuple[int, ...]:
    """Convert the description of an array to the values of the answer to the command `matrix info`."""
    width, height = (round(length * _LENGTH_UNITS_PER_METRE) for length in (info.cell_width, info.cell_height))
    return (info.columns, info.rows, width, height, info.full_scale)


def decode_matrix_info(values: Values) -> MatrixInfo:
    """Convert the values of the answer to the command `matrix info` to the description of an array."""
    columns, rows, width, height, full_scale = (int(value) for value in values)
    return MatrixInfo(
        columns=columns,
        rows=rows,
        cell_width=width / _LENGTH_UNITS_PER_METRE,
        cell_height=height / _LENGTH_UNITS_PER_METRE,
        full_scale=full_scale,
    )


def decode_system_info(values: Values) -> SystemInfo:
    """Convert the values of the answer to the command `system info` to the description of a device."""
    kind, hardware, firmware, serial = (int(value) for value in values)
    digits = (firmware >> 12, firmware >> 8 & 15, firmware >> 4 & 15, firmware & 15)
    version = ".".join(str(digit) for digit in digits)
    return SystemInfo(kind=kind, hardware_revision=hardware, firmware=version, serial_number=serial)


def encode_temperature(degrees: float) -> tuple[int]:
    """Convert a temperature [degC] to the value of the answer to the command `temperature`."""
    return (round(degrees * _TEMPERATURE_UNITS_PER_KELVIN),)


def decode_temperature(values: Values) -> float:
    """Convert the value of the answer to the command `temperature` to a temperature [degC]."""
    return int(values[0]) / _TEMPERATURE_UNITS_PER_KELVIN


def encode_mask(active: npt.NDArray[np.bool_]) -> bytes:
    """Convert a mask of n texels, shape (n,), to the bytes of the answer to the command `get mask`."""
    return np.packbits(active, bitorder=MASK_BIT_ORDER).tobytes()


def decode_mask(data: bytes, texels: int) -> npt.NDArray[np.bool_]:
    """Convert the bytes of the answer to the command `get mask` to a mask: whether each texel exists, shape (texels,).

    Raises:
        ValueError: If the bytes are not a mask of so many texels, or if no texel exists.
    """
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder=MASK_BIT_ORDER).astype(bool)
    if len(data) != -(-texels // 8) or bits[texels:].any() or not bits.any():
        raise ValueError(f"{len(data)} bytes {data[:LONGEST_TEXT].hex()} are no mask of {texels} texels")
    return bits[:texels]


def _find_command(identifier: int) -> Command:
    if identifier not in LAYOUTS:
        raise KeyError(f"no command has the identifier {identifier:#04x}")
    return Command(identifier)


def _pack(command: Command, layout: str | None, values: Values) -> bytes:
    """Convert values to a payload by a `struct` format, or join raw bytes if the format is None."""
    try:
        return join_bytes(values) if layout is None else struct.pack(layout, *values)
    except struct.error as error:
        raise ValueError(f"{command.name}: {values} does not fit its layout {layout!r}: {error}") from error


def _unpack(command: Command, layout: str | None, payload: bytes) -> Values:
    """Convert a payload to values by a `struct` format; the value is the payload itself if the format is None."""
    try:
        return (payload,) if layout is None else struct.unpack(layout, payload)
    except struct.error as error:
        raise ValueError(f"{command.name}: {len(payload)} bytes do not fit its layout {layout!r}") from error


#: Largest count of a texel, a number of 12 bits [-].
LARGEST_COUNT = 0x0FFF
#: Layout of the start of a frame: time on the clock of the device (unsigned, 32 bits, little-endian), flags (8 bits).
_FRAME_HEAD = struct.Struct("<IB")
#: Number of bytes before the counts of a frame.
FRAME_HEAD_SIZE = _FRAME_HEAD.size
#: Largest number of equal counts that one run-length unit can hold, because the number has 4 bits [-].
_LONGEST_RUN = 15


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Reading:
    """One frame that a sensor has sent: the counts of all texels at one instant.

    Attributes:
        counts: Counts of the n texels, shape (n,), row by row, x fastest [-].
        ticks: Time of the frame on the clock of the device, 32 bits unsigned [ticks].
        host_time: Time at which the last byte of the frame was read, on the monotonic clock of the host [ns]; 0 for a
            frame that did not come from a port.
        run_length: Whether the frame was sent run-length encoded.
    """

    counts: CountArray
    ticks: int
    host_time: int = 0
    run_length: bool = False

    @property
    def time(self) -> float:
        """Time of the frame on the clock of the device [s]."""
        return self.ticks * TICK


def encode_frame(ticks: int, counts: npt.ArrayLike, *, run_length: bool = False) -> bytes:
    """Return a frame as bytes: the payload of a periodic frame, or of a requested single frame after the status.

    Args:
        ticks: Time of the frame on the clock of the device [ticks]; the lowest 32 bits are used.
        counts: Counts 0..4095 of the n texels, shape (n,) [-].
        run_length: Whether to run-length encode the counts.

    Raises:
        ValueError: If a count does not fit 12 bits.
    """
    values = np.asarray(counts).ravel()
    if values.size and (int(values.min()) < 0 or int(values.max()) > LARGEST_COUNT):
        raise ValueError(f"texel values must lie in 0..{LARGEST_COUNT}, not {values.min()}..{values.max()}")
    head = _FRAME_HEAD.pack(ticks & 0xFFFFFFFF, RUN_LENGTH_FLAG * run_length)
    texels = values.astype("<u2")
    return head + (compress(texels) if run_length else texels.tobytes())


def decode_frame(payload: bytes, *, texels: int | None = None, host_time: int = 0) -> Reading:
    """Decode the payload of a frame message.

    Args:
        payload: Clock, flags and counts of the frame, without the status of an answer.
        texels: Expected number of texels; any number is accepted if not given [-].
        host_time: Time at which the last byte was read, on the monotonic clock of the host [ns].

    Raises:
        ValueError: If the payload is too short, has unknown flags, a count over 12 bits or the wrong number of texels.
    """
    if len(payload) < FRAME_HEAD_SIZE:
        raise ValueError(f"a frame has at least {FRAME_HEAD_SIZE} bytes, not {len(payload)}")
    ticks, flags = _FRAME_HEAD.unpack_from(payload)
    if flags & ~RUN_LENGTH_FLAG or len(payload) % 2 != FRAME_HEAD_SIZE % 2:
        raise ValueError(f"not a frame: flags {flags:#04x}, {len(payload)} bytes")
    units = np.frombuffer(payload, dtype="<u2", offset=FRAME_HEAD_SIZE)
    run_length = bool(flags & RUN_LENGTH_FLAG)
    counts = _expand(units) if run_length else units.astype(np.uint16)
    if counts.size and int(counts.max()) > LARGEST_COUNT:
        raise ValueError(f"texel value {counts.max()} does not fit 12 bits")
    if texels is not None and counts.size != texels:
        raise ValueError(f"a frame of this array has {texels} texels, not {counts.size}")
    return Reading(counts=counts, ticks=ticks, host_time=host_time, run_length=run_length)


def compress(counts: CountArray) -> bytes:
    """Run-length encode the counts of n texels, each 0..4095, shape (n,)."""
    if not counts.size:
        return b""
    starts = np.flatnonzero(np.concatenate(([True], counts[1:] != counts[:-1])))
    lengths = np.diff(np.append(starts, counts.size))
    # a run that is longer than one unit can hold is divided into full units of 15 counts and a rest of 1..15 counts
    full, rest = np.divmod(lengths - 1, _LONGEST_RUN)
    values = np.repeat(counts[starts].astype(np.uint16), full + 1)
    runs = np.full(values.size, _LONGEST_RUN, dtype=np.uint16)
    runs[np.cumsum(full + 1) - 1] = rest + 1
    return bytes((values | (runs << RUN_LENGTH_VALUE_BITS)).astype("<u2").tobytes())


def _expand(units: CountArray) -> CountArray:
    """Decode run-length units to the counts of the n texels, shape (n,)."""
    runs = units >> RUN_LENGTH_VALUE_BITS
    if not runs.all():
        raise ValueError("a run of length 0 in a run-length encoded frame")
    return np.repeat(units & LARGEST_COUNT, runs).astype(np.uint16)
