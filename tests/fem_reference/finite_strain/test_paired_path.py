"""A path and its baseline on a block: their difference, and the starts that it gives on finer grids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference.finite_strain.block_path import (
    PairedPath,
    add_change,
    lay_out_block,
    mesh_block,
    press_paired,
)
from fem_reference.finite_strain.contact_problem import Guess
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from meshes import Box, Cover, Layer, Material

FACE = Box(size=(3e-3, 2e-3, 5e-3))
RUBBER = Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 0.4e6}, poisson_ratio=0.45)
COVER = Cover(layers=(Layer(thickness=2e-3, material=RUBBER),))


def path(*depths):
    return LoadingPath(cover=COVER, indenter=FACE, targets=depths, control="depth")


def block(n):
    return lay_out_block(
        path(0.1e-3), elements_per_thickness=n, contact_half=FACE.footprint, fillet=0.8e-3 / n, reach=1e-3
    )


def grid(n):
    return mesh_block(block(n), Units.of(COVER).scale_cover(COVER), n)


@pytest.fixture(scope="module")
def pressed():
    """A path of two depths on a coarse grid."""
    depths = (0.1e-3, 0.3e-3)
    return press_paired(path(*depths), block(2), depths, elements_per_thickness=2)


@pytest.mark.slow
def test_both_paths_reach_their_targets_and_differ_more_at_larger_depth(pressed):
    rest, deep, pair = pressed
    for small, large, depth in zip(rest, deep, (0.1e-3, 0.3e-3), strict=True):
        assert (small.depth, large.depth) == pytest.approx((depth, depth), rel=1e-9)
    added = [large.total_force / small.total_force - 1 for small, large in zip(rest, deep, strict=True)]
    assert abs(added[0]) < abs(added[1]) / 2
    assert pair.ratio == pytest.approx(1e3)


@pytest.mark.slow
def test_a_target_has_the_same_solution_alone_as_after_others(pressed):
    alone = press_paired(path(0.3e-3), block(2), [0.3e-3], elements_per_thickness=2)
    for together, single in zip(pressed[:2], alone[:2], strict=True):
        assert together[1].total_force == pytest.approx(single[0].total_force, rel=3e-4)
        pressure = single[0].base.pressure
        assert together[1].base.pressure == pytest.approx(pressure, abs=2e-3 * pressure.max())


@pytest.mark.slow
def test_a_start_from_a_coarser_grid_changes_no_result(pressed):
    depths = [0.1e-3, 0.3e-3]
    alone, after = (
        press_paired(path(*depths), block(3), depths, elements_per_thickness=3, coarser=b) for b in (None, pressed[2])
    )
    for one, other in zip(alone[1], after[1], strict=True):
        assert other.total_force == pytest.approx(one.total_force, rel=5e-4)


def test_the_difference_of_both_paths_is_transferred_to_a_finer_grid(pressed):
    """Linear displacements are transferred exactly; without a difference nothing is."""
    pair = pressed[2]
    target = grid(3)
    still = replace(
        pair,
        full=[
            replace(each, state=pair.ratio * each.state, depth=pair.ratio * each.depth, before_augmentation=None)
            for each in pair.baseline
        ],
        baseline=[replace(each, before_augmentation=None) for each in pair.baseline],
    )
    for each in still.transfer_changes(target):
        assert np.abs(each.state).max() == 0
        assert each.depth == 0
    slope = np.array([[0.1, -0.2, 0.3], [0.0, 0.2, 0.1], [-0.1, 0.05, 0.2]])
    added = [
        replace(each, state=each.state + _linear(pair.elements, slope), depth=each.depth + 0.1) for each in still.full
    ]
    within = (target.nodes <= pair.elements.nodes.max(axis=0) + 1e-9).all(axis=1).repeat(3)
    assert within.mean() > 0.8
    for each in replace(still, full=added).transfer_changes(target):
        moved = each.state[: target.displacements][within]
        assert moved == pytest.approx(_linear(target, slope)[: target.displacements][within], abs=1e-8)
        assert each.depth == pytest.approx(0.1)


def _linear(elements, slope):
    """A field of constant displacement gradient, without pressure."""
    return np.concatenate([(elements.nodes @ slope.T).ravel(), np.zeros(elements.pressures)])


def test_points_in_contact_keep_their_gap_when_a_change_moves_them(pressed):
    pair = pressed[2]
    surface = replace(block(2).surface, load_scale=1.0)
    rest = pair.baseline[1].before_augmentation
    still = Guess(state=pair.ratio * rest.state, depth=pair.ratio * rest.depth)
    change = Guess(state=0.02 * _linear(pair.elements, np.eye(3)), depth=0.01)
    found = add_change(still, change, pair.elements, surface)
    top = np.flatnonzero(pair.elements.nodes[:, 2] > 1 - 1e-9)

    def gap(guess, places):
        return surface.height(*places.T) - guess.depth - guess.state[3 * top + 2]

    here = pair.elements.nodes[top, :2]
    moved = here + np.stack([found.state[3 * top], found.state[3 * top + 1]], axis=1)
    before = gap(still, here)
    touched = before < 0.01 * still.depth
    assert 10 < touched.sum() < len(top)
    assert gap(found, moved)[touched] == pytest.approx(before[touched], abs=1e-12)
    kept = np.setdiff1d(np.arange(len(found.state)), 3 * top[touched] + 2)
    assert (found.state[kept] == (still.state + change.state)[kept]).all()
    assert found.depth == still.depth + change.depth


@pytest.mark.slow
def test_a_guess_that_fails_changes_no_result(pressed, caplog):
    """A guess with inverted elements is given up, and steps are taken instead."""
    pair = pressed[2]
    wild = [
        replace(
            each,
            before_augmentation=replace(
                each.before_augmentation, state=each.before_augmentation.state - _linear(pair.elements, 3 * np.eye(3))
            ),
        )
        for each in pair.full
    ]
    misleading = PairedPath(elements=pair.elements, baseline=pair.baseline, full=wild, ratio=pair.ratio)
    with caplog.at_level("INFO", logger="fem_reference.finite_strain.contact_problem"):
        found = press_paired(
            path(0.1e-3),
            block(2),
            [0.1e-3],
            elements_per_thickness=2,
            coarser=replace(misleading, baseline=pair.baseline[:1], full=wild[:1]),
        )
    failures = [record for record in caplog.records if record.getMessage().startswith("guess for depth")]
    assert len(failures) == 1
    assert float(failures[0].args[1]) == pytest.approx(0.05)  # of the thickness, not of its thousandth
    assert found[1][0].total_force == pytest.approx(pressed[1][0].total_force, rel=3e-4)
