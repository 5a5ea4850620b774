"""What finite strain in space starts from: the small-strain twin, the coarser grid's change, another load's answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference.elements.scaling import Units
from fem_reference.finite_strain.block_path import lay_out_block, mesh_block, recover_gauss_pressure
from fem_reference.finite_strain.contact_problem import Guess
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.paired_path import PairedPath, add_change, press_paired
from fem_reference.indentation import small_strain
from meshes import Box, Cover, Cylinder, Layer, Material, TexelArray
from meshes.pose import PlanarPose

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


def test_both_paths_reach_their_targets_and_differ_by_what_strain_adds(pressed):
    rest, deep, pair = pressed
    for small, large, depth in zip(rest, deep, (0.1e-3, 0.3e-3), strict=True):
        assert (small.depth / 1e-3, large.depth) == pytest.approx((depth, depth), rel=1e-9)
    added = [large.load / small.load * 1e-3 - 1 for small, large in zip(rest, deep, strict=True)]
    assert abs(added[0]) < abs(added[1]) / 2
    assert pair.ratio == pytest.approx(1e3)


@pytest.mark.slow
def test_a_target_of_a_path_is_the_one_pressed_alone(pressed):
    alone = press_paired(path(0.3e-3), block(2), [0.3e-3], elements_per_thickness=2)
    for together, single in zip(pressed[:2], alone[:2], strict=True):
        assert together[1].load == pytest.approx(single[0].load, rel=3e-4)
        pressure = recover_gauss_pressure(single[0])[2]
        assert recover_gauss_pressure(together[1])[2] == pytest.approx(pressure, abs=2e-3 * pressure.max())


@pytest.mark.slow
def test_starting_from_a_coarser_grid_changes_no_answer(pressed):
    depths = [0.1e-3, 0.3e-3]
    alone, after = (
        press_paired(path(*depths), block(3), depths, elements_per_thickness=3, coarser=b) for b in (None, pressed[2])
    )
    for one, other in zip(alone[1], after[1], strict=True):
        assert other.load == pytest.approx(one.load, rel=5e-4)


def test_the_change_that_a_coarser_grid_found_is_carried_over(pressed):
    """Linear displacements between the grids' nodes are carried exactly; nothing is added where nothing changed."""
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


def test_points_that_touched_lie_on_the_surface_where_they_have_moved_to(pressed):
    pair = pressed[2]
    surface = block(2).surface.with_load_scale(1.0)
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
def test_a_guess_that_leads_nowhere_costs_time_alone(pressed, caplog):
    """A change that turns elements inside out is given up, and the path is walked."""
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
    astray = PairedPath(elements=pair.elements, baseline=pair.baseline, full=wild, ratio=pair.ratio)
    with caplog.at_level("INFO", logger="fem_reference.finite_strain.contact_problem"):
        found = press_paired(
            path(0.1e-3),
            block(2),
            [0.1e-3],
            elements_per_thickness=2,
            coarser=replace(astray, baseline=pair.baseline[:1], full=wild[:1]),
        )
    given_up = [record for record in caplog.records if record.getMessage().startswith("guess for depth")]
    assert len(given_up) == 1
    assert float(given_up[0].args[1]) == pytest.approx(0.05)  # of the thickness, not of its thousandth
    assert found[1][0].load == pytest.approx(pressed[1][0].load, rel=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("control", ["load", "depth"])
def test_another_load_of_a_flat_face_is_the_first_scaled(control):
    linear = replace(RUBBER, model="linear-elastic", parameters={"youngs_modulus": 1e6})
    cover = Cover(layers=(Layer(thickness=2e-3, material=linear),))
    targets = (1.0, 2.5) if control == "load" else (0.1e-3, 0.25e-3)
    flat = LoadingPath(cover=cover, indenter=Cylinder(radius=2e-3), targets=targets, control=control)
    both = small_strain.solve_path(flat, None, None)
    alone = small_strain.solve_path(replace(flat, targets=targets[1:]), None, None)
    array = TexelArray.grid(6, 6, pitch=3.4e-3)
    for scaled, solved in zip(both[1], alone[0], strict=True):
        for name in ("total_force", "depth", "area"):
            assert getattr(scaled, name) == pytest.approx(getattr(solved, name), rel=1e-6)
        assert scaled.contact == pytest.approx(solved.contact, rel=1e-6)
        forces = scaled.texel_forces(array, PlanarPose(at=(1e-3, 0.0)))
        assert forces == pytest.approx(solved.texel_forces(array, PlanarPose(at=(1e-3, 0.0))), rel=1e-6)
        assert forces.sum() == pytest.approx(scaled.total_force, rel=2e-2)
