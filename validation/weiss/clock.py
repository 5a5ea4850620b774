"""Fits the clock of the host to the clock of the device, so that frames get the times at which they were taken.

A frame arrives some time after it was taken: it is sent, waits in buffers, and waits for a busy host.  This delay is
never negative.  The fit is therefore a straight line below the arrival times as a function of the device's clock: its
slope is the median slope between the earliest frames of all half seconds of the last minute (Theil and Sen), and it
touches the earliest of them.  A constant part of the delay cannot be told from these times; it stays in the stamps.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from validation.weiss.unconfirmed import TICK


@dataclass(frozen=True, kw_only=True)
class _FitSettings:
    """Settings of the fit, chosen with simulated delays of a busy host.

    Attributes:
        block: Duration over which the earliest arrival is looked for [s].
        blocks: Number of these durations that are fitted [-].
        fitted_blocks: Number of blocks from which the slope is fitted; before, a tick is assumed to last `TICK` [-].
        largest_drift: Largest deviation of the length of a tick from `TICK`, as a share of it; cheap clocks deviate by
            0.3 % [-].
        largest_delay: Largest time by which a frame may arrive before or after its fitted time; a frame outside has a
            wrong clock [s].
        most_outliers: Number of consecutive frames outside after which the clock counts as set anew, and the fit starts
            again [-].
        clock_range: Number of different values of the device's clock, which has 32 bits [-].
        bin: Width of a bin in which delays are counted [ns].
        bins: Number of these bins: delays up to two seconds are told apart [-].
    """

    block: float = 0.5
    blocks: int = 120
    fitted_blocks: int = 4
    largest_drift: float = 0.01
    largest_delay: float = 2.0
    most_outliers: int = 3
    clock_range: int = 1 << 32
    bin: int = 100_000
    bins: int = 20_001


_FIT = _FitSettings()

_NANOSECONDS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True, kw_only=True)
class Residual:
    """How far arrival times lie from the times that the fit gives.

    Attributes:
        median: Median of the time from a frame's stamp to its arrival [s].
        p95: Time that 95 % of the frames do not exceed [s].
        largest: Largest of these times [s].
        tick: Length of a tick of the device by the clock of the host [s].
        unfitted: Number of frames whose device clock did not fit, stamped by their arrival [-].
        restarts: How often the fit started again because the device's clock was set anew [-].
    """

    median: float
    p95: float
    largest: float
    tick: float
    unfitted: int
    restarts: int

    def __str__(self) -> str:
        """Return a description in one line."""
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
        self._restarts = self._unfitted = self._outliers = 0
        self._delays = np.zeros(_FIT.bins, dtype=np.int64)
        self._largest = self._last_stamp = 0
        self._tick = TICK
        self._start()

    def stamp(self, ticks: int, arrival: int) -> int:
        """Return the time at which a frame was taken, on the monotonic clock of the host [ns].

        Args:
            ticks: Time of the frame on the clock of the device [ticks].
            arrival: Time at which the frame arrived, on the monotonic clock of the host [ns].
        """
        fitted = self._fit(ticks, arrival)
        if fitted is None:
            self._outliers += 1
            if self._outliers < _FIT.most_outliers:
                self._unfitted += 1
                return self._increase(arrival)
            self._restarts += 1
            self._start()
            fitted = self._fit(ticks, arrival)
        self._outliers = 0
        stamp = self._increase(arrival if fitted is None else fitted)
        delay = max(0, arrival - stamp)
        self._delays[min(_FIT.bins - 1, delay // _FIT.bin)] += 1
        self._largest = max(self._largest, delay)
        return stamp

    @property
    def residual(self) -> Residual:
        """How far arrival times lie from the stamps so far; NaN without frames."""
        total = np.cumsum(self._delays)
        median, p95 = (
            float(np.searchsorted(total, share * total[-1]) + 0.5) * _FIT.bin / _NANOSECONDS_PER_SECOND
            if total[-1]
            else float("nan")
            for share in (0.5, 0.95)
        )
        return Residual(
            median=median,
            p95=p95,
            largest=self._largest / _NANOSECONDS_PER_SECOND,
            tick=self._tick,
            unfitted=self._unfitted,
            restarts=self._restarts,
        )

    def _start(self) -> None:
        """Start the fit with the next frame."""
        #: Ticks and arrival [ns] of the first frame, from which the others count.
        self._origin: tuple[int, int] | None = None
        #: Time since the first frame by the device's clock, if a tick lasts `TICK`, and arrival minus this time [s], of
        #: the earliest frame of each block; the last one is of the present block.
        self._earliest: deque[tuple[float, float]] = deque(maxlen=_FIT.blocks)
        self._block = -1
        self._slope = self._offset = 0.0

    def _fit(self, ticks: int, arrival: int) -> int | None:
        """Add a frame to the fit and return its time [ns]; None if its clock does not fit."""
        if self._origin is None:
            self._origin = (ticks, arrival)
        start_ticks, start = self._origin
        elapsed = (arrival - start) / _NANOSECONDS_PER_SECOND
        device = self._unwrap(ticks - start_ticks, elapsed) * TICK
        difference = elapsed - device
        if abs(difference - self._offset - self._slope * device) > _FIT.largest_delay:
            return None
        block = int(elapsed / _FIT.block)
        if block != self._block:
            self._block = block
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
        """Fit slope and offset to the earliest frames of the complete blocks."""
        if not self._earliest:
            return
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

    @staticmethod
    def _unwrap(ticks: int, elapsed: float) -> int:
        """Return ticks since the first frame, as near to `elapsed` [s] as 32 bits leave open."""
        return ticks + _FIT.clock_range * round((elapsed / TICK - ticks) / _FIT.clock_range)

    def _increase(self, stamp: int) -> int:
        """Return the stamp, or the last one and a microsecond if it would not be later."""
        self._last_stamp = max(stamp, self._last_stamp + 1000)
        return self._last_stamp
