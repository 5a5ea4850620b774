from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from meshes.solids.facets import area_vectors
from meshes.solids.shell import BONDED, LEFT_OUT, TOUCHABLE, Shell, join, leave_out
from meshes.solids.solid_mesh import SolidMesh, check_quality, compute_volume, measure_area
from meshes.solids.tetrahedra import _fit, fill_with_tetrahedra, label_mesh, list_boundary, orient_tetrahedra, refine
from meshes.surfaces.smooth import smooth_surface
from meshes.surfaces.triangles import (
    check_closed,
    enclosed_volume,
    find_crossings,
    merge_corners,
    nearest_points,
    normal_vectors,
)

SIZE = (6e-3, 4e-3, 2e-3)
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)]) * SIZE
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
FACES = np.array([[q[0], *q[k : k + 2]] for q in QUADS for k in (1, 2)])
BOX = CORNERS[FACES]
#: A box of five tetrahedra.
FIVE = np.array([[0, 3, 5, 6], [0, 3, 1, 5], [0, 6, 2, 3], [0, 5, 4, 6], [3, 6, 7, 5]])


@pytest.mark.parametrize(
    ("triangles", "message"),
    [
        (BOX[1:], "not closed: it has 3 open edges"),
        (np.concatenate([BOX, BOX[:1]]), "more than two triangles"),
        (np.concatenate([BOX[:1, ::-1], BOX[1:]]), "face different ways"),
        (BOX[:, ::-1], "inside out"),
        (np.concatenate([BOX, BOX + 1e-3]), "intersects itself"),
        (np.where(np.arange(12)[:, None, None] == 3, np.nan, BOX), "no number"),
        (BOX * [1, 1, 0], "not closed|encloses no volume"),
        (BOX[:, :2], "shape"),
    ],
)
def test_bad_surfaces_are_refused_in_one_line(triangles, message):
    with pytest.raises(ValueError, match=message) as caught:
        check_closed(triangles, "box.stl")
    assert "box.stl" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_touching_and_nested_boxes_do_not_cross():
    assert len(find_crossings(BOX)) == 0
    assert len(find_crossings(np.concatenate([BOX, 0.5 * BOX + [0, 0, 5e-4]]))) == 0
    assert len(find_crossings(np.concatenate([BOX, BOX + 1e-3]))) > 3


#: Points around a triangle with sides 3, 4 and 5 and the height above it, and their nearest points in its plane.
AROUND = [
    ((1, 1, 2), (1, 1)), ((1, 1, -2), (1, 1)),
    ((2, -1, 1), (2, 0)), ((-2, 3, 1), (0, 3)), ((1.5 + 0.8, 2 + 0.6, -1), (1.5, 2)),
    ((-1, -2, 1), (0, 0)), ((5, -1, 0), (3, 0)), ((3.4, 0, 1), (3, 0)), ((-1, 5, 1), (0, 4)),
]  # fmt: skip


@pytest.mark.parametrize("scale", [1e-5, 1e-3, 1.0])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 1, 0)])
def test_the_nearest_point_lies_inside_on_a_side_or_at_a_corner_at_every_scale(scale, order):
    points = scale * np.array([point for point, _ in AROUND])
    expected = scale * np.array([[*nearest, 0] for _, nearest in AROUND])
    triangle = scale * np.array([[[0, 0, 0], [3, 0, 0], [0, 4, 0]]])[:, order]
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    found, _ = nearest_points(points @ turn.T, triangle @ turn.T)
    np.testing.assert_allclose(found, expected @ turn.T, rtol=0, atol=1e-13 * scale)


@pytest.mark.parametrize("corners", [(0, 0, 3), (0, 3, 3), (3, 0, 0), (0, 2, 3), (0, 3, 1)])
@pytest.mark.parametrize("turn", [[0, 0, 0], [0.3, -1.1, 0.7], [1.2, 0.1, 0.4]])
def test_a_triangle_without_area_is_a_line(corners, turn):
    turned = 1e-3 * Rotation.from_rotvec(turn).as_matrix().T
    points = np.array([[1.0, 0.5, 0.0], [1.0, 0.1, -0.7], [-1, 1, 1], [4, 0, 2]]) @ turned
    triangle = np.array([[[corner, 0.0, 0.0] for corner in corners]]) @ turned
    expected = np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 0], [3, 0, 0]]) @ turned
    np.testing.assert_allclose(nearest_points(points, triangle)[0], expected, rtol=0, atol=1e-17)


def label_box(nodes=CORNERS, cells=FIVE):
    """A mesh of the box on its lower face, of which the face at the smallest x is left out."""
    facets = nodes[list_boundary(cells)]
    low = (facets[..., 2] == 0).all(axis=1)
    mount = (facets[..., 0] == CORNERS[0, 0]).all(axis=1)
    label = np.where(low, BONDED, np.where(mount, LEFT_OUT, TOUCHABLE))
    return label_mesh(nodes, cells, label, source="box", settings={})


def test_everything_that_is_neither_bonded_nor_left_out_can_be_touched():
    mesh = label_box()
    for _ in range(3):
        assert compute_volume(mesh) == pytest.approx(np.prod(SIZE), rel=1e-12)
        assert check_quality(mesh).inverted == 0
        assert measure_area(mesh, "base") == pytest.approx(24e-6)
        assert measure_area(mesh, "left_out") == pytest.approx(8e-6)
        assert measure_area(mesh, "top") == pytest.approx((24 + 8 + 24) * 1e-6)
        # The normals of the base point into the cover, all others out of it.
        assert area_vectors(mesh.nodes, mesh.base, np.array([[0.2, 0.3]]))[..., 2].min() > 0
        outward = area_vectors(mesh.nodes, mesh.left_out, np.array([[0.2, 0.3]]))
        assert outward[..., 0].max() < 0
        count = len(mesh.cells)
        mesh = refine(mesh)
        assert len(mesh.cells) == 8 * count
        # Parts that share an edge share its middle: no two nodes lie in one place.
        assert len(np.unique(np.round(mesh.nodes * 1e9), axis=0)) == len(mesh.nodes)
    assert list_boundary(mesh.cells).shape == (12 * 4**3, 6)


def test_a_surface_of_which_nothing_is_bonded_or_touchable_is_refused():
    for label, what in ((TOUCHABLE, "lies on the base"), (BONDED, "can be touched")):
        with pytest.raises(ValueError, match=what):
            label_mesh(CORNERS, FIVE, np.full(12, label), source="box", settings={})


def fill_between(triangles, radii):
    """Straight tetrahedra between copies of a closed surface that are scaled to some radii, three in each prism."""
    points, faces = merge_corners(triangles)
    faces, count = np.sort(faces, axis=1), len(points)
    nodes = np.concatenate([radius * points for radius in radii])
    cells = [
        faces[:, [0, 1, 2, 2]] + count * np.array([k, k, k, k + 1]) for k in range(len(radii) - 1)
    ] + [
        faces[:, [0, 1, 1, 2]] + count * np.array([k, k, k + 1, k + 1]) for k in range(len(radii) - 1)
    ] + [
        faces[:, [0, 0, 1, 2]] + count * np.array([k, k + 1, k + 1, k + 1]) for k in range(len(radii) - 1)
    ]  # fmt: skip
    return nodes, orient_tetrahedra(nodes, np.concatenate(cells))


@pytest.mark.slow
@pytest.mark.parametrize("change", [[1.0, 0.6, 1.4]])
def test_a_mesh_has_the_labels_and_the_shape_of_the_smooth_surface_and_so_have_its_refinements(change):
    """A shell around a core, whose own corners are those of 320 triangles.  Nothing of it is flat or open."""
    given = np.array(trimesh.creation.icosphere(subdivisions=2, radius=1.0).triangles) * change * 8e-3
    ball = smooth_surface(given, 1e-5)[0]
    shell = join(ball, 0.5 * ball)
    assert (shell.label == BONDED).sum() == (shell.label == TOUCHABLE).sum() == len(ball)
    below = shell.surface[..., 2].max(axis=1) < -4e-3
    shell = leave_out(shell, below)
    left = np.linalg.norm(normal_vectors(shell.surface[shell.label == LEFT_OUT]), axis=1).sum() / 2
    total = np.linalg.norm(normal_vectors(ball), axis=1).sum() / 2
    mesh = _fit(*fill_between(given, (0.5, 0.75, 1.0)), shell, {})
    flat = enclosed_volume(given) * (1 - 0.5**3)
    exact = 4 * np.pi / 3 * np.prod(change) * 8e-3**3 * (1 - 0.5**3)
    for _ in range(2):
        assert compute_volume(mesh) == pytest.approx(exact, rel=4e-3)
        assert compute_volume(mesh) > flat + 0.9 * (exact - flat)
        assert measure_area(mesh, "top") + measure_area(mesh, "left_out") == pytest.approx(total, rel=4e-3)
        assert measure_area(mesh, "left_out") == pytest.approx(left, rel=0.1)
        assert measure_area(mesh, "base") == pytest.approx(0.25 * total, rel=4e-3)
        radius = 8e-3 * np.linalg.norm(mesh.nodes[np.unique(mesh.top)] / change / 8e-3, axis=1)
        assert np.abs(radius - 8e-3).max() < 25e-6  # flat facets: 106e-6
        assert mesh.geometry_error < 0.1e-3
        assert check_quality(mesh).inverted == 0
        mesh = refine(mesh)


def test_slivers_and_coarse_meshes_are_refused():
    nodes = CORNERS.copy()
    nodes[3] += [0, 0, 1e-9]
    mesh = label_box(nodes)
    assert "elements through the thickness" in check_quality(mesh).faults[-1]
    flat = np.array([[0, 0, 0], [1e-2, 0, 0], [0, 1e-2, 0], [3e-3, 3e-3, 1e-6]])
    flat = label_mesh(flat, np.array([[0, 1, 2, 3]]), np.array([1, 0, 0, 0]), source="flat", settings={})
    with pytest.raises(ValueError, match="1 of 1 elements are slivers"):
        check_quality(flat).require()


def test_a_body_that_the_base_does_not_hold_is_refused():
    nodes = np.concatenate([CORNERS, CORNERS + 20e-3])
    mesh = label_box(nodes, np.concatenate([FIVE, FIVE + len(CORNERS)]))
    assert any("5 of 10 elements are not connected with the base" in each for each in check_quality(mesh).faults)
    assert not any("not connected" in each for each in check_quality(label_box()).faults)


ONE = {
    "nodes": np.eye(10, 3), "cells": np.arange(10)[None], "base": np.array([[0, 1, 2, 4, 5, 6]]),
    "top": np.array([[0, 1, 3, 4, 8, 7]]), "left_out": np.array([[2, 0, 3, 6, 7, 9]]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nodes": np.eye(10, 2)}, "finite and have the shape"),
        ({"nodes": np.where(np.eye(10, 3) > 0, np.nan, 0)}, "finite and have the shape"),
        ({"cells": np.array([[0, 1, 2]])}, "hexahedra of 27 nodes or tetrahedra"),
        ({"cells": np.zeros((0, 10), int)}, "hexahedra of 27 nodes or tetrahedra"),
        ({"top": np.array([[0, 1, 3, 2]])}, "facets of the top"),
        ({"base": np.zeros((0, 6), int)}, "no base"),
        ({"cells": np.arange(1, 11)[None]}, "a node that it does not have"),
        ({"left_out": np.array([[2, 0, 10, 6, 7, 9]])}, "a node that it does not have"),
        ({"top": np.array([[0, 1, -1, 4, 8, 7]])}, "a node that it does not have"),
    ],
)
def test_meshes_that_do_not_fit_together_are_refused(change, words):
    assert len(SolidMesh(**ONE, source="one").cells) == 1
    assert len(SolidMesh(**ONE | {"left_out": np.zeros((0, 6), int)}, source="one").left_out) == 0
    with pytest.raises(ValueError, match=words):
        SolidMesh(**ONE | change, source="one")


#: Keeps what the mesher is given, and takes the corners of the box as nodes.
MESHER = f"""
import os, numpy
def tetrahedralize(points, faces, **options):
    numpy.savez(os.environ["KEPT"], points=points, faces=faces, **options)
    return points, numpy.array({FIVE.tolist()})
"""


#: The closed surface of the box, bonded below.
SHELL = Shell(surface=BOX, label=np.where((BOX[..., 2] == 0).all(axis=1), BONDED, TOUCHABLE))


def test_the_mesher_works_in_lengths_of_order_one_and_its_mesh_is_scaled_back(tmp_path, monkeypatch):
    (tmp_path / "pytetwild.py").write_text(MESHER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("KEPT", str(tmp_path / "given.npz"))
    monkeypatch.setattr("meshes.solids.tetrahedra.find_spec", lambda _: "found")
    mesh = fill_with_tetrahedra(SHELL, 1.3e-3)
    diagonal, thickness = np.linalg.norm(SIZE), 2 * 48 / 88 * 1e-3
    with np.load(tmp_path / "given.npz") as given:
        np.testing.assert_allclose(diagonal * given["points"][given["faces"]], BOX, atol=1e-15)
        assert given["faces"].dtype == np.int32
        assert given["edge_length_abs"] == pytest.approx(1.3e-3 / diagonal)
        assert given["epsilon"] == pytest.approx(thickness / 25 / diagonal)
        assert given["num_threads"] == 1
        # Sizes follow the distance between the two parts of the surface, within limits; they cover the box.
        places, sizes = diagonal * given["bg_vertices"], diagonal * given["bg_values"]
        assert (places.min(axis=0) < BOX.min(axis=(0, 1))).all()
        assert (places.max(axis=0) > BOX.max(axis=(0, 1))).all()
        deep = np.abs(places[:, 2] - 1e-3) + np.abs(places[:, :2]).max(axis=1) < 1e-3
        assert deep.any()
        np.testing.assert_allclose(sizes[deep], 1.3e-3 * np.minimum(2e-3 / thickness, 1.5), rtol=0.3)
        assert 0.649e-3 < sizes.min() < 1.0e-3
        corner = places[given["bg_tets"]]
        volume = np.abs(np.linalg.det(corner[:, 1:] - corner[:, :1])).sum() / 6
        assert volume == pytest.approx(np.prod(np.ptp(places, axis=0)))
    np.testing.assert_allclose(mesh.nodes[: len(CORNERS)], CORNERS, atol=1e-15)
    assert compute_volume(mesh) == pytest.approx(np.prod(SIZE))
    assert measure_area(mesh, "base") == pytest.approx(24e-6)


@pytest.mark.slow
def test_the_mesher_runs_in_a_folder_of_its_own(tmp_path, monkeypatch):
    pytest.importorskip("pytetwild")
    monkeypatch.chdir(tmp_path)
    mesh = fill_with_tetrahedra(SHELL, 1.3e-3)
    assert list(tmp_path.iterdir()) == []
    assert check_quality(mesh).faults == ()
    assert compute_volume(mesh) == pytest.approx(np.prod(SIZE), rel=0.01)
    assert measure_area(mesh, "top") == pytest.approx(64e-6, rel=0.01)


@pytest.mark.parametrize(
    ("code", "scale", "message"),
    [
        ("import os; os.abort()", 1, "the mesher failed on box.*exit -6"),
        ("raise OSError('no')", 1, "the mesher failed on box.*no"),
        ("", 1e3, "millimetres taken for metres"),
    ],
)
def test_a_mesher_that_dies_and_millimetres_are_reported(monkeypatch, code, scale, message):
    monkeypatch.setattr("meshes.solids.tetrahedra._PROGRAM", code)
    with pytest.raises(ValueError, match=message):
        fill_with_tetrahedra(replace(SHELL, surface=scale * BOX), 1e-3 * scale, name="box")
