"""Plots of moving cases and of left-out images, and texels in figures, against made-up numbers."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from meshes import TexelArray
from validation.derivation.solid import SolidDerivation
from validation.moving.results import MovingResult, MovingScore
from validation.render.figure import draw_texels, open_figure
from validation.render.image import Scale, shorten, tactile_image
from validation.report.figures import draw_campaign, draw_cases, draw_left_out, draw_moving, render_svg
from validation.text.indenter import describe_indenter


def make_score(model, delay):
    names = ("error", "misplaced", "misplaced_high", "touching", "sliding", "overshoot", "latency", "latency_worst")
    return MovingScore(case="slide", model=model, chain="a filter", delay=delay, **dict.fromkeys(names, 0.01))


def test_a_moving_case_is_drawn_with_the_models_of_the_longest_delays():
    """The slowest setting of each model counts; those without a delay are left out."""
    delays = {
        "fast": 0.004,
        "a, slow": 0.03,
        "a, quick": 0.001,
        "b": 0.02,
        "c": 0.0,
        "d": np.nan,
        "e": 0.01,
        "f": 0.005,
    }
    names = ["truth", *delays]
    result = MovingResult(
        name="slide", indenter="a ball", states=7, interpolation_error=0.002, fastest=3.0, resonance=90.0, warnings=(),
        scores=tuple(make_score(name, delay) for name, delay in delays.items()), times=np.array([0.0, 0.1, 0.3]),
        totals={name: np.array([0.0, 1.0, 2.0]) + k for k, name in enumerate(names)},
    )  # fmt: skip
    axes = Figure().subplots()
    draw_moving(result, axes)
    shown = {line.get_label(): line.get_xydata().T for line in axes.lines}
    assert list(shown) == ["finite elements", "fast", "a, slow", "b", "e", "f"]
    for label, (times, forces) in shown.items():
        np.testing.assert_array_equal(times, [0.0, 0.1, 0.3])
        at = names.index("truth" if label == "finite elements" else label)
        np.testing.assert_array_equal(forces, np.array([0.0, 1.0, 2.0]) + at)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "force on the texels [N]")


def test_left_out_errors_stand_over_the_power_of_the_load():
    axes = Figure().subplots()
    draw_left_out({"even seat": (3.0, 2.0, 4.0), "seating heights": (1.0, 5.0, 6.0)}, axes)
    assert [line.get_label() for line in axes.lines] == ["even seat", "seating heights"]
    assert [list(line.get_ydata()) for line in axes.lines] == [[3.0, 2.0, 4.0], [1.0, 5.0, 6.0]]
    axes.figure.canvas.draw()
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0", "1", "8"]


def test_a_plot_on_a_page_has_no_background_no_names_and_the_colour_of_its_text():
    svg = render_svg(lambda axes: axes.plot([0, 1], [2, 3], color="black"), width=4, height=2)
    assert svg.startswith("<svg")
    assert ('width="288pt"' in svg, 'height="144pt"' in svg) == (True, True)
    assert "#000000" not in svg
    assert "currentColor" in svg
    assert not re.findall(r'<g id="', svg)
    filled = re.findall(r'style="fill: #ffffff([^"]*)"', svg)
    assert all("opacity: 0" in each for each in filled)
    assert not re.findall(r"<dc:date>|<dc:creator>", svg)


def test_marks_of_a_campaign_are_the_misplaced_forces_of_its_models():
    def result(name, *shares):
        predictions = {
            model: SimpleNamespace(score=SimpleNamespace(misplaced_force=share))
            for model, share in zip(("fast", "foundation"), shares, strict=True)
        }
        return SimpleNamespace(case=SimpleNamespace(name=name), predictions=predictions)

    campaign = SimpleNamespace(
        models=("fast", "foundation"), cases=(result("one", 0.02, 0.3), result("two", 0.05, 0.4))
    )
    axes = Figure().subplots()
    draw_campaign(campaign, axes)
    assert {line.get_label(): list(line.get_ydata()) for line in axes.lines} == {
        "fast": pytest.approx([2, 5]), "foundation": pytest.approx([30, 40])
    }  # fmt: skip
    assert [list(line.get_xdata()) for line in axes.lines] == [[0, 1], [0, 1]]
    assert len({line.get_marker() for line in axes.lines}) == 2
    assert [label.get_text() for label in axes.get_xticklabels()] == ["one", "two"]
    assert (axes.get_yscale(), axes.get_ylabel()) == ("log", "misplaced force [% of the load]")


@pytest.mark.parametrize(("count", "left"), [(24, 0), (26, 2)])
def test_at_most_24_cases_are_drawn_in_three_dimensions(monkeypatch, tmp_path, count, left):
    """The scene of the third one cannot be shown."""
    shown, written = [], []

    def show(found, array, indenter, pose, *, title):
        shown.append((found, array, indenter, pose, title))
        return None if found == 3 else found

    monkeypatch.setattr("validation.scene.cover_scene.show_indentation", show)
    monkeypatch.setattr("validation.scene.draw.write_picture", lambda *given: written.append(given))
    cases = [
        SimpleNamespace(
            case=SimpleNamespace(name=f"case {k}", shape="sphere:radius=4mm", load=0.25 * k, indenter="ball", pose=k),
            reference=SimpleNamespace(found=k),
        )
        for k in range(1, count + 1)
    ]
    derivation = SimpleNamespace(sensor=SimpleNamespace(array="the array"))
    evaluation = SimpleNamespace(campaign=SimpleNamespace(cases=cases))
    pictures = draw_cases.dispatch(SolidDerivation)(derivation, evaluation, tmp_path)
    assert len(shown) == 24
    assert shown[1] == (2, "the array", "ball", 2, f"case 2: {describe_indenter('sphere:radius=4mm')}, 0.5 N")
    assert written[:3] == [(k, tmp_path / f"case-{k:02d}.png") for k in (1, 2, 4)]
    assert pictures.files == {f"case {k}": f"case-{k:02d}.png" for k in range(1, 25) if k != 3}
    assert pictures.missing == f"{left + 1} further cases are not drawn"


VALUES = np.array([0.5, -0.002, -0.2, 0.25, 1.0, 9.0])
ACTIVE = np.array([True, True, True, True, True, False])


@pytest.mark.parametrize(
    ("scale", "values", "limits"),
    [
        (Scale(peak=1.0), [500, 0, -200, 250, 1000, None], (0, 1000)),
        (Scale(peak=2.0, unit="N", factor=1.0), [0.5, 0, -0.2, 0.25, 1.0, None], (0, 2)),
        (Scale(peak=1.0, difference=True), [500, -2, -200, 250, 1000, None], (-1000, 1000)),
        (Scale(peak=0.0), [500, -2, -200, 250, 1000, None], (0, 1)),
    ],
)
def test_texels_in_a_figure_have_the_printed_unit_and_small_pulls_the_colour_of_zero(scale, values, limits):
    array = TexelArray.grid(3, 2, (2e-3, 5e-3), active=ACTIVE)
    axes = Figure().subplots()
    drawn = draw_texels(axes, array, VALUES, scale, title="a title")
    shown = np.ma.filled(drawn.get_array(), np.nan).ravel()
    np.testing.assert_allclose(shown, [np.nan if each is None else each for each in values])
    assert drawn.get_clim() == limits
    assert (drawn.origin, axes.get_aspect(), axes.get_title()) == ("lower", 2.5, "a title")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("column", "row")
    assert [list(axes.get_xticks()), list(axes.get_yticks())] == [[0, 1], [0, 1, 2]]
    assert to_hex(drawn.cmap.get_bad()) == "#e6e6ea"
    assert to_hex(drawn.cmap.get_under()) == "#e8432e"


@pytest.mark.parametrize(("columns", "ticks"), [(7, [0, 1, 2, 3, 4, 5, 6]), (8, [0, 2, 4, 6]), (15, [0, 3, 6, 9, 12])])
def test_a_row_of_texels_is_as_high_as_its_axes_and_has_at_most_seven_marks(columns, ticks):
    axes = Figure().subplots()
    draw_texels(axes, TexelArray.grid(1, columns, 1e-3), np.ones(columns), Scale(peak=1.0))
    assert list(axes.get_xticks()) == ticks
    assert list(axes.get_yticks()) == []
    assert (axes.get_aspect(), axes.get_xlabel(), axes.get_ylabel()) == ("auto", "texel", "")


def test_a_figure_has_its_size_in_inches_and_the_format_of_its_name(tmp_path):
    with open_figure(tmp_path / "new" / "er" / "x.svg", height=2.0, width=3.5) as figure:
        assert figure.get_size_inches().tolist() == [3.5, 2.0]
    assert 'width="252pt" height="144pt"' in (tmp_path / "new" / "er" / "x.svg").read_text()
    with open_figure(tmp_path / "x.png", height=1.0) as figure:
        assert figure.get_size_inches().tolist() == [7.2, 1.0]
    content = (tmp_path / "x.png").read_bytes()
    assert content[:4] == b"\x89PNG"
    assert (int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")) == (1440, 200)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.04, "0"), (0.04, "0"), (0.06, "0.1"), (9.96, "10.0"), (-3.21, "\u22123.2"), (10.4, "10"),
     (-1234.4, "\u22121234"), (12345.4, "12345"), (123456.0, "1e+05"), (-99999.0, "-1e+05")],
)  # fmt: skip
def test_a_number_in_a_texel_has_at_most_five_characters_and_a_sign(value, text):
    assert shorten(value) == text


def test_the_drawing_of_an_oblong_grid_is_to_scale():
    """3 rows of 3 mm pitch and 2 columns of 2 mm: squares of 0.94 times the smaller pitch; 200 units are the height."""
    svg = tactile_image(TexelArray.grid(3, 2, (2e-3, 3e-3)), np.arange(6.0), Scale(peak=5.0, unit="N", factor=1.0))
    width, height = map(float, re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg).groups())
    edge = 0.94 * 2.0
    per_mm = 196 / (6 + edge)
    assert (width, height) == pytest.approx((4 + per_mm * (2 + edge), 200), abs=0.06)
    squares = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"[^>]*><title>([^<]+)', svg)
    for k, (x, y, wide, high, title) in enumerate(squares):
        row, column = divmod(k, 2)
        assert float(x) == pytest.approx(2 + per_mm * 2 * column, abs=0.06)
        assert float(y) == pytest.approx(200 - 2 - per_mm * (3 * row + edge), abs=0.06)
        assert float(wide) == float(high) == pytest.approx(per_mm * edge, abs=0.01)
        assert title == f"[{row}, {column}] {k} N"
    zoom = min(190 / width, 370 / height)
    assert f'width="{zoom * width:.0f}" height="{zoom * height:.0f}"' in svg
    texts = re.findall(r'<text x="([\d.]+)" y="([\d.]+)"', svg)
    for (x, y, wide, *_), (at, low) in zip(squares, texts, strict=True):
        assert float(at) == pytest.approx(float(x) + float(wide) / 2, abs=0.02)
        assert float(y) + float(wide) / 2 < float(low) < float(y) + 0.7 * float(wide)


@pytest.mark.parametrize(
    ("value", "colour"),  # eight colours at equal steps from zero to the peak, and seven of differences
    [(0.0, "#1b1340"), (1.0, "#3b2f74"), (3.0, "#36839a"), (0.5, "#2b215a"), (7.0, "#fdf3a1"), (9.0, "#fdf3a1"),
     (-1.0, "#1b1340")],
)  # fmt: skip
def test_the_colours_of_forces_are_between_their_steps(value, colour):
    assert Scale(peak=7.0).colour(value) == colour
    assert Scale(peak=0.0).colour(value) == "#1b1340"


@pytest.mark.parametrize(
    ("value", "colour"), [(-3.0, "#0b4f8a"), (-1.0, "#a3cfe6"), (1.0, "#f6b89b"), (2.0, "#d9604c")]
)
def test_the_colours_of_differences_are_at_equal_steps_to_both_sides(value, colour):
    assert Scale(peak=3.0, difference=True).colour(value) == colour
