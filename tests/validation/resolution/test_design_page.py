"""Tables and maps of made-up designs: what stands where, in which unit, and which axes and bands are drawn."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from validation.resolution import design_page
from validation.resolution.design import Design, Designs
from validation.resolution.design_page import draw, list_maps, tabulate_best, tabulate_designs, write_designs

DASH = "\u2013"
THICK, HARD, PITCH = (1e-3, 2e-3, 4e-3), (20.0, 30.0), (2e-3, 3e-3, 5e-3)


def error(thickness, pitch):
    return 1e-5 + 2 * (thickness - 2e-3) ** 2 + 1e-2 * pitch


def make_designs(*, best=10, hard=HARD):
    """Designs whose error depends on thickness and pitch, the depth on all, and the spread on the thickness alone."""
    designs = tuple(
        Design(
            thickness=t, hardness=h, pitch=p, modulus=1e6, ends="saturation",
            numbers={"error_m": error(t, p), "spread_m": 1.2 * t, "least_N": 0.004, "most_N": None, "touch_m": None,
                     "depth_m": 1e-2 * t * p / (h or 10.0) * 100},
            bands={"error_m": (0.9 * error(t, p), 1.25 * error(t, p)), "spread_m": None, "least_N": (0.004, 0.004),
                   "most_N": None, "touch_m": None, "depth_m": (1e-6, 2e-6)},
        )
        for t in THICK for h in hard for p in PITCH
    )  # fmt: skip
    return Designs(
        sensor="pad", load=1.0, noise=4e-3, noise_assumed=False, radius=0.0, ball=5e-3, layers=1,
        scale="a" if hard[0] else "", tolerance=5.0 if hard[0] else None, finite_error=0.01, designs=designs, best=best,
        flat=None,
    )  # fmt: skip


@pytest.fixture
def found():
    return make_designs()


def show(found, name, axes):
    plot = Figure().subplots()
    draw(found, name, axes, plot)
    return plot


def test_the_table_of_designs_has_their_axes_and_all_numbers(found):
    table = tabulate_designs(found, found.designs[:2], ["hardness", "pitch"], name="designs", caption="all")
    assert (table.name, table.caption) == ("designs", "all")
    assert list(table.headings) == [
        "hardness [Shore A]", "pitch [mm]", "error of place [um]", "width of the spread [mm]", "least force [mN]",
        "largest load [N]", "touch radius [mm]", "depth [mm]",
    ]  # fmt: skip
    first, second = ([(cell.text, cell.value, cell.small) for cell in row] for row in table.rows)
    value = error(1e-3, 2e-3)
    assert first[:2] == [("20.0", None, ""), ("2.00", None, "")]
    assert second[1][0] == "3.00"
    assert first[2] == (f"{1e6 * value:.1f}", value, f"{0.9e6 * value:.1f} to {1.25e6 * value:.1f}")
    assert first[3] == ("1.20", 1.2e-3, "")
    assert first[4] == ("4.00", 0.004, "")  # both ends of the band are equal
    assert first[5] == (DASH, None, "")
    brief = tabulate_designs(found, found.designs[:1], ["thickness"])
    assert [cell.small for cell in brief.rows[0]] == [""] * 7


def test_the_table_of_the_best_design_says_what_each_number_is(found):
    table = tabulate_best(found)
    assert (list(table.headings), list(table.texts)) == (["", "value", "band", "what it is"], [2, 3])
    assert (table.name, table.caption) == ("best", "Best design")
    value = error(2e-3, 3e-3)  # the eleventh design
    rows = [[cell.text for cell in row] for row in table.rows]
    assert rows[0] == ["error of place [um]", f"{1e6 * value:.1f}", f"{0.9e6 * value:.1f} to {1.25e6 * value:.1f}",
                       "per axis, force known"]  # fmt: skip
    assert rows[3][:3] == ["largest load [N]", DASH, ""]
    assert len(rows) == 6


def test_maps_show_the_axes_along_which_a_number_varies(found):
    assert list_maps(found) == [
        ("error_m", ("thickness", "pitch")), ("spread_m", ("thickness",)),
        ("depth_m", ("thickness", "hardness")), ("depth_m", ("thickness", "pitch")),
    ]  # fmt: skip


def test_a_number_over_one_axis_has_its_band_and_a_star_at_the_best_design(found):
    plot = show(found, "error_m", ("thickness",))
    line, star = plot.lines
    expected = 1e6 * np.array([error(t, 3e-3) for t in THICK])
    np.testing.assert_allclose(line.get_xydata(), np.column_stack([[1, 2, 4], expected]))
    np.testing.assert_allclose(star.get_xydata(), [[2, expected[1]]])
    assert (star.get_marker(), line.get_marker(), line.get_linestyle()) == ("*", "o", "-")
    assert star.get_markersize() > line.get_markersize()
    assert to_hex(star.get_color()) == "#d55e00"
    (band,) = plot.collections
    corners = band.get_paths()[0].vertices
    for x, middle in zip((1, 2, 4), expected, strict=True):
        ends = corners[np.isclose(corners[:, 0], x), 1]
        assert (ends.min(), ends.max()) == pytest.approx((0.9 * middle, 1.25 * middle))
    assert 0 < band.get_alpha() < 0.5
    assert plot.get_ylim()[0] == 0
    assert (plot.get_xlabel(), plot.get_title()) == ("thickness [mm]", "error of place [um]")
    bare = show(found, "spread_m", ("thickness",))  # has no band
    np.testing.assert_allclose(bare.lines[0].get_ydata(), [1.2, 2.4, 4.8])
    assert not np.isfinite([path.vertices[:, 1] for each in bare.collections for path in each.get_paths()]).any()


def test_a_number_over_two_axes_has_iso_lines_and_a_dashed_line_of_ten_percent(found):
    plot = show(found, "error_m", ("thickness", "pitch"))
    assert (plot.get_xlabel(), plot.get_ylabel()) == ("thickness [mm]", "pitch [mm]")
    assert (plot.get_xlim(), plot.get_ylim()) == ((1, 4), (2, 5))
    (star,) = plot.lines
    np.testing.assert_allclose(star.get_xydata(), [[2, 3]])
    assert not star.get_clip_on()
    filled, lines, flat = plot.collections
    values = 1e6 * np.array([[error(t, p) for t in THICK] for p in PITCH])
    assert (filled.levels[0], filled.levels[-1]) == pytest.approx((values.min(), values.max()))
    inner = lines.levels[1:-1]
    assert 3 <= len(inner) <= 8
    assert np.diff(inner) == pytest.approx(np.full(len(inner) - 1, inner[1] - inner[0]))
    for level, segments in zip(lines.levels, lines.allsegs, strict=True):
        for x, y in (point for part in segments for point in part):
            k, m = (
                min(np.searchsorted([1, 2, 4], x, "right") - 1, 1),
                min(np.searchsorted([2, 3, 5], y, "right") - 1, 1),
            )
            assert values[m : m + 2, k : k + 2].min() - 1e-6 <= level <= values[m : m + 2, k : k + 2].max() + 1e-6
    assert list(flat.levels) == [pytest.approx(1.1e6 * error(2e-3, 3e-3))]
    assert to_hex(flat.get_edgecolor()[0]) == "#d55e00"
    assert flat.get_linestyle()[0][1] is not None  # dashed
    assert to_hex(lines.get_edgecolor()[0]) == "#1f2a37"
    assert to_hex(filled.cmap(0.0)) == "#f4f8fc"
    assert to_hex(filled.cmap(1.0)) == "#8fbbe0"
    other = show(found, "depth_m", ("thickness", "pitch"))
    assert len(other.collections) == 2  # the dashed line belongs to the error alone


FEW, MANY = {1.0, 1.5, 2.0, 3.0, 5.0, 7.0}, {1.0, 2.0, 5.0}


def show_range(found, most):
    """Draw a number that rises from 1 to some value, and return the levels of its iso-lines between these ends."""
    grid = np.geomspace(1, most, 9).reshape(3, 3)
    designs = []
    for each in found.designs:
        value = float(grid[THICK.index(each.thickness), PITCH.index(each.pitch)])
        designs.append(dataclasses.replace(each, numbers=each.numbers | {"most_N": value}))
    plot = show(dataclasses.replace(found, designs=tuple(designs)), "most_N", ("thickness", "pitch"))
    _, lines = plot.collections
    return [level for level in lines.levels if 1 < level < most]


@pytest.mark.parametrize(("most", "steps"), [(8.01, FEW), (9.0, FEW), (64.0, FEW), (64.1, MANY), (100.0, MANY)])
def test_numbers_over_several_powers_have_iso_lines_at_equal_ratios(found, most, steps):
    inner = show_range(found, most)
    mantissas = {round(level / 10.0 ** math.floor(math.log10(level) + 1e-9), 6) for level in inner}
    assert mantissas | {1.0} == steps
    assert len(inner) >= 4


def test_numbers_up_to_eight_times_the_least_have_iso_lines_at_equal_distances(found):
    apart = np.diff(show_range(found, 8.0))
    assert apart == pytest.approx(np.full(len(apart), apart[0]))
    assert len(apart) >= 3


def test_a_number_that_is_the_same_or_unknown_everywhere_says_so(found):
    assert show(found, "least_N", ("thickness", "pitch")).get_title() == "least force [mN]: 4 everywhere here"
    plot = show(found, "touch_m", ("thickness", "pitch"))
    assert plot.get_title() == "touch radius [mm]: none here"
    assert len(plot.lines) == 1
    assert not plot.collections


def test_the_page_has_each_map_with_its_caption(found, tmp_path, monkeypatch):
    """Drawing itself is tested above; the picture has two maps in a row."""
    drawn, plots = [], []
    monkeypatch.setattr(
        "validation.report.figures.render_svg", lambda plot, *size: plots.append((plot, size)) or "<svg/>"
    )
    monkeypatch.setattr(design_page, "draw", lambda _, *given: drawn.append((*given[:2], given[2].get_subplotspec())))
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, target, **_: drawn.append(figure))
    write_designs(found, tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    captions = re.findall(r"<figcaption>([^<]+)</figcaption>", page)
    assert captions[1].startswith("Width of the spread: full width at half maximum under a point load.")
    assert captions[1].endswith("The same for every hardness and pitch.")
    del captions[1]
    assert captions == [
        "Error of place: per axis, force known. The same for every hardness.",
        "Depth: of the ball under the load. At pitch 3.00 mm.", "Depth: of the ball under the load. At hardness 30.0.",
    ]  # fmt: skip
    assert page.count("<svg") == 4
    assert json.loads((tmp_path / "design.json").read_text())["sensor"] == "pad"
    *maps, figure = drawn
    assert [each[:2] for each in maps] == list_maps(found)
    places = [(each[2].rowspan.start, each[2].colspan.start, each[2].get_gridspec().get_geometry()) for each in maps]
    assert places == [(0, 0, (2, 2)), (0, 1, (2, 2)), (1, 0, (2, 2)), (1, 1, (2, 2))]
    assert figure.get_size_inches() == pytest.approx([7.2, 5.2])
    assert (tmp_path / "maps.png").exists()
    assert {size for _, size in plots} == {(4.4, 3.2)}


def test_designs_of_one_thickness_have_no_maps(tmp_path):
    found = make_designs(best=None, hard=(None,))
    one = dataclasses.replace(found, designs=found.designs[:1])
    write_designs(one, tmp_path)
    assert not (tmp_path / "maps.png").exists()
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "thickness [mm]" in page
    assert design_page.list_maps(one) == []
