"""The loops of the kernels for the pressure against matrices of numpy, at inputs by which every term counts."""

import numpy as np
import pytest
from scipy.optimize import minimize

from fastmodel.pressure.pressure_kernels import (
    constrain_forces,
    find_modes,
    gather_shares,
    match_springs,
    minimise_energy,
    place_cells,
    spread_on_window,
)
from fastmodel.pressure.solvers import find_start

LOW, EDGE = np.array([-4e-3, -7e-3]), np.array([0.8e-3, 1.3e-3])
NEAR, SQUARE = np.array([[5.0, 1.5], [2.0, 0.7]]), 3.0


def place(row, column, coverage, across, along):
    """Cells whose covered parts have centroids that lie off their centres by parts of the edges."""
    x = LOW[0] + (column + 0.5 + across) * EDGE[0]
    y = LOW[1] + (row + 0.5 + along) * EDGE[1]
    return place_cells((row, column, coverage, x, y), (np.array([30, 20]), LOW, EDGE), NEAR, SQUARE)


@pytest.mark.parametrize(("rows", "columns", "shape"), [((5, 5), (8, 8), (4, 4)), ((5, 6), (8, 14), (4, 12))])
def test_a_cell_is_divided_so_that_its_centroid_stays(rows, columns, shape):
    row, column = np.array([rows[0], rows[1], rows[0]]), np.array([columns[1], columns[0], columns[0]])
    across, along = np.array([0.25, -0.4, 0.0]), np.array([-0.125, 0.3, 0.0])
    coverage = np.array([1.0, 0.25, 0.0625])
    origin, size, corner, weight, own = place(row, column, coverage, across, along)
    assert origin == (rows[0] - 1, columns[0] - 1)
    assert size == shape
    up, aside = np.array([[0], [0], [1], [1]]), np.array([[0], [1], [0], [1]])
    np.testing.assert_allclose(weight.sum(axis=0), 1, rtol=1e-12)
    np.testing.assert_allclose((weight * (corner[0] + up)).sum(axis=0), row + along - origin[0], atol=1e-8)
    np.testing.assert_allclose((weight * (corner[1] + aside)).sum(axis=0), column + across - origin[1], atol=1e-8)
    assert (weight >= 0).all()
    assert weight[:, 2].tolist() == [1, 0, 0, 0]  # whole cells stay whole
    given = np.zeros(3)
    for a in range(4):
        for b in range(4):
            given += weight[a] * weight[b] * NEAR[abs(up[a] - up[b]), abs(aside[a] - aside[b])]
    # the compliance of the parts and the addition are that of a cell and of a square of the covered area
    np.testing.assert_allclose(own + given, NEAR[0, 0] + SQUARE * np.array([0.0, 1.0, 3.0]), rtol=1e-9)


def test_an_iteration_starts_from_the_last_pressures_scaled_to_each_load():
    """Body 0 was pressed, body 1 bore exactly half its load, and body 2 was not there."""
    last = np.array([2, 2, 3]), np.array([1, 2, 4]), np.array([4.0, 2.0, 3.0])
    row, column = np.array([2, 2, 3, 3, 0]), np.array([1, 2, 4, 5, 0])
    coverage, body = np.array([0.5, 1.0, 0.25, 0.75, 0.5]), np.array([0, 0, 1, 1, 2])
    scratch = np.zeros((5, 7))
    found = find_start(last, (row, column, coverage, body), np.array([6.0, 1.5, 2.0]), scratch)
    np.testing.assert_allclose(found, [6 * 2 / 4, 6 * 2 / 4, 1.5 * 0.25, 1.5 * 0.75, 2.0])
    assert not scratch.any()
    found = find_start(last, (row, column, coverage, body), np.array([6.0, 1.49, 2.0]), scratch)
    np.testing.assert_allclose(found[2:4], [1.49, 0])  # the last pressure, on one cell


@pytest.mark.parametrize("count", [1, 3])
def test_springs_meet_force_and_moments_as_a_minimum_of_energy_does(count):
    """The motion minimises the energy of springs and holders less the work of the loads; some cells lift off."""
    random = np.random.default_rng(4)
    gap, stiffness = random.uniform(0, 0.3, 12), random.uniform(2.0, 9.0, 12)
    columns = np.column_stack([np.ones(12), random.uniform(-2, 2, (12, 2))])[:, :count]
    target, yielding = np.array([4.0, 3.0, -5.0])[:count], np.array([0.0, 0.2, 0.5])[:count]

    def energy(motion):
        lift = np.maximum(columns @ motion - gap, 0)
        held = (motion[1:] ** 2 / yielding[1:]).sum()
        return 0.5 * (stiffness * lift**2).sum() - target @ motion + 0.5 * held

    motion = minimize(energy, np.zeros(count), method="BFGS", options={"gtol": 1e-9}).x
    forces, height = match_springs(gap, stiffness, (columns, target, yielding))
    np.testing.assert_allclose(height, columns @ motion, atol=1e-6)
    np.testing.assert_allclose(forces, stiffness * np.maximum(columns @ motion - gap, 0), atol=1e-5)
    assert 0 < (forces > 0).sum() < 12
    assert forces.sum() == pytest.approx(4.0, rel=1e-12)


def test_one_spring_takes_the_whole_load():
    found = match_springs(np.array([0.1, 0.9]), np.array([4.0, 5.0]), (np.ones((2, 1)), np.array([2.0]), np.zeros(1)))
    np.testing.assert_allclose(found, [[2.0, 0.0], [0.6, 0.6]], rtol=1e-9)


def build_cover(rows, columns, count, random, *, spread, loads=0):
    """Cells in a corner of a window, or all over it, on a cover that is a sum of two products; and its matrix."""
    apart_r, apart_c = (np.abs(np.subtract.outer(np.arange(n), np.arange(n))) for n in (rows, columns))
    terms = [(np.exp(-apart_r / 2.0), np.exp(-apart_c / 1.5)), (0.3 * np.exp(-apart_r), np.exp(-apart_c / 5.0))]
    high, wide = (rows - 1, columns - 1) if spread else (3, 3)
    chosen = random.permutation(high * wide)[:count]
    corner = np.array(np.divmod(chosen, wide))
    a, b = random.uniform(0, 1, (2, count))
    weight = np.array([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
    own = random.uniform(0.5, 1.0, count)
    shares = random.uniform(0, 1, (loads, count))
    root = random.normal(size=(loads, loads))
    remainder = 0.3 * root @ root.T
    divided = np.zeros((rows * columns, count))
    for part, (i, j) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        np.add.at(divided, ((corner[0] + i) * columns + corner[1] + j, np.arange(count)), weight[part])
    whole = sum(np.kron(along, across) for along, across in terms)
    matrix = divided.T @ whole @ divided + np.diag(own) + shares.T @ remainder @ shares
    first, second = np.concatenate([each for each, _ in terms]), np.concatenate([each for _, each in terms])
    return (corner, weight, own, first, second, shares, remainder), matrix, divided


@pytest.mark.parametrize(("spread", "loads"), [(False, 0), (True, 0), (True, 3)])
def test_forces_minimise_the_energy_of_cover_and_slacks(spread, loads):
    """Two bodies, one of which tilts, on a cover with a compliance between loads or without."""
    random = np.random.default_rng(7)
    count, rows, columns = 9, 8, 12
    cover, matrix, divided = build_cover(rows, columns, count, random, spread=spread, loads=loads)
    gap, owner = random.uniform(0, 3.0, count), np.arange(count) % 2
    given = np.zeros((count, 4))
    given[owner == 0, 0], given[owner == 1, 1] = 1, 1
    given[owner == 1, 2:] = random.uniform(-1, 1, ((owner == 1).sum(), 2))
    target, yielding = np.array([3.0, 2.0, 0.4, -0.3]), np.array([0.0, 0.0, 0.7, 1.9])
    start = random.uniform(0, 1, count)
    forces, window, motion, steps, converged = minimise_energy(
        cover, gap, (given, target, yielding), start, (1e-11, 1e-11, 300)
    )
    assert converged
    assert 0 < steps < 300
    overlap = matrix @ forces + gap - given @ motion
    np.testing.assert_allclose(overlap[forces > 0], 0, atol=2e-6)
    assert overlap.min() > -2e-6
    assert forces.min() >= 0
    assert 0 < (forces == 0).sum() < count - 3
    missing = target - given.T @ forces
    np.testing.assert_allclose(yielding * missing, [0, 0, *motion[2:]], atol=2e-6)
    np.testing.assert_allclose(missing[:2], 0, atol=1e-9)
    np.testing.assert_allclose(window.ravel(), divided @ forces, atol=1e-12)
    np.testing.assert_allclose(spread_on_window(cover[0], cover[1], forces, (rows, columns)), window)
    # the solution is a start that the next iteration accepts
    assert minimise_energy(cover, gap, (given, target, yielding), forces, (1e-5, 1e-5, 300))[3] <= 1


def test_an_iteration_without_steps_scales_the_start_to_the_loads():
    random = np.random.default_rng(1)
    cover, _, _ = build_cover(6, 6, 4, random, spread=True)
    given = np.array([[1.0, 0], [0.5, 0], [0, 1.0], [0, 2.0]])
    constraints = given, np.array([3.0, 5.0]), np.zeros(2)
    start = np.array([1.0, 2.0, 0.0, 0.0])
    forces, _, _, steps, converged = minimise_energy(cover, np.zeros(4), constraints, start, (0.0, 0.0, 0))
    # without any pressure on a body the load is shared in proportion to its column
    np.testing.assert_allclose(forces, [1.5, 3.0, 1.0, 2.0])
    assert (steps, converged) == (0, False)


def test_cells_on_a_curved_cover_share_the_loads_of_their_corners():
    random = np.random.default_rng(2)
    corners = np.array([[0, 1, 2], [2, 3, 1], [4, 3, 2]])
    parts = random.dirichlet(np.ones(3), 3)
    shared, shares = np.array([[8, 3], [3, 5], [5, 0], [0, 8], [1, 8]]), random.uniform(0, 1, (5, 2))
    loads, found = gather_shares(corners, parts, shared, shares, 10)
    assert sorted(loads) == [0, 1, 3, 5, 8]
    whole = np.zeros((10, 3))
    for cell in range(3):
        for corner in range(3):
            for each in range(2):
                point = corners[cell, corner]
                whole[shared[point, each], cell] += parts[cell, corner] * shares[point, each]
    np.testing.assert_allclose(found, whole[loads])


def draw_surface(count, seed):
    random = np.random.default_rng(seed)
    normal = random.normal((0, 0, 2), size=(count, 3))
    return random.uniform(-1, 1, (count, 3)), normal / np.linalg.norm(normal, axis=1, keepdims=True), random


@pytest.mark.parametrize("turns", [0, 2])
def test_constraints_are_forces_and_moments_about_the_point_of_the_box_next_to_the_line_of_action(turns):
    place, normal, random = draw_surface(7, 3)
    vector, point = np.array([0.5, -0.3, 2.0]), np.array([0.4, 1.9, -0.6])
    directions, about = random.normal(size=(2, 3)), random.normal(size=(turns, 3))
    columns, target = constrain_forces(place, normal, (vector, point, directions, about), 0.3)
    along = point + vector * (vector @ (place.mean(axis=0) - point)) / (vector @ vector)
    centre = np.clip(along, place.min(axis=0), place.max(axis=0))
    assert 0 < (centre != along).sum() < 3
    expected = [normal @ directions.T, np.cross(place - centre, normal) @ about.T / 0.3]
    np.testing.assert_allclose(columns, np.hstack(expected), atol=1e-12)
    moment = np.cross(along - centre, vector) @ about.T / 0.3
    np.testing.assert_allclose(target, np.append(directions @ vector, moment), atol=1e-12)


def test_modes_are_changes_of_the_forces_that_are_linear_in_place():
    place, normal, random = draw_surface(8, 5)
    forces = random.uniform(1, 2, 8)
    forces[[1, 4]] = 0
    place[4] *= 100  # bears nothing, and counts nowhere
    first, turns = random.normal(size=(1, 3)), random.normal(size=(2, 3))
    centre, farthest, modes, moments, gram, largest = find_modes(place, normal, forces, (first, turns), 0.4)
    np.testing.assert_allclose(centre, np.average(place, axis=0, weights=forces))
    on = forces > 0
    assert farthest == pytest.approx(np.linalg.norm(place[on] - centre, axis=1).max())
    columns = np.hstack([normal @ first.T, np.cross(place - centre, normal) @ turns.T / 0.4])
    expected = np.vstack([forces, forces * columns.T])
    np.testing.assert_allclose(modes, expected, atol=1e-12)
    np.testing.assert_allclose(moments, expected @ np.cross(place, normal), atol=1e-11)
    np.testing.assert_allclose(gram, columns.T @ (forces[:, None] * columns), atol=1e-12)
    np.testing.assert_allclose(largest, np.abs(columns[on]).max(axis=0))
