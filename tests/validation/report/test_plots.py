"""What the plots of a derivation show, against the results that they stand for."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.colors import to_hex

from fem_reference.closed_form import point_response
from validation.report.figures import campaign_figure, point_spread_figure, texel_profile_figure
from validation.report.files import draw_derivation, write_derivation


def test_the_plots_of_a_derivation_show_its_spread_and_its_kernel(wts_derivation, monkeypatch, tmp_path):
    saved = {}
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, path, **_: saved.update({path.name: figure}))
    assert write_derivation(wts_derivation, tmp_path)[-1] == "psf.png"
    figure = saved["psf.png"]
    assert figure.get_suptitle() == "wts-0614-34 (assumed cover)"
    radial, row, image, colours = figure.axes

    curve, edge = radial.lines
    x, y = curve.get_data()
    np.testing.assert_allclose((x[0], x[-1]), (0, 10))  # five times the thickness [mm]
    np.testing.assert_allclose(y, 1e-6 * wts_derivation.point_spread.pressure(1e-3 * x))
    assert edge.get_xdata() == pytest.approx([1.7, 1.7])
    assert {text.get_text() for text in radial.get_legend().texts} == {"finite elements", "edge of the texel"}

    array, response = wts_derivation.sensor.array, wts_derivation.texel_response_uniform
    place = 3.4 * (np.arange(6) - 3)
    (line,), bars = row.lines, row.patches
    np.testing.assert_allclose(line.get_xdata(), place, atol=1e-12)
    np.testing.assert_allclose(line.get_ydata(), 100 * response[7])
    np.testing.assert_allclose([bar.get_x() + bar.get_width() / 2 for bar in bars], place, atol=1e-12)
    kernel = wts_derivation.fit.gaussian.operator(array)[7 * 6 : 8 * 6, 7 * 6 + 3]
    np.testing.assert_allclose([bar.get_height() for bar in bars], 100 * kernel)
    assert bars[0].get_width() == pytest.approx(0.8 * 3.4)

    (drawn,) = image.images
    np.testing.assert_allclose(drawn.get_array(), 100 * response)
    assert drawn.origin == "lower"
    assert "% of the load" in colours.get_ylabel()
    assert drawn.get_cmap().name == "viridis"
    assert (image.get_xlabel(), image.get_ylabel()) == ("column", "row")
    labels = [(each.get_xlabel(), each.get_ylabel(), each.get_title()) for each in (radial, row)]
    assert labels == [
        ("distance from the load [mm]", "base pressure per force [1/mm\u00b2]", "point load"),
        ("texel's distance along x [mm]", "force on the texel [% of the load]", "uniform load on one texel"),
    ]
    assert [text.get_text() for text in row.get_legend().texts] == ["finite elements", "fitted Gaussian"]
    assert (line.get_marker(), edge.get_linestyle(), edge.get_color()) == ("o", ":", "grey")
    assert {(bar.get_alpha(), to_hex(bar.get_facecolor())) for bar in bars} == {(0.5, to_hex("tab:orange"))}
    assert len(x) == 300
    assert figure.get_size_inches().tolist() == [12, 4]
    assert image.get_gridspec().get_width_ratios() == (2, 2, 1)
    for axes in (radial, row):
        assert not axes.get_legend().get_frame_on()
        assert axes.get_legend().texts[0].get_fontsize() == pytest.approx(8.33, abs=0.01)


def test_with_free_sides_the_rows_under_the_middle_and_the_last_texel_are_drawn(wts_derivation, monkeypatch, tmp_path):
    saved = {}
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, path, **_: saved.update({path.name: figure}))
    texels, asked = wts_derivation.sensor.array.count, []

    def texel_response(array, *, load, texel):
        asked.append((array is wts_derivation.sensor.array, load, texel))
        return np.arange(texels) / 1000 + texel

    sides = dataclasses.replace(wts_derivation, influence=SimpleNamespace(texel_response=texel_response))
    draw_derivation(sides, tmp_path, "png")
    rows, image, _ = saved["psf.png"].axes
    assert asked == [(True, "uniform", 45), (True, "uniform", 47)]
    place = 3.4 * (np.arange(6) - 2.5)
    for line, texel in zip(rows.lines, (45, 47), strict=True):
        np.testing.assert_allclose(line.get_xdata(), place, atol=1e-12)
        np.testing.assert_allclose(line.get_ydata(), 0.1 * np.arange(42, 48) + 100 * texel)
        assert (line.get_marker(), line.get_linestyle()) == ("o", "-")
    assert [text.get_text() for text in rows.get_legend().texts] == [
        f"uniform load on the {name} texel of the middle row" for name in ("middle", "outermost")
    ]
    assert rows.get_xlabel() == "texel's position along x [mm]"
    assert rows.get_ylabel() == "force on the texel [% of the load]"
    assert image.get_gridspec().get_width_ratios() == (2, 1)


def test_the_figures_of_the_page_hold_the_curves_that_they_name(wts_derivation):
    figure = point_spread_figure(wts_derivation)
    fem, exact, gaussian = figure["data"]
    radius, cover = 1e-3 * fem["x"], wts_derivation.sensor.cover
    np.testing.assert_allclose(fem["x"], np.linspace(0, min(1e3 * wts_derivation.point_spread.reach, 12), 300))
    np.testing.assert_allclose(fem["y"], 1e-6 * wts_derivation.point_spread.pressure(radius))
    np.testing.assert_allclose(exact["y"], 1e-6 * point_response(cover, radius))
    sigma = 3.4 * wts_derivation.fit.gaussian.sigma_x
    np.testing.assert_allclose(
        gaussian["y"], np.exp(-(fem["x"] ** 2) / (2 * sigma**2)) / (2 * np.pi * sigma**2), rtol=1e-9
    )
    names = ["finite elements", "exact layer solution", "fitted Gaussian (to uniform texel load)"]
    assert [each["name"] for each in figure["data"]] == names
    assert [each["line"] for each in figure["data"]] == [
        {"color": "#2b6cb0", "width": 3}, {"color": "ink", "dash": "dot"}, {"color": "#dd8a34", "dash": "dash"}
    ]  # fmt: skip
    assert {(each["type"], each["mode"]) for each in figure["data"]} == {("scatter", "lines")}

    array, profile = wts_derivation.sensor.array, texel_profile_figure(wts_derivation)
    kernel = wts_derivation.fit.gaussian.operator(array)[3::6, 7 * 6 + 3]
    expected = (wts_derivation.texel_response_uniform[:, 3], wts_derivation.texel_response[:, 3], kernel)
    for trace, values in zip(profile["data"], expected, strict=True):
        np.testing.assert_array_equal(trace["x"], np.arange(14) - 7)
        np.testing.assert_allclose(trace["y"], 100 * values)
        assert (trace["type"], trace["mode"], trace["marker"]["size"]) == ("scatter", "lines+markers", 7)
    names = ["reference, uniform texel load", "reference, point load", "fitted kernel"]
    assert [each["name"] for each in profile["data"]] == names
    assert [each["marker"]["symbol"] for each in profile["data"]] == ["circle", "diamond", "square"]
    assert [each["line"]["color"] for each in profile["data"]] == ["#2b6cb0", "ink", "#dd8a34"]
    for drawn, labels in (
        (figure, ("distance from the load [mm]", "base pressure per force [1/mm²]")),
        (profile, ("texels from the loaded one, along y", "force on the texel [% of the load]")),
    ):
        layout = drawn["layout"]
        assert [layout[axis] for axis in ("xaxis", "yaxis")] == [
            {"automargin": True, "title": {"text": text}} for text in labels
        ]
        assert (layout["height"], layout["margin"]) == (360, {"l": 60, "r": 10, "t": 60, "b": 50})
        assert layout["legend"] == {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0}
        assert layout["font"]["size"] == 12
    with pytest.raises(ValueError, match="free side edges has no radial profile"):
        point_spread_figure(SimpleNamespace(point_spread=None))


def test_the_bars_of_a_campaign_stand_for_misplaced_forces():
    score = [SimpleNamespace(score=SimpleNamespace(misplaced_force=share)) for share in (0.1, 0.2, 0.3, 0.4)]
    cases = [
        SimpleNamespace(case=SimpleNamespace(name=name), predictions={"fast": score[i], "zeros": score[i + 1]})
        for name, i in (("a", 0), ("b", 2))
    ]
    figure = campaign_figure(SimpleNamespace(cases=cases, models=("fast", "zeros")))
    assert figure["data"] == [
        {"type": "bar", "name": name, "x": ["a", "b"], "y": pytest.approx(shares), "marker": {"color": colour}}
        for name, shares, colour in (("fast", [10, 30], "#2b6cb0"), ("zeros", [20, 40], "#9aa0ab"))
    ]
    layout = figure["layout"]
    assert (layout["barmode"], layout["xaxis"]["tickangle"]) == ("group", -35)
    assert layout["margin"] == {"l": 60, "r": 10, "t": 40, "b": 130}
    assert layout["yaxis"]["title"]["text"] == "misplaced force [% of the load]"
