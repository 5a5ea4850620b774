"""Conversion of texel forces to the counts (integers) that a sensor sends, and to grey levels.

The force on each texel passes the stages hysteresis, temperature, noise, characteristic, gain, threshold, saturation,
rounding to whole counts, and 8-bit grey, in this order.  Hysteresis, temperature and noise are off by default.

The characteristic is a function of the force of its calibration.  On a bench, a small tip presses on the cover over the
centre of a texel, and the applied force is known.  The cover spreads this force, and the texel under the tip measures
only a share of it.  The force on a texel divided by that share is the applied force.

All functions accept arrays of any library that follows the array API standard, with any number of dimensions before
that of the texels.  They do not change their arguments.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError
from fastmodel.signal.array_namespace import Array, as_floats, cast, find_namespace, round_half_to_even
from fastmodel.signal.creep import MOST_CREEP

#: Grey level of white in an 8-bit image [-].
WHITE = 255
#: Width of the saturation bend below which counts are clipped sharply [counts].  Counts are rounded to whole numbers,
#: so that a narrower bend has no effect.
_SHARP = 1e-6
#: Value of `Electronics.calibrated` for a characteristic that is a function of the force on the texel itself.
TEXEL_FORCE = "texel force"
#: Form of `Electronics.calibrated` for a characteristic of the force that a rounded tip applies through the cover.
_THROUGH_COVER = re.compile(r"through the cover, tip (\d+\.?\d*(?:e[-+]?\d+)?) mm")
#: Largest accepted number of bits of a converter [-].
_MOST_BITS = 32
#: Number of coefficients of a characteristic of degree 5, as in the 2015 report [-].
_COEFFICIENTS = 6


@dataclass(frozen=True, kw_only=True)
class Electronics:
    """The conversion of a texel's force to counts.

    Attributes:
        rate_hz: Frames per second [Hz].
        sensitivity: Slope of the linear characteristic, counts = sensitivity * force + offset [1/N].
        offset: Counts at zero force.  With a negative offset, small forces give no counts [-].
        output_max: Largest count that the sensor delivers; white in the image [-].
        bits: Resolution of the converter: no count exceeds 2^bits - 1 [-].
        noise: Standard deviation of the Gaussian noise on each texel force of each frame [N].
        threshold: Counts that the firmware subtracts; negative results are set to zero [-].
        saturation_band: Counts below `output_max` over which the characteristic bends into saturation; 0 clips
            sharply [-].
        characteristic: Coefficients c0..c5 of counts = sum of c_k force^k, which replaces the linear
            characteristic [1/N^k]; None for the linear one.
        gains: Factor on the counts of each of n texels, applied before the threshold, shape (n,) [-]; None for factors
            of one.
        seed: Seed from which the noise starts when a sensor is bound; sensors with other names get other noise [-].
        hysteresis_share: Share of the force that passes through a play operator, 0..1; 0 for no hysteresis [-].
        hysteresis_width: Half width of the play operator.  Unloading and loading curves differ by twice this width
            times the share [N].
        temperature_coefficient: Relative change of the measured force per kelvin; 0 for none [1/K].
        temperature_excess: Temperature minus the temperature at which the characteristic was measured [K].
        creep: Growth of the force that counts stand for, in a factor e of the time under a constant load, see
            `fastmodel.signal.creep` [-].
        high_pass_hz: Cut-off of a first-order high-pass behind the low-pass filter, as of piezoelectric arrays, which
            see changes only; None for none [Hz].
        calibrated: Force that is the argument of the characteristic. `"texel force"` is the force on the texel, after
            spread. `"through the cover, tip 1 mm"` is the force that a rod with a hemispherical end of 1 mm radius
            (`meshes.RoundedTip`), or of another number of millimetres, applies to the cover over a texel's centre.
        tip_share: Share of the tip's force that the texel under the tip measures [-]; `softcover derive` computes it by
            finite elements.  If it is not known (None), the characteristic is applied to the texel force, so that
            counts are too low, and a running sensor logs a warning.
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
    creep: float = 0.0
    high_pass_hz: float | None = None
    calibrated: str = TEXEL_FORCE
    tip_share: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers of the electronics and the text `calibrated`.

        Raises:
            ValueError: If a number is out of range; the message lists all faults.
        """
        if not isinstance(self.bits, int) or not 1 <= self.bits <= _MOST_BITS:
            raise ValueError(f"bits must be a whole number 1..{_MOST_BITS}, not {self.bits!r}")
        largest, c, share, inf = 2**self.bits - 1, self.characteristic, self.tip_share, np.inf
        is_texel_force, most = self.calibrated == TEXEL_FORCE, self.output_max
        accepted = f"{TEXEL_FORCE!r} or 'through the cover, tip 1 mm' (radius in mm)"
        rules = {
            f"rate_hz must be positive, not {self.rate_hz}": 0 < self.rate_hz < inf,
            f"sensitivity must be positive, not {self.sensitivity}": 0 < self.sensitivity < inf,
            f"offset must be finite, not {self.offset}": np.isfinite(self.offset),
            f"output_max must lie in 1..{largest} ({self.bits} bits), not {most}": 1 <= most <= largest,
            f"hysteresis_share must lie in 0..1, not {self.hysteresis_share}": 0 <= self.hysteresis_share <= 1,
            "temperature_coefficient times temperature_excess must exceed -1; the gain is "
            f"{self.temperature_gain}": self.temperature_gain > 0,
            f"creep must lie in 0..{MOST_CREEP:g}, not {self.creep}": 0 <= self.creep <= MOST_CREEP,
            f"high_pass_hz must lie above 0 and below half of rate_hz, not {self.high_pass_hz}": (
                self.high_pass_hz is None or 0 < self.high_pass_hz < self.rate_hz / 2
            ),
            f"noise must not be negative, not {self.noise}": 0 <= self.noise < inf,
            f"hysteresis_width must not be negative, not {self.hysteresis_width}": 0 <= self.hysteresis_width < inf,
            f"threshold must not be negative, not {self.threshold}": 0 <= self.threshold < inf,
            f"saturation_band must lie in 0..output_max, not {self.saturation_band}": 0 <= self.saturation_band < most,
            f"characteristic takes {_COEFFICIENTS} finite coefficients c0..c5, not {c}": (
                c is None or (len(c) == _COEFFICIENTS and np.isfinite(c).all())
            ),
            "gains must be finite and not negative": self.gains is None or all(0 <= gain < inf for gain in self.gains),
            f"calibrated must be {accepted}, not {self.calibrated!r}": (
                is_texel_force or 0 < (self.tip_radius or 0) < inf
            ),
            f"tip_share must be positive, not {share}": share is None or 0 < share < inf,
            f"tip_share must be left out if the characteristic was calibrated against {TEXEL_FORCE!r}": (
                share is None or not is_texel_force
            ),
        }
        if faults := [message for message, holds in rules.items() if not holds]:
            raise ValueError("; ".join(faults))

    @property
    def tip_radius(self) -> float | None:
        """Radius of the tip that the characteristic was calibrated with through the cover; None for texel force [m]."""
        tip = _THROUGH_COVER.fullmatch(self.calibrated) if isinstance(self.calibrated, str) else None
        return None if tip is None else 1e-3 * float(tip[1])

    @property
    def applied_share(self) -> float:
        """Force on a texel over the argument of the characteristic [-]: `tip_share`, or 1 if it is None."""
        return 1.0 if self.tip_share is None else self.tip_share

    @property
    def temperature_gain(self) -> float:
        """Factor by which the temperature changes the measured force: 1 + coefficient * excess [-]."""
        return 1.0 + self.temperature_coefficient * self.temperature_excess

    def apply_hysteresis(self, forces: Array, play: Array) -> tuple[Array, Array]:
        """Return the forces on n texels after rate-independent hysteresis, and the outputs of the play operators.

        The share `hysteresis_share` of each force passes through a play operator.  The output of the play operator
        stays constant while the input differs from the output by at most `hysteresis_width`.  Otherwise the output
        follows the input at that distance.
        Source: Visintin, Differential Models of Hysteresis (1994), section III.2.

        Args:
            forces: Texel forces of the next frame, shape (..., n) [N].
            play: Output of each texel's play operator at the last frame, shape (..., n) [N].

        Returns:
            Forces after hysteresis and new outputs of the play operators, each of shape (..., n) [N].
        """
        if self.hysteresis_share == 0:
            return forces, play
        xp = find_namespace(forces)
        followed = xp.clip(play, forces - self.hysteresis_width, forces + self.hysteresis_width)
        return (1 - self.hysteresis_share) * forces + self.hysteresis_share * followed, followed

    def counts(self, forces: npt.ArrayLike | Array, noise: np.random.Generator | Array | None = None) -> Array:
        """Convert the forces on n texels to counts, integers of shape (..., n) [-].

        Args:
            forces: Texel forces after filter, spread and hysteresis, shape (..., n) [N].
            noise: Random generator of the noise, for arrays of numpy; or independent numbers with the standard normal
                distribution, shape (..., n) [-]; None for counts without noise.

        Raises:
            FastModelError: If the gains are for another number of texels.
        """
        xp = find_namespace(forces)
        measured = as_floats(xp, forces)
        if self.temperature_coefficient:
            measured = measured * self.temperature_gain
        if noise is not None and self.noise > 0:
            drawn = noise.standard_normal(measured.shape) if isinstance(noise, np.random.Generator) else noise
            measured = measured + self.noise * drawn
        applied = measured if self.tip_share is None else measured / self.tip_share
        if self.characteristic is None:
            signal = self.sensitivity * applied + self.offset
        else:
            *others, last = self.characteristic
            signal = xp.full_like(applied, last)
            for coefficient in reversed(others):
                signal = coefficient + signal * applied
        if self.gains is not None:
            if measured.shape[-1:] != (len(self.gains),):
                raise FastModelError(f"gains for {len(self.gains)} texels do not fit forces of shape {measured.shape}")
            signal = signal * xp.asarray(self.gains, dtype=signal.dtype)
        if self.threshold:
            signal = signal - self.threshold
        limited = saturate(xp.maximum(signal, 0.0), self.output_max, self.saturation_band)
        return cast(xp, round_half_to_even(xp, limited), xp.int64)

    def image(self, counts: npt.ArrayLike | Array) -> Array:
        """Convert counts to grey levels 0..255, with white at `output_max`, uint8 of the same shape [-]."""
        return grey_levels(counts, self.output_max)


def saturate(counts: Array, output_max: float, band: float) -> Array:
    """Limit counts to a largest value; return the limited counts, same shape [-].

    Counts up to the knee output_max - band pass unchanged.  Above the knee the curve continues with slope one and
    approaches the largest count exponentially: output_max - band exp(-(counts - knee) / band).

    Args:
        counts: Unlimited counts, floating-point numbers of any shape [-].
        output_max: Largest count [-].
        band: Counts between the knee and the largest count; 0 clips sharply [-].
    """
    xp = find_namespace(counts)
    if band < _SHARP:
        return xp.minimum(counts, float(output_max))
    knee = output_max - band
    bent = knee - band * xp.expm1(-xp.maximum(counts - knee, 0.0) / band)
    return xp.where(counts > knee, bent, counts)


def grey_levels(values: npt.ArrayLike | Array, full_scale: float) -> Array:
    """Convert values to grey levels, round(255 values / full_scale) clipped to 0..255, uint8 of the same shape [-].

    All levels are 0 if the full scale is not positive.  Halves are rounded to the even level, as numpy does.

    Args:
        values: Counts [-] or forces [N], any shape.
        full_scale: Value that is shown white (255) [unit of the values].
    """
    xp = find_namespace(values)
    floats = as_floats(xp, values)
    if not full_scale > 0:
        return xp.zeros(floats.shape, dtype=xp.uint8)
    grey = WHITE * xp.minimum(xp.maximum(floats / full_scale, 0.0), 1.0)
    return cast(xp, round_half_to_even(xp, grey), xp.uint8)


def describe_calibration(electronics: Electronics) -> str:
    """Describe in one sentence for which force the characteristic was calibrated, and how it is applied."""
    if electronics.tip_radius is None:
        return "counts are a function of the force on the texel"
    force = f"counts are a function of the force applied {electronics.calibrated} (radius of its hemispherical end)"
    if electronics.tip_share is not None:
        return f"{force}, of which the texel under the tip measures {electronics.tip_share:.4f}"
    return (
        f"{force}; the share of it on the texel is not known, so that the function is applied to the force on the "
        f"texel and counts are too low; take parameters from `softcover derive`, or set tip_share, or set calibrated "
        f"to {TEXEL_FORCE!r}"
    )


#: Electronics of the Weiss WTS 0614-34 in the 2015 report: counts are zero below 0.185 N and saturate from 1.646 N,
#: applied to the cover with a tip of 1 mm.
WTS_0614_34 = Electronics(
    rate_hz=271.0,
    sensitivity=2665.7,
    offset=-493.87,
    output_max=3895,
    bits=12,
    calibrated="through the cover, tip 1 mm",
)
