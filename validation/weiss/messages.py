"""Messages on the wire: `AA AA AA`, identifier, payload size (u16 LE), payload, checksum (u16 LE).

The checksum uses the table of the plain polynomial 0x1021 but shifts as the reflected form does, starts at
0xFFFF and runs from the first AA.  That mixture loses information: the state can differ by 0xA189 without a
trace, and after a few bytes only 8192 different states remain.  Any damage within one byte is caught; of
random damage to a payload one case in 8192 passes, not one in 65536.  Readers therefore also check what a
frame may contain.
"""

from __future__ import annotations

from dataclasses import dataclass

PREAMBLE = b"\xaa\xaa\xaa"
#: Bytes before the payload, and after it.
HEAD_SIZE, CHECKSUM_SIZE = 6, 2
_POLYNOMIAL = 0x1021
_LARGEST_PAYLOAD = 0xFFFF


def _table() -> tuple[int, ...]:
    def entry(byte: int) -> int:
        value = byte << 8
        for _ in range(8):
            value = (value << 1) ^ _POLYNOMIAL if value & 0x8000 else value << 1
        return value & 0xFFFF

    return tuple(entry(byte) for byte in range(256))


_TABLE = _table()


def checksum(data: bytes, state: int = 0xFFFF) -> int:
    """Checksum of `data`; 0 over a whole message that includes its checksum.

    Args:
        data: The bytes, from the first AA on.
        state: Where to start, to continue an earlier result.
    """
    table = _TABLE
    for byte in data:
        state = table[(state ^ byte) & 0xFF] ^ (state >> 8)
    return state


_AFTER_PREAMBLE = checksum(PREAMBLE)


@dataclass(frozen=True, slots=True)
class Message:
    """A message that arrived whole.

    Attributes:
        identifier: Command identifier, 0..255 but never 0xAA.
        payload: What it carries.
        skipped: Bytes since the message before this one that belonged to no message.
    """

    identifier: int
    payload: bytes
    skipped: int = 0


def encode(identifier: int, payload: bytes = b"") -> bytes:
    """Put a payload into a message.

    Raises:
        ValueError: If the identifier is not a byte, is 0xAA (it would read as preamble), or the payload is
            too long.
    """
    if not 0 <= identifier <= 0xFF or identifier == PREAMBLE[0]:  # noqa: PLR2004 -- a byte
        raise ValueError(f"a message identifier is 0..255 and not 0xAA, not {identifier:#x}")
    if len(payload) > _LARGEST_PAYLOAD:
        raise ValueError(f"a payload holds at most {_LARGEST_PAYLOAD} bytes, not {len(payload)}")
    body = bytes([identifier]) + len(payload).to_bytes(2, "little") + payload
    return PREAMBLE + body + checksum(body, _AFTER_PREAMBLE).to_bytes(2, "little")


def decode(data: bytes) -> Message:
    """Read one whole message.

    Raises:
        ValueError: If `data` is not exactly one message with a right checksum.
    """
    if len(data) < HEAD_SIZE + CHECKSUM_SIZE or not data.startswith(PREAMBLE):
        raise ValueError("a message starts with AA AA AA and has at least 8 bytes")
    size = int.from_bytes(data[4:HEAD_SIZE], "little")
    if len(data) != HEAD_SIZE + size + CHECKSUM_SIZE:
        raise ValueError(f"a message with a payload of {size} bytes has {size + 8} bytes, not {len(data)}")
    if checksum(data) != 0 or data[3] == PREAMBLE[0]:
        raise ValueError("the checksum is wrong: the message was damaged")
    return Message(data[3], data[HEAD_SIZE:-CHECKSUM_SIZE])
