"""The signal chain as pure functions over many worlds at once, for arrays of numpy, JAX or PyTorch.

The contact forces may have any source, for example a simulator that runs thousands of worlds on a graphics card:

    functions = ChainFunctions(parameters, rate_hz=1000.0)
    state = functions.settle(forces)                         # forces: (worlds, texels) [N]
    state = jax.jit(functions.take)(state, forces)           # one more sample
    state, output = jax.jit(functions.frame)(state)          # output.image: (worlds, rows, columns)

No function changes its arguments.  A `Sensor` calls the same functions.  Arrays of any
library that follows the array API standard (2024.12) are accepted, with any number of dimensions before that of the
texels.  Constants follow the library, the element type (32 or 64 bits) and the device of the forces.  Tests run with
numpy, array-api-strict, JAX and PyTorch; arrays of PyTorch need the package array-api-compat.  JAX computes with 32
bits unless `jax.config.update("jax_enable_x64", True)` was called; with 32 bits counts may differ by one.

`fastmodel.ContactFunctions` computes texel forces from gaps, contacts or depths of such a simulator.
"""

from __future__ import annotations

import functools
import logging
from typing import Any, NamedTuple

import numpy as np

from fastmodel.errors import FastModelError
from fastmodel.parameters import Parameters
from fastmodel.signal.array_namespace import Array, check_floats, convert, find_namespace
from fastmodel.signal.butterworth import LowPass
from fastmodel.signal.creep import Creep
from fastmodel.signal.electronics import describe_calibration
from fastmodel.signal.point_spread import build_operator

_LOG = logging.getLogger(__name__)


class ChainState(NamedTuple):
    """The state of the signal chain of n texels.

    Attributes:
        filter: States of the low-pass filter of n + 1 + m signals, shape (k, ..., n + 1 + m) [N].  The last of the k
            entries is the filtered sample.  The signals are the force on every texel, the total force, and m others.
        play: Output of each texel's play operator, which models hysteresis, shape (..., n) [N].
        creep: States of the creep of each texel, shape (m, ..., n) [N]; m is 0 without creep.
    """

    filter: Array
    play: Array
    creep: Array


class ChainOutput(NamedTuple):
    """The values of one frame of n texels, see `Frame`.

    Attributes:
        counts: Output of the sensor, integers of shape (..., n) [-].
        image: The counts as grey levels, uint8 of shape (..., rows, columns) [-].
        texel_forces: Filtered and spread texel forces, shape (..., n) [N].
        outside: Part of the filtered contact force that no texel measures, shape (...) [N].
        others: The m other signals after the filter, shape (..., m) [unit of the signals].
    """

    counts: Array
    image: Array
    texel_forces: Array
    outside: Array
    others: Array


class ChainFunctions:
    """Filter, point spread, characteristic and image of one sensor, as pure functions.

    Other signals, for example the tangential forces on texels or the net force, pass through the filter alone.  The
    functions do not compute them: they come from the simulator, as the contact forces do.
    """

    def __init__(
        self,
        parameters: Parameters,
        rate_hz: float,
        *,
        spreads: bool = True,
        namespace: Any = np,  # noqa: ANN401 -- modules have no common type
    ) -> None:
        """Build the matrices of filter and point spread.

        Args:
            parameters: The array of n texels, its cover and its electronics.
            rate_hz: Samples of the contact forces per second [Hz].
            spreads: Whether the functions apply the point spread; False for forces at the base of the cover, which the
                contact method `cover` computes.
            namespace: Module for forces that are plain lists, for example `jax.numpy`; arrays keep their own.

        Raises:
            FastModelError: If the filter's cut-off is not below half the sampling rate.
        """
        array = parameters.array
        self._electronics, self._shape, self._count = parameters.electronics, (array.rows, array.columns), array.count
        if parameters.electronics.tip_radius is not None and parameters.electronics.tip_share is None:
            _warn_once(f"array {array.name!r}: {describe_calibration(parameters.electronics)}")
        self._namespace, self._active = namespace, None if array.active.all() else array.active.astype(np.float64)
        self._low_pass, self._ones = (
            LowPass(parameters.filter, rate_hz, parameters.electronics.high_pass_hz),
            np.ones(array.count),
        )
        self._creep = Creep(parameters.electronics.creep)
        # The operator is transposed, because the forces stand on its left: texels are their last dimension.
        self._spread = build_operator(parameters.spread, array).T if spreads else None

    def settle(self, forces: Array, carried: Array | None = None, others: Array | None = None) -> ChainState:
        """Return the steady state under constant forces, without hysteresis; with creep, that after a hold of 2 s.

        Args:
            forces: Constant contact force on each texel, shape (..., n) [N].
            carried: Total force, shape (...) [N]; by default the sum of the forces.
            others: Constant values of m other signals, shape (..., m) [any unit]; none by default.

        Raises:
            FastModelError: If an array has the wrong number of texels, shape, element type or device.
        """
        signals = self._join(forces, carried, others)
        play = find_namespace(signals).zeros_like(signals[..., : self._count])
        steady = self._low_pass.settle(signals)
        return ChainState(steady, play, self._creep.settle(self._spread_forces(steady)))

    def take(
        self, state: ChainState, forces: Array, carried: Array | None = None, others: Array | None = None
    ) -> ChainState:
        """Return the state after one more sample of the contact forces.

        Args:
            state: The state before the sample.
            forces: Contact force on each texel, shape (..., n) [N].
            carried: Total force, shape (...) [N]; by default the sum of the forces.
            others: The m other signals, as many as in the state, shape (..., m) [any unit].

        Raises:
            FastModelError: If an array has the wrong number of texels, shape, element type or device, or another one
                than the state.
        """
        signals = self._join(forces, carried, others)
        check_floats("state.filter", state.filter, signals, (state.filter.shape[0], *signals.shape))
        return ChainState(self._low_pass.step(state.filter, signals), state.play, state.creep)

    def frame(
        self, state: ChainState, noise: np.random.Generator | Array | None = None, *, frames: int = 1
    ) -> tuple[ChainState, ChainOutput]:
        """Return the frame made from the latest sample, and the state after the frame.

        Args:
            state: The state after the latest sample.
            noise: Random generator of the noise of the electronics, for arrays of numpy; or independent numbers with
                the standard normal distribution, shape (..., n) [-]; None for frames without noise.
            frames: Number of frame intervals since the last frame, in which the forces creep [-].

        Raises:
            FastModelError: If the noise has another shape, element type or device than the forces.
        """
        electronics, filtered, count = self._electronics, state.filter[-1, ...], self._count
        forces = self._spread_forces(state.filter)
        xp = find_namespace(forces)
        if noise is not None and not isinstance(noise, np.random.Generator):
            noise = check_floats("noise", noise, forces, tuple(forces.shape))
        crept, creep = self._creep.step(state.creep, forces, frames / electronics.rate_hz)
        delayed, play = electronics.apply_hysteresis(crept, state.play)
        counts = electronics.counts(delayed, noise)
        if self._active is not None:
            counts = xp.where(convert(self._active, forces) > 0, counts, xp.zeros_like(counts))
        image = xp.reshape(electronics.image(counts), (*counts.shape[:-1], *self._shape))
        output = ChainOutput(
            counts=counts,
            image=image,
            texel_forces=forces,
            outside=filtered[..., count] - forces @ convert(self._ones, forces),
            others=filtered[..., count + 1 :],
        )
        return ChainState(state.filter, play, creep), output

    def _spread_forces(self, filtered: Array) -> Array:
        """Return the spread forces on n texels of the latest filtered sample, shape (..., n) [N]."""
        pressing = filtered[-1, ..., : self._count]
        return pressing if self._spread is None else pressing @ convert(self._spread, filtered)

    def _join(self, forces: Array, carried: Array | None, others: Array | None) -> Array:
        """Join the forces on n texels, the total force, and m other signals, shape (..., n + 1 + m) [N]."""
        forces = check_floats("forces", forces, otherwise=self._namespace)
        xp, shape = find_namespace(forces), tuple(forces.shape)
        if shape[-1:] != (self._count,):
            raise FastModelError(f"forces has shape {shape}; its last dimension must be the {self._count} texels")
        total = xp.sum(forces, axis=-1) if carried is None else check_floats("carried", carried, forces, shape[:-1])
        signals = [forces, total[..., None]]
        if others is not None:
            signals.append(check_floats("others", others, forces, (*shape[:-1], *others.shape[-1:])))
        return xp.concat(signals, axis=-1)


@functools.cache
def _warn_once(message: str) -> None:
    """Log a warning, once in a process."""
    _LOG.warning(message)
