"""The contact solver against a dense least-squares solver, and the conditions at its solution."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import nnls

from fem_reference.errors import ConvergenceError
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact import constrained_solver as solver
from fem_reference.small_strain_contact.constrained_solver import (
    ComplianceOperator,
    Exchange,
    find_pressures,
    solve_displacement,
)

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
    # one cell may flicker between contact and none while its pressure or overlap is below 1e-4 of the largest
    assert found.ravel() == pytest.approx(expected, abs=1e-4 * max(expected.max(), 1.0))


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


def test_wrong_cells_change_together_until_their_number_no_longer_falls():
    """Twice more without a new minimum; then the last one alone, until there is a new minimum."""
    exchange, chosen = Exchange(6, 2), []
    for wrong in (
        [0, 1, 3, 5],
        [0, 1, 3, 4],
        [0, 1, 2, 3, 4],
        [0, 2, 3, 5],
        [1, 2, 4, 5],
        [1, 2, 4],
        [0, 1, 2],
        [3, 4, 5],
    ):
        picked = exchange.choose(np.isin(np.arange(6), wrong))
        chosen.append((np.flatnonzero(picked).tolist(), exchange.is_single, exchange.fewest))
    assert chosen == [
        ([0, 1, 3, 5], False, 4), ([0, 1, 3, 4], False, 4), ([0, 1, 2, 3, 4], False, 4), ([5], True, 4), ([5], True, 4),
        ([1, 2, 4], False, 3), ([0, 1, 2], False, 3), ([3, 4, 5], False, 3),
    ]  # fmt: skip
    assert Exchange(6, 0).choose(np.ones(6, dtype=bool)).all()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-9])
def test_displacements_are_met_within_their_tolerance_from_any_start(compliance, dense, tolerance):
    rng = np.random.default_rng(3)
    wanted, touching = 1e-4 * rng.standard_normal(SHAPE), rng.uniform(size=SHAPE) < 0.6
    held = touching.ravel()
    exact = np.zeros(held.size)
    exact[held] = np.linalg.solve(dense[np.ix_(held, held)], wanted.ravel()[held])
    size = np.linalg.norm(wanted[touching])
    for start in (np.zeros(SHAPE), 1e6 * rng.standard_normal(SHAPE), exact.reshape(SHAPE)):
        found = solve_displacement(compliance, wanted, touching, start, tolerance)
        assert (found[~touching] == 0).all()
        missed = (dense @ found.ravel())[held] - wanted[touching]
        assert np.linalg.norm(missed) <= 1.0001 * tolerance * size
    assert found == pytest.approx(exact.reshape(SHAPE), abs=1e-9 * np.abs(exact).max())
    assert not solve_displacement(compliance, wanted, np.zeros(SHAPE, dtype=bool), wanted, tolerance).any()


def test_searches_that_take_too_long_are_given_up(compliance, monkeypatch):
    gap = 1e-4 * np.arange(35.0).reshape(SHAPE) / 35 - 0.6e-4
    plain = solver._SETTINGS
    monkeypatch.setattr(solver, "_SETTINGS", dataclasses.replace(plain, exchanges=1))
    with pytest.raises(ConvergenceError, match=r"did not settle in 1 exchanges on \(7, 5\) cells"):
        find_pressures(compliance, gap, gap < 1.0)
    monkeypatch.setattr(solver, "_SETTINGS", dataclasses.replace(plain, iterations=1))
    with pytest.raises(ConvergenceError, match="conjugate gradients did not converge in 1 iterations"):
        find_pressures(compliance, gap, gap < 0)
    monkeypatch.setattr(solver, "_SETTINGS", plain)
    with pytest.raises(ConvergenceError, match="no motion of the indenters balances their loads and moments"):
        find_pressures(compliance, 0 * gap, gap < 1.0, columns=np.ones((1, *SHAPE)), sums=np.array([-1e6]))
