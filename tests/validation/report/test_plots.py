"""What the plots of a derivation show, against the results that they stand for."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from validation.report.derivation import write_derivation


def test_the_plots_of_a_derivation_show_its_spread_and_its_kernel(wts_derivation, monkeypatch, tmp_path):
    saved = {}
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, path, **_: saved.update({path.name: figure}))
    assert write_derivation(wts_derivation, tmp_path)[-2:] == ("psf.svg", "psf.png")
    assert list(saved) == ["psf.svg", "psf.png"]
    figure = saved["psf.svg"]
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
    assert [each.get_xlabel()[-4:] for each in (radial, row)] == ["[mm]", "[mm]"]
