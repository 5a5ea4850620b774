from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from meshes import TexelArray
from meshes.bounded_file import pack_npz
from meshes.solids import check_quality, check_texels, fingertip, flat_pad, phalanx, read_mesh, sweep, write_mesh
from meshes.solids.facets import node_normals
from meshes.solids.solid_mesh import compute_volume, measure_area
from meshes.solids.swept import cylinder_surface, flat_surface, grade_heights, join_grids
from meshes.solids.texels import covered_share, tangent_axes

R, H, L = 6e-3, 2e-3, 14.4e-3


def test_volume_and_base_of_a_fingertip_are_those_of_its_geometry():
    mesh = fingertip().mesh()
    volume = np.pi / 2 * ((R + H) ** 2 - R**2) * L + np.pi / 3 * ((R + H) ** 3 - R**3)
    assert compute_volume(mesh) == pytest.approx(volume, rel=1e-5)
    assert measure_area(mesh, "base") == pytest.approx(np.pi * R * (L + R), rel=1e-5)
    # The top is all that is not bonded: the outer surface and the sides that it ends in.
    outer, sides = np.pi * (R + H) * (L + R + H), 2 * H * L + np.pi * ((R + H) ** 2 - R**2)
    assert measure_area(mesh, "top") == pytest.approx(outer + sides, rel=1e-5)
    nodes = mesh.nodes[np.unique(mesh.base)]
    radius = np.linalg.norm(np.column_stack([nodes[:, 0], np.maximum(nodes[:, 1], 0), nodes[:, 2]]), axis=1)
    np.testing.assert_allclose(radius, R, rtol=1e-12)


@pytest.mark.parametrize(
    "cover",
    [pytest.param(flat_pad(), marks=pytest.mark.slow), phalanx(), pytest.param(fingertip(), marks=pytest.mark.slow)],
    ids=lambda cover: cover.texels.name,
)
def test_built_in_covers_have_good_meshes_with_all_texels_on_the_base(cover):
    mesh = cover.mesh()
    quality = check_quality(mesh)
    assert quality.faults == ()
    assert quality.scaled_jacobian > 0.85
    assert quality.through == 4
    check_texels(mesh, cover.texels)


def test_the_surface_of_a_mesh_is_closed():
    mesh = fingertip().mesh(2e-3, layers=2)
    used, normals = node_normals(mesh.nodes, mesh.top[: len(mesh.base)])
    assert (np.einsum("nc,nc->n", normals, mesh.nodes[used] * [1, 0, 1]) >= 0).all()
    corners = [0, 2, 8, 6]
    facets = np.concatenate([mesh.base[:, corners][:, ::-1], mesh.top[:, corners]])
    edges = [tuple(edge) for k in range(4) for edge in facets[:, [k, (k + 1) % 4]].tolist()]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)


def test_an_inward_sweep_meets_the_outer_surface_exactly():
    surface = cylinder_surface(8e-3, 2.0, 10e-3, 2e-3)
    mesh = sweep(surface, 2e-3, inward=True)
    np.testing.assert_array_equal(mesh.nodes[-len(surface.points) :], surface.points)
    assert compute_volume(mesh) == pytest.approx(2.0 / 2 * (64e-6 - 36e-6) * 10e-3, rel=1e-4)


def test_a_surface_on_a_grid_computes_its_normals():
    x, y = np.meshgrid(np.linspace(-1e-2, 1e-2, 9), np.linspace(-1e-2, 1e-2, 7))
    surface = join_grids([(np.stack([x, y, 0.1 * x], axis=-1), None)], "given")
    np.testing.assert_allclose(surface.normals, np.tile(np.array([-0.1, 0, 1]) / np.hypot(1, 0.1), (63, 1)), atol=1e-12)


def test_a_mesh_file_holds_its_mesh_and_a_changed_one_is_named(tmp_path):
    mesh = flat_pad().mesh(4e-3)
    path = tmp_path / "pad.npz"
    write_mesh(path, mesh)
    assert read_mesh(path).digest == mesh.digest
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["nodes"][7, 2] += 1e-9
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=r"pad\.npz was changed"):
        read_mesh(path)
    path.write_text("no mesh")
    for name, message in (("pad.npz", r"pad\.npz"), ("absent.npz", "give the path")):
        with pytest.raises(ValueError, match=message):
            read_mesh(tmp_path / name)


FLAT = flat_surface((1e-2, 1e-2), 5e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sweep(cylinder_surface(1e-3, 2.0, 10e-3, 0.5e-3), 2e-3, inward=True), "elements are inverted"),
        (lambda: sweep(flat_surface((20.0, 20.0), 5.0), 2.0), "were millimetres taken for metres"),
        (lambda: sweep(FLAT, np.arange(len(FLAT.points)) * 1e-3), "must be positive everywhere"),
        (lambda: sweep(FLAT, 1e-3, layers=1), "at least 2 layers"),
        (lambda: join_grids([(np.zeros((4, 5, 3)), None)], "given"), "odd numbers of points"),
        (lambda: flat_surface((10e-3, 10e-3), 1e-6), "an edge of 10 mm"),
        (lambda: flat_surface((10e-3, 10e-3), 5e-5), "40000 quadrilaterals"),
    ],
)
def test_bad_covers_are_refused_and_too_many_elements_before_they_are_made(make, message):
    with pytest.raises(ValueError, match=message):
        check_quality(make()).require()


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"centres": np.array([[0, 0, 1e-3]])}, "off the base: 0, texel 0 by 1 mm"),
        ({"centres": np.array([[0.02, 0, 0]])}, "off the base: 0, texel 0 by 10 mm"),
        ({"normals": np.array([[0.0, 0, -1]])}, "do not point out of the base"),
    ],
)
def test_texels_off_the_base_are_refused(fault, message):
    mesh = flat_pad().mesh(4e-3)
    place = {"centres": np.zeros((1, 3)), "normals": np.array([[0.0, 0, 1]])} | fault
    texels = TexelArray(
        **place, texel_size=(1e-3, 1e-3), pitch=(1e-3, 1e-3), rows=1, columns=1, active=np.ones(1, dtype=bool)
    )
    with pytest.raises(ValueError, match=message):
        check_texels(mesh, texels)


def test_texels_that_touch_share_a_flat_base_without_rest_and_overlap_on_a_cylinder():
    texels = flat_pad().texels
    axes = tangent_axes(texels.normals)
    np.testing.assert_array_equal(axes, np.tile([[1.0, 0, 0], [0, 1, 0]], (25, 1, 1)))
    points = np.array([[1e-4, 2e-4, 0], [1.7e-3, 0.0, 0], [9e-3, 0, 0]])
    spread = np.tile([[1e-3, 0, 0], [0, 1e-3, 0]], (3, 1, 1))
    share = covered_share(texels, points, np.tile([0.0, 0, 1], (3, 1)), spread)
    np.testing.assert_allclose(share.sum(axis=0), [1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.sort(share[:, 1])[-2:], 0.5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"about": np.array("[" * 100_000)}, "deep; give a mesh file of softcover"),
        ({"nodes": np.array(["a"])}, "has nodes of type <U1"),
        ({"nodes": np.ones((30, 3), dtype=complex)}, "has nodes of type complex128"),
        ({"cells": np.full((3, 27), np.nan)}, "has cells of type float64"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_mesh_files_of_strangers_are_refused_in_a_line(tmp_path, changes, message):
    """The files hold arrays, or a text `about`, that `write_mesh` would not write."""
    path = tmp_path / "mesh.npz"
    write_mesh(path, phalanx().mesh(3e-3, layers=2))
    with np.load(path) as found:
        arrays = {**found, **changes}
    path.write_bytes(pack_npz(arrays))
    with pytest.raises(ValueError, match=message):
        read_mesh(path)


def test_a_mesh_in_one_point_has_no_quality(tmp_path):
    """Its file states a valid hash."""
    mesh = phalanx().mesh(3e-3, layers=2)
    write_mesh(tmp_path / "mesh.npz", dataclasses.replace(mesh, nodes=0 * mesh.nodes))
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="has no area; mesh again"):
        check_quality(read_mesh(tmp_path / "mesh.npz"))


def test_every_layer_has_more_elements_on_finer_meshes():
    """Otherwise no estimate of the error contains that of the layers."""
    for inner in ([0.5], [0.3, 0.7], [0.9]):
        counts = [np.diff(np.searchsorted(grade_heights(n, inner), [0.0, *inner, 1.0])) for n in (3, 4, 5)]
        assert (np.diff(counts, axis=0) >= 0).all()
        assert (counts[2] > counts[0]).all()
        assert (counts[0] >= 2).all()
    for wrong in ([0.8, 0.3], [1.2], [0.0]):
        with pytest.raises(ValueError, match="ascend between 0 and 1"):
            grade_heights(3, wrong)
