"""Mixtures of t-distributions against the densities of scipy, and their clusters against laws of moments."""

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, multivariate_t

from validation.resolution.mixture import draw_mixture, find_clusters, raise_power, weigh

SHARES = np.array([0.2, 0.5, 0.3])
MEANS = np.array([[0.0, 1.0, -1.0], [2.0, -0.5, 0.3], [-1.5, 0.2, 0.8]])
ROOTS = np.array([
    [[0.5, 0, 0], [0.2, 0.7, 0], [-0.1, 0.3, 0.4]], [[1.1, 0, 0], [-0.4, 0.6, 0], [0.2, 0.1, 0.9]],
    [[0.3, 0, 0], [0.1, 0.2, 0], [0.0, -0.2, 0.5]],
])  # fmt: skip


def test_points_and_densities_are_those_of_t_distributions_of_eight_degrees_of_freedom():
    random = np.random.default_rng(3)
    normal, uniform = random.normal(size=(40, 5)), np.r_[random.uniform(size=38), 0.2 - 1e-9, 1.0]
    tails = random.uniform(0.5, 2, 40)
    z, logs = draw_mixture(SHARES, MEANS, ROOTS, normal, tails, uniform)
    part = np.minimum((uniform[:, None] > np.cumsum(SHARES)).sum(axis=1), 2)
    expected = MEANS[part] + tails[:, None] * np.einsum("mij,mj->mi", ROOTS[part], normal[:, :3])
    np.testing.assert_allclose(z, expected, atol=1e-12)
    densities = [
        np.log(share) + multivariate_t(mean, root @ root.T, df=8).logpdf(z)
        for share, mean, root in zip(SHARES, MEANS, ROOTS, strict=True)
    ]
    odds = multivariate_normal(np.zeros(3)).logpdf(z) - logsumexp(densities, axis=0)
    np.testing.assert_allclose(logs - logs[0], odds - odds[0], atol=1e-9)  # constants do not count


def test_weights_are_shares_of_one_and_their_number_that_of_kish():
    logarithms = np.array([-1000.0, -1001.0, -1002.5, -1000.2])
    weights, count = weigh(logarithms)
    expected = np.exp(logarithms + 1000)
    expected /= expected.sum()
    np.testing.assert_allclose(weights, expected)
    assert count == pytest.approx(1 / (expected**2).sum())
    assert weigh(np.full(7, 3.0))[1] == pytest.approx(7)


def test_a_likelihood_is_raised_to_the_power_at_which_enough_points_count():
    likely, odds = -np.linspace(0, 60, 200), np.random.default_rng(2).normal(0, 0.1, 200)

    def count(power):
        weights = np.exp(power * likely + odds - (power * likely + odds).max())
        return weights.sum() ** 2 / (weights**2).sum()

    found = raise_power(likely, odds, 0.0, 1.0, 50.0)
    assert 0 < found < 1
    assert count(found) > 50
    assert count(1.01 * found) < 50
    assert raise_power(likely, odds, 0.0, 0.5 * found, 50.0) == 0.5 * found
    assert raise_power(likely, odds, 0.3, 1.0, 199.9) == 0.3
    assert raise_power(likely, odds, 0.3, 1.0, count(1.0) - 1e-6) == 1.0


def find_shares(given):
    """Shares of the points in each cluster, to which a little was added so that none is forgotten."""
    return given * (1 + 0.02 * len(given)) - 0.02


def test_clusters_have_the_moments_of_their_points():
    """By the law of total covariance; means are exact, covariances are widened by 1.1."""
    random = np.random.default_rng(7)
    z = random.normal(size=(4000, 2)) * [3.0, 0.2]
    z[:, 1] += 0.1 * z[:, 0] ** 2  # a bent set
    weights = random.uniform(0.5, 1.5, 4000)
    weights /= weights.sum()
    given, means, roots = find_clusters(z, weights)
    shares = find_shares(given)
    assert given.sum() == pytest.approx(1)
    assert shares.sum() == pytest.approx(1)
    assert (shares > 0.02).all()
    np.testing.assert_allclose(shares @ means, weights @ z, atol=1e-9)
    inner = (roots @ roots.swapaxes(1, 2)) / 1.1**2
    apart = means - weights @ z
    total = np.einsum("k,kij->ij", shares, inner + apart[:, :, None] * apart[:, None])
    np.testing.assert_allclose(total, np.cov(z.T, aweights=weights, ddof=0), rtol=0.02)
    assert (np.triu(roots[:, :, :], 1) == 0).all()
    # clusters follow the bend: their own covariances are far smaller than that of all points
    assert np.median(inner[:, 0, 0]) < 0.1 * np.var(z[:, 0])


def test_the_members_of_far_groups_are_not_mixed():
    random = np.random.default_rng(1)
    centres = np.array([[-50.0, 0.0], [50.0, 10.0]])
    z = np.concatenate([centre + random.normal(0, 0.5, (300, 2)) for centre in centres])
    weights = np.r_[np.full(300, 0.25), np.full(300, 0.75)] / 300
    given, means, roots = find_clusters(z, weights)
    left = means[:, 0] < 0
    assert find_shares(given)[left].sum() == pytest.approx(0.25)
    assert np.abs(means[left] - centres[0]).max() < 2
    assert np.abs(means[~left] - centres[1]).max() < 2
    # a cluster of n points of equal weight is trusted by n / (n + 2), and takes the rest from all points
    whole = np.cov(z.T, aweights=weights, ddof=0)
    for mean, root, share in zip(means, roots, find_shares(given), strict=True):
        count = share / (0.25 if mean[0] < 0 else 0.75) * 300
        trust = 1 / (1 + 2 / count)
        assert ((root @ root.T)[0, 0] / 1.21) == pytest.approx((1 - trust) / len(given) * whole[0, 0], abs=0.5)


def test_one_point_that_has_all_weight_keeps_a_narrow_cluster():
    z = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 7.0]])
    shares, means, roots = find_clusters(z, np.array([0.0, 1.0, 0.0]))
    assert shares.sum() == pytest.approx(1)
    np.testing.assert_allclose(means, np.broadcast_to([3.0, 4.0], means.shape))
    assert (np.abs(roots) < 1e-5).all()
    assert (np.diagonal(roots, axis1=1, axis2=2) > 0).all()
