"""What the picture of an indentation is made of, against made-up fields and solids whose values are known by hand."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.fields.cover_fields import CoverFields
from meshes import Box, Cover, Layer, Pose, Sphere, TexelArray
from meshes.catalogue import MATERIALS
from meshes.solids.solid_mesh import SolidMesh
from tests.support.drawn_views import CORNERS
from validation.scene.cover_scene import average_pressure, show_indentation, show_mesh, split_cells

ARRAY = TexelArray.grid(2, 2, 3e-3)
#: Sizes of a block [m], from z = 1 mm.
SIZE, LOW = np.array([6e-3, 4e-3, 2e-3]), 1e-3


def make_stress(stresses):
    """Stress tensors of the components xx, yy, zz, xy, yz, zx, shape (n, 3, 3)."""
    xx, yy, zz, xy, yz, zx = np.transpose(stresses)
    return np.moveaxis(np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]), -1, 0)


def make_block(stress=None):
    """A block of two layers of one hexahedron each, whose nodes on the interface occur twice."""
    lower, upper = CORNERS * [1, 1, 0.5], CORNERS * [1, 1, 0.5] + [0, 0, 0.5]
    position = np.concatenate([lower, upper]) * SIZE + [-1e-3, -2e-3, LOW]
    values = np.random.default_rng(5).uniform(-9e3, 9e3, (16, 6)) if stress is None else stress
    # the top sinks by 0.1 mm and moves by 0.05 mm along x
    displacement = (position[:, [2]] - LOW) / SIZE[2] * [5e-5, 0, -1e-4]
    return CoverFields(
        position=position, displacement=displacement, stress=make_stress(values),
        cells=np.arange(16).reshape(2, 8), layer=np.array([0, 1]), axisymmetric=False,
    )  # fmt: skip


def find(fields, places, forces, mesh=None, **options):
    """The result of a press with forces [N] along -z at places [m]."""
    return SimpleNamespace(
        mesh=mesh, fields=fields, contact_points=np.array(places, dtype=float),
        contact_forces=np.outer(forces, [0.0, 0.0, -1.0]), texel_forces=np.array([0.1, 0.2, 0.3, 0.4]), **options,
    )  # fmt: skip


PLACES = [[0, -1e-3, 7], [2e-3, 0, 7], [1e-3, 1e-3, 7], [5e-3, 2e-3, 7]]
FORCES = [1.0, 3.0, 4.0, 0.0]


@pytest.fixture
def block():
    fields = make_block()
    cover = Cover(layers=(
        Layer(material=dataclasses.replace(MATERIALS["pet"], name="lower"), thickness=1.25e-3),
        Layer(material=dataclasses.replace(MATERIALS["pet"], name="upper"), thickness=0.5e-3),
    ))  # fmt: skip
    punch = Box(size=(3e-3, 3e-3, 2e-3))
    pose = Pose(point=(1e-3, 0.5e-3, 9e-3))
    return fields, show_indentation(find(fields, PLACES, FORCES), ARRAY, punch, pose, cover=cover, title="a block")


def test_the_surface_of_layers_has_the_pressure_and_the_section_the_stress_of_von_mises(block):
    fields, scene = block
    np.testing.assert_allclose(scene.surface, -1e-3 * fields.stress[:, 2, 2])
    principal = np.linalg.eigvalsh(fields.stress)
    apart = principal - np.roll(principal, 1, axis=1)
    np.testing.assert_allclose(scene.inside, 1e-3 * np.sqrt((apart**2).sum(axis=1) / 2))
    assert (scene.surface_label, scene.inside_label) == ("pressure [kPa]", "von Mises stress [kPa]")
    for name in ("position", "displacement", "cells", "layer"):
        np.testing.assert_array_equal(getattr(scene, name), getattr(fields, name))
    assert scene.layers == ("lower, 1.25 mm", "upper, 0.5 mm")
    assert (scene.title, scene.texels) == ("a block", ARRAY)
    np.testing.assert_array_equal(scene.texel_forces, [0.1, 0.2, 0.3, 0.4])


def test_the_contact_on_layers_is_the_mean_place_of_the_force_on_the_top(block):
    """A place without force counts neither for the middle nor for the reach."""
    _, scene = block
    middle = [(3 * 2e-3 + 4 * 1e-3) / 8, (-1e-3 + 4 * 1e-3) / 8]
    np.testing.assert_allclose(scene.touched, [*middle, LOW + SIZE[2]])
    assert scene.thickness == pytest.approx(SIZE[2])
    assert scene.limits == pytest.approx(1.375e-3 + 4 * SIZE[2])  # from the middle to y = -1 mm


def test_the_indenter_stands_on_the_sunken_top(block):
    _, scene = block
    np.testing.assert_allclose(scene.pose.point, (1e-3, 0.5e-3, LOW + SIZE[2] - 1e-4), atol=1e-12)
    assert scene.indenter == Box(size=(3e-3, 3e-3, 2e-3))


def test_without_named_layers_and_without_fields_nothing_is_invented():
    fields = make_block()
    ball, pose = Sphere(radius=1e-3), Pose()
    assert show_indentation(find(fields, PLACES, FORCES), ARRAY, ball, pose).layers == ()
    assert show_indentation(find(None, PLACES, FORCES), ARRAY, ball, pose) is None


@pytest.mark.parametrize(("ratio", "logarithmic"), [(0.5, False), (19.9, False), (20.1, True)])
@pytest.mark.parametrize("stiff", [0, 1])
def test_the_scale_is_logarithmic_if_the_largest_stresses_of_the_layers_differ_by_more_than_20(
    ratio, logarithmic, stiff
):
    stress = np.zeros((16, 6))
    stress[:, 3] = np.linspace(0.1, 1.0, 16) * 64.0  # smaller stresses do not count
    stress[[7, 15], 3] = 64.0
    stress[8 * stiff : 8 * stiff + 8, 3] *= ratio
    scene = show_indentation(find(make_block(stress), PLACES, FORCES), ARRAY, Sphere(radius=1e-3), Pose())
    assert scene.logarithmic == logarithmic


def test_an_axisymmetric_solution_is_turned_about_its_axis():
    """A half plane at y = -1 mm from the axis at x = 2 mm, of two quadrilaterals in two layers."""
    r = np.array([0, 3e-3, 3e-3, 0, 0, 3e-3, 3e-3, 0])
    z = np.array([0, 0, 1e-3, 1e-3, 1e-3, 1e-3, 1.5e-3, 1.5e-3])
    radial, down = 0.02 * r, -0.1 * z
    stresses = np.column_stack([1e3 + 1e6 * r, 2e3 - 2e5 * r, -3e3 - 1e6 * z, 0 * r, 0 * r, 7e5 * r])
    fields = CoverFields(
        position=np.column_stack([2e-3 + r, np.full(8, -1e-3), z]),
        displacement=np.column_stack([radial, 0 * r, down]), stress=make_stress(stresses),
        cells=np.arange(8).reshape(2, 4), layer=np.array([0, 1]), axisymmetric=True,
    )  # fmt: skip
    places = [[2e-3, -1e-3, 0], [3e-3, -1e-3, 0], [1e-3, -1e-3, 0]]
    ball = Sphere(radius=4e-3)
    scene = show_indentation(find(fields, places, [2.0, 1.0, 1.0]), ARRAY, ball, Pose(point=(2e-3, -1e-3, 0)))
    x, y, height = (scene.position - [2e-3, -1e-3, 0]).T
    around, angle = np.hypot(x, y), np.arctan2(y, x)
    node = np.arange(len(x)) % 8
    np.testing.assert_allclose(around, r[node], atol=1e-12)
    np.testing.assert_allclose(height, z[node], atol=1e-12)
    turns = np.unique(np.round(np.degrees(angle[(node == 1)]) % 360, 6) % 360)
    np.testing.assert_allclose(turns, np.arange(0, 360, 3.75), atol=1e-5)
    outwards = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    expected = radial[node, None] * outwards + down[node, None] * [0, 0, 1]
    np.testing.assert_allclose(scene.displacement, expected, atol=1e-12)
    np.testing.assert_allclose(scene.surface, 1e-3 * (3e3 + 1e6 * z[node]))
    np.testing.assert_allclose(scene.inside, 1e-3 * fields.von_mises[node])
    # the hexahedra fill a prism of 96 sides, each with the layer at its height
    corners = scene.position[scene.cells]
    # the three edges of a corner on the outside of a wedge span the volume of a box of which the wedge is half
    outer = corners[:, [0, 3, 5, 1]] - corners[:, [1]]
    wedge = np.abs(np.linalg.det(outer[:, :3])) / 2
    assert len(corners) == 192
    assert wedge.sum() == pytest.approx(96 / 2 * np.sin(2 * np.pi / 96) * 9e-6 * 1.5e-3, rel=1e-9)
    low = corners[..., 2].min(axis=1)
    np.testing.assert_array_equal(scene.layer, (low > 0.5e-3).astype(int))
    assert np.allclose(corners[:, 4:, 2], corners[:, :4, 2])  # the upper half of a cell is its turned lower half
    step = np.arctan2(corners[:, 5, 1] + 1e-3, corners[:, 5, 0] - 2e-3)
    step -= np.arctan2(corners[:, 1, 1] + 1e-3, corners[:, 1, 0] - 2e-3)
    np.testing.assert_allclose(np.degrees(step) % 360, 3.75, atol=1e-6)
    np.testing.assert_allclose(scene.touched, [2e-3, -1e-3, 1.5e-3])
    assert scene.limits == pytest.approx(1e-3 + 4 * 1.5e-3)
    assert scene.thickness == pytest.approx(1.5e-3)


def make_brick(low, high):
    """Nodes of a hexahedron of 27 nodes in lexicographic order."""
    k, j, i = np.meshgrid(*[np.linspace(0, 1, 3)] * 3, indexing="ij")
    return low + np.column_stack([i.ravel(), j.ravel(), k.ravel()]) * (np.array(high) - low)


@pytest.fixture
def bricks():
    """Two hexahedra of 2 x 3 x 1.5 mm side by side along x, whose nodes in common occur once."""
    both = np.concatenate([make_brick(np.zeros(3), (2e-3, 3e-3, 1.5e-3)),
                           make_brick(np.array([2e-3, 0, 0]), (4e-3, 3e-3, 1.5e-3))])  # fmt: skip
    nodes, cells = np.unique(np.round(both, 12), axis=0, return_inverse=True)
    cells = cells.reshape(2, 27)
    base, top = cells[:, :9], cells[:, 18:]
    side = cells[[0]][:, [0, 9, 18, 3, 12, 21, 6, 15, 24]]
    return SolidMesh(nodes=nodes, cells=cells, base=base, top=top, left_out=side, source="two bricks")


def test_a_hexahedron_of_27_nodes_is_split_at_its_middle_in_the_order_of_vtk(bricks):
    cells = split_cells(bricks)
    assert cells.shape == (16, 8)
    half = np.array([1e-3, 1.5e-3, 0.75e-3])
    corners = bricks.nodes[cells]
    np.testing.assert_allclose(corners - corners[:, :1], np.broadcast_to(CORNERS * half, (16, 8, 3)), atol=1e-9)
    first = np.round(corners[:, 0] / half).astype(int)
    assert {tuple(each) for each in first} == {(i, j, k) for i in range(4) for j in (0, 1) for k in (0, 1)}
    assert (bricks.nodes[cells[:8]][..., 0] < 2.1e-3).all()  # those of an element stand together


def test_an_unloaded_mesh_is_coloured_by_its_parts(bricks):
    scene = show_mesh(bricks, ARRAY, title="two bricks")
    x, _, z = bricks.nodes.T
    expected = np.where(z == 0, 3.0, np.where(x == 0, 1.0, 2.0))
    np.testing.assert_array_equal(scene.surface, expected)
    np.testing.assert_array_equal(scene.inside, expected)
    assert scene.thickness == pytest.approx(1.5e-3)
    assert not scene.displacement.any()
    assert scene.displacement.shape == bricks.nodes.shape
    assert (scene.title, scene.texels, scene.texel_forces, scene.indenter) == ("two bricks", ARRAY, None, None)
    assert scene.surface_label.strip() == scene.inside_label.strip() == "parts"
    assert scene.surface_label != scene.inside_label  # bars of one title are merged
    np.testing.assert_array_equal(scene.position, bricks.nodes)
    np.testing.assert_array_equal(scene.cells, split_cells(bricks))


def test_a_loaded_solid_shows_the_pressure_of_its_top_and_the_length_of_its_displacement(bricks):
    """Forces on two nodes, one of which is tangential; one end of the solid has displacements besides the nodes."""
    top = np.unique(bricks.top)
    x, y, _ = bricks.nodes[top].T
    forces = np.zeros((len(top), 3))
    at = int(np.flatnonzero((x == 1e-3) & (np.abs(y - 1.5e-3) < 1e-9))[0])
    edge = int(np.flatnonzero((np.abs(x - 2e-3) < 1e-9) & (y == 0))[0])
    forces[at], forces[edge] = (0.3, 0.1, -0.6), (0.0, 0.0, -0.2)
    moved = np.random.default_rng(2).uniform(-1e-4, 1e-4, (len(bricks.nodes) + 5, 3))
    found = SimpleNamespace(
        mesh=bricks, displacement=moved, fields=None, contact_points=bricks.nodes[top], contact_forces=forces,
        texel_forces=np.array([0.0, 0.1, 0.2, 0.5]),
    )  # fmt: skip
    scene = show_indentation(found, ARRAY, Sphere(radius=50e-3), Pose(point=(1e-3, 1e-3, 4e-3)), title="t")
    # each force is shared by the facets of its node; a facet's force is spread over its area of 6 mm2 at its nodes
    area = 2e-3 * 3e-3
    left, right = 0.6 + 0.1, 0.1
    expected = np.zeros(len(bricks.nodes))
    at_left, at_right = set(bricks.top[0].tolist()), set(bricks.top[1].tolist())
    for node in top:
        share = [(left, node in at_left), (right, node in at_right)]
        facets = sum(on for _, on in share)
        expected[node] = 1e-3 * sum(force for force, on in share if on) / (facets * area)
    np.testing.assert_allclose(scene.surface, expected)
    np.testing.assert_allclose(scene.inside, 1e3 * np.sqrt((moved[:-5] ** 2).sum(axis=1)))
    np.testing.assert_array_equal(scene.displacement, moved[:-5])
    assert (scene.surface_label, scene.inside_label) == ("contact pressure [kPa]", "displacement [mm]")
    assert (scene.title, scene.thickness) == ("t", pytest.approx(1.5e-3))
    assert (scene.indenter, scene.texels) == (Sphere(radius=50e-3), ARRAY)
    np.testing.assert_array_equal(scene.texel_forces, [0.0, 0.1, 0.2, 0.5])
    np.testing.assert_array_equal(scene.position, bricks.nodes)
    np.testing.assert_array_equal(scene.cells, split_cells(bricks))
    # 3/4 of the force acts at (1, 1.5) mm and 1/4 at (2, 0) mm: the nearest node to (1.25, 1.125) is the first one
    np.testing.assert_allclose(scene.touched, [1e-3, 1.5e-3, 1.5e-3], atol=1e-9)
    # the ball passes midway between the two moved nodes that bear force
    ball = scene.pose.position + np.array([0, 0, 50e-3])
    apart = [np.linalg.norm(bricks.nodes[top[k]] + moved[top[k]] - ball) - 50e-3 for k in (at, edge)]
    assert sum(apart) == pytest.approx(0, abs=2e-6)
    np.testing.assert_allclose(scene.pose.point[:2], (1e-3, 1e-3))


def test_a_solid_without_force_is_touched_in_the_middle_of_its_top(bricks):
    top = np.unique(bricks.top)
    found = SimpleNamespace(
        mesh=bricks, displacement=np.zeros_like(bricks.nodes), fields=None, contact_points=bricks.nodes[top],
        contact_forces=np.zeros((len(top), 3)), texel_forces=np.zeros(4),
    )  # fmt: skip
    scene = show_indentation(found, ARRAY, Sphere(radius=5e-3), Pose(point=(1e-3, 1e-3, 4e-3)))
    np.testing.assert_allclose(scene.touched, [2e-3, 1.5e-3, 1.5e-3], atol=1e-9)
    assert not scene.surface.any()


def test_a_tetrahedron_is_drawn_by_its_corners_with_the_pressure_on_its_face():
    """The face z = 1 mm of a right-angled tetrahedron with legs of 2 mm has 2 mm2."""
    corners = np.array([[0, 0, 1.0], [0, 2, 1], [2, 0, 1], [0, 0, 0]]) * 1e-3
    ends = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    nodes = np.concatenate([corners, [corners[list(each)].mean(axis=0) for each in ends]])
    top, base = np.array([[0, 2, 1, 6, 5, 4]]), np.array([[0, 1, 3, 4, 8, 7]])
    mesh = SolidMesh(nodes=nodes, cells=np.arange(10)[None], base=base, top=top,
                     left_out=np.empty((0, 6), dtype=int), source="one")  # fmt: skip
    np.testing.assert_array_equal(split_cells(mesh), [[0, 1, 2, 3]])
    forces = np.zeros((6, 3))
    forces[2] = (0, 0, -0.5)
    found = SimpleNamespace(
        mesh=mesh, displacement=np.zeros((10, 3)), fields=None, contact_points=nodes[np.unique(top)],
        contact_forces=forces, texel_forces=np.zeros(4),
    )  # fmt: skip
    scene = show_indentation(found, ARRAY, Sphere(radius=5e-3), Pose(point=(1e-3, 1e-3, 4e-3)))
    expected = np.zeros(10)
    expected[top[0]] = 1e-3 * 0.5 / 2e-6
    np.testing.assert_allclose(scene.surface, expected)
    np.testing.assert_allclose(scene.touched, nodes[2])


def test_a_node_off_all_facets_has_no_pressure():
    pressure = average_pressure(np.array([[0, 1, 2, 3]]), np.array([2.0, 0, 0, 0, 5.0]), np.array([4e-6]))
    np.testing.assert_allclose(pressure, [5e5, 5e5, 5e5, 5e5, 0])


def test_the_indenter_stays_where_it_is_if_nothing_lies_below_it(bricks):
    """The touched node lies beside the face of the box, where the gap to it has no value."""
    top = np.unique(bricks.top)
    forces = np.zeros((len(top), 3))
    forces[0, 2] = -1.0
    found = SimpleNamespace(
        mesh=bricks, displacement=np.zeros_like(bricks.nodes), fields=None, contact_points=bricks.nodes[top],
        contact_forces=forces, texel_forces=np.zeros(4),
    )  # fmt: skip
    pose = Pose(point=(30e-3, 30e-3, 4e-3))
    scene = show_indentation(found, ARRAY, Box(size=(1e-3, 1e-3, 1e-3)), pose)
    assert scene.pose == pose
    moved = dataclasses.replace(pose, point=(0.0, 0.0, 4e-3))
    scene = show_indentation(found, ARRAY, Box(size=(1e-3, 1e-3, 1e-3)), moved)
    np.testing.assert_allclose(scene.pose.point, (0, 0, 1.5e-3), atol=1e-12)
