"""From samples of contact forces to frames: filter, spread and electronics of one array.

Samples wait until a frame falls due; then all are filtered at once, and what the filter gives is spread and converted.
Where compiled loops are there and nothing random or lasting comes between, one of them does all of it: a frame is a few
microseconds of arithmetic, and calls from Python would cost more.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import find_kernel
from fastmodel.parameters import Parameters
from fastmodel.signal.butterworth import BLOCK, FilterBank
from fastmodel.signal.electronics import COUNTS, GREY
from fastmodel.signal.frame import Frame
from fastmodel.signal.loops import chain_loops
from fastmodel.signal.point_spread import running_operator

FloatArray = npt.NDArray[np.float64]


class SignalChain:
    """The running chain of one array.

    Attributes:
        outside: Filtered contact force of the latest frame that no texel feels [N].
    """

    def __init__(self, parameters: Parameters, rate_hz: float, *, spreads: bool, native: bool | None) -> None:
        """Prepare a chain; `settle` starts it.

        Args:
            parameters: The array and its cover.
            rate_hz: Samples per second [Hz].
            spreads: Whether samples are yet to be spread by the cover.
            native: True for the numba kernels, False for numpy, None for whichever is there.

        Raises:
            FilterError: If the filter's cut-off is not below half the rate.
            FastModelError: If numba is asked for and not installed.
        """
        array, electronics = parameters.array, parameters.electronics
        self._count, self._shape, self._electronics = array.count, (array.rows, array.columns), electronics
        # the last signal is the sum of everything, so that what no texel feels is filtered alike
        self._filter = FilterBank(parameters.filter, rate_hz, array.count + 1, native=native)
        self._operator = running_operator(parameters.spread, array) if spreads else None
        self._convert = electronics.converter(array.active, native=native)
        self._waiting = 0
        self.outside = 0.0
        self._at_once = find_kernel(chain_loops, native=native)
        if not (electronics.plain and (self._operator is None or isinstance(self._operator, np.ndarray))):
            self._at_once = None
        columns = np.ascontiguousarray(np.zeros((0, 0)) if self._operator is None else self._operator.T)
        self._constants = (columns, *electronics.numbers(array.count), array.active)

    def settle(self, signals: FloatArray) -> None:
        """Start anew as after a long time under constant forces.

        Args:
            signals: Force on each texel and the sum of everything, shape (n + 1,) [N].
        """
        self._filter.settle(signals)
        self._waiting = 0
        self._play = np.zeros(self._count)
        self._noise = np.random.default_rng(self._electronics.seed)

    def room(self) -> FloatArray:
        """Where the next sample is to be put, as `settle` takes it, shape (n + 1,) [N]; `take` takes it in."""
        if self._waiting == BLOCK:
            self._filter.advance(self._waiting)
            self._waiting = 0
        return self._filter.room[self._waiting]

    def take(self) -> None:
        """Take in the sample that was put in `room`."""
        self._waiting += 1

    def frame(self, time: float, *, noisy: bool = True) -> Frame:
        """The frame of the latest sample.

        Args:
            time: When that was [s].
            noisy: Whether it has the sensor's noise.
        """
        waiting, self._waiting = self._waiting, 0
        if self._at_once is None:
            self._filter.advance(waiting)
            return self._frame(time, self._noise if noisy else None)
        bank, count = self._filter, self._count
        forces, counts, image = np.empty(count), np.empty(count, COUNTS), np.empty(self._shape, GREY)
        self.outside = self._at_once(
            bank.sections, bank.memory, bank.waiting[waiting], *self._constants, bank.filtered, forces, counts, image
        )
        return Frame(time=time, counts=counts, texel_forces=forces, image=image)

    def _frame(self, time: float, noise: np.random.Generator | None) -> Frame:
        """The same stage by stage."""
        electronics, forces = self._electronics, self._filter.filtered[:-1]
        texel_forces = forces.copy() if self._operator is None else self._operator @ forces
        self.outside = float(self._filter.filtered[-1] - np.add.reduce(texel_forces))
        counts, image = self._convert(electronics.felt(electronics.lag(texel_forces, self._play), noise))
        return Frame(time=time, counts=counts, texel_forces=texel_forces, image=image.reshape(self._shape))
