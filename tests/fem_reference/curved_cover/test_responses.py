from __future__ import annotations

import numpy as np
import pytest

from fem_reference.curved_cover import texel_responses
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.responses import estimate_error, project_texels
from fem_reference.curved_cover.solid import CoverSolid
from fem_reference.linear_response.finite_cover import solid_influence
from meshes import Cover, Layer, Material, TexelArray
from meshes.solids import fingertip, flat_pad, phalanx
from meshes.solids.shell import BONDED, LEFT_OUT, TOUCHABLE
from meshes.solids.tetrahedra import label_mesh, list_boundary


def rubber(poisson_ratio, modulus=1e6):
    return Material(
        name="rubber", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=poisson_ratio
    )


def split_box(counts, size):
    """Tetrahedral mesh of a box on the plane z = 0."""
    import skfem

    mesh = skfem.MeshTet.init_tensor(
        *(np.linspace(-s / 2, s / 2, n + 1) for s, n in zip(size[:2], counts[:2], strict=True)),
        np.linspace(0, size[2], counts[2] + 1),
    )
    cells = mesh.t.T.astype(np.int64)
    corner = mesh.p.T[cells]
    turned = np.linalg.det(corner[:, 1:] - corner[:, :1]) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    nodes = mesh.p.T.copy()
    facets = nodes[list_boundary(cells)]
    low, high = ((facets[..., 2] == height).all(axis=1) for height in (0, size[2]))
    label = np.where(low, BONDED, np.where(high, TOUCHABLE, LEFT_OUT))
    return label_mesh(nodes, cells, label, source="box", settings={})


COARSE = phalanx(length=6e-3, rows=2, columns=2).mesh(2.5e-3, layers=2)


@pytest.mark.parametrize("mesh", [COARSE, split_box((2, 2, 2), (4e-3, 4e-3, 2e-3))], ids=["curved", "tetrahedra"])
def test_a_rigid_motion_of_the_base_moves_the_whole_cover(mesh):
    solid = CoverSolid(mesh, rubber(0.5))
    turn = np.array([[0, -1.0, 2.0], [1, 0, -3], [-2, 3, 0]])
    base = solid.nodes[solid.base]
    moved = solid.solve(np.arange(len(solid.nodes)), base=(base @ turn.T + [1e-3, 2e-3, 3e-3])[None])[0]
    np.testing.assert_allclose(moved, solid.nodes @ turn.T + [1e-3, 2e-3, 3e-3], atol=1e-13)


@pytest.mark.parametrize("mesh", [COARSE, split_box((3, 3, 2), (6e-3, 6e-3, 2e-3))], ids=["curved", "tetrahedra"])
def test_reactions_balance_force_and_moment_and_reciprocity_holds(mesh):
    solid = CoverSolid(mesh, rubber(0.49))
    top = FacetSurface.part_of(solid.nodes, solid.layout.top)
    forces = np.zeros_like(solid.nodes)
    forces[top.index] = np.random.default_rng(1).normal(size=(len(top.index), 3))
    moved, reaction = solid.solve_fully(forces)
    np.testing.assert_allclose(reaction.sum(axis=0), -forces.sum(axis=0), atol=1e-10)
    moment = np.cross(solid.nodes, forces).sum(axis=0)
    np.testing.assert_allclose(np.cross(solid.nodes[solid.base], reaction).sum(axis=0), -moment, atol=1e-12)
    weight = np.random.default_rng(2).normal(size=(1, len(solid.base), 3))
    lifted = solid.solve(top.index, base=weight)[0]
    assert (lifted * forces[top.index]).sum() == pytest.approx(-(weight[0] * reaction).sum(), rel=1e-9)
    np.testing.assert_allclose(solid.solve(top.index, forces=forces[None])[0], moved[top.index], atol=1e-15)


def test_one_texel_over_the_whole_flat_base_feels_every_normal_force():
    cover = flat_pad(size=(6e-3, 6e-3), rows=1, pitch=6e-3)
    response = texel_responses([cover.mesh(3e-3, layers=2)], cover.texels, rubber(0.45))
    influence = response.finest.influence[0]
    np.testing.assert_allclose(influence, np.tile([0.0, 0, -1], (len(influence), 1)), atol=1e-10)
    pressure = np.full(len(influence), 1e4)
    assert response.under_pressure(pressure)[0] == pytest.approx(1e4 * 36e-6, rel=1e-10)


@pytest.mark.slow
def test_texels_hold_their_area_on_the_base():
    cover = fingertip()
    mesh = cover.mesh(1.5e-3, layers=2)
    base = FacetSurface.part_of(mesh.nodes, mesh.base)
    values = project_texels(base, cover.texels)
    area = values @ base.mass.sum(axis=1)
    half = cover.texels.texel_size[0] / 2
    flat = 2 * half * 2 * 6e-3 * np.arcsin(half / 6e-3)  # a square projected onto a cylinder
    np.testing.assert_allclose(area[:48], flat, rtol=2e-3)
    assert base.areas.sum() == pytest.approx(np.pi * 6e-3 * (14.4e-3 + 6e-3), rel=1e-3)


def test_points_are_located_on_a_curved_top():
    mesh = fingertip().mesh(1.5e-3, layers=2)
    top = FacetSurface.part_of(mesh.nodes, mesh.top)
    direction = np.random.default_rng(3).normal(size=(50, 3))
    direction[:, 1:] = np.abs(direction[:, 1:])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    weights, distance = top.locate(9e-3 * direction)
    np.testing.assert_allclose(weights @ top.nodes, 8e-3 * direction, atol=2e-5)
    np.testing.assert_allclose(distance, 1e-3, rtol=2e-2)


def test_a_masked_texel_gets_nothing_and_modulus_and_size_have_no_effect():
    cover = flat_pad(size=(8e-3, 8e-3), rows=2, pitch=3e-3)
    mesh = cover.mesh(4e-3, layers=2)
    response = texel_responses([mesh], cover.texels, rubber(0.4))
    other = texel_responses([mesh], cover.texels, rubber(0.4, modulus=3e4))
    np.testing.assert_allclose(other.matrix, response.matrix, rtol=1e-9)
    half = flat_pad(size=(4e-3, 4e-3), thickness=1e-3, rows=2, pitch=1.5e-3)
    small = texel_responses([half.mesh(2e-3, layers=2)], half.texels, rubber(0.4))
    np.testing.assert_allclose(small.matrix, response.matrix, rtol=1e-9)
    masked = TexelArray.grid(2, 2, 3e-3, active=[True, False, True, True])
    force = np.zeros_like(response.finest.top.nodes) - [0, 0, 1.0]
    found = texel_responses([mesh], masked, rubber(0.4)).texel_forces(force)
    assert found[1] == 0
    np.testing.assert_allclose(found[[0, 2, 3]], response.texel_forces(force)[[0, 2, 3]])


def test_errors_are_estimated_from_two_or_three_meshes():
    meshes = flat_pad(size=(4e-3, 4e-3)).meshes()
    sizes = np.array([len(mesh.cells) ** (-1 / 3) for mesh in meshes])
    values = 1 + np.outer(sizes**3, [1.0, -2.0])
    assert estimate_error(values, meshes) == pytest.approx(1.25 * 2 * sizes[2] ** 3, rel=1e-6)
    second = 1 + sizes**2
    assert estimate_error(second[1:], meshes[1:]) == pytest.approx(1.25 * sizes[2] ** 2, rel=1e-6)
    assert np.isnan(estimate_error(second[:1], meshes[:1]))


def test_meshes_of_one_size_count_as_different_by_a_fifth():
    mesh = flat_pad(size=(4e-3, 4e-3)).mesh(2e-3, layers=2)
    assert estimate_error(np.array([1.0, 1.1]), [mesh, mesh]) == pytest.approx(1.25 * 0.1 / (1.2**2 - 1))


def test_bad_input_is_refused():
    cover = flat_pad(size=(8e-3, 8e-3), rows=2)
    mesh = cover.mesh(4e-3, layers=2)
    with pytest.raises(ValueError, match="from coarse to fine"):
        texel_responses((mesh, mesh), cover.texels, rubber(0.3))
    with pytest.raises(ValueError, match="off the base"):
        texel_responses([mesh], TexelArray.grid(1, 3, 6e-3, texel_size=1e-3), rubber(0.3))
    with pytest.raises(ValueError, match="off the top"):
        texel_responses([mesh], cover.texels, rubber(0.3)).finest.at(np.array([[0, 0, 1.0]]))


@pytest.mark.slow
def test_errors_are_relative_to_the_largest_force_above_a_texel():
    meshes = [split_box((n, n, m), (6e-3, 6e-3, 2e-3)) for n, m in ((5, 2), (7, 3))]
    texels = flat_pad(size=(6e-3, 6e-3), rows=2).texels
    each = [texel_responses([mesh], texels, rubber(0.4)).matrix for mesh in meshes]
    found = texel_responses(meshes, texels, rubber(0.4)).error_estimate
    own = [np.diag(matrix) for matrix in each]
    assert found["peak_texel"] == pytest.approx(estimate_error(own, meshes) / own[-1].max(), rel=1e-9)
    assert found["any_texel"] == pytest.approx(estimate_error(each, meshes) / own[-1].max(), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("poisson_ratio", [0.5])
def test_a_flat_pad_of_hexahedra_equals_the_solution_with_free_edges(poisson_ratio):
    cover = flat_pad(size=(10e-3, 10e-3), rows=2)
    response = texel_responses(cover.meshes(), cover.texels, rubber(poisson_ratio))
    layer = Layer(thickness=2e-3, material=rubber(poisson_ratio))
    known = solid_influence(Cover(layers=(layer,), size=(10e-3, 10e-3)), cover.texels)
    expected = known.texel_influence(cover.texels, cover.texels.centres[:, :2])
    difference = np.abs(response.matrix - expected).max() / expected.max()
    assert difference < 2e-3
    assert difference < response.error_estimate["any_texel"] < 0.05


@pytest.mark.slow
def test_tetrahedra_and_hexahedra_agree_on_a_flat_pad():
    cover = flat_pad(size=(10e-3, 10e-3), rows=2)
    hexahedra = texel_responses(cover.meshes(), cover.texels, rubber(0.49))
    boxes = [split_box((n, n, m), (10e-3, 10e-3, 2e-3)) for n, m in ((8, 3), (10, 4), (13, 5))]
    tetrahedra = texel_responses(boxes, cover.texels, rubber(0.49))
    difference = np.abs(tetrahedra.matrix - hexahedra.matrix).max() / hexahedra.matrix.max()
    assert difference < tetrahedra.error_estimate["any_texel"] + hexahedra.error_estimate["any_texel"]
    assert difference < 0.01


@pytest.mark.slow
def test_a_cylinder_of_growing_radius_tends_to_the_flat_pad():
    flat = flat_pad(size=(10e-3, 10e-3), rows=3, pitch=2.5e-3)
    material = rubber(0.49)
    expected = texel_responses([flat.mesh()], flat.texels, material).matrix
    differences = []
    for radius in (2e-2, 4e-2, 8e-2):
        cover = phalanx(radius=radius, angle=10e-3 / radius, length=10e-3, rows=3, columns=3, pitch=2.5e-3 / 0.9)
        texels = TexelArray(
            centres=radius * _turn(flat.texels.centres, radius) + [[0, y, 0] for y in flat.texels.centres[:, 1]],
            normals=_turn(flat.texels.centres, radius),
            texel_size=flat.texels.texel_size,
            pitch=flat.texels.pitch,
            rows=3,
            columns=3,
            active=flat.texels.active,
        )
        differences.append(np.abs(texel_responses([cover.mesh()], texels, material).matrix - expected).max())
    ratio = np.array(differences[:-1]) / differences[1:]
    assert (ratio > 1.6).all()
    assert differences[-1] < 0.03


def _turn(centres, radius):
    angle = centres[:, 0] / radius
    return np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
