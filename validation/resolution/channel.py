"""What one count tells about the force on a texel: noise, dead zone, rounding, saturation, gains.

The electronics are those of `fastmodel`; the smallest force of every count is found by bisection on them.  A count
then says that force plus Gaussian noise lies between two such edges.  Where the noise exceeds half a count, rounding
acts as further noise of variance (one count)^2 / 12 (Widrow and Kollar, Quantization Noise, 2008, chapter 4); where it
does not, probabilities of counts are exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import log_ndtr, ndtr, ndtri

from fastmodel.signal.electronics import TEXEL_FORCE, Electronics
from meshes.array_types import BoolArray, FloatArray, IntArray
from validation.errors import InputError
from validation.parameters import find_parameters
from validation.sensor_file import SensorDescription

#: Share of false alarms in which a touch is reported at rest, and of touches that are found [-].
FALSE_ALARMS, HITS = 1e-3, 0.9
#: Largest count for which every edge is found [-].
_MOST_COUNTS = 65535
#: Largest force on a texel at which a count is looked for [N], and number of halvings of a bisection [-].
_LARGEST_FORCE, _HALVINGS = 1e4, 48
#: Forces at which the characteristic is checked to rise [-].
_CHECKED = 4001
#: Standard deviations beyond which noise is neglected [-].
_FAR = 10.0
#: Standard deviations of the noise above the threshold from which a texel counts as lit [-].
_LIT = 3.0
#: Counts on both sides of the expected one whose probabilities are summed where the noise is below half a count [-].
_BESIDE = 8
#: Force over the standard deviation of the noise below which a texel does not tell where a touch is [-].
_NEGLIGIBLE = 0.02
_TINY = 1e-300


class Reading(NamedTuple):
    """Interval in which force plus noise of each texel lies, each of shape (draws, n) [N]; equal without rounding."""

    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Channel:
    """Noise and electronics of n texels.

    Attributes:
        noise: Standard deviation of the noise of each texel, as a force [N].
        electronics: Electronics, with the gains of these texels; None for a sensor that adds noise alone.
    """

    noise: float
    electronics: Electronics | None = None

    @cached_property
    def edges(self) -> FloatArray:
        """Smallest force of each count, shape (counts + 2, n or 1) [N]; -inf for count 0, inf beyond the largest one.

        Raises:
            InputError: If the characteristic falls, or the converter has too many counts.
        """
        electronics = self.electronics
        if electronics is None:
            return np.array([[-np.inf], [-np.inf], [np.inf], [np.inf]])
        most = electronics.output_max
        if most > _MOST_COUNTS:
            raise InputError(
                f"output_max: limits are computed for up to {_MOST_COUNTS} counts, not {most}; give the sensor file "
                "fewer bits, with sensitivity and output_max to match"
            )
        columns = 1 if electronics.gains is None else len(electronics.gains)
        lowest, top = -_FAR * self.noise, 1e-3
        while top < _LARGEST_FORCE and (electronics.counts(np.full((1, columns), top)) < most).any():
            top *= 2
        steps = np.linspace(0, 1, _CHECKED)  # to the power of four, as the range may be a small part of `top`
        trace = np.append(lowest * steps[::-1], top * steps**4)[:, None] * np.ones(columns)
        if (np.diff(electronics.counts(trace), axis=0) < 0).any():
            raise InputError("characteristic: counts must not fall while the force rises; no limit follows from it")
        levels = np.arange(1, most + 1)[:, None]
        low, high = np.full((most, columns), lowest), np.full((most, columns), top)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            reached = electronics.counts(middle) >= levels
            low, high = np.where(reached, low, middle), np.where(reached, middle, high)
        first, last = (electronics.counts(np.full((1, columns), end)) for end in (lowest, top))
        found = np.where(first >= levels, -np.inf, np.where(last < levels, np.inf, high))
        return np.vstack([np.full(columns, -np.inf), found, np.full(columns, np.inf)])

    @cached_property
    def _ends(self) -> FloatArray:
        """Least and largest finite edge, between which counts are not censored, shape (2, n or 1) [N]."""
        known = np.isfinite(self.edges)
        return np.array([
            np.where(known, self.edges, np.inf).min(axis=0), np.where(known, self.edges, -np.inf).max(axis=0)
        ])  # fmt: skip

    @cached_property
    def usual_step(self) -> float:
        """Median force of one count [N]; 0 without electronics."""
        inner = self.edges[np.isfinite(self.edges).all(axis=1)]
        return float(np.median(np.diff(inner, axis=0))) if len(inner) > 1 else 0.0

    @property
    def spread(self) -> float:
        """Standard deviation of noise and rounding together [N]."""
        return math.hypot(self.noise, self.usual_step / math.sqrt(12))

    def is_lit(self, forces: FloatArray, among: IntArray | None = None) -> BoolArray:
        """Return whether each texel lies three standard deviations above its threshold and below saturation.

        Args:
            forces: Forces on the texels, shape (..., n) [N].
            among: Indices of the n texels; all if None.
        """
        edges = self.edges if among is None or self.edges.shape[1] == 1 else self.edges[:, among]
        return np.asarray((forces > np.maximum(edges[1], 0.0) + _LIT * self.noise) & (forces < edges[-2]))

    def is_shown(self, forces: FloatArray) -> BoolArray:
        """Return which forces a frame can show: above 2 % of the noise, and within 10 noises of the first count."""
        return np.asarray(forces > np.maximum(_NEGLIGIBLE * self.noise, self.edges[1] - _FAR * self.noise))

    def information(self, forces: FloatArray) -> FloatArray:
        """Compute the Fisher information of one count about the force on a texel, shape of `forces` (..., n) [1/N2].

        Counts at zero and at the largest count are censored: they tell that the force lies beyond an edge.
        """
        if self.electronics is None:
            return np.full(forces.shape, self.noise**-2)
        counts = self.electronics.counts(forces)
        low, high = self._bound(counts)
        step = np.where(np.isfinite(high - low), high - low, self.usual_step)
        spread = np.sqrt(self.noise**2 + step**2 / 12)
        u, v = (self.edges[1] - forces) / spread, (self.edges[-2] - forces) / spread
        within = ndtr(v) - ndtr(u) - _times_density(v) + _times_density(u)
        found = (within + _hazard(u) + _hazard(-v)) / spread**2
        coarse = self.noise < step / 2
        if coarse.any():
            found[coarse] = self._sum_counts(counts, forces, coarse)
        return np.asarray(found)

    def _bound(self, counts: IntArray) -> tuple[FloatArray, FloatArray]:
        column = np.arange(counts.shape[-1]) if self.edges.shape[1] > 1 else 0
        return self.edges[counts, column], self.edges[counts + 1, column]

    def _sum_counts(self, counts: IntArray, forces: FloatArray, where: BoolArray) -> FloatArray:
        """Sum (dP / dforce)^2 / P over the counts near the expected one, for the entries `where` of the forces."""
        total = np.zeros(int(where.sum()))
        for beside in range(-_BESIDE, _BESIDE + 1):
            near = np.clip(counts + beside, 0, len(self.edges) - 2)
            low, high = ((each - forces)[where] / self.noise for each in self._bound(near))
            change = (_density(low) - _density(high)) / self.noise
            probability = _between(low, high)
            new = (counts + beside == near)[where] & (probability > _TINY)
            total += np.where(new, change**2 / np.maximum(probability, _TINY), 0.0)
        return total

    def read(self, forces: FloatArray, normal: FloatArray) -> Reading:
        """Draw readings of forces, shape (draws, n) [N], from standard normal numbers, shape (draws, n) [-]."""
        noisy = forces + self.noise * normal
        return self.take(noisy if self.electronics is None else self.electronics.counts(noisy))

    def take(self, frames: FloatArray | IntArray) -> Reading:
        """Return what frames tell, shape (frames, n): counts, limited to those that there are, or forces [N]."""
        if self.electronics is None:
            return Reading(frames.astype(float), frames.astype(float))
        return Reading(*self._bound(np.clip(frames, 0, self.electronics.output_max).astype(int)))

    def log_likelihood(self, reading: Reading, forces: FloatArray, seen: IntArray) -> FloatArray:
        """Compute the logarithm of the probability of readings, less a constant for each, shape (draws, m) [-].

        Args:
            reading: Readings of n texels.
            forces: Forces on the texels `seen` in m cases, shape (m, s) [N].
            seen: Indices of the texels that differ between the cases, shape (s,).
        """
        low, high = reading.low[:, seen], reading.high[:, seen]
        first, last = self._ends if self.edges.shape[1] == 1 else self._ends[:, seen]
        inner = np.isfinite(low) & np.isfinite(high)
        step = np.subtract(high, low, out=np.zeros_like(low), where=inner)  # both are infinite for impossible counts
        smooth = inner & (self.noise >= step / 2)
        weight = np.where(smooth, 1 / (self.noise**2 + step**2 / 12), 0.0)
        middle = np.where(smooth, low + step / 2, 0.0)
        found = (weight * middle) @ forces.T - weight @ (forces**2).T / 2 - (weight * middle**2).sum(1)[:, None] / 2
        if (dark := np.isneginf(low) & np.isfinite(high)).any():
            some = dark.any(axis=0)
            found += dark[:, some].astype(float) @ log_ndtr((first - forces)[:, some] / self.noise).T
        if (full := np.isposinf(high) & np.isfinite(low)).any():
            some = full.any(axis=0)
            found += full[:, some].astype(float) @ log_ndtr((forces - last)[:, some] / self.noise).T
        for texel in np.flatnonzero((inner & ~smooth).any(axis=0)):
            rows = np.flatnonzero((inner & ~smooth)[:, texel])
            ends = ((each[rows, texel, None] - forces[:, texel]) / self.noise for each in (low, high))
            found[rows] += np.log(np.maximum(_between(*ends), _TINY))
        return np.asarray(found)

    def find_least_force(self, shares: FloatArray) -> float:
        """Compute the least force of a known place that 90 % of frames show, with 0.1 % of false alarms [N].

        Where the noise is seen at rest, the frame is weighted with the known image, and the force is
        (z_fa + z_hit) s / norm(T) (Kay, Detection Theory, 1998, section 4.3).  Else a touch is reported where any texel
        exceeds a count that at most 0.1 % of frames exceed at rest.  The smaller force is returned, inf if none.

        Args:
            shares: Force on each of n texels per unit force of the touch, shape (n,) [-].
        """
        seen = (self.edges[1] < -_LIT * self.noise).all() and self.noise >= self.usual_step / 2
        weighted = (ndtri(1 - FALSE_ALARMS) + ndtri(HITS)) * self.spread / np.linalg.norm(shares) if seen else np.inf
        if self.electronics is None:
            return float(weighted)
        repeat = len(shares) if self.edges.shape[1] == 1 else 1
        quiet = repeat * log_ndtr(self.edges[1:-1] / self.noise).sum(axis=1) >= math.log1p(-FALSE_ALARMS)
        if not quiet.any():
            return float(weighted)
        level = self.edges[1 + int(np.argmax(quiet))]

        def miss(force: float) -> float:
            return float(np.sum(log_ndtr((level - force * shares) / self.noise))) - math.log(1 - HITS)

        most = 1e-3
        while miss(most) > 0 and most < _LARGEST_FORCE:
            most *= 2
        return min(float(weighted), float(brentq(miss, 0, most)) if miss(most) <= 0 else np.inf)


def make_channel(electronics: Electronics, noise: float | None, active: BoolArray) -> tuple[Channel, bool]:
    """Prepare the channel of the active texels of a sensor, and whether its noise is assumed to be one count.

    Args:
        electronics: Electronics of the sensor.
        noise: Standard deviation of the noise on each texel's force [N]; None for that of the electronics, or one count
            if they state none.
        active: Whether each texel measures, shape (n,).
    """
    gains = None if electronics.gains is None else tuple(np.asarray(electronics.gains)[active].tolist())
    sigma, gain = electronics.noise if noise is None else noise, electronics.temperature_gain
    silent = replace(electronics, gains=gains, noise=0.0)
    if sigma:
        return Channel(noise=sigma / gain, electronics=silent), False
    step = Channel(noise=1e-9, electronics=silent).usual_step
    if not step:
        raise InputError("noise: one count has no size on this sensor; state the noise of a texel, such as --noise 5mN")
    return Channel(noise=step, electronics=silent), True


def find_channel(
    sensor: SensorDescription, noise: float | None, progress: Callable[[str], None] | None = None
) -> tuple[Channel, bool]:
    """Prepare the channel of a sensor with `make_channel`; the share under its tip is computed where it is not stated.

    Raises:
        ConvergenceError: If finite elements are needed and did not converge.
    """
    electronics = sensor.electronics
    if electronics.calibrated != TEXEL_FORCE and electronics.tip_share is None:
        electronics = find_parameters(sensor, progress).electronics
    return make_channel(electronics, noise, sensor.array.active)


def say_noise(noise: float, *, assumed: bool) -> str:
    """Return words for the standard deviation of the noise of a texel [N], and whether it is assumed."""
    why = ": one count, because the sensor states none; give yours with --noise" if assumed else ""
    return f"noise of {1e3 * noise:.3g} mN{why}"


def _density(u: FloatArray) -> FloatArray:
    """Return the density of the standard normal distribution."""
    return np.asarray(np.exp(-(u**2) / 2) / math.sqrt(2 * math.pi))


def _between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the probability that a standard normal number lies between two numbers, exact in both tails."""
    turned = low > 0
    return np.asarray(ndtr(np.where(turned, -low, high)) - ndtr(np.where(turned, -high, low)))


def _hazard(u: FloatArray) -> FloatArray:
    """Return density(u)^2 / P(below u) of the standard normal distribution, 0 at infinity."""
    finite = np.where(np.isfinite(u), u, 0.0)
    return np.where(np.isfinite(u), np.exp(-(finite**2) - math.log(2 * math.pi) - log_ndtr(finite)), 0.0)


def _times_density(u: FloatArray) -> FloatArray:
    """Return u density(u) of the standard normal distribution, 0 at infinity."""
    finite = np.where(np.isfinite(u), u, 0.0)
    return np.asarray(finite * _density(finite))
