"""Solutions on grids: scaling, extrapolation, correction, and the estimate from three grids."""

from __future__ import annotations

from dataclasses import replace

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


@pytest.mark.parametrize(
    ("forces", "result", "error"),
    [
        # A fifth of what is extrapolated, where both extrapolations agree.
        ([2 + 0.4 * size for size in SIZES], 2.0, 0.2 * 0.4 / 9),
        # 1.25 times the change from 2.3 - 2 * 0.2 otherwise.
        ([2.5, 2.3, 2.25], 2.15, 1.25 * (2.15 - 1.9)),
        ([2.0, 2.0, 2.1], 2.3, 1.25 * (2.3 - 2.0)),
        ([2.0, 2.1, 2.1], 2.1, 1.25 * (2.3 - 2.1)),
    ],
)
def test_extrapolated_values_are_as_unsure_as_they_change(forces, result, error):
    grids, study = make_grids(*forces), GridStudy(solutions=[], extrapolate=True)
    assert float(study.combine(grids, read_force)) == pytest.approx(result)
    assert study.estimate_error(grids, read_force) == pytest.approx(error / result)
    shares = np.array([0.4, -0.3])
    found = study.texel_errors(grids, lambda each: each.total_force * shares)
    assert found == pytest.approx(error * np.abs(shares))
    floor = GridStudy(solutions=[], extrapolate=True, least_error=0.5)
    assert floor.estimate_error(grids, read_force) == 0.5
    assert floor.texel_errors(grids, lambda each: each.total_force * shares) == pytest.approx(
        0.5 * result * abs(shares)
    )


def test_texels_of_grids_that_are_refined_in_turn_add_both_errors():
    """Thrice the change by the edge, and 1.25 times what elements of a third instead of a half leave."""
    values = np.array([[1.0, 2.0, -3.0], [1.1, 1.9, -3.0], [1.2, 2.2, -3.5]])
    grids = [make_solution(size=size) for size in (1 / 2, 1 / 2, 1 / 3)]
    known = dict(zip(map(id, grids), values, strict=True))
    found = GridStudy(solutions=[], edge_safety=3.0).texel_errors(grids, lambda each: known[id(each)])
    left = (1 / 3) / (1 / 2 - 1 / 3)
    assert found == pytest.approx(3 * np.array([0.1, 0.1, 0.0]) + 1.25 * left * np.array([0.1, 0.3, 0.5]))


class Scaled:
    """Fields that hold their factors."""

    def scale(self, displacement, stress):
        return displacement, stress


@pytest.mark.parametrize(
    ("control", "force", "depth"), [("depth", 2.25, 1.0), ("load", 2.75, 2.75 * 0.5 * (1 - 0.2 / 2))]
)
def test_half_of_an_effect_at_twice_the_target_corrects_every_attribute(control, force, depth):
    """Baseline and full solution at a depth of 2: 25 % stiffer, 20 % wider, and more energy per force and depth."""
    accurate = replace(make_solution(2.0, 1.0, area=3.0, size=9.0), energy=0.45 * 2.0)
    baseline = replace(make_solution(4.4, 2.0, area=5.0, overlap=0.03, shares=(0.3, 0.3, 0.2, 0.1)), energy=0.4 * 8.8)
    full = replace(
        make_solution(5.5, 2.0, area=6.0, overlap=0.02, shares=(0.35, 0.25, 0.2, 0.1), size=0.25),
        energy=0.5 * 11.0, fields=Scaled(),
    )  # fmt: skip
    found = correct_solution(accurate, baseline=baseline, full=full, control=control, share=0.5)
    assert (found.total_force, found.depth) == pytest.approx((force, depth))
    assert (found.size, found.overlap) == (0.25, 0.03)
    assert found.area == pytest.approx(3.0 * (1 + 0.2 / 2))
    assert found.energy == pytest.approx(force * depth * 0.45 * (1 + 0.25 / 2))
    assert found.contact == pytest.approx(full.contact * [1, 1, force / 5.5])
    assert found.shear == pytest.approx(full.shear * force / 5.5)
    assert found.fields == pytest.approx((depth / 2.0, force / 5.5))
    shares = np.array([0.4 + 0.05 / 2, 0.3 - 0.05 / 2, 0.2, 0.05])
    assert read_texels(found) == pytest.approx(force * shares)
    told = correct_solution(accurate, baseline=full, full=baseline, control=control, share=0.5, area=7.0)
    assert (told.overlap, told.area, told.fields) == (0.03, 7.0, None)


def test_extrapolation_takes_everything_else_from_the_finest_grid():
    grids = [
        make_solution(2 + size, 1.0, area=each, overlap=each / 100, size=size)
        for size, each in zip(SIZES, (3.0, 4.0, 5.0), strict=True)
    ]
    found = extrapolate_solutions(grids)
    assert (found.size, found.area, found.overlap) == (1 / 9, 5.0, 0.05)
    assert found.contact is grids[2].contact
    assert found.energy == pytest.approx((2 * 1.0) / 2)
