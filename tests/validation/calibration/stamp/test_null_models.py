"""Null models reproduce what they can express, and only that."""

import numpy as np
import pytest

from tests.support.stamp import case_of, file_of
from validation.calibration.stamp.null_models import NULLS


def test_nulls_reproduce_what_they_can_express_and_only_that():
    rng = np.random.default_rng(1)
    pattern = rng.uniform(10, 100, 78)
    big = 10**6
    separable = [case_of(letter, pattern * file_of(letter).load ** 2) for letter in "ACEG"]
    held_out = pattern * file_of("H").load ** 2
    load = file_of("H").load
    assert NULLS["mean pattern x load curve"](separable, big)(load) == pytest.approx(held_out, rel=1e-6)
    assert NULLS["quadratic per texel"](separable, big)(load) == pytest.approx(held_out, rel=1e-6)
    powers = rng.uniform(0.5, 1.9, 78)
    mixed = [case_of(letter, pattern * file_of(letter).load ** powers) for letter in "ACEG"]
    wanted = pattern * load**powers
    assert np.abs(NULLS["mean pattern x load curve"](mixed, big)(load) / wanted - 1).max() > 0.1
    assert np.abs(NULLS["quadratic per texel"](mixed, big)(load) / wanted - 1).max() < 0.05
    assert not NULLS["zeros"](mixed, big)(load).any()
    straight = [case_of(letter, pattern * (file_of(letter).load - 1)) for letter in "ACEG"]
    assert NULLS["line per texel"](straight, big)(load) == pytest.approx(pattern * (load - 1), rel=1e-6)
    assert NULLS["line per texel"](straight, 50)(load).max() == 50
    assert NULLS["line per texel"](straight, 50)(0.5).max() == 0
