"""Finds missing frames in a stream, from the clock of the device and from bytes that belong to no message.

A step is the increase of the device's clock from one frame to the next.  If a frame is lost, the step is longer than
the period, the mean step without a lost frame.  The period is estimated from the stream, because the frame rate is not
known beforehand: the first steps are compared with one another, later steps with the steps before them.  Only the short
steps count, so that a stream that loses many frames from its start is not taken for a slow stream.

The clock counts whole ticks.  At 271 frames/s and a tick of 1 ms, steps of 3 and 4 ticks alternate: their mean is 3.69,
their median is 4.  The period is therefore the span of all steps over their number of frames, lost frames in short gaps
included, so that the fractions of consecutive steps cancel.  Steps are compared only when they span so many ticks that
one tick is less than 0.5 % of the span.  The number of frames in a gap is then right within 1 %.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from statistics import fmean
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class _Rules:
    """Rules by which frames count as missing, checked with damaged streams at 271 frames/s.

    Attributes:
        most_frames_per_step: Largest number of frames in a step that still adds to the period [-].
        initial_steps: Smallest number of steps from which the period is computed [-].
        initial_span: Smallest span of short steps from which the period is computed [ticks].
        most_waiting_steps: Largest number of steps at the start of a stream that wait for this span [-].
        remembered_steps: Largest number of earlier steps from which the period is computed [-].
        long_step: Length of a step over the typical length above which frames count as lost [-].  It lies above 4/3,
            because at 271 frames/s a clock in milliseconds advances by 3 or 4 ticks, and below 2, the ratio with one
            lost frame.
        clock_range: Number of different values of the device's clock, which has 32 bits and then starts again at zero
            [ticks].
    """

    most_frames_per_step: int = 8
    initial_steps: int = 8
    initial_span: int = 250
    most_waiting_steps: int = 512
    remembered_steps: int = 256
    long_step: float = 1.5
    clock_range: int = 1 << 32


_RULES = _Rules()

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
        return (self.after - self.before) % _RULES.clock_range


class Continuity:
    """Reports the gaps in a stream of frames, from the times of the frames on the clock of the device."""

    def __init__(self) -> None:
        #: Lengths [ticks] and numbers of frames of the latest steps without a long gap.
        self._steps: deque[tuple[int, int]] = deque(maxlen=_RULES.remembered_steps)
        #: Steps at the start of the stream that have not been checked for gaps yet; None when the period is known.
        self._unchecked: list[_Step] | None = []
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
        if self._unchecked is None:
            period = self._compute_period()
            self._add(step, period)
            gap = _find_gap(step, period)
            return [] if gap is None else [gap]
        self._unchecked.append(step)
        waiting, short = len(self._unchecked), _find_short_steps(self._unchecked)
        is_known = len(short) >= _RULES.initial_steps and sum(short) >= _RULES.initial_span
        return self.finish() if is_known or (short and waiting >= _RULES.most_waiting_steps) else []

    def finish(self) -> list[Gap]:
        """Check the steps at the start of the stream that have not been checked yet, and return the gaps in them."""
        steps = self._unchecked or []
        short = _find_short_steps(steps)
        for step in steps if short else []:
            self._add(step, fmean(short))
        self._unchecked = None if self._steps else []
        period = self._compute_period() if self._steps else 0.0
        return [gap for step in steps if (gap := _find_gap(step, period)) is not None]

    def _add(self, step: _Step, period: float) -> None:
        """Add a step to those that give the period, unless it has a long gap or the clock repeated or was set back."""
        frames = round(step.length / period)
        if 0 < frames <= _RULES.most_frames_per_step and step.length:
            self._steps.append((step.length, frames))

    def _compute_period(self) -> float:
        """Return the mean step without a lost frame [ticks]."""
        lengths, frames = zip(*self._steps, strict=True)
        return float(sum(lengths) / sum(frames))


def _find_short_steps(steps: Collection[_Step]) -> list[int]:
    """Return the lengths of the steps without a lost frame [ticks].

    A frame counts as lost if the step exceeds the first octile of all steps by the factor `_RULES.long_step`.  Steps in
    which the clock repeated or was set back do not count.
    """
    ordered = sorted(step.length for step in steps if 0 < step.length < _RULES.clock_range // 2)
    return ordered[: bisect_right(ordered, _RULES.long_step * ordered[len(ordered) // 8])] if ordered else []


def _find_gap(step: _Step, period: float) -> Gap | None:
    """Return the gap in a step, or None; `period` is the mean step without a lost frame, 0 if unknown [ticks]."""
    kind: Kind
    frames = 0
    if step.length == 0:
        kind = "frame repeated"
    elif step.length >= _RULES.clock_range // 2:
        kind = "clock set back"
    elif period and step.length > _RULES.long_step * period:
        kind, frames = "frames missing", max(1, round(step.length / period) - 1)
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
