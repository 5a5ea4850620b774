"""Solvers with several bodies and with tables that depend on the load, through their public states and results."""

import dataclasses

import numpy as np
import pytest

from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import GapSamples
from fastmodel.pressure.solvers import CoverSolver, FoundationSolver, Load
from meshes import TexelArray
from tests.support.cover_data import cells

ARRAY = TexelArray.grid(4, 5, 3.4e-3)
CELLS = cells(ARRAY, per_texel=2, reach=6)
GRID = CellGrid.over(ARRAY, 2, 1)
#: Twice and five times as stiff at 1 N and 3 N, with nine and seven tenths of the influence.
LOADED = dataclasses.replace(
    CELLS,
    loads=np.array([1.0, 3.0]),
    loaded_compliance=np.stack([CELLS.compliance / 2, CELLS.compliance / 5]),
    loaded_influence=np.stack([0.9 * CELLS.influence, 0.7 * CELLS.influence]),
)


def make_samples(*places, curvature=5.0):
    """Bowls over parts of the cells, each around a row and column, with partly covered cells at their rims."""
    parts = []
    for body, (row, column) in enumerate(places):
        i, j = (each.ravel() for each in np.mgrid[row - 2 : row + 3, column - 2 : column + 3])
        away = np.hypot(i - row, j - column)
        kept = away < 2.5
        i, j, away = i[kept], j[kept], away[kept]
        coverage = np.where(away > 2, 0.5, 1.0)
        x = GRID.low[0] + (j + 0.5 - 0.1 * (j - column) * (away > 2)) * GRID.edge[0]
        y = GRID.low[1] + (i + 0.5 - 0.1 * (i - row) * (away > 2)) * GRID.edge[1]
        gap = 1e-3 * body + curvature * ((x - x.mean()) ** 2 + (y - y.mean()) ** 2)
        parts.append((np.full(len(i), body), i, j, coverage, x, y, gap))
    body, i, j, coverage, x, y, gap = (np.concatenate(each) for each in zip(*parts, strict=True))
    place, normal = np.column_stack([x, y, 0 * x]), np.tile([0, 0, 1.0], (len(x), 1))
    return GapSamples(body, i, j, coverage, x, y, gap, place, normal)


def press(force, moment=(0.0, 0.0), *, tilts=False):
    return Load.on_plate(force, np.array(moment), tilts=tilts)


def build(cover=CELLS):
    bases = [GRID.build_base_forces(each, ARRAY) for each in cover.under_loads]
    return CoverSolver(cover, GRID, tolerance=1e-7, steps=1000, bases=bases)


def test_samples_know_their_bodies_and_lowest_gaps():
    samples = make_samples((4, 4), (4, 9))
    assert samples.count == len(samples.gap)
    assert samples.bodies_found == [0, 1]
    np.testing.assert_allclose(samples.lowest, [samples.gap[samples.body == k].min() for k in (0, 1)])
    apart = dataclasses.replace(samples, body=2 * samples.body)
    assert apart.bodies_found == [0, 2]
    assert apart.lowest[1] == np.inf
    np.testing.assert_allclose(apart.lowest[[0, 2]], samples.lowest)


@pytest.mark.parametrize("load", [0.0, 0.25, 1.0, 1.5, 3.0, 8.0])
def test_base_forces_lie_between_those_of_the_tabulated_loads(load):
    solver, window = build(LOADED), np.random.default_rng(0).uniform(0, 1, (4, 5))
    solver.set_state({"stretching": np.array([load, 1.0]), "last": np.zeros((3, 0))})
    factor = np.interp(load, [0, 1, 3], [1, 0.9, 0.7])
    plain = GRID.build_base_forces(CELLS, ARRAY).from_window(window, (3, 4))
    np.testing.assert_allclose(solver.find_base_forces(window, (3, 4)), factor * plain, atol=1e-6 * plain.max())


@pytest.mark.parametrize(("force", "stiffer"), [(0.4, 1), (0.6, 2), (1.9, 2), (2.1, 5), (50.0, 5)])
def test_the_heaviest_body_determines_the_table(force, stiffer):
    """Where the depths of a ball are not known its force does; the second body is lighter."""
    samples, loads = make_samples((4, 4), (4, 9)), [press(0.3), press(force, (0.0, 0.0))]
    plain = dataclasses.replace(CELLS, compliance=CELLS.compliance / stiffer)
    for order in (slice(None), slice(None, None, -1)):
        found, expected = (build(each).solve(samples, loads[order]) for each in (LOADED, plain))
        np.testing.assert_allclose(found.forces, expected.forces, atol=2e-6 * max(force, 1))
        np.testing.assert_allclose(found.approach, expected.approach, rtol=1e-4)


def test_a_body_that_sinks_less_than_the_ball_is_solved_at_a_smaller_load():
    samples = make_samples((4, 4), curvature=1.0)
    depth = build().solve(samples, [press(2.0)]).approach[0]
    shallow = dataclasses.replace(LOADED, load_depths=np.array([5, 9]) * depth)
    solver = build(shallow)
    solution = solver.solve(samples, [press(2.0)])
    np.testing.assert_allclose(solution.forces, build().solve(samples, [press(2.0)]).forces, atol=1e-6)
    load, share = solver.get_state()["stretching"]
    assert load == pytest.approx(2.0 * share, rel=0.3)
    wanted = shallow.load_at_depth(float(solution.approach[0]) / 0.85)
    assert abs(shallow.position_among_loads(load) - shallow.position_among_loads(wanted)) < 0.25
    assert share < 0.2


def test_a_restored_solver_goes_on_bit_for_bit_and_a_reset_one_starts_anew():
    first, second = make_samples((4, 4)), make_samples((4, 5))
    solver, other, fresh = build(LOADED), build(LOADED), build(LOADED)
    cold = solver.solve(first, [press(1.2)])
    state = solver.get_state()
    rows = np.array([first.row, first.column, cold.forces / first.coverage])
    np.testing.assert_allclose(state["last"], rows)
    other.set_state(state)
    one, two = (each.solve(second, [press(1.3)]) for each in (solver, other))
    np.testing.assert_array_equal(one.forces, two.forces)
    assert one.steps == two.steps
    solver.reset()
    again, new = (each.solve(second, [press(1.3)]) for each in (solver, fresh))
    np.testing.assert_array_equal(again.forces, new.forces)
    assert again.steps == new.steps


@pytest.mark.parametrize("tilts", [False, True])
def test_springs_under_several_bodies_bear_each_its_own_load(tilts):
    modulus = 3e8
    samples, loads = make_samples((4, 4), (5, 9)), [press(0.5), press(1.5, (0.01, -0.005), tilts=tilts)]
    bases = [GRID.build_base_forces(CELLS, ARRAY)]
    found, bare = FoundationSolver(GRID, modulus, bases).solve(samples, loads), FoundationSolver(GRID, modulus)
    np.testing.assert_allclose(np.bincount(samples.body, found.forces), [0.5, 1.5])
    spring = modulus * GRID.edge[0] * GRID.edge[1] * samples.coverage
    np.testing.assert_allclose(found.forces, spring * np.maximum(found.surface - samples.gap, 0), atol=1e-7)
    for body in (0, 1):
        own = samples.body == body
        columns = np.column_stack([np.ones(own.sum()), samples.x[own], samples.y[own]])[:, : 3 if body and tilts else 1]
        motion = np.linalg.lstsq(columns, found.surface[own], rcond=None)[0]
        np.testing.assert_allclose(columns @ motion, found.surface[own], atol=1e-12)
        if body and tilts:
            assert np.abs(motion[1:]).min() > 1e-5
    # on the window of whole cells the force on a part of a cell is that on the cell
    rows, columns = samples.row - found.origin[0], samples.column - found.origin[1]
    expected = np.zeros(found.window.shape)
    np.add.at(expected, (rows, columns), found.forces)
    np.testing.assert_allclose(found.window, expected)
    alone = bare.solve(samples, loads)
    np.testing.assert_allclose(alone.forces, found.forces)
    assert (alone.window, alone.shares, alone.approach) == (None, None, None)
    assert bare.find_base_forces(expected, (0, 0)) is None
    assert (bare.get_state(), bare.reset()) == ({}, None)
