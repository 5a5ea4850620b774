"""Corrections of a small-strain path, with made-up solvers whose answer is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.fields.cover_fields import CoverFields
from fem_reference.finite_strain.block_path import BlockState
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import finite_cover, finite_strain
from fem_reference.indentation.correction import BlockModel, correct_path, solve_block_pair
from fem_reference.indentation.grid_solution import GridSolution, GridStudy, extrapolate_solutions
from fem_reference.indentation.rounding import SOLID_GRIDS, SolidGrid
from meshes import Box, Roller, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import make_cover

FACE, ROLLER = Box(size=(4e-3, 4e-3, 4e-3)), Roller(radius=4e-3, length=6e-3)
STIFFNESS, STIFFENING = 1e4, 50.0  # [N/m], [1/m]


def make_solution(force, depth, size=1.0):
    return GridSolution(
        size=size,
        total_force=force,
        depth=depth,
        area=1.0,
        overlap=0.0,
        contact=np.zeros((1, 3)),
        base_forces=lambda array, pose: np.array([force, 0.0]),
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
    assert record_targets(FACE, 1e-6, 0.5e-3) == pytest.approx([0.04 * 2e-3, 0.5e-3])


def test_curved_shapes_and_friction_are_solved_as_asked():
    assert record_targets(ROLLER, 1e-6, 2e-6) == [1e-6, 2e-6]
    assert record_targets(FACE, 1e-6, 2e-6, friction=0.3) == [1e-6, 2e-6]


def test_faces_that_rub_are_refined_in_turn():
    """The last solution has the changes of both others from the first one."""

    def scatter(path, approaches):
        stiff = (1.0, 1.02, 0.99)
        full = [[make_solution(factor * STIFFNESS * d, d) for factor in stiff] for d in approaches]
        return [[make_solution(STIFFNESS * d, d) for _ in stiff] for d in approaches], full

    path = LoadingPath(cover=make_cover(0.45), indenter=FACE, targets=(1e-4,), control="depth", friction=0.3)
    found = correct_path(path, [make_grids(1e-4)], scatter)[0]
    assert [each.total_force for each in found] == pytest.approx([1.0, 1.02, 1.01])


@pytest.mark.parametrize(("shape", "rubs", "limit"), [(FACE, False, 1.03), (FACE, True, 1.01), (ROLLER, False, 1.01)])
def test_the_limit_is_extrapolated_under_faces_that_do_not_rub_and_else_that_of_the_finest_grid(shape, rubs, limit):
    """Forces 1.07, 1.03 and 1.01 on grids of size 3, 2 and 1 lie on a line only from the second on."""
    friction = 0.3 if rubs else 0.0
    path = LoadingPath(
        cover=make_cover(0.45), indenter=shape, targets=(1e-4,), control="depth",
        friction=friction, baseline_friction=friction,
    )  # fmt: skip
    grids = [make_solution(factor * STIFFNESS * 1e-4, 1e-4, size) for factor, size in ((1.07, 4), (1.03, 2), (1.01, 1))]

    def same(_, approaches):
        one = [[make_solution(STIFFNESS * d, d) for _ in SOLID_GRIDS] for d in approaches]
        return one, one

    found = correct_path(path, [grids], same)[0]
    expected = extrapolate_solutions(grids).total_force if shape is FACE and not rubs else 1.01
    assert [each.total_force for each in found] == pytest.approx([expected] * 3)
    assert (expected == pytest.approx(1.01)) == (limit == 1.01)


def test_solutions_on_blocks_are_read_in_units_of_the_indenter_and_fields_on_the_finest_grid(monkeypatch):
    """Both loading paths are solved at their load scale, and their results are divided by it."""
    pose = Pose.planar(at=(3e-3, -1e-3), yaw=0.3)
    path = LoadingPath(
        cover=make_cover(0.45), indenter=ROLLER, targets=(1e-4, 2e-4), control="depth", friction=0.3, fields=True
    )
    place, push = np.array([[1e-3, 2e-3]]), np.array([[0.1, -0.2]])  # in the frame of the indenter

    def make_state(path, target, count):
        """A state whose numbers are those of its target and grid."""
        value = path.load_scale * target * count
        x, y = pose.to_array(*place.T)
        shear = replace(pose, point=(0.0, 0.0, 0.0)).to_array(*push.T)
        return SimpleNamespace(
            load=2 * value, depth=value, area=1e-6 * count, overlap=0.01 * value, energy=path.load_scale**2 * 5 * count,
            contact=np.column_stack([x, y, [3 * value], value * shear[0], value * shear[1]]), base=4 * value,
            fields=make_fields(target * count) if path.fields else None,
        )  # fmt: skip

    received = []

    def press(path, block, approaches, *, elements_per_thickness, coarser, progress):
        received.append((block, approaches, coarser))
        states = [[make_state(each, target, elements_per_thickness) for target in path.targets]
                  for each in (replace(path.baseline, fields=False), path)]  # fmt: skip
        return *states, f"pair on {elements_per_thickness}"

    monkeypatch.setattr("fem_reference.indentation.correction.press_paired", press)
    grids = [SolidGrid(count=count, fillet=1e-4 / count) for count in SOLID_GRIDS]
    model = BlockModel(
        kind="blocks with known answers", inputs={}, pose=pose, grids=grids, lay_out=lambda grid: grid.fillet,
        recover_pressure=lambda state: (np.zeros(1), np.zeros(1), np.array([[state.base]])),
        integrate=lambda base: lambda array, pose: base[2][0],
    )  # fmt: skip
    for _ in range(2):  # computed, then read from the store
        baseline, full = solve_block_pair(path, [1.1e-4, 2.2e-4], model, None)
        for target, *both in zip(path.targets, baseline, full, strict=True):
            for count, *solutions in zip(SOLID_GRIDS, *both, strict=True):
                value = target * count
                for found in solutions:
                    assert (found.size, found.area, found.overlap) == pytest.approx((1 / count, 1e-6 * count, 0.01))
                    assert (found.total_force, found.depth) == pytest.approx((2 * value, value))
                    assert found.energy == pytest.approx(5 * count)
                    assert found.contact == pytest.approx(np.column_stack([place, [3 * value]]))
                    assert found.base_forces(None, None) == pytest.approx([4 * value])
                assert solutions[0].shear is None
                assert solutions[1].shear == pytest.approx(value * push)
                assert solutions[0].fields is None
                assert (solutions[1].fields is not None) == (count == SOLID_GRIDS[-1])
            assert (both[1][-1].fields.stress == target * SOLID_GRIDS[-1]).all()
    pairs = [None, *(f"pair on {count}" for count in SOLID_GRIDS[:-1])]
    assert received == [(grid.fillet, [1.1e-4, 2.2e-4], pair) for grid, pair in zip(grids, pairs, strict=True)]
    bare = solve_block_pair(replace(path, fields=False), [1.1e-4, 2.2e-4], model, None)[1]
    assert [each.fields for grids in bare for each in grids] == [None] * 6


def test_each_pose_on_a_cover_of_limited_size_and_each_indenter_on_a_wide_one_is_solved_once(monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    accurate = GridStudy(solutions=[make_grids(2e-4)], least_order=1.0, assumptions={})
    monkeypatch.setattr("fem_reference.indentation.small_strain.study_path", lambda *_: accurate)
    solved = []

    def press(path, block, approaches, *, elements_per_thickness, coarser, progress):
        solved.append(block)
        nodes = np.linspace(0, 1e-3, 5)
        state = BlockState(
            load=2 * path.load_scale, depth=2e-4 * path.load_scale, area=1e-6, overlap=0.0, energy=path.load_scale**2,
            lines=(nodes, nodes), forces=np.ones((5, 5)), symmetric=block.symmetric, contact=np.zeros((1, 5)),
        )  # fmt: skip
        return [state], [state], None

    monkeypatch.setattr("fem_reference.indentation.correction.press_paired", press)
    path = LoadingPath(cover=make_cover(0.45), indenter=FACE, targets=(2e-4,), control="depth")
    bounded = replace(path, cover=replace(path.cover, size=(16e-3, 12e-3)))
    array, grids = TexelArray.grid(2, 2, pitch=3e-3), len(SOLID_GRIDS)
    for number, at in enumerate([(0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3)], start=1):
        for _ in range(2):
            finite_cover.study_path(bounded, Place(array=array, pose=Pose.planar(at=at)), None)
            assert len(solved) == number * grids
    for number, shape in enumerate([FACE, Box(size=(4e-3, 3e-3, 4e-3))], start=4):
        for _ in range(2):
            finite_strain.study_path(replace(path, indenter=shape), None)
            assert len(solved) == number * grids


def make_fields(stress):
    """The same stress at the corners of one hexahedron."""
    return CoverFields(
        position=np.zeros((8, 3)), displacement=np.zeros((8, 3)), stress=np.full((8, 3, 3), stress),
        cells=np.arange(8)[None], layer=np.zeros(1, int), axisymmetric=False,
    )  # fmt: skip
