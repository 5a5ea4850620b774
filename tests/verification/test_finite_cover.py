"""Covers with free side edges: against general elements, exact solutions and the wide cover; symmetry, convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from scipy.optimize import brentq

from fem_reference import point_spread
from fem_reference.elements.line import Line, line_matrix
from fem_reference.elements.taylor_hood import assemble_linear, prepare_elements
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.finite_cover import (
    Resolution,
    SolidInfluence,
    mesh_quarter,
    solid_influence,
    solve_adjoint,
)
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover, Layer, Material, TexelArray

COARSE = Resolution(across=1.2, through=2)
MIDDLE = Resolution(across=2.25, through=3)
FINE = Resolution(across=3.4, through=3)
SMALL = TexelArray.grid(2, 3, 3.4e-3, texel_size=3.0e-3)
THREE = TexelArray.grid(3, 3, 3.4e-3)


def one_grid(cover, array, resolution=COARSE):
    return SolidInfluence(cover=cover, array=array, grids=(solve_adjoint(cover, array, resolution),))


def test_estimates_are_those_of_the_texels_under_their_own_loads(bonded):
    """The largest error of a texel over the largest force, from the forces of the grids themselves."""
    cover = replace(bonded(0.45), size=(9e-3, 13e-3))
    grids = tuple(solve_adjoint(cover, SMALL, Resolution(across=n, through=2)) for n in (0.8, 1.2, 1.7))
    found = SolidInfluence(cover=cover, array=SMALL, grids=grids)
    own = np.array([np.diag(found._evaluate(grid, SMALL.centres[:, :2])) for grid in grids])
    errors = [grid_convergence(list(each), found.sizes) for each in own.T]
    assert found.error_estimate["peak_texel"] == pytest.approx(max(errors) / own[-1].max(), rel=1e-12)
    assert found.error_estimate["total_force"] == pytest.approx(np.abs(grids[-1].whole - 1).max(), rel=1e-12)
    centre = SMALL.centres[SMALL.middle, :2]  # halfway between the sides
    widths = []
    for grid in grids:
        one = replace(found, grids=(grid,))

        def excess(distance, one=one):
            force = one.texel_influence(SMALL, centre + np.array([[0.0, 0.0], [distance, 0.0]]))
            return force[1, SMALL.middle] - force[0, SMALL.middle] / 2

        widths.append(brentq(excess, 1e-4, 4e-3))
    expected = grid_convergence(widths, found.sizes) / widths[-1]
    assert found.error_estimate["sigma"] == pytest.approx(expected, rel=0.02)


def foil_on_foam(**options):
    foil = Material(name="foil", model="linear-elastic", parameters={"youngs_modulus": 1e8}, poisson_ratio=0.35)
    foam = Material(name="foam", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.45)
    return Cover(layers=(Layer(thickness=1.8e-3, material=foam), Layer(thickness=0.2e-3, material=foil)), **options)


@pytest.mark.parametrize("bulk_compliance", [0.3, 0.0])
def test_line_matrices_make_the_matrix_of_the_general_elements(bulk_compliance):
    x, y, z = np.array([0, 0.3, 1.0]), np.array([0, 0.5, 0.8]), np.array([0, 0.4, 1.0, 1.2])
    mesh = skfem.MeshHex.init_tensor(x, y, z)
    region = (mesh.p[2][mesh.t].mean(axis=0) > 1).astype(int)
    shear, soft = np.array([1.0, 7.0]), np.array([bulk_compliance, 0.2])
    general = prepare_elements(mesh, region=region, order=6)
    expected = assemble_linear(general, shear, soft).toarray()
    upper = TensorSolid(
        edges=(x, y, z), layer=np.array([0, 0, 1]), shear_modulus=shear, bulk_compliance=soft
    ).assemble_upper()
    found = (upper + sp.triu(upper, 1).T).toarray()
    order = np.lexsort(np.round(general.nodes, 9).T[::-1])
    moves = np.concatenate([3 * order + component for component in range(3)])
    split = len(moves)
    assert np.abs(found[:split, :split] - expected[np.ix_(moves, moves)]).max() < 1e-12
    pressure = match_columns(found[:split, split:], expected[np.ix_(moves, np.arange(split, len(expected)))])
    assert np.abs(found[split:, split:] - expected[split:, split:][np.ix_(pressure, pressure)]).max() < 1e-12


def match_columns(found, expected):
    """Which column of `expected` each of `found` is; fails when one has no equal."""
    distance = np.abs(found[:, :, None] - expected[:, None, :]).max(axis=0)
    assert distance.min(axis=1).max() < 1e-12
    return distance.argmin(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("base", ["bonded", "sliding"])
@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_quarter_and_adjoint_equal_the_whole_cover_loaded_at_a_point(bonded, nu, base):
    """A load on the whole cover, general elements, reactions recovered: the same discrete answer by another way."""
    cover = bonded(nu, size=(11e-3, 8e-3), base=base)
    solid = mesh_quarter(cover, SMALL, COARSE)
    x, y, z = (solid.lines[0].edges, solid.lines[1].edges, solid.lines[2].edges)
    mesh = skfem.MeshHex.init_tensor(np.r_[-x[:0:-1], x], np.r_[-y[:0:-1], y], z)
    whole = prepare_elements(mesh, order=6)
    matrix = assemble_linear(whole, solid.shear_modulus, solid.bulk_compliance)
    base_nodes = np.flatnonzero(np.abs(whole.nodes[:, 2]) < 1e-9)
    fixed = (3 * base_nodes[:, None] + np.arange(3)).ravel()
    if base == "sliding":  # three nodes' sides hold it against drifting and turning
        fixed = np.concatenate([3 * base_nodes + 2, [3 * base_nodes[0], 3 * base_nodes[0] + 1, 3 * base_nodes[-1] + 1]])
    top = np.flatnonzero(np.abs(whole.nodes[:, 2] - 1) < 1e-9)
    loaded = top[[3, len(top) // 3, len(top) // 2, -1]]
    load = np.zeros((matrix.shape[0], len(loaded)))
    load[3 * loaded + 2, np.arange(len(loaded))] = -1.0
    system = ConstrainedSystem(fixed).factorise(matrix)
    reaction = system.reaction(system.solve(load), load)[3 * base_nodes + 2]
    expected = recovered(reaction, whole.nodes[base_nodes], (x, y), SMALL, cover.thickness)
    found = one_grid(cover, SMALL).texel_influence(SMALL, whole.nodes[loaded, :2] * cover.thickness)
    assert np.abs(found - expected).max() < 1e-8


def recovered(reaction, nodes, edges, array, unit):
    """Integrals over texels of the continuous pressure whose consistent forces the reactions are, shape (k, n)."""
    lines = [Line(edges=np.r_[-e[:0:-1], e], order=2) for e in edges]
    mass = [line_matrix(line, line, (0, 0), np.ones(len(line.edges) - 1)).toarray() for line in lines]
    order = np.lexsort(np.round(nodes[:, :2], 9).T[::-1])
    forces = reaction[order].reshape(lines[0].count, lines[1].count, -1)
    pressure = np.einsum("ax,by,xyk->abk", np.linalg.inv(mass[0]), np.linalg.inv(mass[1]), forces)
    half = np.array(array.texel_size) / 2
    spans = [(array.centres[:, axis, None] + [[-half[axis], half[axis]]]) / unit for axis in (0, 1)]
    share = [
        np.array([line.integral(low, high) for low, high in span]) for line, span in zip(lines, spans, strict=True)
    ]
    return np.einsum("na,nb,abk->kn", *share, pressure)


@pytest.mark.parametrize("nu", [0.49])
def test_texels_and_outside_add_up_to_the_load(bonded, nu):
    covered = TexelArray.grid(2, 3, 3.4e-3)
    cover = bonded(nu, size=(10.2e-3, 6.8e-3))
    solution = one_grid(cover, covered)
    places = np.random.default_rng(0).uniform(-1, 1, (50, 2)) * [5.1e-3, 3.4e-3]
    assert solution.texel_influence(covered, places).sum(axis=1) == pytest.approx(1, abs=1e-8)
    assert solution.outside(covered, places) == pytest.approx(0, abs=1e-8)
    assert solution.grids[-1].whole == pytest.approx(1, abs=1e-8)
    masked = replace(covered, active=np.array([True, False, True, True, True, True]))
    lost = solution.outside(masked, places)
    assert lost == pytest.approx(solution.texel_influence(covered, places)[:, 1], abs=1e-8)
    assert (solution.texel_influence(masked, places)[:, 1] == 0).all()


@pytest.mark.parametrize("nu", [0.0, pytest.param(0.5, marks=pytest.mark.slow)])
def test_uniform_pressure_on_a_sliding_cover_gives_uniform_base_pressure(bonded, nu):
    """Uniaxial stress is an exact state: every texel carries its part of the area."""
    cover = bonded(nu, size=(11e-3, 8e-3), base="sliding")
    solution = one_grid(cover, SMALL)
    x, y = solution.grids[-1].x, solution.grids[-1].y
    whole = [line.integral(0, line.edges[-1]) / line.edges[-1] for line in (x, y)]
    share = np.einsum("x,y,pxy->p", *whole, solution.grids[-1].texels[0, 0])
    assert share == pytest.approx(np.full(len(share), 9e-6 / (11e-3 * 8e-3)), rel=1e-9)


def test_mirrored_loads_give_mirrored_forces_and_a_square_can_be_turned(bonded):
    square = bonded(0.49, size=(11e-3, 11e-3))
    place = np.array([[1.2e-3, 4.1e-3]])
    solution = one_grid(square, THREE)
    image = THREE.image(solution.texel_influence(THREE, place)[0])
    assert THREE.image(solution.texel_influence(THREE, -place)[0]) == pytest.approx(image[::-1, ::-1], abs=1e-12)
    assert THREE.image(solution.texel_influence(THREE, place[:, ::-1])[0]) == pytest.approx(image.T, abs=1e-12)


def test_exchanging_x_and_y_saves_work_and_changes_nothing(bonded, monkeypatch):
    square = bonded(0.5, size=(11e-3, 11e-3))
    short = solve_adjoint(square, THREE, COARSE).texels
    monkeypatch.setattr("fem_reference.linear_response.finite_cover.MirroredTexels.swapped", None)
    assert np.abs(solve_adjoint(square, THREE, COARSE).texels - short).max() < 1e-11


@pytest.mark.slow
def test_an_array_off_the_middle_gets_its_forces_too(bonded):
    """One texel of an uneven array has the influence it has in an even one."""
    cover = bonded(0.45, size=(14e-3, 12e-3))
    shifted = replace(SMALL, centres=SMALL.centres + np.array([1.7e-3, 0, 0]))
    places = np.random.default_rng(1).uniform(-1, 1, (20, 2)) * [7e-3, 6e-3]
    fine = one_grid(cover, shifted, MIDDLE).texel_influence(shifted, places)
    wider = TexelArray.grid(2, 4, 3.4e-3, texel_size=3.0e-3)  # its columns 1 and 2 and 3 are the shifted array's
    expected = one_grid(cover, wider, MIDDLE).texel_influence(wider, places)
    assert wider.centres[1:4, 0] == pytest.approx(shifted.centres[:3, 0])
    assert np.abs(fine[:, :3] - expected[:, 1:4]).max() < 2e-3


PLACES = np.array([[0, 0], [1.7e-3, 0], [1.7e-3, 1.7e-3], [0.3e-3, 1.1e-3], [5.1e-3, 5.1e-3]])


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.3, 0.49, 0.5])
def test_a_cover_whose_sides_are_far_equals_the_axisymmetric_solution(bonded, nu):
    found = one_grid(bonded(nu, size=(26e-3, 26e-3)), THREE, FINE)
    spread = point_spread(bonded(nu))
    assert np.abs(found.texel_influence(THREE, PLACES) - spread.texel_influence(THREE, PLACES)).max() < 2e-3
    for load in ("point", "uniform"):
        assert np.abs(found.texel_response(THREE, load) - spread.texel_response(THREE, load)).max() < 1e-3
    assert np.abs(found.outside(THREE, PLACES) - spread.outside(THREE, PLACES)).max() < 2e-3


@pytest.mark.slow
def test_a_cover_without_a_size_is_cut_far_away(bonded):
    single = TexelArray.grid(1, 1, 3.4e-3)
    found = one_grid(bonded(0.45), single, MIDDLE)
    assert found.grids[-1].x.edges[-1] * 2e-3 > 20e-3
    spread = point_spread(bonded(0.45))
    assert np.abs(found.texel_response(single) - spread.texel_response(single)).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("base", ["bonded", pytest.param("sliding", marks=pytest.mark.bench)])
def test_a_wide_foil_on_foam_equals_the_axisymmetric_solution(base):
    found = one_grid(foil_on_foam(base=base, size=(34e-3, 34e-3)), THREE, FINE)
    spread = point_spread(foil_on_foam(base=base))
    assert np.abs(found.texel_influence(THREE, PLACES) - spread.texel_influence(THREE, PLACES)).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.3, pytest.param(0.5, marks=pytest.mark.slow)])
def test_refinement_converges_and_the_estimate_covers_the_error(bonded, nu):
    cover = bonded(nu, size=(24e-3, 24e-3))  # its side is far from the one texel
    single = TexelArray.grid(1, 1, 3.4e-3)
    found = solid_influence(cover, single)
    exact = point_spread(bonded(nu)).texel_response(single)[0]
    errors = [
        abs(SolidInfluence(cover=cover, array=single, grids=(grid,)).texel_response(single)[0] - exact)
        for grid in found.grids
    ]
    assert errors[2] < 0.5 * errors[0]
    assert errors[2] < 1e-3
    assert errors[2] <= found.error_estimate["peak_texel"] + 2e-4  # what the wide cover's own error and the side leave
    assert found.error_estimate["peak_texel"] < 0.01
    assert found.error_estimate["sigma"] < 0.01
    assert found.error_estimate["total_force"] < 1e-8


def test_a_free_side_is_not_a_wide_cover(bonded):
    """The planted defect of the comparison above: near its side a finite cover answers otherwise."""
    covered = TexelArray.grid(1, 3, 3.4e-3)
    free = one_grid(bonded(0.49, size=(10.2e-3, 10.2e-3)), covered)
    place = np.array([[4.8e-3, 0.0]])
    wide = point_spread(bonded(0.49)).texel_influence(covered, place)
    assert np.abs(free.texel_influence(covered, place) - wide).max() > 0.02


def test_other_arrays_and_positions_beside_the_cover_are_refused(bonded, wts):
    solution = one_grid(bonded(0.45, size=(11e-3, 8e-3)), SMALL)
    with pytest.raises(ValueError, match="beyond the cover, which is 11 x 8 mm"):
        solution.texel_influence(SMALL, [[0.0, 4.2e-3]])
    with pytest.raises(ValueError, match="of another array"):
        solution.texel_influence(wts, [[0.0, 0.0]])
    with pytest.raises(ValueError, match="planar"):
        solid_influence(bonded(0.45), replace(SMALL, centres=SMALL.centres + np.array([0, 0, 1e-3])))
