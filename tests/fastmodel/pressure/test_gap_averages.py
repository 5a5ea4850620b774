"""Gaps of turned bodies over oblong cells against averages of heights that are computed point by point."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import BodyShape, PosedBody, Solid, sample_gap
from fastmodel.pressure.gap_kernels import CAPSULE, CYLINDER, ELLIPSOID, POLYTOPE, WALL, sample_body
from meshes import TexelArray

#: 7 rows and 10 columns of cells of 1.0 mm x 1.4 mm, off the middle.
GRID = replace(CellGrid.over(TexelArray.grid(3, 4, (2e-3, 2.8e-3)), 2, (0.5, 0.25)), low=np.array([-5.3e-3, -4.1e-3]))
UNTURNED = np.eye(3)
SHAPE = (GRID.rows, GRID.columns)
EDGE = 0.12e-3
#: Kind, size, and half edges of the bounding box.
KINDS = {
    "box": (POLYTOPE, [2.1e-3, 1.3e-3, 0.9e-3], [2.1e-3, 1.3e-3, 0.9e-3]),
    "ellipsoid": (ELLIPSOID, [2.5e-3, 1.5e-3, 3.2e-3], [2.5e-3, 1.5e-3, 3.2e-3]),
    "cylinder": (CYLINDER, [1.9e-3, 2.2e-3, 0.0], [1.9e-3, 1.9e-3, 2.2e-3]),
    "capsule": (CAPSULE, [1.2e-3, 2.4e-3, 0.0], [1.2e-3, 1.2e-3, 3.6e-3]),
}


def make_solid(name, edge=0.0):
    kind, size, half = KINDS[name]
    planes = np.zeros((0, 4))
    if kind == POLYTOPE:
        planes = np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.tile(np.array(size) + edge, 2)])
    return Solid(kind, np.array(size), planes, np.zeros(3), np.array(half) + edge)


def pose_solids(names, turns, places, *, edge=0.0, depth=np.inf):
    solids = [make_solid(name, edge) for name in names]
    return PosedBody(
        shape=BodyShape.of(solids, edge),
        rotation=np.array([Rotation.from_rotvec(each).as_matrix() for each in turns]),
        position=np.array(places, dtype=float),
        depth=depth,
    )


def find_heights(name, turn, place, edge, *points):
    """Lowest and highest z of a solid over each point (x, y), by the roots of its surfaces; inf, -inf beside it.

    A cylinder is widened by the edge as far as its axis is upright, and lengthened by it.
    """
    (x, y), (kind, size, _) = points, KINDS[name]
    start = np.stack([x - place[0], y - place[1], np.full_like(x, -place[2])], axis=-1) @ turn
    along = turn[2]
    if kind == POLYTOPE:
        return cut_slabs(start, along, np.array(size) + edge)
    if kind == ELLIPSOID:
        return cut_quadric(start / size, along / size, 1.0)
    if kind == CYLINDER:
        wide = size[0] + edge * along[2] ** 2
        round_low, round_high = cut_quadric(start[..., :2], along[:2], wide)
        low, high = cut_slabs(start[..., 2:], along[2:], np.array([size[1] + edge]))
        low, high = np.maximum(low, round_low), np.minimum(high, round_high)
        return np.where(low <= high, low, np.inf), np.where(low <= high, high, -np.inf)
    low, high = find_heights_of_cylinder(start, along, size)
    for end in (-size[1], size[1]):
        one, other = cut_quadric(start - [0, 0, end], along, size[0])
        low, high = np.minimum(low, one), np.maximum(high, other)
    return low, high


def find_heights_of_cylinder(start, along, size):
    one, two = cut_quadric(start[..., :2], along[:2], size[0])
    low, high = cut_slabs(start[..., 2:], along[2:], np.array([size[1]]))
    low, high = np.maximum(low, one), np.minimum(high, two)
    return np.where(low <= high, low, np.inf), np.where(low <= high, high, -np.inf)


def cut_slabs(start, along, half):
    ends = (np.stack([-half, half]).reshape(2, *(1,) * (start.ndim - 1), -1) - start) / along
    low, high = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    return np.where(low <= high, low, np.inf), np.where(low <= high, high, -np.inf)


def cut_quadric(start, along, radius):
    a, b, c = along @ along, start @ along, (start**2).sum(axis=-1) - radius**2
    root = np.sqrt(np.maximum(b**2 - a * c, 0))
    inside = b**2 >= a * c
    return np.where(inside, (-b - root) / a, np.inf), np.where(inside, (-b + root) / a, -np.inf)


def average(body, names, reach, *, turn=UNTURNED):
    """The cells under a body by the definition: row, column, coverage, x, y and gap."""
    x, y = np.meshgrid(
        *(low + (np.arange(4 * n) + 0.5) / 4 * e for low, n, e in zip(GRID.low, SHAPE[::-1], GRID.edge, strict=True))
    )
    gap = np.full(x.shape, np.inf)
    for name, axes, place in zip(names, body.rotation @ turn, body.position, strict=True):
        low, high = find_heights(name, axes, place, body.shape.edge, x, y)
        low = np.maximum(low, body.floor)
        gap = np.minimum(gap, np.where(high > low, low, np.inf))
    x, y, gap = (each.reshape(GRID.rows, 4, GRID.columns, 4).transpose(0, 2, 1, 3) for each in (x, y, gap))
    cells = {}
    for key in zip(*np.isfinite(gap).any(axis=(2, 3)).nonzero(), strict=True):
        on = gap[key] <= min(gap[key].min() + WALL * GRID.edge[0], 1e9)
        cells[key] = on.mean(), x[key][on].mean(), y[key][on].mean(), gap[key][on].mean()
    least = min(each[3] for each in cells.values())
    near = {key for key, each in cells.items() if each[3] <= least + reach}
    beside = list(np.ndindex(3, 3))
    return [
        (*key, *each) for key, each in cells.items() if near & {(key[0] + i - 1, key[1] + j - 1) for i, j in beside}
    ]


def list_cells(found):
    return np.array([found.row, found.column, found.coverage, found.x, found.y, found.gap]).T


TURNS = ([0.3, -0.2, 0.9], [1.3, 0.7, -0.4], [-0.15, 0.05, 2.0])


@pytest.mark.parametrize("edge", [0.0, EDGE])
@pytest.mark.parametrize("name", KINDS)
def test_gaps_are_averages_over_the_points_of_each_cell(name, edge):
    for number, turn in enumerate(TURNS):
        place = np.array([0.4e-3, -0.5e-3, 2.5e-3]) + number * np.array([-3e-3, 1.5e-3, 1e-3])
        body = pose_solids([name], [turn], [place], edge=edge)
        for reach in (np.inf, 0.4e-3, 0.0):
            found = sample_gap(GRID, [body], [reach])
            np.testing.assert_allclose(list_cells(found), average(body, [name], reach), rtol=1e-9, atol=1e-12)
            np.testing.assert_array_equal(found.place, np.column_stack([found.x, found.y, 0 * found.x]))
            np.testing.assert_array_equal(found.normal, np.tile([0, 0, 1], (found.count, 1)))


@pytest.mark.parametrize("depth", [np.inf, 0.8e-3, 0.2e-3])
def test_of_several_solids_the_lowest_counts_down_to_the_floor(depth):
    """Parts that end below the floor lie behind the array; parts that begin below it start there."""
    names = ["box", "ellipsoid", "cylinder", "capsule"]
    places = [[-3e-3, 0, 0.3e-3], [1e-3, 1e-3, 2.0e-3], [3e-3, -2e-3, 1.5e-3], [0, -2e-3, -1.8e-3]]
    body = pose_solids(names, [*TURNS, [0.2, 1.5, 0.1]], places, edge=EDGE, depth=depth)
    assert body.floor == -2 * depth - 4 * EDGE
    found = sample_gap(GRID, [body], [np.inf])
    np.testing.assert_allclose(list_cells(found), average(body, names, np.inf), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("reach", [0.02e-3, 0.3e-3])
def test_all_solids_within_reach_are_kept(reach):
    names, places = ["box", "ellipsoid", "capsule"], np.array([[-3e-3, 0, 0], [3e-3, 2e-3, 0], [2e-3, -2.6e-3, 0]])
    body = pose_solids(names, [*TURNS[:2], [0.2, 1.5, 0.1]], places)
    bottoms = [
        np.min(find_heights(n, t, p, 0.0, *np.mgrid[-8e-3:8e-3:50j, -8e-3:8e-3:50j])[0])
        for n, t, p in zip(names, body.rotation, places, strict=True)
    ]
    body.position[:, 2] -= bottoms
    found = sample_gap(GRID, [body], [reach])
    np.testing.assert_allclose(list_cells(found), average(body, names, reach), rtol=1e-9, atol=1e-12)
    assert found.count < sample_gap(GRID, [body], [np.inf]).count


def test_the_kernel_as_loops_gives_what_its_compiled_form_gives():
    body = pose_solids(["capsule", "box"], TURNS[:2], [[-2e-3, 0, 2.4e-3], [2e-3, 1e-3, 2.2e-3]], edge=EDGE)
    compiled = sample_gap(GRID, [body], [0.5e-3])
    solids = body.shape.arrays, body.shape.edge, body.rotation, body.position
    plain = sample_body(solids, GRID.arrays, 0.5e-3, body.floor)
    for name, values in zip(("row", "column", "coverage", "x", "y", "gap"), plain, strict=True):
        np.testing.assert_allclose(getattr(compiled, name), values, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "turn"),
    [
        ("cylinder", [0.0, 0, 0.7]),
        ("cylinder", [np.pi / 2, 0, 0]),
        ("cylinder", [0, np.pi / 2, 0]),
        ("box", [0.0, 0, 0.4]),
        ("box", [np.pi / 2, 0, 0]),
        ("capsule", [0.0, np.pi / 2, 0]),
        ("capsule", [0.0, 0, 0.3]),
    ],
)
def test_upright_and_lying_solids_have_the_gaps_of_ones_that_lean_by_less_than_a_microradian(name, turn):
    """Lines are then parallel to faces, and to the axes of round solids."""
    body = pose_solids([name], [turn], [[-0.21e-3, 0.13e-3, 1.3e-3]], edge=EDGE)
    leans = Rotation.from_rotvec([2e-7, 3e-7, 1e-7]).as_matrix()
    expected = average(body, [name], np.inf, turn=leans)
    np.testing.assert_allclose(list_cells(sample_gap(GRID, [body], [np.inf])), expected, rtol=1e-4, atol=1e-9)


def test_a_motion_is_split_into_path_turn_and_tilt():
    """About a point of a turned surface; a small rotation turns by its parts along and across the normal."""
    normal = np.array([0.6, 0.0, 0.8])
    point, place = np.array([1e-3, 2e-3, 3e-3]), np.array([2e-3, 2.5e-3, 4e-3])
    body = pose_solids(["box"], [[0.2, 0.3, -0.4]], [place])
    turn = 1e-4 * (3 * normal + 4 * np.array([0.0, 1.0, 0.0]))
    step = 2e-5 * normal + 3e-5 * np.array([0.8, 0.0, -0.6])
    about = Rotation.from_rotvec(turn).as_matrix()
    moved = replace(body, rotation=about @ body.rotation, position=(point + about @ (place - point) + step)[None])
    found = moved.measure_motion(body, point, normal)
    assert found == pytest.approx((3e-5, 3e-4, 4e-4), rel=1e-6)
    other = replace(moved, shape=pose_solids(["capsule"], [[0, 0, 0]], [place]).shape)
    assert other.measure_motion(body, point, normal) == (np.inf, np.inf, np.inf)
    again = replace(moved, shape=pose_solids(["box"], [[0, 0, 0]], [place]).shape)  # equal, but made anew
    assert again.measure_motion(body, point, normal) == pytest.approx(found)


def test_lines_in_any_direction_enter_a_polytope_where_a_linear_programme_says():
    random = np.random.default_rng(6)
    body = pose_solids(["box"], [[0.4, -1.1, 0.3]], [[1e-3, -2e-3, 3e-3]])
    points, along = random.uniform(-3e-3, 3e-3, (12, 3)), random.normal(size=(12, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    along[:6] = body.position[0] - points[:6] + random.uniform(-5e-4, 5e-4, (6, 3))
    along[:6] /= np.linalg.norm(along[:6], axis=1, keepdims=True)
    found = body.measure_gaps(points, along, behind=1e-3)
    planes = make_solid("box").planes
    normals, offsets = (
        planes[:, :3] @ body.rotation[0].T,
        planes[:, 3] + planes[:, :3] @ body.rotation[0].T @ body.position[0],
    )
    for point, direction, gap in zip(points, along, found, strict=True):
        limit = {"A_ub": (normals @ direction)[:, None] * 1e3, "b_ub": (offsets - normals @ point) * 1e3}
        first, last = (linprog([sign], **limit, bounds=[(None, None)]) for sign in (1, -1))
        met = first.status == 0 and last.x[0] >= -1e-3
        assert np.isfinite(gap) == met
        if met:
            assert gap == pytest.approx(first.x[0], abs=1e-9)
