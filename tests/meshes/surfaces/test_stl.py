"""Reading STL files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh

from fem_reference import result_store
from meshes import Box, Cylinder, LetterH, Nut, Prism, Sphere, TriangleMesh, read_stl
from meshes.surfaces import files

SAME = {
    "box": Box(size=(10e-3, 6e-3, 5e-3)),
    "nut": Nut(across=13e-3, bore=8e-3),
    "h": LetterH(size=(12e-3, 16e-3), bar=4e-3),
}


def draw_points(shape, count, seed=1, reach=1.2):
    return (np.random.default_rng(seed).uniform(-reach, reach, (count, 2)) * shape.footprint).T


def make_key(shape):
    return result_store.make_key("test", result_store.describe({"indenter": shape}))


@pytest.mark.parametrize("name", SAME)
def test_a_body_on_a_flat_face_becomes_the_prism_on_that_face(write_stl, name):
    read = read_stl(write_stl(name))
    assert isinstance(read, Prism)
    np.testing.assert_allclose(read.footprint, SAME[name].footprint, rtol=1e-6)
    x, y = draw_points(SAME[name], 4000)
    np.testing.assert_allclose(read.signed_distance(x, y), SAME[name].signed_distance(x, y), atol=1e-8)
    assert len(read.primitives()) == {"box": 1, "nut": 6, "h": 3}[name]


def test_bodies_of_facets_lie_within_their_sagitta_of_cylinder_and_sphere(write_stl):
    read = read_stl(write_stl("cylinder"))
    x, y = draw_points(read, 4000)
    sagitta = 4e-3 * (1 - np.cos(np.pi / 96))
    assert np.abs(read.signed_distance(x, y) - Cylinder(radius=4e-3).signed_distance(x, y)).max() <= 1.01 * sagitta
    assert len(read.primitives()) == 1
    read = read_stl(write_stl("sphere"))
    assert isinstance(read, TriangleMesh)
    x, y = draw_points(read, 20000, reach=0.6)
    above = read.gap(x, y) - Sphere(radius=5e-3).gap(x, y)
    edge = np.linalg.norm(np.diff(read.triangles, axis=1), axis=-1).max()
    sagitta = edge**2 / 3 / (2 * 5e-3)
    assert above.min() > -2e-9
    assert above.max() < 1.8 * sagitta  # seen along the vertical, up to 58 degrees off the normal
    assert len(read.primitives()) == 1


def test_bodies_from_equal_files_are_equal_and_have_the_same_store_key(write_stl, tmp_path, body):
    binary, text = read_stl(write_stl("sphere")), read_stl(write_stl("sphere", "stl_ascii"))
    np.testing.assert_allclose(binary.triangles, text.triangles, atol=2e-9)
    moved = tmp_path / "elsewhere.stl"
    moved.write_bytes(write_stl("sphere").read_bytes())
    again = read_stl(moved)
    assert again == binary
    assert hash(again) == hash(binary)
    assert make_key(again) == make_key(binary)
    other = TriangleMesh(triangles=binary.triangles * 1.001)
    assert other != binary
    assert make_key(other) != make_key(binary)


def test_the_unit_scales_and_the_axis_shifts_the_body(write_stl):
    path = write_stl("sphere")
    np.testing.assert_allclose(read_stl(path, unit=25.4e-3).triangles, 25.4 * read_stl(path).triangles, atol=1e-12)
    shifted = read_stl(path, axis=(32e-3, -15e-3))
    x, y = draw_points(shifted, 500)
    np.testing.assert_allclose(shifted.gap(x, y), read_stl(path).gap(x + 1e-3, y + 2e-3), atol=1e-9)
    with pytest.raises(ValueError, match=r"sphere.stl: the axis, at .* must stand within"):
        read_stl(path, axis=(0.0, 0.0))
    with pytest.raises(ValueError, match=r"unit of sphere.stl must be a positive length"):
        read_stl(path, unit=0.0)
    for unit in (1.0, 1e-6):
        with pytest.raises(ValueError, match=r"sphere.stl would be .* mm long, no size for an indenter .* unit=mm"):
            read_stl(path, unit=unit)


def test_a_face_becomes_a_prism_only_where_the_rest_is_out_of_reach(tmp_path):
    for height, kind in ((4.0, TriangleMesh), (6.0, Prism)):
        foot = trimesh.creation.box((4, 4, height), transform=trimesh.transformations.translation_matrix([0, 0, -1]))
        plate = trimesh.creation.box(
            (20, 20, 2), transform=trimesh.transformations.translation_matrix([0, 0, height / 2])
        )
        trimesh.boolean.union([foot, plate], engine="manifold").export(tmp_path / "foot.stl")
        read = read_stl(tmp_path / "foot.stl")
        assert isinstance(read, kind)
        assert read.footprint == pytest.approx((2e-3, 2e-3) if kind is Prism else (10e-3, 10e-3), rel=1e-6)


def test_an_open_surface_and_a_sheet_are_refused(tmp_path, body):
    mesh = body("sphere")
    mesh.update_faces(np.arange(len(mesh.faces)) != 7)
    mesh.export(tmp_path / "open.stl")
    with pytest.raises(ValueError, match=r"open.stl is not closed: it has 3 open edges; close the surface"):
        read_stl(tmp_path / "open.stl")
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 1]], process=False).export(tmp_path / "sheet.stl")
    with pytest.raises(ValueError, match=r"sheet.stl holds no volume"):
        read_stl(tmp_path / "sheet.stl")


DAMAGED = {
    "empty": lambda _: b"",
    "short": lambda content: content[:1000],
    "none": lambda content: content[:80] + b"\0\0\0\0",
    "text": lambda _: b"solid nothing\nendsolid nothing\n",
    "noise": lambda _: np.random.default_rng(0).bytes(3000),
    "nan": lambda content: content[:84] + np.float32(np.nan).tobytes() * 6 + content[84 + 24 :],
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_files_are_refused_in_one_line(tmp_path, write_stl, kind):
    path = tmp_path / f"{kind}.stl"
    path.write_bytes(DAMAGED[kind](write_stl("sphere").read_bytes()))
    with pytest.raises(ValueError, match=f"{kind}.stl (is not a whole STL file|is damaged|is not closed)") as caught:
        read_stl(path)
    assert "\n" not in str(caught.value)


def test_missing_files_folders_and_huge_files_are_refused(tmp_path, write_stl, monkeypatch):
    with pytest.raises(ValueError, match=r"gone.stl: No such file or directory; give the path of an STL file"):
        read_stl(tmp_path / "gone.stl")
    with pytest.raises(ValueError, match=r"is a folder; name a file"):
        read_stl(tmp_path)
    path = write_stl("sphere")
    monkeypatch.setattr(files, "LIMITS", dataclasses.replace(files.LIMITS, triangles=1000))
    with pytest.raises(ValueError, match=r"1280 triangles, more than the 1000"):
        read_stl(path)
    monkeypatch.setattr(files, "LIMITS", dataclasses.replace(files.LIMITS, stl_bytes=900))
    with pytest.raises(ValueError, match=r"has more than the 900 bytes accepted; .* exported more coarsely"):
        read_stl(path)
