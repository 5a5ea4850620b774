"""Runs a virtual sensor on a port: a pseudo-terminal, or any port that pyserial opens."""

from __future__ import annotations

import os
import select
import threading
import time
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

import serial

from validation.weiss.link import PortError
from validation.weiss.virtual import VirtualSensor

#: Largest number of bytes that are stored for a client that does not read.  If more are stored, new frames are left
#: out as a whole, as a real device does.
BACKLOG_BYTES = 4096
#: Longest wait for bytes from a client, after which the server checks whether it should stop [s].
_RECEIVE_TIMEOUT = 0.05
#: Largest number of bytes that are read from a client at a time.
_PIECE_BYTES = 4096
#: Start of the names of pseudo-terminals on Linux and macOS.
_TERMINALS = ("/dev/pts/", "/dev/ttys")
#: Longest wait until the port accepts bytes to send [s].
_WRITE_TIMEOUT = 1.0


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
            self._serial = serial.serial_for_url(port, baudrate=baud_rate, write_timeout=_WRITE_TIMEOUT)
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
            backlog = _send(end, backlog)
        due = sensor.next_due
        wait = _RECEIVE_TIMEOUT if due is None else min(_RECEIVE_TIMEOUT, max(0.0, due - (time.monotonic() - start)))
        received = end.receive(wait)
        if received:
            backlog += sensor.receive(received, time.monotonic() - start)
        backlog = _send(end, backlog)
    return left_out


def _send(end: End, data: bytes) -> bytes:
    """Send as many bytes as the connection accepts, and return the bytes that were not sent."""
    return data[end.send(data) :] if data else data
