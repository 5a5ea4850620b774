"""Solutions on grids: scaling, extrapolation, correction, and the estimate from three grids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.indentation.grid_solution import (
    GridSolution,
    GridStudy,
    add_refinements,
    correct_solution,
    estimate_spread,
    extrapolate_solutions,
    scale_solution,
)
from meshes import TexelArray
from meshes.pose import Pose
from tests.support.indentations import FixedBase

ARRAY = TexelArray.grid(2, 2, pitch=3e-3)
SIZES = (1 / 4, 1 / 6, 1 / 9)
POSITIVE = st.floats(0.1, 10)


def make_solution(force=1.0, depth=1.0, *, area=1.0, shares=(0.4, 0.3, 0.2, 0.05), overlap=0.0, size=1.0):
    """A solution whose texel forces are fixed shares of its force."""
    return GridSolution(
        size=size,
        total_force=force,
        depth=depth,
        area=area,
        overlap=overlap,
        contact=np.array([[0.0, 1.0, force / 2], [2.0, 3.0, force / 2]]),
        base=FixedBase(values=force * np.append(shares, 1 - sum(shares))),
        energy=force * depth / 2,
        shear=np.array([[0.1, 0.0], [-0.1, 0.2]]) * force,
    )


def read_texels(solution):
    return solution.base.forces(ARRAY, Pose())[:4]


@given(force=POSITIVE, depth=POSITIVE, first=POSITIVE, second=POSITIVE)
def test_scaling_is_linear_and_keeps_the_contact_area(force, depth, first, second):
    solution = make_solution(force, depth)
    twice = scale_solution(scale_solution(solution, first), second)
    once = scale_solution(solution, first * second)
    for each in (twice, once):
        assert (each.total_force, each.depth) == pytest.approx((first * second * force, first * second * depth))
        assert read_texels(each) == pytest.approx(first * second * read_texels(solution))
        assert each.contact[:, 2].sum() == pytest.approx(each.total_force)
        assert (each.contact[:, :2] == solution.contact[:, :2]).all()
        assert each.area == solution.area
        assert each.energy == pytest.approx(each.total_force * each.depth / 2)


@given(radius=st.floats(-0.2, 0.2), elements=st.floats(-0.2, 0.2))
def test_refinements_in_turn_add_up_and_so_do_their_errors(radius, elements):
    """Of a force that is linear in both, all of the effect of the elements and of half the radius is left."""
    sizes, radii = (1 / 2, 1 / 2, 1 / 3), (1.0, 0.5, 1.0)
    forces = [2 + radius * r + elements * h for r, h in zip(radii, sizes, strict=True)]
    grids = [make_solution(force, 1.0, size=size) for force, size in zip(forces, sizes, strict=True)]
    study = GridStudy(solutions=[], edge_safety=3.0)
    solutions = add_refinements(grids)
    force = 2 + radius / 2 + elements / 3
    assert [each.total_force for each in solutions] == pytest.approx([*forces[:2], force])
    assert float(solutions[-1].base.forces(ARRAY, Pose()).sum()) == pytest.approx(force)
    estimate = study.estimate_error(solutions, lambda each: each.total_force)
    assert estimate == pytest.approx((3.0 * abs(radius) / 2 + 1.25 * abs(elements) / 3) / force, abs=1e-12)


@given(limit=POSITIVE, slope=st.floats(-0.5, 0.5))
def test_extrapolation_recovers_the_limit_of_a_first_order_sequence(limit, slope):
    grids = [make_solution(limit * (1 + slope * size), limit * (2 - slope * size), size=size) for size in SIZES]
    found = extrapolate_solutions(grids)
    assert found.total_force == pytest.approx(limit, rel=1e-9)
    assert found.depth == pytest.approx(2 * limit, rel=1e-9)
    assert read_texels(found) == pytest.approx(limit * np.array([0.4, 0.3, 0.2, 0.05]), rel=1e-9)
    assert found.area == grids[-1].area


@given(force=POSITIVE, depth=POSITIVE, control=st.sampled_from(["load", "depth"]), share=st.floats(0.1, 1))
def test_a_correction_without_an_effect_changes_nothing(force, depth, control, share):
    accurate = make_solution(force, depth)
    coarse = make_solution(force / share, depth / share, shares=(0.3, 0.3, 0.3, 0.1))
    found = correct_solution(accurate, baseline=coarse, full=coarse, control=control, share=share)
    assert (found.total_force, found.depth, found.area) == pytest.approx((force, depth, 1.0))
    assert read_texels(found) == pytest.approx(read_texels(accurate))


@given(effect=st.floats(-0.3, 0.3), error=st.floats(-0.2, 0.2), control=st.sampled_from(["load", "depth"]))
def test_an_error_that_baseline_and_full_solution_share_cancels(effect, error, control):
    """Both coarse stiffnesses are wrong by the same factor; the corrected one is right."""
    accurate = make_solution(2.0, 1.0)
    stiffness = 2.0 * (1 + error) * np.array([1.0, 1 + effect])
    if control == "load":
        baseline, full = (make_solution(2.0, 2.0 / each) for each in stiffness)
    else:
        baseline, full = (make_solution(each, 1.0) for each in stiffness)
    found = correct_solution(accurate, baseline=baseline, full=full, control=control)
    assert found.total_force / found.depth == pytest.approx(2.0 * (1 + effect))
    assert getattr(found, "total_force" if control == "load" else "depth") == pytest.approx(
        2.0 if control == "load" else 1
    )


def test_a_shift_of_force_between_texels_is_added():
    accurate = make_solution(shares=(0.4, 0.3, 0.2, 0.1))
    baseline, full = make_solution(shares=(0.5, 0.3, 0.1, 0.1)), make_solution(shares=(0.45, 0.35, 0.1, 0.1))
    found = correct_solution(accurate, baseline=baseline, full=full, control="load")
    assert read_texels(found) == pytest.approx([0.35, 0.35, 0.2, 0.1])


def make_grids(*forces):
    """Solutions of given force at the same depth on three grids."""
    return [make_solution(force, size=size) for force, size in zip(forces, SIZES, strict=True)]


def read_force(solution):
    return solution.total_force


@given(forces=st.lists(POSITIVE, min_size=3, max_size=3), swings=st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3))
def test_forces_that_balance_on_every_grid_balance_in_the_result(forces, swings):
    """Also if single texels go back and forth over the grids."""
    grids = [
        make_solution(force, shares=(0.4 + swing, 0.3 - 2 * swing, 0.2, 0.05), size=size)
        for force, swing, size in zip(forces, swings, SIZES, strict=True)
    ]
    for study in (GridStudy(solutions=[]), GridStudy(solutions=[], extrapolate=True)):
        base = study.combine(grids, lambda each: each.base.forces(ARRAY, Pose()))
        assert base.sum() == pytest.approx(float(study.combine(grids, read_force)), rel=1e-12, abs=1e-12)


@given(order=st.floats(1.0, 3.0), coefficient=st.floats(0.01, 0.5), sign=st.sampled_from([-1, 1]))
def test_the_estimate_covers_the_error_of_a_convergent_sequence(order, coefficient, sign):
    values = [1 + sign * coefficient * size**order for size in SIZES]
    grids = make_grids(*values)
    assert GridStudy(solutions=[]).estimate_error(grids, read_force) * abs(values[-1]) >= abs(values[-1] - 1) * (
        1 - 1e-9
    )


def test_values_that_go_back_and_forth_are_not_extrapolated():
    study = GridStudy(solutions=[], extrapolate=True)
    grids = make_grids(1.0, 1.2, 1.1)
    assert study.combine(grids, read_force) == 1.1
    assert study.estimate_error(grids, read_force) == pytest.approx(
        GridStudy(solutions=[]).estimate_error(grids, read_force)
    )


def test_scattered_values_are_covered_by_their_spread():
    assert estimate_spread([1.0, 1.02, 1.01]) == pytest.approx(2 * 0.02 / 1.01)
    assert estimate_spread([3.0, 3.0, 3.0]) == 0
