"""Surfaces and tetrahedra from files of other programs."""

import dataclasses
import io
import tracemalloc

import numpy as np
import pytest
import trimesh

from meshes.solids.tetrahedra import orient_tetrahedra
from meshes.surfaces import files
from meshes.surfaces.files import read_tetrahedra, read_triangles
from meshes.surfaces.triangles import enclosed_volume

CUBE = trimesh.creation.box((10, 20, 30))


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_a_body_is_read_in_its_unit(tmp_path, kind):
    path = tmp_path / f"cube.{kind}"
    path.write_bytes(trimesh.exchange.export.export_mesh(CUBE, None, file_type=kind) if kind != "obj" else b"")
    if kind == "obj":
        path.write_text(trimesh.exchange.obj.export_obj(CUBE))
    assert enclosed_volume(read_triangles(path, 1e-3)) == pytest.approx(6e-6, rel=1e-6)


@pytest.mark.parametrize(
    ("shift", "marker", "lost"),
    [(1, None, 0), (1, 0.0, 1), (-1, None, 0), (-1, np.nan, 1), (-1, np.inf, 1), (-1, 0.0, 4)],
    ids=["whole", "far origin", "origin in the grid", "nan", "inf", "two at the origin"],
)
def test_missing_points_of_a_grid_are_skipped_and_a_single_point_at_the_origin_is_a_point(
    tmp_path, shift, marker, lost
):
    x, y = np.meshgrid(np.arange(5.0) + shift, np.arange(3.0) + shift)
    grid = np.stack([x, y, 0 * x], axis=-1)
    if marker is not None:
        grid[0, 0] = marker
    np.save(tmp_path / "grid.npy", grid)
    assert len(read_triangles(tmp_path / "grid.npy", 1.0)) == 2 * (4 * 2 - lost)


def test_tetrahedra_are_oriented_and_their_boundary_is_taken(tmp_path):
    text = "# tet\n\nv 0 0 0 0\nv 1 0 0 0\nv 0 1 0 0\nv 0 0 1 0\nt 0 2 1 3\n"
    path = tmp_path / "one.tet"
    path.write_text(text)
    nodes, cells = read_tetrahedra(path, 1e-3)
    corner = nodes[orient_tetrahedra(nodes, cells)][0]
    assert np.linalg.det(corner[1:] - corner[0]) == pytest.approx(1e-9)
    assert enclosed_volume(read_triangles(path, 1e-3)) == pytest.approx(1e-9 / 6)


def test_coordinates_up_to_a_thousand_million_are_accepted(tmp_path):
    path = tmp_path / "far.obj"
    for far, valid in (("1000000000", True), ("1000000000.5", False), ("-1000000000.5", False)):
        path.write_text(f"v 0 0 0\nv {far} 0 0\nv 0 1 0\nf 1 2 3\n")
        if valid:
            assert read_triangles(path, 1e-9).max() == pytest.approx(1.0)
        else:
            with pytest.raises(ValueError, match="not a number"):
                read_triangles(path, 1e-9)


def npy(shape):
    """The bytes of an npy file that states a shape and holds nothing."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"solid nothing", "whole STL file"),
        ("a.stl", b"\x00" * 90, "whole STL file"),
        ("a.obj", b"v 0 0 0\nf 1 2 9\n", "whole OBJ file"),
        ("a.ply", b"ply\nformat", "whole PLY file"),
        ("a.npy", b"no numpy", "no file of numpy"),
        ("a.npy", npy((100_000, 100_000, 3)), "unpacks to more than the 1024 MiB"),
        ("a.npy", npy((100, 100, 3)), "size is not that of its shape"),
        ("a.npy", b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535, "no file of numpy that is accepted"),
        ("a.tet", b"v 0 0 0 0\nt 0 1 2 3\n", "is no .tet file"),
        ("a.tet", b"\xff\xfe", "is no .tet file"),
        ("a.tet", b"v 0 0 nan 0\nv 0 0 1\nv 0 1 0\nv 1 0 0\nt 0 1 2 3\n", "is no .tet file"),
        ("a.tet", b"v 0 0 0\nt 0 0 0 0\n", "holds no triangles"),
        ("a.tet", b"v 0 0 1e300\nt 0 0 0 0\n", "is no .tet file"),
        ("a.tet", b"v 0 0 0\n" * 1001, "more than the 1000 nodes or 1000000 tetrahedra"),
        ("a.step", b"", "unknown ending"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_damaged_files_and_claims_of_much_memory_are_refused_in_one_line(tmp_path, monkeypatch, name, content, message):
    monkeypatch.setattr(files, "LIMITS", dataclasses.replace(files.LIMITS, nodes=1000))
    (tmp_path / name).write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=rf"^a\..*{message}") as caught:
            read_triangles(tmp_path / name, 1e-3)
        assert tracemalloc.get_traced_memory()[1] < 200e6
    finally:
        tracemalloc.stop()
    assert "\n" not in str(caught.value)
