"""Virtual sensor that answers commands as a Weiss WTS does, and sends frames with given texel values.

`VirtualSensor` converts received bytes and times to sent bytes and needs no port; `serve` runs a virtual sensor on a
port: a pseudo-terminal, or any port that pyserial opens.  Where no source states how a real device answers, the virtual
sensor follows the assumptions in `inquiry`.

A fault of the serial line accepts any bytes, also none, because the faults of a message may be combined in any order.
"""

from __future__ import annotations

import math
import os
import select
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import Protocol

import numpy as np
import numpy.typing as npt
import serial

from validation.weiss.protocol import (
    HEAD_SIZE,
    LARGEST_COUNT,
    LONGEST_TEXT,
    MASK_BIT_ORDER,
    PERIODIC_FRAME,
    PREAMBLE,
    RUN_LENGTH_FLAG,
    TARE,
    TICK,
    UNITS_PER_KELVIN,
    Command,
    MatrixInfo,
    Message,
    Parser,
    Status,
    Values,
    decode_request,
    encode_answer,
    encode_frame,
    encode_message,
    join_bytes,
)
from validation.weiss.sensor import WRITE_TIMEOUT, PortError

#: Function from a message, the index of a random byte of it, and a random number generator to the bytes that the
#: receiver gets.
Fault = Callable[[bytes, int, Random], bytes]
#: Every fault by the name that the command line takes.
FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        # one random bit changed
        "flip-bit": lambda message, at, random: (
            message[:at] + bytes(byte ^ (1 << random.randrange(8)) for byte in message[at : at + 1]) + message[at + 1 :]
        ),
        # one to eight consecutive bytes replaced by random ones
        "change-bytes": lambda message, at, random: (
            message[:at] + random.randbytes(size := len(message[at : at + random.randint(1, 8)])) + message[at + size :]
        ),
        # one to sixteen consecutive bytes left out, or sent twice
        "drop-bytes": lambda message, at, random: message[:at] + message[at + random.randint(1, 16) :],
        "repeat-bytes": lambda message, at, random: message[: at + random.randint(1, 16)] + message[at:],
        # one to forty random bytes in or before the message
        "insert-noise": lambda message, at, random: (
            message[:at] + random.randbytes(random.randint(1, 40)) + message[at:]
        ),
        "cut": lambda message, at, _: message[: max(1, at)],
        # one to five bytes AA, the byte of the preamble, before the message
        "extra-preamble": lambda message, _, random: PREAMBLE[:1] * random.randint(1, 5) + message,
        # the head of another message, with a random payload size and without payload, before the message
        "false-head": lambda message, _, random: (
            PREAMBLE + random.choice((b"\x00", b"\x20")) + bytes([random.randrange(256), 0]) + message
        ),
        "lose": lambda *_: b"",
        "repeat": lambda message, *_: message + message,
        # the text of a booting device of the SDH generation before the message
        "boot-text": lambda message, *_: b"\x1b[5n\x1b[5n\x1b[5n" + message,
        # a random payload size in the head of the message
        "wrong-size": lambda message, _, random: message[: HEAD_SIZE - 2] + random.randbytes(2) + message[HEAD_SIZE:],
    }
)

#: Device tag of the virtual sensor if none is given.  It is not empty, because some public clients wait for a tag;
#: whether a new device has one is unknown.
DEFAULT_TAG = "softcover"
#: Function from the time since the start [s] to the counts of the n texels, shape (n,) [-].
Source = Callable[[float], npt.ArrayLike]

#: Description of the array of a WTS 0614-34 sensor.
WTS_0614_34 = MatrixInfo(columns=6, rows=14, cell_width=3.4e-3, cell_height=3.4e-3, full_scale=4095)


@dataclass(frozen=True, kw_only=True)
class _ShownValues:
    """Temperatures and test patterns of the virtual sensor, chosen so that a user can tell them apart.

    Attributes:
        cold: Temperature of the device at the start [degC].
        warm: Temperature of the device after a long time [degC].
        warming_time: Time constant of the exponential rise from `cold` to `warm` [s].
        blob_peak: Largest count of the pattern `blob`, a moving Gaussian peak [-].
        blob_spread: Twice the variance of the Gaussian of the pattern `blob` [texels^2].
        ramp_step: Difference of the counts of consecutive texels of the pattern `ramp` [-].
        ramp_rate: Increase of the counts of the pattern `ramp` over time [counts/s].
        corner_count: Count of the first texel of the pattern `corner`; all others are zero [-].
    """

    cold: float = 25.0
    warm: float = 35.0
    warming_time: float = 1200.0
    blob_peak: int = 3000
    blob_spread: float = 4.0
    ramp_step: int = 40
    ramp_rate: int = 1000
    corner_count: int = 2000


_SHOWN = _ShownValues()


@dataclass(frozen=True, kw_only=True)
class Misbehaviour:
    """Faults that a virtual sensor makes on request, so that its clients can be tested.

    Attributes:
        rates: Probability 0..1 that a fault damages a message [-], by name of the fault in `FAULTS`.
        refused: Status of the answer, for each command that is refused.
        pauses: Intervals in which no frames are sent: first and last time since the start [s].
        seed: Seed of the random number generator that selects the damaged messages.
    """

    rates: Mapping[str, float] = field(default_factory=dict)
    refused: Mapping[Command, Status] = field(default_factory=dict)
    pauses: tuple[tuple[float, float], ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the names of the faults and their probabilities.

        Raises:
            ValueError: If a fault is unknown or a probability is not in 0..1.
        """
        for name, rate in self.rates.items():
            if name not in FAULTS:
                raise ValueError(f"unknown fault {name!r}; known faults: {', '.join(FAULTS)}")
            if not 0 <= rate <= 1:
                raise ValueError(f"the rate of {name} must lie in 0..1, not {rate}")


class VirtualSensor:
    """Answers commands and sends frames as a Weiss WTS sensor does, without a port.

    Args:
        source: Function that gives the counts of the texels as a function of time.
        matrix: Description of the array that the sensor reports.
        rate: Frames per second if a client requests frames without an interval [Hz].
        active: Whether each texel exists, shape (n,); the others always read 0.  All exist if not given.
        sensor_type: Name of the sensor's type that the sensor reports; made from the array if not given.
        tag: Device tag that the sensor reports until a client sets another one, at most 64 ASCII characters.
        misbehaviour: Faults that the sensor makes; none if not given.

    Raises:
        ValueError: If the rate is not positive, the tag is too long or not ASCII, or the mask has another size than the
            array.
    """

    def __init__(
        self,
        source: Source,
        *,
        matrix: MatrixInfo = WTS_0614_34,
        rate: float = 271.0,
        active: npt.ArrayLike | None = None,
        sensor_type: str | None = None,
        tag: str = DEFAULT_TAG,
        misbehaviour: Misbehaviour | None = None,
    ) -> None:
        if not 0 < rate < math.inf:
            raise ValueError(f"rate must be positive, not {rate} Hz")
        if not tag.isascii() or len(tag) > LONGEST_TEXT:
            raise ValueError(f"a device tag holds at most {LONGEST_TEXT} ASCII characters, not {tag!r}")
        self.matrix = matrix
        self._active = np.ones(matrix.texels, dtype=bool) if active is None else np.asarray(active, dtype=bool)
        if self._active.shape != (matrix.texels,):
            raise ValueError(f"a mask of this array has {matrix.texels} texels, not {self._active.size}")
        self.frames_sent = 0
        self._source = source
        self._rate = rate
        self.type = sensor_type or name_type(matrix)
        self._misbehaviour = misbehaviour or Misbehaviour()
        self._random = Random(self._misbehaviour.seed)  # noqa: S311 -- reproducible faults, no secret
        self._parser = Parser(texels=matrix.texels)
        #: Answers to the commands that ask for a setting.
        self._settings: dict[Command, int | bytes] = {
            Command.GET_THRESHOLD: 0,
            Command.GET_GAIN: 0,
            Command.GET_TAG: tag.encode("ascii"),
        }
        #: Counts that are subtracted from each frame after the command `tare`, shape (n,) [-].
        self._zero: npt.NDArray[np.int64] = np.zeros(matrix.texels, dtype=np.int64)
        #: Time between periodic frames [s]; None while no periodic frames are sent.
        self._period: float | None = None
        self._flags = 0
        self._next_due = 0.0

    @property
    def next_due(self) -> float | None:
        """Time since the start at which the next periodic frame is due [s]; None while no periodic frames are sent."""
        return None if self._period is None else self._next_due

    def receive(self, data: bytes, now: float) -> bytes:
        """Process bytes from the client and return the bytes of the answers.

        Args:
            data: Bytes that the client sent.
            now: Time since the start [s].
        """
        return b"".join(self._damage(self._answer(message, now)) for message in self._parser.feed(data))

    def take_due_frames(self, now: float) -> list[bytes]:
        """Return the messages of the periodic frames that are due and were not returned before.

        Args:
            now: Time since the start [s].
        """
        frames = []
        while self._period is not None and self._next_due <= now:
            if not any(start <= self._next_due < end for start, end in self._misbehaviour.pauses):
                frame = encode_message(PERIODIC_FRAME, self._make_frame(self._next_due, self._flags))
                frames.append(self._damage(frame))
                self.frames_sent += 1
            self._next_due += self._period
        return frames

    def _damage(self, message: bytes) -> bytes:
        """Apply each fault to the bytes of a message with the probability of the fault."""
        for name, rate in self._misbehaviour.rates.items():
            if self._random.random() < rate and message:
                message = FAULTS[name](message, self._random.randrange(len(message)), self._random)
        return message

    def _answer(self, message: Message, now: float) -> bytes:
        """Execute the command in a message from the client and return the bytes of the answer."""
        try:
            command, values = decode_request(message)
        except KeyError:
            return encode_message(message.identifier, int(Status.COMMAND_UNKNOWN).to_bytes(2, "little"))
        except ValueError:
            status = Status.NOT_ENOUGH_PARAMETERS if not message.payload else Status.COMMAND_FORMAT_ERROR
            return encode_answer(Command(message.identifier), status)
        if command in self._misbehaviour.refused:
            return encode_answer(command, self._misbehaviour.refused[command])
        number = values[0] if values and isinstance(values[0], int) else 0
        data = join_bytes(values)
        degrees = _SHOWN.warm - (_SHOWN.warm - _SHOWN.cold) * math.exp(-now / _SHOWN.warming_time)
        questions: Mapping[Command, Callable[[], Values]] = {
            Command.LOOP: lambda: (data,),
            Command.READ_SINGLE_FRAME: lambda: (self._make_frame(now, number),),
            Command.MATRIX_INFO: lambda: self.matrix.values,
            Command.SYSTEM_INFO: lambda: (1, 1, 0x1000, 1),
            Command.SENSOR_TYPE: lambda: (self.type.encode("ascii"),),
            Command.TEMPERATURE: lambda: (round(degrees * UNITS_PER_KELVIN),),
            Command.GET_MASK: lambda: (np.packbits(self._active, bitorder=MASK_BIT_ORDER).tobytes(),),
            **{setting: lambda: (self._settings[command],) for setting in self._settings},
        }
        if command in questions:
            return encode_answer(command, Status.SUCCESS, *questions[command]())
        return encode_answer(command, self._change(command, values, number, now))

    def _change(self, command: Command, values: Values, number: int, now: float) -> Status:
        """Execute a command whose answer has no values; return the status.

        Args:
            command: The command.
            values: Values of the request.
            number: The first value; 0 if it is not a number.
            now: Time since the start [s].
        """
        match command:
            case Command.START_PERIODIC_FRAMES if self._period is not None:
                return Status.ALREADY_RUNNING
            case Command.START_PERIODIC_FRAMES:  # no faster than at the rate of the sensor
                self._period = max(int(values[1]) * 1e-3, 1 / self._rate)
                self._flags, self._next_due = number, now
            case Command.STOP_PERIODIC_FRAMES:
                self._period = None
            case Command.TARE:
                self._zero = self._show(now) if number == TARE else np.zeros_like(self._zero)
            case Command.SET_THRESHOLD | Command.SET_GAIN | Command.SET_TAG:
                if number > LARGEST_COUNT or len(join_bytes(values)) > LONGEST_TEXT:
                    return Status.RANGE_ERROR
                self._settings[Command(command + 1)] = values[0]  # the command that asks for a setting follows
            case _:
                return Status.FEATURE_NOT_SUPPORTED
        return Status.SUCCESS

    def _make_frame(self, now: float, flags: int) -> bytes:
        """Return the bytes of a frame at the time `now` [s], after tare and threshold were subtracted."""
        counts = np.clip(self._show(now) - self._zero - int(self._settings[Command.GET_THRESHOLD]), 0, LARGEST_COUNT)
        return encode_frame(int(now / TICK), counts, run_length=bool(flags & RUN_LENGTH_FLAG))

    def _show(self, now: float) -> npt.NDArray[np.int64]:
        """Return the counts of the source at the time `now` [s], before tare and threshold, shape (n,) [-]."""
        counts = np.asarray(self._source(now), dtype=np.int64).ravel()
        return np.where(self._active, np.clip(counts, 0, self.matrix.full_scale), 0)


def name_type(matrix: MatrixInfo) -> str:
    """Return the type of a sensor as its manufacturer writes it: `WTS 0614-34` for 6 x 14 texels of 3.4 mm.

    The pitch along y is added if it differs from the pitch along x.
    """
    widths = dict.fromkeys(f"{round(1e4 * pitch):02}" for pitch in (matrix.cell_width, matrix.cell_height))
    return f"WTS {matrix.columns:02}{matrix.rows:02}-{'x'.join(widths)}"


def show_pattern(name: str, matrix: MatrixInfo = WTS_0614_34) -> Source:
    """Make a source of counts that shows a test pattern.

    Args:
        name: `blob` (a moving peak), `ramp` (every frame differs), `corner` (the first texel only) or `zero`.
        matrix: Description of the array.

    Raises:
        ValueError: If the name is unknown.
    """
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(matrix.columns), np.arange(matrix.rows)))
    order = np.arange(matrix.texels)

    def show_blob(time: float) -> npt.ArrayLike:
        column = (matrix.columns - 1) * (1 + np.sin(2 * time)) / 2
        row = (matrix.rows - 1) * (1 + np.sin(time)) / 2
        squared = (x - column) ** 2 + (y - row) ** 2
        return np.asarray(np.rint(_SHOWN.blob_peak * np.exp(-squared / _SHOWN.blob_spread)), dtype=np.int64)

    patterns: dict[str, Source] = {
        "blob": show_blob,
        "ramp": lambda time: (order * _SHOWN.ramp_step + round(time * _SHOWN.ramp_rate)) % (LARGEST_COUNT + 1),
        "corner": lambda _: np.where(order == 0, _SHOWN.corner_count, 0),
        "zero": lambda _: np.zeros_like(order),
    }
    if name not in patterns:
        raise ValueError(f"unknown pattern {name!r}; known patterns: {', '.join(patterns)}")
    return patterns[name]


def show_recording(times: npt.ArrayLike, counts: npt.ArrayLike, *, loop: bool = True) -> Source:
    """Make a source of counts that shows recorded frames at the times at which they were recorded.

    Args:
        times: Increasing times of the frames, shape (frames,) [s].
        counts: Counts of the n texels in each frame, shape (frames, n) [-].
        loop: Whether to start again after the last frame; otherwise the last frame is shown from then on.

    Raises:
        ValueError: If there are no frames, or if the numbers of times and frames differ.
    """
    moments, values = np.asarray(times, dtype=float), np.asarray(counts)
    if not len(moments) or len(moments) != len(values):
        raise ValueError(f"a playback needs as many times as frames and at least one, not {len(moments)}")
    moments = moments - moments[0]
    # In a loop, the last frame is shown for the mean time between frames.
    duration = moments[-1] * len(moments) / max(1, len(moments) - 1)

    def show(time: float) -> npt.ArrayLike:
        moment = time % duration if loop and duration else time
        return np.asarray(values[max(0, int(np.searchsorted(moments, moment, side="right")) - 1)])

    return show


def show_frames(frames: Iterable[npt.ArrayLike]) -> Source:
    """Make a source of counts that shows the next of the given frames at each call, and finally the last frame.

    Args:
        frames: Counts of each frame, shape (n,) [-], such as those of the fast model; their number may be infinite.

    Raises:
        ValueError: If there are no frames.
    """
    remaining = iter(frames)
    try:
        shown = next(remaining)
    except StopIteration:
        raise ValueError("at least one frame is needed to show") from None

    def show(time: float) -> npt.ArrayLike:  # noqa: ARG001 -- the order of the frames decides
        nonlocal shown
        shown = next(remaining, shown)
        return shown

    return show


#: Largest number of bytes that are stored for a client that does not read.  If more are stored, new frames are left
#: out as a whole, as a real device does.
BACKLOG_BYTES = 4096
#: Longest wait for bytes from a client, after which the server checks whether it should stop [s].
_RECEIVE_TIMEOUT = 0.05
#: Largest number of bytes that are read from a client at a time.
_PIECE_BYTES = 4096
#: Start of the names of pseudo-terminals on Linux and macOS.
_TERMINALS = ("/dev/pts/", "/dev/ttys")


class End(Protocol):
    """The end of a connection to a client on the side of the virtual sensor."""

    def send(self, data: bytes) -> int:
        """Send as many bytes as possible without waiting, and return their number."""

    def receive(self, wait: float) -> bytes:
        """Return the bytes received; wait for the first byte at most for `wait` [s]."""


class PseudoTerminal(AbstractContextManager["PseudoTerminal"]):
    """A pseudo-terminal, which a client opens by its `name` like a serial port.  It needs Linux or macOS.

    The client's side stays open in this program, so that clients may close and open the port any number of times.  It
    is set to raw mode before a client opens it, because a new pseudo-terminal echoes bytes.

    Args:
        link: Path of a symbolic link to the port that is created and used as `name`; a link to a
            pseudo-terminal, which an earlier run may have left, is replaced.

    Raises:
        PortError: If the system has no pseudo-terminals, or if the link cannot be created.
    """

    def __init__(self, link: str | Path | None = None) -> None:
        try:
            import pty
            import tty
        except ImportError as error:
            raise PortError("pseudo-terminals need Linux or macOS; name a real port to serve on") from error
        self._device, self._client = pty.openpty()
        tty.setraw(self._client)
        os.set_blocking(self._device, False)
        self.port = os.ttyname(self._client)
        self._closed = False
        self._link: Path | None = None
        if link is not None:
            self._create_link(Path(link))
        self.name = self.port if link is None else str(link)

    def __exit__(self, *_: object) -> None:
        """Close the pseudo-terminal."""
        self.close()

    def send(self, data: bytes) -> int:
        """Send as many bytes as the buffer of the client accepts, and return their number."""
        try:
            return os.write(self._device, data)
        except BlockingIOError:
            return 0

    def receive(self, wait: float) -> bytes:
        """Return the bytes that a client sent; wait for the first one at most for `wait` [s]."""
        readable, _, _ = select.select([self._device], [], [], wait)
        return os.read(self._device, _PIECE_BYTES) if readable else b""

    def close(self) -> None:
        """Close the pseudo-terminal; for a client, the port is then lost.  A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        # A link that another pseudo-terminal has replaced since then is not removed.
        if self._link is not None and self._link.is_symlink() and str(self._link.readlink()) == self.port:
            self._link.unlink()
        os.close(self._client)
        os.close(self._device)

    def _create_link(self, link: Path) -> None:
        try:
            if link.is_symlink() and str(link.readlink()).startswith(_TERMINALS):
                link.unlink()
            link.symlink_to(self.port)
        except OSError as error:
            self.close()
            raise PortError(
                f"{link}: cannot create a link to the port here: {error.strerror}; name a new file"
            ) from error
        self._link = link


class SerialEnd:
    """The device's end of a serial cable, or of a connection that a pyserial URL names.

    Args:
        port: Name of a port, or a pyserial URL.
        baud_rate: Baud rate of a UART [1/s].

    Raises:
        PortError: If the port cannot be opened.
    """

    def __init__(self, port: str, *, baud_rate: int = 115_200) -> None:
        self.name = port
        try:
            self._serial = serial.serial_for_url(port, baudrate=baud_rate, write_timeout=WRITE_TIMEOUT)
        except (OSError, ValueError) as error:
            raise PortError(f"{port}: cannot be opened: {error}") from error

    def send(self, data: bytes) -> int:
        """Send all bytes to the client and return their number."""
        return int(self._serial.write(data) or 0)

    def receive(self, wait: float) -> bytes:
        """Return the bytes that a client sent; wait for the first one at most for `wait` [s]."""
        self._serial.timeout = wait
        return bytes(self._serial.read(max(1, self._serial.in_waiting)))

    def close(self) -> None:
        """Close the port."""
        self._serial.close()


def serve(
    sensor: VirtualSensor,
    end: End,
    *,
    stop: threading.Event | None = None,
    seconds: float | None = None,
    backlog_bytes: int = BACKLOG_BYTES,
) -> int:
    """Run a virtual sensor on a port in real time.

    Args:
        sensor: The virtual sensor.
        end: The device's end of the connection.
        stop: Event that ends the run when it is set.
        seconds: Duration of the run; until `stop` is set if not given [s].
        backlog_bytes: Largest number of bytes that are stored for a client that does not read; if more are stored, new
            frames are left out.

    Returns:
        Number of frames that were left out because the client did not read [-].
    """
    start = time.monotonic()
    backlog, left_out = b"", 0
    while not (stop and stop.is_set()):
        now = time.monotonic() - start
        if seconds is not None and now >= seconds:
            break
        for frame in sensor.take_due_frames(now):
            if len(backlog) < backlog_bytes:
                backlog += frame
            else:
                left_out += 1
            # Bytes are sent after each frame; otherwise several frames that are due at once would fill the backlog.
            backlog = backlog[end.send(backlog) :]
        due = sensor.next_due
        wait = _RECEIVE_TIMEOUT if due is None else min(_RECEIVE_TIMEOUT, max(0.0, due - (time.monotonic() - start)))
        received = end.receive(wait)
        if received:
            backlog += sensor.receive(received, time.monotonic() - start)
        if backlog:
            backlog = backlog[end.send(backlog) :]
    return left_out
