"""All assumptions about the protocol of Weiss WTS sensors that no source confirms.

A measurement on a real sensor can confirm or refute them (`softcover doctor --port`).  A change of a constant in this
module changes both the driver and the virtual sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

#: Assumed length of one tick of the device's clock [s].
TICK = 1e-3

#: Bit in the flags of requests and frames that marks run-length encoded counts.
RUN_LENGTH_FLAG = 0x01

#: Number of low bits of a 16-bit run-length unit that hold the count; the other bits hold the number of equal counts
#: (1..15).
RUN_LENGTH_VALUE_BITS = 12

#: Payload of the command `tare` that makes the device subtract the present frame from later frames, and payload that
#: ends the subtraction.
TARE, UNTARE = 1, 0

#: Order of the bits in the bytes of the answer to `get mask`, as numpy names it.
MASK_BIT_ORDER: Literal["little", "big"] = "little"

#: `struct` formats of the threshold and of the front-end gain in the payloads of requests and answers.
THRESHOLD_FORMAT, GAIN_FORMAT = "<H", "<B"

#: Device tag of the virtual sensor if none is given.  It is not empty, because some public clients wait for a tag;
#: whether a new device has one is unknown.
DEFAULT_TAG = "softcover"

#: Description of each assumption by topic, so that a user can check it on a real sensor.
UNCONFIRMED: Mapping[str, str] = MappingProxyType(
    {
        "clock": "a tick of the frame's timestamp is 1 ms",
        "run length": "units are 16 bit: 12 bit value, 4 bit count (as on the SDH generation); flag is bit 0",
        "tare": "command 0x23 takes one byte, 1 to tare and 0 to undo, and the device subtracts by itself",
        "threshold": "the answer to 0x35 is an unsigned 16 bit number; the device subtracts the threshold",
        "gain": "the answer to 0x37 is an unsigned 8 bit number, 0..255",
        "loop": "command 0x06 answers with the bytes it was sent",
        "mask": "the answer to 0x33 has one bit per texel, lowest bit first, 1 for a texel that exists; "
        "the payloads of 0x31 and 0x32 are unknown and passed on as bytes",
        "texel order": "rows come one after the other, columns fastest; press one corner to see",
    }
)
