"""Format of the messages of a Weiss WTS sensor: commands, answers and frames as bytes, and their parser.

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

import re
import struct
from binascii import crc_hqx
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

CountArray = npt.NDArray[np.uint16]

# Assumptions that no source confirms, see `inquiry.UNCONFIRMED`; others are in the layouts of `Command`.  A change here
# changes both the driver and the virtual sensor.

#: Assumed length of one tick of the device's clock [s].
TICK = 1e-3
#: Bit in the flags of requests and frames that marks run-length encoded counts.
RUN_LENGTH_FLAG = 0x01
#: Number of low bits of a 16-bit run-length unit that hold the count; the other bits hold the number of equal counts
#: (1..15).
RUN_LENGTH_VALUE_BITS = 12
#: Order of the bits in the bytes of the answer to `get mask`, as numpy names it.
MASK_BIT_ORDER: Literal["little", "big"] = "little"

#: First bytes of every message.
PREAMBLE = b"\xaa\xaa\xaa"
#: Number of bytes of a message before its payload [bytes].
HEAD_SIZE = 6
#: Number of bytes of a message after its payload [bytes].
CHECKSUM_SIZE = 2
#: Largest size of a payload that the 16-bit field in the head can state [bytes].
_LARGEST_PAYLOAD = 0xFFFF
#: Place at which a message may start: a preamble, or its first bytes at the end of the received bytes.
_START = re.compile(rb"\xaa{3}|\xaa{1,2}\Z")
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


def compute_checksum(data: bytes) -> int:
    """Compute the checksum of the bytes of a message; it is 0 for a complete message that includes its checksum.

    Args:
        data: Bytes of the message, from the first AA on.
    """
    state = 0xFFFF
    for byte in data:
        state = _TABLE[(state ^ byte) & 0xFF] ^ (state >> 8)
    return state


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
    message = PREAMBLE + struct.pack("<BH", identifier, len(payload)) + payload
    return message + compute_checksum(message).to_bytes(CHECKSUM_SIZE, "little")


#: Layout of the status at the start of the payload of an answer: unsigned, 16 bits, little-endian.
_STATUS = struct.Struct("<H")
#: Number of the device's units of length per metre [1/m]; the unit is 0.01 mm.
_UNITS_PER_METRE = 100_000
#: Number of the device's units of temperature per kelvin [1/K]; the unit is 0.1 K.
UNITS_PER_KELVIN = 10

#: Largest length of a text in a request or an answer, such as a sensor type or a tag [bytes].
LONGEST_TEXT = 64
#: Identifier of the frames that a device sends on its own.
PERIODIC_FRAME = 0x00

#: Values in the payload of a request or an answer, in the order of its layout.
Values = tuple[Any, ...]


class Command(IntEnum):
    """The documented commands: identifier, layout of the request, and layout of the answer after its status.

    A layout is a `struct` format of the values; it is None for raw bytes, and empty where there are no values.  The
    layouts of tare, threshold and gain are assumptions.
    """

    request: str | None
    answer: str | None

    def __new__(cls, identifier: int, request: str | None = "", answer: str | None = "") -> Self:
        """Make a command whose value is its identifier.

        Args:
            identifier: Identifier of the command in messages.
            request: Layout of the payload of the request.
            answer: Layout of the payload of the answer after its status.
        """
        made = int.__new__(cls, identifier)
        made._value_ = identifier
        made.request, made.answer = request, answer
        return made

    LOOP = 0x06, None, None
    READ_SINGLE_FRAME = 0x20, "<B", None
    START_PERIODIC_FRAMES = 0x21, "<BH"
    STOP_PERIODIC_FRAMES = 0x22
    TARE = 0x23, "<B"  # The value 1 starts the subtraction of the present frame from later frames; 0 ends it.
    MATRIX_INFO = 0x30, "", "<5H"
    SET_MASK_WINDOW = 0x31, None
    SET_ADVANCED_MASK = 0x32, None
    GET_MASK = 0x33, "", None
    SET_THRESHOLD = 0x34, "<H"
    GET_THRESHOLD = 0x35, "", "<H"
    SET_GAIN = 0x36, "<B"
    GET_GAIN = 0x37, "", "<B"
    SENSOR_TYPE = 0x38, "", None
    TEMPERATURE = 0x46, "", "<h"
    SYSTEM_INFO = 0x50, "", "<BBHI"
    SET_TAG = 0x51, None
    GET_TAG = 0x52, "", None


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


@dataclass(frozen=True)
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

    @property
    def values(self) -> Values:
        """The values of the answer to the command `matrix info`."""
        width, height = (round(length * _UNITS_PER_METRE) for length in (self.cell_width, self.cell_height))
        return (self.columns, self.rows, width, height, self.full_scale)

    @classmethod
    def from_values(cls, values: Values) -> Self:
        """Read the values of the answer to the command `matrix info`."""
        columns, rows, width, height, full_scale = values
        return cls(columns, rows, width / _UNITS_PER_METRE, height / _UNITS_PER_METRE, full_scale)


@dataclass(frozen=True)
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

    @classmethod
    def from_values(cls, values: Values) -> Self:
        """Read the values of the answer to the command `system info`."""
        kind, hardware, firmware, serial = values
        return cls(kind, hardware, ".".join(str(firmware >> shift & 15) for shift in (12, 8, 4, 0)), serial)


def encode_request(command: Command, *values: int | bytes) -> bytes:
    """Return the message that requests a command with the given values.

    Raises:
        ValueError: If the values do not fit the command's layout.
    """
    return encode_message(command, _pack(command, command.request, values))


def encode_answer(command: Command, status: Status, *values: int | bytes) -> bytes:
    """Return the message that answers a command; the values are left out unless the status is success.

    Raises:
        ValueError: If the values do not fit the command's layout.
    """
    data = b"" if status else _pack(command, command.answer, values)
    return encode_message(command, _STATUS.pack(status) + data)


def decode_request(command: Command, payload: bytes) -> Values:
    """Return the values in the payload of a request.

    Raises:
        ValueError: If the payload does not fit the command's layout.
    """
    return _unpack(command, command.request, payload)


def decode_answer(command: Command, payload: bytes) -> tuple[int, Values]:
    """Return the status and the values of an answer; the values are empty unless the status is 0 (success).

    Raises:
        ValueError: If the payload does not fit the command's layout.
    """
    if len(payload) < _STATUS.size:
        raise ValueError(f"the answer to {command.name} has no status; expected {_STATUS.size} bytes or more")
    (status,) = _STATUS.unpack_from(payload)
    return status, () if status else _unpack(command, command.answer, payload[_STATUS.size :])


def describe_status(status: int) -> str:
    """Return the meaning of a status in words, with its number."""
    name = {each.value: each.name for each in Status}.get(status, "unknown status")
    return f"{name.lower().replace('_', ' ')} ({status})"


def _pack(command: Command, layout: str | None, values: Values) -> bytes:
    """Convert values to a payload by a `struct` format, or join raw bytes if the format is None."""
    try:
        return b"".join(values) if layout is None else struct.pack(layout, *values)
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
    if len(payload) < _FRAME_HEAD.size:
        raise ValueError(f"a frame has at least {_FRAME_HEAD.size} bytes, not {len(payload)}")
    ticks, flags = _FRAME_HEAD.unpack_from(payload)
    if flags & ~RUN_LENGTH_FLAG or len(payload) % 2 != _FRAME_HEAD.size % 2:
        raise ValueError(f"not a frame: flags {flags:#04x}, {len(payload)} bytes")
    units = np.frombuffer(payload, dtype="<u2", offset=_FRAME_HEAD.size)
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
    # A run that is longer than one unit can hold is divided into full units of 15 counts and a rest of 1..15 counts.
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


#: Largest number of texels that is accepted in a frame while the array is unknown: that of the largest array of the
#: manufacturer [-].
_MOST_TEXELS = 512


class Parser:
    """Finds messages in a byte stream that is received in pieces.

    A message is accepted if its checksum is correct and, for frames, its content is valid.  If a message is refused,
    the search continues at the byte after its first byte AA, so that only damaged messages are lost.  After the head of
    a message, the parser waits for the stated number of bytes, unless the number exceeds the largest possible message;
    `finish` ends the wait.  The parser stores at most one message of the largest size and the last piece.

    Args:
        texels: Number of texels of the array; if given, frames with another number are refused [-].
    """

    def __init__(self, *, texels: int | None = None) -> None:
        self.texels = texels
        #: Numbers of bytes received, and of bytes that belong to no message.
        self.bytes_seen = self.bytes_skipped = 0
        self._buffer = bytearray()
        #: Number of bytes before the last message that belong to no message.
        self._skipped_before = 0

    @property
    def largest_payload(self) -> int:
        """Size of the largest payload of a message that is accepted [bytes]."""
        texels = _MOST_TEXELS if self.texels is None else self.texels
        return _STATUS.size + max(_FRAME_HEAD.size + 2 * texels, LONGEST_TEXT)

    def finish(self) -> list[Message]:
        """End the wait for the rest of a message, and return the messages in the stored bytes after its head."""
        return self.feed(b"", final=True)

    def feed(self, data: bytes, *, final: bool = False) -> list[Message]:
        """Add the next bytes of the stream and return the messages that they complete.

        Args:
            data: The next bytes.
            final: Whether an incomplete message counts as damaged, because no further bytes are awaited.
        """
        self._buffer += data
        self.bytes_seen += len(data)
        messages: list[Message] = []
        buffer, end, place = self._buffer, 0, 0
        while found := _START.search(buffer, place):
            place = found.start()
            size = self._measure_message(place, final=final)
            if size is None:
                break
            if size:
                self.bytes_skipped += place - end
                payload = bytes(buffer[place + HEAD_SIZE : place + size - CHECKSUM_SIZE])
                messages.append(Message(buffer[place + 3], payload, self.bytes_skipped - self._skipped_before))
                self._skipped_before, end = self.bytes_skipped, place + size
            place += size or 1
        else:
            place = len(buffer)
        self.bytes_skipped += place - end
        del buffer[:place]
        return messages

    def _measure_message(self, start: int, *, final: bool) -> int | None:
        """Return the size of the message that starts at the index `start` of the stored bytes.

        Returns:
            Size of the message [bytes]; 0 if the bytes are no valid message, None if more bytes are needed to decide.
        """
        head = self._buffer[start : start + HEAD_SIZE]
        size = HEAD_SIZE + int.from_bytes(head[4:], "little") + CHECKSUM_SIZE
        if head[3:4] == PREAMBLE[:1] or size > HEAD_SIZE + self.largest_payload + CHECKSUM_SIZE:
            return 0
        message = bytes(self._buffer[start : start + size])
        if len(message) < size:
            return 0 if final else None
        if compute_checksum(message):
            return 0
        payload = message[HEAD_SIZE:-CHECKSUM_SIZE]
        is_single = head[3] == Command.READ_SINGLE_FRAME and payload.startswith(_STATUS.pack(Status.SUCCESS))
        if is_single or head[3] == PERIODIC_FRAME:
            try:
                decode_frame(payload[_STATUS.size * is_single :], texels=self.texels)
            except ValueError:
                return 0
        return size
