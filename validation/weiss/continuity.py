"""Finds missing frames from the clock of the device and from bytes that belong to no message.

A lost frame shows as a step of the device's clock that is longer than the typical step.  The typical step is learnt
from the stream, because the free-running rate is not known beforehand: the first steps are judged together, later ones
against those before.  The typical step is the median of the short steps only, so that a stream that loses many frames
from its start is not taken for a slow one.  Only ratios of steps are used, so that the unit of the clock is irrelevant.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from statistics import median
from typing import Literal

#: Number of steps that are judged together at the start, and largest number that is remembered [-].
_LEARNING_STEPS, _REMEMBERED_STEPS = 8, 64
#: Ratio to the typical step above which a step hides a frame.  It lies above 4/3, because a clock that ticks in
#: milliseconds advances by 3 or 4 at 271 frames/s, and below 2, the ratio of one lost frame [-].
_LONG_STEP = 1.5
#: The clock of the device has 32 bits [ticks].
_CLOCK_RANGE = 1 << 32

Kind = Literal[
    "frames missing", "bytes skipped", "frame repeated", "clock set back", "silence", "link lost", "overflow"
]


@dataclass(frozen=True, kw_only=True, slots=True)
class Gap:
    """A place in the stream where frames or bytes are missing or wrong.

    Attributes:
        kind: Kind of the fault.
        host_time: When it was noticed, monotonic [ns].
        after: Device's clock of the last frame before it [ticks]; None if there was no frame.
        before: Device's clock of the first frame after it [ticks]; None if there was no frame.
        frames: Number of missing frames, estimated from the clock [-].
        skipped: Number of bytes that belong to no message [-].
        seconds: Duration of a silence or of a lost link [s].
    """

    kind: Kind
    host_time: int
    after: int | None = None
    before: int | None = None
    frames: int = 0
    skipped: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        """Describe the gap in one line."""
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
    """The step of the device's clock from one frame to the next [ticks], with the bytes skipped between them."""

    before: int
    after: int
    skipped: int
    host_time: int

    @property
    def length(self) -> int:
        """Ticks from one frame to the next, across the wrap of the clock."""
        return (self.after - self.before) % _CLOCK_RANGE


class Continuity:
    """Follows the clocks of frames and reports the gaps between them."""

    def __init__(self) -> None:
        #: Lengths of the last steps without a gap [ticks].
        self._lengths: deque[int] = deque(maxlen=_REMEMBERED_STEPS)
        #: Steps at the start that are not judged yet.
        self._unjudged: list[_Step] = []
        self._last: int | None = None

    def add(self, ticks: int, *, skipped: int, host_time: int) -> list[Gap]:
        """Take the next frame and return the gaps that are known now.

        Args:
            ticks: Clock of the device [ticks].
            skipped: Number of bytes before the frame that belong to no message [-].
            host_time: When the frame was read, monotonic [ns].
        """
        last, self._last = self._last, ticks
        if last is None:
            return [Gap(kind="bytes skipped", host_time=host_time, before=ticks, skipped=skipped)] if skipped else []
        step = _Step(last, ticks, skipped, host_time)
        if len(self._lengths) >= _LEARNING_STEPS:
            return self._judge([step])
        self._unjudged.append(step)
        return self.finish() if len(self._unjudged) >= _LEARNING_STEPS else []

    def finish(self) -> list[Gap]:
        """Judge the steps at the start that are not judged yet, and return the gaps among them."""
        steps, self._unjudged = self._unjudged, []
        for step in steps:
            self._learn(step)
        return self._judge(steps)

    def _learn(self, step: _Step) -> None:
        if 0 < step.length < _CLOCK_RANGE // 2:
            self._lengths.append(step.length)

    def _judge(self, steps: list[_Step]) -> list[Gap]:
        gaps = []
        for step in steps:
            gap = _find_gap(step, _find_typical_length(self._lengths))
            if gap is not None:
                gaps.append(gap)
            elif len(steps) == 1:  # several steps were learnt before
                self._learn(step)
        return gaps


def _find_typical_length(lengths: Collection[int]) -> float:
    """Median of the lengths that hide no frame; 0 without any [ticks].

    A length hides a frame if it exceeds the shortest eighth of the lengths by the ratio `_LONG_STEP`.
    """
    if not lengths:
        return 0.0
    ordered = sorted(lengths)
    return median(ordered[: bisect_right(ordered, _LONG_STEP * ordered[len(ordered) // 8])])


def _find_gap(step: _Step, typical: float) -> Gap | None:
    """The gap in a step, given the typical length [ticks]; None if there is none."""
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
