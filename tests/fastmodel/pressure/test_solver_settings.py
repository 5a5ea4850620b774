"""Numbers of steps that nobody gives, images of points that do not divide cells, and blocks of worlds."""

import numpy as np
import pytest

from fastmodel import ContactFunctions, FastModelError
from fastmodel.pressure.gap import sample_gap
from fastmodel.pressure.solvers import CoverSolver, Load
from meshes import Sphere, TexelArray
from tests.support import cover_data
from tests.support.posed_bodies import GRID, pose_body

ARRAY = TexelArray.grid(3, 2, 3.4e-3, margin=0.0)
FUNCTIONS = ContactFunctions(cover_data.parameters(ARRAY))
SHAPE = (FUNCTIONS.grid.rows, FUNCTIONS.grid.columns)


def draw_gaps(count):
    """Bowls off the middle, and loads."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE).reshape(2, 1, 1) / 2 + 0.5
    gaps = [4e-6 * (x - a) ** 2 + 7e-6 * (y - b) ** 2 + 3e-6 * x for a, b in random.uniform(-1, 1, (count, 2))]
    return np.where(np.hypot(x, y) < 3.8, np.array(gaps), np.inf), random.uniform(0.5, 2, count)


def test_a_solver_without_settings_stops_at_the_documented_limits():
    samples, loads = (
        sample_gap(GRID, [pose_body(Sphere(radius=9e-3))], [1e-3]),
        [Load.on_plate(3.0, np.zeros(2), tilts=False)],
    )
    cells = cover_data.cells()
    plain, given = CoverSolver(cells, GRID), CoverSolver(cells, GRID, tolerance=2e-4, steps=200)
    one, other = (each.solve(samples, loads) for each in (plain, given))
    np.testing.assert_array_equal(one.forces, other.forces)
    assert one.converged
    stopped = CoverSolver(cells, GRID, tolerance=0.0).solve(samples, loads)
    few = CoverSolver(cells, GRID, tolerance=2e-4, steps=one.steps - 1).solve(samples, loads)
    assert (few.converged, few.steps) == (False, one.steps - 1)
    assert stopped.steps >= one.steps
    assert one.forces.sum() == pytest.approx(3.0)


@pytest.mark.parametrize("shape", [(2, 3), (3, 2), (1, 2)])
def test_points_divide_every_cell_alike_along_rows_and_columns(shape):
    size = tuple(each * n for each, n in zip(SHAPE, shape, strict=True))
    with pytest.raises(
        FastModelError, match=rf"gap has shape \({size[0]}, {size[1]}\); its last two dimensions must be"
    ):
        FUNCTIONS.forces(np.zeros(size), 1.0)


@pytest.mark.parametrize("gap", [np.zeros(()), np.zeros(SHAPE[1]), np.zeros((0, 0)), np.zeros((SHAPE[0], 0))])
def test_images_without_two_dimensions_are_refused(gap):
    with pytest.raises(FastModelError, match="gap has shape"):
        FUNCTIONS.forces(gap, 1.0)


def test_many_worlds_are_computed_as_each_alone():
    """More worlds than one block holds; an image of 3 x 3 points per cell gives the same."""
    gap, load = draw_gaps(66)
    found = FUNCTIONS.forces(gap, load, iterations=3)
    assert found.cell_forces.shape == (66, *SHAPE)
    for world in (0, 63, 64, 65):
        alone = FUNCTIONS.forces(gap[world], load[world], iterations=3)
        np.testing.assert_allclose(found.cell_forces[world], alone.cell_forces, atol=1e-9)
    fine = np.repeat(np.repeat(gap[:2], 3, axis=1), 3, axis=2)
    np.testing.assert_allclose(
        FUNCTIONS.forces(fine, load[:2], iterations=3).cell_forces, found.cell_forces[:2], atol=1e-9
    )
