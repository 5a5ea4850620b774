"""Variance components of linear problems: closed forms, and planted variances inside their own uncertainty."""

import numpy as np
import pytest

from validation.calibration.uncertainty import estimate_components


def group(count, size):
    """Factor matrix of `count` groups of `size` observations in a row."""
    return np.kron(np.eye(count), np.ones((size, 1)))


def test_a_balanced_one_way_layout_gives_the_mean_squares_of_the_analysis_of_variance():
    """Mean squares B between and W within m groups of n give the variances (B - W) / n and W, and their covariance."""
    m, n = 7, 5
    random = np.random.default_rng(1)
    factor = group(m, n)
    values = 3 + factor @ random.normal(0, 2, m) + random.normal(0, 1, m * n)
    means = values.reshape(m, n).mean(axis=1)
    between = n * means.var(ddof=1)
    within = np.sum((values - factor @ means) ** 2) / (m * (n - 1))
    found, spread = estimate_components(values, np.ones((m * n, 1)), (factor,), least=1e-6)
    assert found == pytest.approx([(between - within) / n, within], rel=1e-4)
    of_between, of_within = 2 * between**2 / (m - 1), 2 * within**2 / (m * (n - 1))
    covariance = [[(of_between + of_within) / n**2, -of_within / n], [-of_within / n, of_within]]
    np.testing.assert_allclose(spread, covariance, rtol=1e-3)


@pytest.mark.slow
def test_planted_variances_of_two_crossed_factors_are_found_within_their_uncertainty():
    """Recordings with weights as of counts, and texels common to recordings; four parameters take part of both."""
    random = np.random.default_rng(2)
    count, texels, draws = 24, 15, 60
    level = random.uniform(1, 10, (count, texels)).ravel()
    recordings = level[:, None] * group(count, texels)
    seats = np.vstack([np.kron(np.eye(4)[k % 4], np.eye(texels)) for k in range(count)])
    design = np.column_stack([level, np.ones(level.size), *random.normal(size=(2, level.size))])
    planted = np.array([0.1, 0.5, 0.3]) ** 2
    found, errors = [], []
    for _ in range(draws):
        effects = [
            random.normal(0, sd, size) for sd, size in zip(planted**0.5, (count, 4 * texels, level.size), strict=True)
        ]
        values = recordings @ effects[0] + seats @ effects[1] + effects[2] + design @ random.normal(0, 9, 4)
        variances, spread = estimate_components(values, design, (recordings, seats), least=1e-6)
        found.append(variances)
        errors.append(np.diag(spread))
    expected = np.mean(errors, axis=0) ** 0.5
    assert (np.abs(np.mean(found, axis=0) - planted) < 3 * expected / draws**0.5).all()
    assert np.std(found, axis=0) == pytest.approx(expected, rel=0.3)
    assert (expected < 0.4 * planted).all()


def test_a_variance_that_the_parameters_take_up_is_zero_and_the_others_do_not_change():
    random = np.random.default_rng(3)
    factor, other = group(6, 8), np.tile(np.eye(8), (6, 1))
    values = factor @ random.normal(0, 2, 6) + other @ random.normal(0, 5, 8) + random.normal(0, 1, 48)
    found, spread = estimate_components(values, other, (factor, other), least=1e-6)
    alone, alone_spread = estimate_components(values, other, (factor,), least=1e-6)
    assert found[1] == 0
    assert (spread[1] == 0).all()
    assert found[[0, 2]] == pytest.approx(alone, rel=1e-6)
    np.testing.assert_allclose(spread[np.ix_([0, 2], [0, 2])], alone_spread, rtol=1e-6)


def test_observations_that_the_parameters_describe_leave_the_least_variance():
    found, spread = estimate_components(np.arange(4.0), np.eye(4), (group(2, 2),), least=0.25)
    assert found.tolist() == [0, 0.25]
    assert np.isfinite(spread).all()
