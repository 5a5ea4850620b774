"""Finds what is missing between frames, from the device's clock and from bytes that belonged to no message.

A lost frame leaves a step of the device's clock that is longer than its neighbours.  How long a step should
be is learnt from the stream itself, since no one knows the free-running rate beforehand: the first few
steps are judged together, later ones against those before.  The usual step is the median of the short ones, so that
a stream that loses many frames from its start on is not taken for a slow one.  Only ratios of ticks are used, so that
the unit of the device's clock does not matter.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from statistics import median
from typing import Literal

#: Steps that are judged together at the start, and the most that are remembered.
_LEARNT, _WINDOW = 8, 64
#: A step longer than this many usual ones hides a frame; clocks that tick in ms step 3 or 4 at 271 frames/s.
_LONG = 1.5
_CLOCK_RANGE = 1 << 32

Kind = Literal[
    "frames missing", "bytes skipped", "frame repeated", "clock set back", "silence", "link lost", "overflow"
]


@dataclass(frozen=True, kw_only=True, slots=True)
class Gap:
    """A place where the stream of frames is not whole.

    Attributes:
        kind: What happened.
        host_time: When it was noticed, monotonic [ns].
        after: The device's clock of the last frame before it [ticks]; None where there was none.
        before: The device's clock of the first frame after it [ticks]; None where none came.
        frames: Frames that are missing, as far as the clock tells [-].
        skipped: Bytes that belonged to no message [-].
        seconds: How long nothing came, where that is what happened [s].
    """

    kind: Kind
    host_time: int
    after: int | None = None
    before: int | None = None
    frames: int = 0
    skipped: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        """One line for people."""
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
    before: int
    after: int
    skipped: int
    host_time: int

    @property
    def length(self) -> int:
        """Ticks from one frame to the next, over the clock's wrap."""
        return (self.after - self.before) % _CLOCK_RANGE


class Continuity:
    """Follows the clocks of frames and says where some are missing."""

    def __init__(self) -> None:
        self._steps: deque[int] = deque(maxlen=_WINDOW)
        self._waiting: list[_Step] = []
        self._last: int | None = None

    def next(self, ticks: int, *, skipped: int, host_time: int) -> list[Gap]:
        """Take the next frame's clock and the bytes skipped before it; return the gaps that are now known."""
        last, self._last = self._last, ticks
        if last is None:
            return [Gap(kind="bytes skipped", host_time=host_time, before=ticks, skipped=skipped)] if skipped else []
        step = _Step(last, ticks, skipped, host_time)
        if len(self._steps) >= _LEARNT:
            return self._judge([step])
        self._waiting.append(step)
        return self.finish() if len(self._waiting) >= _LEARNT else []

    def finish(self) -> list[Gap]:
        """Judge what was kept back at the start."""
        waiting, self._waiting = self._waiting, []
        for step in waiting:
            self._learn(step)
        return self._judge(waiting)

    def _learn(self, step: _Step) -> None:
        if 0 < step.length < _CLOCK_RANGE // 2:
            self._steps.append(step.length)

    def _judge(self, steps: list[_Step]) -> list[Gap]:
        gaps = []
        for step in steps:
            usual = _usual(self._steps)
            gap = _gap(step, usual)
            if gap is not None:
                gaps.append(gap)
            elif len(steps) == 1:
                self._learn(step)
        return gaps


def _usual(steps: Collection[int]) -> float:
    """Median of the steps that hide no frame, as told by the shortest eighth; 0 where there are none [ticks]."""
    if not steps:
        return 0.0
    ordered = sorted(steps)
    return median(ordered[: bisect_right(ordered, _LONG * ordered[len(ordered) // 8])])


def _gap(step: _Step, usual: float) -> Gap | None:
    kind: Kind
    frames = 0
    if step.length == 0:
        kind = "frame repeated"
    elif step.length >= _CLOCK_RANGE // 2:
        kind = "clock set back"
    elif usual and step.length > _LONG * usual:
        kind, frames = "frames missing", max(1, round(step.length / usual) - 1)
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
