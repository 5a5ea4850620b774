"""Relaxation of the shear modulus of a material in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from meshes.array_types import FloatArray, is_positive

#: What the bulk modulus of a relaxing material does.
Bulk = Literal["relaxing", "constant"]
#: Largest sum of Prony terms: one, with rounding [-].
_MOST = 1 + 1e-12


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """Relaxation function g(t) = G(t) / G(0) of the shear modulus; the material states G(0), that just after a step.

    Prony terms: g(t) = 1 - sum of g_i (1 - exp(-t / tau_i)).  Power law: g(t) = (1 + t / tau)^-exponent.

    Attributes:
        g: Prony terms, the share of the modulus that relaxes with each time; empty for a power law [-].
        tau: Times of the Prony terms, or the one time of a power law [s].
        exponent: Exponent of a power law, in 0..1; None for Prony terms [-].
        bulk: Whether the bulk modulus relaxes with the shear modulus, so that the Poisson ratio is constant, or is
            constant.
    """

    tau: tuple[float, ...]
    g: tuple[float, ...] = ()
    exponent: float | None = None
    bulk: Bulk = "relaxing"

    def __post_init__(self) -> None:
        """Check the parameters.

        Raises:
            ValueError: If terms and exponent are both given or both missing, a term, time or exponent is out of range,
                their numbers differ, or the terms sum to more than one.
        """
        if self.bulk not in get_args(Bulk):
            raise ValueError(f"bulk is {' or '.join(get_args(Bulk))}, not {self.bulk!r}")
        if bool(self.g) == (self.exponent is not None):
            raise ValueError("give either g, the Prony terms, or exponent, that of a power law")
        if not all(map(is_positive, self.tau)) or len(self.tau) != max(1, len(self.g)):
            raise ValueError(f"tau takes one positive time for each of {max(1, len(self.g))} terms, not {self.tau} s")
        if self.exponent is not None and not 0 < self.exponent < 1:
            raise ValueError(f"exponent must lie between 0 and 1, not {self.exponent}")
        if not all(map(is_positive, self.g)):
            raise ValueError(f"g takes positive terms, not {', '.join(f'{each:g}' for each in self.g)}")
        if sum(self.g) > _MOST:
            raise ValueError(f"g takes terms that sum to at most one, not to {sum(self.g):.6g}")

    def mean(self, start: FloatArray, length: FloatArray) -> FloatArray:
        """Return the mean of g over intervals of time, without cancellation; g itself at intervals of length 0.

        Args:
            start: Start of each interval, any shape [s].
            length: Length of each interval, of a shape that fits [s].
        """
        start, length = np.broadcast_arrays(start, length)
        if self.exponent is not None:
            base, power = 1 + start / self.tau[0], 1 - self.exponent
            step = length / (self.tau[0] * base)
            rise = np.expm1(power * np.log1p(step))
            return np.asarray(
                base**-self.exponent * np.divide(rise, power * step, out=np.ones_like(step), where=step > 0)
            )
        out = np.full(start.shape, max(0.0, 1 - sum(self.g)))
        for share, tau in zip(self.g, self.tau, strict=True):
            step = length / tau
            out += (
                share * np.exp(-start / tau) * np.divide(-np.expm1(-step), step, out=np.ones_like(step), where=step > 0)
            )
        return out

    def at(self, time: float) -> float:
        """Return g at a time after a step [-]."""
        return float(self.mean(np.array(time), np.array(0.0)))
