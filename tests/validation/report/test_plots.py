"""What the plots of a derivation show, against the results that they stand for."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from fem_reference.closed_form import point_response
from validation.report.figures import campaign_figure, draw_derivation, plot_responses


def test_the_plots_hold_the_curves_that_they_name(wts_derivation):
    plots = plot_responses(wts_derivation)
    fem, exact, gaussian = plots["psf-plot"].lines
    radius, cover = 1e-3 * fem.x, wts_derivation.sensor.cover
    np.testing.assert_allclose(fem.x, np.linspace(0, min(1e3 * wts_derivation.point_spread.reach, 12), 300))
    np.testing.assert_allclose(fem.y, 1e-6 * wts_derivation.point_spread.pressure(radius))
    np.testing.assert_allclose(exact.y, 1e-6 * point_response(cover, radius))
    sigma = 3.4 * wts_derivation.fit.gaussian.sigma_x
    np.testing.assert_allclose(gaussian.y, np.exp(-(fem.x**2) / (2 * sigma**2)) / (2 * np.pi * sigma**2), rtol=1e-9)
    kernel = wts_derivation.fit.gaussian.operator(wts_derivation.sensor.array)[3::6, 7 * 6 + 3]
    expected = (wts_derivation.texel_response_uniform[:, 3], wts_derivation.texel_response[:, 3], kernel)
    for line, values in zip(plots["texel-plot"].lines, expected, strict=True):
        np.testing.assert_array_equal(line.x, np.arange(14) - 7)
        np.testing.assert_allclose(line.y, 100 * values)
    for plot in plots.values():
        for line, trace in zip(plot.lines, plot.to_plotly()["data"], strict=True):
            assert (trace["name"], trace["x"] is line.x, trace["y"] is line.y) == (line.name, True, True)


@pytest.mark.parametrize("sides", [False, True], ids=["wide", "free sides"])
def test_a_picture_shows_the_plots_and_the_image_of_a_load_on_one_texel(wts_derivation, monkeypatch, tmp_path, sides):
    saved = {}
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, path, **_: saved.update({path.name: figure}))
    derivation = wts_derivation
    if sides:
        uniform = wts_derivation.texel_response_uniform.ravel()
        derivation = dataclasses.replace(
            wts_derivation, influence=SimpleNamespace(texel_response=lambda _array, load: uniform)
        )
    assert draw_derivation(derivation, tmp_path, "png") == ("psf.png",)
    *plots, image, colours = saved["psf.png"].axes
    assert len(plots) == (1 if sides else 2)
    for drawn, plot in zip(plots, plot_responses(derivation).values(), strict=True):
        for line, each in zip(drawn.lines, plot.lines, strict=True):
            np.testing.assert_array_equal(line.get_ydata(), each.y)
    (drawn,) = image.images
    np.testing.assert_allclose(drawn.get_array(), 100 * wts_derivation.texel_response_uniform)
    assert drawn.origin == "lower"
    assert "% of the load" in colours.get_ylabel()


def test_the_bars_of_a_campaign_stand_for_misplaced_forces():
    score = [SimpleNamespace(score=SimpleNamespace(misplaced_force=share)) for share in (0.1, 0.2, 0.3, 0.4)]
    cases = [
        SimpleNamespace(case=SimpleNamespace(name=name), predictions={"fast": score[i], "zeros": score[i + 1]})
        for name, i in (("a", 0), ("b", 2))
    ]
    figure = campaign_figure(SimpleNamespace(cases=cases, models=("fast", "zeros")))
    assert [(bar["name"], bar["x"], bar["y"]) for bar in figure["data"]] == [
        ("fast", ["a", "b"], pytest.approx([10, 30])),
        ("zeros", ["a", "b"], pytest.approx([20, 40])),
    ]
