"""Butterworth low-pass filters of any order over all texels at once.

The filter is a cascade of second-order sections (one of first order when the order is odd), each from the
bilinear transform with the cut-off pre-warped, so that -3 dB falls on the cut-off at any sampling rate.
Single high-order polynomials lose their poles to rounding from about order 5; sections stay stable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import find_kernel
from fastmodel.errors import FilterError, ShapeError
from fastmodel.signal.loops import filter_loops

FloatArray = npt.NDArray[np.float64]

#: Highest order that is offered; nothing breaks above, but nothing was verified either.
ORDER_MAX = 20
#: Samples that wait at most before they are filtered together.
BLOCK = 8


@dataclass(frozen=True, kw_only=True)
class Butterworth:
    """A low-pass as one would order it.

    Attributes:
        cutoff_hz: Frequency of -3 dB [Hz].
        order: Number of poles [-].
    """

    cutoff_hz: float
    order: int = 2

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            FilterError: If the cut-off is not positive or the order not 1..20.
        """
        if not 0 < self.cutoff_hz < np.inf:
            raise FilterError(f"cutoff_hz must be positive, not {self.cutoff_hz}")
        if self.order != int(self.order) or not 1 <= self.order <= ORDER_MAX:
            raise FilterError(f"order must be a whole number 1..{ORDER_MAX}, not {self.order}")

    def sections(self, rate_hz: float) -> FloatArray:
        """Coefficients b0 b1 b2 a0 a1 a2 of each section, shape (ceil(order / 2), 6) [-].

        With K = tan(pi cutoff / rate), a pole pair of quality Q gives D = 1 + K/Q + K^2, b = K^2/D (1, 2, 1),
        a = (1, 2(K^2 - 1)/D, (1 - K/Q + K^2)/D); the real pole of an odd order gives b = K/(1 + K) (1, 1),
        a = (1, (K - 1)/(K + 1)).  Every section has unit gain at zero frequency.

        Args:
            rate_hz: Sampling rate [Hz].

        Raises:
            FilterError: If the cut-off is not below half the sampling rate.
        """
        if not self.cutoff_hz < rate_hz / 2:
            raise FilterError(f"cutoff_hz {self.cutoff_hz:g} must lie below half the sampling rate of {rate_hz:g} Hz")
        K = np.tan(np.pi * self.cutoff_hz / rate_hz)
        rows = [_first_order(K)] if self.order % 2 else []
        # Lowest quality first keeps the values inside the cascade small.
        angles = np.pi * (2 * np.arange(self.order // 2)[::-1] + 1) / (2 * self.order)
        rows += [_second_order(K, float(2 * np.sin(angle))) for angle in angles]
        return np.array(rows)

    def gain(self, frequency_hz: npt.ArrayLike, rate_hz: float) -> FloatArray:
        """Amplitude gain at given frequencies of the sampled filter, same shape [-].

        Args:
            frequency_hz: Frequencies [Hz].
            rate_hz: Sampling rate [Hz].
        """
        z = np.exp(-2j * np.pi * np.asarray(frequency_hz) / rate_hz)
        response = np.ones_like(z)
        for b0, b1, b2, a0, a1, a2 in self.sections(rate_hz):
            response *= (b0 + b1 * z + b2 * z**2) / (a0 + a1 * z + a2 * z**2)
        return np.abs(response)


class FilterBank:
    """The running filter: one cascade, its state for each of `count` texels.

    Transposed direct form II.  Samples may wait, so that several are filtered at once: by the numba kernel when numba
    is installed; without it by one product of matrices, from state and samples to output and new state, equal to the
    kernel's but for rounding.

    Attributes:
        room: Where samples are put that wait, the earliest first: `BLOCK` arrays of shape (count,) [any].
        filtered: The latest filtered sample, shape (count,); overwritten by the next [any].
    """

    def __init__(self, design: Butterworth | None, rate_hz: float, count: int, *, native: bool | None = None) -> None:
        """Prepare a filter at rest.

        Args:
            design: The low-pass; None lets samples pass as they are.
            rate_hz: Sampling rate [Hz].
            count: Number of texels [-].
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            FilterError: If the cut-off is not below half the rate.
            FastModelError: If numba is asked for and not installed.
        """
        self.sections = np.zeros((0, 6)) if design is None else design.sections(rate_hz)
        held = 2 * len(self.sections)
        # state and samples in one array, since one product takes both
        self._rows = np.zeros((held + BLOCK, count))
        self.filtered = np.zeros(count)
        self._kernel = find_kernel(filter_loops, native=native)
        self._moved = np.zeros((held + 1, count))
        self._look()

    def _look(self) -> None:
        """Make the views of the one array."""
        held = 2 * len(self.sections)
        samples = self._rows[held:]
        self.memory = self._rows[:held]
        self.waiting = [samples[:k] for k in range(BLOCK + 1)]
        self.room: list[FloatArray] = list(samples)
        self._products: dict[int, tuple[FloatArray, FloatArray]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """All but the views, each of which a copy would hold as an array of its own."""
        return {name: value for name, value in vars(self).items() if name not in _VIEWS}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take that, and look at the one array again."""
        vars(self).update(state)
        self._look()

    def settle(self, values: npt.ArrayLike = 0.0) -> None:
        """Put the filter into the state it would reach under constant input.

        Args:
            values: Constant input, a number or shape (count,) [any].
        """
        self.filtered[:] = np.asarray(values, dtype=np.float64)
        for (b0, _, b2, _, _, a2), k in zip(self.sections, range(0, len(self.memory), 2), strict=True):
            # y = x = steady in every section, because each has unit gain at zero frequency.
            self.memory[k] = (1.0 - b0) * self.filtered
            self.memory[k + 1] = (b2 - a2) * self.filtered

    def step(self, values: npt.ArrayLike) -> FloatArray:
        """Take one sample of every texel and return the filtered one, shape (count,).

        Args:
            values: Input, shape (count,) [any].

        Raises:
            ShapeError: If the shape is another.
        """
        sample = np.asarray(values, dtype=np.float64)
        if sample.shape != self.filtered.shape:
            raise ShapeError(f"the filter runs over shape {self.filtered.shape}, not {sample.shape}")
        self.room[0][:] = sample
        self.advance(1)
        return self.filtered.copy()

    def advance(self, count: int) -> None:
        """Filter the samples that wait.

        Args:
            count: How many there are in `room`, 0..BLOCK [-].
        """
        if self._kernel is not None:
            self._kernel(self.sections, self.memory, self.waiting[count], self.filtered)
        elif count:
            if count not in self._products:
                self._products[count] = _product(self.sections, count), self._rows[: len(self.memory) + count]
            product, rows = self._products[count]
            np.dot(product, rows, out=self._moved)
            self.filtered[:], self.memory[:] = self._moved[0], self._moved[1:]


#: Attributes of a filter bank that look at its one array.
_VIEWS = frozenset({"memory", "waiting", "room", "_products"})


def _second_order(K: float, inverse_quality: float) -> list[float]:
    D = 1 + K * inverse_quality + K**2
    b = K**2 / D
    return [b, 2 * b, b, 1.0, 2 * (K**2 - 1) / D, (1 - K * inverse_quality + K**2) / D]


def _first_order(K: float) -> list[float]:
    b = K / (1 + K)
    return [b, b, 0.0, 1.0, (K - 1) / (K + 1), 0.0]


def _product(sections: FloatArray, count: int) -> FloatArray:
    """So many samples through the cascade as a matrix: from state and samples to output and new state [-]."""
    held = 2 * len(sections)
    units, filtered = np.eye(held + count), np.zeros(held + count)
    filter_loops(sections, units[:held], units[held:], filtered)
    return np.concatenate([filtered[None], units[:held]])
