"""The contact solver against a dense least-squares solver, and the conditions at its solution."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import nnls

from fem_reference.errors import ConvergenceError
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator, find_pressures

SHAPE, CELL = (7, 5), (0.4e-3, 0.3e-3)
GAPS = arrays(float, SHAPE, elements=st.floats(0, 1)).map(lambda gap: 2e-4 * gap)
SHARED = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def compliance(bonded):
    return ComplianceOperator(surface_compliance(bonded(0.45), 10e-3), SHAPE, CELL)


@pytest.fixture(scope="module")
def dense(compliance):
    units = np.eye(SHAPE[0] * SHAPE[1]).reshape(-1, *SHAPE)
    return np.array([compliance.displace(unit).ravel() for unit in units])


def test_the_operator_is_reciprocal_and_positive(dense):
    assert dense == pytest.approx(dense.T, rel=1e-9)
    assert np.linalg.eigvalsh(dense)[0] > 0


@SHARED
@given(gap=GAPS, depth=st.floats(1e-5, 2e-4))
def test_pressures_at_a_depth_are_those_of_non_negative_least_squares(compliance, dense, gap, depth):
    """With K = L L^T and g = gap - depth, p K p / 2 + p g and |L^T p + L^-1 g| are least at the same p >= 0."""
    wanted = (gap - depth).ravel()
    factor = np.linalg.cholesky(dense)
    expected, _ = nnls(factor.T, -np.linalg.solve(factor, wanted))
    found, motion = find_pressures(compliance, gap - depth, gap < depth)
    assert motion.shape == (0,)
    assert found.ravel() == pytest.approx(expected, abs=1e-5 * max(expected.max(), 1.0))


@SHARED
@given(gap=GAPS, guess=arrays(bool, SHAPE))
def test_the_first_guess_does_not_matter(compliance, gap, guess):
    one, other = (find_pressures(compliance, gap - 1e-4, mask)[0] for mask in (guess, gap < 1e-4))
    assert one == pytest.approx(other, abs=1e-5 * max(other.max(), 1.0))


@SHARED
@given(gap=GAPS, load=st.floats(0.1, 10.0), side=st.floats(-0.3, 0.3), across=st.floats(-0.2, 0.2))
@example(gap=np.full(SHAPE, 3.3e-160), load=1.0, side=0.0, across=0.0)  # its square is too small for a number
def test_a_body_that_may_tilt_is_in_equilibrium_and_touches_without_overlap(compliance, gap, load, side, across):
    x, y = np.meshgrid(
        *((np.arange(n) - (n - 1) / 2) * edge for n, edge in zip(SHAPE, CELL, strict=True)), indexing="ij"
    )
    point = np.array([side, across]) * CELL * np.array(SHAPE)
    columns = np.array([np.ones(SHAPE), (x - point[0]) / CELL[0], (y - point[1]) / CELL[1]])
    sums = np.array([load / np.prod(CELL), 0.0, 0.0])
    pressure, motion = find_pressures(compliance, 0.01 * gap, np.ones(SHAPE, dtype=bool), columns=columns, sums=sums)
    overlap = np.tensordot(motion, columns, 1) - 0.01 * gap - compliance.displace(pressure)
    assert (pressure >= 0).all()
    assert np.tensordot(columns, pressure, 2) / sums[0] == pytest.approx([1, 0, 0], abs=1e-6)
    assert np.abs(overlap[pressure > 0]).max() < 1e-6 * np.abs(motion[0])
    assert overlap.max() < 1e-6 * np.abs(motion[0])


@pytest.mark.slow
def test_a_load_beside_the_body_cannot_be_balanced(compliance):
    x, _ = np.meshgrid(
        *((np.arange(n) - (n - 1) / 2) * edge for n, edge in zip(SHAPE, CELL, strict=True)), indexing="ij"
    )
    columns = np.array([np.ones(SHAPE), x - 2e-3])  # the last cells end at 1.4 mm
    with pytest.raises(ConvergenceError):
        find_pressures(
            compliance, np.zeros(SHAPE), np.ones(SHAPE, dtype=bool), columns=columns, sums=np.array([1e6, 0.0])
        )
