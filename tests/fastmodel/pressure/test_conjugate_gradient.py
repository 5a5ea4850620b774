import numpy as np
import pytest

from fastmodel.pressure.gap import sample_gap
from fastmodel.pressure.pressure_kernels import place_cells
from fastmodel.pressure.solvers import TILT, CoverSolver, Load
from meshes import Box, Cylinder, LetterH, Nut, Sphere
from tests.support.cover_data import cells
from tests.support.posed_bodies import GRID, pose_body

CELLS = cells()
SHAPES = [Box(size=(12e-3, 7e-3, 5e-3)), Nut(across=13e-3, bore=8e-3), LetterH(size=(12e-3, 16e-3), bar=4e-3)]
SHAPES += [Sphere(radius=5e-3), Cylinder(radius=0.3e-3)]


def press_guided(force):
    return Load.on_plate(force=force, moment=np.zeros(2), tilts=False)


def build_matrix(samples, solver):
    """The compliance between sampled cells as a dense matrix [m/N], from the weights and the kernel of the cover."""
    data = (samples.row, samples.column, samples.coverage, samples.x, samples.y)
    _, _, corner, weight, own = place_cells(data, GRID.arrays, solver._near[0], solver._square)
    rows = corner[0] + np.array([[0], [0], [1], [1]])
    columns = corner[1] + np.array([[0], [1], [0], [1]])
    kernel = np.zeros((100, 100))
    size = CELLS.compliance.shape
    kernel[: size[0], : size[1]] = CELLS.compliance / (CELLS.cell[0] * CELLS.cell[1])
    matrix = np.diag(own)
    for a, b in np.ndindex(4, 4):
        apart = np.abs(np.subtract.outer(rows[a], rows[b])), np.abs(np.subtract.outer(columns[a], columns[b]))
        matrix += weight[a][:, None] * kernel[apart] * weight[b]
    return matrix


@pytest.mark.parametrize("tilts", [False, True], ids=["guided", "free"])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_solution_meets_the_conditions_of_the_minimum(shape, tilts):
    """Balance; no tension; one plane under the contact; a gap beside it; a tilt in proportion to missed moments."""
    samples = sample_gap(GRID, [pose_body(shape, yaw=0.3)], [2e-3])
    moment = 3.0 * np.array([0.7e-3, -1.1e-3]) + (3.0 * 0.3e-3 if samples.count > 9 else 0.0)
    solver = CoverSolver(CELLS, GRID, tolerance=1e-10, steps=2000)
    found = solver.solve(samples, [Load.on_plate(force=3.0, moment=moment, tilts=tilts)])
    assert found.converged
    assert found.forces.min() >= 0
    assert found.forces.sum() == pytest.approx(3.0, rel=1e-8)
    matrix = build_matrix(samples, solver)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * matrix.max())
    overlap = matrix @ found.forces + samples.gap
    columns = np.column_stack([np.ones(samples.count), samples.x, samples.y])[:, : 3 if tilts else 1]
    active = found.forces > 0
    motion = np.linalg.lstsq(columns[active], overlap[active], rcond=None)[0]
    apart = overlap - columns @ motion
    scale = np.abs(matrix @ found.forces).max()
    # the convolution of the solver leaves out small singular values of the kernel
    assert np.abs(apart[active]).max() < 3e-4 * scale
    assert apart[~active].min(initial=0) > -3e-4 * scale
    if tilts:
        missed = moment - [found.forces @ samples.x, found.forces @ samples.y]
        assert np.abs(missed).max() < 3.0 * (5e-6 if active.sum() > 25 else 0.5e-3)
        if active.sum() > 25:  # fewer cells may lie on a line, which has no tilt across
            edge, compliance = np.sqrt(GRID.edge[0] * GRID.edge[1]), solver._near[0][0, 0]
            slack = TILT * compliance / edge**2
            np.testing.assert_allclose(motion[1:], slack * missed, atol=3e-2 * slack * np.abs(missed).max())


def test_a_warm_start_changes_only_the_number_of_steps():
    solver = CoverSolver(CELLS, GRID, tolerance=1e-8, steps=2000)
    before = sample_gap(GRID, [pose_body(SHAPES[1])], [2e-3])
    after = sample_gap(GRID, [pose_body(SHAPES[1], at=(0.8e-3, -1.1e-3))], [2e-3])
    solver.solve(before, [press_guided(3.0)])
    warm = solver.solve(after, [press_guided(3.0)])
    solver.reset()
    cold = solver.solve(after, [press_guided(3.0)])
    np.testing.assert_allclose(warm.forces, cold.forces, atol=1e-6)
    assert warm.steps < cold.steps


def test_two_bodies_sink_by_their_own_weights_and_by_that_of_the_other():
    bodies = [pose_body(SHAPES[0], at=(0, -3.6e-3)), pose_body(SHAPES[0], at=(0, 3.6e-3))]
    loads = [press_guided(4.0), press_guided(1.0)]
    solver = CoverSolver(CELLS, GRID, tolerance=1e-7)
    samples = sample_gap(GRID, bodies, [1e-3, 1e-3])
    found = solver.solve(samples, loads)
    np.testing.assert_allclose(np.bincount(samples.body, found.forces), [4, 1], rtol=1e-6)
    alone = solver.solve(sample_gap(GRID, bodies[1:], [1e-3]), loads[1:])
    assert found.approach[1] > 1.02 * alone.approach[0]


def test_loads_stay_balanced_when_the_iteration_is_cut_off_or_diverges_or_no_pressure_has_the_moments():
    samples = sample_gap(GRID, [pose_body(SHAPES[0])], [2e-3])
    found = CoverSolver(CELLS, GRID).solve(samples, [Load.on_plate(force=1.0, moment=np.array([0.1, 0]), tilts=True)])
    assert found.converged
    assert found.forces.sum() == pytest.approx(1.0)
    samples = sample_gap(GRID, [pose_body(SHAPES[3], at=(-0.00795, 0.01658))], [2e-3])
    load = [press_guided(0.2)]
    for steps in (0, 1, 2):
        found = CoverSolver(CELLS, GRID, tolerance=1e-12, steps=steps).solve(samples, load)
        assert not found.converged
        assert found.forces.sum() == pytest.approx(0.2, rel=1e-6)
        assert found.forces.min() >= 0
    solver = CoverSolver(CELLS, GRID)
    solver._last = (samples.row, samples.column, np.full(samples.count, np.nan))
    assert solver.solve(samples, load).forces.sum() == pytest.approx(0.2, rel=1e-6)
