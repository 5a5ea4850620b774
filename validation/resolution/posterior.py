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
from scipy.special import chdtri, logsumexp, ndtr, ndtri
from scipy.stats import qmc

from meshes.array_types import FloatArray, IntArray
from validation.resolution.channel import Channel, Reading
from validation.resolution.chart import Chart

#: Points as powers of two: of the first look, less the parameters, of a round, and of the result; most rounds [-].
_LOOKED, _DRAWN, _LAST, _ROUNDS = 5, 8, 9, 16
#: Share of points that count when the likelihood is raised, when the proposal has settled, and when it is poor [-].
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
    """Points drawn from the posterior of a touch.

    Attributes:
        search: The frame, and the touches that may have made it.
        places: Place from the point above the texel of the chart, shape (m, 2) [m].
        radii: Radius, shape (m,) [m].
        forces: Force, shape (m,) [N].
        weights: Weights, whose sum is one, shape (m,) [-].
        misfit: Sum of squared deviations of lit texels from the most likely touch, over their variance [-].
        explained: Texel forces of the most likely touch, shape (n,) [N].
    """

    search: Search
    places: FloatArray
    radii: FloatArray
    forces: FloatArray
    weights: FloatArray
    misfit: float
    explained: FloatArray

    def summarise(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the mean and the quantiles 2.5 % and 97.5 % of values (m, k), shape (k,) each."""
        order = np.argsort(values, axis=0)
        total = np.cumsum(self.weights[order], axis=0) - self.weights[order] / 2
        low, high = np.transpose([
            np.interp([0.025, 0.975], total[:, k], values[order[:, k], k]) for k in range(values.shape[1])
        ])  # fmt: skip
        return values[0] + self.weights @ (values - values[0]), low, high


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
        places: Places from the point above the texel of the chart, shape (m, 2) [m].
        radii: Radii, shape (m,) [m].
        linear: Force, followed by force times ellipticities if the radius is unknown, shape (m, l) [N].
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

    @property
    def forces(self) -> FloatArray:
        """Force on each texel, shape (m, s) [N]."""
        return np.asarray((self.linear[:, None] @ self.shares)[:, 0])

    @property
    def volume(self) -> FloatArray:
        """Logarithm of the volume of the forces, times that of the density of their shape given the force, (m,) [-]."""
        force = np.maximum(self.linear[:, :1], _TINY)
        shape = (self.linear[:, 1:] / (_OVAL * force)) ** 2 / 2 + np.log(force)
        return np.asarray(np.log(np.diagonal(self.factor, axis1=1, axis2=2)).sum(axis=1) - shape.sum(axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """A frame, and the touches that may have made it.

    Attributes:
        chart: Texel forces of these touches.
        channel: Noise and electronics.
        reading: Reading of all texels, shape (1, n) [N].
        seen: Indices of the s texels that count.
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
        return int((self._targets[1] > 0).sum()) - self.size

    def sample(self) -> Posterior:
        """Draw points of the posterior.

        The likelihood is raised to one over the misfit per degree of freedom, at most 1 (Birge, Physical Review 40,
        1932), or less: a frame that is explained less well than the noise lets expect tells less.
        """
        best, root, fit = self._settle()
        misfit, explained = float((fit.residual[0] ** 2).sum()), np.zeros(len(self.others))
        explained[self.seen] = fit.forces[0]
        power = min(1.0, self.free / misfit) if self.free > 0 and misfit > 0 else 1.0
        power /= 1 + _SYSTEMATIC * (1 - power)
        proposal = Proposal(np.ones(1), best[None], _WIDENED / np.sqrt(power) * root[None])
        for attempt in range(3):
            z, fit, weights = self._draw(proposal, power)
            counted = 1 / (weights**2).sum() / len(z)
            if counted > _SETTLED:
                break
            proposal = _cluster(z, weights) if counted > _POOR and attempt != 1 else self._adapt(power)
        return Posterior(self, fit.places, fit.radii, fit.linear[:, 0], weights, misfit, explained)

    def _adapt(self, power: float) -> Proposal:
        """Follow the likelihood from the prior on."""
        size, raised = self.ends.shape[1], 0.0
        proposal = Proposal(np.ones(1), np.zeros((1, size)), np.eye(size)[None])
        for _ in range(_ROUNDS):
            z, odds = proposal.draw(_draw(size, _DRAWN))
            fit = self._fit(z)
            likely = self._judge(fit) + fit.volume / power
            raised = _raise(likely, odds, raised, power)
            weights = _normalise(raised * likely + odds)
            proposal = _cluster(z, weights)
            if raised == power and 1 / (weights**2).sum() > _SETTLED * len(z):
                break
        return proposal

    def _draw(self, proposal: Proposal, power: float) -> tuple[FloatArray, Fit, FloatArray]:
        """Draw points and forces, and weigh them."""
        drawn = _draw(self.size, _LAST)
        z, odds = proposal.draw(drawn)
        fit, more = self._fit(z), drawn.normal[:, -self.rows :]
        fit = fit._replace(linear=fit.linear + (fit.factor @ more[..., None])[..., 0] / np.sqrt(power))
        odds = odds + (more**2).sum(axis=1) / 2 + fit.volume
        odds = np.where((fit.linear[:, 0] >= 0) & (fit.linear[:, 0] <= self.most), odds, -np.inf)
        return z, fit, _normalise(power * self._judge(fit) + odds)

    def _settle(self) -> tuple[FloatArray, FloatArray, Fit]:
        """Find the most likely touch by Newton's method of least squares, a root of the covariance, and the fit."""
        size = self.ends.shape[1]
        z = _draw(size, _LOOKED + size).normal
        fit = self._fit(z)
        best = z[np.argmax(self._judge(fit) - (z**2).sum(axis=1) / 2)]
        aside = _ASIDE * np.eye(size)
        reached, last, step, root, kept = -np.inf, best, np.zeros(size), np.eye(size), fit
        for _ in range(_NEWTON):
            z = np.vstack([best, best + aside, best - aside])
            fit = self._fit(z)
            value = float(self._judge(fit)[0] - best @ best / 2)
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

    def _fit(self, z: FloatArray) -> Fit:
        """Compute the touches at points (m, d)."""
        values = self.ends[0] + (self.ends[1] - self.ends[0]) * ndtr(z)
        places, radii = values[:, :2], values[:, 2] if self.rows > 1 else np.full(len(z), self.chart.radii[0])
        shares = self.chart.at(places, radii, self.seen)
        target, weight, beyond = self._targets
        lit, axis = weight > 0, np.eye(self.rows)
        wrong, linear = np.zeros((len(z), len(lit)), dtype=bool), self.most / 2 * np.ones((len(z), 1))
        for _ in range(_PASSES):
            weighted = shares * np.where(lit, weight, wrong / self.channel.noise**2)[:, None]
            precision = (_OVAL * np.maximum(linear[:, :1], 1e-3 * self.most)) ** -2 * np.ones(self.rows)
            precision[:, 0] = 12 / self.most**2
            normal = weighted @ shares.transpose(0, 2, 1) + precision[..., None] * axis
            inverse = np.linalg.inv(normal)
            linear = (inverse @ (weighted @ target + 6 / self.most * axis[0])[..., None])[..., 0]
            linear[:, 0] = np.clip(linear[:, 0], 0, self.most)
            apart = (linear[:, None] @ shares)[:, 0] - target
            before, wrong = wrong, ~lit & (beyond * apart > 0)
            if self.rows == 1 and (wrong == before).all():
                break
        residual = np.sqrt(np.where(lit, weight, wrong / self.channel.noise**2)) * apart
        return Fit(places, radii, linear, shares, np.linalg.cholesky(inverse), residual)

    def _judge(self, fit: Fit) -> FloatArray:
        """Compute the logarithm of the likelihood of the frame, shape (m,)."""
        forces = fit.forces + self.others[self.seen]
        return np.asarray(self.channel.log_likelihood(self.reading, forces, self.seen)[0])

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
