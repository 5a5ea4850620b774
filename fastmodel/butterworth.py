"""Butterworth low-pass filters of any order over all texels at once.

The filter is a cascade of second-order sections (one of first order when the order is odd), each from the
bilinear transform with the cut-off pre-warped, so that -3 dB falls on the cut-off at any sampling rate.
Single high-order polynomials lose their poles to rounding from about order 5; sections stay stable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fastmodel.errors import FilterError, ShapeError
from fastmodel.native import choose_kernel

FloatArray = npt.NDArray[np.float64]

#: Highest order that is offered; nothing breaks above, but nothing was verified either.
ORDER_MAX = 20


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

    Transposed direct form II, shape (sections, 2, count).  The numba kernel is used when numba is installed; without it
    a step is one product of matrices, input and state to output and state, equal to the kernel's but for rounding.
    """

    def __init__(self, design: Butterworth, rate_hz: float, count: int, *, native: bool | None = None) -> None:
        """Prepare a filter at rest.

        Args:
            design: The low-pass.
            rate_hz: Sampling rate [Hz].
            count: Number of texels [-].
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            FilterError: If the cut-off is not below half the rate.
            FastModelError: If numba is asked for and not installed.
        """
        self._sections = design.sections(rate_hz)
        self._state = np.zeros((len(self._sections), 2, count))
        self._advance = choose_kernel(_advance_loops, _advance_numpy, native=native)
        self._coefficients = _product(self._sections) if self._advance is _advance_numpy else self._sections

    def settle(self, values: npt.ArrayLike = 0.0) -> None:
        """Put the filter into the state it would reach under constant input.

        Args:
            values: Constant input, a number or shape (count,) [any].
        """
        steady = np.broadcast_to(np.asarray(values, dtype=np.float64), self._state.shape[2:])
        for (b0, _, b2, _, _, a2), state in zip(self._sections, self._state, strict=True):
            # y = x = steady in every section, because each has unit gain at zero frequency.
            state[0] = (1.0 - b0) * steady
            state[1] = (b2 - a2) * steady

    def step(self, values: npt.ArrayLike) -> FloatArray:
        """Take one sample of every texel and return the filtered one, shape (count,).

        Args:
            values: Input, shape (count,) [any].

        Raises:
            ShapeError: If the shape is another.
        """
        sample = np.asarray(values, dtype=np.float64)
        if sample.shape != self._state.shape[2:]:
            raise ShapeError(f"the filter runs over shape {self._state.shape[2:]}, not {sample.shape}")
        return self.advance(sample)

    def advance(self, values: FloatArray) -> FloatArray:
        """The same for an array that is known to fit."""
        sample = values.copy()
        self._advance(self._coefficients, self._state, sample)
        return sample


def _second_order(K: float, inverse_quality: float) -> list[float]:
    D = 1 + K * inverse_quality + K**2
    b = K**2 / D
    return [b, 2 * b, b, 1.0, 2 * (K**2 - 1) / D, (1 - K * inverse_quality + K**2) / D]


def _first_order(K: float) -> list[float]:
    b = K / (1 + K)
    return [b, b, 0.0, 1.0, (K - 1) / (K + 1), 0.0]


def _product(sections: FloatArray) -> FloatArray:
    """One sample through the cascade as a matrix: from input and state to output and new state [-]."""
    units = np.eye(2 * len(sections) + 1)
    _advance_loops(sections, units[1:].reshape(len(sections), 2, -1), units[0])
    return units


def _advance_numpy(product: FloatArray, state: FloatArray, sample: FloatArray) -> None:
    """One sample through the cascade, in place."""
    memory = state.reshape(len(product) - 1, -1)
    moved = product @ np.concatenate([sample[None], memory])
    sample[:], memory[:] = moved[0], moved[1:]


def _advance_loops(sections: FloatArray, state: FloatArray, sample: FloatArray) -> None:
    """The same as the published loops, section by section, for numba."""
    for s in range(sections.shape[0]):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        for i in range(sample.shape[0]):
            x = sample[i]
            y = b0 * x + state[s, 0, i]
            state[s, 0, i] = b1 * x - a1 * y + state[s, 1, i]
            state[s, 1, i] = b2 * x - a2 * y
            sample[i] = y
