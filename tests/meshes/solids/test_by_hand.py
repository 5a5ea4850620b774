"""Numbers of swept meshes, texels on curved bases and measures of quality, computed by hand at unusual inputs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from meshes import Layer, TexelArray
from meshes.catalogue import MATERIALS
from meshes.solids import check_quality, check_texels, fingertip, flat_pad, phalanx, sweep
from meshes.solids.solid_mesh import (
    assign_layers,
    compute_volume,
    describe_size,
    measure_area,
    measure_height,
    measure_thickness,
    scaled_jacobians,
)
from meshes.solids.swept import cylinder_surface, fingertip_surface, flat_surface, grade_heights
from meshes.solids.tetrahedra import label_mesh, refine
from meshes.solids.texels import covered_share, cylinder_texels, fingertip_texels, tangent_axes
from tests.fem_reference.curved_cover.test_responses import split_box


@pytest.mark.parametrize(
    ("layers", "interfaces", "expected"),
    [
        (2, (), [0, 0.5, 1]),
        # sizes 1/2 + sin(k pi / 8) / 2 for odd k: 0.6913, 0.9619, 0.9619, 0.6913
        (4, (), [0, 0.20908, 0.5, 0.79092, 1]),
        # three elements of sizes 3/4, 1 and 3/4 in each layer
        (4, (0.4,), [0, 0.12, 0.28, 0.4, 0.58, 0.82, 1]),
        (2, (0.4, 0.5), [0, 0.2, 0.4, 0.45, 0.5, 0.75, 1]),
    ],
)
def test_elements_are_thinner_at_the_ends_of_each_layer(layers, interfaces, expected):
    np.testing.assert_allclose(grade_heights(layers, interfaces), expected, atol=1e-5)


def test_a_layer_has_its_share_of_the_elements_if_that_is_more():
    assert len(grade_heights(10, (0.03,))) == 1 + 9 + 10


@pytest.mark.parametrize(
    ("size", "along", "quads"),
    [((6e-3, 4e-3), 2e-3, (3, 2)), ((6e-3, 4e-3), 2.5e-3, (3, 2)), ((6e-3, 4e-3), 9e-3, (1, 1)),
     ((3e-3, 5e-3), 1.0001e-3, (3, 5)), ((3e-3, 5e-3), 0.9999e-3, (4, 6))],
)  # fmt: skip
def test_a_rectangle_is_divided_into_elements_of_at_most_a_size(size, along, quads):
    surface = flat_surface(size, along)
    assert len(surface.quads) == quads[0] * quads[1]
    assert len(surface.points) == (2 * quads[0] + 1) * (2 * quads[1] + 1)
    np.testing.assert_allclose(surface.points.min(axis=0), [-size[0] / 2, -size[1] / 2, 0])
    np.testing.assert_allclose(surface.points.max(axis=0), [size[0] / 2, size[1] / 2, 0])
    corner = surface.points[surface.quads[0]]
    np.testing.assert_allclose(corner[1] - corner[0], [size[0] / quads[0] / 2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(corner[3] - corner[0], [0, size[1] / quads[1] / 2, 0], atol=1e-12)
    assert surface.settings == {"width": size[0], "length": size[1], "element_size": along}


def test_a_cylinder_and_a_fingertip_have_their_elements():
    tube = cylinder_surface(4e-3, 1.5, 5e-3, 2.1e-3)  # an arc of 6 mm
    assert len(tube.quads) == 3 * 3
    assert tube.settings == {"radius": 4e-3, "angle": 1.5, "length": 5e-3, "element_size": 2.1e-3}
    np.testing.assert_allclose(np.hypot(*tube.points[:, ::2].T), 4e-3)
    np.testing.assert_allclose(np.ptp(np.arctan2(*tube.points[:, ::2].T)), 1.5)
    np.testing.assert_allclose(np.unique(tube.points[:, 1].round(9)), np.linspace(-2.5e-3, 2.5e-3, 7).round(9))
    # two elements on an eighth of a circle of 3.14 mm: 8 around and 2 along the cylinder, 8 + 8 + 4 + 4 on the sphere
    tip = fingertip_surface(4e-3, 5e-3, 3e-3)
    assert len(tip.quads) == 8 * 2 + 24
    assert tip.settings == {"radius": 4e-3, "length": 5e-3, "element_size": 3e-3}
    np.testing.assert_allclose(np.linalg.norm(tip.points - np.minimum(tip.points, 0) * [0, 1, 0], axis=1), 4e-3)
    np.testing.assert_allclose(tip.normals, (tip.points - np.minimum(tip.points, 0) * [0, 1, 0]) / 4e-3, atol=1e-12)
    assert tip.points[:, 1].min() == pytest.approx(-5e-3)
    assert tip.points[:, 2].min() > -1e-12
    inner = tip.points[tip.quads]
    outward = np.cross(inner[:, 1] - inner[:, 0], inner[:, 3] - inner[:, 0])
    assert (np.einsum("qc,qc->q", outward, tip.normals[tip.quads[:, 4]]) > 0).all()


def test_a_cover_of_uneven_thickness_has_the_volume_below_it():
    surface = flat_surface((6e-3, 4e-3), 2e-3)
    height = 2e-3 + 0.1 * surface.points[:, 0]
    mesh = sweep(surface, height, layers=3)
    assert compute_volume(mesh) == pytest.approx(24e-6 * 2e-3)
    assert measure_area(mesh, "base") == pytest.approx(24e-6)
    # top of slope 0.1; two trapezia of 6 mm x 2 mm, one end of 1.7 mm and one of 2.3 mm
    assert measure_area(mesh, "top") == pytest.approx(24e-6 * np.hypot(1, 0.1) + 24e-6 + 4e-3 * 4e-3)
    assert measure_area(mesh, "left_out") == 0
    assert mesh.settings == {**surface.settings, "layers": 3, "inward": False}
    assert sweep(surface, 2e-3, layers=3, inward=True).settings["thickness"] == 2e-3
    below = sweep(surface, 2e-3, layers=3, inward=True, interfaces=(0.25,))
    assert np.unique(below.nodes[:, 2].round(9))[[0, -1]].tolist() == [-2e-3, 0]
    assert below.settings["layers"] == 2 + 2
    assert len(below.cells) == 6 * 4
    levels = np.array([0, 1, 2, 3, 4, 7, 10, 13, 16]) / 16
    np.testing.assert_allclose(np.unique(below.nodes[:, 2].round(9)), 2e-3 * (levels - 1), atol=1e-9)


def test_three_meshes_of_a_cover_have_their_elements():
    pad = flat_pad(size=(4e-3, 3e-3), thickness=1.5e-3, rows=2)
    # sizes of 1.008, 0.798 and 0.63 mm, then 0.72, 0.57 and 0.45 mm
    assert [len(mesh.cells) for mesh in pad.meshes(1.4)] == [4 * 3 * 3, 6 * 4 * 3, 7 * 5 * 4]
    assert [len(mesh.cells) for mesh in pad.meshes()] == [6 * 5 * 3, 8 * 6 * 3, 9 * 7 * 4]
    assert len(pad.mesh().cells) == 6 * 4 * 4  # 0.75 mm
    divided = pad.divide([0.3e-3, 0.6e-3, 0.6e-3])
    assert (divided.thickness, divided.interfaces) == (pytest.approx(1.5e-3), pytest.approx((0.2, 0.6)))
    assert len(divided.mesh(2e-3, layers=3).cells) == 2 * 2 * 6


def test_built_in_covers_have_the_sizes_that_they_state():
    pad, finger, tip = flat_pad(), phalanx(), fingertip()
    assert compute_volume(pad.mesh(20e-3, layers=2)) == pytest.approx(20e-3 * 20e-3 * 2e-3)
    volume = np.pi / 3 * (8e-3**2 - 6e-3**2) * 20e-3
    assert compute_volume(finger.mesh(2.2e-3, layers=2)) == pytest.approx(volume, rel=1e-4)
    assert compute_volume(tip.mesh(2.4e-3, layers=2)) == pytest.approx(
        np.pi / 2 * (64e-6 - 36e-6) * 14.4e-3 + np.pi / 3 * (512e-9 - 216e-9), rel=1e-3
    )
    assert (pad.texels.rows, pad.texels.columns, pad.texels.texel_size) == (5, 5, (3.4e-3, 3.4e-3))
    assert (finger.texels.rows, finger.texels.columns, finger.texels.pitch) == (8, 5, (2.2e-3, 2.2e-3))
    assert finger.texels.texel_size == pytest.approx((1.98e-3, 1.98e-3))
    assert tip.texels.count == 66
    assert tip.texels.texel_size == pytest.approx((0.85 * 2.35e-3, 0.85 * 2.35e-3))
    assert np.linalg.norm(finger.texels.centres[1] - finger.texels.centres[0]) == pytest.approx(
        2 * 6e-3 * np.sin(1.1e-3 / 6e-3)
    )


def test_texels_on_a_cylinder_have_their_places():
    """Turns of -0.4, 0 and 0.4 on a radius of 5 mm."""
    texels = cylinder_texels(5e-3, rows=2, columns=3, pitch=(2e-3, 3e-3), size=(1.5e-3, 2.5e-3), name="ring")
    turn, y = np.tile([-0.4, 0, 0.4], 2), np.repeat([-1.5e-3, 1.5e-3], 3)
    np.testing.assert_allclose(
        texels.centres, np.column_stack([5e-3 * np.sin(turn), y, 5e-3 * np.cos(turn)]), atol=1e-15
    )
    np.testing.assert_allclose(texels.normals, np.column_stack([np.sin(turn), 0 * y, np.cos(turn)]), atol=1e-15)
    assert (texels.rows, texels.columns, texels.pitch, texels.texel_size) == (2, 3, (2e-3, 3e-3), (1.5e-3, 2.5e-3))


def test_texels_on_a_fingertip_lie_in_rings():
    """Seven on each of four rings of the cylinder; 7, 6, 4 and 1 at latitudes of 11.25 + 22.5 k degrees."""
    texels = fingertip_texels(6e-3, 10e-3, pitch=2.5e-3, size=2e-3, name="tip")
    latitude = np.radians(np.repeat([0, 0, 0, 0, 11.25, 33.75, 56.25, 78.75], [7, 7, 7, 7, 7, 6, 4, 1]))
    shift = np.repeat([-8.75e-3, -6.25e-3, -3.75e-3, -1.25e-3, 0], [7, 7, 7, 7, 18])
    np.testing.assert_allclose(texels.centres[:, 1], 6e-3 * np.sin(latitude) + shift, atol=1e-12)
    np.testing.assert_allclose(texels.normals[:, 1], np.sin(latitude), atol=1e-12)
    around = np.degrees(np.arctan2(texels.normals[:, 0], texels.normals[:, 2]))
    np.testing.assert_allclose(around[:7], 180 / 7 * np.arange(-3, 4), atol=1e-9)
    np.testing.assert_allclose(around[-11:], [*np.arange(-75, 76, 30), *np.arange(-67.5, 68, 45), 0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(texels.normals, axis=1), 1)
    assert texels.texel_size == (2e-3, 2e-3)
    assert fingertip_texels(6e-3, 1e-3, pitch=2.5e-3, size=2e-3, name="tip").count == 7 + 18  # at least one ring


def test_tangents_of_texels_follow_y_or_minus_z_at_the_pole():
    axes = tangent_axes(np.array([[0.6, 0, 0.8], [0, 0.6, 0.8], [0, 1, 0], [0, -1, 0]]))
    expected = [
        [[0.8, 0, -0.6], [0, 1, 0]], [[1, 0, 0], [0, 0.8, -0.6]], [[1, 0, 0], [0, 0, -1]], [[-1, 0, 0], [0, 0, -1]]
    ]  # fmt: skip
    np.testing.assert_allclose(axes, expected, atol=1e-12)


def test_a_part_of_the_base_belongs_to_texels_by_its_overlap():
    """A texel of 2 mm x 1 mm; parts of 0.5 mm x 0.4 mm, sheared ones and ones that face away."""
    one = TexelArray.grid(1, 1, (2e-3, 1e-3))
    points = 1e-3 * np.array([[0.9, 0.5, 0], [-0.9, -0.5, 0.3], [1.2, 0, 0], [1.3, 0, 0], [0, 0, 0], [0.9, 0, 0]])
    normals = np.array([[0, 0, 1.0]] * 4 + [[0, 0, -1.0]] + [[0.6, 0, 0.8]])
    spread = np.tile(1e-3 * np.array([[0.5, 0, 0], [0, 0.4, 0]]), (6, 1, 1))
    spread[5, 1, 0] = -0.3e-3  # 0.8 mm along x
    share = covered_share(one, points, normals, spread)
    np.testing.assert_allclose(share, [[0.7 * 0.5, 0.7 * 0.5, 0.1, 0, 0, 0.5 / 0.8]], atol=1e-12)
    twice = TexelArray.grid(1, 2, (0.5e-3, 1e-3), texel_size=(1e-3, 1e-3))
    both = covered_share(twice, points[:1] * [0, 0, 0], normals[:1], spread[:1])
    np.testing.assert_allclose(both, [[0.5], [0.5]])


def bend(mesh, rise):
    """Lift the nodes of a mesh by a quadratic function of x and y, which quadratic elements represent exactly."""
    return dataclasses.replace(mesh, nodes=mesh.nodes + rise(*mesh.nodes.T)[:, None] * [0, 0, 1])


HEXAHEDRA = sweep(flat_surface((4e-3, 2e-3), 1e-3), 2e-3, layers=2)
TETRAHEDRA = split_box((4, 2, 2), (4e-3, 2e-3, 2e-3))


@pytest.mark.parametrize(
    "mesh", [HEXAHEDRA, TETRAHEDRA, refine(TETRAHEDRA)], ids=["hexahedra", "tetrahedra", "refined"]
)
def test_a_bent_block_has_its_volume_its_area_and_its_thickness(mesh):
    """z + k x^2 with k = 100 / m: a parabola of slope s up to 0.4, of the length (asinh(s) + s sqrt(1 + s^2)) / 2 k."""
    assert measure_height(flatten(mesh)) == pytest.approx(2e-3)
    bent = bend(mesh, lambda x, y, z: 100 * x**2 * (z >= 0))
    assert compute_volume(bent) == pytest.approx(16e-9)
    slope = 0.4
    length = (np.arcsinh(slope) + slope * np.hypot(1, slope)) / 200
    assert measure_area(bent, "base") == pytest.approx(length * 2e-3, rel=1e-5)
    assert measure_thickness(bent) == pytest.approx(8e-6 / length, rel=1e-5)
    thick = bend(mesh, lambda x, y, z: 50 * z * x)  # 2 mm + 0.1 x, of 1.8 to 2.2 mm
    assert compute_volume(thick) == pytest.approx(16e-9)
    assert measure_height(flatten(thick)) == pytest.approx(2e-3, abs=0.06e-3)


def flatten(mesh):
    """Only the facets of the top that face up: the sides can be touched as well."""
    high = mesh.nodes[mesh.top][:, :, 2].min(axis=1) > 1.2e-3
    return dataclasses.replace(mesh, top=mesh.top[high], left_out=np.concatenate([mesh.left_out, mesh.top[~high]]))


def test_scaled_jacobians_of_known_shapes():
    """Cubes 1, sheared cubes the sine of their angle, a corner of a cube 1 / sqrt 2, a regular tetrahedron 1."""
    np.testing.assert_allclose(scaled_jacobians(HEXAHEDRA), 1)
    sheared = bend(HEXAHEDRA, lambda x, y, z: 0.75 * x)
    np.testing.assert_allclose(scaled_jacobians(sheared), 0.8)
    cubes = split_box((2, 2, 2), (2e-3, 2e-3, 2e-3))
    corner = cubes.nodes[cubes.cells[:, :4]]
    edges = np.sort(np.linalg.norm(corner[:, :, None] - corner[:, None], axis=-1).reshape(len(corner), -1), axis=1)
    # six tetrahedra of a cube: edges 1, 1, 1, sqrt 2, sqrt 2, sqrt 3, and the largest product at a corner sqrt 6
    np.testing.assert_allclose(edges[:, 4::2] / 1e-3, np.sqrt([[1, 1, 1, 2, 2, 3]] * len(edges)))
    np.testing.assert_allclose(scaled_jacobians(cubes), 1 / np.sqrt(3))
    quality = check_quality(cubes)
    assert quality.scaled_jacobian == pytest.approx(1 / np.sqrt(3))
    # the edge of a regular tetrahedron of 1/6 mm3
    assert quality.through == pytest.approx(quality.thickness / (1e-3 * 2 ** (1 / 6)))
    assert (quality.kind, quality.elements, quality.nodes) == ("tetrahedra", 48, 125)
    assert check_quality(HEXAHEDRA).kind == "hexahedra"
    assert (check_quality(HEXAHEDRA).elements, check_quality(HEXAHEDRA).nodes) == (16, 9 * 5 * 5)


@pytest.mark.parametrize(("steep", "slivers"), [(19.0, 0), (21.0, 16)])
def test_hexahedra_of_less_than_a_twentieth_are_slivers(steep, slivers):
    quality = check_quality(bend(HEXAHEDRA, lambda x, y, z: steep * x))
    assert quality.scaled_jacobian == pytest.approx(1 / np.hypot(1, steep))
    assert (quality.inverted, quality.slivers) == (0, slivers)
    assert len(quality.faults) == (slivers > 0)


@pytest.mark.parametrize(("steep", "slivers"), [(99.0, 0), (101.0, 1)])
def test_tetrahedra_of_less_than_a_hundredth_are_slivers(steep, slivers):
    """A right-angled corner with edges of 1 and one of 1 / s: the largest product at a corner is sqrt(2 + 2 / s^2)."""
    nodes = 1e-3 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1 / steep]])
    quality = check_quality(label_mesh(nodes, np.arange(4)[None], np.array([1, 0, 0, 0]), source="one", settings={}))
    assert quality.scaled_jacobian == pytest.approx(1 / np.hypot(1, steep))
    assert (quality.inverted, quality.slivers) == (0, slivers)


@pytest.mark.parametrize(
    ("length", "accepted"),
    [(0.99e-3, False), (1.0e-3, True), (1.7e-3, True), (0.3, True), (0.301, False), (1.1, False)],
)
def test_bodies_of_one_to_three_hundred_millimetres_are_covers(length, accepted):
    said = describe_size(length, "the pad")
    assert (not said) == accepted
    if said:
        assert f"the pad would be {1e3 * length:.4g} mm long, outside 1..300 mm" in said


@pytest.mark.parametrize(
    ("through", "refined", "fault"), [(2, None, False), (2, 0, False), (1, 0, False), (1, 1, True)]
)
def test_a_mesh_needs_elements_through_the_thickness_and_half_as_many_beside_its_refinement(through, refined, fault):
    mesh = dataclasses.replace(HEXAHEDRA, cells=HEXAHEDRA.cells[: 8 * through])
    settings = {} if refined is None else {"refined": refined}
    faults = check_quality(dataclasses.replace(mesh, settings=settings)).faults
    assert any("elements through the thickness, at least 1.5 needed" in each for each in faults) == fault


def place_texels(count, *, off=0.0, turn=0.0):
    normals = np.tile([np.sin(turn), 0, np.cos(turn)], (count, 1))
    centres = np.tile([0.1e-3, 0.2e-3, off], (count, 1))
    return TexelArray(
        centres=centres, normals=normals, texel_size=(1e-3, 1e-3), pitch=(1e-3, 1e-3), rows=1, columns=count,
        active=np.ones(count, dtype=bool),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ({"off": 0.19e-3, "turn": np.radians(29.5)}, None),
        ({"off": -0.19e-3, "turn": np.radians(-29.5)}, None),
        ({"off": 0.21e-3}, r"22 of 22 texels are off the base: 0, .*, 19 and 2 more, texel 0 by 0.21 mm"),
        ({"turn": np.radians(30.5)}, r"22 of 22 texels do not point out of the base there: 0, .*, 19 and 2 more"),
    ],
)
def test_texels_lie_within_a_tenth_of_the_thickness_and_thirty_degrees(place, message):
    texels = place_texels(22, **place)
    if message is None:
        check_texels(HEXAHEDRA, texels)
        return
    with pytest.raises(ValueError, match=message):
        check_texels(HEXAHEDRA, texels)


@pytest.mark.parametrize(
    ("share", "off", "message"),
    [(0.3, 0.0009, None), (0.3, -0.0009, None), (0.3, 0.0011, "no edges of elements lie at 30.11 %"),
     (0.025, 0.0, None), (0.023, 0.0, "thinner than 2.4 %")],
)  # fmt: skip
def test_layers_end_at_edges_of_elements_within_a_thousandth(share, off, message):
    mesh = sweep(flat_surface((4e-3, 2e-3), 2e-3), 2e-3, layers=3, interfaces=(share,))
    end = share + off
    layers = tuple(
        Layer(thickness=2e-3 * part, material=MATERIALS[name])
        for part, name in ((end, "dragon-skin-30"), (1 - end, "pet"))
    )
    if message is None:
        assert np.bincount(assign_layers(mesh, layers))[0] == 2 * 2
        return
    with pytest.raises(ValueError, match=message):
        assign_layers(mesh, layers)
