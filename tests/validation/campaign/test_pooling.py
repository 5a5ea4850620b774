"""Means over cases, their intervals, and skill."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.campaign.results import pool, skill


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


def test_skill_is_one_less_the_ratio_of_the_mean_errors():
    assert skill([1, 1], [2, 2]).mean == 0.5
    assert skill([2, 1], [2, 1]).low == 0
    assert skill([4.0], [2.0]).mean == -1
    assert math.isnan(skill([1.0], [0.0]).mean)
    with pytest.raises(ValueError, match="same cases"):
        skill([1.0], [1.0, 2.0])


VALUES = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20)
ERRORS = st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3)), min_size=1, max_size=12)


@given(VALUES, st.integers(0, 3))
def test_interval_contains_the_mean_and_stays_among_the_values(values, missing):
    pooled = pool([*values, *[math.nan] * missing], resamples=400)
    room = 1e-9 * (1 + max(map(abs, values)))
    assert pooled.cases == len(values)
    assert pooled.mean == pytest.approx(sum(values) / len(values), abs=room)
    assert min(values) - room <= pooled.low <= pooled.high <= max(values) + room
    wide = pool(values, resamples=400, level=0.999)
    assert wide.low <= pooled.low + room
    assert wide.high >= pooled.high - room


@given(VALUES, st.floats(-5, 5), st.floats(-100, 100))
def test_pooling_commutes_with_a_change_of_unit(values, factor, offset):
    pooled = pool(values, resamples=200)
    other = pool(factor * np.array(values) + offset, resamples=200)
    ends = sorted((factor * pooled.low + offset, factor * pooled.high + offset))
    assert other.mean == pytest.approx(factor * pooled.mean + offset, abs=1e-8)
    assert (other.low, other.high) == pytest.approx(tuple(ends), abs=1e-6)


@given(ERRORS, st.floats(0.1, 10))
def test_skill_compares_errors_whatever_their_unit(pairs, factor):
    errors, others = (np.array(each) for each in zip(*pairs, strict=True))
    found = skill(errors, others, resamples=200)
    assert found.mean == pytest.approx(1 - errors.sum() / others.sum())
    assert skill(factor * errors, factor * others, resamples=200).low == pytest.approx(found.low)
    assert skill(others, others, resamples=200).high == pytest.approx(0, abs=1e-12)
