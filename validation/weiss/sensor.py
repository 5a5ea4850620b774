"""Driver of a Weiss WTS sensor on a serial port: sends commands and yields the stream of frames.

A background thread reads the port, so that no bytes are lost while the program does other work.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import serial
from serial.tools import list_ports

from validation.weiss import protocol
from validation.weiss.protocol import Command, MatrixInfo, Parser, Reading, SystemInfo
from validation.weiss.stream import Continuity, Gap

#: Largest number of received bytes that are kept until the program fetches them: five seconds of an array of 84 texels
#: at 271 frames/s.
BUFFER_BYTES = 256 * 1024
#: Longest wait for a byte, after which the reading thread checks whether it should stop [s].
_READ_TIMEOUT = 0.05
#: Longest wait until the port accepts bytes to send [s].
_WRITE_TIMEOUT = 1.0
#: Number of bytes that are requested at a time from a socket [bytes].  A socket, unlike a serial port, does not report
#: the number of bytes that can be read.
_SOCKET_BYTES = 64
#: Longest wait for bytes from a socket [s].
_SOCKET_TIMEOUT = 0.005
#: Description of the accepted names of ports, for error messages.
_ACCEPTED = "accepted: a port such as /dev/ttyACM0, or a pyserial URL"


class PortError(OSError):
    """Reports that a port cannot be opened, was lost, or that no sensor answers on it; the message is one line."""


class LinkLostError(PortError):
    """Reports that a port was lost while it was in use."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes that were received from a port at one time.

    Attributes:
        host_time: Time at which the bytes were read, on the monotonic clock of the host [ns].
        data: The bytes.
        lost: Number of bytes before `data` that were discarded because the buffer was full [-].
    """

    host_time: int
    data: bytes
    lost: int = 0


class Link:
    """An open serial port whose received bytes are buffered by a background thread.

    Args:
        port: Name of a port, or a pyserial URL such as `socket://host:port`.
        baud_rate: Baud rate of a UART; virtual ports over USB ignore the value [1/s].
        buffer_bytes: Largest number of received bytes that are kept; further bytes are discarded and counted.

    Raises:
        PortError: If the port cannot be opened.
    """

    def __init__(self, port: str, *, baud_rate: int = 115_200, buffer_bytes: int = BUFFER_BYTES) -> None:
        self.name = port
        self._is_url = "://" in port
        # A serial port can be locked against a second client; a pyserial URL cannot.
        options = {"timeout": _SOCKET_TIMEOUT} if self._is_url else {"timeout": _READ_TIMEOUT, "exclusive": True}
        try:
            self._serial = serial.serial_for_url(port, baudrate=baud_rate, write_timeout=_WRITE_TIMEOUT, **options)
            self._serial.reset_input_buffer()
        except (OSError, ValueError) as error:
            raise PortError(_explain(port, error)) from error
        self._limit = buffer_bytes
        self._chunks: deque[Chunk] = deque()
        #: Number of bytes in the buffered chunks, and number of bytes discarded since the last chunk.
        self._buffered = self._lost = 0
        self._changed = threading.Condition()
        self._failure: Exception | None = None
        self._stopping = False
        self._reader = threading.Thread(target=self._keep_reading, name=f"read {port}", daemon=True)
        self._reader.start()

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            LinkLostError: If the port was lost or does not accept the bytes.
        """
        try:
            self._serial.write(data)
        except OSError as error:
            raise LinkLostError(f"{self.name}: the port went away or takes no bytes: {error}") from error

    def read(self, timeout: float) -> list[Chunk]:
        """Fetch the bytes received since the last call.

        Args:
            timeout: Longest wait for the first byte [s].

        Raises:
            LinkLostError: If the port was lost and all bytes received before were fetched.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._chunks or self._failure, timeout)
            chunks = list(self._chunks)
            self._chunks.clear()
            self._buffered = 0
        if not chunks and self._failure is not None:
            raise LinkLostError(f"{self.name}: the port went away (unplugged?)") from self._failure
        return chunks

    def close(self) -> None:
        """Stop the background thread that reads the port, and close the port."""
        self._stopping = True
        self._reader.join()
        self._serial.close()

    def _keep_reading(self) -> None:
        """Read bytes into the buffer until the port is closed or lost; runs in the background thread.

        Bytes for which the buffer has no room are discarded and counted.
        """
        while not self._stopping and self._failure is None:
            data, failure = b"", None
            try:
                data = self._serial.read(_SOCKET_BYTES if self._is_url else max(1, self._serial.in_waiting))
            except (OSError, TypeError) as error:
                # pyserial raises TypeError if the file descriptor of the port is closed during a read.
                failure = error
            with self._changed:
                self._failure = failure
                if self._buffered + len(data) > self._limit:
                    self._lost += len(data)
                elif data:
                    self._chunks.append(Chunk(time.monotonic_ns(), data, self._lost))
                    self._buffered += len(data)
                    self._lost = 0
                self._changed.notify_all()


def _explain(port: str, error: Exception) -> str:
    """Return one line with the reason why a port cannot be opened and what the user can do."""
    number, text = getattr(error, "errno", None), " ".join(str(error).split())
    if number == errno.ENOENT:
        names = ", ".join(entry.device for entry in list_ports.comports()) or "none"
        reason = f"no such port; ports on this machine: {names}"
    elif number == errno.EACCES:
        reason = f"no permission to open it; {_find_remedy(port)}"
    elif "exclusively lock" in text or number == errno.EBUSY:
        reason = "another program has it open; only one client can use a sensor"
    elif "configure port" in text or number in (errno.ENOTTY, errno.EISDIR):
        reason = f"not a serial port; {_ACCEPTED}"
    else:
        reason = f"cannot be opened: {text}; {_ACCEPTED}"
    return f"{port}: {reason}"


def _find_remedy(port: str) -> str:
    """Return an instruction how the user gets permission to open a port."""
    try:
        group = Path(port).group()
    except (KeyError, OSError, NotImplementedError):
        return "ask the administrator"
    user = os.environ.get("USER", "$USER")
    return f"it belongs to group {group!r}: run `sudo usermod -aG {group} {user}` and log in again"


@dataclass(frozen=True, kw_only=True)
class _Patience:
    """Waiting times and numbers of repetitions of the driver.  The protocol states none, so that they are our choice.

    Attributes:
        most_events: Largest number of readings and gaps that are stored until the program takes them from the stream
            [-].
        attempts: Number of times that a command is sent before it counts as unanswered [-].
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


class SensorError(PortError):
    """Reports that the sensor refused a command, or answered in another format than assumed."""


class NoAnswerError(PortError):
    """Reports that the sensor did not answer a command in time."""


class Sensor(AbstractContextManager["Sensor"]):
    """An open Weiss WTS sensor.  The end of a `with` block stops the stream of frames and closes the port.

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
        #: Payload of the latest answer to each command since a request was sent.
        self._answers: dict[int, bytes] = {}
        #: Parser of the received bytes, which counts bytes and messages since the port was opened or opened again.
        self.parser = Parser()
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

    def read_info(self) -> SystemInfo:
        """Read kind, hardware revision, firmware version and serial number of the device."""
        return SystemInfo.from_values(self.ask(Command.SYSTEM_INFO))

    def read_matrix(self) -> MatrixInfo:
        """Read the numbers of rows and columns, the pitch and the full scale of the array."""
        return MatrixInfo.from_values(self.ask(Command.MATRIX_INFO))

    def read_mask(self) -> npt.NDArray[np.bool_]:
        """Read which texels of the array exist, shape (n,), if the device states this as `inquiry` assumes."""
        (data,), texels = self.ask(Command.GET_MASK), self.read_matrix().texels
        bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder=protocol.MASK_BIT_ORDER).astype(bool)
        if len(data) != -(-texels // 8) or bits[texels:].any() or not bits.any():
            fault = f"{len(data)} bytes {data[: protocol.LONGEST_TEXT].hex()} are no mask of {texels} texels"
            raise SensorError(f"{self.port}: the answer to `get mask` is not as assumed: {fault}")
        return bits[:texels]

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
        return int(self.ask(Command.TEMPERATURE)[0]) / protocol.UNITS_PER_KELVIN

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
        self.ask(Command.TARE, 1)

    def untare(self) -> None:
        """Make the device stop the subtraction that `tare` started."""
        self.ask(Command.TARE, 0)

    def read_frame(self, *, run_length: bool = False) -> Reading:
        """Request one frame and return it.

        Args:
            run_length: Whether to request run-length encoding.
        """
        (frame,) = self.ask(Command.READ_SINGLE_FRAME, protocol.RUN_LENGTH_FLAG * run_length)
        return protocol.decode_frame(frame, host_time=time.monotonic_ns())

    def ask(self, command: Command, *values: int | bytes) -> protocol.Values:
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
            deadline = time.monotonic() + self.timeout
            while command not in self._answers and (left := deadline - time.monotonic()) > 0:
                self._receive(left)
            if command not in self._answers:
                self._end_wait()
            if command not in self._answers:
                continue
            try:
                status, answered = protocol.decode_answer(command, self._answers[command])
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
        requested = (protocol.RUN_LENGTH_FLAG * run_length, interval_ms)
        silence = max(_PATIENCE.silent_timeouts * self.timeout, _PATIENCE.silent_intervals * interval_ms * 1e-3)
        self._start_stream(requested)
        try:
            while True:
                try:
                    self._await_event(silence, requested)
                except LinkLostError as error:
                    self._end_wait()
                    self._events.extend(self._continuity.finish())
                    yield from self._take_events()
                    yield self._reconnect(error, reconnect, requested)
                yield from self._take_events()
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
            with suppress(SensorError):  # A device may refuse a command that would not change its state.
                self.ask(Command.STOP_PERIODIC_FRAMES)
            self.read_info()
        except NoAnswerError as error:
            reason = "nothing came back (is it the sensor's port, and is the sensor powered?)"
            if seen := self.parser.bytes_seen:
                reason = f"{seen} bytes came and none of them is an answer (another device, or a wrong baud rate)"
            raise NoAnswerError(f"{self.port}: no Weiss WTS sensor answers here: {reason}") from error
        self.parser.texels = None
        with suppress(SensorError):
            self.parser.texels = self.read_matrix().texels

    def _set(self, command: Command, value: int) -> None:
        """Set a value on the device, and store the value for a reconnection."""
        self.ask(command, value)
        self._settings[command] = value

    def _ask_text(self, command: Command) -> str:
        """Send a command and return the text in its answer."""
        return str(self.ask(command)[0], "ascii", "replace")

    def _receive(self, timeout: float) -> None:
        """Receive bytes and sort the messages in them; wait for the first byte at most for `timeout` [s]."""
        for chunk in self._link.read(timeout):
            if self.tap is not None:
                self.tap(chunk)
            if chunk.lost:
                self._events.append(Gap(kind="overflow", host_time=chunk.host_time, skipped=chunk.lost))
            self._sort_messages(self.parser.feed(chunk.data), chunk.host_time)

    def _end_wait(self) -> None:
        """Sort the messages that the parser has held back while it waited for the rest of a damaged message."""
        self._sort_messages(self.parser.finish(), time.monotonic_ns())

    def _sort_messages(self, messages: list[protocol.Message], host_time: int) -> None:
        """Store answers for `ask`, and store frames and the gaps between them as events of the stream."""
        for message in messages:
            if message.identifier != protocol.PERIODIC_FRAME:
                self._answers[message.identifier] = message.payload
                continue
            reading = protocol.decode_frame(message.payload, host_time=host_time)
            gaps = self._continuity.add(reading.ticks, skipped=message.skipped, host_time=host_time)
            self._events += [*gaps, reading]
            self._last_ticks = reading.ticks
        if len(self._events) > _PATIENCE.most_events:
            lost = len(self._events)
            self._events = deque([Gap(kind="overflow", host_time=host_time, frames=lost)])

    def _start_stream(self, requested: tuple[int, int]) -> None:
        """Command the device to send frames with these flags and this interval between frames [ms]."""
        self._events.clear()
        self._continuity = Continuity()
        self._streaming = True
        with suppress(SensorError):  # The device refuses the command if it already sends frames.
            self.ask(Command.START_PERIODIC_FRAMES, *requested)

    def _stop_stream(self) -> None:
        """Command the device to stop sending frames, if it sends them."""
        if self._streaming:
            self._streaming = False
            # If the port was lost or the device does not answer, there is no stream to stop.
            with suppress(PortError):
                self.ask(Command.STOP_PERIODIC_FRAMES)

    def _await_event(self, silence: float, requested: tuple[int, int]) -> None:
        """Wait until a reading or a gap is stored.

        If nothing arrives for `silence` [s], this is a gap, and the device is commanded again to send frames.
        """
        deadline = time.monotonic() + silence
        while not self._events and (left := deadline - time.monotonic()) > 0:
            self._receive(left)
        if not self._events:
            self._end_wait()
            self._link.write(protocol.encode_request(Command.START_PERIODIC_FRAMES, *requested))
            self._events.appendleft(Gap(kind="silence", host_time=time.monotonic_ns(), seconds=silence))

    def _take_events(self) -> Iterator[Reading | Gap]:
        """Yield the stored readings and gaps, and remove them from the store."""
        while self._events:
            yield self._events.popleft()

    def _reconnect(self, error: LinkLostError, patience: float, requested: tuple[int, int]) -> Gap:
        """Try for `patience` [s] to open the lost port and to start the stream again.

        Returns:
            The gap in the stream.

        Raises:
            LinkLostError: The given `error`, if the port cannot be opened in time.
        """
        lost, last_ticks = time.monotonic_ns(), self._last_ticks
        while True:
            self._link.close()
            if time.monotonic_ns() - lost >= 1e9 * patience:
                raise error
            time.sleep(_PATIENCE.reopen_pause)
            with suppress(PortError):
                self._link = self._open_link()
                self.parser = Parser(texels=self.parser.texels)
                self._check_sensor()
                for command, value in self._settings.items():
                    self.ask(command, value)
                self._start_stream(requested)
                now = time.monotonic_ns()
                return Gap(kind="link lost", host_time=now, after=last_ticks, seconds=1e-9 * (now - lost))
