"""Mixtures of t-distributions: drawing, weighing, and description of weighted points by clusters."""

# mypy: disable-error-code="no-untyped-def,no-untyped-call,untyped-decorator"
# ruff: noqa: ANN001, ANN201, ANN202, PLR0917 -- arrays, whose types numba finds; it takes no keywords
# Compiled functions are loops: numba takes several times as long to compile operations on arrays.

from __future__ import annotations

import math

import numba
import numpy as np

from meshes.array_types import FloatArray

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
    z, logs, apart = np.zeros((len(normal), size)), np.zeros(len(normal)), np.zeros(size)
    for point in range(len(z)):
        k = min(np.searchsorted(sums, uniform[point]), count - 1)
        density = 0.0
        for i in range(size):
            z[point, i] = means[k, i]
            for j in range(i + 1):
                z[point, i] += tails[point] * roots[k, i, j] * normal[point, j]
            logs[point] -= z[point, i] ** 2 / 2
        for k in range(count):
            scale, square = shares[k], 0.0
            for i in range(size):
                apart[i] = z[point, i] - means[k, i]
                for j in range(i):
                    apart[i] -= roots[k, i, j] * apart[j]
                apart[i] /= roots[k, i, i]
                scale, square = scale / roots[k, i, i], square + apart[i] ** 2
            density += scale * (1 + square / TAILS) ** (-(TAILS + size) / 2)
        logs[point] -= math.log(density)
    return z, logs


@numba.njit(cache=True)
def weigh(logarithms):
    """Return weights of their logarithms, shape (m,), whose sum is one, and the number of points that count."""
    most, total, squared, weights = -np.inf, 0.0, 0.0, np.zeros(len(logarithms))
    for logarithm in logarithms:
        most = max(most, logarithm)
    for k in range(len(weights)):
        weights[k] = math.exp(logarithms[k] - most)
        total, squared = total + weights[k], squared + weights[k] ** 2
    for k in range(len(weights)):
        weights[k] /= total
    return weights, total**2 / squared


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
def _find_nearest(points, centres):
    """Return the number of the centre (k, d) nearest to each point (m, d)."""
    nearest = np.zeros(len(points), np.int64)
    for i in range(len(points)):
        least = np.inf
        for k in range(len(centres)):
            apart = 0.0
            for j in range(points.shape[1]):
                apart += (points[i, j] - centres[k, j]) ** 2
            if apart < least:
                least, nearest[i] = apart, k
    return nearest


def find_clusters(z: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Describe weighted points (m, d) by a few clusters (Lloyd's algorithm), so that bent posteriors are followed.

    Returns:
        Weights, means and roots as `draw_mixture` takes them.
    """
    size, mean = z.shape[1], weights @ z
    apart = z - mean
    products = (apart[:, :, None] * apart[:, None]).reshape(len(z), -1)
    tiny = _TINY * np.eye(size)
    whole = (weights @ products).reshape(size, size) + tiny
    white = np.linalg.solve(np.linalg.cholesky(whole), apart.T).T
    order = np.argsort(white[:, 0])
    parts = np.searchsorted(np.cumsum(weights[order]), (np.arange(_CLUSTERS) + 0.5) / _CLUSTERS)
    centres = white[order[np.minimum(parts, len(z) - 1)]]
    for _ in range(_PASSES):
        member = weights * (_find_nearest(white, centres) == np.arange(len(centres))[:, None])
        share = member.sum(axis=1)
        part = member[share > 0] / share[share > 0, None]
        centres, share = part @ white, share[share > 0]
    means = part @ apart
    covariance = (part @ products).reshape(-1, size, size) - means[:, :, None] * means[:, None]
    trust = (1 / (1 + size * (part**2).sum(axis=1)))[:, None, None]
    covariance = trust * covariance + (1 - trust) / len(share) * whole + tiny
    return (share + 0.02) / (share + 0.02).sum(), mean + means, WIDENED * np.linalg.cholesky(covariance)
