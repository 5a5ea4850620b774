"""From texel forces to the sensor's integers and grey levels.

Per texel: hysteresis -> temperature -> noise -> characteristic -> gain -> threshold -> saturation -> whole counts ->
8-bit grey.  Hysteresis and temperature are off unless asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import find_kernel
from fastmodel.errors import ShapeError
from fastmodel.signal.loops import convert_loops

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Types of counts and grey levels; as objects, since numpy takes longer over classes.
COUNTS, GREY = np.dtype(np.int64), np.dtype(np.uint8)
#: Number of coefficients of the report's 5th-degree characteristic.
_COEFFICIENTS = 6

#: Counts up to which grey levels are looked up in a table [-].
_TABLE_MOST = 1 << 16


@dataclass(frozen=True, kw_only=True)
class Electronics:
    """What the sensor does with a texel's force.

    Attributes:
        rate_hz: Frames per second [Hz].
        sensitivity: Slope of the linear characteristic, counts = sensitivity * force + offset [1/N].
        offset: Count that the characteristic gives at no force; negative makes a dead zone [-].
        output_max: Largest count that the sensor delivers; white in the image [-].
        bits: Bits of the converter: no count exceeds 2^bits - 1 [-].
        noise: Standard deviation of the Gaussian noise on every texel force and frame [N].
        threshold: Counts that the firmware subtracts; whatever lies below reads zero [-].
        saturation_band: Counts below `output_max` over which saturation sets in softly; 0 for a sharp
            clip [-].
        characteristic: Coefficients c0..c5 of counts = sum of c_k force^k, instead of the straight line
            [1/N^k]; None for the line.
        gains: One factor per texel on the counts before the threshold, shape (n,) [-]; None for ones.
        seed: Seed of the noise; the same seed gives the same frames [-].
        hysteresis_share: Share of the force that goes through play, as in a gear: it follows the force only after that
            has turned by `hysteresis_width`, rises late and falls late; 0 for none, at most 1 [-].
        hysteresis_width: Half width of the play; the loop between loading and unloading is twice this times the share
            high [N].
        temperature_coefficient: Change of the felt force with temperature, over the force; 0 for none [1/K].
        temperature_excess: Temperature above the one at which the characteristic was taken [K].
    """

    rate_hz: float
    sensitivity: float
    offset: float = 0.0
    output_max: int = 4095
    bits: int = 12
    noise: float = 0.0
    threshold: float = 0.0
    saturation_band: float = 0.0
    characteristic: tuple[float, ...] | None = None
    gains: tuple[float, ...] | None = None
    seed: int = 0
    hysteresis_share: float = 0.0
    hysteresis_width: float = 0.0
    temperature_coefficient: float = 0.0
    temperature_excess: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If a number is out of range; the message lists every fault.
        """
        faults = [message for wrong, message in self._rules() if wrong]
        if faults:
            raise ValueError("; ".join(faults))

    def _rules(self) -> list[tuple[bool, str]]:
        largest = 2**self.bits - 1
        c = self.characteristic
        return [
            (not 0 < self.rate_hz < np.inf, f"rate_hz must be positive, not {self.rate_hz}"),
            (not 0 < self.sensitivity < np.inf, f"sensitivity must be positive, not {self.sensitivity}"),
            (not np.isfinite(self.offset), f"offset must be finite, not {self.offset}"),
            (
                not 1 <= self.output_max <= largest,
                f"output_max must lie in 1..{largest} ({self.bits} bits), not {self.output_max}",
            ),
            (not 0 <= self.noise < np.inf, f"noise must not be negative, not {self.noise}"),
            (not 0 <= self.hysteresis_share <= 1, f"hysteresis_share must lie in 0..1, not {self.hysteresis_share}"),
            (
                not 0 <= self.hysteresis_width < np.inf,
                f"hysteresis_width must not be negative, not {self.hysteresis_width}",
            ),
            (
                not self.temperature_gain > 0,
                f"temperature_coefficient times temperature_excess must exceed -1; the gain is {self.temperature_gain}",
            ),
            (not 0 <= self.threshold < np.inf, f"threshold must not be negative, not {self.threshold}"),
            (
                not 0 <= self.saturation_band < self.output_max,
                f"saturation_band must lie in 0..output_max, not {self.saturation_band}",
            ),
            (
                c is not None and (len(c) != _COEFFICIENTS or not np.isfinite(c).all()),
                f"characteristic takes {_COEFFICIENTS} finite coefficients c0..c5, not {c}",
            ),
            (
                self.gains is not None and not all(0 <= gain < np.inf for gain in self.gains),
                "gains must be finite and not negative",
            ),
        ]

    @property
    def temperature_gain(self) -> float:
        """Factor of the temperature on the felt force: 1 + coefficient times excess [-]."""
        return 1.0 + self.temperature_coefficient * self.temperature_excess

    @property
    def plain(self) -> bool:
        """Whether forces are felt as they are: without hysteresis, temperature and noise."""
        return self.hysteresis_share == 0 and self.temperature_coefficient == 0 and self.noise == 0

    def lag(self, forces: FloatArray, play: FloatArray) -> FloatArray:
        """Forces as felt after hysteresis, same shape [N].

        One play operator (Prandtl 1928): its output stays until the input comes within the half width from either
        side.  It has no rate: only the order of loads counts.

        Args:
            forces: Texel forces of the next frame, shape (n,) [N].
            play: Where each texel's play stands, shape (n,); moved in place [N].
        """
        if self.hysteresis_share == 0:
            return forces
        np.clip(play, forces - self.hysteresis_width, forces + self.hysteresis_width, out=play)
        return np.asarray((1 - self.hysteresis_share) * forces + self.hysteresis_share * play)

    def counts(self, forces: npt.ArrayLike, noise: np.random.Generator | None = None) -> IntArray:
        """Counts of texels under given forces, shape (..., n) to (..., n) [-].

        Args:
            forces: Texel forces after filter and spread [N].
            noise: Source of the noise; without one the counts are free of noise.

        Raises:
            ShapeError: If there are gains for another number of texels.
        """
        return self._converted(self.felt(np.asarray(forces, dtype=np.float64), noise))

    def felt(self, forces: FloatArray, noise: np.random.Generator | None = None) -> FloatArray:
        """Forces as felt at the sensor's temperature and with its noise, same shape [N].

        Args:
            forces: Texel forces after hysteresis [N].
            noise: Source of the noise; without one there is none.
        """
        if self.temperature_coefficient != 0:
            forces = forces * self.temperature_gain
        if noise is not None and self.noise > 0:
            forces = forces + noise.normal(0.0, self.noise, forces.shape)
        return forces

    def converter(
        self, active: npt.NDArray[np.bool_], *, native: bool | None = None
    ) -> Callable[[FloatArray], tuple[IntArray, npt.NDArray[np.uint8]]]:
        """A function from felt forces to counts and grey levels of one array, all of shape (n,).

        Args:
            active: Which texels measure, shape (n,); the others read zero.
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            ShapeError: If there are gains for another number of texels.
        """
        kernel, count = find_kernel(convert_loops, native=native), len(active)
        coefficients, gains, numbers = self.numbers(count)
        if kernel is None:
            dead = None if active.all() else ~active

            def convert(felt: FloatArray) -> tuple[IntArray, npt.NDArray[np.uint8]]:
                counts = self._converted(felt)
                if dead is not None:
                    counts[dead] = 0
                return counts, self.image(counts)

            return convert

        def convert_natively(felt: FloatArray) -> tuple[IntArray, npt.NDArray[np.uint8]]:
            counts, image = np.empty(count, COUNTS), np.empty((1, count), GREY)
            kernel(felt, coefficients, gains, numbers, active, counts, image)
            return counts, image[0]

        return convert_natively

    def numbers(self, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What compiled loops convert with: coefficients, gains and the rest, see `convert_loops`.

        Args:
            count: Number of texels [-].

        Raises:
            ShapeError: If there are gains for another number of texels.
        """
        return (
            np.array(self.characteristic or (self.offset, self.sensitivity), dtype=np.float64),
            np.zeros(0) if self.gains is None else self._gains((count,)),
            np.array([self.threshold, self.saturation_band, self.output_max], dtype=np.float64),
        )

    def _converted(self, felt: FloatArray) -> IntArray:
        signal = self._characteristic(felt)
        if self.gains is not None:
            signal = signal * self._gains(felt.shape)
        if self.threshold != 0:
            signal = signal - self.threshold
        counts = self._saturate(np.maximum(signal, 0.0))
        return np.rint(counts, out=counts).astype(np.int64)

    def image(self, counts: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """Grey levels round(255 counts / output_max), same shape [-]."""
        counts = np.asarray(counts)
        if counts.dtype == np.int64 and self.output_max < _TABLE_MOST:
            return self._grey_levels.take(counts, mode="clip")
        return self._grey(counts)

    @cached_property
    def _grey_levels(self) -> npt.NDArray[np.uint8]:
        """Grey level of every count from 0 to `output_max`: looking up costs a fifth of working out."""
        return self._grey(np.arange(self.output_max + 1))

    def _grey(self, counts: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
        grey = np.rint(255.0 * counts.astype(np.float64) / self.output_max)
        return np.minimum(np.maximum(grey, 0), 255).astype(np.uint8)

    def _characteristic(self, force: FloatArray) -> FloatArray:
        if self.characteristic is None:
            return self.sensitivity * force + self.offset
        return np.asarray(np.polynomial.polynomial.polyval(force, self.characteristic))

    def _gains(self, shape: tuple[int, ...]) -> FloatArray:
        gains = np.asarray(self.gains)
        if shape[-1:] != gains.shape:
            raise ShapeError(f"there are gains for {len(gains)} texels, but forces of shape {shape}")
        return gains

    def _saturate(self, signal: FloatArray) -> FloatArray:
        """Clip sharply, or bend with slope one into an exponential approach over the band."""
        if self.saturation_band == 0:
            return np.minimum(signal, self.output_max)
        knee = self.output_max - self.saturation_band
        excess = np.maximum(signal - knee, 0.0) / self.saturation_band
        return np.where(signal > knee, knee - self.saturation_band * np.expm1(-excess), signal)


#: The 2015 report's line of the Weiss WTS 0614-34: zero below 0.185 N, saturated from 1.646 N.
WTS_0614_34 = Electronics(rate_hz=271.0, sensitivity=2665.7, offset=-493.87, output_max=3895, bits=12)
