"""Format of the messages on the serial line: `AA AA AA`, identifier, payload size, payload, checksum.

The identifier is one byte; payload size and checksum are unsigned 16-bit numbers, little-endian.

The checksum is a 16-bit cyclic redundancy check (CRC) with the polynomial 0x1021 and the initial value 0xFFFF over the
message from the first AA on.  The device combines the table of the normal (non-reflected) CRC with the shift direction
of the reflected CRC.  This update is not invertible: after a few bytes the checksum takes only 8192 different values.
Errors confined to one byte are always detected.  Of random errors in a payload, one in 8192 is not detected; a standard
CRC would miss one in 65536.  Functions that decode frames (the counts of all texels at one instant) therefore also
check the content of the frames.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass

#: First bytes of every message.
PREAMBLE = b"\xaa\xaa\xaa"
#: Number of bytes of a message before its payload, and after its payload.
HEAD_SIZE, CHECKSUM_SIZE = 6, 2
#: Largest size of a payload that the 16-bit field in the head can state [bytes].
_LARGEST_PAYLOAD = 0xFFFF
#: Table of the CRC: checksum of each single byte, by the normal (non-reflected) CRC with the polynomial 0x1021, which
#: `crc_hqx` computes.
_TABLE = tuple(crc_hqx(bytes([byte]), 0) for byte in range(256))


@dataclass(frozen=True, slots=True)
class Message:
    """A complete message that a sensor or its client has sent.

    Attributes:
        identifier: Identifier of the command, 0..255 but never 0xAA.
        payload: Content of the message without head and checksum.
        skipped: Number of bytes between the previous message and this message that belong to no message [-].
    """

    identifier: int
    payload: bytes
    skipped: int = 0


def compute_checksum(data: bytes, state: int = 0xFFFF) -> int:
    """Compute the checksum of the bytes of a message; it is 0 for a complete message that includes its checksum.

    Args:
        data: Bytes of the message, from the first AA on.
        state: Checksum of the bytes of the message before `data`; the initial value if there are none.
    """
    for byte in data:
        state = _TABLE[(state ^ byte) & 0xFF] ^ (state >> 8)
    return state


#: Checksum of the preamble, from which the checksum of every message continues.
_PREAMBLE_CHECKSUM = compute_checksum(PREAMBLE)


def encode_message(identifier: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a message with an identifier and a payload.

    Raises:
        ValueError: If the identifier is not a byte or is 0xAA, which a receiver would take for the preamble, or if the
            payload is too long.
    """
    if not 0 <= identifier <= 0xFF or identifier == PREAMBLE[0]:  # noqa: PLR2004 -- a byte
        raise ValueError(f"a message identifier is 0..255 and not 0xAA, not {identifier:#x}")
    if len(payload) > _LARGEST_PAYLOAD:
        raise ValueError(f"a payload holds at most {_LARGEST_PAYLOAD} bytes, not {len(payload)}")
    body = bytes([identifier]) + len(payload).to_bytes(2, "little") + payload
    return PREAMBLE + body + compute_checksum(body, _PREAMBLE_CHECKSUM).to_bytes(CHECKSUM_SIZE, "little")
