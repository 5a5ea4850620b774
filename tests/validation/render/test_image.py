"""Tactile images as SVG at the ends of their sizes, and the outline of a contact, against values by hand."""

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import Pose, TexelArray
from meshes.solids.texels import cylinder_texels
from tests.support.fixed_values import check_fixed
from validation.render.image import Scale, choose_ink, find_outline, shorten, tactile_image, unroll
from validation.render.table import Cell
from validation.report.figures import Pictures
from validation.scene.cover_scene import CoverScene

VOLTS = Scale(peak=2.0, unit="V", factor=1.0)


def read_size(svg):
    """Width and height of the view box, and of the drawing on a page [px]."""
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)" width="(\d+)" height="(\d+)"', svg)
    return tuple(map(float, box.groups()))


@pytest.mark.parametrize(
    ("rows", "columns", "size"),
    [
        (1, 1, (200, 200, 190, 190)),
        # squares of 0.94 pitches: 196 units are 2.94 pitches, and 0.94 of them are 62.67; at most 190 px wide
        (1, 3, (200, 66.7, 190, 63)),
        (3, 1, (66.7, 200, 123, 370)),  # at most 370 px high
    ],
)
def test_a_drawing_is_200_units_long_and_at_most_190_px_wide_and_370_px_high(rows, columns, size):
    svg = tactile_image(TexelArray.grid(rows, columns, 3e-3), np.ones(rows * columns), VOLTS)
    assert read_size(svg) == pytest.approx(size, abs=0.01)


def test_a_single_texel_fills_its_drawing_but_for_the_margin():
    svg = tactile_image(TexelArray.grid(1, 1, 3e-3), np.array([-0.5]), VOLTS)
    assert '<rect x="2" y="2" width="196" height="196"' in svg
    assert 'aria-label="Texel values: 1 texels; largest -0.5 V in row 0, column 0"' in svg
    size = float(re.search(r'font-size="([\d.]+)"', svg)[1])
    # five characters, each 0.56 of the size wide in a sans-serif face, nearly fill the square
    assert 0.9 * 196 < 5 * 0.56 * size < 1.1 * 196


def test_the_largest_texel_is_an_active_one_and_masked_ones_have_no_value():
    array = TexelArray.grid(2, 2, (2e-3, 3e-3), active=[1, 1, 0, 1])
    svg = tactile_image(array, np.array([0.5, -1.25, 9.0, 1.0]), VOLTS, name="a")
    assert 'aria-label="a: 3 texels; largest -1.25 V in row 0, column 1"' in svg
    titles = re.findall(r'fill="(#\w+)"><title>([^<]+)</title></rect>(<text)?', svg)
    assert [(title, bool(text)) for _, title, text in titles] == [
        ("[0, 0] 0.5 V", True), ("[0, 1] -1.25 V", True), ("[1, 0] no texel", False), ("[1, 1] 1 V", True),
    ]  # fmt: skip
    assert titles[2][0] == "#e6e6ea"
    assert re.findall(r">([^<>]+)</text>", svg) == ["0.5", "\u22121.2", "1.0"]


def test_the_value_of_a_bright_texel_is_black():
    svg = tactile_image(TexelArray.grid(1, 2, 2e-3), np.array([0.0, 2.0]), VOLTS)
    assert re.findall(r'<text [^>]*?( fill="\w+")?>', svg) == ["", ' fill="black"']


def test_without_values_each_colour_is_one_path_of_the_same_squares():
    array, values = TexelArray.grid(2, 2, (2e-3, 3e-3), active=[1, 1, 1, 0]), np.array([0.0, 2.0, 2.0, 2.0])
    whole, small = (tactile_image(array, values, VOLTS, values_shown=shown) for shown in (True, False))
    assert read_size(small) == read_size(whole)
    paths = re.findall(r'<path fill="(#\w+)" d="([^"]+)"/>', small)
    assert [colour for colour, _ in paths] == ["#1b1340", "#fdf3a1", "#e6e6ea"]
    squares = [
        (colour, *map(float, square))
        for colour, path in paths
        for square in re.findall(r"M([\d.]+) ([\d.]+)h([\d.]+)v\3h-\3z", path)
    ]
    assert "".join(f"M{x:g} {y:g}h{edge:g}v{edge:g}h-{edge:g}z" for _, x, y, edge in squares) == "".join(
        path for _, path in paths
    )
    rects = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="[\d.]+" fill="(#\w+)"', whole)
    assert squares == [(colour, *map(float, square)) for *square, colour in rects]
    assert "<text" not in small
    assert "<title" not in small


def test_a_bent_array_is_unrolled_along_its_arcs_from_the_middle_texel():
    radius = 6e-3
    array = cylinder_texels(radius, rows=3, columns=5, pitch=(2e-3, 2.5e-3), size=(1.8e-3, 2e-3), name="patch")
    x, y = np.moveaxis(unroll(array).reshape(3, 5, 2), -1, 0)
    normals = array.normals.reshape(3, 5, 3)
    arcs = radius * np.arccos(np.einsum("rkc,rkc->rk", normals[:, 1:], normals[:, :-1]))
    np.testing.assert_allclose(np.diff(x, axis=1), arcs, rtol=1e-6)
    np.testing.assert_allclose(np.diff(y, axis=0), 2.5e-3, rtol=1e-6)
    assert (x[1, 2], y[1, 2]) == (0, 0)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (10.0, "10"), (-10.0, "\u221210"), (9.94, "9.9"), (-9.94, "\u22129.9"), (99999.4, "99999"),
        (-9999.4, "\u22129999"), (99999.6, "1e+05"), (-9999.6, "-1e+04"), (1.0, "1.0"),
    ],
)  # fmt: skip
def test_numbers_from_ten_on_have_no_decimal(value, text):
    assert shorten(value) == text


@pytest.mark.parametrize(("colour", "ink"), [("#727272", "white"), ("#787878", "black"), ("#666666", "white")])
def test_greys_around_equal_contrast_have_either_ink(colour, ink):
    """By WCAG 2 black and white have equal contrast on a ground of luminance sqrt(1.05 * 0.05) - 0.05."""
    level = int(colour[1:3], 16) / 255
    assert (((level + 0.055) / 1.055) ** 2.4 > np.sqrt(1.05 * 0.05) - 0.05) == (ink == "black")
    assert choose_ink(colour) == ink


def press_at(*places):
    """Contact at places [mm] with their forces [N]."""
    points = np.array([[x, y, 7.0] for x, y, *_ in places]) * 1e-3
    return SimpleNamespace(contact_points=points, contact_forces=np.array([force for *_, force in places]))


def test_the_outline_is_the_hull_of_the_points_that_bear_force():
    array, push, rub = TexelArray.grid(2, 2, 2e-3), (0, 0, -0.1), (0, 0.1, 0)
    square = press_at((0, 0, push), (2, 0, push), (2, 1, rub), (0, 1, push), (1, 0.4, push), (9, 9, (0, 0, 0)))
    found = find_outline(array, square)
    assert {tuple(each) for each in np.round(1e3 * found, 9).tolist()} == {(0, 0), (2, 0), (2, 1), (0, 1)}
    x, y = 1e3 * found.T
    assert abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2 == pytest.approx(2)  # corner by corner around 2 mm2
    np.testing.assert_allclose(find_outline(array, press_at((1, 2, push), (3, 5, push))), [[1e-3, 2e-3], [3e-3, 5e-3]])
    line = press_at((0, 0, push), (1, 1, push), (2, 2, push))
    np.testing.assert_allclose(find_outline(array, line), line.contact_points[:, :2])
    assert find_outline(array, press_at((1, 1, (0, 0, 0)))).shape == (0, 2)
    tilted = dataclasses.replace(array, normals=np.array([[0.6, 0, 0.8], *array.normals[1:].tolist()]))
    assert find_outline(tilted, square) is None


@pytest.mark.parametrize("part", [VOLTS, Cell(text="a", value=2.0), Pictures(missing="b")], ids=type)
def test_scales_cells_and_pictures_cannot_be_changed_and_are_equal_by_value(part):
    check_fixed(part)
    assert part == dataclasses.replace(part)


def test_a_scene_of_a_cover_cannot_be_changed_and_is_equal_to_itself_only():
    scene = CoverScene(position=np.eye(4, 3), displacement=np.zeros((4, 3)), cells=np.arange(4)[None], thickness=1e-3)
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.thickness = 2e-3
    assert scene != dataclasses.replace(scene)
    bare = {name: value for name, value in vars(scene).items() if name not in ("position", "displacement", "cells")}
    labels = dict.fromkeys(("surface_label", "inside_label", "title"), "")
    nothing = dict.fromkeys(("surface", "inside", "texels", "texel_forces", "touched", "indenter", "layer"))
    others = {"thickness": 1e-3, "logarithmic": False, "pose": Pose(), "layers": (), "limits": np.inf}
    assert bare == labels | nothing | others
