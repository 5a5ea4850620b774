"""Reads a serial port in a background thread, so that no bytes are lost while the program does other work."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import serial
from serial.tools import list_ports

#: Largest number of received bytes that are kept until the program fetches them: five seconds of an array of 84 texels
#: at 271 frames/s.
BUFFER_BYTES = 256 * 1024
#: Longest wait for a byte, after which the reading thread checks whether it should stop [s].
_READ_TIMEOUT = 0.05
#: Longest wait until the port accepts bytes to send [s].
_WRITE_TIMEOUT = 1.0
#: Number of bytes that are requested at a time from a socket, and longest wait for them [s].  A socket, unlike a serial
#: port, does not report the number of bytes that can be read.
_SOCKET_BYTES, _SOCKET_TIMEOUT = 64, 0.005
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
        self.port = port
        self._is_url = "://" in port
        self._serial = _open_port(port, baud_rate, is_url=self._is_url)
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
        except (OSError, serial.SerialException) as error:
            raise LinkLostError(f"{self.port}: the port went away or takes no bytes: {error}") from error

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
            raise LinkLostError(f"{self.port}: the port went away (unplugged?)") from self._failure
        return chunks

    def close(self) -> None:
        """Stop the background thread that reads the port, and close the port."""
        self._stopping = True
        self._reader.join()
        self._serial.close()

    def _keep_reading(self) -> None:
        """Read bytes into the buffer until the port is closed or lost; runs in the background thread."""
        port = self._serial
        try:
            while not self._stopping:
                data = port.read(_SOCKET_BYTES if self._is_url else max(1, port.in_waiting))
                if data:
                    self._buffer(bytes(data))
        except (OSError, serial.SerialException, TypeError) as error:
            # pyserial raises TypeError if the file descriptor of the port is closed during a read
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _buffer(self, data: bytes) -> None:
        """Append received bytes to the buffer, or discard them if the buffer is full."""
        with self._changed:
            if self._buffered + len(data) > self._limit:
                self._lost += len(data)
                return
            self._chunks.append(Chunk(time.monotonic_ns(), data, self._lost))
            self._buffered += len(data)
            self._lost = 0
            self._changed.notify_all()


def _open_port(port: str, baud_rate: int, *, is_url: bool) -> serial.SerialBase:
    # A serial port can be locked against a second client; a pyserial URL cannot.
    options = {} if is_url else {"exclusive": True}
    try:
        opened = serial.serial_for_url(
            port,
            baudrate=baud_rate,
            timeout=_SOCKET_TIMEOUT if is_url else _READ_TIMEOUT,
            write_timeout=_WRITE_TIMEOUT,
            **options,
        )
        opened.reset_input_buffer()
    except (OSError, serial.SerialException, ValueError) as error:
        raise PortError(_explain(port, error)) from error
    return opened


def _explain(port: str, error: Exception) -> str:
    """Return one line with the reason why a port cannot be opened and what the user can do."""
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT:
        names = ", ".join(entry.device for entry in list_ports.comports()) or "none"
        return f"{port}: no such port; ports on this machine: {names}"
    if number == errno.EACCES:
        return f"{port}: no permission to open it; {_find_remedy(port)}"
    if "exclusively lock" in text or number == errno.EBUSY:
        return f"{port}: another program has it open; only one client can use a sensor"
    if "configure port" in text or number in (errno.ENOTTY, errno.EISDIR):
        return f"{port}: not a serial port; {_ACCEPTED}"
    return f"{port}: cannot be opened: {' '.join(text.split())}; {_ACCEPTED}"


def _find_remedy(port: str) -> str:
    """Return an instruction how the user gets permission to open a port."""
    try:
        import grp

        group = grp.getgrgid(Path(port).stat().st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return "ask the administrator"
    user = os.environ.get("USER", "$USER")
    return f"it belongs to group {group!r}: run `sudo usermod -aG {group} {user}` and log in again"
