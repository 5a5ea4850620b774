"""Load curve of the stamp recordings: the function from texel force to counts that all texels share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmodel.signal.electronics import Electronics, saturate
from meshes.array import FloatArray
from validation.recordings.series import THRESHOLD

#: Initial parameters of the fitted load curve, shape (3,) [-]: logarithm of the sensitivity in 1/N, logarithm of the
#: dead force in N, and logit of the saturation band over the largest count.
START = np.array([np.log(6000.0), np.log(0.05), 1.0])
#: Lower bounds of the parameters of the load curve, in the order of `START`.
LOWER = np.array([np.log(100.0), np.log(1e-5), -6.0])
#: Upper bounds of the parameters of the load curve, in the order of `START`.
UPPER = np.array([np.log(1e5), np.log(1.0), 6.0])


@dataclass(frozen=True, kw_only=True)
class LoadCurve:
    """Counts of a texel as a function of its force: a straight line with a dead zone and soft saturation.

    The curve equals `fastmodel.signal.electronics.Electronics` without rounding, so that it can be fitted to mean
    frames.  The firmware's threshold is subtracted.

    Attributes:
        sensitivity: Slope of the straight line [counts/N].
        dead_force: Force below which a texel of gain one reads zero [N].
        saturation_band: Width of the range of counts below the largest count in which the curve bends [-].
        output_max: Largest count after subtraction of the threshold [-].
    """

    sensitivity: float
    dead_force: float
    saturation_band: float
    output_max: int

    @classmethod
    def from_vector(cls, vector: FloatArray, output_max: int) -> LoadCurve:
        """Make the curve from the vector of fitted parameters, shape (3,), in the order of `START`."""
        slope, dead, bend = vector.tolist()
        return cls(
            sensitivity=float(np.exp(slope)),
            dead_force=float(np.exp(dead)),
            saturation_band=output_max / (1 + float(np.exp(-bend))),
            output_max=output_max,
        )

    @property
    def vector(self) -> FloatArray:
        """The curve as a vector of fitted parameters, shape (3,), in the order of `START`."""
        share = self.saturation_band / self.output_max
        return np.array([np.log(self.sensitivity), np.log(self.dead_force), np.log(share / (1 - share))])

    @property
    def offset(self) -> float:
        """Counts of the straight line at zero force, before the threshold is subtracted [-]."""
        return THRESHOLD - self.sensitivity * self.dead_force

    def counts(self, forces: FloatArray, gains: FloatArray | float = 1.0) -> FloatArray:
        """Convert texel forces to counts without rounding.

        Args:
            forces: Forces on n texels, shape (..., n) [N].
            gains: Gain of each texel, shape (n,), which multiplies the line before the threshold is subtracted [-].

        Returns:
            Counts, shape (..., n) [-].
        """
        signal = np.maximum(gains * (self.sensitivity * forces + self.offset) - THRESHOLD, 0.0)
        return np.asarray(saturate(signal, self.output_max, self.saturation_band))

    def electronics(self, rate_hz: float, gains: FloatArray | None = None) -> Electronics:
        """Return the curve as electronics of the fast model.

        Args:
            rate_hz: Frames per second of the sensor [Hz].
            gains: Gain of each texel, shape (n,); equal gains when not given [-].
        """
        return Electronics(
            rate_hz=rate_hz,
            sensitivity=self.sensitivity,
            offset=self.offset,
            output_max=self.output_max,
            threshold=THRESHOLD,
            saturation_band=self.saturation_band,
            gains=None if gains is None else tuple(gains.tolist()),
        )
