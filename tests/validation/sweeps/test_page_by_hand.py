"""The table and the maps of a made-up sweep: what stands where, and which sweeps have maps."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from validation.render.figure import COLOURS
from validation.sweeps.page import draw_maps, tabulate

DASH = "\u2013"


def make_sweep(axes, shape, quantities, *, draw=0, wish=None, words=None):
    """A sweep of designs of `cover.thickness` and `array.pitch`; each quantity has value, least and largest."""
    count = int(np.prod(shape))
    designs = [
        SimpleNamespace(values={"cover.thickness": f"{k} mm", "array.pitch": f"{2 * k} mm"}) for k in range(count)
    ]
    judged = [SimpleNamespace(state=state, reason=reason) for state, reason in wish or ()]
    return SimpleNamespace(
        tables=SimpleNamespace(designs={"cover.thickness": 1, "array.pitch": 2}, sensor="pad", draw=draw),
        axes=axes, shape=shape, quantities=quantities, designs=designs, words=words or [""] * count, wish=bool(wish),
        judge=lambda: iter(judged),
    )  # fmt: skip


def band(values):
    values = np.asarray(values, dtype=float)
    return np.column_stack([values, 0.9 * values, 1.2 * values])


TWO = {"cover.thickness": ("", ((1.0, 2.0, 4.0), "mm")), "array.pitch": ("", ((3.0, 5.0), ""))}


@pytest.fixture
def drawn(monkeypatch):
    figures = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: figures.append(figure))
    return figures


@pytest.mark.parametrize("brief", [False, True])
def test_the_table_has_the_designs_some_quantities_and_the_words_of_failures(brief):
    quantities = {
        "error_m": ("m", band([1e-4, np.nan])),
        "other": ("", band([1, 2])),
        "least_N": ("N", band([0.01, 0.02])),
    }
    found = make_sweep(TWO, (2, 1), quantities, words=["", "too thin: no cover"])
    table = tabulate(found, ["error_m", "least_N"], brief=brief)
    keys = ["thickness", "pitch"] if brief else ["cover.thickness", "array.pitch"]
    assert table.headings == [*keys, "error_m [m]", "least_N [N]", "remark"]
    assert (list(table.texts), table.caption, table.name) == ([1, 4], "Designs of pad", "designs")
    assert [[cell.text for cell in row] for row in table.rows] == [
        ["0 mm", "0 mm", "0.000100", "0.0100", ""],
        ["1 mm", "2 mm", DASH, "0.0200", "see below" if brief else "too thin: no cover"],
    ]
    assert [row[3].value for row in table.rows] == [0.01, 0.02]


def test_the_table_has_the_verdict_on_a_wish():
    wish = [("certain", ""), ("possible", "error_m may be 3 mm"), ("failed", "pitch too small")]
    found = make_sweep(TWO, (3, 1), {}, wish=wish, words=["", "", "refused: x"])
    assert [row[-1].text for row in tabulate(found, []).rows] == [
        "certain", "possible: error_m may be 3 mm", "failed: pitch too small"
    ]  # fmt: skip
    assert [row[-1].text for row in tabulate(found, [], brief=True).rows] == [
        "certain", "possible: error_m", "failed: see below"
    ]  # fmt: skip


def test_names_that_would_be_the_same_are_not_shortened():
    found = make_sweep(TWO, (1, 1), {})
    found.tables.designs = {"cover.layer[0].thickness": 1, "cover.layer[1].thickness": 2}
    found.designs[0].values = {"cover.layer[0].thickness": "1 mm", "cover.layer[1].thickness": "2 mm"}
    assert tabulate(found, [], brief=True).headings[:2] == ["cover.layer[0].thickness", "cover.layer[1].thickness"]


def test_a_quantity_over_two_axes_is_a_map_with_the_second_axis_upwards(drawn, tmp_path):
    values = np.array([[1.0, 2.0], [3.0, 4.5], [6.0, 9.0]])  # by thickness and pitch
    quantities = {"least_N": ("N", band(values.ravel())), "none": ("m", band(np.full(6, np.nan)))}
    assert draw_maps(make_sweep(TWO, (3, 2), quantities), tmp_path) == ["least_N.png"]
    (figure,) = drawn
    plot, bar = figure.axes
    assert (plot.get_xlabel(), plot.get_ylabel()) == ("cover.thickness [mm]", "array.pitch")
    assert plot.get_title() == "least N [N]"
    assert (plot.get_xlim(), plot.get_ylim()) == ((1, 4), (3, 5))
    filled, lines = plot.collections
    assert len(filled.levels) >= 7
    assert filled.levels[0] <= 1
    assert filled.levels[-1] >= 9
    for level, parts in zip(lines.levels, lines.allsegs, strict=True):
        for x, y in (point for part in parts for point in part):
            along = [np.interp(x, (1, 2, 4), values[:, k]) for k in (0, 1)]
            assert np.interp(y, (3, 5), along) == pytest.approx(level, abs=0.6)
    assert lines.labelTexts
    assert len(bar.get_yticks()) > 2
    assert figure.get_size_inches().tolist() == [3.5, 3.5]


def test_a_quantity_that_is_the_same_everywhere_has_a_map_without_lines(drawn, tmp_path):
    assert draw_maps(make_sweep(TWO, (3, 2), {"x": ("", band(np.full(6, 2.0)))}), tmp_path) == ["x.png"]
    assert len(drawn[0].axes[0].collections) == 1
    assert drawn[0].axes[0].get_title() == "x"


def test_a_quantity_over_one_axis_is_a_curve_with_its_band(drawn, tmp_path):
    one = {"cover.thickness": ("", ((1.0, 2.0, 4.0), "mm"))}
    quantities = {"error_of_place": ("um", band([5.0, np.inf, 7.0]))}
    assert draw_maps(make_sweep(one, (3,), quantities), tmp_path) == ["error_of_place.png"]
    (plot,) = drawn[0].axes
    (line,) = plot.lines
    np.testing.assert_allclose(line.get_xydata(), [[1, 5], [2, np.nan], [4, 7]])
    assert (line.get_color(), line.get_marker(), line.get_linestyle()) == (COLOURS["fem"], "o", "-")
    (shade,) = plot.collections
    assert 0 < shade.get_alpha() < 0.5
    assert (plot.get_xlabel(), plot.get_ylabel()) == (
        "cover.thickness [mm]",
        "error of place [um]".replace("um", "\u00b5m"),
    )


def test_the_band_of_a_curve_reaches_from_the_least_to_the_largest_value(drawn, tmp_path):
    one = {"cover.thickness": ("", ((1.0, 2.0, 4.0), "mm"))}
    draw_maps(make_sweep(one, (3,), {"x": ("", band([5.0, 6.0, 7.0]))}), tmp_path)
    corners = drawn[0].axes[0].collections[0].get_paths()[0].vertices
    for place, value in ((1, 5.0), (2, 6.0), (4, 7.0)):
        ends = corners[np.isclose(corners[:, 0], place), 1]
        assert (ends.min(), ends.max()) == pytest.approx((0.9 * value, 1.2 * value))


THREE = TWO | {"x": ("", ((1.0, 2.0), ""))}


@pytest.mark.parametrize(
    ("axes", "shape", "draw"),
    [(TWO, (3, 2), 6), (THREE, (3, 2, 2), 0), (TWO, (3, 1), 0), ({"cover.material": ("", None)} | TWO, (2, 3, 2), 0),
     ({"cover.material": ("", None), "array.pitch": TWO["array.pitch"]}, (2, 2), 0)],
    ids=["drawn", "three axes", "one value", "materials and two axes", "materials and one axis"],
)  # fmt: skip
def test_sweeps_that_are_no_grid_of_one_or_two_numbers_have_no_maps(drawn, tmp_path, axes, shape, draw):
    quantities = {"x": ("", band(np.arange(np.prod(shape))))}
    assert draw_maps(make_sweep(axes, shape, quantities, draw=draw), tmp_path) == []
    assert not drawn


def test_at_most_forty_maps_are_drawn(monkeypatch, tmp_path):
    shown = []
    monkeypatch.setattr("validation.sweeps.page.open_figure", lambda path, **_: shown.append(path) or Unused())
    one = {"cover.thickness": ("", ((1.0, 2.0), "mm"))}
    quantities = {f"q{k}": ("", band([1.0, 2.0])) for k in range(43)}
    assert draw_maps(make_sweep(one, (2,), quantities), tmp_path) == [f"q{k}.png" for k in range(40)]
    assert shown == [tmp_path / f"q{k}.png" for k in range(40)]


class Unused:
    """A figure into which anything can be drawn."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False

    def __getattr__(self, _name):
        return lambda *_, **__: self
