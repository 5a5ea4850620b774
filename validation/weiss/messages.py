"""Format of the messages on the serial line: `AA AA AA`, identifier, payload size (u16 LE), payload, checksum (u16 LE).

The checksum is a 16-bit cyclic redundancy check (CRC) with the polynomial 0x1021 and the initial value 0xFFFF over the
message from the first AA on.  The device combines the table of the normal (non-reflected) CRC with the shift direction
of the reflected CRC.  This update is not invertible: after a few bytes the checksum takes only 8192 different values.
Errors confined to one byte are always detected.  Of random errors in a payload one in 8192 is not detected; a standard
CRC would miss one in 65536.  Code that decodes frames (the texel values of one instant) therefore also checks their
content.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass

#: First bytes of every message.
PREAMBLE = b"\xaa\xaa\xaa"
#: Number of bytes before and after the payload.
HEAD_SIZE, CHECKSUM_SIZE = 6, 2
_LARGEST_PAYLOAD = 0xFFFF
#: Checksum of each single byte, by the normal (non-reflected) CRC; `crc_hqx` uses the polynomial 0x1021.
_TABLE = tuple(crc_hqx(bytes([byte]), 0) for byte in range(256))


@dataclass(frozen=True, slots=True)
class Message:
    """A message that was received completely.

    Attributes:
        identifier: Identifier of the command, 0..255 but never 0xAA.
        payload: Content of the message.
        skipped: Number of bytes since the message before this one that belong to no message [-].
    """

    identifier: int
    payload: bytes
    skipped: int = 0


def compute_checksum(data: bytes, state: int = 0xFFFF) -> int:
    """Checksum of bytes; 0 for a complete message with its checksum.

    Args:
        data: The bytes, from the first AA on.
        state: Checksum of the bytes before these.
    """
    for byte in data:
        state = _TABLE[(state ^ byte) & 0xFF] ^ (state >> 8)
    return state


_PREAMBLE_CHECKSUM = compute_checksum(PREAMBLE)


def encode_message(identifier: int, payload: bytes = b"") -> bytes:
    """Put a payload into a message.

    Raises:
        ValueError: If the identifier is not a byte or is 0xAA (it would read as preamble), or if the payload is too
            long.
    """
    if not 0 <= identifier <= 0xFF or identifier == PREAMBLE[0]:  # noqa: PLR2004 -- a byte
        raise ValueError(f"a message identifier is 0..255 and not 0xAA, not {identifier:#x}")
    if len(payload) > _LARGEST_PAYLOAD:
        raise ValueError(f"a payload holds at most {_LARGEST_PAYLOAD} bytes, not {len(payload)}")
    body = bytes([identifier]) + len(payload).to_bytes(2, "little") + payload
    return PREAMBLE + body + compute_checksum(body, _PREAMBLE_CHECKSUM).to_bytes(CHECKSUM_SIZE, "little")
