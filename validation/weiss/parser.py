"""Finds the messages of a sensor in a byte stream that may be damaged."""

from __future__ import annotations

from dataclasses import dataclass

from validation.weiss.protocol import (
    CHECKSUM_SIZE,
    FRAME_HEAD_SIZE,
    HEAD_SIZE,
    LONGEST_TEXT,
    PREAMBLE,
    Command,
    Message,
    compute_checksum,
    decode_frame,
)

#: Largest number of texels that is accepted in a frame while the array is unknown: that of the largest array of the
#: manufacturer [-].
_MOST_TEXELS = 512
#: Number of bytes of the status at the start of an answer, and the bytes of the status `success`.
_STATUS_SIZE = 2
_SUCCESS = b"\0\0"


@dataclass(slots=True)
class Counters:
    """Numbers of bytes and messages that a parser has processed.

    Attributes:
        bytes_seen: Number of bytes received [-].
        messages: Number of messages found [-].
        skipped: Number of bytes that belong to no message [-].
    """

    bytes_seen: int = 0
    messages: int = 0
    skipped: int = 0


class Parser:
    """Finds messages in a byte stream that is received in pieces.

    A message is accepted if its checksum is correct and, for frames, its content is valid.  If a message is refused,
    the search continues at the byte after its first byte AA, so that only damaged messages are lost.  After the head of
    a message, the parser waits for the stated number of bytes, unless the number exceeds the largest possible message;
    `finish` ends the wait.  The parser stores at most one message of the largest size and the last piece.

    Args:
        texels: Number of texels of the array; if given, frames with another number are refused [-].
    """

    def __init__(self, *, texels: int | None = None) -> None:
        self.texels = texels
        self.counters = Counters()
        self._buffer = bytearray()
        #: Number of bytes since the last message that belong to no message.
        self._skipped = 0

    @property
    def pending(self) -> int:
        """Number of stored bytes, which may be the start of a message [-]."""
        return len(self._buffer)

    @property
    def largest_payload(self) -> int:
        """Size of the largest payload of a message that is accepted [bytes]."""
        texels = _MOST_TEXELS if self.texels is None else self.texels
        return _STATUS_SIZE + max(FRAME_HEAD_SIZE + 2 * texels, LONGEST_TEXT)

    def feed(self, data: bytes) -> list[Message]:
        """Add the next bytes of the stream and return the messages that they complete."""
        self._buffer += data
        self.counters.bytes_seen += len(data)
        return self._scan(final=False)

    def finish(self) -> list[Message]:
        """End the wait for the rest of a message, and return the messages in the stored bytes after its head."""
        return self._scan(final=True)

    def _scan(self, *, final: bool) -> list[Message]:
        """Return the messages in the stored bytes; if `final`, an incomplete message counts as damaged."""
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
        """Return the size of the message that starts at the index `start` of the stored bytes.

        Returns:
            Size of the message [bytes]; 0 if the bytes are no valid message, None if more bytes are needed to decide.
        """
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
        """Return whether the payload of a message is valid: a frame if the identifier is that of a frame message."""
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
        """Make a message from `size` stored bytes from the index `start` on, and count it."""
        payload = bytes(self._buffer[start + HEAD_SIZE : start + size - CHECKSUM_SIZE])
        message = Message(self._buffer[start + 3], payload, self._skipped)
        self._skipped = 0
        self.counters.messages += 1
        return message

    def _skip(self, count: int) -> None:
        """Count bytes that belong to no message."""
        self.counters.skipped += count
        self._skipped += count


def _find_partial_preamble(buffer: bytearray, position: int) -> int:
    """Return the index at which an incomplete preamble at the end of the buffer starts, or the length of the buffer."""
    start = len(buffer)
    while start > max(position, len(buffer) - len(PREAMBLE) + 1) and buffer[start - 1] == PREAMBLE[0]:
        start -= 1
    return start
