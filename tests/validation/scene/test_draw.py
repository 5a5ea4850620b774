"""What the three views of a cover show, without drawing them: what stands where, in which colours, and its captions."""

import dataclasses

import numpy as np
import pytest

from meshes import Box, Cylinder, Pose, Prism, Roller, RoundedTip, Sphere
from tests.support.drawn_views import AT, describe
from validation.scene import draw, rendering
from validation.scene.cover_scene import _advance

pyvista = pytest.importorskip("pyvista")


def is_round_end(end, highest):
    """Return whether a scale of colours ends at a number of two digits near the largest value."""
    return float(f"{end:.2g}") == pytest.approx(end) and 0.95 * highest < end < 1.35 * highest


def test_the_surface_is_cut_off_around_the_contact_and_has_the_indenter_over_it_to_scale(views, scene):
    surface = views(scene)[0]
    body, ball = surface.meshes
    np.testing.assert_allclose(body.bounds, (-2, 6, -3, 5, 0, 2 - 0.05), atol=1e-5)
    assert surface.texts == ["block\ncover; to scale"]
    assert (body.name, surface.bars) == ("surface", ["pressure [kPa]"])
    assert body.limits[0] == 0
    assert is_round_end(body.limits[1], np.quantile(scene.surface[1:], 0.999))
    np.testing.assert_allclose(surface.ruled, (-2, 6, -3, 5, 0, 2), atol=1e-9)
    assert surface.marks == (9, 9)
    # a ball of 3 mm stands on the pressed point, lifted by a hundredth of the thickness, cut at 0.35 of the edge
    low, cut = 2 - 0.05 + 0.02, 2 - 0.05 + 0.35 * 8
    wide = np.sqrt(9 - (cut - low - 3) ** 2)
    np.testing.assert_allclose(ball.bounds[4:], (low, cut), atol=1e-3)
    np.testing.assert_allclose(ball.bounds[:4], (AT[0] - wide, AT[0] + wide, AT[1] - wide, AT[1] + wide), atol=0.02)
    assert 0 < ball.opacity < 1


@pytest.mark.parametrize(
    ("indenter", "half", "high"),
    [
        (Cylinder(radius=2e-3), (2.0, 2.0), None), (Box(size=(3e-3, 5e-3, 1e-3)), (1.5, 2.5), 1.0),
        (Roller(radius=0.7e-3, length=4e-3), (0.7, 2.0), 1.4), (RoundedTip(radius=1.2e-3), (1.2, 1.2), None),
        (Prism(points=((-1e-3, -1e-3), (2e-3, -1e-3), (2e-3, 3e-3), (-1e-3, 3e-3))), None, None),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_every_kind_of_body_stands_over_the_point_to_scale(views, scene, indenter, half, high):
    """Half widths along x and y, and the height [mm]; bodies that reach beyond the cut of 2.8 mm end there."""
    *_, body = views(dataclasses.replace(scene, indenter=indenter))[0].meshes
    (left, right, near, far, low, top), base = body.bounds, 2 - 0.05 + 0.02
    around = np.array([2, 2, 1, 1]) + ((-1, 2, -1, 3) if half is None else np.outer(half, (-1, 1)).ravel())
    np.testing.assert_allclose((left, right, near, far), around, atol=0.02)
    assert low == pytest.approx(base, abs=1e-3)
    assert top == pytest.approx(1.95 + 2.8 if high is None else base + high, abs=1e-3)


def test_an_indenter_stands_where_its_surface_passes_through_what_it_touches():
    """A tilted roller and a ball that moves askew, at points of their surfaces and any distance along the motion."""
    for indenter, pose in (
        (Sphere(radius=4e-3), Pose(point=(1e-3, 0, 9e-3), direction=(0.5, 0, -1))),
        (Roller(radius=2e-3, length=8e-3), Pose(point=(0, 2e-3, 5e-3), yaw=0.3, tilt=(0.0, 0.1))),
    ):
        x, y = np.array([[0, 1e-3, -0.5e-3], [0, 0.5e-3, -1e-3]])
        local = np.column_stack([x, y, indenter.gap(x, y)])
        touched = pose.position + local @ pose.rotation.T + 3e-3 * pose.towards
        np.testing.assert_allclose(_advance(pose, indenter, touched).position, pose.position + 3e-3 * pose.towards)


def test_the_section_shows_the_half_behind_the_contact(views, scene):
    section = views(scene)[1]
    body, ball, *layers = section.meshes
    np.testing.assert_allclose(body.bounds, (-2, 6, 1, 5, 0, 1.95), atol=1e-5)
    assert ball.bounds[2] == pytest.approx(1, abs=1e-3)
    # the border of each layer on the plane of the section
    for part, ends in zip(layers, ((0, 0.975), (0.975, 1.95)), strict=True):
        np.testing.assert_allclose(part.bounds[[0, 1, 4, 5]], (-2, 6, *ends), atol=1e-4)
        assert 0.99 < part.bounds[2] <= part.bounds[3] < 1  # in front of the cut face, which would hide it
    assert section.texts == ["\nsection through (2, 1, 2) mm; from the top:\nstiff, 1 mm\nsoft, 1 mm"]
    assert (body.name, section.bars, body.logarithmic) == ("inside", ["displacement [mm]"], False)
    assert body.limits == pytest.approx((0, 7))  # displacements are finite everywhere: all of them have a colour


def test_stresses_of_unlike_layers_have_a_logarithmic_scale(views, scene):
    uneven = dataclasses.replace(scene, inside_label="von Mises stress [kPa]", logarithmic=True)
    body = views(uneven)[1].meshes[0]
    high = np.quantile(scene.inside[1:], 0.999)
    assert body.logarithmic
    assert body.limits[0] == pytest.approx(1e-4 * body.limits[1])
    assert float(f"{body.limits[1]:.1g}") == pytest.approx(body.limits[1])
    assert high <= body.limits[1] <= 2.5 * high


def test_a_bar_on_each_texel_is_as_high_as_its_force(views, scene):
    texels = views(scene)[2]
    (bars,) = texels.meshes
    points = bars.points.reshape(16, 8, 3)
    heights = points[:, 4:, 2].max(axis=1)
    np.testing.assert_allclose(heights[1:], 0.3 * 12 * scene.texel_forces[1:] / 0.2, rtol=1e-5)
    assert heights[0] == pytest.approx(0.01 * 0.3 * 3.6, rel=1e-5)  # flat, not below the base
    np.testing.assert_allclose(points[:, :4, 2], 0, atol=1e-6)
    np.testing.assert_allclose(points.mean(axis=1)[:, :2], 1e3 * scene.texels.centres[:, :2], atol=1e-5)
    np.testing.assert_allclose(np.ptp(points, axis=1)[:, :2], 0.94 * 4, atol=1e-5)
    assert bars.limits == pytest.approx((0, 200))  # hardly negative forces have the colour of none
    assert texels.texts == ["\n16 texels, 1.5920 N on them"]
    assert views(dataclasses.replace(scene, texel_forces=-scene.texel_forces[::-1]))[2].meshes[0].limits[0] == -200


def test_without_a_load_the_whole_cover_is_drawn_with_its_edges(views, scene):
    alone = dataclasses.replace(
        scene,
        displacement=0 * scene.position,
        surface=None,
        inside=None,
        texels=None,
        touched=None,
        limits=np.inf,
        indenter=None,
        layers=(),
    )
    surface, section, size = views(alone)
    assert size == [1600, 820]
    for view, y in ((surface, -8), (section, 0)):
        body, edges = view.meshes
        for bounds in (body.bounds, edges.bounds):
            np.testing.assert_allclose(bounds, (-8, 8, y, 8, 0, 2), atol=1e-5)
        assert view.bars == []
    assert surface.texts == ["block\ncover"]
    assert section.texts == ["\nsection through (0, 0, 1) mm"]


def test_a_file_of_gltf_is_to_scale_and_in_metres(scene, monkeypatch, tmp_path):
    monkeypatch.setattr(rendering, "find_window_without_display", lambda: "")
    found = []
    monkeypatch.setattr(
        pyvista.Plotter, "export_gltf", lambda plotter, _, inline_data: found.append(describe(plotter.renderer))
    )
    draw.write_gltf(scene, tmp_path / "cover.gltf")
    body, bars = found[0].meshes
    np.testing.assert_allclose(body.bounds, 1e-3 * np.array([-2, 6, -3, 5, 0, 1.95]), atol=1e-8)
    assert bars.bounds[5] == pytest.approx(3.6e-3)
