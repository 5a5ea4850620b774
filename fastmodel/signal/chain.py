"""The signal chain of one array: contact forces go through filter, spread and electronics and become frames.

The filter runs on every sample.  Spread and electronics run once per frame, on the latest filtered sample: spread and
filter are linear and all texels have the same filter, so their order does not matter.
"""

from __future__ import annotations

import numpy as np

from fastmodel.contact.interface import Reading
from fastmodel.parameters import Parameters
from fastmodel.signal.butterworth import FilterBank
from fastmodel.signal.frame import Frame
from fastmodel.signal.point_spread import build_operator


class SignalChain:
    """The running chain of one array; `settle` starts it.

    Attributes:
        outside: Filtered contact force of the latest frame that no texel measures [N].
    """

    def __init__(self, parameters: Parameters, rate_hz: float, *, spreads: bool) -> None:
        """Prepare a chain.

        Args:
            parameters: The array and its cover.
            rate_hz: Samples per second [Hz].
            spreads: Whether the chain applies the point spread; False if the contact method has done so.

        Raises:
            FilterError: If the filter's cut-off is not below half the sampling rate.
        """
        array = parameters.array
        self._array, self._electronics = array, parameters.electronics
        self._inactive = None if array.active.all() else ~array.active
        self._operator = build_operator(parameters.spread, array) if spreads else None
        # One signal per texel.  The last signal is the total force, so that `outside` is filtered as the texels are.
        self._filter = FilterBank(parameters.filter, rate_hz, array.count + 1)
        self._sample = np.zeros(array.count + 1)
        self.outside = 0.0

    def settle(self, reading: Reading) -> None:
        """Start again in the state that is reached after a long time under constant forces.

        Args:
            reading: The constant forces.
        """
        self._filter.settle(self._signals(reading))
        self._hysteresis = np.zeros(self._array.count)
        self._noise = np.random.default_rng(self._electronics.seed)

    def take(self, reading: Reading) -> None:
        """Filter one more sample.

        Args:
            reading: The forces of the sample.
        """
        self._filter.step(self._signals(reading))

    def frame(self, time: float, *, noisy: bool = True) -> Frame:
        """Make a frame of the latest sample.

        Args:
            time: Time of that sample [s].
            noisy: Whether to add the sensor's noise.
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
        """Force on each texel, spread if the contact method spreads, and the total force, shape (n + 1,) [N]."""
        forces = reading.contact_forces if reading.texel_forces is None else reading.texel_forces
        self._sample[:-1], self._sample[-1] = forces, reading.carried
        return self._sample
