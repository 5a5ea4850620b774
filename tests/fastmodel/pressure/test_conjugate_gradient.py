import numpy as np
import pytest

from fastmodel import ShapeError
from fastmodel.pressure.base_forces import BaseForces
from fastmodel.pressure.conjugate_gradient import CoverSolver, Settings
from fastmodel.pressure.gap_sampling import Load, sample
from fastmodel.pressure.winkler import foundation_forces
from meshes import Box, Cylinder, LetterH, Nut, Sphere, TexelArray
from tests.support.cover_data import WTS, cells
from tests.support.gap_samples import GRID, standing

CELLS = cells()
SHAPES = [Box(size=(12e-3, 7e-3, 5e-3)), Nut(across=13e-3, bore=8e-3), LetterH(size=(12e-3, 16e-3), bar=4e-3)]
SHAPES += [Sphere(radius=5e-3), Cylinder(radius=0.3e-3)]


def dense(samples, solver):
    """The compliance as a matrix, column by column."""
    from fastmodel.pressure.conjugate_gradient import _Operator

    operator = _Operator(solver, samples)
    first, second = operator.matrices
    n, m = first.shape[1], second.shape[1]
    matrix = np.zeros((samples.count, samples.count))
    for k in range(samples.count):
        unit = np.zeros(samples.count)
        unit[k] = 1
        window = operator.on_cells(unit)
        flat = sum(
            a @ window @ b for a, b in zip(first.reshape(-1, n, n), second.reshape(-1, m, m), strict=True)
        ).ravel()
        matrix[:, k] = (operator.weight * flat[operator.target]).sum(axis=0) + operator.soft * unit
    return matrix


@pytest.mark.parametrize("native", [False, True], ids=["numpy", "numba"])
@pytest.mark.parametrize("tilts", [False, True], ids=["guided", "free"])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_pressure_where_it_touches_and_no_overlap_elsewhere(shape, tilts, native):
    """The conditions of the minimum, each one: balance, no pull, one plane under the contact, a gap beside it."""
    if native:
        pytest.importorskip("numba")
    samples = sample(GRID, [standing(shape, yaw=0.3)], [2e-3])
    moment = 3.0 * np.array([0.7e-3, -1.1e-3]) + (3.0 * 0.3e-3 if samples.count > 9 else 0.0)
    solver = CoverSolver(CELLS, GRID, Settings(tolerance=1e-10, steps=2000), native=native)
    found = solver.solve(samples, [Load(force=3.0, moment=moment, tilts=tilts)])
    assert found.converged
    assert found.forces.min() >= 0
    assert found.forces.sum() == pytest.approx(3.0, rel=1e-8)
    matrix = dense(samples, solver)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * matrix.max())
    overlap = matrix @ found.forces + samples.gap
    columns = np.column_stack([np.ones(samples.count), samples.x, samples.y])[:, : 3 if tilts else 1]
    active = found.forces > 0
    motion = np.linalg.lstsq(columns[active], overlap[active], rcond=None)[0]
    apart = overlap - columns @ motion
    scale = np.abs(matrix @ found.forces).max()
    assert np.abs(apart[active]).max() < 1e-5 * scale
    assert apart[~active].min(initial=0) > -1e-5 * scale
    if tilts and samples.count > 9:  # a point can be tilted about nothing
        np.testing.assert_allclose([found.forces @ samples.x, found.forces @ samples.y], moment, atol=1e-9)


def test_a_warm_start_changes_nothing_but_the_steps():
    solver = CoverSolver(CELLS, GRID, Settings(tolerance=1e-8, steps=2000))
    before = sample(GRID, [standing(SHAPES[1])], [2e-3])
    after = sample(GRID, [standing(SHAPES[1], at=(0.8e-3, -1.1e-3))], [2e-3])
    load = [Load(force=3.0, moment=np.zeros(2), tilts=False)]
    solver.solve(before, load)
    warm = solver.solve(after, load)
    solver.reset()
    cold = solver.solve(after, load)
    np.testing.assert_allclose(warm.forces, cold.forces, atol=1e-6)
    assert warm.steps < cold.steps


def test_moments_that_no_pressure_can_carry_are_let_go():
    samples = sample(GRID, [standing(SHAPES[0])], [2e-3])
    found = CoverSolver(CELLS, GRID, Settings()).solve(
        samples, [Load(force=1.0, moment=np.array([0.1, 0]), tilts=True)]
    )
    assert found.converged
    assert found.forces.sum() == pytest.approx(1.0)


def test_two_bodies_sink_by_their_own_weights_and_feel_one_another():
    bodies = [standing(SHAPES[0], at=(0, -3.6e-3)), standing(SHAPES[0], at=(0, 3.6e-3))]
    samples = sample(GRID, bodies, [1e-3, 1e-3])
    loads = [Load(force=force, moment=np.zeros(2), tilts=False) for force in (4.0, 1.0)]
    solver = CoverSolver(CELLS, GRID, Settings(tolerance=1e-7))
    found = solver.solve(samples, loads)
    sums = np.bincount(samples.body, found.forces)
    np.testing.assert_allclose(sums, [4, 1], rtol=1e-6)
    alone = solver.solve(sample(GRID, bodies[1:], [1e-3]), loads[1:])
    assert found.approach[1] > 1.02 * alone.approach[0]


def test_force_at_the_base_is_the_influence_of_every_cell():
    base = BaseForces(CELLS, GRID, WTS)
    rng = np.random.default_rng(0)
    window, origin = rng.uniform(0, 1, (9, 11)), (13, 5)
    found = WTS.image(base.of_window(window, origin))
    expected = np.zeros((14, 6))
    for i, j in np.ndindex(window.shape):
        for r, c in np.ndindex(expected.shape):
            a = origin[0] + i - GRID.margin - 4 * r + CELLS.reach
            b = origin[1] + j - GRID.margin - 4 * c + CELLS.reach
            if 0 <= a < len(CELLS.influence) and 0 <= b < len(CELLS.influence):
                expected[r, c] += window[i, j] * CELLS.influence[a, b]
    np.testing.assert_allclose(found, expected, atol=1e-5 * expected.max())


def test_even_forces_on_texels_go_the_same_way():
    base = BaseForces(CELLS, GRID, WTS)
    forces = np.zeros(84)
    forces[40] = 2.0
    s = CELLS.per_texel
    window = np.full((s, s), 2.0 / s**2)
    there = base.of_window(window, (GRID.margin + s * (40 // 6), GRID.margin + s * (40 % 6)))
    np.testing.assert_allclose(base.of_texels(forces), there, atol=1e-12)


def test_springs_carry_force_and_moments_too():
    samples = sample(GRID, [standing(Sphere(radius=5e-3), at=(1e-3, 2e-3))], [2e-3])
    for tilts in (False, True):
        moment = 2.0 * np.array([1.1e-3, 2.05e-3])
        forces, levels = foundation_forces(
            samples, [Load(force=2.0, moment=moment, tilts=tilts)], 2e9 * 0.85e-3**2 * samples.coverage
        )
        assert forces.min() >= 0
        assert forces.sum() == pytest.approx(2.0)
        np.testing.assert_array_equal(forces > 0, levels > samples.gap)
        if tilts:
            np.testing.assert_allclose([forces @ samples.x, forces @ samples.y], moment, atol=1e-8)


def test_modulus_is_that_of_the_patch():
    """A foundation with it yields to even pressure on the patch by the mean of what the cells yield."""
    n = 9  # 4 thicknesses of 2 mm in cells of 0.85 mm
    rows, columns = np.divmod(np.arange(n * n), n)
    matrix = CELLS.compliance[np.abs(np.subtract.outer(rows, rows)), np.abs(np.subtract.outer(columns, columns))]
    assert CELLS.foundation_modulus() == pytest.approx(1 / matrix.sum(axis=1).mean(), rel=1e-12)


def test_cells_that_do_not_divide_the_pitch_are_refused():
    with pytest.raises(ShapeError, match="pitch"):
        CELLS.check(TexelArray.grid(4, 4, 3.0e-3))


def test_whatever_goes_wrong_inside_the_loads_stay_carried():
    """Cut off after no step at all, and fed with a start that is no number."""
    samples = sample(GRID, [standing(SHAPES[3], at=(-0.00795, 0.01658))], [2e-3])
    load = [Load(force=0.2, moment=np.zeros(2), tilts=False)]
    for steps in (0, 1, 2):
        found = CoverSolver(CELLS, GRID, Settings(tolerance=1e-12, steps=steps)).solve(samples, load)
        assert not found.converged
        assert found.forces.sum() == pytest.approx(0.2, rel=1e-6)
        assert found.forces.min() >= 0
    solver = CoverSolver(CELLS, GRID, Settings())
    solver._start = lambda *_: np.full(samples.count, np.nan)
    assert solver.solve(samples, load).forces.sum() == pytest.approx(0.2, rel=1e-6)
