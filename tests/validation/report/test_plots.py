"""What the plots of a derivation show, against the results that they stand for."""

import dataclasses
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from fem_reference.closed_form import point_response
from validation.report.figures import draw_campaign, draw_derivation, plot_responses, render_svg


def draw(plot):
    axes = Figure().subplots()
    plot(axes)
    return axes


def test_the_plots_hold_the_curves_that_they_name(wts_derivation):
    plots = {name: draw(plot) for name, (_, plot) in plot_responses(wts_derivation).items()}
    fem, exact, gaussian = (line.get_xydata().T for line in plots["psf-plot"].lines)
    radius, cover = 1e-3 * fem[0], wts_derivation.sensor.cover
    np.testing.assert_allclose(fem[0], np.linspace(0, min(1e3 * wts_derivation.point_spread.reach, 12), 300))
    np.testing.assert_allclose(fem[1], 1e-6 * wts_derivation.point_spread.pressure(radius))
    np.testing.assert_allclose(exact[1], 1e-6 * point_response(cover, radius))
    sigma = 3.4 * wts_derivation.fit.gaussian.sigma_x
    expected = np.exp(-(fem[0] ** 2) / (2 * sigma**2)) / (2 * np.pi * sigma**2)
    np.testing.assert_allclose(gaussian[1], expected, rtol=1e-9)
    kernel = wts_derivation.fit.gaussian.operator(wts_derivation.sensor.array)[3::6, 7 * 6 + 3]
    expected = (wts_derivation.texel_response_uniform[:, 3], wts_derivation.texel_response[:, 3], kernel)
    for line, values in zip(plots["texel-plot"].lines, expected, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), np.arange(14) - 7)
        np.testing.assert_allclose(line.get_ydata(), 100 * values)


def test_a_plot_in_the_page_takes_the_colour_of_its_text(wts_derivation):
    _, plot = plot_responses(wts_derivation)["psf-plot"]
    svg = render_svg(plot)
    assert svg.startswith("<svg ")
    assert "currentColor" in svg
    assert "#000000" not in svg
    assert "finite elements</text>" in svg


@pytest.mark.parametrize("sides", [False, True], ids=["wide", "free sides"])
def test_a_picture_shows_the_plots_and_the_image_of_a_load_on_one_texel(wts_derivation, monkeypatch, tmp_path, sides):
    saved = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: saved.append(figure))
    derivation = wts_derivation
    if sides:
        uniform = wts_derivation.texel_response_uniform.ravel()
        derivation = dataclasses.replace(
            wts_derivation, influence=SimpleNamespace(texel_response=lambda _array, load: uniform)
        )
    draw_derivation(derivation, tmp_path, "png")
    assert (tmp_path / "psf.png").exists()
    *plots, image, colours = saved[0].axes
    assert len(plots) == (1 if sides else 2)
    (drawn,) = image.images
    np.testing.assert_allclose(drawn.get_array(), 100 * wts_derivation.texel_response_uniform)
    assert drawn.origin == "lower"
    assert "% of the load" in colours.get_ylabel()


def test_the_marks_of_a_campaign_stand_for_misplaced_forces():
    score = [SimpleNamespace(score=SimpleNamespace(misplaced_force=share)) for share in (0.1, 0.2, 0.3, 0.4)]
    cases = [
        SimpleNamespace(case=SimpleNamespace(name=name), predictions={"fast": score[i], "zeros": score[i + 1]})
        for name, i in (("a", 0), ("b", 2))
    ]
    axes = draw(partial(draw_campaign, SimpleNamespace(cases=cases, models=("fast", "zeros"))))
    fast, zeros = axes.lines
    assert fast.get_ydata() == pytest.approx([10, 30])
    assert zeros.get_ydata() == pytest.approx([20, 40])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["a", "b"]


def test_a_name_from_a_stranger_is_text():
    """Neither mathematics nor markup: the name of a case stands in the figure as it is."""
    name = r"<!--<script>alert(1)</script> $\foo$ & \u2028"
    score = SimpleNamespace(score=SimpleNamespace(misplaced_force=0.1))
    case = SimpleNamespace(case=SimpleNamespace(name=name), predictions={"fast": score})
    svg = render_svg(partial(draw_campaign, SimpleNamespace(cases=[case], models=("fast",))))
    assert "<script" not in svg
    assert r"&lt;!--&lt;script&gt;alert(1)&lt;/script&gt; $\foo$ &amp;" in svg
