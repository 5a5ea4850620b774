"""Newton's method and the step walker on small systems with known solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.errors import ConvergenceError, PathConvergenceError
from fem_reference.finite_strain.hyperelastic import InvertedElementError
from fem_reference.finite_strain.newton import (
    Equilibrium,
    Linearisation,
    solve_newton,
    walk_to,
)


def make_equilibrium(state, iterations, depth=0.0, load=0.0):
    return Equilibrium(state=state, depth=depth, load=load, reaction=np.zeros_like(state), iterations=iterations)


def make_cubic(matrix, force):
    """The gradient of x A x / 2 + sum x^4 / 4 - f x: one solution if A is positive definite."""

    def linearise(unknowns, iteration):
        gradient = matrix @ unknowns + unknowns**3 - force
        converged = np.abs(gradient).max() < 1e-10
        return Linearisation(
            equilibrium=make_equilibrium(unknowns, iteration) if converged else None,
            solve=lambda: np.linalg.solve(matrix + 3 * np.diag(unknowns**2), -gradient),
            gradient=gradient,
        )

    return linearise


def draw_matrix(seed):
    factor = np.random.default_rng(seed).standard_normal((4, 4))
    return factor @ factor.T + np.eye(4)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(0.01, 3.0))
def test_the_solution_of_a_known_system_is_found(seed, size):
    matrix = draw_matrix(seed)
    solution = size * np.random.default_rng(seed + 1).standard_normal(4)
    found = solve_newton(make_cubic(matrix, matrix @ solution + solution**3), np.zeros(4), iterations=60)
    assert found.state == pytest.approx(solution, abs=1e-8)


def test_too_few_iterations_are_an_error():
    with pytest.raises(ConvergenceError, match="did not converge in 2 iterations"):
        solve_newton(make_cubic(np.eye(1), np.array([1e3])), np.zeros(1), iterations=2)


def test_a_step_that_inverts_an_element_is_halved():
    """1 / x = 2 from x = 1.9: Newton's first step leads to a negative x, where nothing can be evaluated."""

    def linearise(unknowns, iteration):
        x = float(unknowns[0])
        if x <= 0:
            raise InvertedElementError("inverted")
        residual = 1 / x - 2
        found = make_equilibrium(unknowns, iteration) if abs(residual) < 1e-9 else None
        return Linearisation(equilibrium=found, solve=lambda: np.array([residual * x**2]))

    assert solve_newton(linearise, np.array([1.9]), iterations=20).state == pytest.approx(0.5)


def test_a_step_past_the_minimum_is_taken_back():
    """Newton's method diverges on arctan(x) = 0 from x = 2: every step leads farther out on the other side."""

    def linearise(unknowns, iteration):
        gradient = np.arctan(unknowns)
        return Linearisation(
            equilibrium=make_equilibrium(unknowns, iteration) if abs(gradient[0]) < 1e-10 else None,
            solve=lambda: -gradient * (1 + unknowns**2),
            gradient=gradient,
        )

    def linearise_without_gradient(unknowns, iteration):
        return replace(linearise(unknowns, iteration), gradient=None)

    assert solve_newton(linearise, np.array([2.0]), iterations=20).state == pytest.approx(0, abs=1e-9)
    with pytest.raises(ConvergenceError):
        solve_newton(linearise_without_gradient, np.array([2.0]), iterations=8)


def walk(target, *, longest_step=np.inf, limit=np.inf, step=1.0, **options):
    """Walk with a solver that fails for steps above `longest_step` and beyond `limit`; return the visited depths."""
    visited = [0.0]

    def solve(before, here, aim):
        if abs(aim - here.depth) > longest_step or aim > limit:
            raise ConvergenceError("too far")
        visited.append(float(aim))
        return make_equilibrium(np.zeros(1), here.iterations + 5, depth=float(aim))

    walk_to(
        target,
        make_equilibrium(np.zeros(1), 0),
        control="depth",
        step=step,
        solve=solve,
        describe=lambda here: f"{here.depth:.3g}",
        **options,
    )
    return np.array(visited)


@settings(max_examples=50, deadline=None)
@given(target=st.floats(0.1, 20), longest=st.floats(0.5, 100))
def test_a_walk_ends_exactly_at_its_target_and_never_turns_back(target, longest):
    visited = walk(target, longest_step=longest)
    assert visited[-1] == target
    assert (np.diff(visited) > 0).all()
    assert np.diff(visited).max() <= longest * (1 + 1e-12)


def test_a_walk_that_cannot_go_on_says_where_it_ended():
    with pytest.raises(PathConvergenceError, match=r"no convergence beyond \d[.\d]*: too far") as stopped:
        walk(10.0, limit=4.0)
    assert 4.0 - 2 * 10 / 256 < stopped.value.depth <= 4.0
    assert isinstance(stopped.value, ConvergenceError)
