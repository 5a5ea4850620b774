"""Colours, scales, ruled edges and cameras of the views of a cover, against what a reader reads from them."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshes import Box, Cone, Cylinder, LetterH, Nut, Pose, Roller, RoundedTip, Sphere, TexelArray
from meshes.solids.texels import cylinder_texels, tangent_axes
from tests.support.drawn_views import CORNERS, describe
from validation.scene import draw, rendering
from validation.scene.cover_scene import CoverScene

pyvista = pytest.importorskip("pyvista")
matplotlib = pytest.importorskip("matplotlib")


def make_brick(low, high, **options):
    """A scene of one hexahedron between two corners [mm], with a small displacement so that it counts as loaded."""
    position = 1e-3 * (np.array(low) + CORNERS * (np.array(high) - low))
    given = {"displacement": np.full_like(position, 1e-12), "cells": np.arange(8)[None], "thickness": 1e-3}
    return CoverScene(position=position, **given | options)


def find_colours(name, count=256):
    """Colours of a map of matplotlib, 0..255."""
    return np.floor(matplotlib.colormaps[name](np.linspace(0, 1, count))[:, :3] * 255 + 0.5)


@pytest.fixture(scope="module")
def drawn(views, scene):
    return views(scene)


def test_every_view_is_white_with_dark_words_arrows_and_numbered_edges(drawn):
    surface, section, texels, size = drawn
    assert size == [2400, 820]
    for view in (surface, section, texels):
        assert view.ground == "#ffffff"
        assert view.arrows[:2] == (0, 0)  # in the lower left corner
        assert max(view.arrows[2:]) < 0.2
        (title,) = view.titles
        assert title.below  # the words hang from the upper left corner
        assert title.position[0] < 0.05
        assert title.position[1] > 0.95
        assert title.colour == "#000000"
        edges = view.edges
        assert edges.titles[:2] == ("x [mm]", "y [mm]")
        assert (edges.outwards, edges.outer, edges.form) == (True, True, "%.4g")
        assert 10 <= edges.font < title.size
        assert not edges.minor
        assert max(edges.colour) < 0.3
    assert [bool(view.edges.shown) for view in (surface, section, texels)] == [True, True, False]
    assert [bool(view.edges.numbered) for view in (surface, section, texels)] == [True, True, False]
    assert [view.edges.titles[2] for view in (surface, section, texels)] == ["z [mm]", "z [mm]", " "]


def test_the_bars_of_colours_lie_below_the_views_with_titles_above_their_labels(drawn):
    for view, title in zip(drawn, ("pressure [kPa]", "displacement [mm]", "force on the texel [mN]"), strict=False):
        (bar,) = view.scales
        assert bar.title == title
        assert bar.level
        assert bar.place[0] > view.arrows[2]  # beside the arrows
        assert bar.place[0] + bar.size[0] < 1
        assert 0 < bar.place[1] < bar.place[1] + bar.size[1] < 0.2
        assert bar.form == "%.4g"
        assert bar.colours == ((0, 0, 0), (0, 0, 0))
        assert bar.fonts[0] > bar.fonts[1] >= 14
        assert bar.apart >= bar.fonts[0]


def test_values_have_the_colours_of_their_map_and_half_of_the_light_everywhere(drawn):
    maps = ("YlGnBu", "YlOrRd", "viridis")
    for view, name in zip(drawn, maps, strict=False):
        body = view.meshes[0]
        np.testing.assert_allclose(body.colours, find_colours(name), atol=1)
        assert body.coloured
        assert (body.ambient, body.diffuse) == (0.5, 0.5)
    surface, section, texels, _ = drawn
    assert surface.meshes[1].colour == section.meshes[1].colour
    assert 0 < surface.meshes[1].opacity < 0.5  # the contact is seen through the indenter
    assert section.meshes[1].opacity == 1
    assert section.meshes[1].ambient == 0.5
    assert [each.colour for each in section.meshes[2:]] == ["#303030"] * 2
    assert [each.lines for each in section.meshes[2:]] == [2, 2]
    bars = texels.meshes[0]
    assert (bool(bars.edged), bars.edge_colour, bars.lines) == (True, "#808080", 1)
    assert texels.scales[0].marks == 5  # 0, 50, .. 200 mN


def check_camera(view, towards, bounds):
    """The camera looks along a direction [-] at all corners of a box [mm], which fills the middle of the view."""
    camera = view.camera
    assert camera.parallel
    assert tuple(camera.up) == (0, 0, 1)
    line = camera.position - camera.middle
    distance = np.linalg.norm(line)
    np.testing.assert_allclose(line / distance, np.array(towards) / np.linalg.norm(towards), atol=1e-9)
    corners = np.array([[bounds[k] for k in (i, 2 + j, 4 + n)] for i in (0, 1) for j in (0, 1) for n in (0, 1)])
    assert 1 < distance / np.linalg.norm(corners[-1] - corners[0]) < 5
    turn = Rotation.align_vectors([[0, 0, 1], [0, 1, 0]], [line / distance, [0, 0, 1]], weights=[np.inf, 1])[0]
    across, up = turn.apply(corners - camera.middle)[:, :2].T / camera.half
    # the view is 2 high and 2 * 800 / 820 wide; the box fills 70 % of its height or 75 % of its width
    tall, wide = np.ptp(up) / 2, np.ptp(across) / (2 * 800 / 820)
    assert max(tall / 0.7, wide / 0.75) == pytest.approx(1, abs=1e-6)
    assert (up.max() + up.min()) / 2 == pytest.approx(0.1, abs=1e-6)  # raised above the bar of colours
    assert across.max() + across.min() == pytest.approx(0, abs=1e-6)


def test_a_flat_cover_is_seen_from_the_front_and_above(drawn):
    surface, section, texels, _ = drawn
    check_camera(surface, (0.35, -0.75, 0.55), (-2, 6, -3, 5, 0, 2))
    check_camera(section, (0.35, -0.75, 0.55), section.ruled)
    check_camera(texels, (0.35, -0.75, 0.55), texels.ruled)


VALUES = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
#: Corners of a block [mm], ends and marks of its edges along x, y and z; forces on four texels [mN], and ends and marks
#: of their scale.  A block may reach out by a tenth of an interval; a short edge along z has marks at its ends only.
EDGES = (
    ((-7.3, 0.04, 0.0), (8.9, 3.1, 0.8), (-10, 10, 0, 3.5, 0, 0.8), (5, 8, 2), (-1.5, 78.5, 0, 9), (0, 80, 9)),
    ((0.0, 0.0, 0.0), (1.6, 1.0, 1.05), (0, 1.6, 0, 1.0, 0, 1.2), (9, 6, 7), (-1.58, 78.4, 1, 2), (-10, 80, 10)),
    ((0.0, 0.0, 0.0), (8.0, 8.0, 2.0), (0, 8, 0, 8, 0, 2), (9, 9, 5), (-30, 70, 0, 10), (-40, 80, 7)),
    ((0.0, 0.0, 0.0), (10.0, 8.0, 2.0), (0, 10, 0, 8, 0, 2), (6, 9, 2), (0, 13.3, 0, 0), (0, 14, 8)),
    ((-0.305, -41, 5), (0.305, 41, 60), (-0.3, 0.3, -40, 40, 0, 60), (7, 5, 7), (1, 2, 8, 3), (0, 8, 9)),
)


@pytest.mark.parametrize("case", EDGES)
def test_edges_and_forces_end_at_round_numbers_with_at_most_eight_intervals(views, case):
    """The scale of forces begins at zero unless a texel is pulled by two percent of the largest force."""
    low, high, ends, marks, forces, scale = case
    texels, forces = TexelArray.grid(2, 2, 2e-3), 1e-3 * np.array(forces)
    surface, section, bars, _ = views(make_brick(low, high, texels=texels, texel_forces=forces))
    np.testing.assert_allclose(surface.ruled, ends, atol=1e-9)
    assert surface.edges.marks == marks
    assert np.ptp(section.meshes[0].points[:, 1]) == pytest.approx((high[1] - low[1]) / 2, rel=1e-4)
    check_camera(surface, (0.35, -0.75, 0.55), ends)
    assert bars.meshes[0].limits == pytest.approx(scale[:2], abs=1e-9)
    assert bars.scales[0].marks == scale[2]
    assert bars.texts == [f"\n4 texels, {forces.sum():.4f} N on them"]


@pytest.mark.parametrize(
    ("options", "surface", "inside"),  # least and largest value of each scale, and its marks
    [
        ({"surface": 1.23 * VALUES, "inside": 30 * VALUES}, (0, 10, 6), (0, 250, 6)),
        ({"surface": 0 * VALUES, "inside": 3 * VALUES / 7, "logarithmic": True}, (0, 1, 6), (5e-4, 5, 5)),
        ({"surface": -VALUES, "inside": 0.9 * VALUES / 7, "logarithmic": True}, (0, 1e-9, 6), (1e-4, 1, 5)),
    ],
)
def test_scales_of_colours_begin_at_zero_and_end_at_round_numbers(views, options, surface, inside):
    labels = {"surface_label": "pressure [kPa]", "inside_label": "von Mises stress [kPa]"}
    found = views(make_brick((0, 0, 0), (4, 4, 4), **labels | options))
    for view, (low, high, marks) in zip(found, (surface, inside), strict=False):
        assert view.meshes[0].limits == pytest.approx((low, high), rel=1e-6, abs=1e-15)
        assert view.scales[0].marks == marks
    assert [bool(view.meshes[0].logarithmic) for view in found[:2]] == [False, options.get("logarithmic", False)]


def test_the_largest_thousandth_of_stresses_has_the_last_colour_and_no_displacement_is_cut(views, scene):
    values = np.full(len(scene.position), 1.5)
    values[0] = 900.0
    options = {"surface": values, "surface_label": "pressure [kPa]", "inside": values, "indenter": None, "texels": None}
    surface, section, _ = views(dataclasses.replace(scene, inside_label="displacement [mm]", **options))
    # of 867 values the quantile lies 0.134 of the way from the last but one to the last: at 121.8
    assert surface.meshes[0].limits == (0, 120)
    assert section.meshes[0].limits == (0, 1000)


def test_a_cover_without_load_shows_its_parts_by_name_and_its_bare_texels(views):
    parts = np.array([3.0, 3, 3, 3, 2, 2, 2, 1])
    texels = TexelArray.grid(2, 2, 2e-3, active=np.array([True, True, True, False]))
    brick = make_brick(
        (0, 0, 0), (4, 4, 4), displacement=np.zeros((8, 3)), surface=parts, surface_label="parts", inside=parts,
        inside_label="parts ", texels=texels, title="pad",
    )  # fmt: skip
    surface, section, texels, _ = views(brick)
    for view in (surface, section):
        edges, body = view.meshes
        assert (edges.colour, edges.lines) == ("#51606e", 1)
        assert body.limits == (0.5, 3.5)
        np.testing.assert_array_equal(body.colours, [[0xF4, 0xA2, 0x61], [0x8E, 0xCA, 0xE6], [0x6D, 0x59, 0x7A]])
        assert body.words == {1.0: "left out", 2.0: "touchable", 3.0: "bonded"}
        (bar,) = view.scales
        assert not bar.numbered  # names instead of numbers
        assert 0 < bar.place[1] < bar.place[1] + bar.size[1] < 0.2
    np.testing.assert_allclose(surface.meshes[0].bounds, (0, 4, 0, 4, 0, 4), atol=1e-6)
    np.testing.assert_allclose(section.meshes[0].bounds[[0, 1, 4, 5]], (0, 4, 0, 4), atol=1e-6)
    assert surface.texts == ["pad\ncover"]
    assert texels.texts == ["\ntexels on the base"]
    (bars,) = texels.meshes
    assert (bars.colour, bool(bars.edged), bars.coloured) == ("#3a7ca5", True, False)
    assert bars.points.shape == (24, 3)


def test_a_cover_without_values_is_plain_with_the_edges_of_its_elements(views):
    surface, section, _ = views(make_brick((0, 0, 0), (4, 4, 4)))
    for view in (surface, section):
        body, edges = view.meshes
        assert (body.colour, body.flat, body.coloured) == ("#b9c4cf", True, False)
        assert (edges.colour, edges.lines) == ("#51606e", 1)
        assert view.scales == []


ROUND = cylinder_texels(6e-3, rows=2, columns=5, pitch=(2e-3, 3e-3), size=(1.8e-3, 2.5e-3), name="round")
FORCE = np.array([0.02, 0.1, 0.4, -0.05, 0.0, 0.03, 0.2, 0.05, 0.01, -0.3])


def test_a_bar_stands_on_each_active_texel_along_its_normal():
    """Of the largest force it is as high as 0.3 of the array; of no force and of a pull it is flat."""
    active = np.arange(10) != 7
    scene = make_brick((0, 0, 0), (1, 1, 1), texels=dataclasses.replace(ROUND, active=active), texel_forces=FORCE)
    bars = draw.make_bars(scene, 1e3)
    points = np.asarray(bars.points).reshape(9, 8, 3)
    axes, highest = tangent_axes(ROUND.normals), 0.3 * np.ptp(ROUND.centres, axis=0).max()
    for place, texel in zip(points, np.flatnonzero(active), strict=True):
        local = (1e-3 * place - ROUND.centres[texel]) @ np.column_stack([*axes[texel], ROUND.normals[texel]])
        half = 0.47 * np.array([1.8e-3, 2.5e-3])
        height = max(highest * FORCE[texel] / 0.4, 0.003 * highest)
        np.testing.assert_allclose(local, (CORNERS - [0.5, 0.5, 0]) * [*2 * half, height], atol=2e-9)
        quads = place[np.asarray(bars.regular_faces).reshape(9, 6, 4)[0]]
        ways = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]) / 2
        volume = (quads.mean(axis=1) * ways).sum() / 3  # by the theorem of Gauss: all faces look outwards
        assert volume == pytest.approx(1e9 * 4 * half.prod() * height, rel=1e-4)
    faces = np.asarray(bars.regular_faces).reshape(9, 24)
    np.testing.assert_array_equal(faces // 8, np.repeat(np.arange(9)[:, None], 24, axis=1))
    np.testing.assert_allclose(bars.cell_data["force"], np.repeat(1e3 * FORCE[active], 6))
    bare = draw.make_bars(dataclasses.replace(scene, texel_forces=None), 1.0)
    assert not bare.cell_data["force"].any()
    assert bare.points.shape == (72, 3)


@pytest.fixture
def finger():
    """A cover with texels on several sides, pressed askew."""
    return make_brick(
        (-6, -4, 0), (6, 4, 8), texels=ROUND, texel_forces=np.abs(FORCE), title="finger",
        touched=np.array([0, 0, 8e-3]),
        indenter=Sphere(radius=3e-3), pose=Pose(point=(0, 0, 8e-3), direction=(-0.6, 0.0, -0.8)), surface=VALUES,
        surface_label="contact pressure [kPa]",
    )  # fmt: skip


def test_a_cover_with_texels_on_several_sides_is_seen_from_where_the_load_comes(views, finger):
    surface, section, texels, _ = views(finger)
    view = np.array([0.75, 0.6, 0.5]) / np.linalg.norm([0.75, 0.6, 0.5]) + 1.2 * np.array([0.6, 0, 0.8])
    for each in (surface, texels):
        check_camera(each, view, each.ruled)
    _, base = texels.meshes
    np.testing.assert_allclose(base.bounds, 0.999 * np.array([-6, 6, -4, 4, 0, 8]), atol=1e-5)
    assert 0.05 < base.opacity < 0.2  # texels on the far side are seen through the cover
    assert texels.edges.titles[2] == "z [mm]"
    assert texels.edges.shown
    # the section contains the direction of the load; its half lies behind it as seen by the camera
    normal = np.array([0.0, 1.0, 0.0])
    body = section.meshes[0]
    np.testing.assert_allclose(body.bounds, (-6, 6, -4, 0, 0, 8), atol=1e-5)
    line = section.camera.position - section.camera.middle
    assert line @ normal / np.linalg.norm(line) == pytest.approx(0.7)
    unit = view / np.linalg.norm(view)
    assert np.linalg.det([normal, unit, line]) == pytest.approx(0, abs=1e-9)  # turned towards the camera of the surface
    assert line @ unit > 0
    check_camera(section, line, section.ruled)
    assert section.texts == ["\nsection through (0, 0, 8) mm"]
    assert section.meshes[1].bounds[3] == pytest.approx(0, abs=1e-6)
    alone = dataclasses.replace(finger, touched=None, indenter=None)
    check_camera(views(alone)[0], (0.75, 0.6, 0.5), (-6, 6, -4, 4, 0, 8))


def test_a_section_across_an_oblique_load_contains_the_direction_of_the_load(views, scene):
    """A load that leans along y: the cut is a plane through the contact and this direction."""
    pose = dataclasses.replace(scene.pose, direction=(0.0, 0.6, -0.8))
    section = views(dataclasses.replace(scene, pose=pose, displacement=1e-9 * scene.displacement))[1]
    points = section.meshes[0].points - [2, 1, 2]
    # the largest part of the view that is not along the load is along y or x
    view, up = np.array([0.35, -0.75, 0.55]), np.array([0, -0.6, 0.8])
    view /= np.linalg.norm(view)
    level = view - (view @ up) * up
    axis = int(np.argmax(np.abs(level)))
    normal = np.sign(level[axis]) * np.eye(3)[axis]
    normal -= (normal @ up) * up
    along = points @ (normal / np.linalg.norm(normal))
    assert along.max() == pytest.approx(0, abs=1e-5)
    assert along.min() < -1
    assert section.camera.position @ normal - section.camera.middle @ normal > 0


BODIES = (
    Sphere(radius=2e-3), Cylinder(radius=2e-3), Box(size=(3e-3, 5e-3, 6e-3)), Roller(radius=0.7e-3, length=4e-3),
    RoundedTip(radius=1.2e-3), Cone(angle=2.0, radius=3e-3), LetterH(size=(12e-3, 16e-3), bar=4e-3),
    Nut(across=13e-3, bore=8e-3),
)  # fmt: skip


@pytest.mark.parametrize("indenter", BODIES, ids=lambda body: type(body).__name__)
def test_a_turned_body_has_its_lower_side_where_its_gap_says(indenter):
    """Turned, tilted and askew: in the body's frame no point is below the gap, and all are within its footprint."""
    pose = Pose(point=(3e-3, -2e-3, 4e-3), direction=(0.3, 0.1, -1), yaw=0.5, tilt=(0.1, -0.2))
    surface = SimpleNamespace(bounds=(0.0, 80.0, 0.0, 10.0, 0.0, 60.0))
    body = draw.make_indenter(make_brick((0, 0, 0), (1, 1, 1), thickness=5e-3, indenter=indenter, pose=pose), surface)
    lifted = 1e-3 * np.asarray(body.points) + 0.01 * 5e-3 * pose.towards
    x, y, z = pose.points_to_indenter(lifted).T
    wide, high = indenter.footprint
    assert np.abs(x).max() <= 1.001 * wide
    assert np.abs(y).max() <= 1.001 * high
    if not isinstance(indenter, LetterH | Nut | Sphere | RoundedTip | Roller):
        assert (np.abs(x).max(), np.abs(y).max()) == pytest.approx((wide, high), rel=0.01)
    inside = 0.999 * np.column_stack([x, y])
    gap = indenter.gap(*inside.T)
    known = np.isfinite(gap)
    assert (z[known] > gap[known] - 0.02e-3).all()
    assert np.min((z - gap)[known]) == pytest.approx(0, abs=0.02e-3)
    assert z.max() > 1e-3
    # nothing reaches beyond 0.35 of the middle edge of the drawn cover, 60 mm, against the motion
    assert ((1e-3 * np.asarray(body.points) - pose.position) @ -pose.towards).max() < 0.35 * 60e-3 + 1e-9


def test_a_tall_body_is_cut_off_across_its_motion():
    pose = Pose(point=(3e-3, -2e-3, 4e-3), direction=(0.3, 0.1, -1))
    surface = SimpleNamespace(bounds=(0.0, 8.0, 0.0, 1.0, 0.0, 6.0))
    scene = make_brick((0, 0, 0), (1, 1, 1), indenter=Box(size=(3e-3, 5e-3, 60e-3)), pose=pose)
    points = 1e-3 * np.asarray(draw.make_indenter(scene, surface).points)
    assert ((points - pose.position) @ -pose.towards).max() == pytest.approx(0.35 * 6e-3, rel=1e-5)


@pytest.fixture
def exported(monkeypatch, tmp_path):
    monkeypatch.setattr(rendering, "find_window_without_display", lambda: "")
    found = []

    def export(plotter, path, *, inline_data):
        assert path == str(tmp_path / "cover.gltf")
        assert inline_data
        found.append(describe(plotter.renderer))

    monkeypatch.setattr(pyvista.Plotter, "export_gltf", export)

    def show(scene):
        draw.write_gltf(scene, tmp_path / "cover.gltf")
        return found[-1].meshes

    return show


def test_a_file_of_gltf_has_the_colours_and_scales_of_the_picture(exported, finger):
    body, bars = exported(finger)
    np.testing.assert_allclose(body.bounds, 1e-3 * np.array([-6, 6, -4, 4, 0, 8]), atol=1e-8)
    assert (body.name, body.limits) == ("surface", pytest.approx((0, 7)))
    assert (bars.name, bars.limits) == ("force", pytest.approx((0, 400)))
    for mesh, name in ((body, "YlGnBu"), (bars, "viridis")):
        np.testing.assert_allclose(mesh.colours, find_colours(name), atol=1)
    (plain,) = exported(dataclasses.replace(finger, surface=None, texel_forces=None))
    assert (plain.colour, plain.coloured) == ("#b9c4cf", False)


@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
def test_a_grid_holds_the_undeformed_cover_and_all_values(kind):
    cells = np.arange(8)[None] if kind == "hexahedra" else np.array([[0, 1, 3, 4], [6, 5, 7, 2]])
    moved = np.random.default_rng(1).uniform(-1e-3, 1e-3, (8, 3))
    scene = make_brick((1, 2, 3), (2, 4, 6), cells=cells, displacement=moved, surface=VALUES, inside=2 * VALUES,
                       layer=np.arange(len(cells)))  # fmt: skip
    grid = draw.make_grid(scene, 1e3)
    assert grid.volume == pytest.approx(6 if kind == "hexahedra" else 2)
    np.testing.assert_allclose(grid.points, 1e3 * scene.position)
    np.testing.assert_allclose(grid.point_data["displacement"], 1e3 * moved)
    np.testing.assert_allclose(grid.point_data["surface"], VALUES)
    np.testing.assert_allclose(grid.point_data["inside"], 2 * VALUES)
    np.testing.assert_array_equal(grid.cell_data["layer"], np.arange(len(cells)))
    bare = draw.make_grid(dataclasses.replace(scene, surface=None, inside=None, layer=None))
    assert list(bare.array_names) == ["displacement"]
    np.testing.assert_allclose(bare.points, scene.position)
