"""What the pictures of matplotlib show: every curve, image, label and limit, against what it stands for."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("matplotlib")


from meshes import TexelArray
from meshes.catalogue import MATERIALS
from validation.calibration.calibrate import HoldOut, draw_hold_out
from validation.material_curve import compute_stress, write_curve
from validation.render.figure import draw_texels, label_lines, open_figure
from validation.render.image import Scale, spell_units


@pytest.fixture
def saved(monkeypatch):
    """Figures by their format, and the resolutions [dots per inch]."""
    figures = {}

    def save(figure, _, *, dpi, format):  # noqa: A002 -- the name in matplotlib
        figures[format] = figure
        assert dpi >= 150

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", save)
    return figures


@pytest.mark.parametrize(("name", "factor", "unit"), [("dragon-skin-30", 1e-3, "kPa"), ("pet", 1e-6, "MPa")])
def test_a_curve_of_a_material_has_the_range_of_its_modulus_around_it(saved, tmp_path, name, factor, unit):
    material = MATERIALS[name]
    write_curve(material, tmp_path / "material.svg")
    figure = saved["svg"]
    (axes,) = figure.axes
    curve = axes.lines[0]
    strain, stress = curve.get_data()
    limits = (-30, 30) if name == "pet" else (-50, 100)
    np.testing.assert_allclose(strain, np.linspace(*limits, 301), atol=1e-12)
    np.testing.assert_allclose(stress, factor * compute_stress(material, strain / 100), atol=1e-12)
    (band,) = axes.collections
    corners = band.get_paths()[0].vertices
    expected = [end / material.youngs_modulus * stress[-1] for end in material.modulus_range]
    at_end = corners[corners[:, 0] == limits[1], 1]
    assert (at_end.min(), at_end.max()) == pytest.approx(expected)
    assert corners[:, 0].min() == limits[0]
    assert [axes.get_xlabel(), axes.get_ylabel()] == ["strain [%]", f"nominal stress [{unit}]"]
    assert axes.get_title() == f"{name}, uniaxial"


def test_left_out_recordings_stand_above_their_prediction_and_the_difference(saved, tmp_path):
    active = np.arange(12) != 5
    array = TexelArray.grid(4, 3, (2e-3, 3e-3), active=active)
    loads = np.array([5.0, 1.0, 3.0, 2.0, 4.0, 6.0, 7.0])
    recorded = np.arange(84.0).reshape(7, 12)
    predicted = recorded * 1.1 + 3
    held = HoldOut(
        recordings=("a",), image_changed_percent=1.0, line_per_texel_percent=None,
        loads=loads, recorded=recorded, predicted=predicted,
    )  # fmt: skip
    assert draw_hold_out(held, array, tmp_path / "x.png") == tmp_path / "x.png"
    figure = saved["png"]
    chosen, loads = [1, 2, 0, 6], [1, 3, 5, 7]  # the lightest, the heaviest, and evenly between
    panels = np.array([axes for axes in figure.axes if axes.images]).reshape(3, 4)
    assert figure.get_suptitle() == "left out: image changed 1.00 %"
    apart = predicted - recorded
    top, most = predicted[chosen].max(), apart[chosen].max()
    rows = (("recorded", recorded, (0, top)), ("predicted", predicted, (0, top)), ("difference", apart, (-most, most)))
    for row, (name, values, limits) in zip(panels, rows, strict=True):
        for axes, place, load in zip(row, chosen, loads, strict=True):
            (image,) = axes.images
            shown = np.ma.filled(image.get_array(), np.nan)
            np.testing.assert_array_equal(shown, np.where(active, values[place], np.nan).reshape(4, 3))
            assert image.get_clim() == pytest.approx(limits)
            assert axes.get_aspect() == pytest.approx(1.5)
            assert image.origin == "lower"
            assert axes.get_title() == f"{name}, {load} N"


def test_one_left_out_recording_without_counts_has_a_scale_of_one(saved, tmp_path):
    dark = np.zeros((1, 6))
    held = HoldOut(
        recordings=("a",), image_changed_percent=0.0, line_per_texel_percent=None,
        loads=[2.0], recorded=dark, predicted=dark,
    )  # fmt: skip
    draw_hold_out(held, TexelArray.grid(2, 3, 1e-3), tmp_path / "x.png")
    images = [axes.images[0] for axes in saved["png"].axes if axes.images]
    assert [image.get_clim() for image in images] == [(0, 1), (0, 1), (-1, 1)]


@pytest.mark.parametrize(("rows", "labels"), [(1, ("texel", "")), (2, ("column", "row"))])
def test_texels_in_one_row_are_high_enough_to_be_seen(rows, labels):
    """To scale the image of 60 texels would be a line."""
    from matplotlib.figure import Figure

    axes = Figure(figsize=(6, 4)).add_subplot()
    draw_texels(axes, TexelArray.grid(rows, 60, 2e-3), np.arange(60.0 * rows), Scale(peak=60.0))
    axes.apply_aspect()
    box = axes.get_window_extent()
    assert (box.height > 0.5 * box.width) == (rows == 1)
    assert (axes.get_xlabel(), axes.get_ylabel()) == labels
    assert len(axes.get_yticks()) == (0 if rows == 1 else rows)


@pytest.mark.parametrize("difference", [False, True])
def test_texels_off_a_grid_are_drawn_where_they_are(difference):
    """Three texels of a plane in an angle, in mm about the middle one, which stands first in the list."""
    from matplotlib.figure import Figure

    grid = TexelArray.grid(1, 3, 2e-3, active=[True, True, False])
    places = np.array([[0, 0, 0], [3e-3, 1e-3, 0], [-1e-3, 4e-3, 0]])
    array = dataclasses.replace(grid, centres=places)
    axes = Figure().add_subplot()
    drawn = draw_texels(axes, array, np.array([0.5, -0.2, 9.0]), Scale(peak=0.5, difference=difference))
    middles = np.array([path.vertices[:4].mean(axis=0) for path in drawn.get_paths()])
    np.testing.assert_allclose(middles - middles[0], 1e3 * places[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.ma.filled(drawn.get_array(), np.nan), [500, -200, np.nan])
    assert drawn.get_clim() == (-500 if difference else 0, 500)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("unrolled x [mm]", "unrolled y [mm]")


def test_labels_of_iso_lines_stand_on_their_lines_and_inside_the_axes():
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    x, y = np.linspace(1, 5, 5), np.linspace(2, 4, 3)
    height = x * (5 - y)[:, None]
    lines = axes.contour(x, y, height, levels=[1.05, 4, 8, 14.9])  # the first and the last only cut a corner
    label_lines(axes, lines, fmt="%g")
    labels = {float(each.get_text()): each.get_position() for each in lines.labelTexts}
    assert set(labels) == {4, 8}
    for level, (across, up) in labels.items():
        assert 1.2 <= across <= 4.8
        assert 2.1 <= up <= 3.9
        assert across * (5 - up) == pytest.approx(level, rel=0.03)


def test_pictures_and_pages_write_micrometres_with_their_letter(tmp_path):
    assert (
        spell_units("place [um], 169 um, (1 to 2) um, 3 umbrellas of um")
        == "place [\u00b5m], 169 \u00b5m, (1 to 2) \u00b5m, 3 umbrellas of um"
    )
    with open_figure(tmp_path / "map.svg", height=2, width=2) as figure:
        figure.add_subplot().set_title("error of place [um]")
    assert "error of place [\u00b5m]" in (tmp_path / "map.svg").read_text()
