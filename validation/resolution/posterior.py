"""The posterior of a touch given one frame: place, force and radius, as drawn points with weights.

The prior is uniform over a box around a texel, over the radius, and over the force.  Place and radius are sampled as
normal numbers z, whose distribution function spans the box.  The force, in which the frame is linear, is drawn around
its weighted least squares.  Points are drawn from a t-distribution at the most likely touch; where it does not fit,
from clusters that follow a likelihood raised to a growing power, from the prior on (Neal, Annealed importance sampling,
2001; Cappe et al., Population Monte Carlo, 2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, ndtr, ndtri
from scipy.stats import qmc

from meshes.array_types import FloatArray, IntArray
from validation.resolution.channel import Channel, Reading
from validation.resolution.chart import Chart
from validation.resolution.kernel import LINE, fit_touches
from validation.resolution.mixture import TAILS, WIDENED, draw_mixture, find_clusters, raise_power, weigh

#: Points as powers of two: of the first look, less the parameters, of a round, and of the result; most rounds [-].
_LOOKED, _DRAWN, _LAST, _ROUNDS, _DRAWS = 5, 8, 9, 16, 4
#: Share of points that count when the likelihood is raised, and when the proposal has settled [-].
_RAISED, _SETTLED = 0.15, 0.25
#: Steps toward the most likely touch, their largest length, and step of difference quotients, in normal numbers [-].
_NEWTON, _LONGEST, _ASIDE = 12, 0.7, 0.01
#: Growth of the variance by a misfit that is not noise, besides that by its size [-].
_SYSTEMATIC = 3.0
#: Standard deviation of the middle of a pressure of unknown shape from that of an oval one, over the radius [-]; chosen
#: on presses of boxes.
_ASKEW = 0.015
#: Smallest variance of a proposal in normal numbers [-].
_TINY = 1e-12


class Posterior(NamedTuple):
    """Points drawn from the posterior of a touch.

    Attributes:
        places: Place from the point above the texel of the chart, shape (m, 2) [m].
        radii: Radius, shape (m,) [m].
        forces: Force, shape (m,) [N].
        texels: Force on each texel, shape (m, n) [N].
        weights: Weights, whose sum is one, shape (m,) [-].
    """

    places: FloatArray
    radii: FloatArray
    forces: FloatArray
    texels: FloatArray
    weights: FloatArray

    def summarise(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the mean and the quantiles 2.5 % and 97.5 % of values (m, k), shape (k,) each."""
        order = np.argsort(values, axis=0)
        total = np.cumsum(self.weights[order], axis=0) - self.weights[order] / 2
        low, high = np.transpose([
            np.interp([0.025, 0.975], total[:, k], values[order[:, k], k]) for k in range(values.shape[1])
        ])  # fmt: skip
        return values[0] + self.weights @ (values - values[0]), low, high


def pool(parts: list[Posterior]) -> Posterior:
    """Return several posteriors of a touch as one."""
    columns = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Posterior(*columns)._replace(weights=np.concatenate([part.weights for part in parts]) / len(parts))


class Drawn(NamedTuple):
    """Normal numbers (m, d), factors that make a t-distribution of them (m,), and uniform numbers (m,)."""

    normal: FloatArray
    tails: FloatArray
    uniform: FloatArray


@cache
def _draw(size: int, power: int) -> Drawn:
    uniform = qmc.Sobol(size + 2, seed=0).random_base2(power)
    return Drawn(ndtri(uniform[:, :size]), np.sqrt(TAILS / chdtri(TAILS, uniform[:, -2])), uniform[:, -1])


class Proposal(NamedTuple):
    """Mixture of k t-distributions: weights (k,), means (k, d) and roots of the covariance (k, d, d)."""

    weights: FloatArray
    means: FloatArray
    roots: FloatArray


class Fit(NamedTuple):
    """Touches at m points with their forces by least squares, and how they fit a frame.

    Attributes:
        places: Places from the point above the texel of the chart, shape (m, 2) [m].
        radii: Radii, shape (m,) [m].
        linear: Force, followed by force times ellipticities if the radius is unknown, shape (m, l) [N].
        logs: Logarithms of the volume of the forces, times the density of their shape given the force, and of the
            likelihood, shape (m, 2) [-].
        residual: Deviations of the texels in standard deviations, shape (m, s); 0 where dark and saturated ones agree.
        forces: Force on each texel, shape (m, s) [N].
    """

    places: FloatArray
    radii: FloatArray
    linear: FloatArray
    logs: FloatArray
    residual: FloatArray
    forces: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """A frame, and the touches that may have made it.

    Attributes:
        chart: Texel forces of these touches.
        channel: Noise and electronics.
        reading: Reading of all texels, shape (1, n) [N].
        seen: Indices of the s texels that count, the first ones in the order of the chart.
        most: Largest force [N].
        others: Force of other touches on each texel, shape (n,) [N].
    """

    chart: Chart
    channel: Channel
    reading: Reading
    seen: IntArray
    most: float
    others: FloatArray

    @cached_property
    def ends(self) -> FloatArray:
        """Least and largest place, and radius unless it is known, shape (2, d) [m]."""
        ends, radii = np.array([self.chart.low, self.chart.high]), self.chart.radii
        return ends if len(radii) == 1 else np.column_stack([ends, radii[[0, -1]]])

    @cached_property
    def rows(self) -> int:
        """Number of linear parameters: the force and, if the radius is unknown, two ellipticities."""
        return 3 if len(self.chart.radii) > 1 else 1

    @property
    def size(self) -> int:
        """Number of parameters [-]."""
        return int(self.ends.shape[1]) + self.rows

    @property
    def free(self) -> int:
        """Number of lit texels less that of the parameters [-]."""
        return int((self._texels[1] > 0).sum()) - self.size

    @property
    def misfit(self) -> float:
        """Sum of squared deviations of the texels from the most likely touch, over their variance [-].

        It includes dark texels whose force by this touch is above the threshold.
        """
        return float((self._settled[2].residual[0] ** 2).sum())

    @property
    def explained(self) -> FloatArray:
        """Texel forces of the most likely touch, shape (n,) [N]."""
        return np.asarray(self._spread(self._settled[2].forces[:1])[0])

    def sample(self) -> Posterior:
        """Draw points of the posterior.

        The likelihood is raised to one over the misfit per degree of freedom, at most 1 (Birge, Physical Review 40,
        1932), or less: a frame that is explained less well than the noise lets expect tells less.
        """
        best, root, _ = self._settled
        power = min(1.0, self.free / self.misfit) if self.free > 0 and self.misfit > 0 else 1.0
        power /= 1 + _SYSTEMATIC * (1 - power)
        known = self.free > 0  # With fewer lit texels the posterior is never close to normal.
        proposal = Proposal(np.ones(1), best[None], WIDENED / np.sqrt(power) * root[None]) if known else None
        for attempt in range(_DRAWS):
            proposal = proposal or self._adapt(power)
            z, fit, weights, counted = self._draw(proposal, power)
            if counted > _SETTLED * len(z):
                break
            proposal = None if known and not attempt else Proposal(*find_clusters(z, weights))
        askew = _ASKEW * fit.radii[:, None] * _draw(self.size + 2, _LAST).normal[:, -2:] if self.rows > 1 else 0.0
        return Posterior(fit.places + askew, fit.radii, fit.linear[:, 0], self._spread(fit.forces), weights)

    def _adapt(self, power: float) -> Proposal:
        """Follow the likelihood from the prior on, as its power grows."""
        size, raised = self.ends.shape[1], 0.0
        z, odds = self._look[0], np.zeros(1 << _LOOKED + size)
        fit = self._fit(z, power)
        for _ in range(_ROUNDS):
            likely = fit.logs[:, 1] + fit.logs[:, 0] / power
            raised = raise_power(likely, odds, raised, power, _RAISED * len(z))
            weights, counted = weigh(raised * likely + odds)
            proposal = Proposal(*find_clusters(z, weights))
            if raised == power and counted > _SETTLED * len(z):
                break
            z, odds = draw_mixture(*proposal, *_draw(size, _DRAWN))
            fit = self._fit(z, power)
        return proposal

    def _draw(self, proposal: Proposal, power: float) -> tuple[FloatArray, Fit, FloatArray, float]:
        """Draw points and forces, weigh them, and count them."""
        drawn = _draw(self.size + 2, _LAST)
        z, odds = draw_mixture(*proposal, *drawn)
        more = drawn.normal[:, -self.rows - 2 : -2]
        fit = self._fit(z, power, more)
        odds = odds + (more**2).sum(axis=1) / 2 + fit.logs[:, 0]
        force = fit.linear[:, 0]
        possible = (force >= np.hypot(*fit.linear[:, 1:].T) / LINE) & (force <= self.most)
        odds = np.where(possible, odds, -np.inf)
        return z, fit, *weigh(power * fit.logs[:, 1] + odds)

    @cached_property
    def _look(self) -> tuple[FloatArray, Fit]:
        """Points of the prior, and their fit."""
        z = _draw(self.ends.shape[1], _LOOKED + self.ends.shape[1]).normal
        return z, self._fit(z)

    def _spread(self, forces: FloatArray) -> FloatArray:
        """Return forces on the texels that count, shape (m, s), as forces on all of them, shape (m, n) [N]."""
        found = np.zeros((len(forces), len(self.others)))
        found[:, self.seen] = forces
        return found

    @cached_property
    def _settled(self) -> tuple[FloatArray, FloatArray, Fit]:
        """Find the most likely touch by Newton's method of least squares, a root of the covariance, and the fit."""
        size = self.ends.shape[1]
        z, fit = self._look
        best = z[np.argmax(fit.logs[:, 1] - (z**2).sum(axis=1) / 2)]
        aside = _ASIDE * np.eye(size)
        reached, last, step, root, kept = -np.inf, best, np.zeros(size), np.eye(size), fit
        for _ in range(_NEWTON):
            z = np.vstack([best, best + aside, best - aside])
            fit = self._fit(z)
            value = float(fit.logs[0, 1] - best @ best / 2)
            if value < reached - 1e-6:
                step = step / 4
            else:
                ended = value < reached + 1e-3
                reached, last, kept = value, best, fit
                slope = (fit.residual[1 : size + 1] - fit.residual[size + 1 :]) / (2 * _ASIDE)
                inverse = np.linalg.inv(slope @ slope.T + np.eye(size))
                root = np.linalg.cholesky(inverse)
                step = -inverse @ (slope @ fit.residual[0] + best)
                step = step * min(1.0, _LONGEST / max(float(np.abs(step).max()), _TINY))
                if ended:
                    break
            best = last + step
        return last, root, kept

    def _fit(self, z: FloatArray, power: float = 1.0, more: FloatArray | None = None) -> Fit:
        """Compute the touches at points (m, d), with forces some standard deviations (m, l) away from least squares.

        Args:
            z: The points.
            power: Power of the likelihood beside the prior of force and shape.
            more: The standard deviations; None for none.
        """
        values = self.ends[0] + (self.ends[1] - self.ends[0]) * ndtr(z)
        places = np.ascontiguousarray(values[:, :2])
        radii = values[:, 2].copy() if self.rows > 1 else np.full(len(z), self.chart.radii[0])
        aside = np.zeros((len(z), 3))
        if more is not None:
            aside[:, : self.rows] = more
        found = fit_touches(self.chart.arrays, self._texels, self.channel.noise, self.most, power, places, radii, aside)
        return Fit(places, radii, *found)

    @cached_property
    def _texels(self) -> FloatArray:
        """What each texel tells, shape (4, s), as `fit_touches` takes it."""
        low, high = (each[0, self.seen] for each in self.reading)
        inner, full, dark = np.isfinite(high - low), np.isfinite(low) & ~np.isfinite(high), np.isfinite(high)
        width, noise = np.where(inner, high - low, 0.0), self.channel.noise
        target = np.where(full, low, np.where(dark, high, 0.0)) - width / 2 - self.others[self.seen]
        weight = np.where(inner, 1 / (noise**2 + width**2 / 12), 0.0)
        return np.array([target, weight, np.where(full, -1.0, dark), np.where(width > 2 * noise, width / 2, 0.0)])
