"""Elements along a line: partition of unity, exact integrals, and pressures recovered from their forces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.elements.line import Line, gauss_points, interpolation_matrix, line_matrix, recover_pressure

QUICK = settings(max_examples=50, deadline=None)
STEPS = st.lists(st.floats(0.1, 2.0), min_size=1, max_size=5)
ORDERS = st.sampled_from([1, 2, 3])


def make_line(steps, order=2, start=0.0):
    return Line(edges=start + np.concatenate([[0.0], np.cumsum(steps)]), order=order)


@QUICK
@given(steps=STEPS, order=ORDERS, part=st.floats(0, 1))
def test_functions_are_one_at_their_node_and_add_up_to_one(steps, order, part):
    line = make_line(steps, order)
    assert line.at(line.nodes) == pytest.approx(np.eye(line.count), abs=1e-9)
    assert line.at(np.array([part * line.edges[-1]])).sum() == pytest.approx(1)


@QUICK
@given(steps=STEPS, order=ORDERS, ends=st.tuples(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2)))
def test_integrals_of_polynomials_are_exact_between_any_ends(steps, order, ends):
    line = make_line(steps, order)
    low, high = sorted(np.array(ends) * line.edges[-1])
    values = line.nodes**order
    inside = np.clip([low, high], 0, line.edges[-1])
    exact = (inside[1] ** (order + 1) - inside[0] ** (order + 1)) / (order + 1)
    assert line.integral(low, high) @ values == pytest.approx(exact, abs=1e-9 * line.edges[-1] ** (order + 1))


@QUICK
@given(steps=STEPS, start=st.floats(0.0, 2.0))
def test_mass_and_stiffness_integrate_polynomials(steps, start):
    line = make_line(steps, start=start)
    a, b = line.edges[[0, -1]]
    r = line.nodes
    one, mass = np.ones(line.count), line_matrix(line, line)
    assert one @ mass @ one == pytest.approx(b - a)
    assert r @ mass @ r == pytest.approx((b**3 - a**3) / 3)
    assert r**2 @ line_matrix(line, line, (1, 1)) @ r**2 == pytest.approx(4 * (b**3 - a**3) / 3)
    rings = line_matrix(line, line, axisymmetric=True)
    assert one @ rings @ one == pytest.approx(np.pi * (b**2 - a**2))
    assert r @ rings @ r == pytest.approx(np.pi * (b**4 - a**4) / 2)


@QUICK
@given(x=STEPS, y=STEPS, seed=st.integers(0, 9))
def test_a_pressure_is_recovered_from_its_consistent_forces(x, y, seed):
    lines = [make_line(x), make_line(y)]
    pressure = np.random.default_rng(seed).standard_normal((lines[0].count, lines[1].count))
    mass = [line_matrix(line, line).toarray() for line in lines]
    forces = mass[0] @ pressure @ mass[1].T
    assert recover_pressure(lines, forces) == pytest.approx(pressure, abs=1e-8)


@QUICK
@given(steps=STEPS, count=st.integers(1, 5))
def test_gauss_points_integrate_polynomials_of_twice_their_number(steps, count):
    edges = np.concatenate([[0.0], np.cumsum(steps)])
    points, weights = gauss_points(edges, count)
    power = 2 * count - 1
    assert weights @ points**power == pytest.approx(edges[-1] ** (power + 1) / (power + 1))


@QUICK
@given(x=STEPS, y=STEPS, order=ORDERS, seed=st.integers(0, 99))
def test_a_matrix_interpolates_on_the_grid_of_two_lines(x, y, order, seed):
    """A polynomial of the order of the elements is met exactly at any place, also at the ends."""
    lines = make_line(x, order), make_line(y, order, start=-1.0)
    rng = np.random.default_rng(seed)
    factors = rng.standard_normal((order + 1, order + 1))
    places = [np.concatenate([line.edges[[0, -1]], rng.uniform(line.edges[0], line.edges[-1], 7)]) for line in lines]
    values = np.polynomial.polynomial.polygrid2d(lines[0].nodes, lines[1].nodes, factors)
    found = interpolation_matrix(*lines, *places) @ values.ravel()
    assert found == pytest.approx(np.polynomial.polynomial.polyval2d(*places, factors), rel=1e-9, abs=1e-8)
