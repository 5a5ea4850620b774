"""The signal chain of one array: low-pass filter, point spread and electronics convert contact forces to frames.

The filter runs on every sample of the contact forces.  Point spread and electronics run once per frame, on the latest
filtered sample.  Filter and point spread are linear and all texels have the same filter, so the order of filter and
point spread has no effect on the result.
"""

from __future__ import annotations

import numpy as np

from fastmodel.contact.interface import Reading
from fastmodel.parameters import Parameters
from fastmodel.signal.frame import Frame
from fastmodel.signal.functions import ChainFunctions, ChainState
from fastmodel.state import State, pack_generator, take_array, unpack_generator
from meshes.array_types import FloatArray


class SignalChain:
    """The signal chain of one array with the states of its filters; call `settle` before the first sample.

    Attributes:
        noise: Random generator of the noise.
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
            FastModelError: If the filter's cut-off is not below half the sampling rate.
        """
        self._area = float(np.prod(parameters.array.texel_size))
        self._functions = ChainFunctions(parameters, rate_hz, spreads=spreads)
        self._source = ""
        self.noise = np.random.default_rng(parameters.electronics.seed)
        self.outside = 0.0

    def settle(self, reading: Reading) -> None:
        """Set the filter to its steady state under constant forces, and restart hysteresis; the noise continues.

        Args:
            reading: The constant contact forces.
        """
        forces, vectors = _pressing(reading), _list_vectors(reading)
        others = np.concatenate(vectors) if vectors else None
        self._state = self._functions.settle(forces, np.float64(reading.carried), others)
        self._source = reading.tangential_source

    def take(self, reading: Reading) -> None:
        """Pass one more sample through the filter.

        Args:
            reading: The contact forces of the sample.
        """
        signals = np.concatenate([_pressing(reading), (reading.carried,), *_list_vectors(reading)])
        self._state = self._functions.take_signals(self._state, signals)

    def frame(self, time: float, *, noisy: bool = True) -> Frame:
        """Make a frame from the latest filtered sample.

        Args:
            time: Time of the latest sample [s].
            noisy: Whether to add the noise of the electronics.
        """
        self._state, made = self._functions.frame(self._state, self.noise if noisy else None)
        self.outside = float(made.outside)
        vectors: FloatArray = made.others.copy()
        return Frame(
            time=time,
            counts=made.counts,
            texel_forces=made.texel_forces,
            image=made.image,
            texel_area=self._area,
            net_force=vectors[:3] if len(vectors) else None,
            net_torque=vectors[3:6] if len(vectors) else None,
            tangential=vectors[6:].reshape(-1, 2) if len(vectors) else None,
            tangential_source=self._source,
        )

    def get_state(self) -> State:
        """Return the states of filter, hysteresis and noise, and the force `outside`."""
        return {
            "filter": np.array(self._state.filter),
            "play": np.array(self._state.play),
            "noise": pack_generator(self.noise),
            "outside": np.array(self.outside),
        }

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned.

        Raises:
            FastModelError: If an array is missing or has another shape than in this chain.
        """
        own = self.get_state()
        found = {name: take_array(state, name, array) for name, array in own.items()}
        self._state = ChainState(filter=found["filter"], play=found["play"])
        self.noise = unpack_generator(found["noise"])
        self.outside = float(found["outside"])


def _pressing(reading: Reading) -> FloatArray:
    """Return the texel forces of a reading, at the base of the cover if the contact method computes them, (n,) [N]."""
    return reading.contact_forces if reading.texel_forces is None else reading.texel_forces


def _list_vectors(reading: Reading) -> tuple[FloatArray, ...]:
    """Return net force and torque, shape (6,), and tangential forces, shape (2 n,), of a reading; () if it has none."""
    if reading.wrench is None or reading.tangential is None:
        return ()
    return reading.wrench, reading.tangential.reshape(-1)
