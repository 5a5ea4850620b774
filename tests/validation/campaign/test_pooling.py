"""Means over cases, their intervals, and skill."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from validation.pooling import pool, skill


def test_pooling_covers_the_mean_and_skips_what_does_not_exist():
    values = [1.0, 2.0, 3.0, math.nan]
    pooled = pool(values)
    assert pooled.cases == 3
    assert pooled.low < pooled.mean == 2 < pooled.high
    assert pool(values) == pooled
    assert pool([math.nan]).cases == 0


def draw_normal(random, shape):
    return random.normal(1.0, 1.0, shape)


def draw_lognormal(random, shape):
    """Draws of mean 1 with a long tail, as errors have."""
    return np.exp(random.normal(0.0, 0.5, shape) - 0.125)


@pytest.mark.parametrize("draw", [draw_normal, draw_lognormal])
@pytest.mark.parametrize(
    "count", [3, pytest.param(5, marks=pytest.mark.slow), pytest.param(17, marks=pytest.mark.slow)]
)
def test_intervals_cover_from_three_to_seventeen_cases(draw, count):
    """The standard error of a coverage of 0.94 over 6000 draws is 0.003."""
    draws = draw(np.random.default_rng(count), (6000, count))
    covered = np.mean([each.low <= 1 <= each.high for each in map(pool, draws)])
    assert 0.93 <= covered <= 0.975, covered


@pytest.mark.parametrize("count", [pytest.param(3, marks=pytest.mark.slow), pytest.param(17, marks=pytest.mark.slow)])
def test_intervals_of_skill_cover_with_errors_that_go_together(count):
    random = np.random.default_rng(count)
    common = draw_lognormal(random, (6000, count))
    ours, others = (common * np.exp(random.normal(0, 0.3, common.shape)) for _ in range(2))
    found = [skill(e, c) for e, c in zip(ours, 2 * others, strict=True)]
    assert np.mean([each.low <= 0.5 <= each.high for each in found]) >= 0.925


def test_interval_of_symmetric_values_is_students():
    values = [1.0, 2.0, 3.0, 4.0, 5.0]
    half = 2.7764451 * math.sqrt(2.5 / 5)  # quantile 0.975 of Student's t with four degrees of freedom
    found = pool(values)
    assert (found.low, found.high) == pytest.approx((3 - half, 3 + half), abs=1e-6)
    tailed = pool([1.0, 1.1, 1.2, 1.3, 3.0])
    assert tailed.high - tailed.mean > 1.2 * (tailed.mean - tailed.low)


@pytest.mark.parametrize("values", [[1.0], [1.0, 1.4], [0.3] * 6])
def test_there_is_no_interval_of_few_or_equal_values(values):
    found = pool(values)
    assert math.isnan(found.low)
    assert math.isnan(found.high)
    assert ("no interval" if len(values) < 3 else "the same in all 6 cases") in found.describe()


def test_skill_is_one_less_the_ratio_of_the_mean_errors():
    assert skill([1, 1], [2, 2]).mean == 0.5
    assert skill([2, 1, 3], [2, 1, 3]).mean == 0
    assert skill([4.0], [2.0]).mean == -1
    assert math.isnan(skill([1.0], [0.0]).mean)
    with pytest.raises(ValueError, match="same cases"):
        skill([1.0], [1.0, 2.0])


VALUES = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20)
ERRORS = st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3)), min_size=1, max_size=12)


@given(VALUES, st.integers(0, 3))
def test_interval_contains_the_mean_and_grows_with_its_level(values, missing):
    pooled = pool([*values, *[math.nan] * missing])
    room = 1e-9 * (1 + max(map(abs, values)))
    assert pooled.cases == len(values)
    assert pooled.mean == pytest.approx(sum(values) / len(values), abs=room)
    if math.isnan(pooled.low):
        assert len(values) < 3 or max(values) - min(values) < room
        return
    assert pooled.low < pooled.mean < pooled.high
    wide = pool(values, level=0.999)
    assert wide.low < pooled.low
    assert wide.high > pooled.high


@given(VALUES, st.floats(-5, 5), st.floats(-100, 100))
def test_pooling_commutes_with_a_change_of_unit(values, factor, offset):
    assume(np.ptp(values) * abs(factor) > 1e-6)
    pooled = pool(values)
    other = pool(factor * np.array(values) + offset)
    ends = sorted((factor * pooled.low + offset, factor * pooled.high + offset))
    assert other.mean == pytest.approx(factor * pooled.mean + offset, abs=1e-8)
    assert (other.low, other.high) == pytest.approx(tuple(ends), abs=1e-5, nan_ok=True)


@given(ERRORS, st.floats(0.1, 10))
def test_skill_compares_errors_whatever_their_unit(pairs, factor):
    errors, others = (np.array(each) for each in zip(*pairs, strict=True))
    found = skill(errors, others)
    assert found.mean == pytest.approx(1 - errors.sum() / others.sum())
    assume(math.isnan(found.low) or found.high - found.low > 1e-6)
    assert skill(factor * errors, factor * others).low == pytest.approx(found.low, nan_ok=True)
