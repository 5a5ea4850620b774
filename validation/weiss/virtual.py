"""Virtual sensor that answers commands as a Weiss WTS does, and sends frames with given texel values.

`VirtualSensor` converts received bytes and times to sent bytes and needs no port; `serve` runs a virtual sensor on a
port.  Where no source states how a real device answers, the virtual sensor follows the assumptions in `unconfirmed`.

A fault of the serial line is a function that takes the bytes of a message and a random number generator, and returns
the bytes that the receiver gets.  Every fault accepts any bytes, also none, because the faults of a message may be
combined in any order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from random import Random
from types import MappingProxyType
from typing import Protocol

import numpy as np
import numpy.typing as npt

from validation.weiss import protocol
from validation.weiss.parser import Parser
from validation.weiss.protocol import (
    HEAD_SIZE,
    LARGEST_COUNT,
    LONGEST_TEXT,
    PREAMBLE,
    Command,
    MatrixInfo,
    Message,
    Status,
    Values,
    encode_frame,
    encode_mask,
    encode_message,
)
from validation.weiss.unconfirmed import DEFAULT_TAG, RUN_LENGTH_FLAG, TARE, TICK

#: Function from a message and a random number generator to the bytes that the receiver gets.
Fault = Callable[[bytes, Random], bytes]


def flip_bit(message: bytes, random: Random) -> bytes:
    """Change one random bit of the message."""
    start = _choose_index(message, random)
    changed = bytes(byte ^ (1 << random.randrange(8)) for byte in message[start : start + 1])
    return message[:start] + changed + message[start + 1 :]


def change_bytes(message: bytes, random: Random) -> bytes:
    """Replace one to eight consecutive bytes of the message by random bytes."""
    start = _choose_index(message, random)
    length = min(random.randint(1, 8), len(message) - start)
    return message[:start] + random.randbytes(length) + message[start + length :]


def drop_bytes(message: bytes, random: Random) -> bytes:
    """Remove one to sixteen consecutive bytes of the message."""
    start = _choose_index(message, random)
    return message[:start] + message[start + random.randint(1, 16) :]


def repeat_bytes(message: bytes, random: Random) -> bytes:
    """Send one to sixteen consecutive bytes of the message twice."""
    start = _choose_index(message, random)
    end = start + random.randint(1, 16)
    return message[:end] + message[start:]


def insert_noise(message: bytes, random: Random) -> bytes:
    """Insert one to forty random bytes in or before the message."""
    start = _choose_index(message, random)
    return message[:start] + random.randbytes(random.randint(1, 40)) + message[start:]


def cut(message: bytes, random: Random) -> bytes:
    """Truncate the message after a random number of bytes, at least one."""
    return message[: random.randint(1, max(1, len(message) - 1))]


def false_head(message: bytes, random: Random) -> bytes:
    """Send the head of another message, with a random payload size and without payload, before the message."""
    return PREAMBLE + random.choice((b"\x00", b"\x20")) + bytes([random.randrange(256), 0]) + message


def wrong_size(message: bytes, random: Random) -> bytes:
    """Replace the payload size in the head of the message by a random number."""
    return message[: HEAD_SIZE - 2] + random.randbytes(2) + message[HEAD_SIZE:]


def _choose_index(message: bytes, random: Random) -> int:
    """Return the index of a random byte of the message; 0 if it has none."""
    return random.randrange(max(1, len(message)))


#: Every fault by the name that the command line takes.
FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "flip-bit": flip_bit,
        "change-bytes": change_bytes,
        "drop-bytes": drop_bytes,
        "repeat-bytes": repeat_bytes,
        "insert-noise": insert_noise,
        "cut": cut,
        # one to five bytes AA, the byte of the preamble, before the message
        "extra-preamble": lambda message, random: PREAMBLE[:1] * random.randint(1, 5) + message,
        "false-head": false_head,
        "lose": lambda _message, _random: b"",
        "repeat": lambda message, _: message + message,
        # the text of a booting device of the SDH generation before the message
        "boot-text": lambda message, _: b"\x1b[5n\x1b[5n\x1b[5n" + message,
        "wrong-size": wrong_size,
    }
)

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
        warming_time: Time constant of the exponential rise between them [s].
        blob_peak: Largest count of the pattern `blob`, a moving Gaussian peak [-].
        blob_spread: Twice the variance of this Gaussian [texels^2].
        ramp_step: Difference of the counts of consecutive texels of the pattern `ramp` [-].
        ramp_rate: Increase of these counts over time [counts/s].
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


class HasCounts(Protocol):
    """A frame of any type that has the counts of n texels."""

    @property
    def counts(self) -> npt.NDArray[np.integer]:
        """Counts of the texels, shape (n,) [-]."""


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
        self.type = name_type(matrix) if sensor_type is None else sensor_type
        self._misbehaviour = misbehaviour or Misbehaviour()
        self._random = Random(self._misbehaviour.seed)  # noqa: S311 -- reproducible faults, no secret
        self._parser = Parser(texels=matrix.texels)
        self._tag = tag.encode("ascii")
        self._threshold = self._gain = 0
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
                frame = encode_message(Command.PERIODIC_FRAME, self._make_frame(self._next_due, self._flags))
                frames.append(self._damage(frame))
                self.frames_sent += 1
            self._next_due += self._period
        return frames

    def _damage(self, message: bytes) -> bytes:
        """Apply each fault to the bytes of a message with the probability of the fault."""
        for name, rate in self._misbehaviour.rates.items():
            if self._random.random() < rate and message:
                message = FAULTS[name](message, self._random)
        return message

    def _answer(self, message: Message, now: float) -> bytes:
        """Execute the command in a message from the client and return the bytes of the answer."""
        try:
            command, values = protocol.decode_request(message)
        except KeyError:
            return encode_message(message.identifier, int(Status.COMMAND_UNKNOWN).to_bytes(2, "little"))
        except ValueError:
            status = Status.NOT_ENOUGH_PARAMETERS if not message.payload else Status.COMMAND_FORMAT_ERROR
            return protocol.encode_answer(Command(message.identifier), status)
        if command in self._misbehaviour.refused:
            return protocol.encode_answer(command, self._misbehaviour.refused[command])
        status, answered = self._execute(command, values, now)
        return protocol.encode_answer(command, status, *answered)

    def _execute(self, command: Command, values: Values, now: float) -> tuple[Status, Values]:
        """Execute a command and return the status and the values of its answer."""
        state = self._report_state(now).get(command)
        if state is not None:
            return Status.SUCCESS, state
        number = values[0] if values and isinstance(values[0], int) else 0
        data = protocol.join_bytes(values)
        match command:
            case Command.LOOP:
                return Status.SUCCESS, (data,)
            case Command.READ_SINGLE_FRAME:
                return Status.SUCCESS, (self._make_frame(now, number),)
            case Command.START_PERIODIC_FRAMES:
                return self._start_frames(number, int(values[1]), now), ()
            case _:
                return self._change(command, number, data, now), ()

    def _report_state(self, now: float) -> Mapping[Command, Values]:
        """Return the values of the answers to all commands that only read a property of the device, by command."""
        degrees = _SHOWN.warm - (_SHOWN.warm - _SHOWN.cold) * math.exp(-now / _SHOWN.warming_time)
        return {
            Command.MATRIX_INFO: protocol.encode_matrix_info(self.matrix),
            Command.GET_THRESHOLD: (self._threshold,),
            Command.GET_GAIN: (self._gain,),
            Command.SENSOR_TYPE: (self.type.encode("ascii"),),
            Command.TEMPERATURE: protocol.encode_temperature(degrees),
            Command.SYSTEM_INFO: (1, 1, 0x1000, 1),
            Command.GET_TAG: (self._tag,),
            Command.GET_MASK: (encode_mask(self._active),),
        }

    def _change(self, command: Command, number: int, data: bytes, now: float) -> Status:
        """Execute a command that changes a setting and whose answer has no values; return the status.

        Args:
            command: The command.
            number: First value of the request; 0 if the first value is not a number.
            data: Raw bytes of the request.
            now: Time since the start [s].
        """
        match command:
            case Command.STOP_PERIODIC_FRAMES:
                self._period = None
            case Command.TARE:
                self._zero = self._show(now) if number == TARE else np.zeros_like(self._zero)
            case Command.SET_THRESHOLD if number > LARGEST_COUNT:
                return Status.RANGE_ERROR
            case Command.SET_THRESHOLD:
                self._threshold = number
            case Command.SET_GAIN:
                self._gain = number
            case Command.SET_TAG if len(data) > LONGEST_TEXT:
                return Status.RANGE_ERROR
            case Command.SET_TAG:
                self._tag = data
            case _:
                return Status.FEATURE_NOT_SUPPORTED
        return Status.SUCCESS

    def _start_frames(self, flags: int, interval_ms: int, now: float) -> Status:
        """Start to send periodic frames, no faster than at the rate of the sensor; return the status."""
        if self._period is not None:
            return Status.ALREADY_RUNNING
        self._period = max(interval_ms * 1e-3, 1 / self._rate)
        self._flags = flags
        self._next_due = now
        return Status.SUCCESS

    def _make_frame(self, now: float, flags: int) -> bytes:
        """Return the bytes of a frame at the time `now` [s], after tare and threshold were subtracted."""
        counts = np.clip(self._show(now) - self._zero - self._threshold, 0, LARGEST_COUNT)
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


def show_frames(frames: Iterable[HasCounts]) -> Source:
    """Make a source of counts that shows the next of the given frames at each call, and finally the last frame.

    Args:
        frames: The frames, such as those of the fast model; their number may be infinite.

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
        return shown.counts

    return show
