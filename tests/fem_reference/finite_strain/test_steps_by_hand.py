"""Newton's steps and the steps of a loading path, one by one, against sequences that are computed by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.errors import ConvergenceError, PathConvergenceError
from fem_reference.finite_strain.hyperelastic import InvertedElementError
from fem_reference.finite_strain.newton import Equilibrium, Linearisation, is_balanced, solve_newton, walk_to


def reach(depth, iterations=0, load=0.0):
    return Equilibrium(state=np.zeros(1), depth=depth, load=load, reaction=np.zeros(1), iterations=iterations)


def walk(target, *, start=0.0, step=1.0, longest_step=np.inf, limit=np.inf, iterations=7, **options):
    """The depths that are tried, whether the last two equilibria are known to each, and the depths that are reached."""
    tried, known, reached = [], [], []

    def solve(before, here, aim):
        tried.append(float(aim))
        known.append(before is not None)
        if abs(aim - here.depth) > longest_step or aim > limit:
            raise ConvergenceError("too far")
        reached.append(float(aim))
        return reach(float(aim), here.iterations + iterations, load=3 * aim)

    found = walk_to(
        target, reach(start, 11), control="depth", step=step, solve=solve, describe=lambda here: f"{here.depth:g}",
        **options,
    )  # fmt: skip
    assert found.depth == target
    return tried, known, reached


@pytest.mark.parametrize(
    ("target", "options", "depths"),
    [
        # Steps of fewer than eight iterations grow by 1.8; the last one may be 1.3 times as long as planned.
        (20.0, {}, [1, 2.8, 6.04, 11.872, 20]),
        (4.29, {"iterations": 8}, [1, 2, 3, 4.29]),
        (4.31, {"iterations": 8}, [1, 2, 3, 4, 4.31]),
        (1.3, {}, [1.3]),
        (7.0, {"iterations": 4, "easy": 4}, [1, 2, 3, 4, 5, 6, 7]),
        (7.0, {"iterations": 3, "easy": 4}, [1, 2.8, 7]),
        (9.0, {"longest": 2.0}, [1, 2.8, 4.8, 6.8, 9]),
        # Downwards from 5.
        (2.0, {"start": 5.0}, [4, 2]),
        (-6.0, {"start": 1.0, "iterations": 9, "step": 2.5}, [-1.5, -4, -6]),
        (3.0, {"start": 3.0}, []),
    ],
)
def test_steps_grow_and_end_at_the_target(target, options, depths):
    tried, known, reached = walk(target, **options)
    assert tried == reached == pytest.approx(depths)
    assert known == [False, *[True] * (len(depths) - 1)][: len(depths)]


def test_a_step_that_fails_is_tried_from_the_last_equilibrium_halved_and_grows_more_slowly():
    """Steps up to 1.5: that of 1.8 fails twice, and the ones after it grow by 1.2."""
    tried, known, reached = walk(5.0, longest_step=1.5)
    assert tried == pytest.approx([1, 2.8, 2.8, 1.9, 2.98, 4.276, 5])
    assert known == [False, True, False, False, True, True, True]
    assert reached == pytest.approx([1, 1.9, 2.98, 4.276, 5])
    # A first step that fails has no other guess.
    tried, known, _ = walk(1.2, longest_step=0.6)
    assert tried == pytest.approx([1.2, 0.6, 1.2])
    assert known == [False, False, True]


@pytest.mark.parametrize(
    ("start", "target", "limit", "last"),
    [(0.0, 8.0, 0.0, 8 / 256), (4.0, 8.0, 4.0, 4 / 256), (-2.0, 8.0, -2.0, 2 / 256)],
)
def test_a_step_below_a_share_of_what_was_reached_ends_the_path(start, target, limit, last):
    """Of the target where nothing was reached; a step of exactly that share is tried."""
    tried = []

    def solve(_before, here, aim):
        tried.append(aim - here.depth)
        raise ConvergenceError("stuck here")

    with pytest.raises(PathConvergenceError, match=r"no convergence beyond here: stuck here") as stopped:
        walk_to(
            target, reach(start, load=2.5), control="depth", step=1.0, solve=solve, describe=lambda _: "here"
        )  # fmt: skip
    assert limit == start
    assert tried[0] == 1.0
    assert tried[-1] == last
    assert (stopped.value.cause, stopped.value.load, stopped.value.depth) == ("stuck here", 2.5, start)


def solve_line(share, *, changed=False, iterations=5, tolerance=1e-9, gradient=True):
    """Points at which x = 0 is solved from 1, with steps of a share of the right one."""
    seen = []

    def linearise(x, iteration):
        seen.append(float(x[0]))
        return Linearisation(
            equilibrium=reach(0.0, iteration) if abs(x[0]) < tolerance else None,
            solve=lambda: -share * x,
            gradient=x if gradient else None,
            changed=changed,
        )

    try:
        found = solve_newton(linearise, np.ones(1), iterations=iterations)
    except ConvergenceError:
        return seen, None
    return seen, found.iterations


@pytest.mark.parametrize(
    ("share", "options", "points", "count"),
    [
        # The energy is a parabola, so that the secant rule finds its minimum.
        (2.0, {}, [1, -1, 0], 2),
        (1.31, {}, [1, -0.31, 0], 2),
        # A slope of less than 0.3 of the first one is left; at most nine tenths of a step are taken back.
        (1.29, {"iterations": 3}, [1, -0.29, 0.29**2], None),
        (20.0, {}, [1, -19, -1, 19, 1], None),
        (2.0, {"changed": True}, [1, -1, 1, -1, 1], None),
        (2.0, {"gradient": False}, [1, -1, 1, -1, 1], None),
        (0.5, {"iterations": 4}, [1, 0.5, 0.25, 0.125], None),
        (1.0, {}, [1, 0], 1),
    ],
)
def test_a_step_past_the_minimum_is_taken_back_by_the_secant_rule(share, options, points, count):
    seen, iterations = solve_line(share, **options)
    assert seen == pytest.approx(points, abs=1e-12)
    assert iterations == count


@pytest.mark.parametrize(("limit", "found"), [(1.0, True), (0.99, False), (-0.1, False)])
def test_a_step_that_inverts_is_halved_four_times(limit, found):
    """From 0 towards 16; the first point cannot be halved."""
    seen = []

    def linearise(x, iteration):
        seen.append(float(x[0]))
        if x[0] > limit:
            raise InvertedElementError("inverted")
        return Linearisation(
            equilibrium=reach(0.0, iteration) if x[0] > 0 else None, solve=lambda: np.full(1, 16.0), changed=True
        )

    if found:
        assert solve_newton(linearise, np.zeros(1), iterations=9).iterations == 5
    else:
        with pytest.raises(InvertedElementError):
            solve_newton(linearise, np.zeros(1), iterations=9)
    assert seen == ([0] if limit < 0 else [0, 16, 8, 4, 2, 1])


@pytest.mark.parametrize(
    ("forces", "volumes", "balanced"),
    [
        ((0.019, 0, -0.019, 0), (0.029, -0.029), True),
        ((0.021, 0, 0, 0), (0, 0), False),
        ((0, 0, 0, -0.021), (0, 0), False),
        ((0, 900.0, 0, 0), (0, 0), True),  # a reaction
        ((0, 0, 0, 0), (0, 0.031), False),
        ((0, 0, 0, 0), (-0.031, 0), False),
        ((0.021, 0, 0, 0), (0.031, 0), False),
    ],
)
def test_forces_and_volumes_are_balanced_within_their_own_shares(forces, volumes, balanced):
    """One hundredth of 2 N, and of 3 m3, the half of a volume of 6 m3."""
    elements = SimpleNamespace(displacements=4, weight=np.array([[1.0, 2.0], [2.5, 0.5]]))
    residual = np.array([*forces, *volumes])
    found = is_balanced(elements, residual, np.array([1]), reference=2.0, tolerance=0.01)
    assert found is balanced
