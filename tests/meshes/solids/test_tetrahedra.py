from __future__ import annotations

import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshes.solids.solid_mesh import SolidMesh, check_quality, compute_volume, measure_area
from meshes.solids.tetrahedra import classify_boundary, fill_with_tetrahedra
from meshes.surfaces.triangles import check_closed, find_crossings, nearest_points

SIZE = (6e-3, 4e-3, 2e-3)
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)]) * SIZE
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
FACES = np.array([[q[0], *q[k : k + 2]] for q in QUADS for k in (1, 2)])
BOX = CORNERS[FACES]
BASE = BOX[(BOX[..., 2] == 0).all(axis=1)]
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


def test_base_top_and_sides_are_found_and_orientation_and_base_are_corrected():
    nodes = CORNERS + np.where(CORNERS[:, [2]] == 0, [0, 0, 1e-5], 0)
    cells = FIVE.copy()
    cells[::2] = cells[::2][:, [1, 0, 2, 3]]
    mesh = classify_boundary(nodes, cells, BASE, tolerance=2e-5)
    assert compute_volume(mesh) == pytest.approx(np.prod(SIZE))
    assert check_quality(mesh).inverted == 0
    np.testing.assert_allclose(mesh.nodes[mesh.base][..., 2], 0, atol=1e-18)
    assert measure_area(mesh, "base") == pytest.approx(24e-6)
    assert measure_area(mesh, "top") == pytest.approx(24e-6)
    assert measure_area(mesh, "sides") == pytest.approx(40e-6)
    reversed_base = classify_boundary(nodes, cells, BASE[:, ::-1], tolerance=2e-5)
    np.testing.assert_array_equal(np.sort(reversed_base.top, axis=1), np.sort(mesh.top, axis=1))
    with pytest.raises(ValueError, match="no part of the surface lies on the base"):
        classify_boundary(nodes, cells, BASE - [0, 0, 1e-3], tolerance=2e-5)


def test_slivers_and_coarse_meshes_are_refused():
    nodes = CORNERS.copy()
    nodes[3] += [0, 0, 1e-9]
    mesh = classify_boundary(nodes, FIVE, BASE, tolerance=1e-6)
    assert "elements through the thickness" in check_quality(mesh).faults[-1]
    flat = SolidMesh(
        nodes=np.array([[0, 0, 0], [1e-2, 0, 0], [0, 1e-2, 0], [3e-3, 3e-3, 1e-6]]),
        cells=np.array([[0, 1, 2, 3]]),
        base=np.array([[0, 1, 2]]),
        top=np.array([[0, 1, 3], [1, 2, 3]]),
        sides=np.array([[2, 0, 3]]),
        source="flat",
    )
    with pytest.raises(ValueError, match="1 of 1 elements are slivers"):
        check_quality(flat).require()


def test_a_body_that_the_base_does_not_hold_is_refused():
    nodes = np.concatenate([CORNERS, CORNERS + 20e-3])
    mesh = classify_boundary(nodes, np.concatenate([FIVE, FIVE + len(CORNERS)]), BASE, tolerance=1e-6)
    assert any("5 of 10 elements are not connected with the base" in each for each in check_quality(mesh).faults)
    held = classify_boundary(CORNERS, FIVE, BASE, tolerance=1e-6)
    assert not any("not connected" in each for each in check_quality(held).faults)


ONE = {
    "nodes": np.eye(4, 3), "cells": np.array([[0, 1, 2, 3]]), "base": np.array([[0, 1, 2]]),
    "top": np.array([[0, 1, 3], [1, 2, 3]]), "sides": np.array([[2, 0, 3]]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nodes": np.eye(4, 2)}, "finite and have the shape"),
        ({"nodes": np.where(np.eye(4, 3) > 0, np.nan, 0)}, "finite and have the shape"),
        ({"cells": np.array([[0, 1, 2]])}, "hexahedra of 27 nodes or tetrahedra"),
        ({"cells": np.zeros((0, 4), int)}, "hexahedra of 27 nodes or tetrahedra"),
        ({"top": np.array([[0, 1, 3, 2]])}, "facets of the top"),
        ({"base": np.zeros((0, 3), int)}, "no base"),
        ({"cells": np.array([[0, 1, 2, 4]])}, "a node that it does not have"),
        ({"sides": np.array([[2, 0, 4]])}, "a node that it does not have"),
        ({"top": np.array([[0, 1, -1]])}, "a node that it does not have"),
    ],
)
def test_meshes_that_do_not_fit_together_are_refused(change, words):
    assert len(SolidMesh(**ONE, source="one").cells) == 1
    assert len(SolidMesh(**ONE | {"sides": np.zeros((0, 3), int)}, source="one").sides) == 0
    with pytest.raises(ValueError, match=words):
        SolidMesh(**ONE | change, source="one")


#: Keeps what the mesher is given, and takes the corners of the box as nodes.
MESHER = f"""
import os, numpy
def tetrahedralize(points, faces, **options):
    numpy.savez(os.environ["KEPT"], points=points, faces=faces, **options)
    return points, numpy.array({FIVE.tolist()})
"""


def test_the_mesher_works_in_lengths_of_order_one_and_its_mesh_is_scaled_back(tmp_path, monkeypatch):
    (tmp_path / "pytetwild.py").write_text(MESHER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("KEPT", str(tmp_path / "given.npz"))
    monkeypatch.setattr("meshes.solids.tetrahedra.find_spec", lambda _: "found")
    mesh = fill_with_tetrahedra(BOX, BASE, 1.3e-3)
    diagonal = np.linalg.norm(SIZE)
    with np.load(tmp_path / "given.npz") as given:
        np.testing.assert_allclose(diagonal * given["points"][given["faces"]], BOX, atol=1e-15)
        assert given["faces"].dtype == np.int32
        assert given["edge_length_abs"] == pytest.approx(1.3e-3 / diagonal)
        assert given["epsilon"] == pytest.approx(2e-3 / 50 / diagonal)  # a fiftieth of the thickness
        assert given["num_threads"] == 1
    np.testing.assert_allclose(mesh.nodes, CORNERS, atol=1e-15)
    assert compute_volume(mesh) == pytest.approx(np.prod(SIZE))
    assert measure_area(mesh, "base") == pytest.approx(24e-6)


@pytest.mark.slow
def test_the_mesher_runs_in_a_folder_of_its_own(tmp_path, monkeypatch):
    pytest.importorskip("pytetwild")
    monkeypatch.chdir(tmp_path)
    mesh = fill_with_tetrahedra(BOX, BASE, 1.3e-3)
    assert list(tmp_path.iterdir()) == []
    assert check_quality(mesh).faults == ()
    assert compute_volume(mesh) == pytest.approx(np.prod(SIZE), rel=0.01)


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
        fill_with_tetrahedra(scale * BOX, scale * BASE, 1e-3 * scale, name="box")
