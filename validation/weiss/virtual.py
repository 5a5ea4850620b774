"""Virtual sensor that answers commands as a Weiss WTS does, and sends frames with given texel values.

`VirtualSensor` converts received bytes and times to sent bytes and needs no port; `serve` runs a virtual sensor on a
port: a pseudo-terminal, or any port that pyserial opens.  Where no source states how a real device answers, the virtual
sensor follows the assumptions in `inquiry`.
"""

from __future__ import annotations

import math
import os
import select
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from validation.weiss import protocol
from validation.weiss.protocol import LARGEST_COUNT, PREAMBLE, Command, MatrixInfo, Status, Values
from validation.weiss.sensor import Link, PortError

#: Function from a message, the index of a random byte of it, and a random number generator to the bytes that the
#: receiver gets.
Fault = Callable[[bytes, int, Random], bytes]
#: Every fault of the serial line by the name that the command line takes.
FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        # One random bit of the message is changed.
        "flip-bit": lambda sent, at, random: sent[:at] + bytes([sent[at] ^ 1 << random.randrange(8)]) + sent[at + 1 :],
        # One to eight consecutive bytes of the message are replaced by random ones.
        "change-bytes": lambda sent, at, random: (
            sent[:at] + random.randbytes(size := len(sent[at : at + random.randint(1, 8)])) + sent[at + size :]
        ),
        # One to sixteen consecutive bytes of the message are left out, or sent twice.
        "drop-bytes": lambda sent, at, random: sent[:at] + sent[at + random.randint(1, 16) :],
        "repeat-bytes": lambda sent, at, random: sent[: at + random.randint(1, 16)] + sent[at:],
        # One to forty random bytes are inserted in or before the message.
        "insert-noise": lambda sent, at, random: sent[:at] + random.randbytes(random.randint(1, 40)) + sent[at:],
        "cut": lambda sent, at, _: sent[: max(1, at)],
        # One to five bytes AA, the byte of the preamble, are sent before the message.
        "extra-preamble": lambda sent, _, random: PREAMBLE[:1] * random.randint(1, 5) + sent,
        # The head of another message, with a random payload size and without payload, is sent before the message.
        "false-head": lambda sent, _, random: (
            PREAMBLE + bytes([random.choice((0x00, 0x20)), random.randrange(256), 0]) + sent
        ),
        "lose": lambda *_: b"",
        "repeat": lambda sent, *_: sent + sent,
        # The text of a booting device of the SDH generation is sent before the message.
        "boot-text": lambda sent, *_: b"\x1b[5n\x1b[5n\x1b[5n" + sent,
        # The head of the message states a random payload size.
        "wrong-size": lambda sent, _, random: sent[:4] + random.randbytes(2) + sent[protocol.HEAD_SIZE :],
    }
)

#: Function from the time since the start [s] to the counts of the n texels, shape (n,) [-].
Source = Callable[[float], npt.ArrayLike]

#: Description of the array of a WTS 0614-34 sensor.
WTS_0614_34 = MatrixInfo(columns=6, rows=14, cell_width=3.4e-3, cell_height=3.4e-3, full_scale=LARGEST_COUNT)


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
        tag: Device tag that the sensor reports until a client sets another one, at most 64 ASCII characters.  It is not
            empty by default, because some public clients wait for a tag; whether a new device has one is unknown.
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
        tag: str = "softcover",
        misbehaviour: Misbehaviour | None = None,
    ) -> None:
        if not 0 < rate < math.inf:
            raise ValueError(f"rate must be positive, not {rate} Hz")
        if not tag.isascii() or len(tag) > protocol.LONGEST_TEXT:
            raise ValueError(f"a device tag holds at most {protocol.LONGEST_TEXT} ASCII characters, not {tag!r}")
        self.matrix = matrix
        self._active = np.ones(matrix.texels, dtype=bool) if active is None else np.asarray(active, dtype=bool)
        if self._active.shape != (matrix.texels,):
            raise ValueError(f"a mask of this array has {matrix.texels} texels, not {self._active.size}")
        self.frames_sent = 0
        self._source = source
        self._rate = rate
        self.type = name_type(matrix)
        self._misbehaviour = misbehaviour or Misbehaviour()
        self._random = Random(self._misbehaviour.seed)  # noqa: S311 -- reproducible faults, no secret
        self._parser = protocol.Parser(texels=matrix.texels)
        #: Values of the settings, by the command that reads the setting.
        self._settings: dict[Command, Any] = {
            Command.GET_THRESHOLD: 0,
            Command.GET_GAIN: 0,
            Command.GET_TAG: tag.encode("ascii"),
        }
        #: Counts that are subtracted from each frame after the command `tare`, shape (n,) [-].
        self._zero: npt.NDArray[np.int64] = np.zeros(matrix.texels, dtype=np.int64)
        #: Time since the start at which the next periodic frame is due; infinite while none are sent [s].
        self.next_due = math.inf
        #: Time between periodic frames [s], infinite for none, and the flags of the request, such as run-length coding.
        self._period, self._flags = math.inf, 0

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
        while self.next_due <= now:
            if not any(start <= self.next_due < end for start, end in self._misbehaviour.pauses):
                frame = self._make_frame(self.next_due, self._flags)
                frames.append(self._damage(protocol.encode_message(protocol.PERIODIC_FRAME, frame)))
                self.frames_sent += 1
            self.next_due += self._period
        return frames

    def _damage(self, message: bytes) -> bytes:
        """Apply each fault to the bytes of a message with the probability of the fault."""
        for name, rate in self._misbehaviour.rates.items():
            if self._random.random() < rate and message:
                message = FAULTS[name](message, self._random.randrange(len(message)), self._random)
        return message

    def _answer(self, message: protocol.Message, now: float) -> bytes:
        """Execute the command in a message from the client and return the bytes of the answer."""
        try:
            command = Command(message.identifier)
        except ValueError:
            return protocol.encode_message(message.identifier, int(Status.COMMAND_UNKNOWN).to_bytes(2, "little"))
        try:
            values = protocol.decode_request(command, message.payload)
        except ValueError:
            status = Status.COMMAND_FORMAT_ERROR if message.payload else Status.NOT_ENOUGH_PARAMETERS
            return protocol.encode_answer(command, status)
        if command in self._misbehaviour.refused:
            return protocol.encode_answer(command, self._misbehaviour.refused[command])
        questions: Mapping[Command, Callable[..., Values]] = {
            Command.LOOP: lambda data: (data,),
            Command.READ_SINGLE_FRAME: lambda flags: (self._make_frame(now, flags),),
            Command.MATRIX_INFO: lambda: self.matrix.values,
            Command.SYSTEM_INFO: lambda: (1, 1, 0x1000, 1),
            Command.SENSOR_TYPE: lambda: (self.type.encode("ascii"),),
            # The temperature rises from 25 to 35 degC with a time constant of 20 min.
            Command.TEMPERATURE: lambda: (round((35 - 10 * math.exp(-now / 1200)) * protocol.UNITS_PER_KELVIN),),
            Command.GET_MASK: lambda: (np.packbits(self._active, bitorder=protocol.MASK_BIT_ORDER).tobytes(),),
            **{setting: lambda: (self._settings[command],) for setting in self._settings},
        }
        if command in questions:
            return protocol.encode_answer(command, Status.SUCCESS, *questions[command](*values))
        return protocol.encode_answer(command, self._change(command, values, now))

    def _change(self, command: Command, values: Values, now: float) -> Status:
        """Execute a command whose answer has no values; return the status.

        Args:
            command: The command.
            values: Values of the request.
            now: Time since the start [s].
        """
        match command:
            case Command.START_PERIODIC_FRAMES if self.next_due < math.inf:
                return Status.ALREADY_RUNNING
            case Command.START_PERIODIC_FRAMES:  # The frame rate never exceeds the rate of the sensor.
                self._flags, interval = values
                self._period, self.next_due = max(interval * 1e-3, 1 / self._rate), now
            case Command.STOP_PERIODIC_FRAMES:
                self.next_due = math.inf
            case Command.TARE:
                self._zero = self._show(now) * (values[0] == 1)
            case Command.SET_THRESHOLD | Command.SET_GAIN | Command.SET_TAG:
                (value,) = values
                if len(value) > protocol.LONGEST_TEXT if isinstance(value, bytes) else value > LARGEST_COUNT:
                    return Status.RANGE_ERROR
                # The identifier of the command that reads a setting follows that of the command that sets it.
                self._settings[Command(command + 1)] = value
            case _:
                return Status.FEATURE_NOT_SUPPORTED
        return Status.SUCCESS

    def _make_frame(self, now: float, flags: int) -> bytes:
        """Return the bytes of a frame at the time `now` [s], after tare and threshold were subtracted."""
        counts = np.clip(self._show(now) - self._zero - self._settings[Command.GET_THRESHOLD], 0, LARGEST_COUNT)
        run_length = bool(flags & protocol.RUN_LENGTH_FLAG)
        return protocol.encode_frame(int(now / protocol.TICK), counts, run_length=run_length)

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
        name: `blob` (a moving Gaussian peak of 3000 counts), `ramp` (40 counts more from texel to texel, and 1000 more
            in a second, modulo 4096), `corner` (2000 counts of the first texel only) or `zero`.
        matrix: Description of the array.

    Raises:
        ValueError: If the name is unknown.
    """
    order = np.arange(matrix.texels)
    y, x = np.divmod(order, matrix.columns)

    def show_blob(time: float) -> npt.ArrayLike:
        column = (matrix.columns - 1) * (1 + np.sin(2 * time)) / 2
        row = (matrix.rows - 1) * (1 + np.sin(time)) / 2
        return np.asarray(np.rint(3000 * np.exp(-((x - column) ** 2 + (y - row) ** 2) / 4)), dtype=np.int64)

    patterns: dict[str, Source] = {
        "blob": show_blob,
        "ramp": lambda time: (40 * order + round(1000 * time)) % (LARGEST_COUNT + 1),
        "corner": lambda _: 2000 * (order == 0),
        "zero": lambda _: 0 * order,
    }
    if name not in patterns:
        raise ValueError(f"unknown pattern {name!r}; known patterns: {', '.join(patterns)}")
    return patterns[name]


def show_recording(times: npt.ArrayLike, counts: npt.ArrayLike) -> Source:
    """Make a source of counts that shows recorded frames at the times at which they were recorded, again and again.

    Args:
        times: Increasing times of the frames, shape (frames,) [s].
        counts: Counts of the n texels in each frame, shape (frames, n) [-].

    Raises:
        ValueError: If there are no frames, or if the numbers of times and frames differ.
    """
    moments, values = np.asarray(times, dtype=float), np.asarray(counts)
    if not len(moments) or len(moments) != len(values):
        raise ValueError(f"a playback needs as many times as frames and at least one, not {len(moments)}")
    moments = moments - moments[0]
    # The last frame is shown for the mean time between frames.  One frame alone is shown all the time.
    duration = moments[-1] * len(moments) / max(1, len(moments) - 1) or math.inf

    def show(time: float) -> npt.ArrayLike:
        return np.asarray(values[np.searchsorted(moments, time % duration, side="right") - 1])

    return show


def show_frames(frames: Iterable[npt.ArrayLike]) -> Source:
    """Make a source of counts that shows the next of the given frames at each call, and finally the last frame.

    Args:
        frames: Counts of each frame, shape (n,) [-], such as those of the fast model; their number may be infinite.

    Raises:
        ValueError: If there are no frames.
    """
    remaining = iter(frames)
    shown = next(remaining, None)
    if shown is None:
        raise ValueError("at least one frame is needed to show")

    def show(time: float) -> npt.ArrayLike:  # noqa: ARG001 -- the order of the frames decides
        nonlocal shown
        shown = next(remaining, shown)
        return np.asarray(shown)

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


class PseudoTerminal:
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
        self._device, client = pty.openpty()
        self._open_files = [self._device, client]
        tty.setraw(client)
        os.set_blocking(self._device, False)
        self.port = os.ttyname(client)
        self.name = str(link or self.port)
        if link is not None:
            try:
                self._remove_link(lambda target: target.startswith(_TERMINALS))
                Path(link).symlink_to(self.port)
            except OSError as error:
                self.close()
                fault = f"cannot create a link to the port here: {error.strerror}; name a new file"
                raise PortError(f"{link}: {fault}") from error

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
        if self._open_files:
            # A link that another pseudo-terminal has replaced since then is not removed.
            self._remove_link(lambda target: target == self.port)
        while self._open_files:
            os.close(self._open_files.pop())

    def _remove_link(self, is_old: Callable[[str], bool]) -> None:
        """Remove the symbolic link to the port if `is_old` is true for the target of the link."""
        link = Path(self.name)
        if link.is_symlink() and is_old(str(link.readlink())):
            link.unlink()


class SerialEnd(Link):
    """The device's end of a serial cable, or of a connection that a pyserial URL names."""

    def send(self, data: bytes) -> int:
        """Send all bytes to the client and return their number."""
        self.write(data)
        return len(data)

    def receive(self, wait: float) -> bytes:
        """Return the bytes that a client sent; wait for the first one at most for `wait` [s]."""
        return b"".join(chunk.data for chunk in self.read(wait))


def serve(
    sensor: VirtualSensor,
    end: PseudoTerminal | SerialEnd,
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
    limit = math.inf if seconds is None else seconds
    backlog, left_out = b"", 0
    while not (stop and stop.is_set()) and (now := time.monotonic() - start) < limit:
        for frame in sensor.take_due_frames(now):
            if len(backlog) < backlog_bytes:
                backlog += frame
            else:
                left_out += 1
            # Bytes are sent after each frame; otherwise several frames that are due at once would fill the backlog.
            backlog = backlog[end.send(backlog) :]
        wait = min(_RECEIVE_TIMEOUT, max(0.0, sensor.next_due - (time.monotonic() - start)))
        backlog += sensor.receive(end.receive(wait), time.monotonic() - start)
        if backlog:
            backlog = backlog[end.send(backlog) :]
    return left_out
