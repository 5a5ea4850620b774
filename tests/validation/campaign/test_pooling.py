"""Means over cases, their intervals, and skill."""

import math

import numpy as np
import pytest

from validation.campaign.pooling import pool, skill


def test_pooling_covers_the_mean_and_skips_what_does_not_exist():
    values = [1.0, 2.0, 3.0, math.nan]
    pooled = pool(values)
    assert pooled.cases == 3
    assert pooled.low < pooled.mean == 2 < pooled.high
    assert pool(values) == pooled
    assert pool([math.nan]).cases == 0


def test_bootstrap_interval_has_about_its_coverage():
    rng = np.random.default_rng(1)
    hits = [abs_in(pool(rng.normal(size=30), resamples=400, level=0.9)) for _ in range(300)]
    assert 0.8 < np.mean(hits) < 0.97


def abs_in(pooled):
    return pooled.low <= 0 <= pooled.high


def test_skill():
    assert skill([1, 1], [2, 2]).mean == 0.5
    assert skill([2, 1], [2, 1]).low == 0
    assert skill([4.0], [2.0]).mean == -1
    assert math.isnan(skill([1.0], [0.0]).mean)
    with pytest.raises(ValueError, match="same cases"):
        skill([1.0], [1.0, 2.0])
