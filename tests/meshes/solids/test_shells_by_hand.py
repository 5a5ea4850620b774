"""Shells of covers, element sizes in them, and covers of tetrahedra, by closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh

from meshes import Layer
from meshes.catalogue import MATERIALS
from meshes.solids import covers, flat_pad, tetrahedra
from meshes.solids.covers import make_shell_cover, make_swept_cover, take_meshes
from meshes.solids.shell import BONDED, LEFT_OUT, TOUCHABLE, Shell, join, leave_out, thicken
from meshes.solids.solid_mesh import compute_volume, measure_area, measure_thickness
from meshes.solids.tetrahedra import choose_sizes, count_elements, fill_with_tetrahedra, refine
from meshes.surfaces.smooth import smooth_surface
from meshes.surfaces.triangles import check_closed, enclosed_volume, merge_corners, normal_vectors
from tests.fem_reference.curved_cover.test_responses import split_box
from tests.meshes.solids.test_tetrahedra import fill_between
from tests.meshes.surfaces.test_by_hand import make_grid

FLAT = make_grid(np.linspace(-5e-3, 5e-3, 6), np.linspace(-4e-3, 4e-3, 5))


@pytest.mark.parametrize(("inward", "base"), [(True, -1.5e-3), (False, 0.0)])
def test_a_flat_sheet_becomes_a_plate(inward, base):
    shell = thicken(FLAT, 1.5e-3, "sheet", inward=inward)
    check_closed(shell.surface, "plate")
    assert enclosed_volume(shell.surface) == pytest.approx(80e-6 * 1.5e-3)
    np.testing.assert_allclose(shell.base[..., 2], base, atol=1e-12)
    assert (normal_vectors(shell.base)[:, 2] > 0).all()
    # 40 triangles above and below, two on each of 18 edges around
    assert np.bincount(shell.label).tolist() == [40 + 36, 40]
    assert (shell.nominal, shell.thickness, shell.is_folded, shell.geometry_error) == (1.5e-3, 1.5e-3, False, 0.0)
    part = leave_out(shell, np.arange(len(shell.surface)) < 60)
    assert np.bincount(part.label).tolist() == [36, 40, 40]
    box = Shell(surface=shell.surface, label=shell.label)
    assert box.thickness == pytest.approx(120e-9 / (80e-6 + 18e-3 * 1.5e-3))  # the volume over half of the area


@pytest.mark.parametrize(("rise", "noted"), [(0.024, True), (-0.024, True), (0.026, False), (-0.026, None)])
def test_a_pyramid_tells_its_outside_from_a_fortieth_of_its_width(rise, noted):
    """The mean of normal times place is 0.4 h / sqrt(h^2 + a^2 / 4) of the width a; the limits are 0.02."""
    corner = 10e-3 * np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0], [0, 0, rise]])
    pyramid = corner[[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]]
    if noted is None:
        with pytest.raises(ValueError, match="pyramid is inside out"):
            thicken(pyramid, 1e-3, "pyramid", inward=True)
        return
    notes = thicken(pyramid, 1e-3, "pyramid", inward=True).notes
    assert any("hardly bends" in note and "faces (0, 0, 1)" in note for note in notes) == noted


@pytest.mark.parametrize(("thickness", "kept"), [(9e-3, True), (11e-3, False)])
def test_edges_of_a_fifth_of_the_thickness_are_collapsed(thickness, kept):
    """Edges of 2 mm."""
    shell = thicken(np.concatenate([FLAT, FLAT + np.array([0, 8e-3, 0])]), thickness, "sheet", inward=False)
    assert ((shell.label == BONDED).sum() == 80) == kept
    assert enclosed_volume(shell.surface) == pytest.approx(160e-6 * thickness)


@pytest.mark.parametrize(("thickness", "refused"), [(5.4e-3, True), (5.1e-3, False)])
def test_a_closed_surface_that_is_no_thicker_than_its_cover_is_the_cover(thickness, refused):
    """A cube of 20 mm: its volume over half its area is 6.67 mm, 1.25 times 5.33 mm."""
    cube = np.array(trimesh.creation.box((20e-3, 20e-3, 20e-3)).triangles)
    if refused:
        with pytest.raises(ValueError, match=r"cube encloses a body that is only 6.7 mm thick on average"):
            thicken(cube, thickness, "cube", inward=True)
    else:
        assert thicken(cube, thickness, "cube", inward=True).nominal == thickness


def test_a_groove_that_is_too_narrow_makes_the_cover_thinner_there():
    """Half a tube of 1.6 mm between two flat sides, covered by 2 mm."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 9)
    across = np.concatenate([[-6e-3, -3.8e-3], 1.6e-3 * np.sin(turn), [3.8e-3, 6e-3]])
    height = np.concatenate([[0, 0], -1.6e-3 * np.cos(turn), [0, 0]])
    steps = np.arange(len(across))
    grid = make_grid(steps.astype(float), np.linspace(0, 6e-3, 4))
    index = grid[..., 0].round().astype(int)
    groove = np.stack([across[index], grid[..., 1], height[index]], axis=-1)
    shell = thicken(groove, 2e-3, "groove", inward=False)
    (note,) = (each for each in shell.notes if "bends more sharply than 2 mm" in each)
    least = float(note.split("at least ")[1].split(" mm")[0])
    assert 1.0 <= least < 1.96
    assert enclosed_volume(shell.surface) > 0
    if not shell.is_folded:
        check_closed(shell.surface, "groove")


def test_sides_between_two_squares_make_a_frustum():
    """h / 3 (A + B + sqrt(A B)) of 10 mm and 8 mm squares, 2 mm apart."""
    axis = np.linspace(-5e-3, 5e-3, 5)
    outer, base = make_grid(axis, axis) + np.array([0, 0, 2e-3]), make_grid(0.8 * axis, 0.8 * axis)
    shell = join(outer, base)
    check_closed(shell.surface, "frustum")
    assert enclosed_volume(shell.surface) == pytest.approx(2e-3 / 3 * (100 + 64 + 80) * 1e-6)
    assert np.bincount(shell.label).tolist() == [32 + 32, 32]
    np.testing.assert_allclose(shell.base[..., 2], 0, atol=1e-15)


def make_slab(size=(10e-3, 10e-3, 2e-3), nominal=2e-3):
    box = np.array(trimesh.creation.box(size).triangles) + np.array([0, 0, size[2] / 2])
    return Shell(surface=box, label=np.where((box[..., 2] < 1e-9).all(axis=1), BONDED, TOUCHABLE), nominal=nominal)


def test_elements_are_as_large_as_the_thickness_around_them(monkeypatch):
    """On a grid of 1.4 mm around a slab of 2 mm: the mean of the distances from base and top over 1 mm, 0.5 to 1.5."""
    points, cells, sizes = choose_sizes(make_slab(), 2e-3)
    assert len(points) == 10 * 10 * 4
    np.testing.assert_allclose(points.min(axis=0), [-5.7e-3, -5.7e-3, -0.7e-3])
    np.testing.assert_allclose(points.max(axis=0), [6.9e-3, 6.9e-3, 3.5e-3])
    middle = (np.abs(points[:, :2] - [-0.1e-3, -0.1e-3]) < 1e-9).all(axis=1)
    np.testing.assert_allclose(points[middle, 2], [-0.7e-3, 0.7e-3, 2.1e-3, 3.5e-3])
    np.testing.assert_allclose(sizes[middle], 2e-3 * np.array([1.5, 1.0, 1.1, 1.5]))
    side = (np.abs(points - [-4.3e-3, -0.1e-3, 0.7e-3]) < 1e-9).all(axis=1)
    np.testing.assert_allclose(sizes[side], 2e-3 * 0.7)
    thick = choose_sizes(make_slab(nominal=8e-3), 2e-3)[2]
    np.testing.assert_allclose(thick[side], 1e-3)
    assert len(cells) == 9 * 9 * 3 * 6
    # the six tetrahedra of each cube fill it once
    place = np.random.default_rng(2).uniform(0, 1, (40, 3)) @ np.diag(np.ptp(points, axis=0)) + points.min(axis=0)
    corner = points[cells]
    shares = np.linalg.solve(
        (corner[:, 1:] - corner[:, :1]).transpose(0, 2, 1)[:, None], (place[None] - corner[:, :1])[..., None]
    )[..., 0]
    inside = (shares >= 0).all(axis=-1) & (shares.sum(axis=-1) <= 1)
    assert inside.sum(axis=0).tolist() == [1] * 40
    monkeypatch.setattr(tetrahedra, "_NUMBERS", dataclasses.replace(tetrahedra._NUMBERS, sizes=(0.7, 50)))
    few = choose_sizes(make_slab(), 2e-3)[0]  # about 50 points in 200 mm3
    assert np.diff(np.unique(few[:, 2].round(9)))[0] == pytest.approx(np.cbrt(200 / 50) * 1e-3, rel=1e-4)


@pytest.mark.parametrize("size", [2e-3, 0.9e-3])
def test_elements_are_counted_by_the_volume_of_half_a_regular_tetrahedron(size):
    """Full size below the top, half of it at the sides, which hold t^2 (a + b) of the weight, and the top t a b."""
    slab = make_slab()
    top, sides = 2e-3 * 100e-6, 2e-3**2 * 20e-3
    mean = (top + 8 * sides) / (top + sides)
    assert count_elements(slab, size) == pytest.approx(200e-9 * mean / size**3 * 12 * np.sqrt(2))


def test_tetrahedra_are_moved_onto_a_ball_and_so_are_their_refinements(monkeypatch):
    """A shell between balls of 4 and 8 mm, given by 80 triangles each."""
    given = np.array(trimesh.creation.icosphere(subdivisions=1, radius=8e-3).triangles)
    ball = smooth_surface(given, 0.15e-3)[0]
    shell = join(ball, 0.5 * ball)
    shell = leave_out(shell, shell.surface[..., 2].max(axis=1) < -4e-3)
    monkeypatch.setattr(tetrahedra, "find_spec", lambda _: "found")
    monkeypatch.setattr(tetrahedra, "_run_mesher", lambda *_: fill_between(given, (0.5, 0.75, 1.0)))
    mesh = fill_with_tetrahedra(shell, 3e-3)
    assert len(mesh.cells) == 80 * 2 * 3
    assert mesh.settings["element_size"] == 3e-3
    assert mesh.settings["envelope"] == pytest.approx(shell.thickness / 25)
    volume = 4 / 3 * np.pi * 7 / 8 * 8e-3**3
    for count, level in ((480, 0), (3840, 1)):
        assert (len(mesh.cells), mesh.settings["refined"]) == (count, level)
        assert compute_volume(mesh) == pytest.approx(volume, rel=0.01)
        assert measure_area(mesh, "base") == pytest.approx(np.pi * 8e-3**2, rel=0.01)
        assert measure_area(mesh, "top") + measure_area(mesh, "left_out") == pytest.approx(4 * np.pi * 64e-6, rel=0.01)
        np.testing.assert_allclose(np.linalg.norm(mesh.nodes[np.unique(mesh.top)], axis=1), 8e-3, rtol=6e-3)
        mesh = refine(mesh)
    assert 1e-6 < mesh.geometry_error < 0.15e-3


def test_a_bent_mesh_keeps_its_shape_when_it_is_refined():
    """A block lifted by 100 x^2, on which all middles lie."""
    block = split_box((4, 2, 2), (4e-3, 2e-3, 2e-3))
    bent = type(block)(
        **block.arrays | {"nodes": block.nodes + [0, 0, 100] * block.nodes[:, :1] ** 2}, source="bent", settings={}
    )
    finer = refine(bent)
    assert (finer.settings["refined"], refine(finer).settings["refined"]) == (1, 2)
    assert compute_volume(finer) == pytest.approx(compute_volume(bent), rel=1e-12)
    for name, height in (("base", 0.0), ("top", 2e-3)):
        nodes = finer.nodes[np.unique(getattr(finer, name))]
        np.testing.assert_allclose(nodes[:, 2], height + 100 * nodes[:, 0] ** 2, atol=1e-15)
        assert len(getattr(finer, name)) == 4 * len(getattr(bent, name))
        assert measure_area(finer, name) == pytest.approx(measure_area(bent, name), rel=1e-3)
    assert len(finer.left_out) == 4 * len(bent.left_out)
    assert len(finer.nodes) == 17 * 9 * 9


def fill_by(monkeypatch, shell, counts, **options):
    """A cover of a slab whose mesher makes boxes of some numbers of elements; returns it and the sizes asked for."""
    asked, left = [], list(counts)

    def fill(given, size, *, name):
        asked.append((size, name))
        return split_box(left.pop(0), (10e-3, 10e-3, 2e-3))

    monkeypatch.setattr(covers, "fill_with_tetrahedra", fill)
    cover = make_shell_cover(shell, MATERIALS["pet"], "slab", lambda _, compute: compute(), **options)
    return cover, asked


def test_a_shell_is_filled_with_elements_by_its_thickness_or_by_a_size(monkeypatch):
    """Of 0.7 of the thickness, or larger so that 4500 are expected; of twice the given size, which is for the finer."""
    cover, asked = fill_by(monkeypatch, make_slab(), [(5, 5, 1)])
    coarse, fine = cover.meshes()
    expected = max(1.0, np.cbrt(count_elements(make_slab(), 1.4e-3) / 4500))
    assert asked == [(pytest.approx(1.4e-3 * expected), "slab")]
    assert coarse.source == "tetrahedra in slab"
    assert len(fine.cells) == 8 * len(coarse.cells) == 8 * 25 * 6
    assert cover.layers == (Layer(thickness=2e-3, material=MATERIALS["pet"]),)
    assert len(cover.base_triangles) == 2
    wide = make_slab((60e-3, 60e-3, 2e-3))
    cover, asked = fill_by(monkeypatch, wide, [(5, 5, 1)])
    cover.meshes()
    assert asked[0][0] == pytest.approx(1.4e-3 * np.cbrt(count_elements(wide, 1.4e-3) / 4500))
    assert asked[0][0] > 1.5e-3
    cover, asked = fill_by(monkeypatch, make_slab(), [(5, 5, 1)], element_size=0.8e-3)
    cover.meshes()
    assert asked == [(1.6e-3, "slab")]


def test_a_mesh_with_few_elements_through_the_thickness_is_made_smaller_four_times(monkeypatch):
    """Boxes of 10 mm x 10 mm x 2 mm in one part have 0.34 elements through the thickness."""
    cover, asked = fill_by(monkeypatch, make_slab(), [(1, 1, 1), (2, 2, 1), (5, 5, 1)], element_size=1e-3)
    assert len(cover.meshes()[0].cells) == 25 * 6
    assert [size for size, _ in asked] == pytest.approx([2e-3, 0.85 * 2e-3, 0.85**2 * 2e-3])
    cover, asked = fill_by(monkeypatch, make_slab(), [(1, 1, 1)] * 9, element_size=1e-3)
    assert len(cover.meshes()[0].cells) == 6
    assert len(asked) == 4


def test_sizes_with_more_than_twelve_thousand_elements_are_refused(monkeypatch):
    slab = make_slab()
    size = 1e-3 * np.cbrt(count_elements(slab, 2e-3) / 12_000)  # of the finer mesh
    cover, asked = fill_by(monkeypatch, slab, [(5, 5, 1)], element_size=1.001 * size)
    cover.meshes()
    assert len(asked) == 1
    cover, _ = fill_by(monkeypatch, slab, [], element_size=0.999 * size)
    with pytest.raises(ValueError, match=r"element_size: .* would make 96\d\d\d tetrahedra, more than 96000"):
        cover.meshes()


def test_a_swept_cover_has_three_meshes_and_a_finer_one():
    pad = flat_pad(size=(4e-3, 3e-3), thickness=1.5e-3, rows=2)
    cover = make_swept_cover(pad, MATERIALS["pet"], "pad", assumed=True)
    assert [len(mesh.cells) for mesh in cover.meshes()] == [6 * 5 * 3, 8 * 6 * 3, 9 * 7 * 4]
    assert len(cover.refine((1.5e-3,)).cells) == 13 * 10 * 5  # 0.33 mm
    assert (cover.thicknesses, cover.source, cover.assumed) == ((1.5e-3,), "pad", True)
    given = take_meshes([pad.mesh(2e-3, layers=2), pad.mesh(1e-3, layers=2)], MATERIALS["pet"], notes=("so",))
    assert given.layers[0].thickness == pytest.approx(measure_thickness(pad.mesh(2e-3))) == pytest.approx(1.5e-3)
    assert [len(mesh.cells) for mesh in given.meshes()] == [2 * 2 * 2, 4 * 3 * 2]
    assert (given.notes, given.refine, given.source) == (("so",), None, "given meshes")


def test_what_is_left_out_stays_bonded_where_it_is_bonded():
    slab = make_slab()
    assert (leave_out(slab, np.ones(12, dtype=bool)).label == np.where(slab.label == BONDED, BONDED, LEFT_OUT)).all()
    assert len(merge_corners(slab.surface)[0]) == 8
