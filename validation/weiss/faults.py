"""Faults of a serial line, as functions that damage one message.

Each function takes the bytes of a message and a random number generator, and returns the bytes that the receiver gets.
Every function accepts any bytes, also none, because the faults of a message may be combined in any order.
The tests of the parser and the virtual sensor use the same faults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from types import MappingProxyType

from validation.weiss.messages import HEAD_SIZE, PREAMBLE

#: Function from a message and a random number generator to the bytes that the receiver gets.
Fault = Callable[[bytes, Random], bytes]

#: Text that sensors of the SDH generation send while they boot.
_BOOT_TEXT = b"\x1b[5n\x1b[5n\x1b[5n"


def flip_bit(message: bytes, random: Random) -> bytes:
    """Change one random bit of the message."""
    start = _choose_index(message, random)
    changed = bytes(byte ^ (1 << random.randrange(8)) for byte in message[start : start + 1])
    return message[:start] + changed + message[start + 1 :]


def change_bytes(message: bytes, random: Random) -> bytes:
    """Replace one to eight consecutive bytes of the message by random bytes."""
    start = _choose_index(message, random)
    length = min(random.randint(1, 8), len(message) - start)
    return message[:start] + random.randbytes(length) + message[start + length :]


def drop_bytes(message: bytes, random: Random) -> bytes:
    """Remove one to sixteen consecutive bytes of the message."""
    start = _choose_index(message, random)
    return message[:start] + message[start + random.randint(1, 16) :]


def repeat_bytes(message: bytes, random: Random) -> bytes:
    """Send one to sixteen consecutive bytes of the message twice."""
    start = _choose_index(message, random)
    end = start + random.randint(1, 16)
    return message[:end] + message[start:]


def insert_noise(message: bytes, random: Random) -> bytes:
    """Insert one to forty random bytes in or before the message."""
    start = _choose_index(message, random)
    return message[:start] + random.randbytes(random.randint(1, 40)) + message[start:]


def cut(message: bytes, random: Random) -> bytes:
    """Truncate the message after a random number of bytes, at least one."""
    return message[: random.randint(1, max(1, len(message) - 1))]


def extra_preamble(message: bytes, random: Random) -> bytes:
    """Send one to five bytes AA, the byte of the preamble, before the message."""
    return PREAMBLE[:1] * random.randint(1, 5) + message


def false_head(message: bytes, random: Random) -> bytes:
    """Send the head of another message, with a random payload size and without payload, before the message."""
    return PREAMBLE + random.choice((b"\x00", b"\x20")) + bytes([random.randrange(256), 0]) + message


def lose(message: bytes, random: Random) -> bytes:  # noqa: ARG001 -- all faults take the same arguments
    """Send nothing instead of the message."""
    return b""


def repeat(message: bytes, random: Random) -> bytes:  # noqa: ARG001 -- all faults take the same arguments
    """Send a copy of the message after the message."""
    return message + message


def boot_text(message: bytes, random: Random) -> bytes:  # noqa: ARG001 -- all faults take the same arguments
    """Send the text of a booting device before the message."""
    return _BOOT_TEXT + message


def wrong_size(message: bytes, random: Random) -> bytes:
    """Replace the payload size in the head of the message by a random number."""
    return message[: HEAD_SIZE - 2] + random.randbytes(2) + message[HEAD_SIZE:]


def _choose_index(message: bytes, random: Random) -> int:
    """Return the index of a random byte of the message; 0 if it has none."""
    return random.randrange(max(1, len(message)))


_ALL = (
    *(flip_bit, change_bytes, drop_bytes, repeat_bytes, insert_noise, cut),
    *(extra_preamble, false_head, lose, repeat, boot_text, wrong_size),
)
#: Every fault by the name that the command line takes, e.g. `flip-bit`.
FAULTS: Mapping[str, Fault] = MappingProxyType({fault.__name__.replace("_", "-"): fault for fault in _ALL})
