"""Contact points: sums, mirror images and rings, and the pressure of Hertz from a solved contact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.finite_strain.contact import divide_rings, unfold_points


@given(seed=st.integers(0, 10**6), symmetric=st.tuples(st.booleans(), st.booleans()))
def test_mirror_images_multiply_the_force_and_cancel_what_is_odd(seed, symmetric):
    points = np.random.default_rng(seed).uniform(0.1, 1, (7, 5))
    whole = unfold_points(points, symmetric)
    multiple = (1 + symmetric[0]) * (1 + symmetric[1])
    assert whole[:, 2].sum() == pytest.approx(multiple * points[:, 2].sum())
    for axis in range(2):
        expected = 0.0 if symmetric[axis] else multiple * points[:, 3 + axis].sum()
        assert whole[:, 3 + axis].sum() == pytest.approx(expected)
        # What a mirror image keeps: shear that points away from the plane.
        moment = whole[:, axis] @ whole[:, 3 + axis]
        assert moment == pytest.approx(multiple * points[:, axis] @ points[:, 3 + axis])


def test_rings_keep_force_radius_and_radial_friction():
    rings = np.array([[1.0, 3.0, -0.5], [2.0, 1.0, 0.25], [4.0, 2.0, 0.0]])
    points = divide_rings(rings)
    x, y, force, *shear = points.T
    assert force.sum() == pytest.approx(rings[:, 1].sum())
    assert force @ np.column_stack([x, y]) == pytest.approx([0, 0], abs=1e-12)
    assert force @ (x**2) == pytest.approx(rings[:, 1] @ rings[:, 0] ** 2 / 2)
    radial = (x * shear[0] + y * shear[1]) / np.hypot(x, y)
    assert radial.reshape(3, -1).sum(axis=1) == pytest.approx(rings[:, 2])
    assert x * shear[1] == pytest.approx(y * shear[0])
