"""The style of all figures, labels of iso-lines, and texels in colours, against what a reader sees."""

import dataclasses
import io
import logging

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from meshes import TexelArray
from validation.render.figure import COLOURS, draw_texels, label_lines, open_figure, save_figure
from validation.render.image import Scale
from validation.report.figures import render_svg


def test_a_figure_is_legible_in_print_and_has_two_open_sides():
    """Sizes in points: text of 8, smaller at ticks and in legends, larger above the whole figure."""
    with open_figure(io.StringIO(), height=2.0, format="svg") as figure:
        axes = figure.add_subplot()
        axes.plot([0, 1], [0, 1], "o-", label="a $b$")
        axes.plot([0, 1], [0, 1])
        axes.set(xlabel="x", ylabel="y", title="t")
        legend, title = axes.legend(), figure.suptitle("all")
        sizes = [each.get_size() for each in (axes.xaxis.label, axes.yaxis.label, axes.title, axes.text(0, 0, "x"))]
        ticks = [axes.get_xticklabels()[0].get_size(), axes.get_yticklabels()[0].get_size()]
        assert sizes == [8.0] * 4
        assert {*ticks, legend.get_texts()[0].get_size()} == {7.0}
        assert title.get_size() == 9.0
        assert [name for name, side in axes.spines.items() if side.get_visible()] == ["left", "bottom"]
        assert not legend.get_frame_on()
        assert not legend.get_texts()[0].get_parse_math()
        first, second = axes.lines
        assert 1.0 < first.get_linewidth() < 1.5
        assert 3.0 <= first.get_markersize() < 5
        assert [first.get_color(), second.get_color()] == [COLOURS["fem"], COLOURS["fast"]]
        tick = axes.xaxis.get_major_ticks()[0].tick1line, axes.yaxis.get_major_ticks()[0].tick1line
        thin = [axes.spines["left"].get_linewidth(), *(each.get_markeredgewidth() for each in tick)]
        assert max(thin) < first.get_linewidth()
        assert "Constrained" in type(figure.get_layout_engine()).__name__


def test_a_plot_on_a_page_is_six_by_three_inches_unless_told():
    svg = render_svg(lambda axes: axes.plot([0, 1]))
    assert 'width="432pt" height="216pt"' in svg
    assert "<text" in svg  # letters stay letters


def test_a_figure_that_fails_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "x.svg"
    path.write_text("before")
    with pytest.raises(KeyError), open_figure(path, height=1.0):
        raise KeyError
    assert path.read_text() == "before"


def test_without_matplotlib_a_picture_is_left_out_with_a_warning(tmp_path, caplog):
    def fail(_path):
        raise ImportError

    drawn = []
    with caplog.at_level(logging.WARNING):
        assert save_figure(tmp_path / "x.png", drawn.append) == ("x.png",)
        assert not caplog.records
        assert save_figure(tmp_path / "x.png", fail) == ()
    assert drawn == [tmp_path / "x.png"]
    assert "no picture" in caplog.text


def test_a_label_stands_at_the_middle_of_the_longest_part_of_its_line_away_from_the_edges():
    """Level lines of y over 0..10, cut out at 3..4: the longest part that is inside reaches from 4 to 9.4."""
    axes = Figure().add_subplot()
    x, y = np.meshgrid(np.linspace(0, 10, 101), np.linspace(0, 4, 41))
    height = np.ma.masked_where((x > 3) & (x < 4), y)
    lines = axes.contour(x, y, height, levels=[0.2, 0.26, 2.0, 3.73, 3.8])
    label_lines(axes, lines, fmt="%g", colors="#123456")
    labels = {float(each.get_text()): each for each in lines.labelTexts}
    assert sorted(labels) == [0.26, 2.0, 3.73]  # 6 % of the height are 0.24
    for level, label in labels.items():
        assert label.get_position() == pytest.approx(((4 + 9.4) / 2, level), abs=0.15)
        assert to_hex(label.get_color()) == "#123456"


@pytest.mark.parametrize("difference", [False, True])
def test_texels_have_the_colours_of_the_scale(difference):
    scale = Scale(peak=2.0, difference=difference)
    axes = Figure().add_subplot()
    drawn = draw_texels(axes, TexelArray.grid(2, 3, 1e-3), np.arange(6.0), scale)
    steps = np.linspace(0, 1, len(scale.colours))
    for step, colour in zip(steps, scale.colours, strict=True):
        shown = np.array(drawn.cmap(step)[:3]) * 255
        np.testing.assert_allclose(shown, [int(colour[k : k + 2], 16) for k in (1, 3, 5)], atol=4)
    assert drawn.get_clim() == (-2000 if difference else 0, 2000)


@pytest.mark.parametrize(("pull", "shown"), [(-0.0099, 0.0), (-0.01, 0.0), (-0.0101, -10.1)])
def test_a_pull_below_a_hundredth_of_the_largest_force_is_not_shown(pull, shown):
    axes = Figure().add_subplot()
    drawn = draw_texels(axes, TexelArray.grid(1, 2, 1e-3), np.array([pull, 1.0]), Scale(peak=1.0))
    np.testing.assert_allclose(drawn.get_array().ravel(), [shown, 1000.0], atol=1e-9)


def test_texels_off_a_grid_are_rectangles_of_their_size_in_millimetres():
    grid = TexelArray.grid(1, 3, (2e-3, 3e-3), texel_size=(1.5e-3, 2.5e-3))
    array = dataclasses.replace(grid, centres=np.array([[0, 0, 0], [3e-3, 1e-3, 0], [-1e-3, 4e-3, 0]]))
    axes = Figure().add_subplot()
    drawn = draw_texels(axes, array, np.array([0.5, 0.2, 0.1]), Scale(peak=0.5), title="squares")
    for path in drawn.get_paths():
        np.testing.assert_allclose(np.ptp(path.vertices, axis=0), (1.5, 2.5), atol=1e-9)
    middles = np.array([(path.vertices.min(axis=0) + path.vertices.max(axis=0)) / 2 for path in drawn.get_paths()])
    np.testing.assert_allclose(middles - middles[0], [(0, 0), (3, 1), (-1, 4)], atol=1e-9)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("unrolled x [mm]", "unrolled y [mm]")
    assert to_hex(drawn.get_edgecolors()[0]) == "#ffffff"
    assert 0 < drawn.get_linewidths()[0] < 1
    assert (axes.get_title(), axes.get_aspect()) == ("squares", 1.0)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    corners = np.concatenate([path.vertices for path in drawn.get_paths()])
    assert left <= corners[:, 0].min() < corners[:, 0].max() <= right < corners[:, 0].max() + 2
    assert low <= corners[:, 1].min() < corners[:, 1].max() <= high < corners[:, 1].max() + 2
    assert drawn in axes.collections


def test_texels_on_a_grid_are_counted_from_the_lower_left():
    axes = Figure().add_subplot()
    drawn = draw_texels(axes, TexelArray.grid(3, 2, (2e-3, 5e-3)), np.arange(6.0), Scale(peak=5.0, factor=1.0))
    np.testing.assert_array_equal(drawn.get_array(), [[0, 1], [2, 3], [4, 5]])
    assert axes.get_ylim() == (-0.5, 2.5)
    assert axes.get_xlim() == (-0.5, 1.5)


@pytest.mark.parametrize("difference", [False, True])
def test_an_array_of_values_has_the_colour_of_each(difference):
    scale = Scale(peak=4.0, difference=difference)
    values = np.array([[-4.0, -1.0, 0.0], [0.7, 2.5, 4.0]])
    found = scale.rgb(values)
    assert (found.shape, found.dtype) == ((2, 3, 3), np.uint8)
    for place, value in np.ndenumerate(values):
        assert "#" + bytes(found[place].tolist()).hex() == scale.colour(float(value))
    steps = np.linspace(-1 if difference else 0, 1, len(scale.colours))
    for channel in range(3):
        ends = [int(colour[1 + 2 * channel : 3 + 2 * channel], 16) for colour in scale.colours]
        np.testing.assert_allclose(found[..., channel], np.interp(values / 4, steps, ends), atol=0.51)
