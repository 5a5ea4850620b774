"""Surfaces, touches, distances and solids of solid covers against closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fem_reference.curved_cover.facet_surface import FacetSurface, quadrature
from fem_reference.curved_cover.penetration import measure_penetration
from fem_reference.curved_cover.rays import explain_miss, find_first_node, find_touch, measure_gaps
from fem_reference.curved_cover.responses import (
    GridResponse,
    TexelResponses,
    check_meshes,
    estimate_error,
    find_above,
    find_uncovered,
    project_texels,
)
from fem_reference.curved_cover.solid import CoverSolid
from meshes import Box, Cylinder, Layer, LetterH, Material, Roller, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad, phalanx
from tests.fem_reference.curved_cover.test_responses import split_box


def cut_top(mesh, height):
    """The facets of the top that do not belong to the sides, which can be touched as well: those of the height 1."""
    nodes = mesh.nodes[mesh.top]
    return FacetSurface.part_of(mesh.nodes, mesh.top[np.isclose(height(nodes), 1.0, atol=1e-3).all(axis=1)])


PAD = flat_pad(size=(8e-3, 6e-3), rows=2, thickness=2e-3)
MESH = PAD.mesh(2e-3, layers=2)  # elements of 2 mm
TOP = cut_top(MESH, lambda nodes: nodes[..., 2] / 2e-3)
TETRAHEDRA = split_box((4, 3, 2), (8e-3, 6e-3, 2e-3))
TRIANGLES = cut_top(TETRAHEDRA, lambda nodes: nodes[..., 2] / 2e-3)
ROUND = phalanx(radius=6e-3, length=6e-3, rows=2, columns=3)
ROUND_MESH = ROUND.mesh(1.2e-3, layers=2)
CROWN = cut_top(ROUND_MESH, lambda nodes: np.hypot(nodes[..., 0], nodes[..., 2]) / 8e-3)  # a cylinder about y


@pytest.mark.parametrize("top", [TOP, TRIANGLES], ids=["quadrilaterals", "triangles"])
def test_a_flat_top_has_its_area_its_moments_and_its_thrust(top):
    """Integrals of 1, x and x^2 over 8 mm x 6 mm: 48 mm2, 0 and 256 mm4; of y^2: 144 mm4."""
    x, y, z = top.nodes.T
    assert top.areas.sum() == pytest.approx(48e-6)
    np.testing.assert_allclose(np.asarray(top.mass.sum(axis=1)).ravel(), top.areas, atol=1e-18)
    assert x @ top.mass @ x == pytest.approx(256e-12)
    assert y @ top.mass @ y == pytest.approx(144e-12)
    assert x @ top.mass @ y == pytest.approx(0, abs=1e-18)
    np.testing.assert_allclose(top.normals, np.tile([0, 0, 1], (len(x), 1)), atol=1e-12)
    pressure = np.array([np.full(len(x), 2e3), 1e6 * x, 3e8 * y**2])
    forces = top.integrate_pressure(pressure)
    np.testing.assert_allclose(forces.sum(axis=1), [[0, 0, -0.096], [0, 0, 0], [0, 0, -0.0432]], atol=1e-9)
    # moment about y of the pressure 1e6 x: the integral of x p
    assert np.cross(top.nodes, forces[1]).sum(axis=0)[1] == pytest.approx(256e-6, rel=1e-6)
    assert (z == z[0]).all()


@pytest.mark.parametrize("parts", [1, 3])
def test_parts_of_facets_tile_them(parts):
    middle, area, edges = TOP.split(parts)
    assert middle.shape == (12, parts**2, 3)
    np.testing.assert_allclose(area, np.broadcast_to([0, 0, 4e-6 / parts**2], area.shape), atol=1e-18)
    lengths = np.linalg.norm(edges, axis=-1)
    np.testing.assert_allclose(lengths, 2e-3 / parts)
    np.testing.assert_allclose(np.einsum("fkc,fkc->fk", edges[:, :, 0], edges[:, :, 1]), 0, atol=1e-18)
    # the middles are those of a regular grid of the whole top
    steps = (np.arange(4 * parts) + 0.5) * 2e-3 / parts - 4e-3
    np.testing.assert_allclose(np.unique(middle[..., 0].round(9)), steps.round(9))
    triangles = TRIANGLES.split(parts)[1]
    np.testing.assert_allclose(triangles.sum(axis=(0, 1)), [0, 0, 48e-6], atol=1e-15)


@pytest.mark.parametrize(
    ("top", "chosen"),  # beside a border of triangles only a point near the nearest one is found
    [(TOP, slice(None)), (TRIANGLES, [0, 1, 4])], ids=["quadrilaterals", "triangles"],
)  # fmt: skip
def test_the_nearest_point_of_a_flat_top_is_below_or_on_its_border(top, chosen):
    points = 1e-3 * np.array([[0.3, -1.7, 5.0], [3.9, 2.9, 2.0], [7.0, 0.4, 2.0], [-5.0, -7.0, 1.0], [1.0, 1.0, 0.5]])
    nearest = 1e-3 * np.array([[0.3, -1.7, 2.0], [3.9, 2.9, 2.0], [4.0, 0.4, 2.0], [-4.0, -3.0, 2.0], [1.0, 1.0, 2.0]])
    points, nearest = points[chosen], nearest[chosen]
    weights, distance = top.locate(points)
    np.testing.assert_allclose(weights @ top.nodes, nearest, atol=1e-9)
    np.testing.assert_allclose(distance, np.linalg.norm(points - nearest, axis=1), atol=1e-9)
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_the_nearest_point_of_a_cylinder_is_on_its_radius():
    angles, heights = np.array([-0.7, 0.0, 0.3, 0.9]), np.array([-2e-3, 0.1e-3, 1.7e-3, 2.9e-3])
    for radius in (11e-3, 5e-3):
        points = np.column_stack([radius * np.sin(angles), heights, radius * np.cos(angles)])
        weights, distance = CROWN.locate(points)
        expected = np.column_stack([8e-3 * np.sin(angles), heights, 8e-3 * np.cos(angles)])
        np.testing.assert_allclose(weights @ CROWN.nodes, expected, atol=5e-6)
        np.testing.assert_allclose(distance, abs(radius - 8e-3), atol=5e-6)


def test_a_cylinder_under_pressure_is_pushed_by_its_projected_area():
    """p times 2 R sin(60 degrees) times the length, against z; the sides cancel."""
    force = CROWN.integrate_pressure(np.full((1, len(CROWN.nodes)), 1e4))[0].sum(axis=0)
    np.testing.assert_allclose(force, [0, 0, -1e4 * 2 * 8e-3 * np.sin(np.radians(60)) * 6e-3], atol=1e-4)
    assert CROWN.areas.sum() == pytest.approx(8e-3 * np.radians(120) * 6e-3, rel=1e-4)
    out = CROWN.nodes * [1, 0, 1] / 8e-3
    np.testing.assert_allclose(CROWN.normals, out, atol=5e-3)


def down(x, y, z=20e-3):
    return Pose.facing([x, y, z], [0, 0, -1])


@pytest.mark.parametrize(
    ("pose", "indenter", "travel"),
    [
        (down(0, 0), Sphere(radius=3e-3), 18e-3), (down(1.3e-3, -2.1e-3), Sphere(radius=3e-3), 18e-3),
        (down(2e-3, 1e-3), Cylinder(radius=1e-3), 18e-3), (down(0, 0, 1e-3), Sphere(radius=3e-3), -1e-3),
        # a ball beside the pad touches its edge, a ball beside its corner the corner
        (down(5.5e-3, 0), Sphere(radius=3e-3), 18e-3 + 3e-3 - np.sqrt(9 - 1.5**2) * 1e-3),
        (down(5e-3, -4.5e-3), Sphere(radius=3e-3), 18e-3 + 3e-3 - np.sqrt(9 - 1 - 1.5**2) * 1e-3),
        (down(8e-3, 0), Sphere(radius=3e-3), np.inf), (down(6e-3, 0), Box(size=(3e-3, 3e-3, 4e-3)), np.inf),
        (down(5e-3, 0), Box(size=(3e-3, 3e-3, 4e-3)), 18e-3),
        # from below the top faces away
        (Pose.facing([0, 0, -9e-3], [0, 0, 1]), Sphere(radius=3e-3), np.inf),
    ],
)  # fmt: skip
def test_the_travel_to_the_first_touch_of_a_pad(pose, indenter, travel):
    assert find_touch(TOP, indenter, pose) == pytest.approx(travel, abs=1e-6)


@pytest.mark.parametrize("x", [0.0, 1e-3, -3e-3, 4.5e-3])
def test_a_ball_over_a_cylinder_touches_where_the_distance_of_the_axes_is_the_sum_of_the_radii(x):
    """Its lowest point begins at 20 mm: the middle travels from 23 mm to sqrt(11^2 - x^2) mm."""
    touch = find_touch(CROWN, Sphere(radius=3e-3), down(x, 0.5e-3))
    assert touch == pytest.approx(23e-3 - np.sqrt(11e-3**2 - x**2), abs=3e-6)
    node = CROWN.nodes[find_first_node(CROWN, Sphere(radius=3e-3), down(x, 0.5e-3), touch)]
    middle = np.array([8 / 11 * x, 0.5e-3, 8 / 11 * np.sqrt(11e-3**2 - x**2)])
    assert np.linalg.norm(node - middle) < 0.8e-3


def test_of_nodes_that_touch_together_the_first_is_next_to_the_axis():
    touch = find_touch(TOP, Box(size=(5e-3, 5e-3, 4e-3)), down(1.2e-3, -0.7e-3))
    node = TOP.nodes[find_first_node(TOP, Box(size=(5e-3, 5e-3, 4e-3)), down(1.2e-3, -0.7e-3), touch)]
    np.testing.assert_allclose(node, [1e-3, -1e-3, 2e-3], atol=1e-12)


def test_a_miss_is_explained_by_the_place_or_by_the_elements():
    assert explain_miss(TOP, down(9e-3, 0)).startswith("the indenter never touches the cover")
    assert "points of the elements, 2 mm wide" in explain_miss(TOP, down(0.1e-3, 0))
    assert "points of the elements" in explain_miss(TOP, down(5.9e-3, 0))  # less than an element beside it
    assert explain_miss(TOP, down(6.1e-3, 0)).startswith("the indenter never touches the cover")


@pytest.mark.parametrize(
    ("indenter", "point", "direction", "behind", "gap"),
    [
        (Sphere(radius=3e-3), (0, 0, -1e-3), (0, 0, 1), 0, 1e-3),
        (Sphere(radius=3e-3), (0, 0, 7e-3), (0, 0, 1), 0.5e-3, np.inf),  # it has passed by 1 mm
        (Sphere(radius=3e-3), (0, 0, 7e-3), (0, 0, 1), 1.5e-3, -7e-3),
        (Sphere(radius=3e-3), (0, 0, 2e-3), (0, 0, 1), 0, -2e-3),  # inside
        (Box(size=(4e-3, 6e-3, 5e-3)), (-5e-3, 2.9e-3, 1e-3), (1, 0, 0), 0, 3e-3),
        (Box(size=(4e-3, 6e-3, 5e-3)), (-5e-3, 3.1e-3, 1e-3), (1, 0, 0), 0, np.inf),
        (Box(size=(4e-3, 6e-3, 5e-3)), (0, 0, 6e-3), (0, 0, -1), 0, 1e-3),
        (Cylinder(radius=3e-3), (-5e-3, 0, 1e-3), (0.6, 0, 0.8), 0, 2e-3 / 0.6),
        (Roller(radius=3e-3, length=6e-3), (-1e-3, 0, -2e-3), (0, 0, 1), 0, 2e-3 + 3e-3 - np.sqrt(8) * 1e-3),
    ],
)
def test_a_gap_is_the_distance_at_which_a_line_enters(indenter, point, direction, behind, gap):
    found = measure_gaps(indenter, np.array([point]), np.array([direction], dtype=float), behind=behind)[0]
    assert found == pytest.approx(gap, abs=1e-12)


@pytest.mark.parametrize(
    ("indenter", "point", "inside"),
    [
        (Sphere(radius=3e-3), (0, 0, -1e-3), -1e-3), (Sphere(radius=3e-3), (4e-3, 0, 3e-3), -1e-3),
        (Box(size=(4e-3, 6e-3, 5e-3)), (0, 0, -0.7e-3), -0.7e-3),
        (Box(size=(4e-3, 6e-3, 5e-3)), (0, 0, 4.6e-3), 0.4e-3),
        (Cylinder(radius=3e-3), (3.5e-3, 0, 1e-3), -0.5e-3),
        (LetterH(size=(12e-3, 16e-3), bar=4e-3), (5e-3, 7e-3, 0.3e-3), 0.3e-3),
    ],
)  # fmt: skip
def test_a_point_outside_is_as_far_outside(indenter, point, inside):
    assert measure_penetration(indenter, np.array([point]))[0] == pytest.approx(inside, abs=1e-12)


def make_material(modulus, poisson_ratio=0.0):
    parameters = {"youngs_modulus": modulus}
    return Material(name="x", model="linear-elastic", parameters=parameters, poisson_ratio=poisson_ratio)


@pytest.mark.parametrize("moduli", [(1e6,), (3e6, 0.5e6)])
def test_a_pad_without_lateral_strain_is_a_spring_of_its_layers(moduli):
    """Under a uniform pressure the top sinks by p sum(h / E), and the base bears p A; Poisson's ratio is zero."""
    heights = (2e-3,) if len(moduli) == 1 else (0.5e-3, 1.5e-3)
    layers = tuple(Layer(thickness=h, material=make_material(each)) for h, each in zip(heights, moduli, strict=True))
    mesh = flat_pad(size=(8e-3, 6e-3), rows=2, thickness=2e-3).divide(heights).mesh(2e-3, layers=2)
    solid, top = CoverSolid(mesh, layers), cut_top(mesh, lambda nodes: nodes[..., 2] / 2e-3)
    forces = np.zeros_like(solid.nodes)
    forces[top.index] = top.integrate_pressure(np.full((1, len(top.nodes)), 5e4))[0]
    moved, reaction = solid.solve_fully(forces)
    sunk = 5e4 * sum(h / each for h, each in zip(heights, moduli, strict=True))
    np.testing.assert_allclose(moved[top.index], np.tile([0, 0, -sunk], (len(top.nodes), 1)), atol=1e-6 * sunk)
    level = np.isclose(solid.nodes[:, 2], heights[0])
    np.testing.assert_allclose(moved[level, 2], -5e4 * heights[0] / moduli[0], rtol=1e-6)
    np.testing.assert_allclose(reaction.sum(axis=0), [0, 0, 5e4 * 48e-6], atol=1e-9)
    many = solid.solve(top.index, forces=np.array([forces, -2 * forces]))
    np.testing.assert_allclose(many[:, :, 2], np.outer([-sunk, 2 * sunk], np.ones(len(top.nodes))), rtol=1e-6)


def make_response(texels=PAD.texels):
    """Made-up influence of three forces per node: the k-th texel feels (k + 1) (x, 2, 3) of each node's place."""
    per_node = np.stack([TOP.nodes[:, 0], np.full(len(TOP.nodes), 2.0), np.full(len(TOP.nodes), 3.0)], axis=1)
    influence = np.array([(k + 1) * per_node for k in range(texels.count)])
    return GridResponse(mesh=MESH, top=TOP, influence=influence)


def test_forces_on_texels_are_sums_over_nodes_and_axes():
    grid = make_response()
    forces = np.zeros((len(TOP.nodes), 3))
    forces[4], forces[9] = (1.0, 0.5, -2.0), (0.0, 0.0, 1.0)
    one = TOP.nodes[4, 0] + 1.0 - 6.0 + 3.0
    np.testing.assert_allclose(grid.texel_forces(forces), one * np.arange(1, 5))
    np.testing.assert_allclose(grid.texel_forces(np.array([forces, -forces])), np.outer([1, -1], one * np.arange(1, 5)))
    np.testing.assert_allclose(grid.normal_influence, np.outer(np.arange(1, 5), np.full(len(TOP.nodes), -3.0)))
    point = np.array([[1.1e-3, -0.4e-3, 2.05e-3]])
    np.testing.assert_allclose(grid.at(point), [-3.0 * np.arange(1, 5)])
    np.testing.assert_allclose(grid.at(point, np.array([[1.0, 0, 0]])), [1.1e-3 * np.arange(1, 5)], rtol=1e-9)
    with pytest.raises(ValueError, match=r"a point lies 1 mm off the top"):
        grid.at(np.array([[0.0, 0.0, 3e-3]]))
    aside = np.array([[1.1e-3, -0.4e-3, 3e-3]])  # the nearest point of the top counts
    sideways = np.array([[1.0, 0, 0]])
    np.testing.assert_allclose(grid.at(aside, sideways, beside=True), [1.1e-3 * np.arange(1, 5)], rtol=1e-9)


def test_inactive_texels_feel_nothing_and_pressures_act_against_the_normals():
    texels = dataclasses.replace(PAD.texels, active=np.array([True, False, True, True]))
    made = TexelResponses(texels=texels, layers=(), grids=(make_response(),))
    forces = np.zeros((len(TOP.nodes), 3))
    forces[3, 2] = 1.0
    np.testing.assert_allclose(made.texel_forces(forces), [3.0, 0, 9.0, 12.0])
    # -3 per newton against the normal, times p A
    np.testing.assert_allclose(made.under_pressure(np.full(len(TOP.nodes), 1e3)), -0.144 * np.array([1, 0, 3, 4]))
    both = made.under_pressure(np.outer([1.0, 2.0], np.full(len(TOP.nodes), 1e3)))
    np.testing.assert_allclose(both, -0.144 * np.outer([1, 2], [1, 0, 3, 4]))


def test_points_above_texels_are_on_their_normals():
    np.testing.assert_allclose(find_above(TOP, PAD.texels), PAD.texels.centres + np.array([0, 0, 2e-3]), atol=1e-9)
    np.testing.assert_allclose(
        find_above(CROWN, ROUND.texels), ROUND.texels.centres + 2e-3 * ROUND.texels.normals, atol=5e-6
    )
    assert not find_uncovered(CROWN, ROUND.texels, 2e-3).any()
    # a top 3 mm high is covered by a layer of 1 mm or more, and one of 0.6 mm is another side of the body
    assert find_uncovered(TOP, PAD.texels, 0.66e-3).all()
    assert not find_uncovered(TOP, PAD.texels, 0.67e-3).any()
    moved = dataclasses.replace(PAD.texels, centres=PAD.texels.centres + np.array([2.9e-3, 0, 0]))
    # texels at x = 1.2 and 4.6 mm: the second is 0.6 mm beside the pad, more than a quarter of 2 mm
    assert find_uncovered(TOP, moved, 2e-3).tolist() == [False, True, False, True]
    assert not find_uncovered(TOP, moved, 2.5e-3).any()
    behind = dataclasses.replace(PAD.texels, normals=-PAD.texels.normals)
    assert find_uncovered(TOP, behind, 2e-3).all()


def test_texels_of_a_flat_base_hold_their_area():
    """Texels of 3.4 mm on elements of 2 mm: integrals of the projections are the areas, their sum is one inside."""
    base = FacetSurface.part_of(MESH.nodes, MESH.base)
    values = project_texels(base, PAD.texels)
    np.testing.assert_allclose(values @ base.areas, np.full(4, 3.4e-3 * 3.0e-3), rtol=2e-2)
    assert values.sum(axis=0) @ base.areas == pytest.approx(6.8e-3 * 6e-3, rel=1e-2)


@pytest.mark.parametrize(("factor", "order", "ratio"), [(8, 2.0, 2.0), (64, 1.5, 4.0), (1.1, 2.0, 1.2)])
def test_an_error_is_estimated_from_the_largest_change_between_meshes(factor, order, ratio):
    """1.25 c / (r^p - 1) of the largest change c on elements r times smaller, r at least 1.2 (Roache 1994)."""
    cells = np.repeat(MESH.cells, 10, axis=0)
    meshes = [dataclasses.replace(MESH, cells=np.resize(cells, (round(10 * n), cells.shape[1]))) for n in (1, factor)]
    found = estimate_error([[1.0, 2.0], [1.1, 2.3]], meshes, least=order)
    assert found == pytest.approx(1.25 * 0.3 / (ratio**order - 1))
    assert np.isnan(estimate_error([[1.0]], meshes[:1]))


def test_meshes_are_given_from_coarse_to_fine():
    finer = flat_pad(size=(8e-3, 6e-3), rows=2, thickness=2e-3).mesh(1.5e-3, layers=2)
    check_meshes([MESH, finer])
    for wrong in ([finer, MESH], [MESH, MESH], [], [MESH] * 4):
        with pytest.raises(ValueError, match=r"give (one, two or three|the meshes from coarse)"):
            check_meshes(wrong)


def test_unknowns_are_displacements_off_the_base_and_a_pressure_at_each_corner():
    """Of 2 x 1 x 2 hexahedra: 5 x 3 x 5 nodes, 15 of them on the base, and 3 x 2 x 3 corners."""
    mesh = flat_pad(size=(4e-3, 2e-3)).mesh(2e-3, layers=2)
    assert CoverSolid(mesh, make_material(1e6)).unknowns == 3 * (75 - 15) + 18


def test_facets_have_four_gauss_points_along_each_side_or_those_of_order_six_on_triangles():
    """Exact for x^6 y^6, with 4 / 49, and for x^4 y^2, with 4! 2! / 8!; of x^8 Gauss misses 2 / 9 by 0.0116."""
    place, weight = quadrature(9)
    assert (place.shape, weight.shape) == ((16, 2), (16,))
    assert weight @ (place**6).prod(axis=1) == pytest.approx(4 / 49)
    assert weight @ place[:, 0] ** 8 == pytest.approx(2 * (2 / 9 - 128 / 11025))
    place, weight = quadrature(6)
    assert weight @ (place[:, 0] ** 4 * place[:, 1] ** 2) == pytest.approx(24 * 2 / 40320)
