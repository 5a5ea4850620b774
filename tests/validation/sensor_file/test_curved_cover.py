"""Sensor files whose cover is given by surfaces or by a mesh."""

import json

import numpy as np
import pytest
import trimesh

from meshes.bounded_file import pack_npz, unpack_npz
from meshes.solids import fingertip, write_mesh
from validation.errors import InputError
from validation.sensor_file import load

#: The facets are kept, which is faster; `SMOOTH` is the default.
SMOOTH = 'surface = "outer.stl"\nthickness = "2 mm"\nunit = "mm"\nmaterial = "dragon-skin-30"\n'
COVER = f"{SMOOTH}crease_angle = 0\n"


def write_sensor(folder, cover=COVER, array='positions = "texels.csv"\nunit = "mm"\nproject = true\n', texel="0,0,10"):
    (folder / "texels.csv").write_text(f"x,y,z\n{texel}\n3,0,9.5\n")
    path = folder / "sensor.toml"
    path.write_text(f"[array]\n{array}[cover]\n{cover}")
    return path


def write_ball(folder, name="outer.stl", radius=10.0, change=None):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    if change:
        change(ball)
    ball.export(folder / name)


def refuse(path):
    with pytest.raises(InputError) as caught:
        load(path)
    (line,) = caught.value.faults
    return line


def test_texels_are_projected_onto_the_base(tmp_path):
    write_ball(tmp_path)
    path = write_sensor(tmp_path)
    sensor = load(path)
    np.testing.assert_allclose(np.linalg.norm(sensor.array.centres, axis=1), 8e-3, rtol=0.03)
    np.testing.assert_allclose(sensor.array.normals[0], [0, 0, 1], atol=0.05)
    assert sensor.cover.thickness == pytest.approx(2e-3)
    assert sensor.cover.source == "outer.stl and 2 mm below it"


@pytest.mark.slow
def test_facets_are_smoothed_and_what_remains_is_said(tmp_path):
    write_ball(tmp_path)
    smooth, kept = (load(write_sensor(tmp_path, each)) for each in (SMOOTH, COVER))
    for sensor, least in ((smooth, 0.998), (kept, 0.98)):
        radius = np.linalg.norm(sensor.cover.base_triangles.mean(axis=1), axis=1)
        assert radius.min() > least * 8e-3
    assert "lie up to 0.13 mm off a smooth surface and were smoothed" in smooth.cover.notes[0]
    assert "were kept: the error of the shape is about 0.13 mm" in kept.cover.notes[0]


def test_a_surface_over_a_base(tmp_path):
    write_ball(tmp_path)
    write_ball(tmp_path, "base.stl", radius=8.0)
    sensor = load(write_sensor(tmp_path, COVER.replace('thickness = "2 mm"', 'base = "base.stl"')))
    assert sensor.cover.source == "outer.stl over base.stl"
    with pytest.raises(InputError, match="--thickness: the thickness follows from"):
        load(tmp_path / "sensor.toml", thickness="3mm")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda ball: ball.update_faces(np.arange(len(ball.faces)) > 0), None),  # an open surface is closed by its base
        (lambda ball: ball.invert(), "outer.stl is inside out: its triangles face inwards"),
        (lambda ball: ball.apply_scale(1e-3), "would be 0.02 mm long.*millimetres taken for metres"),
        (lambda ball: ball.apply_scale(1e3), "would be 2e\\+04 mm long.*millimetres taken for metres"),
        (lambda ball: ball.faces.__setitem__(0, ball.faces[0, ::-1]), "face different ways"),
    ],
)
def test_bad_surfaces_end_in_one_line(tmp_path, change, said):
    write_ball(tmp_path, change=change)
    path = write_sensor(tmp_path)
    if said is None:
        load(path)
    else:
        line = refuse(path)
        assert line.startswith(f"{path}: cover")
        assert __import__("re").search(said, line)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["outer.stl", "sensor.toml", "texels.csv"]


@pytest.mark.parametrize(
    ("outer", "base", "said"),
    [
        (None, lambda ball: ball.apply_translation([4, 0, 0]), "the base reaches through the outer surface"),
        (lambda ball: ball.update_faces(np.arange(len(ball.faces)) > 0), None, "the outer surface is open"),
    ],
)
def test_surfaces_that_enclose_no_body_are_refused(tmp_path, outer, base, said):
    write_ball(tmp_path, change=outer)
    write_ball(tmp_path, "base.stl", radius=8.0, change=base)
    assert said in refuse(write_sensor(tmp_path, COVER.replace('thickness = "2 mm"', 'base = "base.stl"')))


@pytest.mark.parametrize(
    ("cover", "said"),
    [
        (COVER.replace('unit = "mm"\n', ""), "cover.unit: is missing"),
        (COVER.replace('thickness = "2 mm"\n', ""), "cover.thickness: give surface and base"),
        (COVER.replace("outer.stl", "outer.step"), "cover.surface: 'outer.step' has an unknown ending"),
        (COVER.replace('unit = "mm"', 'unit = "kg"'), "cover.unit: 'kg' in '1 kg' is not a unit of length"),
        (COVER.replace("surface", "shape"), "cover.shape: unknown key"),
        (COVER.replace('"outer.stl"', '"none.stl"'), "none.stl: No such file"),
        (COVER + 'mesh = "mesh.npz"\n', "cover.mesh: replaces surface and thickness"),
        ('mesh = "mesh.npz"\nmaterial = "dragon-skin-30"\nleft_out = ["z < 1 mm"]\n', "cover.mesh: replaces left_out"),
    ],
)
def test_faults_of_the_table_are_named(tmp_path, cover, said):
    write_ball(tmp_path)
    with pytest.raises(InputError) as caught:
        load(write_sensor(tmp_path, cover))
    assert said in "\n".join(caught.value.faults)


def test_texels_far_from_the_base_are_named(tmp_path):
    write_ball(tmp_path)
    assert "texel 0 by " in refuse(write_sensor(tmp_path, texel="0,0,30"))
    line = refuse(write_sensor(tmp_path, array='positions = "texels.csv"\nproject = true\n'))  # metres, not millimetres
    assert "2 of 2 texels are far from the base" in line


def test_one_texel_needs_its_size_only(tmp_path):
    write_ball(tmp_path)
    path = write_sensor(tmp_path)
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,8\n")
    assert 'array.texel_size: is missing, and one texel has no neighbour; write texel_size = "2 mm"' in refuse(path)
    path.write_text(path.read_text().replace("project", 'texel_size = "2 mm"\nproject'))
    assert load(path).array.pitch == load(path).array.texel_size == (2e-3, 2e-3)


def test_a_mesh_file_is_taken_and_a_changed_one_is_named(tmp_path):
    tip = fingertip()
    write_mesh(tmp_path / "mesh.npz", tip.mesh(3e-3, layers=2))
    path = write_sensor(tmp_path, 'mesh = "mesh.npz"\nmaterial = "dragon-skin-30"\n', texel="0,-5,6")
    sensor = load(path)
    assert sensor.cover.meshes()[0].digest == tip.mesh(3e-3, layers=2).digest
    arrays = unpack_npz((tmp_path / "mesh.npz").read_bytes(), most=2**30)
    arrays = dict(arrays) | {"nodes": arrays["nodes"] * 1.001}
    assert json.loads(str(arrays["about"]))["digest"] == sensor.cover.meshes()[0].digest
    (tmp_path / "mesh.npz").write_bytes(pack_npz(arrays))
    assert "mesh.npz was changed after it was written" in refuse(path)


def test_flat_covers_are_not_projected(tmp_path):
    path = write_sensor(tmp_path, '[[cover.layer]]\nthickness = "2 mm"\nmaterial = "dragon-skin-30"\n')
    assert "array.project: is for curved covers" in refuse(path)


def write_tetrahedra(path, change=None):
    """A cube of 10 mm in 24 tetrahedra around a node in its middle."""
    cube = trimesh.creation.box((10, 10, 10)).subdivide()
    nodes = np.concatenate([cube.vertices, [[0.0, 0.0, 0.0]]])
    cells = np.column_stack([cube.faces, np.full(len(cube.faces), len(cube.vertices))])
    if change:
        change(nodes, cells)
    lines = [f"v {x} {y} {z} 0" for x, y, z in nodes] + [f"t {a} {b} {c} {d}" for a, b, c, d in cells]
    path.write_text("\n".join(lines))


def write_base(folder):
    sheet = trimesh.creation.box((10, 10, 10)).subdivide()
    sheet.update_faces(sheet.triangles_center[:, 2] < -4.9)
    sheet.export(folder / "base.stl")


TET = 'mesh = "cube.tet"\nbase = "base.stl"\nunit = "mm"\nmaterial = "dragon-skin-30"\n'


def turn_some(nodes, cells):
    cells[::5] = cells[::5][:, [0, 2, 1, 3]]


def tangle(nodes, cells):
    nodes[-1] = [0, 0, 9]


def flatten(nodes, cells):
    nodes[-1] = [0, 0, 4.999]


def squash(nodes, cells):
    nodes[:, 2] = -5


def test_slivers_are_refused_with_a_way_out_that_works(tmp_path):
    write_base(tmp_path)
    write_tetrahedra(tmp_path / "cube.tet", flatten)
    said = refuse(write_sensor(tmp_path, TET, texel="0,0,-5"))
    assert "elements are slivers" in said
    assert 'write surface = "cube.tet" instead of mesh' in said
    path = write_sensor(tmp_path, TET.replace("mesh =", "surface ="))
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,-5\n3,0,-5\n")
    assert load(path).cover.notes == ()


def test_turned_tetrahedra_are_repaired(tmp_path):
    write_base(tmp_path)
    write_tetrahedra(tmp_path / "cube.tet", turn_some)
    body = load(write_sensor(tmp_path, TET, texel="0,0,-5")).cover
    assert "tetrahedra of cube.tet were turned" in body.notes[0]
    mesh = body.meshes()[0]
    assert len(mesh.base) * 6 == 48
    corner = mesh.nodes[mesh.cells[:, :4]]
    assert np.linalg.det(corner[:, 1:] - corner[:, :1]).sum() / 6 == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (tangle, "cube.tet has tetrahedra that overlap"),
        (squash, "no tetrahedron of cube.tet has a volume; export a solid"),
    ],
)
def test_tetrahedra_that_fill_no_body_are_refused(tmp_path, change, said):
    write_base(tmp_path)
    write_tetrahedra(tmp_path / "cube.tet", change)
    assert said in refuse(write_sensor(tmp_path, TET, texel="0,0,-5"))


def write_revolved(folder, *radii):
    """A hemisphere on a flat face at z = 0; with two radii, the hollow one of a skin."""
    turn = np.linspace(0, np.pi / 2, 12)
    arcs = [radius * np.column_stack([np.cos(turn), np.sin(turn)]) for radius in radii]
    profile = [[0.0, 0.0], *arcs[0]] if len(arcs) == 1 else [*arcs[0], *arcs[1][::-1], arcs[0][0]]
    trimesh.creation.revolve(np.array(profile), sections=48).export(folder / "outer.stl")


@pytest.mark.slow
def test_a_mounting_face_is_asked_about_and_left_out(tmp_path):
    write_revolved(tmp_path, 8.0)
    closed = load(write_sensor(tmp_path, SMOOTH, texel="0,0,8")).cover
    (note,) = [each for each in closed.notes if "flat face" in each]
    assert 'around (0, 0, 0) mm too; if it is the mounting face, write left_out = ["z < 0.008 mm"]' in note
    given = load(write_sensor(tmp_path, SMOOTH + 'left_out = ["z < 0.008 mm"]\n', texel="0,0,8")).cover
    assert not any("flat face" in each for each in given.notes)
    # The base ends at the mounting face; with the closed surface it goes on above it.
    areas = [np.linalg.norm(np.cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0]), axis=1).sum() / 2 for b in (
        closed.base_triangles, given.base_triangles,
    )]  # fmt: skip
    assert areas[1] == pytest.approx(2 * np.pi * 6e-3**2, rel=0.02)
    assert areas[0] > 1.3 * areas[1]
    line = refuse(write_sensor(tmp_path, COVER + 'left_out = ["z above 3"]\n'))
    assert "cover.left_out[0]: 'z above 3' is no half-space; write for example \"z < 1 mm\"" in line
    assert "is not a unit of length" in refuse(write_sensor(tmp_path, COVER + 'left_out = ["z < 1 kg"]\n'))
    whole = write_sensor(tmp_path, COVER + 'left_out = ["z < 90 mm"]\n')
    assert "left_out: all of outer.stl lies in it" in refuse(whole)


def test_the_surface_of_the_cover_itself_is_recognised(tmp_path):
    write_revolved(tmp_path, 10.0, 8.0)
    said = refuse(write_sensor(tmp_path))
    assert (
        "mm thick on average: this looks like the cover itself; give the surface to which it is bonded as base" in said
    )


def test_all_texels_off_the_base_and_all_turned_ones_are_named_before_a_mesh_is_made(tmp_path):
    write_ball(tmp_path)
    path = write_sensor(tmp_path, array='positions = "texels.csv"\nunit = "mm"\ntexel_size = "2 mm"\n')
    rows = ["0,0,8,0,0,1", "0,0,9,0,0,1", "8,0,0,0,0,1", "0,8,0,0,1,0", "0,-8,0,0,1,0", "-9.5,0,0,-1,0,0"]
    (tmp_path / "texels.csv").write_text("x,y,z,nx,ny,nz\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError) as caught:
        load(path)
    off, turned = caught.value.faults
    assert "array: 2 of 6 texels are off the base: 1, 5, texel 5 by 1.5" in off
    assert "leave them out" in off
    assert "the normals of 2 of 6 texels do not point out of the base there: 2, 4; leave them out" in turned


def test_projected_texels_at_a_sharp_edge_take_the_normal_of_the_face_that_they_lie_on(tmp_path):
    trimesh.creation.box((12, 20, 6)).export(tmp_path / "base.stl")
    cover = COVER.replace('surface = "outer.stl"', 'base = "base.stl"')
    path = write_sensor(tmp_path, cover)
    (tmp_path / "texels.csv").write_text("x,y,z\n5.99,0,3.4\n3,0,3\n")
    sensor = load(path)
    np.testing.assert_allclose(sensor.array.centres[0], [5.99e-3, 0, 3e-3], atol=1e-9)
    assert np.abs(sensor.array.normals[0]).max() > np.cos(np.radians(30))
