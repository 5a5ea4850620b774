"""The signal chain as pure functions over many worlds at once, for arrays of numpy, JAX or PyTorch.

The contact forces may have any source, for example a simulator that runs thousands of worlds on a graphics card:

    functions = ChainFunctions(parameters, rate_hz=1000.0, namespace=jax.numpy)
    state = functions.settle(forces)                         # forces: (worlds, texels) [N]
    state = jax.jit(functions.take)(state, forces)           # one more sample
    state, output = jax.jit(functions.frame)(state)          # output.image: (worlds, rows, columns)

No function changes its arguments.  A `Sensor` calls the same functions.  Arrays of any
library that follows the array API standard (2024.12) are accepted, with any number of dimensions before that of the
texels.  Tests run with numpy, array-api-strict and JAX.  Arrays of PyTorch need the package array-api-compat and are
not tested.  JAX computes with 32 bits unless `jax.config.update("jax_enable_x64", True)` was called; with 32 bits
counts may differ by one.
"""

from __future__ import annotations

import functools
import logging
from typing import Any, NamedTuple

import numpy as np

from fastmodel.parameters import Parameters
from fastmodel.signal.array_namespace import Array, find_namespace
from fastmodel.signal.butterworth import LowPass
from fastmodel.signal.electronics import describe_calibration
from fastmodel.signal.point_spread import build_operator

_LOG = logging.getLogger(__name__)


class ChainState(NamedTuple):
    """The state of the signal chain of n texels.

    Attributes:
        filter: States of the low-pass filter of n + 1 + m signals, shape (k, ..., n + 1 + m) [N].  The last of the k
            entries is the filtered sample.  The signals are the force on every texel, the total force, and m others.
        play: Output of each texel's play operator, which models hysteresis, shape (..., n) [N].
    """

    filter: Array
    play: Array


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
        dtype: Any = None,  # noqa: ANN401 -- types of several libraries
    ) -> None:
        """Build the matrices of filter and point spread.

        Args:
            parameters: The array of n texels, its cover and its electronics.
            rate_hz: Samples of the contact forces per second [Hz].
            spreads: Whether the functions apply the point spread; False for forces at the base of the cover, which the
                contact method `cover` computes.
            namespace: Module of the arrays, for example `numpy` or `jax.numpy`.
            dtype: Floating-point type of the contact forces; by default 64 bits, with JAX as configured.

        Raises:
            FastModelError: If the filter's cut-off is not below half the sampling rate.
        """
        array = parameters.array
        self._electronics, self._shape, self._count = parameters.electronics, (array.rows, array.columns), array.count
        if parameters.electronics.tip_radius is not None and parameters.electronics.tip_share is None:
            _warn_once(f"array {array.name!r}: {describe_calibration(parameters.electronics)}")
        self._active = None if array.active.all() else namespace.asarray(array.active)
        self._low_pass = LowPass(parameters.filter, rate_hz, namespace=namespace, dtype=dtype)
        self._ones = namespace.ones(array.count, dtype=dtype)
        # The operator is transposed, because the forces stand on its left: texels are their last dimension.
        self._spread = None
        if spreads and namespace is np:
            self._spread = build_operator(parameters.spread, array).T.astype(dtype or np.float64)
        elif spreads:
            self._spread = namespace.asarray(parameters.spread.operator(array).T.copy(), dtype=dtype)

    def settle(self, forces: Array, carried: Array | None = None, others: Array | None = None) -> ChainState:
        """Return the steady state under constant forces, without hysteresis.

        Args:
            forces: Constant contact force on each texel, shape (..., n) [N].
            carried: Total force, shape (...) [N]; by default the sum of the forces.
            others: Constant values of m other signals, shape (..., m) [any unit]; none by default.
        """
        xp = find_namespace(forces)
        return ChainState(self._low_pass.settle(_join(forces, carried, others)), xp.zeros_like(forces))

    def take(
        self, state: ChainState, forces: Array, carried: Array | None = None, others: Array | None = None
    ) -> ChainState:
        """Return the state after one more sample of the contact forces.

        Args:
            state: The state before the sample.
            forces: Contact force on each texel, shape (..., n) [N].
            carried: Total force, shape (...) [N]; by default the sum of the forces.
            others: The m other signals, as many as in the state, shape (..., m) [any unit].
        """
        return ChainState(self._low_pass.step(state.filter, _join(forces, carried, others)), state.play)

    def frame(
        self, state: ChainState, noise: np.random.Generator | Array | None = None
    ) -> tuple[ChainState, ChainOutput]:
        """Return the frame made from the latest sample, and the state after the frame.

        Args:
            state: The state after the latest sample.
            noise: Random generator of the noise of the electronics, for arrays of numpy; or independent numbers with
                the standard normal distribution, shape (..., n) [-]; None for frames without noise.
        """
        electronics, filtered, count = self._electronics, state.filter[-1, ...], self._count
        pressing = filtered[..., :count]
        forces = pressing if self._spread is None else pressing @ self._spread
        xp = find_namespace(forces)
        delayed, play = electronics.apply_hysteresis(forces, state.play)
        counts = electronics.counts(delayed, noise)
        if self._active is not None:
            counts = xp.where(self._active, counts, xp.zeros_like(counts))
        image = xp.reshape(electronics.image(counts), (*counts.shape[:-1], *self._shape))
        output = ChainOutput(
            counts=counts,
            image=image,
            texel_forces=forces,
            outside=filtered[..., count] - forces @ self._ones,
            others=filtered[..., count + 1 :],
        )
        return ChainState(state.filter, play), output


def _join(forces: Array, carried: Array | None, others: Array | None) -> Array:
    """Join the forces on n texels, the total force, and m other signals, shape (..., n + 1 + m) [N]."""
    xp = find_namespace(forces)
    total = xp.sum(forces, axis=-1) if carried is None else xp.asarray(carried, dtype=forces.dtype)
    signals = [forces, total[..., None]]
    return xp.concat(signals if others is None else [*signals, xp.asarray(others, dtype=forces.dtype)], axis=-1)


@functools.cache
def _warn_once(message: str) -> None:
    """Log a warning, once in a process."""
    _LOG.warning(message)
