"""Creep of the transducer: under a constant load the reading grows with the logarithm of time.

A load that is put down and held reads 1 + c ln(t / 2 s) times its force.  The reading is a sum of first-order states of
equal weight, whose time constants are equally spaced in logarithm (a Prony series), so that it exists for any history
of the load by superposition.  Each state is updated exactly for a constant load, so that the interval has no effect.

Recordings of a Weiss array determine c from 1 s to 14 s after loading.  Readings at shorter and longer times are
extrapolated, and after unloading the series predicts more memory than these recordings show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmodel.errors import FastModelError
from fastmodel.signal.array_namespace import Array, convert, find_namespace
from meshes.array_types import FloatArray

#: Time after loading at which the reading is the force [s].
REFERENCE_TIME = 2.0
#: Shortest and longest time constant [s]: a decade below the shortest time after loading that recordings determine, and
#: four decades above 100 s.
_SHORTEST, _LONGEST = 0.1, 1e6
#: Number of time constants in a decade [-].  The ripple about the logarithm is 2 c |Gamma(i w)| with w = 2 pi / ln b,
#: and b the ratio of two time constants: 5e-5 for c = 0.12.
_PER_DECADE = 2
#: Largest accepted coefficient [-]; the reading just after loading stays positive.
MOST_CREEP = 0.2


@dataclass(frozen=True)
class Creep:
    """Creep with a coefficient, as pure functions of the states and forces of any number of texels.

    Attributes:
        coefficient: Relative growth of the reading in a factor e of time, c [-].
    """

    coefficient: float

    def __post_init__(self) -> None:
        """Check the coefficient.

        Raises:
            FastModelError: If it is negative or too large.
        """
        if not 0 <= self.coefficient <= MOST_CREEP:
            raise FastModelError(f"creep must lie in 0..{MOST_CREEP:g} (growth in a factor e), not {self.coefficient}")

    @property
    def times(self) -> FloatArray:
        """Time constants of the states, shape (m,) [s]; none without creep."""
        if self.coefficient == 0:
            return np.empty(0)
        decades = np.log10(_LONGEST / _SHORTEST)
        return np.geomspace(_SHORTEST, _LONGEST, round(_PER_DECADE * decades) + 1)

    @property
    def weight(self) -> float:
        """Weight of each state, c ln b [-]."""
        return float(self.coefficient * np.log(10.0) / _PER_DECADE)

    @property
    def instant(self) -> float:
        """Reading just after loading over the force, such that it is 1 at `REFERENCE_TIME` [-]."""
        return float(1 - self.weight * -np.expm1(-REFERENCE_TIME / self.times).sum())

    def settle(self, forces: Array) -> Array:
        """Return the states of loads that have been held for `REFERENCE_TIME`, shape (m, *shape of the forces) [N]."""
        held = -np.expm1(-REFERENCE_TIME / self.times)
        return convert(held.reshape(-1, *(1,) * forces.ndim), forces) * forces

    def step(self, states: Array, forces: Array, interval: float) -> tuple[Array, Array]:
        """Return the reading after an interval of constant forces, and the states.

        Args:
            states: The states, shape (m, *shape of the forces) [N].
            forces: Force on each texel during the interval [N].
            interval: Length of the interval [s].

        Returns:
            Reading in newtons, of the shape of the forces, and the new states.
        """
        if self.coefficient == 0:
            return forces, states
        xp = find_namespace(forces)
        kept = convert(np.exp(-interval / self.times).reshape(-1, *(1,) * forces.ndim), forces)
        states = forces + kept * (states - forces)
        return self.instant * forces + self.weight * xp.sum(states, axis=0), states
