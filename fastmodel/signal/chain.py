"""The signal chain of one array: low-pass filter, point spread and electronics convert contact forces to frames.

The filter runs on every sample of the contact forces.  Point spread and electronics run once per frame, on the latest
filtered sample.  Filter and point spread are linear and all texels have the same filter, so the order of filter and
point spread has no effect on the result.
"""

from __future__ import annotations

import numpy as np

from fastmodel.contact.interface import Reading
from fastmodel.parameters import Parameters
from fastmodel.signal.butterworth import FilterBank
from fastmodel.signal.frame import Frame
from fastmodel.signal.point_spread import build_operator


class SignalChain:
    """The signal chain of one array with the states of its filters; call `settle` before the first sample.

    Attributes:
        outside: Part of the filtered contact force that no texel measures, at the latest frame [N].
    """

    def __init__(self, parameters: Parameters, rate_hz: float, *, spreads: bool) -> None:
        """Build filter and spread operator.

        Args:
            parameters: The array, its cover and its electronics.
            rate_hz: Samples of the contact forces per second [Hz].
            spreads: Whether the chain applies the point spread; False if the contact method gives the forces at the
                base of the cover.

        Raises:
            FilterError: If the filter's cut-off is not below half the sampling rate.
        """
        array = parameters.array
        self._array, self._electronics = array, parameters.electronics
        self._inactive = None if array.active.all() else ~array.active
        self._operator = build_operator(parameters.spread, array) if spreads else None
        # One signal per texel and, as the last signal, the total force, so that `outside` passes through the same
        # filter.
        self._filter = FilterBank(parameters.filter, rate_hz, array.count + 1)
        self._sample = np.zeros(array.count + 1)
        self.outside = 0.0

    def settle(self, reading: Reading) -> None:
        """Set the filter to its steady state under constant forces, and restart hysteresis and noise.

        Args:
            reading: The constant contact forces.
        """
        self._filter.settle(self._signals(reading))
        self._hysteresis = np.zeros(self._array.count)
        self._noise = np.random.default_rng(self._electronics.seed)

    def take(self, reading: Reading) -> None:
        """Pass one more sample through the filter.

        Args:
            reading: The contact forces of the sample.
        """
        self._filter.step(self._signals(reading))

    def frame(self, time: float, *, noisy: bool = True) -> Frame:
        """Make a frame from the latest filtered sample.

        Args:
            time: Time of the latest sample [s].
            noisy: Whether to add the noise of the electronics.
        """
        electronics, filtered = self._electronics, self._filter.filtered
        forces = filtered[:-1].copy() if self._operator is None else self._operator @ filtered[:-1]
        self.outside = float(filtered[-1] - forces.sum())
        delayed = electronics.apply_hysteresis(forces, self._hysteresis)
        counts = electronics.counts(delayed, self._noise if noisy else None)
        if self._inactive is not None:
            counts[self._inactive] = 0
        image = electronics.image(counts).reshape(self._array.rows, self._array.columns)
        return Frame(time=time, counts=counts, texel_forces=forces, image=image)

    def _signals(self, reading: Reading) -> np.ndarray:
        """Return the inputs of the filter: force on each of n texels, then the total force, shape (n + 1,) [N].

        The texel forces are those at the base of the cover if the contact method computes them.
        """
        forces = reading.contact_forces if reading.texel_forces is None else reading.texel_forces
        self._sample[:-1], self._sample[-1] = forces, reading.carried
        return self._sample
