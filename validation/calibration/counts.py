"""Counts of a texel as a function of its force, temperature and time under load.

    counts = S(max(0, g (1 + a (T - T0)) C(t) / C(t0) (s f + o(T)) - threshold)),  C(t) = 1 + c ln(t / 2 s),
    o(T) = threshold - s (d + b (T - T0))

Here f is the texel force, s the sensitivity, g the gain of the texel, d the dead force (below which a texel of gain one
reads zero), a and b the temperature coefficients of the gain and of the dead force, c the creep coefficient, t0 the age
that the sensitivity holds for, and S the soft saturation of `fastmodel.signal.electronics`.  Creep and temperature act
on the counts before the firmware subtracts its threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmodel import Electronics
from fastmodel.signal.electronics import saturate
from meshes.array_types import FloatArray
from validation.calibration.loading import CREEP_START


@dataclass(frozen=True, kw_only=True, eq=False)
class CountCurve:
    """Parameters of the conversion from texel force to counts.

    Attributes:
        sensitivity: Slope s for a texel of gain one, at T0 and t0 [counts/N].
        dead_force: Dead force d [N].
        gain_temperature: Temperature coefficient a of the gain [1/K].
        dead_temperature: Temperature coefficient b of the dead force [N/K].
        reference_temperature: Temperature T0 [degC].
        creep: Creep coefficient c [-].
        reference_age: Time t0 since loading that the sensitivity holds for [s].
        output_max: Largest count after subtraction of the threshold; inf for no saturation [-].
        saturation_band: Counts below `output_max` over which the curve bends [-].
        gains: Gain g of each of n texels, shape (n,) [-].
        heights: Load at which each texel begins to carry, relative to that of an even face, shape (n,) [N]; zeros for
            even seating, see `seat_unevenly`.
    """

    sensitivity: float
    dead_force: float
    gain_temperature: float
    dead_temperature: float
    reference_temperature: float
    creep: float
    reference_age: float = CREEP_START
    output_max: float
    saturation_band: float
    gains: FloatArray
    heights: FloatArray

    def predict(
        self, forces: FloatArray, *, temperatures: FloatArray, ages: FloatArray, thresholds: FloatArray
    ) -> FloatArray:
        """Predict the counts of m images without rounding.

        Args:
            forces: Texel forces under an even face, shape (m, n) [N].
            temperatures: Temperature of each image; NaN where it is unknown, which means T0, shape (m,) [degC].
            ages: Time since loading of each image; NaN where it is unknown, which means t0, shape (m,) [s].
            thresholds: Counts that the firmware subtracts, shape (m,) [-].

        Returns:
            Counts, shape (m, n) [-].
        """
        if self.heights.any():
            forces = seat_unevenly(forces, self.heights)
        warmer = np.nan_to_num(temperatures - self.reference_temperature)
        crept = self._creep_at(np.nan_to_num(ages, nan=self.reference_age)) / self._creep_at(self.reference_age)
        offset = thresholds - self.sensitivity * (self.dead_force + self.dead_temperature * warmer)
        factor = (1 + self.gain_temperature * warmer) * crept
        signal = self.gains * (factor[:, None] * (self.sensitivity * forces + offset[:, None])) - thresholds[:, None]
        signal = np.maximum(signal, 0.0)
        if not np.isfinite(self.output_max):
            return np.asarray(signal)
        return np.asarray(saturate(signal, self.output_max, self.saturation_band))

    def _creep_at(self, age: float | FloatArray) -> FloatArray:
        """Return C(t) at times since loading [s]."""
        return np.asarray(1 + self.creep * np.log(age / CREEP_START))

    def electronics(self, rate_hz: float, *, temperature: float, age: float, threshold: float) -> Electronics:
        """Return the curve at one temperature [degC] and time under load [s] as electronics of the fast model.

        Args:
            rate_hz: Frames per second [Hz].
            temperature: Temperature; NaN for T0 [degC].
            age: Time since loading; NaN for t0 [s].
            threshold: Counts that the firmware subtracts [-].
        """
        warmer = float(np.nan_to_num(temperature - self.reference_temperature))
        crept = self._creep_at(self.reference_age if np.isnan(age) else age) / self._creep_at(self.reference_age)
        factor = (1 + self.gain_temperature * warmer) * crept
        offset = threshold - self.sensitivity * (self.dead_force + self.dead_temperature * warmer)
        largest = 4095 if not np.isfinite(self.output_max) else round(self.output_max)
        return Electronics(
            rate_hz=rate_hz,
            sensitivity=self.sensitivity * float(factor),
            offset=offset * float(factor),
            output_max=largest,
            bits=max(12, int(largest).bit_length()),
            threshold=threshold,
            saturation_band=self.saturation_band if np.isfinite(self.output_max) else 0.0,
            gains=tuple(self.gains.tolist()),
        )


def seat_unevenly(forces: FloatArray, heights: FloatArray) -> FloatArray:
    """Share the load of each image among texels that an uneven face reaches one after the other.

    Texel i carries F_i max(0, p - e_i) / p0, where F_i is its force under an even face, p0 the load, e_i its height
    expressed as a load, and p the approach, expressed as a load, at which the sum of the forces is that of the F_i.
    This is a row of springs whose stiffnesses are the shares of the even face.

    Args:
        forces: Texel forces under an even face, shape (m, n) [N].
        heights: Heights e, shape (n,) [N].

    Returns:
        Forces, shape (m, n) [N].
    """
    total = forces.sum(axis=1, keepdims=True)
    share = np.divide(forces, total, out=np.zeros_like(forces), where=total > 0)
    order = np.argsort(heights)
    sorted_heights, stiffness = heights[order], np.cumsum(share[:, order], axis=1)
    moment = np.cumsum(share[:, order] * sorted_heights, axis=1)
    # With the first k texels in contact, sum share (p - e) = total gives p; the contact is right if p lies between the
    # heights of texel k and k + 1.
    approach = np.divide(total + moment, stiffness, out=np.full_like(forces, np.inf), where=stiffness > 0)
    reached = np.minimum.accumulate(approach, axis=1)[:, -1:]
    return np.asarray(share * np.maximum(reached - heights, 0.0))
