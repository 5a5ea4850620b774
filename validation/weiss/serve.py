"""Puts a virtual sensor on a port: a pseudo-terminal, or any port that pyserial opens."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import serial

from validation.weiss.link import PortError
from validation.weiss.virtual import VirtualSensor

#: Bytes that wait for a client that does not read; beyond that whole frames are left out, as a device does.
BACKLOG = 4096
_IDLE = 0.05
_PIECE = 4096


class End(Protocol):
    """The device's end of a connection."""

    def send(self, data: bytes) -> int:
        """Send what can be sent now; return how many bytes that was."""

    def receive(self, wait: float) -> bytes:
        """What came; waits for the first byte for `wait` [s] at most."""


class PseudoTerminal:
    """A pseudo-terminal: a client opens `name` as if it were a port.  Not on Windows.

    The client's side stays open here, so that clients may come and go, and is set raw before any client opens it: a
    fresh pseudo-terminal echoes.

    Args:
        link: Where to put a symbolic link to the port, so that it can be named; an old link is replaced.

    Raises:
        PortError: If the link cannot be made.
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
        self.name = self.port
        self._link = None if link is None else Path(link)
        if self._link is not None:
            self._place(self._link)
            self.name = str(self._link)

    def _place(self, link: Path) -> None:
        try:
            if link.is_symlink():
                link.unlink()
            link.symlink_to(self.port)
        except OSError as error:
            self._link = None
            self.close()
            raise PortError(f"{link}: cannot put the port here: {error.strerror}") from error

    def __enter__(self) -> Self:
        """Nothing more to do: it is open."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def send(self, data: bytes) -> int:
        """Send what fits into the buffer of a client that does not read."""
        try:
            return os.write(self._device, data)
        except BlockingIOError:
            return 0

    def receive(self, wait: float) -> bytes:
        """What a client sent."""
        readable, _, _ = select.select([self._device], [], [], wait)
        return os.read(self._device, _PIECE) if readable else b""

    def close(self) -> None:
        """Close it: for a client the port is unplugged."""
        # another one may have taken the name meanwhile
        if self._link is not None and self._link.is_symlink() and str(self._link.readlink()) == self.port:
            self._link.unlink()
        self._link = None
        for descriptor in (self._client, self._device):
            try:
                os.close(descriptor)
            except OSError:
                continue


class SerialEnd:
    """The device's end of a real cable, or of a pyserial URL.

    Raises:
        PortError: If it cannot be opened.
    """

    def __init__(self, port: str, *, baud_rate: int = 115_200) -> None:
        self.name = port
        try:
            self._serial = serial.serial_for_url(port, baudrate=baud_rate, write_timeout=1.0)
        except (OSError, ValueError) as error:
            raise PortError(f"{port}: cannot be opened: {error}") from error

    def send(self, data: bytes) -> int:
        """Send all."""
        return int(self._serial.write(data) or 0)

    def receive(self, wait: float) -> bytes:
        """What a client sent."""
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
    backlog_bytes: int = BACKLOG,
    on_turn: Callable[[VirtualSensor], None] | None = None,
) -> int:
    """Run a virtual sensor on a port in real time.

    Args:
        sensor: The sensor.
        end: Its end of the connection.
        stop: Ends the run when set.
        seconds: How long to run; until stopped when not given [s].
        backlog_bytes: Bytes that wait for a client that does not read, before whole frames are left out.
        on_turn: Called once in every turn of the loop, to show progress.

    Returns:
        Frames that were left out because the client did not read.
    """
    start = time.monotonic()
    backlog, left_out = b"", 0
    while not (stop and stop.is_set()):
        now = time.monotonic() - start
        if seconds is not None and now >= seconds:
            break
        for frame in sensor.due(now):
            if len(backlog) < backlog_bytes:
                backlog += frame
            else:
                left_out += 1
            # frames that were late are not left out: only a client that does not read loses any
            backlog = _sent(end, backlog)
        due = sensor.next_due
        wait = _IDLE if due is None else min(_IDLE, max(0.0, due - (time.monotonic() - start)))
        received = end.receive(wait)
        if received:
            backlog += sensor.receive(received, time.monotonic() - start)
        backlog = _sent(end, backlog)
        if on_turn is not None:
            on_turn(sensor)
    return left_out


def _sent(end: End, data: bytes) -> bytes:
    """Send what can be sent and return the rest."""
    return data[end.send(data) :] if data else data
