"""The load curve: counts from texel force, one for all texels, in the words of the fast model's electronics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import Electronics, saturate
from validation.recordings.series import THRESHOLD

FloatArray = npt.NDArray[np.float64]

#: ln(sensitivity [1/N]), ln(force below which nothing is read [N]), logit(saturation band / largest count).
START = np.array([np.log(6000.0), np.log(0.05), 1.0])
LOWER = np.array([np.log(100.0), np.log(1e-5), -6.0])
UPPER = np.array([np.log(1e5), np.log(1.0), 6.0])


@dataclass(frozen=True, kw_only=True)
class LoadCurve:
    """A line with a dead zone, less the firmware's threshold, bent softly into saturation.

    The same as `fastmodel.signal.electronics.Electronics`, but not rounded, so that it can be fitted to mean frames.

    Attributes:
        sensitivity: Slope [1/N].
        dead_force: Force below which a texel of gain one reads zero [N].
        saturation_band: Counts below the largest over which the curve bends [-].
        output_max: Largest count after subtraction of the threshold [-].
    """

    sensitivity: float
    dead_force: float
    saturation_band: float
    output_max: int

    @classmethod
    def of(cls, vector: FloatArray, output_max: int) -> LoadCurve:
        """Make the curve from the vector that is fitted, shape (3,)."""
        slope, dead, bend = (float(value) for value in vector)
        return cls(
            sensitivity=float(np.exp(slope)),
            dead_force=float(np.exp(dead)),
            saturation_band=output_max / (1 + float(np.exp(-bend))),
            output_max=output_max,
        )

    @property
    def offset(self) -> float:
        """Counts of the line at zero force, before the threshold is subtracted [-]."""
        return THRESHOLD - self.sensitivity * self.dead_force

    def counts(self, forces: FloatArray, gains: FloatArray | float = 1.0) -> FloatArray:
        """Counts without rounding, shape (..., n) to (..., n) [-].

        Args:
            forces: Texel forces [N].
            gains: One factor per texel on the line, before the threshold, shape (n,) [-].
        """
        signal = np.maximum(gains * (self.sensitivity * forces + self.offset) - THRESHOLD, 0.0)
        return saturate(signal, self.output_max, self.saturation_band)

    def electronics(self, rate_hz: float, gains: FloatArray | None = None) -> Electronics:
        """The same curve for the fast model."""
        return Electronics(
            rate_hz=rate_hz,
            sensitivity=self.sensitivity,
            offset=self.offset,
            output_max=self.output_max,
            threshold=THRESHOLD,
            saturation_band=self.saturation_band,
            gains=None if gains is None else tuple(float(gain) for gain in gains),
        )
