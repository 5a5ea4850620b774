"""Limits within which texels count as flat, tables beyond the grid, faces of solids, and settings of many worlds."""

import dataclasses

import mujoco
import numpy as np
import pytest

from fastmodel import ContactFunctions, FastModelError
from fastmodel.pressure.cell_grid import CellGrid, divide_into_panels, lay_out
from fastmodel.pressure.flexes import FlexSurfaces
from fastmodel.pressure.gap import BodyShape, PosedBody, describe_solid, find_vertices
from meshes import TexelArray
from tests.support import cover_data

PITCH = (2e-3, 3e-3)


def lift(array, texel, height, lean=0.0):
    """The array with one texel higher, which leans about y."""
    centres, normals = array.centres.copy(), array.normals.copy()
    centres[texel, 2] += height
    normals[texel] = [np.sin(lean), 0, np.cos(lean)]
    return dataclasses.replace(array, centres=centres, normals=normals)


@pytest.mark.parametrize(
    ("height", "lean", "panels"),
    [
        (1.9e-6, 0, 1),
        (-1.9e-6, 0, 1),
        (2.1e-6, 0, 6),  # a thousandth of the smaller pitch
        (-2.1e-6, 0, 6),
        (0, 0.9e-3, 1),
        (0, 1.1e-3, 6),
        (0, -1.1e-3, 6),
    ],
)
def test_texels_in_any_layout_are_one_panel_if_they_lie_in_a_plane(height, lean, panels):
    """Six texels, some of which lie farther apart than on a sheet; the last one is higher or leans."""
    array = TexelArray.grid(2, 3, PITCH)
    array = dataclasses.replace(array, centres=array.centres * [1.5, 1.3, 1.0])
    found = divide_into_panels(lift(array, 5, height, lean), (0.5, 1.0))
    assert len(found) == panels
    assert found[0].first is None
    if panels == 1:
        np.testing.assert_allclose(found[0].half, (3e-3 + 1e-3 + 1e-3, 1.95e-3 + 1.5e-3 + 3e-3))
    else:
        np.testing.assert_allclose([each.half for each in found], np.tile([1e-3, 1.5e-3], (6, 1)))
        np.testing.assert_array_equal([each.origin for each in found], lift(array, 5, height, lean).centres)


def list_blocks(array):
    return [
        (part.panel.first, part.grid.rows // 2, part.grid.columns // 2, part.row, part.column)
        for part in lay_out(array, 0, 2).panels
    ]


def test_blocks_of_a_sheet_hold_coplanar_texels_that_no_other_block_has():
    """The first texel of the second of three rows is higher than the others."""
    array = lift(TexelArray.grid(3, 3, PITCH), 3, 0.2e-3)
    assert list_blocks(array) == [
        ((0, 0), 1, 3, 0, 0),
        ((1, 0), 1, 1, 2, 0),
        ((1, 1), 2, 2, 2, 2),
        ((2, 0), 1, 1, 4, 0),
    ]


@pytest.mark.parametrize(("height", "blocks"), [(1.9e-6, 2), (2.1e-6, 3)])
def test_a_block_of_a_sheet_is_flat_within_a_thousandth_of_the_pitch(height, blocks):
    """The first of four texels is much higher, and the last a little."""
    array = lift(lift(TexelArray.grid(1, 4, PITCH), 0, 0.2e-3), 3, height)
    assert len(divide_into_panels(array, 0)) == blocks


@pytest.mark.parametrize(("lean", "blocks"), [(0.32e-3, 2), (0.35e-3, 3)])
def test_a_block_of_a_sheet_is_straight_over_its_length(lean, blocks):
    """A lean times the length of four texels may be a thousandth of the pitch."""
    array = lift(lift(TexelArray.grid(1, 5, PITCH), 0, 0.2e-3), 4, 0, lean)
    assert len(divide_into_panels(array, 0)) == blocks


@pytest.mark.parametrize("origin", [(-2, -3), (5, 9), (0, 0), (-1, 8)])
def test_a_table_is_applied_to_a_window_that_extends_beyond_the_grid(origin):
    """Cells outside bear nothing; those in the margin reach no texel."""
    array, random = TexelArray.grid(2, 3, 4e-3), np.random.default_rng(1)
    table = random.uniform(0, 1, (6, 4, 6))
    surface = dataclasses.replace(cover_data.cells(array, 2, 4), table=table)
    grid = CellGrid.over(array, 2, (1.0, 0.5))
    window, expected = random.uniform(0, 1, (4, 5)), np.zeros(6)
    for i, j in np.ndindex(window.shape):
        row, column = origin[0] + i, origin[1] + j
        if not (0 <= row < grid.rows and 0 <= column < grid.columns):
            window[i, j] = 0
        row, column = row - grid.margin[0], column - grid.margin[1]
        if 0 <= row < 4 and 0 <= column < 6:
            expected += window[i, j] * table[:, row, column]
    np.testing.assert_allclose(grid.build_base_forces(surface, array).from_window(window, origin), expected)


@pytest.mark.parametrize("edge", [0.0, 0.3e-3])
@pytest.mark.parametrize("scale", [1e-3, 1.0])
def test_a_mesh_has_the_planes_of_its_faces_once(edge, scale):
    """A block of 2 x 3 x 4, from its corners and a point inside; each side consists of triangles in one plane."""
    spec = mujoco.MjSpec()
    corners = scale * np.array([[x, y, z] for x in (0, 2.0) for y in (0, 3.0) for z in (0, 4.0)])
    spec.add_mesh(name="block", uservert=np.vstack([corners, corners.mean(axis=0)]).ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="block")
    model = spec.compile()
    solid = describe_solid(model, 0, edge)
    sizes = np.sort(np.ptp(find_vertices(model, 0), axis=0))
    np.testing.assert_allclose(sizes, scale * np.array([2, 3, 4]), rtol=1e-6)
    assert len(solid.planes) == 6
    np.testing.assert_allclose(np.sort(solid.half), sizes / 2 + edge, rtol=1e-6)
    normals, offsets = solid.planes[:, :3], solid.planes[:, 3]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    apart = find_vertices(model, 0) @ normals.T - offsets
    np.testing.assert_allclose(apart.max(axis=0), -edge, atol=1e-6 * scale)
    assert ((apart > -edge - 1e-6 * scale).sum(axis=0) == 4).all()


def test_a_plane_has_no_end_and_is_not_enlarged():
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    solid = describe_solid(spec.compile(), 0, 1e-3)
    assert np.isinf(solid.half).all()
    turn = np.diag([1.0, -1, -1])  # it looks downwards, at a height of 2 mm
    body = PosedBody(shape=BodyShape.of([solid]), rotation=turn[None], position=np.array([[0, 0, 2e-3]]))
    up = np.array([[0, 0, 1.0], [0.6, 0, 0.8], [1.0, 0, 0]])
    found = body.measure_gaps(np.array([[5.0, 7.0, 0.5e-3]] * 3), up)
    np.testing.assert_allclose(found, [1.5e-3, 1.5e-3 / 0.8, np.inf])
    assert body.is_convex


def test_several_solids_are_one_body_with_the_smallest_gap():
    spec = mujoco.MjSpec()
    for radius in (1e-3, 2e-3):
        spec.worldbody.add_geom(size=[radius, 0, 0])
    model = spec.compile()
    body = PosedBody(
        shape=BodyShape.of([describe_solid(model, k) for k in range(2)], 0.1e-3),
        rotation=np.tile(np.eye(3), (2, 1, 1)),
        position=np.array([[0, 0, 4e-3], [0, 0, 7e-3]]),
        depth=0.3e-3,
    )
    points = np.array([[0, 0, 0], [1.5e-3, 0, 0], [0, 0, 5.5e-3], [0, 0, 9.5e-3]])
    found = body.measure_gaps(points, np.tile([0, 0, 1.0], (4, 1)), behind=0.6e-3)
    np.testing.assert_allclose(found, [3e-3, 7e-3 - np.sqrt(1.75e-6), -2.5e-3, -4.5e-3])
    assert not body.is_convex
    assert body.floor == pytest.approx(-1.0e-3)
    np.testing.assert_array_equal(body.centres, body.position)


ARRAY = TexelArray.grid(3, 2, 3.4e-3, margin=3.4e-3)
FUNCTIONS = ContactFunctions(cover_data.parameters(ARRAY))
SHAPE = (FUNCTIONS.grid.rows, FUNCTIONS.grid.columns)


def draw_gap():
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE).reshape(2, 1, 1) / 2 + 0.5
    return np.where(np.hypot(x, y) < 5, 4e-6 * x**2 + 7e-6 * y**2 + 2e-6 * x, np.inf)


def test_eight_steps_are_taken_unless_a_number_is_given():
    gap, moments = draw_gap(), np.array([1e-3, -2e-3])
    depths = 1e-4 + 1e-3 * ARRAY.centres[:, 0] - 3 * np.hypot(*ARRAY.centres[:, :2].T) ** 2
    point = np.array([[0.3e-3, 0.2e-3, 0.0]]), np.array([[0.0, 0.0, -2.0]])

    def press(name, **steps):
        if name == "forces":
            return FUNCTIONS.forces(gap, 2.0, moments, **steps).cell_forces
        if name == "depths":
            return FUNCTIONS.from_depths(depths, 2.0, **steps).cell_forces
        return FUNCTIONS.from_contacts(np.array([0]), *point, 1, gap[None], **steps).cell_forces

    for name in ("forces", "depths", "contacts"):
        found = press(name)
        np.testing.assert_array_equal(found, press(name, iterations=8))
        for other in (7, 9):
            assert np.abs(found - press(name, iterations=other)).max() > 1e-9


@pytest.mark.parametrize("world", [-2, 2])
def test_worlds_are_numbered_from_zero_and_minus_one_is_none(world):
    points, forces = np.zeros((2, 3)), np.tile([0, 0, -1.5], (2, 1))
    with pytest.raises(FastModelError, match=rf"world\[1\] is {float(world)}; give -1 to 1"):
        FUNCTIONS.from_contacts(np.array([0, world]), points, forces, 2)
    found = FUNCTIONS.from_contacts(np.array([1, -1]), points, forces, 2)
    np.testing.assert_allclose(found.load, [0, 1.5])
    np.testing.assert_allclose(found.cell_forces.sum(axis=(1, 2)), [0, 1.5])
    assert FUNCTIONS.from_contacts(np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros((0, 3)), 0).load.shape == (0,)


def test_contacts_of_a_world_that_pull_in_total_press_nothing():
    points = np.array([[1e-3, 0, 0], [-1e-3, 1e-3, 0], [0, 0, 0]])
    forces = np.array([[0, 0, -1.0], [0, 0, 3.0], [0, 0, -0.5]])
    found = FUNCTIONS.from_contacts(np.array([0, 0, 1]), points, forces, 2, np.stack([draw_gap()] * 2), tilts=False)
    np.testing.assert_allclose(found.load, [0, 0.5])
    np.testing.assert_allclose(found.cell_forces.sum(axis=(1, 2)), [0, 0.5])


def test_depths_on_a_single_row_of_texels_are_the_same_along_its_width():
    """Between texels along the row they are linear."""
    array = TexelArray.grid(1, 4, 3.4e-3, margin=3.4e-3)
    functions = ContactFunctions(cover_data.parameters(array))
    grid = functions.grid
    x = grid.low[0] + (np.arange(grid.columns) + 0.5) * grid.edge[0]
    depths = np.array([1.0, 3.0, 2.0, 2.5]) * 1e-5
    centres = array.centres[:, 0]
    between = np.interp(x, centres, depths)
    low, high = x < centres[0], x > centres[-1]
    between[low] = depths[0] + (x[low] - centres[0]) * (depths[1] - depths[0]) / 3.4e-3
    between[high] = depths[3] + (x[high] - centres[3]) * (depths[3] - depths[2]) / 3.4e-3
    expected = functions.forces(np.tile(-between, (grid.rows, 1)), 2.0)
    found = functions.from_depths(depths, 2.0)
    np.testing.assert_allclose(found.cell_forces, expected.cell_forces, atol=1e-9)
    area = 3.4e-3**2 * cover_data.cells(array).foundation_modulus()
    assert functions.from_depths(depths).load == pytest.approx(area * depths.sum())


def test_contacts_of_flexes_are_replaced_and_those_of_other_bodies_are_kept():
    """A cable and a ball on a box; forces are made up, and one contact of the cable pulls."""
    model = mujoco.MjModel.from_xml_string("""
    <mujoco><worldbody><geom type="box" size="0.03 0.03 0.002" pos="0 0 -0.002"/>
      <flexcomp name="cable" type="grid" dim="1" count="5 1 1" spacing="4e-3 4e-3 4e-3" pos="2e-3 3e-3 0.3e-3"
        mass="0.1" radius="5e-4"><contact selfcollide="none"/></flexcomp>
      <body pos="-0.01 0 0.9e-3"><freejoint/><geom size="1e-3"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    soft = data.contact.flex.max(axis=1) >= 0
    assert 2 <= soft.sum() < len(soft)
    pressed = np.where(soft, 0.4, 0.7)
    pressed[soft.nonzero()[0][0]] = -0.2
    owner = np.where(soft, -1, 0)
    touches = np.column_stack([data.contact.pos[:, :2], pressed])
    place, bounds = np.vstack([np.eye(3), np.zeros(3)]), np.array([[-0.03, -0.03, -4e-3], [0.03, 0.03, 0]])
    surfaces = FlexSurfaces(model, 0.5e-3)
    found, points = surfaces.replace_points(data, pressed, owner, touches, place=place, bounds=bounds)
    kept = ~soft | (pressed < 0)
    np.testing.assert_array_equal(points[: kept.sum()], touches[kept])
    np.testing.assert_array_equal(found, [*owner[kept], *[-1] * (len(points) - kept.sum())])
    added = points[kept.sum() :]
    assert added[:, 2].sum() == pytest.approx(0.4 * (soft.sum() - 1))
    centre = added[:, 2] @ added[:, :2] / added[:, 2].sum()
    np.testing.assert_allclose(centre, data.flexvert_xpos[:, :2].mean(axis=0), atol=1e-5)
    assert np.ptp(added[:, 0]) > 14e-3
    gone = {"place": place, "bounds": bounds + np.array([0.1, 0, 0])}  # no part of the cable lies over the array
    same, left = surfaces.replace_points(data, pressed, owner, touches, **gone)
    np.testing.assert_array_equal(left, touches)
    np.testing.assert_array_equal(same, owner)
