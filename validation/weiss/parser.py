"""Messages out of a byte stream that may be damaged."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from validation.weiss.commands import Command
from validation.weiss.frames import decode_frame
from validation.weiss.messages import CHECKSUM_SIZE, HEAD_SIZE, PREAMBLE, Message, checksum

#: Texels of the largest array of this make.
_MOST_TEXELS = 512
_LONGEST_TEXT = 64
_STATUS_SIZE = 2
_FRAME_HEAD_SIZE = 5


@dataclass(frozen=True, slots=True)
class Counters:
    """What a parser has seen.

    Attributes:
        bytes_seen: Bytes fed.
        messages: Messages handed out.
        skipped: Bytes that belonged to no message.
        checksum_failures: Heads that looked right but whose checksum did not fit.
        malformed: Messages whose checksum fitted but which hold no possible frame.
    """

    bytes_seen: int = 0
    messages: int = 0
    skipped: int = 0
    checksum_failures: int = 0
    malformed: int = 0


class Parser:
    """Finds messages in a stream that is fed piece by piece.

    A message counts only when its checksum fits and, for frames, its content is possible.  After a failure
    the search goes on from the byte after the first AA, so that damage costs only the messages it touches.
    A head may make the parser wait for the rest; it waits for no more than the largest message there can
    be, and `finish` ends the wait.  Holds no more than one such message and what was fed last.

    Args:
        texels: Texels of the array, when known: frames must then have exactly as many.
    """

    def __init__(self, *, texels: int | None = None) -> None:
        self.texels = texels
        self._buffer = bytearray()
        self._seen = self._messages = self._skipped = self._failures = self._malformed = 0
        self._skipped_since = 0

    @property
    def counters(self) -> Counters:
        """What was seen up to now."""
        return Counters(
            bytes_seen=self._seen,
            messages=self._messages,
            skipped=self._skipped,
            checksum_failures=self._failures,
            malformed=self._malformed,
        )

    @property
    def pending(self) -> int:
        """Bytes that may be the start of a message."""
        return len(self._buffer)

    @property
    def largest_payload(self) -> int:
        """Longest payload that is waited for [bytes]."""
        texels = _MOST_TEXELS if self.texels is None else self.texels
        return _STATUS_SIZE + max(_FRAME_HEAD_SIZE + 2 * texels, _LONGEST_TEXT)

    def feed(self, data: bytes) -> list[Message]:
        """Take more bytes and return the messages that they complete."""
        self._buffer += data
        self._seen += len(data)
        return self._scan(final=False)

    def finish(self) -> list[Message]:
        """Say that what is missing will not come, and return the messages that hid behind a damaged head."""
        return self._scan(final=True)

    def _scan(self, *, final: bool) -> list[Message]:
        messages: list[Message] = []
        buffer, position = self._buffer, 0
        while True:
            start = buffer.find(PREAMBLE, position)
            if start < 0:
                start = len(buffer) if final else _trailing_start(buffer, position)
                self._skip(start - position)
                break
            self._skip(start - position)
            size = self._match(start, final=final)
            if size is None:
                break
            if size:
                messages.append(self._take(start, size))
            else:
                self._skip(1)
            position = start + (size or 1)
        del buffer[:start]
        return messages

    def _match(self, start: int, *, final: bool) -> int | None:
        """Size of the message at `start`: 0 where there is none, None where more bytes must come first."""
        buffer = self._buffer
        available = len(buffer) - start
        if available < HEAD_SIZE:
            return 0 if final else None
        identifier = buffer[start + 3]
        payload = buffer[start + 4] | buffer[start + 5] << 8
        if identifier == PREAMBLE[0] or payload > self.largest_payload:
            return 0
        size = HEAD_SIZE + payload + CHECKSUM_SIZE
        if available < size:
            return 0 if final else None
        if checksum(bytes(buffer[start : start + size])):
            self._failures += 1
            return 0
        if not self._possible(identifier, bytes(buffer[start + HEAD_SIZE : start + size - CHECKSUM_SIZE])):
            self._malformed += 1
            return 0
        return size

    def _possible(self, identifier: int, payload: bytes) -> bool:
        if identifier == Command.READ_SINGLE_FRAME and payload[:_STATUS_SIZE] == b"\0\0":
            payload = payload[_STATUS_SIZE:]
        elif identifier != Command.PERIODIC_FRAME:
            return True
        try:
            decode_frame(payload, texels=self.texels)
        except (ValueError, struct.error):
            return False
        return True

    def _take(self, start: int, size: int) -> Message:
        buffer = self._buffer
        payload = bytes(buffer[start + HEAD_SIZE : start + size - CHECKSUM_SIZE])
        message = Message(buffer[start + 3], payload, self._skipped_since)
        self._skipped_since = 0
        self._messages += 1
        return message

    def _skip(self, count: int) -> None:
        self._skipped += count
        self._skipped_since += count


def _trailing_start(buffer: bytearray, position: int) -> int:
    """Where a preamble may have begun at the end of the buffer."""
    start = len(buffer)
    while start > max(position, len(buffer) - len(PREAMBLE) + 1) and buffer[start - 1] == PREAMBLE[0]:
        start -= 1
    return start
