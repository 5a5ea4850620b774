"""Cells on charts of curved covers: planes against plates, a ball against its geometry, and sums over loads."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel.contact.points import (
    ChartCells,
    Footprint,
    find_first_contact,
    pose_indenter,
    press_points,
    solve_pressure,
)
from fastmodel.errors import MissedArrayError
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import BodyShape, PosedBody, Solid, sample_gap
from fastmodel.pressure.gap_kernels import ELLIPSOID, POLYTOPE, sample_surface
from fastmodel.pressure.solvers import Load
from meshes import Box, Nut, Sphere
from meshes.pose import Pose
from tests.support.cover_data import make_dome, make_half_space

TURN = Rotation.from_rotvec([0.4, -0.3, 0.8]).as_matrix()  # of a plane
SHIFT = np.array([1e-3, 4e-3, -2e-3])
SIZE, LOW, EDGE = (6, 9), np.array([-3.7e-3, -2.9e-3]), np.array([0.8e-3, 1.1e-3])
BALL = 5e-3


def make_body(kind, turn, place):
    """A box or a ball at a pose in the frame of the plane."""
    half = np.array([2.2e-3, 1.6e-3, 1.2e-3]) if kind == POLYTOPE else np.full(3, BALL)
    planes = np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.tile(half, 2)])
    solid = Solid(kind, half, planes if kind == POLYTOPE else planes[:0], np.zeros(3), half)
    return PosedBody(
        shape=BodyShape.of([solid]),
        rotation=Rotation.from_rotvec(turn).as_matrix()[None],
        position=np.array([place], dtype=float),
    )


def make_plane(half):
    """Points of a square part of the plane, in space, with its normal, and triangles."""
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-half, half, 6)] * 2))
    flat = make_half_space(np.column_stack([x, y, 0 * x]), np.tile([0.0, 0, 1], (36, 1)))
    return flat.points @ TURN.T + SHIFT, np.tile(TURN[:, 2], (36, 1)), flat.facets


def sample(body, surface, reach=np.inf):
    solids = body.shape.arrays, 0.0, TURN @ body.rotation, body.position @ TURN.T + SHIFT
    chart = SHIFT, np.ascontiguousarray(TURN.T), LOW, EDGE, 0.4
    return sample_surface(solids, surface, chart, SIZE, (reach, 1.0))


def list_cells(cells):
    return np.array([np.asarray(each, dtype=float) for each in cells]).T


@pytest.mark.parametrize("reach", [np.inf, 0.1e-3])
@pytest.mark.parametrize("turn", [[0.05, -0.03, 0.6], [0, 0, 0.2], [-0.08, 0.02, 2.0]])
def test_cells_on_a_plane_are_those_of_a_plate(turn, reach):
    body = make_body(POLYTOPE, turn, [0.3e-3, -0.2e-3, 1.5e-3])
    grid = CellGrid(
        per_texel=1, rows=SIZE[0], columns=SIZE[1], margin=(0, 0), edge=tuple(EDGE), low=LOW, texel_columns=SIZE[1]
    )
    plate = sample_gap(grid, [body], [reach])
    cells, place, normal, below, parts = sample(body, surface := make_plane(9e-3), reach)
    expected = [plate.row, plate.column, plate.coverage, plate.x, plate.y, plate.gap]
    np.testing.assert_allclose(list_cells(cells), list_cells(expected), rtol=1e-6, atol=1e-9)
    assert len(cells[0]) > 5
    np.testing.assert_allclose(place, plate.place @ TURN.T + SHIFT, atol=1e-12)
    np.testing.assert_allclose(normal, np.tile(TURN[:, 2], (len(place), 1)), atol=1e-12)
    np.testing.assert_allclose(np.einsum("kn,knc->kc", parts, surface[0][surface[2][below]]), place, atol=1e-12)
    assert parts.min() > -0.1  # the centroid of a partly covered cell may lie a little beside the triangle


def test_gaps_at_whole_cells_are_those_at_their_centres():
    body = make_body(ELLIPSOID, [0, 0, 0], [0.4e-3, 0.3e-3, 5.2e-3])
    (row, column, coverage, x, y, gap), *_ = sample(body, make_plane(9e-3))
    inner = coverage == 1
    assert inner.sum() > 20
    np.testing.assert_allclose(x[inner], LOW[0] + (column[inner] + 0.5) * EDGE[0], atol=1e-12)
    np.testing.assert_allclose(y[inner], LOW[1] + (row[inner] + 0.5) * EDGE[1], atol=1e-12)
    height = 5.2e-3 - np.sqrt(BALL**2 - (x - 0.4e-3) ** 2 - (y - 0.3e-3) ** 2)
    known = inner & (np.hypot(x - 0.4e-3, y - 0.3e-3) < 2e-3)  # beyond them points are averaged
    np.testing.assert_allclose(gap[known], height[known], atol=1e-9)


@pytest.mark.parametrize("half", [1.9e-3, 2.2e-3])
def test_cells_are_covered_as_far_as_the_surface_goes(half):
    body = make_body(POLYTOPE, [0, 0, 0], [0, 0, 1.2e-3])
    body = dataclasses.replace(
        body, shape=BodyShape.of([Solid(ELLIPSOID, np.array([1, 1, 1e-3]), np.zeros((0, 4)), np.zeros(3), np.ones(3))])
    )
    (row, column, coverage, *_), place, _, _, parts = sample(body, make_plane(half))
    offset = (np.arange(4) + 0.5) / 4
    for axis, each in enumerate((column, row)):
        inside = np.abs(LOW[axis] + (each[:, None] + offset) * EDGE[axis]) <= half
        coverage = coverage / inside.mean(axis=1)
    np.testing.assert_allclose(coverage, 1)
    assert np.abs((place - SHIFT) @ TURN).max() <= half + 1e-9
    np.testing.assert_allclose(parts.sum(axis=1), 1)


def test_cells_on_a_ball_lie_at_their_distance_from_the_origin_and_none_on_its_far_side():
    cover, body = make_dome(17, 6.5e-3), make_body(ELLIPSOID, [0, 0, 0], [0, 0, 110e-3])
    solid = Solid(ELLIPSOID, np.full(3, 100e-3), np.zeros((0, 4)), np.zeros(3), np.full(3, 100e-3))
    body = dataclasses.replace(body, shape=BodyShape.of([solid]))
    solids = body.shape.arrays, 0.0, body.rotation, body.position
    low, edge = np.array([-9e-3, -9e-3]), np.array([1.5e-3, 1.5e-3])
    for least in (0.4, 0.85):
        chart = np.array([0, 0, 10e-3]), np.eye(3), low, edge, least
        with np.errstate(invalid="ignore"):  # places of points that face away are infinite
            cells, place, normal, *_ = sample_surface(
                solids, (cover.points, cover.normals, cover.facets), chart, (12, 12), (np.inf, 1.0)
            )
        np.testing.assert_allclose(np.linalg.norm(place, axis=1), 10e-3, atol=5e-6)
        np.testing.assert_allclose(normal, place / 10e-3, atol=5e-3)
        away = place - [0, 0, 10e-3]
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), np.hypot(cells[3], cells[4]), atol=6e-5)
        np.testing.assert_allclose(away[:, 0] * cells[4], away[:, 1] * cells[3], atol=2e-7)
        assert (normal[:, 2] > least - 0.01).all()
        assert normal[:, 2].min() < max(least, 0.5) + 0.15


def test_a_chart_has_the_wanted_number_of_cells_across_a_contact():
    cells = ChartCells.around(np.zeros(3), np.eye(3), np.array([1e-3, -2e-3]), np.array([3e-3, 1e-3]), 2e-3)
    across = 2 * np.array([3e-3, 1e-3]) / cells.edge
    assert (np.abs(across - 14) < 3).all()
    np.testing.assert_allclose(cells.low + cells.edge * cells.size / 2, [1e-3, -2e-3], atol=1e-15)
    np.testing.assert_array_equal(cells.size, np.ceil(1.25 * across) + 4)


def test_footprints_are_seven_numbers():
    row = [0.1, 0.2, 1.0, 2.0, 3.0, 0.4, 0.5]
    footprint = Footprint.of(np.array(row))
    assert (footprint.travel, footprint.approach) == (0.1, 0.2)
    np.testing.assert_array_equal(footprint.middle, [1, 2, 3])
    np.testing.assert_array_equal(footprint.half, [0.4, 0.5])
    assert footprint.row == row


@pytest.mark.parametrize("indenter", [Nut(across=13e-3, bore=8e-3), Box(size=(2e-3, 3e-3, 4e-3))])
def test_an_indenter_has_the_pose_that_mujoco_gives_its_geoms(indenter):
    pose = Pose(point=(1e-3, 2e-3, 3e-3), yaw=0.4, tilt=(0.2, -0.1))
    found = pose_indenter(indenter, pose)
    spec = mujoco.MjSpec()
    quaternion = Rotation.from_matrix(pose.rotation).as_quat(scalar_first=True)
    fastmodel.add_geoms(spec, spec.worldbody.add_body(pos=pose.position, quat=quaternion), indenter)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(found.position, data.geom_xpos, atol=1e-15)
    np.testing.assert_allclose(found.rotation, data.geom_xmat.reshape(-1, 3, 3), atol=1e-12)


@pytest.mark.parametrize("within", [1e-5, 0.2e-3, 1e-3])
def test_points_that_a_ball_reaches_first_follow_from_its_geometry(within):
    cover, direction = make_dome(25, 7e-3), np.array([0.36, -0.48, -0.8])
    pose = Pose.facing(-0.05 * direction + np.array([0.2e-3, 0.1e-3, 0]), direction)
    found = find_first_contact(cover, Sphere(radius=4e-3), pose, 7 * direction, within=within)
    centre = pose.position - 4e-3 * direction
    away = cover.points - centre
    along = away @ direction
    square = 16e-6 - (away**2).sum(axis=1) + along**2
    facing = (cover.normals @ direction < 0) & (square > 0)
    travel = np.where(facing, along - np.sqrt(np.maximum(square, 0)), np.inf)
    np.testing.assert_array_equal(found, (travel <= travel.min() + within).nonzero()[0])
    with pytest.raises(MissedArrayError):
        find_first_contact(cover, Sphere(radius=4e-3), pose, -direction + [0, 0, 1.7], within=within)


def press_down(force):
    up = np.array([0.0, 0, 1])
    return Load.along_free_directions(force * up, np.zeros(3), up[None], rotates=False)


def make_bed(softness=0.0):
    """A flat half space whose top moves as a whole by `softness` times each force [m/N]."""
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-8e-3, 8e-3, 17)] * 2))
    bed = make_half_space(np.stack([x, y, 0 * x], axis=1), np.tile([0.0, 0, 1], (len(x), 1)))
    return dataclasses.replace(bed, remainder=np.full((len(x), len(x)), softness))


def test_a_bed_that_yields_as_a_whole_moves_by_the_sum_of_the_forces():
    """Forces stay as they are; each body sinks by all forces times the softness."""
    soft, balls = 3e-5, [(-3e-3, 0.5), (4e-3, 0.8)]
    bodies = [pose_indenter(Sphere(radius=4e-3), Pose.facing([x, 0.3e-3, 0], [0, 0, -1])) for x, _ in balls]
    loads = [press_down(force) for _, force in balls]
    stiff, yielding = (solve_pressure(make_bed(each), bodies, loads) for each in (0.0, soft))
    for one, other, (x, force) in zip(stiff, yielding, balls, strict=True):
        assert other.footprint.travel - one.footprint.travel == pytest.approx(1.3 * soft, rel=2e-2)
        assert other.forces.sum() == pytest.approx(force, rel=1e-6)
        middle = np.average(other.place, axis=0, weights=other.forces)
        np.testing.assert_allclose(middle, [x, 0.3e-3, 0], atol=3e-5)
        np.testing.assert_allclose(other.footprint.middle, middle, atol=1e-12)
        assert other.depth == pytest.approx(other.footprint.approach, rel=0.02)


def test_influence_and_displacements_are_sums_over_points_and_loads():
    random, cover = np.random.default_rng(0), make_bed(2e-5)
    cover = dataclasses.replace(cover, influence=random.uniform(0, 1, (4, len(cover.points))))
    pose = Pose.facing([0.4e-3, 0.2e-3, 1e-3], [0, 0, -1])
    found = press_points(cover, Sphere(radius=3e-3), pose, load=0.4)
    pressure = found.pressure
    forces = np.zeros(4)
    for k in range(len(pressure.forces)):
        for corner, part in zip(pressure.corners[k], pressure.parts[k], strict=True):
            forces += pressure.forces[k] * part * cover.influence[:, corner]
    np.testing.assert_allclose(found.texel_forces, forces, rtol=1e-10)
    largest = pressure.parts.argmax(axis=1)
    np.testing.assert_array_equal(pressure.nearest, [row[k] for row, k in zip(pressure.corners, largest, strict=True)])
    far = np.array([0, 16])
    moved = pressure.displace(cover, far)
    away = np.linalg.norm(cover.centres[far][:, None] - pressure.place, axis=2)
    np.testing.assert_allclose(moved, 2e-5 * 0.4 + cover.move_layer(away) @ pressure.forces, rtol=1e-6)
    np.testing.assert_allclose(found.force, [0, 0, -0.4], atol=1e-9)
