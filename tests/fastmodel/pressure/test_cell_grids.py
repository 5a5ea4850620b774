"""Contact grids of oblong cells and of panels against sums over all cells and texels, one by one."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from fastmodel.pressure.cell_grid import BaseForces, CellGrid, divide_into_panels, lay_out
from fastmodel.surface import CoverCells
from meshes import TexelArray
from tests.support.hats import share_by_hats

PITCH = (2e-3, 3e-3)
ARRAY = TexelArray.grid(3, 5, PITCH)
REACH, PER_TEXEL = 3, 2


def make_cells(seed=0, **changes):
    """A cover whose influence differs along rows and columns, and is not symmetric."""
    random = np.random.default_rng(seed)
    size = PER_TEXEL + 2 * REACH
    values = {
        "per_texel": PER_TEXEL,
        "cell": (PITCH[0] / PER_TEXEL, PITCH[1] / PER_TEXEL),
        "compliance": random.uniform(1, 2, (4, 5)),
        "influence": random.uniform(0, 1, (size, size)),
        "top_compliance": 1e-6,
        "thickness": 2e-3,
    }
    return CoverCells(**{**values, **changes})


@pytest.mark.parametrize(("margin", "rows", "columns"), [(1, 2, 2), ((0.5, 1.4), 3, 1), ((1.2, 0.2), 0, 2), (0, 0, 0)])
def test_cells_cover_array_and_margin(margin, rows, columns):
    """A margin is rounded to whole cells; the array lies off the middle."""
    array = dataclasses.replace(ARRAY, centres=ARRAY.centres + np.array([7e-3, -4e-3, 0]))
    grid = CellGrid.over(array, PER_TEXEL, margin)
    assert grid.margin == (rows, columns)
    assert (grid.rows, grid.columns) == (6 + 2 * rows, 10 + 2 * columns)
    assert grid.edge == (1e-3, 1.5e-3)
    assert grid.mean_edge**2 == pytest.approx(1.5e-6)
    middle = grid.low + np.array([grid.columns, grid.rows]) * grid.edge / 2
    np.testing.assert_allclose(middle, [7e-3, -4e-3], atol=1e-15)
    assert (grid.texels, grid.texel_columns) == (15, 5)
    size, low, edge = grid.arrays
    assert (size.tolist(), low.tolist(), edge.tolist()) == (
        [grid.columns, grid.rows],
        grid.low.tolist(),
        [1e-3, 1.5e-3],
    )


def test_forces_on_cells_are_summed_over_the_texel_that_they_lie_on():
    grid, random = CellGrid.over(ARRAY, PER_TEXEL, (0.5, 1.0)), np.random.default_rng(1)
    row, column = (random.integers(0, n, 200) for n in (grid.rows, grid.columns))
    forces, expected = random.uniform(0, 1, 200), np.zeros(15)
    for i, j, force in zip(row, column, forces, strict=True):
        place = grid.low + (np.array([j, i]) + 0.5) * grid.edge
        beside = np.abs(place - ARRAY.centres[:, :2]) / PITCH
        expected[(beside < 0.5).all(axis=1)] += force
    np.testing.assert_allclose(grid.sum_on_texels(row, column, forces), expected)
    assert expected.sum() < 0.9 * forces.sum()  # the margin bears some


@pytest.mark.parametrize("shape", [(3, 5), (1, 4), (4, 1)])
def test_point_forces_are_shared_as_by_hats_over_the_cells(shape):
    """Forces beyond the outermost centres act on the outermost cells, and pulls count as zero."""
    grid, random = CellGrid.over(TexelArray.grid(*shape, PITCH), 1, 0), np.random.default_rng(2)
    points = np.column_stack([random.uniform(-6e-3, 6e-3, (25, 2)), random.uniform(-0.3, 1, 25)])
    points[0, :2], points[1, :2] = grid.low + np.array(grid.edge) / 2, [0.0, 0.0]
    row, column, forces = grid.divide_points(points)
    found = np.zeros((grid.rows, grid.columns))
    np.add.at(found, (row, column), forces)
    expected = share_by_hats(grid, np.maximum(points, [-np.inf, -np.inf, 0]))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert expected.sum() == pytest.approx(np.maximum(points[:, 2], 0).sum())


@pytest.mark.parametrize(("x", "y"), [(0.3, -0.7), (-0.9, 0.2), (0.0, 0.999), (-0.25, -0.25)])
def test_a_window_is_shifted_until_its_forces_act_around_the_wanted_centre(x, y):
    grid, window = CellGrid.over(ARRAY, PER_TEXEL, 1), np.random.default_rng(3).uniform(0, 1, (3, 4))

    def find_centre(forces, origin):
        row, column = np.indices(forces.shape)
        places = [
            grid.low[axis] + ((each + origin[1 - axis] + 0.5) * forces).sum() / forces.sum() * grid.edge[axis]
            for axis, each in enumerate((column, row))
        ]
        return np.array(places)

    centre = find_centre(window, (2, 5))
    wanted = centre + np.array([x, y]) * grid.edge
    found, origin = grid.shift_window(window, (2, 5), wanted)
    assert (origin, found.shape) == ((1, 4), (5, 6))
    np.testing.assert_allclose(find_centre(found, origin), wanted, atol=1e-15)
    assert found.sum() == pytest.approx(window.sum())
    assert found.min() >= 0
    for far in ((1.001, y), (-1.001, y), (x, 1.001), (x, -1.001)):  # more than a cell away along one axis
        kept, same = grid.shift_window(window, (2, 5), centre + np.array(far) * grid.edge)
        np.testing.assert_array_equal(kept, window)
        assert same == (2, 5)


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("origin", [(0, 0), (4, 7), (-2, 1), (6, -3)])
def test_base_forces_are_sums_of_the_influence_by_distance(origin, masked):
    """Also of a window that extends beyond the grid, where no forces are."""
    array = dataclasses.replace(ARRAY, active=np.arange(15) % 4 != 1) if masked else ARRAY
    grid, cells = CellGrid.over(array, PER_TEXEL, (0.5, 1.0)), make_cells()
    base = grid.build_base_forces(cells, array)
    window = np.random.default_rng(5).uniform(0, 1, (4, 6))
    expected = np.zeros((3, 5))
    for i, j in np.ndindex(window.shape):
        row, column = origin[0] + i, origin[1] + j
        if not (0 <= row < grid.rows and 0 <= column < grid.columns):
            window[i, j] = 0
        for r, c in np.ndindex(expected.shape):
            a, b = (row - grid.margin[0] - 2 * r + REACH, column - grid.margin[1] - 2 * c + REACH)
            if 0 <= a < 8 and 0 <= b < 8:
                expected[r, c] += window[i, j] * cells.influence[a, b]
    expected = np.where(array.active, expected.ravel(), 0)
    np.testing.assert_allclose(base.from_window(window, origin), expected, atol=1e-6)
    np.testing.assert_allclose(base.from_window(2 * window, origin), 2 * expected, atol=1e-6)  # the same factors again


def test_even_forces_on_texels_reach_the_base_as_those_on_their_cells():
    base = BaseForces(make_cells(), CellGrid.over(ARRAY, PER_TEXEL, (0.5, 1.0)), ARRAY)
    forces = np.random.default_rng(6).uniform(0, 1, 15)
    expected = np.zeros(15)
    for texel, (row, column) in enumerate(np.ndindex(3, 5)):
        even = np.full((2, 2), forces[texel] / 4)
        expected += base.from_window(even, (2 + 2 * row, 1 + 2 * column))
    np.testing.assert_allclose(base.from_texels(forces), expected, atol=1e-12)


def scatter(array, seed=4):
    """Some of the texels of a grid in random order, as an array of one row."""
    kept = np.random.default_rng(seed).permutation(array.count)[:9]
    return dataclasses.replace(
        array, centres=array.centres[kept], normals=array.normals[kept], active=array.active[kept], rows=1, columns=9
    )


def turn_about_y(array, angle, shift=(1e-3, -2e-3, 5e-3)):
    turn = Rotation.from_rotvec([0, angle, 0]).as_matrix()
    return dataclasses.replace(array, centres=array.centres @ turn.T + shift, normals=array.normals @ turn.T)


@pytest.mark.parametrize("margin", [0.5, (0.0, 1.5)])
def test_texels_in_a_turned_plane_are_one_panel_whose_cells_share_their_area(margin):
    flat = scatter(ARRAY)
    array = turn_about_y(flat, 0.7)
    level, turned = lay_out(flat, margin, PER_TEXEL), lay_out(array, margin, PER_TEXEL)
    (panel,) = (part.panel for part in turned.panels)
    pitches = np.broadcast_to(margin, 2)
    half = np.ptp(flat.centres[:, :2], axis=0) / 2 + (0.5 + pitches) * PITCH
    np.testing.assert_allclose(panel.half, half)
    np.testing.assert_allclose(panel.axes, Rotation.from_rotvec([0, 0.7, 0]).as_matrix(), atol=1e-12)
    local = (array.centres - panel.origin) @ panel.axes
    np.testing.assert_allclose([local.min(axis=0) + local.max(axis=0)], 0, atol=1e-12)
    np.testing.assert_allclose(turned.shares.toarray(), level.shares.toarray(), atol=1e-12)
    assert turned.texels == 9
    # every texel has all of its area: four whole cells, or parts of more
    np.testing.assert_allclose(turned.shares.sum(axis=1), 4, atol=0.26)
    assert turned.shares.sum(axis=0).max() <= 1
    random = np.random.default_rng(8)
    row, column = (random.integers(0, n, 50) for n in (turned.rows, turned.columns))
    forces = random.uniform(0, 1, 50)
    shares = turned.shares.toarray()[:, row * turned.columns + column]
    np.testing.assert_allclose(turned.sum_on_texels(row, column, forces), shares @ forces, atol=1e-12)


def test_base_forces_of_scattered_texels_are_the_influence_at_their_distance():
    """Two groups of texels on planes that look in different directions; one texel looks away from both."""
    cells = make_cells(seed=2)
    places = np.array([[0, 0, 0], [2.3e-3, 0.7e-3, 0], [1e-3, 2.9e-3, 0], [2.0e-3, -1.0e-3, -1.0e-3]])
    normals = np.array([[0, 0, 1.0], [0, 0, 1], [np.sin(0.5), 0, np.cos(0.5)], [0, 0, -1]])
    active = np.array([True, True, True, True])
    array = TexelArray(centres=places, normals=normals, texel_size=PITCH, pitch=PITCH, rows=1, columns=4, active=active)
    grid = lay_out(array, 1, PER_TEXEL, apart=3)
    assert len(grid.panels) == 4
    for k, part in enumerate(grid.panels):
        np.testing.assert_array_equal(part.panel.origin, places[k])
        assert part.panel.half == (1e-3, 1.5e-3)
        assert (part.grid.rows, part.grid.columns, part.rim) == (4, 4, 1)
        assert (part.row, part.column) == (7 * (k // 2), 7 * (k % 2))
        assert part.radius == pytest.approx(np.hypot(2e-3, 3e-3))
    index = (np.arange(8) - REACH + 0.5 - PER_TEXEL / 2) * np.array([[1.5e-3], [1e-3]])
    spline = RectBivariateSpline(*index, cells.influence)
    base = grid.build_base_forces(cells, array)
    for k, part in enumerate(grid.panels):
        for i, j in itertools.product(range(4), range(4)):
            axes = part.panel.axes
            x, y = -2e-3 + (j + 0.5) * 1e-3, -3e-3 + (i + 0.5) * 1.5e-3
            cell = places[k] + x * axes[:, 0] + y * axes[:, 1]
            apart = (cell - places) @ axes[:, :2]
            reached = (np.abs(apart) <= [3.5e-3 + 1e-9, 5.25e-3 + 1e-9]).all(axis=1) & (normals @ axes[:, 2] > 0)
            expected = np.where(reached, spline.ev(apart[:, 1], apart[:, 0]), 0)
            np.testing.assert_allclose(base.from_window(np.ones((1, 1)), (part.row + i, part.column + j)), expected)
            inside = part.holds(np.array([i]), np.array([j]))[0]
            assert inside == (0 < i < 3 and 0 < j < 3)
    even = np.zeros((grid.rows, grid.columns))
    even[1:3, 8:10] = 0.25  # the inner cells of the second panel
    np.testing.assert_allclose(base.from_texels(np.eye(4)[1]), base.from_window(even, (0, 0)), atol=1e-12)
    shifted = base.from_window(np.pad(even, 3), (-3, -3))
    np.testing.assert_allclose(shifted, base.from_window(even, (0, 0)))


def test_masked_texels_in_any_layout_read_zero():
    flat = scatter(dataclasses.replace(ARRAY, active=np.arange(15) % 3 != 0))
    whole = dataclasses.replace(flat, active=np.ones(9, dtype=bool))
    masked, full = (lay_out(each, 1, 2).build_base_forces(make_cells(), each) for each in (flat, whole))
    forces = np.random.default_rng(0).uniform(0, 1, 9)
    np.testing.assert_allclose(masked.from_texels(forces), np.where(flat.active, full.from_texels(forces), 0))


def test_a_bent_sheet_keeps_the_places_of_its_image():
    """Five rows of which the first two, the third, and the last two lie in planes of their own."""
    array = TexelArray.grid(5, 4, PITCH)
    angle = np.repeat([-0.3, -0.3, 0.0, 0.25, 0.25], 4)
    steps = -(angle[::4][1:] + angle[::4][:-1]) / 2  # of the path from row to row, along the mean of their axes
    height, depth = (np.repeat(np.cumsum([0, *3e-3 * each(steps)]), 4) for each in (np.cos, np.sin))
    normals = np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    sheet = dataclasses.replace(array, centres=np.stack([array.centres[:, 0], height, depth], axis=1), normals=normals)
    grid = lay_out(sheet, 1, 2)
    assert (grid.rows, grid.columns, grid.margin) == (10, 8, (0, 0))
    found = [(part.row, part.column, part.grid.rows, part.grid.columns, part.panel.first) for part in grid.panels]
    assert found == [(0, 0, 4, 8, (0, 0)), (4, 0, 2, 8, (2, 0)), (6, 0, 4, 8, (3, 0))]
    for part, rows in zip(grid.panels, ((0, 2), (2, 3), (3, 5)), strict=True):
        own = np.arange(4 * rows[0], 4 * rows[1])
        np.testing.assert_allclose(part.panel.origin, sheet.centres[own].mean(axis=0), atol=1e-15)
        np.testing.assert_allclose(part.panel.half, (4e-3, 1.5e-3 * (rows[1] - rows[0])))
        np.testing.assert_allclose(part.panel.axes[:, 2], normals[own[0]])
        np.testing.assert_allclose(part.grid.low, -np.array(part.panel.half))
    np.testing.assert_array_equal(grid.find_texel(np.array([0, 5, 9]), np.array([0, 3, 7])), [0, 9, 19])


@pytest.mark.parametrize(
    ("change", "sheet"),
    [
        (np.zeros(3), True),
        (np.array([0.35e-3, 0, 0]), True),
        (np.array([0.45e-3, 0, 0]), False),
        (np.array([0, 0.55e-3, 0]), True),
        (np.array([0, 0.65e-3, 0]), False),
        (np.array([0, 0, 0.35e-3]), True),
        (np.array([0, 0, 0.45e-3]), False),
    ],
)
def test_neighbours_on_a_sheet_lie_a_pitch_apart_within_a_fifth_of_it(change, sheet):
    """The last texel of a row of three, the others of which are bent a little out of their plane."""
    array = TexelArray.grid(1, 3, PITCH)
    centres = array.centres + np.array([[0, 0, 0], [0, 0, 0], change]) + np.array([[0, 0, 1e-5], [0, 0, 0], [0, 0, 0]])
    panels = divide_into_panels(dataclasses.replace(array, centres=centres), 0)
    assert (panels[0].first is not None) == sheet
    assert len(panels) == (3 if change.any() or not sheet else 2)


def test_texels_whose_normals_are_far_apart_are_no_sheet():
    array = TexelArray.grid(1, 2, PITCH)
    normals = np.array([[-np.sin(1.1), 0, np.cos(1.1)], [np.sin(1.1), 0, np.cos(1.1)]])
    assert divide_into_panels(dataclasses.replace(array, normals=normals), 0)[0].first is None
