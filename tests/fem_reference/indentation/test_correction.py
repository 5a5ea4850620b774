"""Corrections of a small-strain path, with made-up solvers whose answer is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.block_path import NodalBase
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import finite_strain
from fem_reference.indentation.finite_strain import SOLID_GRIDS, correct_path
from fem_reference.indentation.grid_solution import GridSolution, GridStudy
from meshes import Box, Roller, TexelArray
from meshes.pose import Place, Pose
from tests.support.indentations import FixedBase
from tests.support.rubber import make_cover

FACE, ROLLER = Box(size=(4e-3, 4e-3, 4e-3)), Roller(radius=4e-3, length=6e-3)
STIFFNESS, STIFFENING = 1e4, 50.0  # [N/m], [1/m]


def make_solution(force, depth, size=1.0):
    return GridSolution(
        size=size,
        total_force=force,
        depth=depth,
        area=1.0,
        contact=np.zeros((1, 3)),
        base=FixedBase(values=np.array([force, 0.0])),
        energy=force * depth / 2,
    )


def make_grids(depth):
    """Equal solutions on three grids."""
    return [make_solution(STIFFNESS * depth, depth, size) for size in (3.0, 2.0, 1.0)]


def solve(path, approaches):
    """Grids that are 10 % too stiff, of a cover that stiffens in proportion to the small-strain depth."""
    baseline = [[make_solution(1.1 * STIFFNESS * d, d) for _ in SOLID_GRIDS] for d in approaches]
    full = [[make_solution(1.1 * STIFFNESS * d * (1 + STIFFENING * d), d) for _ in SOLID_GRIDS] for d in approaches]
    return baseline, full


@given(depths=st.lists(st.floats(1e-6, 1e-3), min_size=1, max_size=4, unique=True))
def test_every_target_is_corrected_in_proportion_to_its_depth(depths):
    """Also the depths below those that a grid resolves, which get their share of the effect at a larger depth."""
    for shape in (FACE, ROLLER):
        path = LoadingPath(cover=make_cover(0.45), indenter=shape, targets=tuple(sorted(depths)), control="depth")
        accurate = [make_grids(d) for d in path.targets]
        for depth, grids in zip(path.targets, correct_path(path, accurate, solve), strict=True):
            assert len(grids) == len(SOLID_GRIDS)
            for found in grids:
                assert found.depth == pytest.approx(depth)
                assert found.total_force == pytest.approx(STIFFNESS * depth * (1 + STIFFENING * depth))


def correct_loads(law, *loads):
    """Depths of loads on a cover whose force is the small-strain one times a law of the depth over the thickness."""
    cover = make_cover(0.45)

    def solve_by(path, approaches):
        baseline, _ = solve(path, approaches)
        factors = [law(d / cover.thickness) for d in approaches]
        return baseline, [
            [replace(each, total_force=factor * each.total_force) for each in grids]
            for factor, grids in zip(factors, baseline, strict=True)
        ]

    path = LoadingPath(cover=cover, indenter=FACE, targets=loads, control="load")
    found = correct_path(path, [make_grids(load / STIFFNESS) for load in loads], solve_by)
    for load, grids in zip(loads, found, strict=True):
        assert grids[-1].total_force == pytest.approx(load)
    return [grids[-1].depth / cover.thickness for grids in found]


@pytest.mark.parametrize(
    "law", [lambda s: 1 + s / 2, lambda s: 1 - s / 2, lambda s: 1 + 4 * s**2, lambda s: np.exp(4 * s), lambda s: 1.0]
)
def test_the_cover_bears_each_load_of_a_flat_face_at_the_depth_that_is_found(law):
    loads = (1e-6, 0.8, 6.0)  # the last two at 0.04 and 0.3 of the thickness at small strain
    for load, share in zip(loads, correct_loads(law, *loads), strict=True):
        assert STIFFNESS * 2e-3 * share * law(share) == pytest.approx(load, rel=5e-3)


def test_loads_that_the_cover_bears_at_no_depth_are_refused():
    """The law has its peak of 5 N at half the thickness."""
    assert correct_loads(lambda s: 1 - s, 4.5) == pytest.approx([0.3419], abs=2e-3)
    with pytest.raises(ConvergenceError, match="no depth was found at which the cover bears 6 N; it bears"):
        correct_loads(lambda s: 1 - s, 6.0)


@pytest.mark.parametrize(("stiffening", "passes"), [(0.5, 1), (4.0, 2), (-0.8, 2)])
def test_a_load_is_solved_once_where_the_cover_stiffens_as_under_a_disk_of_its_thickness(stiffening, passes):
    """The force is 1 + s / 2 times that of small strain, and the load reaches a fifth of the thickness there."""
    asked = []

    def law(share):
        asked.append(share)
        return 1 + stiffening * share

    correct_loads(law, 0.2 * 2e-3 * STIFFNESS)
    assert len(asked) == passes


@pytest.mark.parametrize(("share", "settled"), [(0.975, True), (0.96, False), (1.025, True), (1.04, False)])
def test_six_depths_are_tried_and_three_percent_of_the_load_are_bridged(share, settled):
    """A cover that bears the same force at every depth."""
    load, asked = 1.0, []

    def law(depth):
        asked.append(depth)
        return share * load / (STIFFNESS * 2e-3 * depth)

    if settled:
        assert correct_loads(law, load)
    else:
        with pytest.raises(ConvergenceError, match="no depth was found"):
            correct_loads(law, load)
    assert len(asked) == 6


@dataclass(frozen=True)
class Fields:
    """Fields that hold their factors alone."""

    displacement: float = 1.0
    stress: float = 1.0

    def scale(self, displacement, stress):
        return Fields(self.displacement * displacement, self.stress * stress)


def test_energy_tractions_and_fields_of_a_load_belong_to_its_depth():
    """The made-up energy is half of force times depth; tractions sum to the load.  No straight law holds exactly."""

    def solve_with_fields(path, approaches):
        baseline, full = solve(path, approaches)
        for grids in full:
            for k, each in enumerate(grids):
                force = 1.1 * STIFFNESS * each.depth * law(each.depth)
                grids[k] = replace(
                    each, total_force=force, energy=force * each.depth / 2, fields=Fields(each.depth, force),
                    contact=np.array([[0.0, 0.0, force]]),
                )  # fmt: skip
        return baseline, full

    def law(depth):
        return 1 + 2e6 * depth**2

    loads = (1.0, 5.0)
    path = LoadingPath(cover=make_cover(0.45), indenter=FACE, targets=loads, control="load")
    found = correct_path(path, [make_grids(load / STIFFNESS) for load in loads], solve_with_fields)
    for load, grids in zip(loads, found, strict=True):
        for each in grids:
            assert each.total_force == pytest.approx(load)
            assert STIFFNESS * each.depth * law(each.depth) == pytest.approx(load, rel=5e-3)
            assert each.energy == pytest.approx(load * each.depth / 2)
            assert each.contact[:, 2].sum() == pytest.approx(load)
            assert (each.fields.displacement, each.fields.stress) == pytest.approx((each.depth, load))


def test_a_load_under_which_nothing_is_added_has_the_size_and_area_of_each_grid():
    grids = [replace(each, area=area) for each, area in zip(make_grids(5e-9), (3.0, 4.0, 5.0), strict=True)]
    path = LoadingPath(cover=make_cover(0.45), indenter=FACE, targets=(5e-9,), control="depth")
    (found,) = correct_path(path, [grids], None)
    assert [(each.size, each.area) for each in found] == [(3.0, 3.0), (2.0, 4.0), (1.0, 5.0)]
    assert finite_strain.state_correction(path, [grids], 0.1e-3) == {
        "strain": "small, because what finite strain adds at this depth is negligible"
    }
    for last, negligible in ((7.9e-9, True), (8.1e-9, False)):
        loads = replace(path, targets=(1e-4,), control="load")
        depths = [make_solution(1e-4, depth) for depth in (8.1e-9, 8.1e-9, last)]
        stated = finite_strain.state_correction(loads, [make_grids(1e-9), depths], 0.1e-3)
        assert ("strain" in stated) == negligible
    for other in (replace(path, fields=True), replace(path, friction=0.3), replace(path, indenter=ROLLER)):
        assert "strain" not in finite_strain.state_correction(other, [grids], 0.1e-3)
    assert set(finite_strain.state_correction(replace(path, fields=True), [grids], 0.1e-3)) == {"edge", "contact"}


def test_a_face_is_corrected_from_its_extrapolated_solution_and_a_curved_body_from_its_finest():
    """Forces of 1 + 0.1 size per grid come to 1 at size zero, and to 1.1 on the finest grid."""

    def repeat(path, _approaches):
        same = [[make_solution(STIFFNESS * d, d) for _ in SOLID_GRIDS] for d in path.targets]
        return same, same

    for shape, force in ((FACE, 1.0), (ROLLER, 1.1)):
        grids = [make_solution(1 + 0.1 * size, 1e-4, size) for size in (3.0, 2.0, 1.0)]
        path = LoadingPath(cover=make_cover(0.45), indenter=shape, targets=(1e-4,), control="depth")
        (found,) = correct_path(path, [grids], repeat)
        assert [each.total_force for each in found] == pytest.approx([force] * 3)


def test_the_area_of_a_face_is_that_of_small_strain_and_of_a_curved_body_the_corrected_one():
    def widen(path, _approaches):
        same = [[make_solution(STIFFNESS * d, d) for _ in SOLID_GRIDS] for d in path.targets]
        return same, [[replace(each, area=1.3) for each in grids] for grids in same]

    for shape, areas in ((FACE, [3.0, 4.0, 5.0]), (ROLLER, [6.5] * 3)):
        grids = [replace(each, area=area) for each, area in zip(make_grids(1e-4), (3.0, 4.0, 5.0), strict=True)]
        path = LoadingPath(cover=make_cover(0.45), indenter=shape, targets=(1e-4,), control="depth")
        (found,) = correct_path(path, [grids], widen)
        assert [each.area for each in found] == pytest.approx(areas)


def record_targets(shape, *targets, friction=0.0):
    """The depths that are solved on coarse grids."""
    asked = []

    def listen(path, approaches):
        asked.extend(path.targets)
        return solve(path, approaches)

    path = LoadingPath(cover=make_cover(0.45), indenter=shape, targets=targets, control="depth", friction=friction)
    correct_path(path, [make_grids(d) for d in targets], listen)
    return asked


def test_small_loads_of_a_flat_face_are_solved_at_a_larger_one_or_not_at_all():
    assert record_targets(FACE, 1e-6, 2e-6) == pytest.approx([0.04 * 2e-3])
    assert record_targets(FACE, 1e-9, 7.9e-9) == []  # a ten thousandth of what the grids resolve, and less
    assert record_targets(FACE, 1e-9, 8.1e-9) == pytest.approx([0.04 * 2e-3])
    assert record_targets(FACE, 1e-6, 0.1e-3) == [0.1e-3]  # a target that is large enough serves both
    assert record_targets(FACE, 1e-6, 0.159e-3) == [0.159e-3]  # up to twice what the grids resolve
    assert record_targets(FACE, 1e-6, 0.161e-3) == pytest.approx([0.04 * 2e-3, 0.161e-3])
    assert record_targets(FACE, 1e-6, 0.5e-3) == pytest.approx([0.04 * 2e-3, 0.5e-3])
    assert record_targets(FACE, 0.07e-3, 0.09e-3, 0.3e-3) == [0.09e-3, 0.3e-3]
    for shape, friction in ((FACE, 0.3), (ROLLER, 0.0)):
        assert record_targets(shape, 1e-6, 0.5e-3, friction=friction) == [1e-6, 0.5e-3]


def test_faces_that_rub_are_refined_in_turn():
    """The last solution has the changes of both others from the first one."""

    def scatter(path, approaches):
        stiff = (1.0, 1.02, 0.99)
        full = [[make_solution(factor * STIFFNESS * d, d) for factor in stiff] for d in approaches]
        return [[make_solution(STIFFNESS * d, d) for _ in stiff] for d in approaches], full

    path = LoadingPath(cover=make_cover(0.45), indenter=FACE, targets=(1e-4,), control="depth", friction=0.3)
    found = correct_path(path, [make_grids(1e-4)], scatter)[0]
    assert [each.total_force for each in found] == pytest.approx([1.0, 1.02, 1.01])


def test_each_pose_on_a_cover_of_limited_size_and_each_indenter_on_a_wide_one_is_solved_once(monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    accurate = GridStudy(solutions=[make_grids(2e-4)])
    monkeypatch.setattr("fem_reference.indentation.small_strain.study_path", lambda *_: accurate)
    solved = []

    def press(path, block, approaches, *, elements_per_thickness, coarser, progress):
        solved.append(block)
        nodes = np.linspace(0, 1e-3, 5)
        state = replace(make_solution(2.0, 2e-4), base=NodalBase(x=nodes, y=nodes, pressure=np.ones((5, 5))))
        return [state], [state], None

    monkeypatch.setattr("fem_reference.indentation.finite_strain.press_paired", press)
    path = LoadingPath(cover=make_cover(0.45), indenter=FACE, targets=(2e-4,), control="depth")
    bounded = replace(path, cover=replace(path.cover, size=(16e-3, 12e-3)))
    array, grids = TexelArray.grid(2, 2, pitch=3e-3), len(SOLID_GRIDS)
    for number, at in enumerate([(0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3)], start=1):
        for _ in range(2):
            finite_strain.study_path(bounded, Place(array=array, pose=Pose.planar(at=at)), None)
            assert len(solved) == number * grids
    for number, shape in enumerate([FACE, Box(size=(4e-3, 3e-3, 4e-3))], start=4):
        for _ in range(2):
            finite_strain.study_path(replace(path, indenter=shape), Place(array=array, pose=Pose()), None)
            assert len(solved) == number * grids
