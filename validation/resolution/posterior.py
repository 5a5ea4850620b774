"""The posterior of touches given one frame: places, forces and radii, as drawn points with weights.

The prior is uniform over a box around a texel for each touch, over its radius, and over its force.  Places and radii
are sampled as normal numbers z, whose distribution function spans the box.  The forces, in which the frame is linear,
are drawn around their weighted least squares.  Points are drawn from a t-distribution at the most likely touch; where
it does not fit, from clusters that follow a likelihood raised to a growing power, from the prior on (Neal, Annealed
importance sampling, 2001; Cappe et al., Population Monte Carlo, 2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, logsumexp, ndtr, ndtri
from scipy.stats import qmc

from meshes.array_types import BoolArray, FloatArray, IntArray
from validation.resolution.channel import Channel, Reading
from validation.resolution.chart import Chart

#: Points as powers of two: of the first look and its most, of a round, and of the result; largest number of rounds [-].
_LOOKED, _MOST_LOOKED, _DRAWN, _LAST, _ROUNDS = 7, 10, 8, 9, 16
#: Share of points that count when the likelihood is raised, and when the proposal has settled [-].
_RAISED, _SETTLED, _POOR = 0.15, 0.25, 0.03
#: Degrees of freedom of proposals, their widening, and number of clusters [-].
_TAILS, _WIDENED, _CLUSTERS = 8, 1.1, 8
#: Steps toward the most likely touch, their largest length, and step of difference quotients, in normal numbers [-].
_NEWTON, _LONGEST, _ASIDE = 12, 0.7, 0.01
#: Standard deviation of the ellipticities of a touch of unknown shape [-].
_OVAL = 0.5
#: Growth of the variance by a misfit that is not noise, besides that by its size [-].
_SYSTEMATIC = 3.0
#: Passes in which dark and saturated texels that the forces contradict join the least squares [-].
_PASSES = 3
#: Smallest variance of a proposal in normal numbers [-].
_TINY = 1e-12


class Posterior(NamedTuple):
    """Points drawn from a posterior of N touches.

    Attributes:
        places: Place of each touch from the point above the texel of its chart, shape (m, N, 2) [m].
        radii: Radius of each touch, shape (m, N) [m].
        forces: Forces, shape (m, N) [N].
        weights: Weights, whose sum is one, shape (m,) [-].
        misfit: Sum of squared deviations of lit texels from the most likely touch, over their variance [-].
        likely: Logarithm of the likelihood there [-].
        explained: Texel forces there, shape (s,) [N].
    """

    places: FloatArray
    radii: FloatArray
    forces: FloatArray
    weights: FloatArray
    misfit: float
    likely: float
    explained: FloatArray

    def summarise(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return mean, standard deviation and the quantiles 2.5 % and 97.5 % of values (m, k), shape (k,) each."""
        mean = self.weights @ values
        order = np.argsort(values, axis=0)
        total = np.cumsum(self.weights[order], axis=0) - self.weights[order] / 2
        low, high = np.transpose([
            np.interp([0.025, 0.975], total[:, k], values[order[:, k], k]) for k in range(values.shape[1])
        ])  # fmt: skip
        return mean, np.sqrt(self.weights @ (values - mean) ** 2), low, high


class Drawn(NamedTuple):
    """Normal numbers (m, d), factors that make a t-distribution of them (m,), and uniform numbers (m,)."""

    normal: FloatArray
    tails: FloatArray
    uniform: FloatArray


@cache
def _draw(size: int, power: int) -> Drawn:
    uniform = qmc.Sobol(size + 2, seed=0).random_base2(power)
    return Drawn(ndtri(uniform[:, :size]), np.sqrt(_TAILS / chdtri(_TAILS, uniform[:, -2])), uniform[:, -1])


class Proposal(NamedTuple):
    """Mixture of k t-distributions: weights (k,), means (k, d) and roots of the covariance (k, d, d)."""

    weights: FloatArray
    means: FloatArray
    roots: FloatArray

    def draw(self, drawn: Drawn) -> tuple[FloatArray, FloatArray]:
        """Return points (m, d), and the logarithm of the normal distribution over the density there (m,)."""
        size = self.means.shape[1]
        which = np.minimum(np.searchsorted(np.cumsum(self.weights), drawn.uniform), len(self.weights) - 1)
        z = self.means[which] + (self.roots[which] @ (drawn.normal[:, :size] * drawn.tails[:, None])[..., None])[..., 0]
        inverse = np.linalg.inv(self.roots)
        apart = ((inverse @ z.T - inverse @ self.means[..., None]) ** 2).sum(axis=1)
        scale = np.log(self.weights) - np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(axis=1)
        density = logsumexp(scale[:, None] - (_TAILS + size) / 2 * np.log1p(apart / _TAILS), axis=0)
        return z, -(z**2).sum(axis=1) / 2 - density


class Fit(NamedTuple):
    """Touches at m points with their forces by least squares, and how they fit a frame.

    Attributes:
        places, radii, forces: As of `Posterior`.
        linear: Force of each touch, followed by force times ellipticities if the radius is unknown, shape (m, l) [N].
        shares: Force on each texel per unit of these, shape (m, l, s) [-].
        factor: Root of their covariance, shape (m, l, l) [N].
        residual: Deviations of the texels in standard deviations, shape (m, s); 0 where dark and saturated ones agree.
    """

    places: FloatArray
    radii: FloatArray
    linear: FloatArray
    shares: FloatArray
    factor: FloatArray
    residual: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """A frame, and the touches that may have made it.

    Attributes:
        charts: Chart of each of N touches.
        channel: Noise and electronics.
        reading: Reading of all texels, shape (1, n) [N].
        seen: Indices of the s texels that count.
        most: Largest force of a touch [N].
        others: Force of other touches on each texel, shape (n,) [N].
        known: Force of each touch if it is known [N].
    """

    charts: tuple[Chart, ...]
    channel: Channel
    reading: Reading
    seen: IntArray
    most: float
    others: FloatArray
    known: float | None = None

    @cached_property
    def ends(self) -> FloatArray:
        """Least and largest places of all touches, and their radii unless they are known, shape (2, d) [m]."""
        ends = [np.concatenate([getattr(chart, end) for chart in self.charts]) for end in ("low", "high")]
        radii, several = self.charts[0].radii, len(self.charts)
        if len(radii) == 1:
            return np.array(ends)
        return np.array([np.append(ends[0], [radii[0]] * several), np.append(ends[1], [radii[-1]] * several)])

    def sample(self, power: float | None = None) -> Posterior:
        """Draw points of the posterior.

        Args:
            power: Power of the likelihood; None for one over the misfit per degree of freedom, at most 1 (Birge,
                Physical Review 40, 1932): a frame that is explained less well than the noise lets expect tells less.
        """
        best, root = self._settle()
        at_best = self._fit(best[None])
        misfit, likely = float((at_best.residual**2).sum()), float(self._judge(at_best)[0])
        if power is None:
            power = min(1.0, self.free / misfit) if self.free > 0 and misfit > 0 else 1.0
            power /= 1 + _SYSTEMATIC * (1 - power)
        proposal = Proposal(np.ones(1), best[None], _WIDENED / np.sqrt(power) * root[None])
        for attempt in range(3):
            z, places, radii, forces, weights = self._draw(proposal, power)
            counted = 1 / (weights**2).sum() / len(z)
            if counted > _SETTLED:
                break
            proposal = _cluster(z, weights) if counted > _POOR and attempt != 1 else self._adapt(power)
        return Posterior(
            places, radii, forces, weights, misfit, likely, (at_best.linear[:, None] @ at_best.shares)[0, 0]
        )

    @property
    def rows(self) -> int:
        """Number of linear parameters of a touch: the force and, if the radius is unknown, two ellipticities."""
        return 3 if len(self.charts[0].radii) > 1 else 1

    @property
    def lit(self) -> BoolArray:
        """Which of the texels `seen` tell a force, shape (s,)."""
        return self._targets[1] > 0

    @property
    def level(self) -> FloatArray:
        """Force that each of the texels `seen` tells, shape (s,) [N]."""
        return self._targets[0]

    @property
    def size(self) -> int:
        """Number of parameters [-]."""
        return int(self.ends.shape[1]) + self.rows * len(self.charts)

    @property
    def free(self) -> int:
        """Number of lit texels less that of the parameters [-]."""
        return int(self.lit.sum()) - self.size

    def _adapt(self, power: float) -> Proposal:
        """Follow the likelihood from the prior on."""
        size, raised = self.ends.shape[1], 0.0
        proposal = Proposal(np.ones(1), np.zeros((1, size)), np.eye(size)[None])
        for _ in range(_ROUNDS):
            z, odds = proposal.draw(_draw(size, _DRAWN))
            fit = self._fit(z)
            likely = self._judge(fit) + (_log_volume(fit.factor) + self._weigh_shape(fit.linear)) / power
            raised = _raise(likely, odds, raised, power)
            weights = _normalise(raised * likely + odds)
            proposal = _cluster(z, weights)
            if raised == power and 1 / (weights**2).sum() > _SETTLED * len(z):
                break
        return proposal

    def _weigh_shape(self, linear: FloatArray) -> FloatArray:
        """Compute the logarithm of the density of force times ellipticities, which are normal, given the force (m,)."""
        if self.rows == 1:
            return np.zeros(len(linear))
        parts = linear.reshape(len(linear), -1, self.rows)
        forces = np.maximum(parts[..., :1], _TINY)
        return np.asarray((-((parts[..., 1:] / (_OVAL * forces)) ** 2) / 2 - np.log(forces)).sum(axis=(1, 2)))

    def _draw(self, proposal: Proposal, power: float) -> tuple[FloatArray, ...]:
        """Draw points and forces, and weigh them."""
        several = len(self.charts) * self.rows
        drawn = _draw(self.ends.shape[1] + several, _LAST)
        z, odds = proposal.draw(drawn)
        fit = self._fit(z)
        if self.known is None:
            more = drawn.normal[:, -several:]
            fit = fit._replace(linear=fit.linear + (fit.factor @ more[..., None])[..., 0] / np.sqrt(power))
            odds = odds + (more**2).sum(axis=1) / 2 + _log_volume(fit.factor) + self._weigh_shape(fit.linear)
        forces = fit.linear[:, :: self.rows]
        odds = np.where(((forces >= 0) & (forces <= self.most)).all(axis=1), odds, -np.inf)
        weights = _normalise(power * self._judge(fit) + odds)
        return z, fit.places, fit.radii, forces, weights

    def _settle(self) -> tuple[FloatArray, FloatArray]:
        """Find the most likely touch by Newton's method of least squares, and a root of the covariance there."""
        size = self.ends.shape[1]
        z = _draw(size, min(_LOOKED + size - 2, _MOST_LOOKED)).normal
        best = z[np.argmax(self._judge(self._fit(z)) - (z**2).sum(axis=1) / 2)]
        aside = _ASIDE * np.eye(size)
        reached, last, step = -np.inf, best, np.zeros(size)
        root = np.eye(size)
        for _ in range(_NEWTON):
            z = np.vstack([best, best + aside, best - aside])
            fit = self._fit(z)
            value = float(self._judge(fit)[0] - best @ best / 2)
            if value < reached - 1e-6:
                step = step / 4
            else:
                ended = value < reached + 1e-3
                reached, last = value, best
                slope = (fit.residual[1 : size + 1] - fit.residual[size + 1 :]) / (2 * _ASIDE)
                inverse = np.linalg.inv(slope @ slope.T + np.eye(size))
                root = np.linalg.cholesky(inverse)
                step = -inverse @ (slope @ fit.residual[0] + best)
                step = step * min(1.0, _LONGEST / max(float(np.abs(step).max()), _TINY))
                if ended:
                    break
            best = last + step
        return last, root

    def _fit(self, z: FloatArray) -> Fit:
        """Compute the touches at points (m, d)."""
        values = self.ends[0] + (self.ends[1] - self.ends[0]) * ndtr(z)
        several = len(self.charts)
        places = values[:, : 2 * several].reshape(-1, several, 2)
        known = np.broadcast_to(self.charts[0].radii[0], places.shape[:2])
        radii = values[:, 2 * several :] if self.rows > 1 else known
        shares = np.concatenate([c.at(places[:, k], radii[:, k], self.seen) for k, c in enumerate(self.charts)], axis=1)
        target, weight, beyond = self._targets
        lit, size = weight > 0, shares.shape[1]
        wrong = np.zeros((len(z), len(lit)), dtype=bool)
        linear = np.full((len(z), size), self.most / 2 if self.known is None else self.known)
        precision = np.empty((len(z), size))
        middle = np.where(np.arange(size) % self.rows == 0, 6 / self.most, 0.0)
        factor = np.zeros((len(z), size, size))
        for _ in range(_PASSES):
            w = np.where(lit, weight, wrong / self.channel.noise**2)
            if self.known is None:
                forces = np.maximum(linear[:, :: self.rows], 1e-3 * self.most)
                precision[:] = np.repeat((_OVAL * forces) ** -2, self.rows, axis=1)
                precision[:, :: self.rows] = 12 / self.most**2
                weighted = shares * w[:, None]
                normal = weighted @ shares.transpose(0, 2, 1) + precision[..., None] * np.eye(size)
                inverse = 1 / normal if size == 1 else np.linalg.inv(normal)
                right = (weighted @ target[:, None])[..., 0] + middle
                linear = (inverse @ right[..., None])[..., 0]
                linear[:, :: self.rows] = np.clip(linear[:, :: self.rows], 0, self.most)
            apart = (linear[:, None] @ shares)[:, 0] - target
            wrong = ~lit & (beyond * apart > 0)
        if self.known is None:
            factor = np.sqrt(inverse) if size == 1 else np.linalg.cholesky(inverse)
        residual = np.sqrt(np.where(lit, weight, wrong / self.channel.noise**2)) * apart
        return Fit(places, radii, linear, shares, factor, residual)

    def _judge(self, fit: Fit) -> FloatArray:
        """Compute the logarithm of the likelihood of the frame, shape (m,)."""
        forces = (fit.linear[:, None] @ fit.shares)[:, 0]
        return np.asarray(self.channel.log_likelihood(self.reading, forces + self.others[self.seen], self.seen)[0])

    @cached_property
    def _targets(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Force that each texel tells (s,) [N], one over its variance, and the sign of forces that contradict it.

        A dark or saturated texel tells the edge, and has no variance.
        """
        low, high = (each[0, self.seen] for each in self.reading)
        inner, full = np.isfinite(high - low), np.isposinf(high)
        width = np.where(inner, high - low, 0.0)
        target = np.where(full, low, high) - width / 2 - self.others[self.seen]
        return target, np.where(inner, 1 / (self.channel.noise**2 + width**2 / 12), 0.0), np.where(full, -1.0, 1.0)


def _log_volume(factor: FloatArray) -> FloatArray:
    return np.asarray(np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1))


def _raise(likely: FloatArray, odds: FloatArray, least: float, most: float) -> float:
    """Return the largest power of the likelihood between two at which enough points count; `least` if there is none."""

    def counts(power: float) -> bool:
        weights = _normalise(power * likely + odds)
        return bool(1 / (weights**2).sum() > _RAISED * len(odds))

    if counts(most):
        return most
    low, high = least, most
    for _ in range(12):
        middle = np.sqrt(max(low, 1e-7) * high)
        low, high = (middle, high) if counts(middle) else (low, middle)
    return low


def _cluster(z: FloatArray, weights: FloatArray) -> Proposal:
    """Describe weighted points (m, d) by a few clusters (Lloyd's algorithm), so that bent posteriors are followed."""
    size = z.shape[1]
    apart = z - weights @ z
    whole = (weights[:, None] * apart).T @ apart + _TINY * np.eye(size)
    white = apart @ np.linalg.inv(np.linalg.cholesky(whole)).T
    order = np.argsort(white[:, 0])
    parts = (np.arange(_CLUSTERS) + 0.5) / _CLUSTERS
    centres = white[order[np.minimum(np.searchsorted(np.cumsum(weights[order]), parts), len(z) - 1)]]
    for _ in range(4):
        near = np.argmin((centres**2).sum(axis=1) - 2 * white @ centres.T, axis=1)
        member = weights[:, None] * (near[:, None] == np.arange(len(centres)))
        member = member[:, member.sum(axis=0) > 0]
        share = member.sum(axis=0)
        centres = member.T @ white / share[:, None]
    means = member.T @ z / share[:, None]
    apart = (z - means[:, None]) * np.sqrt(member.T / share[:, None])[..., None]
    counted = share**2 / (member**2).sum(axis=0)
    trust = (counted / (counted + size))[:, None, None]
    covariance = trust * (apart.transpose(0, 2, 1) @ apart) + (1 - trust) * whole / len(share) + _TINY * np.eye(size)
    share = share + 0.02
    return Proposal(share / share.sum(), means, np.linalg.cholesky(_WIDENED**2 * covariance))


def _normalise(logarithms: FloatArray) -> FloatArray:
    weights = np.exp(logarithms - logarithms.max())
    return np.asarray(weights / weights.sum())
