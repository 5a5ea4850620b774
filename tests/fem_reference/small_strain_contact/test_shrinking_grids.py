"""Grids of cells that shrink to the contact of one indenter, on springs, and first guesses of a contact."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.errors import TooShallowError
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact.frictionless import guess_touching, measure_area, solve_contact
from meshes import Box, tilt_indenter

MIDDLE, WIDE, RADII = np.array([1e-3, -2e-3]), np.array([4e-3, 3e-3]), np.array([20e-3, 2e-3])
RATE, SOFT, INF = 0.8, 3e-10, np.inf
#: A cover whose layers ask for no further cells.
PLAIN = SimpleNamespace(bending=INF, thickness=2e-3)


class Springs:
    """A curved place whose cells move alone; it notes the grids that it is asked for."""

    is_face, window = False, (MIDDLE, WIDE)

    def __init__(self, floor=0.0):
        self.floor, self.grids = floor, []

    def gap(self, x, y):
        return self.floor + (x - MIDDLE[0]) ** 2 / (2 * RADII[0]) + (y - MIDDLE[1]) ** 2 / (2 * RADII[1])

    def rate(self, x, _):
        return np.full(x.shape, RATE)

    def compliance(self, _, x, y, cell):
        self.grids.append((x, y, np.array(cell)))
        return SimpleNamespace(displace=lambda pressure: SOFT * pressure, precondition=lambda residual: residual)


@pytest.fixture(scope="module")
def surface(bonded):
    return surface_compliance(bonded(0.45), 30e-3)


@pytest.mark.parametrize(("cells", "depth"), [(16, 120e-6), (16, 5e-6), (32, 60e-6), (48, 1e-9)])
def test_grids_shrink_to_the_contact_by_at_most_twenty_and_not_below_its_size(surface, cells, depth):
    springs, cover = Springs(), surface if cells == 48 else PLAIN
    found = solve_contact(cover, Box(size=(1e-3,) * 3), cells=cells, depth=depth, sides=springs)
    parts = []
    for x, y, cell in springs.grids:
        assert x.shape == (cells, cells)
        assert [x.mean(), y.mean()] == pytest.approx(MIDDLE)
        gap = springs.gap(x, y)
        near = gap < max(depth, gap.min() * (1 + 1e-9))
        extent = np.array([np.abs(c[near] - m).max() for c, m in zip((x, y), MIDDLE, strict=True)]) + cell / 2
        parts.append((extent, cells / 2 * cell))
    np.testing.assert_allclose(parts[0][1], WIDE)
    for (extent, half), (_, following) in pairwise(parts):
        assert (extent <= 0.8 * half).any()
        np.testing.assert_allclose(following, np.minimum(np.maximum(1.1 * extent, 0.05 * half), half))
    assert len(parts) > 1
    assert (parts[-1][0] > 0.8 * parts[-1][1]).all()
    assert found.cell == pytest.approx(2 * parts[-1][1] / cells)
    np.testing.assert_allclose(found.force, (depth - springs.gap(found.x, found.y)) / SOFT * np.prod(found.cell))
    assert found.depth == depth
    pressure = np.maximum(0.0, depth - springs.gap(x, y)) / SOFT
    assert found.area == pytest.approx(measure_area(pressure, pressure >= 0, found.cell))
    assert found.area == pytest.approx(np.pi * 2 * depth * np.sqrt(RADII.prod()), rel=0.15)


def test_a_load_acts_along_the_approach_and_not_along_the_normal():
    """The cells sink by 0.8 times the approach, and bear the load over 0.8."""
    springs = Springs()
    found = solve_contact(PLAIN, Box(size=(1e-3,) * 3), cells=32, load=0.2, sides=springs)
    assert found.total_force == pytest.approx(0.2 / RATE)
    sunk = np.sqrt(0.2 / RATE * SOFT / (np.pi * np.sqrt(RADII.prod())))  # half the volume of the cylinder around a cap
    assert found.depth == pytest.approx(sunk / RATE, rel=0.01)
    pressed = RATE * found.depth - springs.gap(found.x, found.y)
    np.testing.assert_allclose(found.force, pressed / SOFT * np.prod(found.cell), rtol=1e-5, atol=1e-9)


def test_a_cell_that_nothing_touches_is_named_with_its_size():
    """Seven grids follow the first one, each with 1.1 / 8 of its size around the four cells in the middle."""
    springs = Springs(floor=2e-6)
    with pytest.raises(TooShallowError, match=rf"cells of {8 * (1.1 / 8) ** 7 / 16:.2g} mm; press deeper"):
        solve_contact(PLAIN, Box(size=(1e-3,) * 3), cells=16, depth=2e-6, sides=springs)
    assert len(springs.grids) == 8


@pytest.mark.parametrize("given", [{}, {"load": 1.0, "depth": 1e-4}])
def test_one_of_load_and_depth_is_given(given):
    with pytest.raises(ValueError, match="give either a load or a depth"):
        solve_contact(PLAIN, Box(size=(1e-3,) * 3), cells=16, **given)


@pytest.mark.parametrize(("tilt", "axis"), [((0.05, 0.0), 1), ((0.0, 0.05), 0), ((0.0, -0.05), 0)])
def test_cells_end_at_the_low_edge_of_a_tilted_face(surface, tilt, axis):
    """The contact is a strip along the whole edge, narrower than depth over tilt; its cells shrink to it."""
    box, depth = tilt_indenter(Box(size=(4e-3, 2e-3, 5e-3)), tilt), 15e-6
    found = solve_contact(surface, box, cells=16, depth=depth)
    side = min((-1, 1), key=lambda sign: box.gap(*np.roll([sign * 0.9e-3, 0.0], axis)[:, None]).item())
    places, edge = (found.x, found.y)[axis], (2e-3, 1e-3)[axis] * np.cos(0.05)
    low, high = places.min() - found.cell[axis] / 2, places.max() + found.cell[axis] / 2
    assert side * (high if side > 0 else low) == pytest.approx(edge, rel=0.01)
    assert 0.05e-3 < high - low < depth / 0.05
    assert 12 * found.cell[axis] < high - low
    other = (found.y, found.x)[axis]
    assert np.ptp(other) + found.cell[1 - axis] == pytest.approx((2e-3, 4e-3)[axis], rel=0.01)


@pytest.mark.parametrize(
    ("gap", "depth", "touching"),
    [
        # A fifth of the cells under a load; at a depth those up to half of it, and at least nine.
        ([*range(11), INF], None, [1] * 3 + [0] * 9),
        ([*range(11), INF], 1.0, [1] * 9 + [0] * 3),
        ([*range(11), INF], 17.9, [1] * 9 + [0] * 3),
        ([*range(11), INF], 18.0, [1] * 10 + [0] * 2),
        ([INF, 4.0, 1.0, 7.0], 0.1, [0, 1, 1, 1]),
        ([0.0, INF, 0.0], None, [1, 0, 1]),
        ([0.0, INF, 0.0], 1.0, [1, 0, 1]),
        ([0.0, 3.0, *[0.0] * 9, INF], 1.0, [1, 0, *[1] * 9, 0]),
    ],
)
def test_the_first_guess_has_the_lowest_cells(gap, depth, touching):
    assert guess_touching(np.array([gap]), depth).tolist() == [[bool(each) for each in touching]]
