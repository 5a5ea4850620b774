"""Finds missing frames in a stream, from the clock of the device and from bytes that belong to no message.

A step is the increase of the device's clock from one frame to the next.  If a frame is lost, the step is longer than
the typical step.  The typical step is estimated from the stream, because the frame rate is not known beforehand: the
first steps are compared with one another, later steps with the steps before them.  The typical step is the median of
the short steps only, so that a stream that loses many frames from its start is not taken for a slow stream.  Only
ratios of steps are used, so the unit of the clock has no effect.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from statistics import median
from typing import Literal

#: Number of steps at the start of a stream that are compared with one another, and largest number of earlier steps from
#: which the typical step is computed [-].
_INITIAL_STEPS, _REMEMBERED_STEPS = 8, 64
#: Length of a step over that of the typical step above which frames count as lost [-].  The value lies above 4/3,
#: because at 271 frames/s a clock in milliseconds advances by 3 or 4 ticks, and below 2, the ratio with one lost frame.
_LONG_STEP = 1.5
#: Number of different values of the device's clock, which has 32 bits and then starts again at zero [ticks].
_CLOCK_RANGE = 1 << 32

#: Kinds of gaps in a stream of frames.
Kind = Literal[
    "frames missing", "bytes skipped", "frame repeated", "clock set back", "silence", "link lost", "overflow"
]


@dataclass(frozen=True, kw_only=True, slots=True)
class Gap:
    """A place in the stream from a sensor where frames or bytes are missing or wrong.

    Attributes:
        kind: Kind of the fault.
        host_time: Time at which the gap was noticed, on the monotonic clock of the host [ns].
        after: Time of the last frame before the gap on the clock of the device [ticks]; None if there was no frame.
        before: Time of the first frame after the gap on the clock of the device [ticks]; None if there was no frame.
        frames: Number of missing frames, estimated from the clock of the device [-].
        skipped: Number of bytes in the gap that belong to no message [-].
        seconds: Duration without frames if the device was silent or the port was lost [s].
    """

    kind: Kind
    host_time: int
    after: int | None = None
    before: int | None = None
    frames: int = 0
    skipped: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        """Return a description of the gap in one line."""
        parts: list[str] = [self.kind]
        if self.after is not None:
            parts.append(f"after tick {self.after}")
        if self.frames:
            parts.append(f"{self.frames} frames")
        if self.skipped:
            parts.append(f"{self.skipped} bytes")
        if self.seconds:
            parts.append(f"{self.seconds:.2f} s")
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class _Step:
    """The step of the device's clock from one frame to the next.

    Attributes:
        before: Time of the first of the two frames on the clock of the device [ticks].
        after: Time of the second of the two frames on the clock of the device [ticks].
        skipped: Number of bytes between the two frames that belong to no message [-].
        host_time: Time at which the second frame was read, on the monotonic clock of the host [ns].
    """

    before: int
    after: int
    skipped: int
    host_time: int

    @property
    def length(self) -> int:
        """Number of ticks from the first frame to the second, also if the clock has started again at zero."""
        return (self.after - self.before) % _CLOCK_RANGE


class Continuity:
    """Reports the gaps in a stream of frames, from the times of the frames on the clock of the device."""

    def __init__(self) -> None:
        #: Lengths of the latest steps without a gap [ticks].
        self._lengths: deque[int] = deque(maxlen=_REMEMBERED_STEPS)
        #: Steps at the start of the stream that have not been checked for gaps yet.
        self._unchecked: list[_Step] = []
        self._last: int | None = None

    def add(self, ticks: int, *, skipped: int, host_time: int) -> list[Gap]:
        """Add the next frame of the stream and return the gaps that have become known.

        Args:
            ticks: Time of the frame on the clock of the device [ticks].
            skipped: Number of bytes before the frame that belong to no message [-].
            host_time: Time at which the frame was read, on the monotonic clock of the host [ns].
        """
        last, self._last = self._last, ticks
        if last is None:
            return [Gap(kind="bytes skipped", host_time=host_time, before=ticks, skipped=skipped)] if skipped else []
        step = _Step(last, ticks, skipped, host_time)
        if len(self._lengths) >= _INITIAL_STEPS:
            return self._find_gaps([step])
        self._unchecked.append(step)
        return self.finish() if len(self._unchecked) >= _INITIAL_STEPS else []

    def finish(self) -> list[Gap]:
        """Check the steps at the start of the stream that have not been checked yet, and return the gaps in them."""
        steps, self._unchecked = self._unchecked, []
        for step in steps:
            self._add_length(step)
        return self._find_gaps(steps)

    def _add_length(self, step: _Step) -> None:
        """Add a step to those from which the typical step is computed, unless the clock repeated or was set back."""
        if 0 < step.length < _CLOCK_RANGE // 2:
            self._lengths.append(step.length)

    def _find_gaps(self, steps: list[_Step]) -> list[Gap]:
        """Return the gaps in steps; a single step without a gap is added to those of the typical step."""
        gaps = []
        for step in steps:
            gap = _find_gap(step, _find_typical_length(self._lengths))
            if gap is not None:
                gaps.append(gap)
            elif len(steps) == 1:  # `finish` has already added the lengths of the steps at the start of the stream
                self._add_length(step)
        return gaps


def _find_typical_length(lengths: Collection[int]) -> float:
    """Return the typical length of a step: the median of the lengths without a lost frame [ticks]; 0 for no lengths.

    A length counts as one with a lost frame if it exceeds the first octile of all lengths by the factor `_LONG_STEP`.
    """
    if not lengths:
        return 0.0
    ordered = sorted(lengths)
    return median(ordered[: bisect_right(ordered, _LONG_STEP * ordered[len(ordered) // 8])])


def _find_gap(step: _Step, typical: float) -> Gap | None:
    """Return the gap in a step, or None; `typical` is the typical length of a step, 0 if it is unknown [ticks]."""
    kind: Kind
    frames = 0
    if step.length == 0:
        kind = "frame repeated"
    elif step.length >= _CLOCK_RANGE // 2:
        kind = "clock set back"
    elif typical and step.length > _LONG_STEP * typical:
        kind, frames = "frames missing", max(1, round(step.length / typical) - 1)
    elif step.skipped:
        kind = "bytes skipped"
    else:
        return None
    return Gap(
        kind=kind,
        host_time=step.host_time,
        after=step.before,
        before=step.after,
        frames=frames,
        skipped=step.skipped,
    )
