"""Assumptions about the protocol that no source confirms; no other file holds any.

A measurement on a real sensor can settle them (`softcover doctor --port`).  A change of a constant here changes the
driver and the virtual sensor together.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

#: Length of one tick of the device's clock [s].
TICK = 1e-3

#: Flag bit, in requests and frames, for run-length encoded texels.
RUN_LENGTH_FLAG = 0x01

#: Number of low bits of a run-length unit that hold the count; the bits above hold the length of the run (1..15).
RUN_LENGTH_VALUE_BITS = 12

#: Payload of the tare command that makes the device subtract the present image, and of the one that undoes it.
TARE, UNTARE = 1, 0

#: `struct` formats of the threshold and of the front-end gain, in requests and in answers.
THRESHOLD_FORMAT, GAIN_FORMAT = "<H", "<B"

#: Each assumption by its topic, in words that a user can check on a real sensor.
UNCONFIRMED: Mapping[str, str] = MappingProxyType(
    {
        "clock": "a tick of the frame's timestamp is 1 ms",
        "run length": "units are 16 bit: 12 bit value, 4 bit count (as on the SDH generation); flag is bit 0",
        "tare": "command 0x23 takes one byte, 1 to tare and 0 to undo, and the device subtracts by itself",
        "threshold": "the answer to 0x35 is an unsigned 16 bit number; the device subtracts the threshold",
        "gain": "the answer to 0x37 is an unsigned 8 bit number, 0..255",
        "loop": "command 0x06 answers with the bytes it was sent",
        "mask": "the payloads of 0x31, 0x32 and 0x33 are unknown and passed on as bytes",
        "texel order": "rows come one after the other, columns fastest; press one corner to see",
    }
)
