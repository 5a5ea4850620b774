"""A WTS sensor on a port."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from validation.weiss import commands
from validation.weiss.commands import Command, MatrixInfo, SystemInfo, Values
from validation.weiss.continuity import Continuity, Gap
from validation.weiss.frames import CountArray, DeviceFrame, decode_frame
from validation.weiss.link import BUFFER_BYTES, Chunk, Link, LinkLostError, PortError
from validation.weiss.messages import Message
from validation.weiss.parser import Counters, Parser
from validation.weiss.unconfirmed import TARE, TICK, UNTARE

#: Readings and gaps held for a consumer that asks for something else in between.
_MOST_EVENTS = 8192
_ATTEMPTS = 3
_REOPEN_PAUSE = 0.1
_NANO = 1e-9


class SensorError(PortError):
    """The sensor refused a command; the message says which and why."""


class NoAnswerError(PortError):
    """The sensor did not answer in time."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Reading:
    """One frame of the sensor.

    Attributes:
        counts: Texel values, shape (n,), row-major, x fastest.
        ticks: The device's clock.
        host_time: When its last byte was read, monotonic [ns].
        run_length: Whether it came run-length encoded.
    """

    counts: CountArray
    ticks: int
    host_time: int
    run_length: bool

    @property
    def time(self) -> float:
        """The device's clock [s]."""
        return self.ticks * TICK


class Sensor:
    """An open sensor.  Use it in a `with` block: leaving stops the frames and closes the port.

    Args:
        port: Name of a port, or a pyserial URL such as `socket://host:port`.
        baud_rate: Speed of a true UART; USB virtual ports ignore it [1/s].
        timeout: How long to wait for an answer before asking again, three times in all [s].
        buffer_bytes: Most bytes held for a consumer that is behind.
        tap: Called with every piece of bytes that comes, before it is parsed.

    Raises:
        PortError: If the port cannot be opened or no sensor answers on it.
    """

    def __init__(
        self,
        port: str,
        *,
        baud_rate: int = 115_200,
        timeout: float = 0.5,
        buffer_bytes: int = BUFFER_BYTES,
        tap: Callable[[Chunk], None] | None = None,
    ) -> None:
        self.port = port
        self.timeout = timeout
        self.tap = tap
        self._open_link: Callable[[], Link] = lambda: Link(port, baud_rate=baud_rate, buffer_bytes=buffer_bytes)
        self._settings: dict[Command, int] = {}
        self._events: deque[Reading | Gap] = deque()
        self._answers: list[Message] = []
        self._parser = Parser()
        self._continuity = Continuity()
        self._streaming = False
        self._last: int | None = None
        self._link = self._open_link()
        try:
            self._greet()
        except BaseException:
            self._link.close()
            raise

    def __enter__(self) -> Self:
        """Nothing more to do: the port is open."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop and close."""
        self.close()

    @property
    def counters(self) -> Counters:
        """What came over the port up to now."""
        return self._parser.counters

    # what can be asked

    def info(self) -> SystemInfo:
        """Kind, revision, firmware and serial number."""
        return commands.system_info(self.ask(Command.SYSTEM_INFO))

    def matrix(self) -> MatrixInfo:
        """Rows, columns, pitch and full scale."""
        return commands.matrix_info(self.ask(Command.MATRIX_INFO))

    def sensor_type(self) -> str:
        """Name of the sensor's type."""
        return self._text(Command.SENSOR_TYPE)

    def tag(self) -> str:
        """Name that a user gave to the device."""
        return self._text(Command.GET_TAG)

    def set_tag(self, tag: str) -> None:
        """Give the device a name (ASCII)."""
        self.ask(Command.SET_TAG, tag.encode("ascii"))

    def temperature(self) -> float:
        """Temperature of the device [degC]."""
        return commands.temperature(self.ask(Command.TEMPERATURE))

    def threshold(self) -> int:
        """Threshold below which a texel reads 0 [counts]."""
        return int(self.ask(Command.GET_THRESHOLD)[0])

    def set_threshold(self, threshold: int) -> None:
        """Set the threshold [counts]; it is set again after a reconnection."""
        self._set(Command.SET_THRESHOLD, threshold)

    def gain(self) -> int:
        """Front-end gain, in the device's own unit."""
        return int(self.ask(Command.GET_GAIN)[0])

    def set_gain(self, gain: int) -> None:
        """Set the front-end gain; it is set again after a reconnection."""
        self._set(Command.SET_GAIN, gain)

    def tare(self) -> None:
        """Take the present image as zero."""
        self.ask(Command.TARE, TARE)

    def untare(self) -> None:
        """Take `tare` back."""
        self.ask(Command.TARE, UNTARE)

    def single(self, *, run_length: bool = False) -> Reading:
        """Ask for one frame.

        Args:
            run_length: Whether to ask for run-length encoding.
        """
        (data,) = self.ask(Command.READ_SINGLE_FRAME, commands.frame_flags(run_length=run_length))
        if not isinstance(data, bytes):
            raise TypeError(f"a frame is bytes, not {data!r}")
        return _reading(decode_frame(data), time.monotonic_ns())

    def ask(self, command: Command, *values: int | bytes) -> Values:
        """Send any documented command and return what its answer holds after the status.

        Raises:
            SensorError: If the status is not success, or the answer is laid out otherwise than assumed.
            NoAnswerError: If no answer comes.
            LinkLostError: If the port goes away.
        """
        for _ in range(_ATTEMPTS):
            self._answers.clear()
            self._link.write(commands.request(command, *values))
            found = self._await(command)
            if found is None:
                continue
            name = command.name.lower().replace("_", " ")
            try:
                status, answered = commands.read_answer(found)
            except ValueError as error:
                raise SensorError(f"{self.port}: the answer to `{name}` is not as assumed: {error}") from error
            if status:
                raise SensorError(f"{self.port}: the sensor refused `{name}`: {commands.describe_status(status)}")
            return answered
        raise NoAnswerError(f"{self.port}: no answer to {command.name.lower()} in {_ATTEMPTS * self.timeout:g} s")

    def stream(
        self, *, run_length: bool = False, interval_ms: int = 0, reconnect: float = 0.0
    ) -> Generator[Reading | Gap, None, None]:
        """Frames as the device sends them, and a `Gap` wherever some are missing.

        Ends only by the caller (leave the loop, close the iterator) or by an error; either way the device is told
        to stop.  Commands may be sent between two frames.

        Args:
            run_length: Whether to ask for run-length encoding.
            interval_ms: Time between frames; 0 for as fast as the device can [ms].
            reconnect: How long to try to open the port again after it went away [s].

        Raises:
            LinkLostError: If the port goes away and does not come back in time.
        """
        values = (commands.frame_flags(run_length=run_length), interval_ms)
        silence = max(2 * self.timeout, 3e-3 * interval_ms)
        self._begin(values)
        try:
            while True:
                try:
                    yield from self._next_events(silence, values)
                except LinkLostError as error:
                    yield from self._flush()
                    yield self._reconnect(error, reconnect, values)
        finally:
            self._end()

    def last_gaps(self) -> list[Gap]:
        """Gaps among the first frames of a stream that was left before they could be told."""
        return self._continuity.finish()

    def close(self) -> None:
        """Stop the frames and close the port; safe to call twice."""
        self._end()
        self._link.close()

    # how it is done

    def _greet(self) -> None:
        """Silence a device that another client left streaming, and see that it is a sensor."""
        try:
            self._quiet(Command.STOP_PERIODIC_FRAMES)
            self.info()
        except NoAnswerError as error:
            seen = self.counters.bytes_seen
            what = (
                f"{seen} bytes came and none of them is an answer (another device, or a wrong baud rate)"
                if seen
                else "nothing came back (is it the sensor's port, and is the sensor powered?)"
            )
            raise NoAnswerError(f"{self.port}: no Weiss WTS sensor answers here: {what}") from error
        try:
            self._parser.texels = self.matrix().texels
        except SensorError:
            self._parser.texels = None

    def _quiet(self, command: Command, *values: int | bytes) -> None:
        """Ask for something that a device may refuse because it is so already."""
        try:
            self.ask(command, *values)
        except SensorError:
            return

    def _set(self, command: Command, value: int) -> None:
        self.ask(command, value)
        self._settings[command] = value

    def _text(self, command: Command) -> str:
        (data,) = self.ask(command)
        return data.decode("ascii", "replace") if isinstance(data, bytes) else str(data)

    def _await(self, command: Command) -> Message | None:
        deadline = time.monotonic() + self.timeout
        while (left := deadline - time.monotonic()) > 0:
            self._pump(left)
            for message in self._answers:
                if message.identifier == command:
                    return message
        self._dispatch(self._parser.finish(), time.monotonic_ns())
        return next((message for message in self._answers if message.identifier == command), None)

    def _pump(self, timeout: float) -> None:
        for chunk in self._link.read(timeout):
            if self.tap is not None:
                self.tap(chunk)
            if chunk.lost:
                self._events.append(Gap(kind="overflow", host_time=chunk.host_time, skipped=chunk.lost))
            self._dispatch(self._parser.feed(chunk.data), chunk.host_time)

    def _dispatch(self, messages: list[Message], host_time: int) -> None:
        for message in messages:
            if message.identifier != Command.PERIODIC_FRAME:
                self._answers.append(message)
                del self._answers[:-_ATTEMPTS]
                continue
            frame = decode_frame(message.payload)
            gaps = self._continuity.next(frame.ticks, skipped=message.skipped, host_time=host_time)
            self._events += [*gaps, _reading(frame, host_time)]
            self._last = frame.ticks
        if len(self._events) > _MOST_EVENTS:
            lost = len(self._events)
            self._events.clear()
            self._events.append(Gap(kind="overflow", host_time=host_time, frames=lost))

    def _begin(self, values: tuple[int, int]) -> None:
        self._events.clear()
        self._continuity = Continuity()
        self._streaming = True
        self._quiet(Command.START_PERIODIC_FRAMES, *values)

    def _next_events(self, silence: float, values: tuple[int, int]) -> Iterator[Reading | Gap]:
        deadline = time.monotonic() + silence
        while not self._events and (left := deadline - time.monotonic()) > 0:
            self._pump(left)
        if not self._events:
            self._dispatch(self._parser.finish(), time.monotonic_ns())
            self._link.write(commands.request(Command.START_PERIODIC_FRAMES, *values))
            yield Gap(kind="silence", host_time=time.monotonic_ns(), seconds=silence)
        while self._events:
            yield self._events.popleft()

    def _flush(self) -> Iterator[Reading | Gap]:
        self._dispatch(self._parser.finish(), time.monotonic_ns())
        self._events.extend(self._continuity.finish())
        while self._events:
            yield self._events.popleft()

    def _reconnect(self, error: LinkLostError, patience: float, values: tuple[int, int]) -> Gap:
        lost, last = time.monotonic_ns(), self._last
        self._link.close()
        while (time.monotonic_ns() - lost) * _NANO < patience:
            time.sleep(_REOPEN_PAUSE)
            try:
                self._link = self._open_link()
                self._parser = Parser(texels=self._parser.texels)
                self._greet()
                for command, value in self._settings.items():
                    self.ask(command, value)
                self._begin(values)
            except PortError:
                self._link.close()
                continue
            now = time.monotonic_ns()
            return Gap(kind="link lost", host_time=now, after=last, seconds=(now - lost) * _NANO)
        raise error

    def _end(self) -> None:
        if not self._streaming:
            return
        self._streaming = False
        try:
            self._quiet(Command.STOP_PERIODIC_FRAMES)
        except PortError:
            # the device is gone or mute: there is nothing left to stop
            return


def _reading(frame: DeviceFrame, host_time: int) -> Reading:
    return Reading(counts=frame.counts, ticks=frame.ticks, host_time=host_time, run_length=frame.run_length)
