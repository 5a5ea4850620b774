"""Finds messages in a byte stream that may be damaged."""

from __future__ import annotations

from dataclasses import dataclass

from validation.weiss.commands import Command
from validation.weiss.frames import HEAD_SIZE as FRAME_HEAD_SIZE
from validation.weiss.frames import decode_frame
from validation.weiss.messages import CHECKSUM_SIZE, HEAD_SIZE, PREAMBLE, Message, compute_checksum

#: Number of texels of the largest array of this manufacturer; used while the array is unknown [-].
_MOST_TEXELS = 512
#: Longest text in an answer, such as a sensor type or a tag [bytes].
_LONGEST_TEXT = 64
_STATUS_SIZE = 2
_SUCCESS = b"\0\0"


@dataclass(slots=True)
class Counters:
    """Totals of a parser.

    Attributes:
        bytes_seen: Bytes received [-].
        messages: Messages found [-].
        skipped: Bytes that belong to no message [-].
    """

    bytes_seen: int = 0
    messages: int = 0
    skipped: int = 0


class Parser:
    """Finds messages in a stream that is received in pieces.

    A message is accepted if its checksum fits and, for frames, its content is possible.  After a failure the search
    continues at the byte after the first AA, so that damage costs only the messages that it touches.  A head makes the
    parser wait for the rest of the message, but for no more than the largest message that is possible; `finish` ends
    the wait.  The parser keeps no more than one such message and the last piece.

    Args:
        texels: Number of texels of the array; if given, frames must have exactly as many [-].
    """

    def __init__(self, *, texels: int | None = None) -> None:
        self.texels = texels
        self.counters = Counters()
        self._buffer = bytearray()
        #: Bytes since the last message that belong to no message.
        self._skipped = 0

    @property
    def pending(self) -> int:
        """Number of bytes that may be the start of a message [-]."""
        return len(self._buffer)

    @property
    def largest_payload(self) -> int:
        """Longest payload that the parser waits for [bytes]."""
        texels = _MOST_TEXELS if self.texels is None else self.texels
        return _STATUS_SIZE + max(FRAME_HEAD_SIZE + 2 * texels, _LONGEST_TEXT)

    def feed(self, data: bytes) -> list[Message]:
        """Take more bytes and return the messages that they complete."""
        self._buffer += data
        self.counters.bytes_seen += len(data)
        return self._scan(final=False)

    def finish(self) -> list[Message]:
        """End the wait for missing bytes and return the messages that follow a damaged head."""
        return self._scan(final=True)

    def _scan(self, *, final: bool) -> list[Message]:
        messages: list[Message] = []
        buffer, position = self._buffer, 0
        while True:
            start = buffer.find(PREAMBLE, position)
            if start < 0:
                start = len(buffer) if final else _find_partial_preamble(buffer, position)
                self._skip(start - position)
                break
            self._skip(start - position)
            size = self._measure_message(start, final=final)
            if size is None:
                break
            if size:
                messages.append(self._take_message(start, size))
            else:
                self._skip(1)
            position = start + (size or 1)
        del buffer[:start]
        return messages

    def _measure_message(self, start: int, *, final: bool) -> int | None:
        """Size of the message at `start` [bytes]: 0 if there is none, None if more bytes are needed to decide."""
        buffer = self._buffer
        available = len(buffer) - start
        incomplete = 0 if final else None
        if available < HEAD_SIZE:
            return incomplete
        identifier = buffer[start + 3]
        payload_size = int.from_bytes(buffer[start + 4 : start + HEAD_SIZE], "little")
        if identifier == PREAMBLE[0] or payload_size > self.largest_payload:
            return 0
        size = HEAD_SIZE + payload_size + CHECKSUM_SIZE
        if available < size:
            return incomplete
        payload = bytes(buffer[start + HEAD_SIZE : start + size - CHECKSUM_SIZE])
        if compute_checksum(bytes(buffer[start : start + size])) or not self._is_possible(identifier, payload):
            return 0
        return size

    def _is_possible(self, identifier: int, payload: bytes) -> bool:
        """Whether a message may be genuine: where its identifier announces a frame, the payload must be one."""
        if identifier == Command.READ_SINGLE_FRAME and payload.startswith(_SUCCESS):
            payload = payload[_STATUS_SIZE:]
        elif identifier != Command.PERIODIC_FRAME:
            return True
        try:
            decode_frame(payload, texels=self.texels)
        except ValueError:
            return False
        return True

    def _take_message(self, start: int, size: int) -> Message:
        payload = bytes(self._buffer[start + HEAD_SIZE : start + size - CHECKSUM_SIZE])
        message = Message(self._buffer[start + 3], payload, self._skipped)
        self._skipped = 0
        self.counters.messages += 1
        return message

    def _skip(self, count: int) -> None:
        self.counters.skipped += count
        self._skipped += count


def _find_partial_preamble(buffer: bytearray, position: int) -> int:
    """Index of a partial preamble at the end of the buffer; the length of the buffer if there is none."""
    start = len(buffer)
    while start > max(position, len(buffer) - len(PREAMBLE) + 1) and buffer[start - 1] == PREAMBLE[0]:
        start -= 1
    return start
