"""Missing frames in a stream, and the time at which each frame was taken, both from the device's clock.

**Gaps.**  A step is the increase of the device's clock from one frame to the next.  If a frame is lost, the step is
longer than the period, the mean step without a lost frame.  The period is estimated from the stream, because the frame
rate is not known beforehand: the first steps are compared with one another, later steps with the steps before them.
Only the short steps count, so that a stream that loses many frames from its start is not taken for a slow stream.

The clock counts whole ticks.  At 271 frames/s and a tick of 1 ms, steps of 3 and 4 ticks alternate: their mean is 3.69,
their median is 4.  The period is therefore the span of all steps over their number of frames, lost frames in short gaps
included, so that the fractions of consecutive steps cancel.  Steps are compared only when they span so many ticks that
one tick is less than 0.5 % of the span.  The number of frames in a gap is then right within 1 %.

**Times.**  A frame arrives some time after it was taken: it is sent, waits in buffers, and waits for a busy host.  This
delay is never negative.  The fit is therefore a straight line below the arrival times as a function of the device's
clock: its slope is the median slope between the earliest frames of all half seconds of the last minute (Theil and Sen),
and it touches the earliest of them.  A constant part of the delay cannot be told from these times; it stays in the
stamps.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Literal

import numpy as np

from validation.weiss.protocol import TICK

#: Number of different values of the device's clock, which has 32 bits and then starts again at zero [ticks].
_CLOCK_RANGE = 1 << 32


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
    """

    most_frames_per_step: int = 8
    initial_steps: int = 8
    initial_span: int = 250
    most_waiting_steps: int = 512
    remembered_steps: int = 256
    long_step: float = 1.5


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
        parts = {
            f"after tick {self.after}": self.after is not None,
            f"{self.frames} frames": self.frames,
            f"{self.skipped} bytes": self.skipped,
            f"{self.seconds:.2f} s": self.seconds,
        }
        return ", ".join([self.kind, *(text for text, is_known in parts.items() if is_known)])

    @property
    def step(self) -> int:
        """Number of ticks from the frame before the gap to the frame after it, also if the clock started again at 0."""
        return 0 if self.after is None or self.before is None else (self.before - self.after) % _CLOCK_RANGE


class Continuity:
    """Reports the gaps in a stream of frames, from the times of the frames on the clock of the device.

    Two consecutive frames are described by a `Gap`, also if no frame is missing between them.
    """

    def __init__(self) -> None:
        #: Lengths [ticks] and numbers of frames of the latest steps without a long gap.
        self._steps: deque[tuple[int, int]] = deque(maxlen=_RULES.remembered_steps)
        #: Pairs of frames at the start of the stream that have not been checked yet; None when the period is known.
        self._unchecked: list[Gap] | None = []
        self._last: int | None = None

    def add(self, ticks: int, *, skipped: int, host_time: int) -> list[Gap]:
        """Add the next frame of the stream and return the gaps that have become known.

        Args:
            ticks: Time of the frame on the clock of the device [ticks].
            skipped: Number of bytes before the frame that belong to no message [-].
            host_time: Time at which the frame was read, on the monotonic clock of the host [ns].
        """
        pair = Gap(kind="bytes skipped", host_time=host_time, after=self._last, before=ticks, skipped=skipped)
        self._last = ticks
        if pair.after is None:
            return [pair] if skipped else []
        if self._unchecked is None:
            period = self._compute_period()
            self._add(pair, period)
            return _find_gaps([pair], period)
        self._unchecked.append(pair)
        waiting, short = len(self._unchecked), _find_short_steps(self._unchecked)
        is_known = len(short) >= _RULES.initial_steps and sum(short) >= _RULES.initial_span
        return self.finish() if is_known or (short and waiting >= _RULES.most_waiting_steps) else []

    def finish(self) -> list[Gap]:
        """Check the steps at the start of the stream that have not been checked yet, and return the gaps in them."""
        pairs = self._unchecked or []
        short = _find_short_steps(pairs)
        for pair in pairs if short else []:
            self._add(pair, fmean(short))
        self._unchecked = None if self._steps else []
        return _find_gaps(pairs, self._compute_period())

    def _add(self, pair: Gap, period: float) -> None:
        """Add a step to those that give the period, unless it has a long gap or the clock repeated or was set back."""
        frames = round(pair.step / period)
        if 0 < frames <= _RULES.most_frames_per_step:
            self._steps.append((pair.step, frames))

    def _compute_period(self) -> float:
        """Return the mean step without a lost frame [ticks]; infinite if no step is known."""
        if not self._steps:
            return math.inf
        lengths, frames = zip(*self._steps, strict=True)
        return float(sum(lengths) / sum(frames))


def _find_short_steps(pairs: Collection[Gap]) -> list[int]:
    """Return the lengths of the steps without a lost frame [ticks].

    A frame counts as lost if the step exceeds the first octile of all steps by the factor `_RULES.long_step`.  Steps in
    which the clock repeated or was set back do not count.
    """
    ordered = sorted(pair.step for pair in pairs if 0 < pair.step < _CLOCK_RANGE // 2)
    return ordered[: bisect_right(ordered, _RULES.long_step * ordered[len(ordered) // 8])] if ordered else []


def _find_gaps(pairs: Collection[Gap], period: float) -> list[Gap]:
    """Return the pairs of consecutive frames with a fault between them, and the kind of the fault.

    Args:
        pairs: Pairs of consecutive frames.
        period: Mean step of the device's clock without a lost frame [ticks].
    """
    gaps = []
    for pair in pairs:
        if pair.step == 0:
            gaps.append(replace(pair, kind="frame repeated"))
        elif pair.step >= _CLOCK_RANGE // 2:
            gaps.append(replace(pair, kind="clock set back"))
        elif pair.step > _RULES.long_step * period:
            gaps.append(replace(pair, kind="frames missing", frames=max(1, round(pair.step / period) - 1)))
        elif pair.skipped:
            gaps.append(pair)
    return gaps


@dataclass(frozen=True, kw_only=True)
class _FitSettings:
    """Settings of the fit, chosen with simulated delays of a busy host.

    Attributes:
        block: Duration of a block of frames, of which only the frame with the earliest arrival is fitted [s].
        blocks: Number of latest blocks that are fitted [-].
        fitted_blocks: Number of blocks from which the slope is fitted; before, a tick is assumed to last `TICK` [-].
        largest_drift: Largest deviation of the length of a tick from `TICK`, as a share of it; cheap clocks deviate by
            0.3 % [-].
        largest_delay: Largest time by which a frame may arrive before or after its fitted time; a frame outside has a
            wrong clock [s].
        most_outliers: Number of consecutive frames outside after which the clock counts as set anew, and the fit starts
            again [-].
    """

    block: float = 0.5
    blocks: int = 120
    fitted_blocks: int = 4
    largest_drift: float = 0.01
    largest_delay: float = 2.0
    most_outliers: int = 3


_FIT = _FitSettings()

_NANOSECONDS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True)
class Residual:
    """Statistics of the delays of frames, from the fitted times of the frames to their arrival.

    Attributes:
        median: Median of the time from a frame's stamp to its arrival [s].
        p95: Time that 95 % of the frames do not exceed [s].
        largest: Largest of these times [s].
        tick: Length of a tick of the device by the clock of the host [s].
        unfitted: Number of frames whose device clock did not fit, stamped by their arrival [-].
        restarts: Number of times that the fit started again because the device's clock was set anew [-].
    """

    median: float
    p95: float
    largest: float
    tick: float
    unfitted: int
    restarts: int

    def __str__(self) -> str:
        """Return the delays and the length of a tick in words, in one line."""
        late = [f"{1e3 * value:.1f} ms" for value in (self.median, self.p95, self.largest)]
        text = f"frames arrived {late[0]} (median), {late[1]} (95 %) and at most {late[2]} after their stamps, "
        if abs(self.tick / TICK - 1) > _FIT.largest_drift:
            text += f"which may be wrong: a tick of the device lasts {1e3 * self.tick:.3g} ms, not {1e3 * TICK:g} ms"
        else:
            text += f"which follow the device's clock with {1e3 * self.tick:.6f} ms per tick"
        odd = f"; {self.unfitted} frames did not fit and are stamped by their arrival" if self.unfitted else ""
        return text + odd + (f"; the clock was set anew {self.restarts} times" if self.restarts else "")


class DeviceClock:
    """Gives each frame the time on the clock of the host at which the device took it.

    Stamps increase from frame to frame.  A frame whose device clock does not fit is stamped by its arrival.
    """

    def __init__(self) -> None:
        self._restarts = self._unfitted = self._outliers = self._last_stamp = 0
        #: Time from the stamp of each frame to its arrival [ns]: 8 MB in an hour at 271 frames/s.
        self._delays = array("q")
        self._tick = TICK
        self._start()

    def stamp(self, ticks: int, arrival: int) -> int:
        """Return the time at which a frame was taken, on the monotonic clock of the host [ns].

        Args:
            ticks: Time of the frame on the clock of the device [ticks].
            arrival: Time at which the frame arrived, on the monotonic clock of the host [ns].
        """
        fitted = self._fit(ticks, arrival)
        self._outliers = 0 if fitted is not None else self._outliers + 1
        if self._outliers == _FIT.most_outliers:
            self._restarts, self._outliers = self._restarts + 1, 0
            self._start()
            fitted = self._fit(ticks, arrival)
        # A stamp that would not be later than the last one follows the last one by a microsecond.
        stamp = self._last_stamp = max(arrival if fitted is None else fitted, self._last_stamp + 1000)
        if fitted is None:
            self._unfitted += 1
        else:
            self._delays.append(max(0, arrival - stamp))
        return stamp

    @property
    def residual(self) -> Residual:
        """Delays of all frames so far, from their stamps to their arrival; NaN without frames."""
        delays = np.array(self._delays) / _NANOSECONDS_PER_SECOND if self._delays else np.array([np.nan])
        median, p95, largest = np.percentile(delays, (50, 95, 100)).tolist()
        return Residual(median, p95, largest, self._tick, self._unfitted, self._restarts)

    def _start(self) -> None:
        """Start the fit of the device's clock anew, with the next frame as its first frame."""
        #: Ticks and arrival time [ns] of the first frame.  All times of the fit count from this frame.
        self._origin: tuple[int, int] | None = None
        #: Earliest frame of each block, the present block last: time since the first frame on the device's clock, with
        #: ticks of the length `TICK`, and arrival minus this time [s].
        self._earliest: deque[tuple[float, float]] = deque(maxlen=_FIT.blocks)
        self._block = -1
        self._slope = self._offset = 0.0

    def _fit(self, ticks: int, arrival: int) -> int | None:
        """Add a frame to the fit and return its fitted time [ns]; None if its device clock is far from the fit."""
        if self._origin is None:
            self._origin = (ticks, arrival)
        start_ticks, start = self._origin
        elapsed = (arrival - start) / _NANOSECONDS_PER_SECOND
        ticks -= start_ticks
        # Ticks since the first frame, as near to the elapsed time as 32 bits leave open.
        device = (ticks + _CLOCK_RANGE * round((elapsed / TICK - ticks) / _CLOCK_RANGE)) * TICK
        difference = elapsed - device
        if abs(difference - self._offset - self._slope * device) > _FIT.largest_delay:
            return None
        block = int(elapsed / _FIT.block)
        if block != self._block:
            self._block = block
            if self._earliest:
                self._fit_line()
            self._earliest.append((device, difference))
        elif self._level(device, difference) < self._level(*self._earliest[-1]):
            self._earliest[-1] = (device, difference)
        self._offset = min(self._offset, self._level(device, difference))
        return start + round((device * (1 + self._slope) + self._offset) * _NANOSECONDS_PER_SECOND)

    def _level(self, device: float, difference: float) -> float:
        """Return the delay of a frame above the line through the first frame with the present slope [s]."""
        return difference - self._slope * device

    def _fit_line(self) -> None:
        """Fit the line of delay over device clock below the earliest frames of the complete blocks."""
        device, difference = np.array(self._earliest).T
        first, second = np.triu_indices(len(device), 1)
        step = device[second] - device[first]
        far = step > TICK
        if len(device) >= _FIT.fitted_blocks and far.any():
            slopes = (difference[second] - difference[first])[far] / step[far]
            slope = float(np.median(slopes))
            self._tick = TICK * (1 + slope)
            self._slope = min(max(slope, -_FIT.largest_drift), _FIT.largest_drift)
        self._offset = float(np.min(difference - self._slope * device))
