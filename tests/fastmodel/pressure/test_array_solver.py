"""Contact problems of many worlds on oblong cells: conditions of the minimum, the other solver, and gradients."""

import numpy as np
import pytest

from fastmodel import WTS_0614_34, ContactFunctions, CoverCells, Gaussian, Parameters
from fastmodel.pressure.gap import GapSamples
from fastmodel.pressure.solvers import TILT, CoverSolver, Load
from meshes import TexelArray

PITCH, PER_TEXEL = (2e-3, 3e-3), 2
ARRAY = TexelArray.grid(3, 4, PITCH, margin=(1e-3, 0.0), active=np.arange(12) != 5)
INFLUENCE = np.random.default_rng(0).uniform(0, 0.2, (8, 8))
#: A compliance that falls faster along columns than along rows, as a product of both.
ALONG, ACROSS = np.exp(-np.arange(6) / 1.5), np.exp(-np.arange(9) / 2.5)
CELLS = CoverCells(
    per_texel=PER_TEXEL,
    cell=(1e-3, 1.5e-3),
    compliance=3e-10 * np.outer(ALONG, ACROSS),
    influence=INFLUENCE,
    top_compliance=3e-8,
    thickness=2e-3,
)
FUNCTIONS = ContactFunctions(
    Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34, surface=CELLS)
)
GRID = FUNCTIONS.grid
SHAPE = (GRID.rows, GRID.columns)
EDGE = np.sqrt(1.5e-6)
OWN = 3e-10 / 1.5e-6


def build_compliance():
    row, column = (np.abs(np.subtract.outer(np.arange(n), np.arange(n))) for n in SHAPE)
    along, across = (np.append(each, np.zeros(20)) for each in (ALONG, ACROSS))
    return OWN * np.kron(along[row], across[column])


def draw_gaps(count, seed):
    """Tilted saddles and bowls under a part of the cells."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE).reshape(2, 1, 1) / 2 + 0.5
    gaps = []
    for _ in range(count):
        a, b, c, d = random.uniform(-1, 1, 4)
        gap = 1e-5 * (a * x + b * y + (0.6 + 0.3 * c) * x**2 + (0.6 + 0.3 * d) * y**2)
        gaps.append(np.where(np.hypot(x, y) < random.uniform(2, 4), gap, np.inf))
    return np.array(gaps), random.uniform(0.5, 3.0, count)


@pytest.mark.parametrize("tilts", [False, True])
def test_forces_on_oblong_cells_obey_the_conditions_of_the_minimum(tilts):
    assert SHAPE == (6, 10)  # 3 x 4 texels, and a cell of margin at each end of the rows
    gap, load = draw_gaps(6, 1)
    x, y = (GRID.low[k] + (np.arange(SHAPE[1 - k]) + 0.5) * GRID.edge[k] for k in range(2))
    x, y = np.tile(x, SHAPE[0]), np.repeat(y, SHAPE[1])
    moments = load[:, None] * np.random.default_rng(2).uniform(-0.7e-3, 0.7e-3, (6, 2))
    found = FUNCTIONS.forces(gap, load, moments if tilts else None, iterations=60)
    compliance = build_compliance()
    for force, given, moment in zip(found.cell_forces.reshape(6, -1), gap.reshape(6, -1), moments, strict=True):
        missed = (moment - [force @ x, force @ y]) * tilts
        slope = TILT * OWN / EDGE**2 * missed
        overlap = compliance @ force - slope[0] * x - slope[1] * y
        under = np.isfinite(given)
        overlap[under] += given[under]
        pressed = force > 0
        assert not pressed[~under].any()
        depth = overlap[pressed].mean()
        assert np.abs(overlap[pressed] - depth).max() < 1e-8 * OWN * force.sum()
        assert overlap[under].min() > depth - 1e-8 * OWN * force.sum()
    np.testing.assert_allclose(found.cell_forces.sum(axis=(1, 2)), load, rtol=1e-9)
    expected = np.zeros((6, 3, 4))
    for r, c, i, j in np.ndindex(3, 4, *SHAPE):
        a, b = i - 2 * r + 3, j - 1 - 2 * c + 3
        if 0 <= a < 8 and 0 <= b < 8:
            expected[:, r, c] += INFLUENCE[a, b] * found.cell_forces[:, i, j]
    np.testing.assert_allclose(found.texel_forces, expected.reshape(6, 12) * ARRAY.active, atol=1e-6)
    assert not found.at_end.any()  # the margin is stated


@pytest.mark.parametrize("tilts", [False, True])
def test_partly_covered_oblong_cells_bear_what_the_solver_of_a_simulation_computes(tilts):
    """A turned rectangle with a curved face, sampled at 4 x 4 points a cell."""
    fine = 4
    x, y = (GRID.low[k] + (np.arange(SHAPE[1 - k] * fine) + 0.5) / fine * GRID.edge[k] for k in range(2))
    x, y = np.meshgrid(x, y)
    u, v = 0.8 * (x - 0.2e-3) + 0.6 * (y + 0.3e-3), 0.8 * (y + 0.3e-3) - 0.6 * (x - 0.2e-3)
    gap = np.where((np.abs(u) < 2.2e-3) & (np.abs(v) < 1.6e-3), u**2 / 0.3 + 1e-3 * v, np.inf)
    moment = np.array([0.5e-3, -0.9e-3])
    found = FUNCTIONS.forces(gap, 2.0, moment if tilts else None, iterations=40)

    def divide(values):
        return values.reshape(SHAPE[0], fine, SHAPE[1], fine).transpose(0, 2, 1, 3).reshape(*SHAPE, -1)

    under = divide(np.isfinite(gap))
    row, column = under.any(axis=2).nonzero()
    hits = under[row, column]
    mean = [(np.where(hits, divide(each)[row, column], 0).sum(axis=1) / hits.sum(axis=1)) for each in (x, y, gap)]
    samples = GapSamples(
        np.zeros(len(row), dtype=np.int64), row, column, hits.mean(axis=1), *mean,
        np.column_stack([*mean[:2], 0 * mean[0]]), np.tile([0, 0, 1.0], (len(row), 1)),
    )  # fmt: skip
    solver = CoverSolver(CELLS, GRID, tolerance=1e-8, steps=1000, bases=[GRID.build_base_forces(CELLS, ARRAY)])
    exact = solver.solve(samples, [Load.on_plate(2.0, moment, tilts=tilts)])
    assert exact.converged
    whole = np.zeros((20, 20))
    top, left = exact.origin
    rows, columns = exact.window.shape
    whole[5 + top : 5 + top + rows, 5 + left : 5 + left + columns] = exact.window
    np.testing.assert_allclose(found.cell_forces, whole[5:11, 5:15], atol=2e-6)
    np.testing.assert_allclose(found.texel_forces, solver.find_base_forces(exact.window, exact.origin), atol=2e-6)
    assert 0 < (hits.mean(axis=1) < 1).sum() < len(row)


@pytest.mark.parametrize("tilts", [False, True])
def test_gradients_are_those_of_finite_differences(tilts):
    """With respect to gap and to force and moments, in units of the cells' own compliance."""
    gap, load = draw_gaps(2, 3)
    random, count, steps = np.random.default_rng(4), 3 if tilts else 1, 70
    target = np.column_stack([load, load * 0.3, load * -0.2])[:, :count]
    flat = gap.reshape(2, -1) / OWN
    problem = FUNCTIONS._build(steps, target)
    forces, slope = problem.press(flat, target, steps), random.normal(size=flat.shape)
    of_gap, of_target = problem.pull_back(forces, slope, steps)
    under = np.isfinite(flat)
    assert (forces > 0).sum(axis=1).min() > 5

    def measure(gap, target):
        return (FUNCTIONS._build(steps, target).press(gap, target, steps) * slope).sum(axis=1)

    step, shift = 1e-6 * np.where(under, random.normal(size=flat.shape), 0), 1e-6 * random.normal(size=target.shape)
    ends = [measure(np.where(under, flat + sign * step, np.inf), target + sign * shift) for sign in (1, -1)]
    expected = (of_gap * step).sum(axis=1) + (of_target * shift).sum(axis=1)
    np.testing.assert_allclose(expected, (ends[0] - ends[1]) / 2, rtol=1e-4, atol=1e-10)


def test_the_cover_of_a_nominal_load_is_taken():
    """Twice as stiff and with half the influence at 2 N; the nearer of the tabulated loads counts."""
    loads = {
        "loads": np.array([2.0, 4.0]),
        "loaded_compliance": np.stack([CELLS.compliance / 2, CELLS.compliance / 4]),
        "loaded_influence": np.stack([INFLUENCE / 2, INFLUENCE / 4]),
    }
    names = ("per_texel", "cell", "compliance", "influence", "top_compliance", "thickness")
    cells = CoverCells(**{name: getattr(CELLS, name) for name in names}, **loads)
    given = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34, surface=cells)
    gap = np.where(np.arange(60).reshape(SHAPE) == 23, 0.0, np.inf)
    for nominal, share in ((0.0, 1.0), (0.9, 1.0), (1.1, 0.5), (2.9, 0.5), (3.1, 0.25), (9.0, 0.25)):
        found = ContactFunctions(given, nominal_load=nominal).forces(gap, 2.0)
        expected = FUNCTIONS.forces(gap, 2.0)
        np.testing.assert_allclose(found.cell_forces, expected.cell_forces, atol=1e-9)
        np.testing.assert_allclose(found.texel_forces, share * expected.texel_forces, atol=1e-6)


@pytest.mark.parametrize("margin", [None, (1e-3, 1.5e-3)])
def test_the_grid_of_a_cover_with_free_sides_ends_at_the_texels_unless_a_margin_is_stated(margin):
    names = ("per_texel", "cell", "compliance", "influence", "top_compliance", "thickness")
    cells = CoverCells(**{name: getattr(CELLS, name) for name in names}, table=np.ones((12, 6, 8)))
    array = TexelArray.grid(3, 4, PITCH, margin=margin)
    given = Parameters(array=array, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34, surface=cells)
    grid = ContactFunctions(given).grid
    assert grid.margin == ((0, 0) if margin is None else (1, 1))
    assert (grid.rows, grid.columns) == (6 + 2 * grid.margin[0], 8 + 2 * grid.margin[1])
    plain = ContactFunctions(Parameters(array=array, spread=given.spread, electronics=WTS_0614_34, surface=CELLS)).grid
    assert plain.margin == ((2, 2) if margin is None else (1, 1))
