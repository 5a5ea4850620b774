"""Encodes and decodes frames: the counts of all texels at one instant, raw or run-length encoded."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.weiss.unconfirmed import RUN_LENGTH_FLAG, RUN_LENGTH_VALUE_BITS, TICK

CountArray = npt.NDArray[np.uint16]

#: Largest count of a texel, a number of 12 bits [-].
LARGEST_COUNT = 0x0FFF
#: Layout of the start of a frame: time on the clock of the device (unsigned, 32 bits, little-endian), flags (8 bits).
_HEAD = struct.Struct("<IB")
#: Number of bytes before the counts of a frame.
HEAD_SIZE = _HEAD.size
#: Largest number of equal counts that one run-length unit can hold, because the number has 4 bits [-].
_LONGEST_RUN = 15


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Reading:
    """One frame that a sensor has sent: the counts of all texels at one instant.

    Attributes:
        counts: Counts of the n texels, shape (n,), row by row, x fastest [-].
        ticks: Time of the frame on the clock of the device, 32 bits unsigned [ticks].
        host_time: Time at which the last byte of the frame was read, on the monotonic clock of the host [ns]; 0 for a
            frame that did not come from a port.
        run_length: Whether the frame was sent run-length encoded.
    """

    counts: CountArray
    ticks: int
    host_time: int = 0
    run_length: bool = False

    @property
    def time(self) -> float:
        """Time of the frame on the clock of the device [s]."""
        return self.ticks * TICK


def encode_frame(ticks: int, counts: npt.ArrayLike, *, run_length: bool = False) -> bytes:
    """Return a frame as bytes: the payload of a periodic frame, or of a requested single frame after the status.

    Args:
        ticks: Time of the frame on the clock of the device [ticks]; the lowest 32 bits are used.
        counts: Counts 0..4095 of the n texels, shape (n,) [-].
        run_length: Whether to run-length encode the counts.

    Raises:
        ValueError: If a count does not fit 12 bits.
    """
    values = np.asarray(counts).ravel()
    if values.size and (int(values.min()) < 0 or int(values.max()) > LARGEST_COUNT):
        raise ValueError(f"texel values must lie in 0..{LARGEST_COUNT}, not {values.min()}..{values.max()}")
    head = _HEAD.pack(ticks & 0xFFFFFFFF, RUN_LENGTH_FLAG * run_length)
    texels = values.astype("<u2")
    return head + (compress(texels) if run_length else texels.tobytes())


def decode_frame(payload: bytes, *, texels: int | None = None, host_time: int = 0) -> Reading:
    """Decode the payload of a frame message.

    Args:
        payload: Clock, flags and counts of the frame, without the status of an answer.
        texels: Expected number of texels; any number is accepted if not given [-].
        host_time: Time at which the last byte was read, on the monotonic clock of the host [ns].

    Raises:
        ValueError: If the payload is too short, has unknown flags, a count over 12 bits or the wrong number of texels.
    """
    if len(payload) < HEAD_SIZE:
        raise ValueError(f"a frame has at least {HEAD_SIZE} bytes, not {len(payload)}")
    ticks, flags = _HEAD.unpack_from(payload)
    if flags & ~RUN_LENGTH_FLAG or len(payload) % 2 != HEAD_SIZE % 2:
        raise ValueError(f"not a frame: flags {flags:#04x}, {len(payload)} bytes")
    units = np.frombuffer(payload, dtype="<u2", offset=HEAD_SIZE)
    run_length = bool(flags & RUN_LENGTH_FLAG)
    counts = _expand(units) if run_length else units.astype(np.uint16)
    if counts.size and int(counts.max()) > LARGEST_COUNT:
        raise ValueError(f"texel value {counts.max()} does not fit 12 bits")
    if texels is not None and counts.size != texels:
        raise ValueError(f"a frame of this array has {texels} texels, not {counts.size}")
    return Reading(counts=counts, ticks=ticks, host_time=host_time, run_length=run_length)


def compress(counts: CountArray) -> bytes:
    """Run-length encode the counts of n texels, each 0..4095, shape (n,)."""
    if not counts.size:
        return b""
    starts = np.flatnonzero(np.concatenate(([True], counts[1:] != counts[:-1])))
    lengths = np.diff(np.append(starts, counts.size))
    # a run that is longer than one unit can hold is divided into full units of 15 counts and a rest of 1..15 counts
    full, rest = np.divmod(lengths - 1, _LONGEST_RUN)
    values = np.repeat(counts[starts].astype(np.uint16), full + 1)
    runs = np.full(values.size, _LONGEST_RUN, dtype=np.uint16)
    runs[np.cumsum(full + 1) - 1] = rest + 1
    return bytes((values | (runs << RUN_LENGTH_VALUE_BITS)).astype("<u2").tobytes())


def _expand(units: CountArray) -> CountArray:
    """Decode run-length units to the counts of the n texels, shape (n,)."""
    runs = units >> RUN_LENGTH_VALUE_BITS
    if not runs.all():
        raise ValueError("a run of length 0 in a run-length encoded frame")
    return np.repeat(units & LARGEST_COUNT, runs).astype(np.uint16)
