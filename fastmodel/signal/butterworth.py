"""Butterworth low-pass filters of orders 1 to 20, applied to the signals of all texels at once.

The filter is a cascade of second-order sections, the bilinear transform of analogue sections, as scipy designs it.  The
cut-off is pre-warped, so that the gain at the cut-off is -3 dB at any sampling rate.  A single transfer function of
high order would be unstable from about order 5 on, because rounding of its coefficients moves the poles; sections stay
stable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmodel.errors import FastModelError
from fastmodel.signal.array_namespace import Array, convert, find_namespace
from meshes.array_types import FloatArray

#: Highest accepted order of a filter [-].  Higher orders are not tested.
ORDER_MAX = 20


@dataclass(frozen=True, kw_only=True)
class Butterworth:
    """Design of a Butterworth low-pass filter.

    Attributes:
        cutoff_hz: Frequency at which the gain is -3 dB [Hz].
        order: Number of poles [-].
    """

    cutoff_hz: float
    order: int = 2

    def __post_init__(self) -> None:
        """Check cut-off and order of the filter.

        Raises:
            FastModelError: If the cut-off is not positive and finite, or the order is not a whole number in 1..20.
        """
        if not 0 < self.cutoff_hz < np.inf:
            raise FastModelError(f"cutoff_hz must be positive, not {self.cutoff_hz}")
        if self.order != int(self.order) or not 1 <= self.order <= ORDER_MAX:
            raise FastModelError(f"order must be a whole number 1..{ORDER_MAX}, not {self.order}")

    def sections(self, rate_hz: float) -> FloatArray:
        """Compute the coefficients b0 b1 b2 a0 a1 a2 of each section, shape (ceil(order / 2), 6) [-].

        Args:
            rate_hz: Sampling rate [Hz].

        Raises:
            FastModelError: If the cut-off is not below half the sampling rate.
        """
        from scipy.signal import butter

        if not self.cutoff_hz < rate_hz / 2:
            raise FastModelError(f"cutoff_hz {self.cutoff_hz:g} must be below half the sampling rate of {rate_hz:g} Hz")
        sections = np.asarray(butter(self.order, self.cutoff_hz, fs=rate_hz, output="sos"))
        # Each section gets a gain of 1 at frequency zero: the whole gain in one section would be 0 in 32 bit.
        sections[:, :3] *= (sections[:, 3:].sum(axis=1) / sections[:, :3].sum(axis=1))[:, None]
        return sections


def list_sections(design: Butterworth | None, rate_hz: float, high_pass_hz: float | None = None) -> FloatArray:
    """Return the second-order sections of a low-pass and a first-order high-pass behind it, shape (s, 6) [-].

    Args:
        design: The low-pass filter; None for none.
        rate_hz: Sampling rate [Hz].
        high_pass_hz: Cut-off of the high-pass, as of a piezoelectric array; None for none [Hz].

    Raises:
        FastModelError: If a cut-off is not below half the sampling rate.
    """
    sections = np.zeros((0, 6)) if design is None else design.sections(rate_hz)
    if high_pass_hz is None:
        return sections
    if not 0 < high_pass_hz < rate_hz / 2:
        raise FastModelError(
            f"high_pass_hz must lie below half the sampling rate of {rate_hz:g} Hz, not {high_pass_hz}"
        )
    from scipy.signal import butter

    return np.vstack([sections, butter(1, high_pass_hz, "highpass", fs=rate_hz, output="sos")])


class LowPass:
    """A low-pass filter sampled at a rate, as pure functions of the states and samples of any number of signals.

    States and samples are arrays of any library that follows the array API standard.  In each step, one product with a
    constant matrix maps the states and the new sample of every signal to the next states and the filtered sample.
    """

    def __init__(self, design: Butterworth | None, rate_hz: float, high_pass_hz: float | None = None) -> None:
        """Build the matrix of the filter.

        Args:
            design: The low-pass filter; None passes every sample unchanged.
            rate_hz: Sampling rate [Hz].
            high_pass_hz: Cut-off of a first-order high-pass behind it; None for none [Hz].

        Raises:
            FastModelError: If the cut-off is not below half the sampling rate.
        """
        sections, resting = list_sections(design, rate_hz, high_pass_hz), np.zeros((0, 2))
        if len(sections):
            from scipy.signal import sosfilt_zi

            resting = sosfilt_zi(sections)
        self._transition = _combine(sections)
        self._steady = np.append(resting.ravel(), 1.0 if high_pass_hz is None else 0.0)

    def settle(self, values: Array) -> Array:
        """Return the steady states under constant input, two for each of s sections and the filtered sample.

        Args:
            values: Constant input of every signal, any shape [any unit].

        Returns:
            The states, shape (2 s + 1, *shape of the values); the last entry is the filtered sample.
        """
        return convert(self._steady.reshape(-1, *(1,) * values.ndim), values) * values

    def step(self, states: Array, values: Array) -> Array:
        """Return the states after one more sample; the last entry is the filtered sample.

        Args:
            states: The states, shape (2 s + 1, *shape of the values).
            values: New sample of every signal, any shape [unit of the input].
        """
        xp, count = find_namespace(values), self._transition.shape[0]
        if count == 1:  # There is no filter; the only state is the sample itself.
            return values[None, ...]
        before, transition = xp.concat([states[:-1, ...], values[None, ...]]), convert(self._transition, values)
        if values.ndim == 1:
            return transition @ before
        return xp.reshape(transition @ xp.reshape(before, (count, -1)), before.shape)


def _combine(sections: FloatArray) -> FloatArray:
    """Build the matrix of one step of a cascade of s sections, shape (2 s + 1, 2 s + 1) [-].

    The matrix maps the states and the new sample to the next states and the filtered sample.  Every section is in
    transposed direct form II, with states m0 and m1: output y = b0 x + m0, then
    m0 = b1 x - a1 y + m1 and m1 = b2 x - a2 y.  The output of a section is the input x of the next.

    Args:
        sections: Coefficients of the sections, see `Butterworth.sections`, shape (s, 6) [-].
    """
    matrix = np.eye(2 * len(sections) + 1)
    signal = matrix[-1]
    for k, (b0, b1, b2, _, a1, a2) in enumerate(sections):
        m0, m1 = matrix[2 * k].copy(), matrix[2 * k + 1].copy()
        output = b0 * signal + m0
        matrix[2 * k] = b1 * signal - a1 * output + m1
        matrix[2 * k + 1] = b2 * signal - a2 * output
        signal = output
    matrix[-1] = signal
    return matrix
