"""A serial port that is read in the background, so that a slow consumer does not stall it."""

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

#: How long the reader waits for a byte before it looks whether it should stop [s].
_PATIENCE = 0.05
_WRITE_TIMEOUT = 1.0
#: Sockets do not tell how many bytes wait: so many are asked for at once, for so long at most [s].
_SOCKET_PIECE, _SOCKET_PATIENCE = 64, 0.005
#: Bytes held for a consumer that is behind: five seconds of an array of 84 texels at 271 frames/s.
BUFFER_BYTES = 256 * 1024


class PortError(OSError):
    """A port cannot be opened, went away, or no sensor answers on it; the message is one line."""


class LinkLostError(PortError):
    """The port went away while it was in use."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes as they came from the port.

    Attributes:
        host_time: When they were read, monotonic [ns].
        data: The bytes.
        lost: Bytes before these that were thrown away because nobody fetched them.
    """

    host_time: int
    data: bytes
    lost: int = 0


class Link:
    """An open port.

    Args:
        port: Name of a port, or a pyserial URL such as `socket://host:port`.
        baud_rate: Speed of a true UART; USB virtual ports ignore it [1/s].
        buffer_bytes: Most bytes held for the consumer; what comes beyond is thrown away and counted.

    Raises:
        PortError: If the port cannot be opened.
    """

    def __init__(self, port: str, *, baud_rate: int = 115_200, buffer_bytes: int = BUFFER_BYTES) -> None:
        self.port = port
        self._is_url = "://" in port
        self._serial = _open(port, baud_rate)
        self._limit = buffer_bytes
        self._chunks: deque[Chunk] = deque()
        self._held = self._lost = 0
        self._changed = threading.Condition()
        self._failure: Exception | None = None
        self._stopping = False
        self._reader = threading.Thread(target=self._read_on, name=f"read {port}", daemon=True)
        self._reader.start()

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            LinkLostError: If the port is gone or does not take them.
        """
        try:
            self._serial.write(data)
        except (OSError, serial.SerialException) as error:
            raise LinkLostError(f"{self.port}: the port went away or takes no bytes: {error}") from error

    def read(self, timeout: float) -> list[Chunk]:
        """Fetch what came since the last call, waiting for the first byte for `timeout` [s] at most.

        Raises:
            LinkLostError: If the port went away; what came before is handed out first.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._chunks or self._failure, timeout)
            chunks = list(self._chunks)
            self._chunks.clear()
            self._held = 0
        if not chunks and self._failure is not None:
            raise LinkLostError(f"{self.port}: the port went away (unplugged?)") from self._failure
        return chunks

    def close(self) -> None:
        """Stop reading and close the port."""
        self._stopping = True
        self._reader.join()
        self._serial.close()

    def _read_on(self) -> None:
        port = self._serial
        try:
            while not self._stopping:
                waiting = port.in_waiting
                data = port.read(_SOCKET_PIECE if self._is_url else max(1, waiting))
                if data:
                    self._hold(bytes(data))
        except (OSError, serial.SerialException, TypeError) as error:
            # pyserial raises TypeError where the file descriptor vanishes under it
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _hold(self, data: bytes) -> None:
        with self._changed:
            if self._held + len(data) > self._limit:
                self._lost += len(data)
                return
            self._chunks.append(Chunk(time.monotonic_ns(), data, self._lost))
            self._held += len(data)
            self._lost = 0
            self._changed.notify_all()


def _open(port: str, baud_rate: int) -> serial.SerialBase:
    url = "://" in port
    # only names of ports can be locked against a second client
    options = {} if url else {"exclusive": True}
    try:
        opened = serial.serial_for_url(
            port,
            baudrate=baud_rate,
            timeout=_SOCKET_PATIENCE if url else _PATIENCE,
            write_timeout=_WRITE_TIMEOUT,
            **options,
        )
        opened.reset_input_buffer()
    except (OSError, serial.SerialException, ValueError) as error:
        raise PortError(_explain(port, error)) from error
    return opened


def _explain(port: str, error: Exception) -> str:
    """Why a port cannot be opened, in one line that says what to do."""
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT:
        names = ", ".join(entry.device for entry in list_ports.comports()) or "none"
        return f"{port}: no such port; ports on this machine: {names}"
    if number == errno.EACCES:
        return f"{port}: no permission to open it; {_remedy(port)}"
    if "exclusively lock" in text or number == errno.EBUSY:
        return f"{port}: another program has it open; only one client can use a sensor"
    if "configure port" in text or number in (errno.ENOTTY, errno.EISDIR):
        return f"{port}: not a serial port; accepted: a port such as /dev/ttyACM0, or a pyserial URL"
    return f"{port}: cannot be opened: {' '.join(text.split())}"


def _remedy(port: str) -> str:
    try:
        import grp

        group = grp.getgrgid(Path(port).stat().st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return "ask the administrator"
    user = os.environ.get("USER", "$USER")
    return f"it belongs to group {group!r}: run `sudo usermod -aG {group} {user}` and log in again"
