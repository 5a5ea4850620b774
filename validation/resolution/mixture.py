"""Compiled mixtures of t-distributions: drawing, weighing, and description of weighted points by clusters."""

# mypy: disable-error-code="no-untyped-def,no-untyped-call,untyped-decorator"
# ruff: noqa: ANN001, ANN201, PLR0917 -- arrays, whose types numba finds; it takes no keywords

from __future__ import annotations

import math

import numba
import numpy as np

#: Degrees of freedom of proposals, their widening, number of clusters, and passes in which they are found [-].
TAILS, WIDENED, _CLUSTERS, _PASSES = 8, 1.1, 8, 4
#: Smallest variance of a proposal in normal numbers, and smallest power of a likelihood [-].
_TINY, _LEAST = 1e-12, 1e-7


@numba.njit(cache=True)
def draw_mixture(shares, means, roots, normal, tails, uniform):
    """Draw points of a mixture of k t-distributions.

    Args:
        shares: Weights, shape (k,) [-].
        means: Means, shape (k, d) [-].
        roots: Lower roots of the covariances, shape (k, d, d) [-].
        normal: Normal numbers, shape (m, d or more).
        tails: Factors that make a t-distribution of them, shape (m,).
        uniform: Uniform numbers, shape (m,).

    Returns:
        Points, shape (m, d), and the logarithm of the normal distribution over the density there, shape (m,).
    """
    (count, size), sums = means.shape, np.cumsum(shares)
    z, density = np.empty((len(normal), size)), np.zeros(len(normal))
    for point in range(len(z)):
        k = min(np.searchsorted(sums, uniform[point]), count - 1)
        for i in range(size):
            z[point, i] = means[k, i]
            for j in range(i + 1):
                z[point, i] += tails[point] * roots[k, i, j] * normal[point, j]
    for k in range(count):
        apart = (np.linalg.solve(roots[k], (z - means[k]).T.copy()) ** 2).sum(axis=0)
        scale = shares[k] / np.prod(np.diag(roots[k]))
        density += scale * (1 + apart / TAILS) ** (-(TAILS + size) / 2)
    return z, -(z**2).sum(axis=1) / 2 - np.log(density)


@numba.njit(cache=True)
def weigh(logarithms):
    """Return weights of their logarithms, shape (m,), whose sum is one, and the number of points that count."""
    weights = np.exp(logarithms - logarithms.max())
    weights /= weights.sum()
    return weights, 1 / (weights**2).sum()


@numba.njit(cache=True)
def raise_power(likely, odds, least, most, wanted):
    """Return the largest power of a likelihood between two at which enough points count; `least` if there is none."""
    if weigh(most * likely + odds)[1] > wanted:
        return most
    low, high = least, most
    for _ in range(12):
        middle = math.sqrt(max(low, _LEAST) * high)
        enough = weigh(middle * likely + odds)[1] > wanted
        low, high = (middle, high) if enough else (low, middle)
    return low


@numba.njit(cache=True)
def find_clusters(z, weights):
    """Describe weighted points (m, d) by a few clusters (Lloyd's algorithm), so that bent posteriors are followed.

    Returns:
        Weights, means and roots as `draw_mixture` takes them.
    """
    size, tiny, apart = z.shape[1], _TINY * np.eye(z.shape[1]), z - weights @ z
    whole = (weights * apart.T) @ apart + tiny
    white = np.linalg.solve(np.linalg.cholesky(whole), apart.T.copy()).T.copy()
    order = np.argsort(white[:, 0])
    parts = np.searchsorted(np.cumsum(weights[order]), (np.arange(_CLUSTERS) + 0.5) / _CLUSTERS)
    centres = white[order[np.minimum(parts, len(z) - 1)]]
    for _ in range(_PASSES):
        near = np.argmin((centres**2).sum(axis=1) - 2 * white @ centres.T, axis=1)
        member = weights.reshape(-1, 1) * (near.reshape(-1, 1) == np.arange(len(centres)))
        member = member[:, member.sum(axis=0) > 0].copy()
        share = member.sum(axis=0)
        centres = member.T.copy() @ white / share.reshape(-1, 1)
    means, roots = member.T.copy() @ z / share.reshape(-1, 1), np.empty((len(share), size, size))
    for k in range(len(share)):
        part, apart = member[:, k] / share[k], z - means[k]
        trust = 1 / (1 + size * (part**2).sum())
        covariance = trust * ((part * apart.T) @ apart) + (1 - trust) / len(share) * whole + tiny
        roots[k] = WIDENED * np.linalg.cholesky(covariance)
    return (share + 0.02) / (share + 0.02).sum(), means, roots
