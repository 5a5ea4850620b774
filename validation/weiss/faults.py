"""What goes wrong on a serial link, as functions of the messages that were meant to be sent.

Fuzzing and the stand-in for the device use the same faults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from types import MappingProxyType

from validation.weiss.messages import PREAMBLE

#: What the SDH generation sends while it boots.
BOOT_TEXT = b"\x1b[5n\x1b[5n\x1b[5n"


def flip_bit(message: bytes, random: Random) -> bytes:
    """One bit changes."""
    damaged = bytearray(message)
    damaged[random.randrange(len(damaged))] ^= 1 << random.randrange(8)
    return bytes(damaged)


def change_bytes(message: bytes, random: Random) -> bytes:
    """A run of one to eight bytes becomes noise."""
    start = random.randrange(len(message))
    length = min(random.randint(1, 8), len(message) - start)
    return message[:start] + random.randbytes(length) + message[start + length :]


def drop_bytes(message: bytes, random: Random) -> bytes:
    """A run of one to sixteen bytes is missing."""
    start = random.randrange(len(message))
    return message[:start] + message[start + random.randint(1, 16) :]


def repeat_bytes(message: bytes, random: Random) -> bytes:
    """A run of one to sixteen bytes comes twice."""
    start = random.randrange(len(message))
    end = start + random.randint(1, 16)
    return message[:end] + message[start:]


def insert_noise(message: bytes, random: Random) -> bytes:
    """One to forty bytes of noise stand in or before the message."""
    start = random.randrange(len(message))
    return message[:start] + random.randbytes(random.randint(1, 40)) + message[start:]


def cut(message: bytes, random: Random) -> bytes:
    """The message ends too early."""
    return message[: random.randrange(1, len(message))]


def extra_preamble(message: bytes, random: Random) -> bytes:
    """One to five more AA stand before the message."""
    return PREAMBLE[:1] * random.randint(1, 5) + message


def false_head(message: bytes, random: Random) -> bytes:
    """A head that promises a payload stands before the message."""
    return PREAMBLE + random.choice((b"\x00", b"\x20")) + bytes([random.randrange(256), 0]) + message


def lose(message: bytes, random: Random) -> bytes:  # noqa: ARG001 -- all faults are called alike
    """The message does not come."""
    return b""


def repeat(message: bytes, random: Random) -> bytes:  # noqa: ARG001 -- all faults are called alike
    """The message comes twice."""
    return message + message


def boot_text(message: bytes, random: Random) -> bytes:  # noqa: ARG001 -- all faults are called alike
    """Text of a booting device stands before the message."""
    return BOOT_TEXT + message


def wrong_size(message: bytes, random: Random) -> bytes:
    """The size field is wrong."""
    return message[:4] + random.randbytes(2) + message[6:]


Fault = Callable[[bytes, Random], bytes]

#: Every fault by name.
FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "flip-bit": flip_bit,
        "change-bytes": change_bytes,
        "drop-bytes": drop_bytes,
        "repeat-bytes": repeat_bytes,
        "insert-noise": insert_noise,
        "cut": cut,
        "extra-preamble": extra_preamble,
        "false-head": false_head,
        "lose": lose,
        "repeat": repeat,
        "boot-text": boot_text,
        "wrong-size": wrong_size,
    }
)
