"""A stand-in for the device: speaks the protocol as a WTS does and shows what it is told to show.

`VirtualSensor` is a function of bytes and time and knows no port; `serve` puts it on one.  How a real device
answers where no source says so follows `unconfirmed`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np
import numpy.typing as npt

from validation.weiss import commands
from validation.weiss.commands import Command, MatrixInfo, Status, Values
from validation.weiss.faults import FAULTS
from validation.weiss.frames import LARGEST_COUNT, encode_frame
from validation.weiss.messages import Message, encode
from validation.weiss.parser import Parser
from validation.weiss.unconfirmed import RUN_LENGTH_FLAG, TARE, TICK

#: Texel values at a time since the start [s], shape (n,) [counts].
Source = Callable[[float], npt.ArrayLike]

WTS_0614_34 = MatrixInfo(columns=6, rows=14, cell_width=3.4e-3, cell_height=3.4e-3, full_scale=4095)


@dataclass(frozen=True, kw_only=True)
class Misbehaviour:
    """What the device does wrong, on request.

    Attributes:
        rates: How often each of `FAULTS` hits a message, by name, 0..1 [-].
        refused: Commands that are answered with a status other than success.
        pauses: Times since the start between which nothing is sent, (from, to) [s].
        seed: Start of the random numbers.
    """

    rates: Mapping[str, float] = field(default_factory=dict)
    refused: Mapping[Command, Status] = field(default_factory=dict)
    pauses: tuple[tuple[float, float], ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the names.

        Raises:
            ValueError: If a fault is unknown or a rate is not in 0..1.
        """
        for name, rate in self.rates.items():
            if name not in FAULTS:
                raise ValueError(f"unknown fault {name!r}; known faults: {', '.join(FAULTS)}")
            if not 0 <= rate <= 1:
                raise ValueError(f"the rate of {name} must lie in 0..1, not {rate}")


class VirtualSensor:
    """What the device does, without a port.

    Args:
        source: What it shows.
        matrix: What it says of its array.
        rate: Frames per second when free-running [Hz].
        sensor_type: What it calls itself.
        misbehaviour: What it does wrong.
    """

    def __init__(
        self,
        source: Source,
        *,
        matrix: MatrixInfo = WTS_0614_34,
        rate: float = 271.0,
        sensor_type: str = "WTS 0614-34",
        misbehaviour: Misbehaviour | None = None,
    ) -> None:
        if rate <= 0:
            raise ValueError(f"rate must be positive, not {rate} Hz")
        self.matrix = matrix
        self.frames_sent = 0
        self._source = source
        self._rate = rate
        self._type = sensor_type
        self._wrong = misbehaviour or Misbehaviour()
        self._random = Random(self._wrong.seed)  # noqa: S311 -- reproducible faults, no secret
        self._parser = Parser(texels=matrix.texels)
        self._tag = b""
        self._threshold = self._gain = 0
        self._zero: npt.NDArray[np.int64] = np.zeros(matrix.texels, dtype=np.int64)
        self._period: float | None = None
        self._flags = 0
        self._next = 0.0

    @property
    def next_due(self) -> float | None:
        """When the next periodic frame is due, since the start; None while there are none [s]."""
        return None if self._period is None else self._next

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the client and return the answers.

        Args:
            data: What the client sent.
            now: Time since the start [s].
        """
        return b"".join(self._damaged(self._answer(message, now)) for message in self._parser.feed(data))

    def due(self, now: float) -> list[bytes]:
        """Periodic frames that are due by now.

        Args:
            now: Time since the start [s].
        """
        frames = []
        while self._period is not None and self._next <= now:
            if not any(start <= self._next < end for start, end in self._wrong.pauses):
                frame = encode(Command.PERIODIC_FRAME, self._frame(self._next, self._flags))
                frames.append(self._damaged(frame))
                self.frames_sent += 1
            self._next += self._period
        return frames

    def _damaged(self, message: bytes) -> bytes:
        for name, rate in self._wrong.rates.items():
            if self._random.random() < rate:
                message = FAULTS[name](message, self._random)
        return message

    def _answer(self, message: Message, now: float) -> bytes:
        try:
            command, values = commands.read_request(message)
        except KeyError:
            return encode(message.identifier, int(Status.COMMAND_UNKNOWN).to_bytes(2, "little"))
        except ValueError:
            status = Status.NOT_ENOUGH_PARAMETERS if not message.payload else Status.COMMAND_FORMAT_ERROR
            return commands.answer(Command(message.identifier), status)
        if command in self._wrong.refused:
            return commands.answer(command, self._wrong.refused[command])
        status, answered = self._carry_out(command, values, now)
        return commands.answer(command, status, *answered)

    def _carry_out(self, command: Command, values: Values, now: float) -> tuple[Status, Values]:
        told = self._told(now).get(command)
        if told is not None:
            return Status.SUCCESS, told
        number = values[0] if values and isinstance(values[0], int) else 0
        data = b"".join(value for value in values if isinstance(value, bytes))
        match command:
            case Command.LOOP:
                return Status.SUCCESS, (data,)
            case Command.READ_SINGLE_FRAME:
                return Status.SUCCESS, (self._frame(now, number),)
            case Command.START_PERIODIC_FRAMES:
                return self._start(number, values[1], now), ()
            case _:
                return self._change(command, number, data, now), ()

    def _told(self, now: float) -> Mapping[Command, Values]:
        """What the device says of itself."""
        return {
            Command.MATRIX_INFO: commands.matrix_values(self.matrix),
            Command.GET_THRESHOLD: (self._threshold,),
            Command.GET_GAIN: (self._gain,),
            Command.SENSOR_TYPE: (self._type.encode("ascii"),),
            Command.TEMPERATURE: (round(10 * _temperature(now)),),
            Command.SYSTEM_INFO: (1, 1, 0x1000, 1),
            Command.GET_TAG: (self._tag,),
        }

    def _change(self, command: Command, number: int, data: bytes, now: float) -> Status:
        match command:
            case Command.STOP_PERIODIC_FRAMES:
                self._period = None
            case Command.TARE:
                self._zero = self._shown(now) if number == TARE else np.zeros_like(self._zero)
            case Command.SET_THRESHOLD if number > LARGEST_COUNT:
                return Status.RANGE_ERROR
            case Command.SET_THRESHOLD:
                self._threshold = number
            case Command.SET_GAIN:
                self._gain = number
            case Command.SET_TAG:
                self._tag = data
            case _:
                return Status.FEATURE_NOT_SUPPORTED
        return Status.SUCCESS

    def _start(self, flags: int, interval: int | bytes, now: float) -> Status:
        if self._period is not None:
            return Status.ALREADY_RUNNING
        self._period = max(int(interval) * 1e-3, 1 / self._rate)
        self._flags = flags
        self._next = now
        return Status.SUCCESS

    def _frame(self, now: float, flags: int) -> bytes:
        counts = np.clip(self._shown(now) - self._zero - self._threshold, 0, LARGEST_COUNT)
        return encode_frame(int(now / TICK), counts, run_length=bool(flags & RUN_LENGTH_FLAG))

    def _shown(self, now: float) -> npt.NDArray[np.int64]:
        return np.clip(np.asarray(self._source(now), dtype=np.int64).ravel(), 0, self.matrix.full_scale)


def _temperature(now: float) -> float:
    """A pad that warms from 25 to 35 degC with a time constant of 20 min [degC]."""
    return float(35 - 10 * np.exp(-now / 1200))


def pattern(name: str, matrix: MatrixInfo = WTS_0614_34) -> Source:
    """A moving picture to recognise: `blob`, `ramp` (every frame differs), `corner` or `zero`.

    Raises:
        ValueError: If the name is unknown.
    """
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(matrix.columns), np.arange(matrix.rows)))
    order = np.arange(matrix.texels)

    def blob(time: float) -> npt.ArrayLike:
        column = (matrix.columns - 1) * (1 + np.sin(2 * time)) / 2
        row = (matrix.rows - 1) * (1 + np.sin(time)) / 2
        squared = (x - column) ** 2 + (y - row) ** 2
        return np.asarray(np.rint(3000 * np.exp(-squared / 4)), dtype=np.int64)

    pictures: dict[str, Source] = {
        "blob": blob,
        "ramp": lambda time: (order * 40 + round(time * 1000)) % (LARGEST_COUNT + 1),
        "corner": lambda time: np.where(order == 0, 2000, 0),  # noqa: ARG005 -- it stands still
        "zero": lambda time: np.zeros_like(order),  # noqa: ARG005 -- it stands still
    }
    if name not in pictures:
        raise ValueError(f"unknown pattern {name!r}; known patterns: {', '.join(pictures)}")
    return pictures[name]


def playback(times: npt.ArrayLike, counts: npt.ArrayLike, *, loop: bool = True) -> Source:
    """Show recorded frames at the times they were recorded.

    Args:
        times: Shape (frames,), rising [s].
        counts: Shape (frames, n).
        loop: Whether to start again at the end; else the last frame stays.

    Raises:
        ValueError: If there are no frames or the shapes disagree.
    """
    when, values = np.asarray(times, dtype=float), np.asarray(counts)
    if not len(when) or len(when) != len(values):
        raise ValueError(f"a playback needs as many times as frames and at least one, not {len(when)}")
    when = when - when[0]
    # the last frame is shown as long as the others on average
    whole = when[-1] * len(when) / max(1, len(when) - 1)

    def show(time: float) -> npt.ArrayLike:
        moment = time % whole if loop and whole else time
        return np.asarray(values[max(0, int(np.searchsorted(when, moment, side="right")) - 1)])

    return show


def from_frames(frames: Iterable[Any]) -> Source:
    """Show the `counts` of frames one after the other, one per frame sent; the last one stays.

    Args:
        frames: Objects with `counts`, shape (n,), such as those of the fast model; may be endless.

    Raises:
        ValueError: If there is none.
    """
    coming: Iterator[Any] = iter(frames)
    shown = next(coming, None)
    if shown is None:
        raise ValueError("at least one frame is needed to show")
    first = [shown]

    def show(time: float) -> npt.ArrayLike:  # noqa: ARG001 -- frames come in their own order
        first[0] = next(coming, first[0])
        return np.asarray(first[0].counts)

    return show
