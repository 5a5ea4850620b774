"""Error estimates and extrapolation of sequences whose limit and order are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.grid_convergence import grid_convergence, pool_errors, texel_convergence

SIZES = st.tuples(st.floats(1.3, 2.0), st.floats(1.3, 2.0)).map(lambda r: (r[0] * r[1], r[1], 1.0))
ERRORS = st.floats(-2.0, 2.0).filter(lambda e: abs(e) > 1e-3)


@given(order=st.floats(1.05, 3.9), sizes=SIZES, limit=st.floats(-5, 5), error=ERRORS)
def test_the_error_of_a_known_order_is_estimated_with_the_safety_factor(order, sizes, limit, error):
    values = [limit + error * h**order for h in sizes]
    assert grid_convergence(values, sizes) == pytest.approx(1.25 * abs(error), rel=1e-5)


@given(order=st.floats(1.05, 3.9), sizes=SIZES, error=ERRORS, scale=st.floats(1e-6, 1e6), shift=st.floats(-3, 3))
def test_the_estimate_scales_with_the_values_and_ignores_a_constant(order, sizes, error, scale, shift):
    values = np.array([error * h**order for h in sizes])
    assert grid_convergence(scale * (values + shift), sizes) == pytest.approx(
        scale * grid_convergence(values, sizes), rel=1e-5
    )


@pytest.mark.parametrize(
    ("values", "sizes", "error"),
    [
        ([0.0, 1.0, 1.25], [4, 2, 1], 1.25 * 0.25 / (2**2 - 1)),
        ([0.0, 1.0, 0.75], [4, 2, 1], 3.0 * 0.25 / (2**2 - 1)),  # back and forth
        ([1.0, 1.0, 1.0], [3, 2, 1], 0.0),
        ([2.0, 1.0, 1.0], [4, 2, 1], 3.0 / 2**4 / (2**4 - 1)),  # the finest grids agree by chance
    ],
)
def test_values_that_do_not_converge_get_the_larger_safety_factor(values, sizes, error):
    assert grid_convergence(values, sizes) == pytest.approx(error)


@pytest.mark.parametrize(
    ("values", "sizes"), [([1, 2], [2, 1]), ([1, 2, 3], [1, 2, 3]), ([1, 2, 3], [2, 2, 1]), ([1, 2, 3], [2, 1, 0])]
)
def test_sizes_must_descend(values, sizes):
    with pytest.raises(ValueError, match="three values"):
        grid_convergence(values, sizes)


@given(order=st.floats(1.05, 3.9), sizes=SIZES, errors=st.lists(ERRORS, min_size=2, max_size=6))
def test_forces_that_converge_with_one_order_get_their_own_errors(order, sizes, errors):
    values = [3 + np.array(errors) * h**order for h in sizes]
    assert texel_convergence(values, sizes) == pytest.approx(1.25 * np.abs(errors), rel=1e-5)


def test_no_force_has_an_error_far_below_the_others_by_chance():
    """The second force is the same on the two finest grids, the third on all."""
    values = np.array([[1.4, 1.4, 2.0], [1.1, 1.0, 2.0], [1.0, 1.0, 2.0]])
    own = texel_convergence(values, (4, 2, 1))
    assert own[2] == 0
    assert own[0] > 0
    assert own[1] > 0
    assert pool_errors(own, values[-1]) == pytest.approx([own[0], own[1], 2 * own.sum() / 4])
    assert not pool_errors(np.zeros(2), np.zeros(2)).any()
