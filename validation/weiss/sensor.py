"""Driver of a Weiss WTS sensor on a serial port: sends commands and yields the stream of frames."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.weiss import protocol
from validation.weiss.continuity import Continuity, Gap
from validation.weiss.link import BUFFER_BYTES, Chunk, Link, LinkLostError, PortError
from validation.weiss.parser import Counters, Parser
from validation.weiss.protocol import Command, MatrixInfo, Message, Reading, SystemInfo, Values, decode_frame
from validation.weiss.unconfirmed import RUN_LENGTH_FLAG, TARE, UNTARE


@dataclass(frozen=True, kw_only=True)
class _Patience:
    """How long the driver waits and repeats; nothing in the protocol states these values.

    Attributes:
        most_events: Largest number of readings and gaps that are stored until the program takes them from the stream
            [-].
        attempts: Number of times that a command is sent before it counts as unanswered, and largest number of stored
            answers [-].
        reopen_pause: Pause between two attempts to open a lost port again [s].
        silent_timeouts: A stream counts as silent after this many timeouts of an answer without a frame [-].
        silent_intervals: A stream counts as silent only after this many intervals between frames as well [-].
    """

    most_events: int = 8192
    attempts: int = 3
    reopen_pause: float = 0.1
    silent_timeouts: int = 2
    silent_intervals: int = 3


_PATIENCE = _Patience()

_SECONDS_PER_NANOSECOND = 1e-9


class SensorError(PortError):
    """Reports that the sensor refused a command, or answered in another format than assumed."""


class NoAnswerError(PortError):
    """Reports that the sensor did not answer a command in time."""


class Sensor(AbstractContextManager["Sensor"]):
    """An open sensor.  Use it in a `with` block, whose end stops the stream and closes the port.

    Args:
        port: Name of a port, or a pyserial URL such as `socket://host:port`.
        baud_rate: Baud rate of a UART; virtual ports over USB ignore the value [1/s].
        timeout: Longest wait for an answer before the command is sent again; it is sent three times at most [s].
        buffer_bytes: Largest number of received bytes that are kept until the program fetches them.

    Raises:
        PortError: If the port cannot be opened or no sensor answers on it.
    """

    def __init__(
        self, port: str, *, baud_rate: int = 115_200, timeout: float = 0.5, buffer_bytes: int = BUFFER_BYTES
    ) -> None:
        self.port = port
        self.timeout = timeout
        #: Function that is called with all received bytes before they are parsed; None for no call.
        self.tap: Callable[[Chunk], None] | None = None
        self._open_link: Callable[[], Link] = lambda: Link(port, baud_rate=baud_rate, buffer_bytes=buffer_bytes)
        #: Values that were set on the device, by command; they are set again after a reconnection.
        self._settings: dict[Command, int] = {}
        self._events: deque[Reading | Gap] = deque()
        self._answers: list[Message] = []
        self._parser = Parser()
        self._continuity = Continuity()
        self._streaming = False
        self._last_ticks: int | None = None
        self._link = self._open_link()
        try:
            self._check_sensor()
        except BaseException:
            self._link.close()
            raise

    def __exit__(self, *_: object) -> None:
        """Stop the stream and close the port."""
        self.close()

    @property
    def counters(self) -> Counters:
        """Numbers of bytes and messages received since the port was opened or opened again."""
        return self._parser.counters

    def read_info(self) -> SystemInfo:
        """Read kind, hardware revision, firmware version and serial number of the device."""
        return protocol.decode_system_info(self.ask(Command.SYSTEM_INFO))

    def read_matrix(self) -> MatrixInfo:
        """Read the numbers of rows and columns, the pitch and the full scale of the array."""
        return protocol.decode_matrix_info(self.ask(Command.MATRIX_INFO))

    def read_mask(self) -> npt.NDArray[np.bool_]:
        """Read which texels of the array exist, shape (n,), if the device states this as `unconfirmed` assumes."""
        data = protocol.join_bytes(self.ask(Command.GET_MASK))
        try:
            return protocol.decode_mask(data, self.read_matrix().texels)
        except ValueError as error:
            raise SensorError(f"{self.port}: the answer to `get mask` is not as assumed: {error}") from error

    def read_type(self) -> str:
        """Read the name of the sensor's type."""
        return self._ask_text(Command.SENSOR_TYPE)

    def read_tag(self) -> str:
        """Read the name that a user gave to the device (tag)."""
        return self._ask_text(Command.GET_TAG)

    def set_tag(self, tag: str) -> None:
        """Store a name for the device (tag), in ASCII characters."""
        self.ask(Command.SET_TAG, tag.encode("ascii"))

    def read_temperature(self) -> float:
        """Read the temperature of the device [degC]."""
        return protocol.decode_temperature(self.ask(Command.TEMPERATURE))

    def read_threshold(self) -> int:
        """Read the threshold below which a texel reads 0 [counts]."""
        return int(self.ask(Command.GET_THRESHOLD)[0])

    def set_threshold(self, threshold: int) -> None:
        """Set the threshold below which a texel reads 0 [counts]; it is set again after a reconnection."""
        self._set(Command.SET_THRESHOLD, threshold)

    def read_gain(self) -> int:
        """Read the front-end gain, in the unit of the device [-]."""
        return int(self.ask(Command.GET_GAIN)[0])

    def set_gain(self, gain: int) -> None:
        """Set the front-end gain, in the unit of the device [-]; it is set again after a reconnection."""
        self._set(Command.SET_GAIN, gain)

    def tare(self) -> None:
        """Make the device subtract the present frame from all later frames, until `untare` is called."""
        self.ask(Command.TARE, TARE)

    def untare(self) -> None:
        """Make the device stop the subtraction that `tare` started."""
        self.ask(Command.TARE, UNTARE)

    def read_frame(self, *, run_length: bool = False) -> Reading:
        """Request one frame and return it.

        Args:
            run_length: Whether to request run-length encoding.
        """
        values = self.ask(Command.READ_SINGLE_FRAME, RUN_LENGTH_FLAG * run_length)
        return decode_frame(protocol.join_bytes(values), host_time=time.monotonic_ns())

    def ask(self, command: Command, *values: int | bytes) -> Values:
        """Send any documented command and return the values of its answer.

        Args:
            command: The command.
            values: Values of the request, in the order of the command's layout.

        Raises:
            SensorError: If the status of the answer is not success, or if the layout of the answer is not as assumed.
            NoAnswerError: If no answer arrives in time.
            LinkLostError: If the port is lost.
        """
        name = command.name.lower().replace("_", " ")
        for _ in range(_PATIENCE.attempts):
            self._answers.clear()
            self._link.write(protocol.encode_request(command, *values))
            message = self._await_answer(command)
            if message is None:
                continue
            try:
                status, answered = protocol.decode_answer(message)
            except ValueError as error:
                raise SensorError(f"{self.port}: the answer to `{name}` is not as assumed: {error}") from error
            if status:
                raise SensorError(f"{self.port}: the sensor refused `{name}`: {protocol.describe_status(status)}")
            return answered
        raise NoAnswerError(
            f"{self.port}: no answer to `{name}` in {_PATIENCE.attempts * self.timeout:g} s; check the cable"
        )

    def stream(
        self, *, run_length: bool = False, interval_ms: int = 0, reconnect: float = 0.0
    ) -> Generator[Reading | Gap, None, None]:
        """Yield frames when the device sends them, and a `Gap` for each place where frames are missing.

        The stream ends if the caller closes the generator or an error is raised.  In both cases the device is commanded
        to stop sending.  The caller may send commands between two frames.

        Args:
            run_length: Whether to request run-length encoding.
            interval_ms: Time between frames; 0 for the shortest time that the device supports [ms].
            reconnect: Longest time during which a lost port is opened again and again [s].

        Raises:
            LinkLostError: If the port is lost and cannot be opened again within `reconnect`.
        """
        values = (RUN_LENGTH_FLAG * run_length, interval_ms)
        silence = max(_PATIENCE.silent_timeouts * self.timeout, _PATIENCE.silent_intervals * interval_ms * 1e-3)
        self._start_stream(values)
        try:
            while True:
                try:
                    yield from self._await_events(silence, values)
                except LinkLostError as error:
                    self._end_wait()
                    self._events.extend(self._continuity.finish())
                    yield from self._take_events()
                    yield self._reconnect(error, reconnect, values)
        finally:
            self._stop_stream()

    def take_last_gaps(self) -> list[Gap]:
        """Return the gaps between the first frames of a stream that ended before these frames were checked for gaps."""
        return self._continuity.finish()

    def close(self) -> None:
        """Stop the stream and close the port; a second call does nothing."""
        self._stop_stream()
        self._link.close()

    def _check_sensor(self) -> None:
        """Stop a stream that another program has left running, and check that a sensor answers.

        Raises:
            NoAnswerError: If no sensor answers on the port.
        """
        try:
            self._ask_unless_refused(Command.STOP_PERIODIC_FRAMES)
            self.read_info()
        except NoAnswerError as error:
            seen = self.counters.bytes_seen
            reason = (
                f"{seen} bytes came and none of them is an answer (another device, or a wrong baud rate)"
                if seen
                else "nothing came back (is it the sensor's port, and is the sensor powered?)"
            )
            raise NoAnswerError(f"{self.port}: no Weiss WTS sensor answers here: {reason}") from error
        try:
            self._parser.texels = self.read_matrix().texels
        except SensorError:
            self._parser.texels = None

    def _ask_unless_refused(self, command: Command, *values: int | bytes) -> None:
        """Send a command and ignore a refusal: a device may refuse a command that would not change its state."""
        with suppress(SensorError):
            self.ask(command, *values)

    def _set(self, command: Command, value: int) -> None:
        """Set a value on the device, and store the value for a reconnection."""
        self.ask(command, value)
        self._settings[command] = value

    def _ask_text(self, command: Command) -> str:
        """Send a command and return the text in its answer."""
        return protocol.join_bytes(self.ask(command)).decode("ascii", "replace")

    def _await_answer(self, command: Command) -> Message | None:
        """Wait for the answer to a command and return it; None if it does not arrive in time."""
        deadline = time.monotonic() + self.timeout
        while (left := deadline - time.monotonic()) > 0:
            self._receive(left)
            if answer := self._find_answer(command):
                return answer
        self._end_wait()
        return self._find_answer(command)

    def _find_answer(self, command: Command) -> Message | None:
        """Return the first stored answer to a command; None if there is none."""
        return next((message for message in self._answers if message.identifier == command), None)

    def _receive(self, timeout: float) -> None:
        """Receive bytes and sort the messages in them; wait for the first byte at most for `timeout` [s]."""
        for chunk in self._link.read(timeout):
            if self.tap is not None:
                self.tap(chunk)
            if chunk.lost:
                self._events.append(Gap(kind="overflow", host_time=chunk.host_time, skipped=chunk.lost))
            self._sort_messages(self._parser.feed(chunk.data), chunk.host_time)

    def _end_wait(self) -> None:
        """Sort the messages that the parser has held back while it waited for the rest of a damaged message."""
        self._sort_messages(self._parser.finish(), time.monotonic_ns())

    def _sort_messages(self, messages: list[Message], host_time: int) -> None:
        """Store answers for `_find_answer`, and store frames and the gaps between them as events of the stream."""
        for message in messages:
            if message.identifier != Command.PERIODIC_FRAME:
                self._answers.append(message)
                del self._answers[: -_PATIENCE.attempts]
                continue
            reading = decode_frame(message.payload, host_time=host_time)
            gaps = self._continuity.add(reading.ticks, skipped=message.skipped, host_time=host_time)
            self._events += [*gaps, reading]
            self._last_ticks = reading.ticks
        if len(self._events) > _PATIENCE.most_events:
            lost = len(self._events)
            self._events.clear()
            self._events.append(Gap(kind="overflow", host_time=host_time, frames=lost))

    def _start_stream(self, values: tuple[int, int]) -> None:
        """Command the device to send frames; `values` are the flags and the interval between frames [ms]."""
        self._events.clear()
        self._continuity = Continuity()
        self._streaming = True
        self._ask_unless_refused(Command.START_PERIODIC_FRAMES, *values)

    def _stop_stream(self) -> None:
        """Command the device to stop sending frames, if it sends them."""
        if not self._streaming:
            return
        self._streaming = False
        # If the port was lost or the device does not answer, there is no stream to stop.
        with suppress(PortError):
            self._ask_unless_refused(Command.STOP_PERIODIC_FRAMES)

    def _await_events(self, silence: float, values: tuple[int, int]) -> Iterator[Reading | Gap]:
        """Wait for readings and gaps, and yield them.

        If nothing arrives for `silence` [s], yield a gap and command the device again to send frames.
        """
        deadline = time.monotonic() + silence
        while not self._events and (left := deadline - time.monotonic()) > 0:
            self._receive(left)
        if not self._events:
            self._end_wait()
            self._link.write(protocol.encode_request(Command.START_PERIODIC_FRAMES, *values))
            yield Gap(kind="silence", host_time=time.monotonic_ns(), seconds=silence)
        yield from self._take_events()

    def _take_events(self) -> Iterator[Reading | Gap]:
        """Yield the stored readings and gaps, and remove them from the store."""
        while self._events:
            yield self._events.popleft()

    def _reconnect(self, error: LinkLostError, patience: float, values: tuple[int, int]) -> Gap:
        """Try for `patience` [s] to open the lost port and to start the stream again.

        Returns:
            The gap in the stream.

        Raises:
            LinkLostError: The given `error`, if the port cannot be opened in time.
        """
        lost, last_ticks = time.monotonic_ns(), self._last_ticks
        self._link.close()
        while (time.monotonic_ns() - lost) * _SECONDS_PER_NANOSECOND < patience:
            time.sleep(_PATIENCE.reopen_pause)
            try:
                self._link = self._open_link()
                self._parser = Parser(texels=self._parser.texels)
                self._check_sensor()
                for command, value in self._settings.items():
                    self.ask(command, value)
                self._start_stream(values)
            except PortError:
                self._link.close()
                continue
            now = time.monotonic_ns()
            seconds = (now - lost) * _SECONDS_PER_NANOSECOND
            return Gap(kind="link lost", host_time=now, after=last_ticks, seconds=seconds)
        raise error
