"""Gauss-Legendre points over a rectangle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.derivation.kernel import gauss_points

LENGTHS = st.floats(1e-4, 1.0)


@given(LENGTHS, LENGTHS, st.integers(1, 12), st.data())
def test_polynomials_up_to_twice_the_order_are_averaged_exactly(width, height, order, data):
    i, j = (data.draw(st.integers(0, 2 * order - 1)) for _ in "xy")
    points, weights = gauss_points((width, height), order)
    x, y = 2 * points[:, 0] / width, 2 * points[:, 1] / height
    exact = [0.0 if power % 2 else 1 / (power + 1) for power in (i, j)]
    assert weights.sum() == pytest.approx(1)
    assert weights @ (x**i * y**j) == pytest.approx(exact[0] * exact[1], abs=1e-12)


def test_points_lie_inside_the_rectangle_along_their_own_axis():
    points, _ = gauss_points((4.0, 1.0), 5)
    assert np.ptp(points, axis=0) == pytest.approx((4 * 0.9061798459, 0.9061798459))
