"""The picture of one indentation: the images that it holds, and the depth profile."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest

import fastmodel
from fem_reference.fields.cover_fields import CoverFields
from meshes import Cover, Layer, Sphere
from meshes.catalogue import MATERIALS
from tests.support.indentations import make_indentation
from validation.campaign.case import Case
from validation.campaign.comparison import Comparison
from validation.press_files import write_press
from validation.press_picture import find_profile, list_images, write_picture
from validation.sensor_file import BUILT_IN

SENSOR = BUILT_IN["wts-0614-34"]


def make_fields(*, axisymmetric):
    """Nodes of a slab of 2 mm whose surface sinks by 0.3 mm exp(-(r/2 mm)^2)."""
    x = np.linspace(0, 8e-3, 9) if axisymmetric else np.linspace(-8e-3, 8e-3, 17)
    y = np.zeros(1) if axisymmetric else np.linspace(-8e-3, 8e-3, 17)
    grid = np.stack(np.meshgrid(x, y, [0, 2e-3], indexing="ij"), axis=-1).reshape(-1, 3)
    sunk = -0.3e-3 * np.exp(-(grid[:, :2] ** 2).sum(axis=1) / 4e-6) * grid[:, 2] / 2e-3
    cells = 2 * np.arange(8)[:, None] + [0, 2, 3, 1] if axisymmetric else np.zeros((0, 8), dtype=int)
    return CoverFields(
        position=grid,
        displacement=np.stack([np.zeros(len(grid)), np.zeros(len(grid)), sunk], axis=1),
        stress=np.zeros((len(grid), 3, 3)),
        cells=cells,
        layer=np.zeros(len(cells), dtype=int),
        axisymmetric=axisymmetric,
    )


@pytest.fixture
def comparison():
    forces = np.arange(84) / 840
    fem = make_indentation(
        forces,
        fields=make_fields(axisymmetric=True),
        error_estimate={"total_force": 0.0, "peak_texel": 0.02},
        contact_points=np.array([[0.0, 0.0, 2e-3]]),
        contact_forces=np.array([[0.0, 0.0, -4.0]]),
    )
    fast = fastmodel.FastIndentation(
        texel_forces=forces[::-1].copy(), contact_forces=forces, outside=0.0, total_force=float(forces.sum()),
        chatter=0.0, method="cover", depth=0.3e-3, fewest_cells=None, warnings=(), seconds=0.1,
    )  # fmt: skip
    case = Case(name="press", indenter=Sphere(radius=5e-3), shape="sphere:radius=5mm", load=4.0)
    return Comparison(
        sensor=SENSOR, case=case, fem=fem, fast=fast, score=None, models=("fem", "fast"), wanted={"load": 4.0}
    )


@pytest.mark.parametrize("axisymmetric", [True, False])
def test_the_profile_is_the_sunk_surface_along_x(axisymmetric):
    distance, height = find_profile(make_fields(axisymmetric=axisymmetric), (0.0, 0.0), 0.0)
    assert (np.diff(distance) >= 0).all()
    assert (distance[0], distance[-1]) == pytest.approx((-8e-3, 8e-3))
    np.testing.assert_allclose(height, -0.3e-3 * np.exp(-(distance**2) / 4e-6), atol=1e-12)


def test_the_profile_turns_with_the_indenter():
    fields = make_fields(axisymmetric=False)
    slope = dataclasses.replace(fields, displacement=fields.position * [0, 0, 1] * fields.position[:, 1:2])
    distance, height = find_profile(slope, (0.0, 0.0), np.pi / 2)
    np.testing.assert_allclose(height, 2e-3 * distance, atol=1e-12)


def test_images_are_both_models_and_their_difference(comparison):
    images = dict(list_images(comparison))
    assert list(images) == ["finite elements", "fast model", "difference"]
    np.testing.assert_array_equal(images["difference"], images["fast model"] - images["finite elements"])
    alone = dataclasses.replace(comparison, fast=None)
    assert [title for title, _ in list_images(alone)] == ["finite elements"]


def test_images_have_row_0_at_the_bottom_and_models_one_scale(comparison, tmp_path, monkeypatch):
    saved = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: saved.append(figure))
    write_picture(comparison, tmp_path)
    figure = saved[0]
    above, below = figure.subfigs
    panels = [axes for axes in above.axes if axes.images]
    for axes, (title, forces) in zip(panels, list_images(comparison), strict=True):
        (image,) = axes.images
        np.testing.assert_allclose(image.get_array(), 1e3 * forces.reshape(14, 6), atol=1e-12)
        assert image.origin == "lower"
        signed = title == "difference"
        top = 1e3 * (np.abs(forces).max() if signed else 83 / 840)
        assert image.get_clim() == pytest.approx((-top if signed else 0, top))
        assert axes.get_aspect() == 1
        for ticks, count in ((axes.get_xticks(), 6), (axes.get_yticks(), 14)):
            assert set(ticks) <= set(range(count))
    assert "sphere:" not in figure.get_suptitle()
    assert "ball, radius 5 mm" in figure.get_suptitle().lower()
    assert "4.1500 N on the texels" in figure.get_suptitle()
    (section,) = below.axes
    layer, indenter = section.collections[0].get_paths()[0].vertices, section.patches[0].get_xy()
    upper = layer[(layer[:, 1] > 1) & (np.abs(layer[:, 0]) < 8)]
    np.testing.assert_allclose(upper[:, 1], 2 - 0.3 * np.exp(-(upper[:, 0] ** 2) / 4), atol=0.02)
    assert layer[:, 1].min() == 0
    assert indenter[:, 1].min() == pytest.approx(2 - 0.3)  # its lowest point, at the depth
    side = indenter[np.argmin(np.abs(indenter[:, 0] - 3) + indenter[:, 1])]
    assert side[1] == pytest.approx(1.7 + 5 - np.sqrt(25 - side[0] ** 2), abs=1e-6)
    named = [text.get_text() for text in section.get_legend().texts]
    assert {"indenter", "bonded base", "assumed elastomer, 2 mm"} <= set(named)


def test_a_section_names_every_layer_and_places_it(comparison, tmp_path, monkeypatch):
    """Without fields the cover is flat and the indenter touches it; the layers have their own thicknesses."""
    saved = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: saved.append(figure))
    stiff = Layer(material=MATERIALS["pet"], thickness=0.25e-3)
    soft = Layer(material=MATERIALS["ecoflex-00-30"], thickness=3e-3)
    sensor = dataclasses.replace(SENSOR, cover=Cover(layers=(stiff, soft)))
    fem = dataclasses.replace(comparison.fem, fields=None)
    write_picture(dataclasses.replace(comparison, sensor=sensor, fem=fem), tmp_path)
    (section,) = saved[0].subfigs[1].axes
    ends = [np.unique(each.get_paths()[0].vertices[:, 1].round(9)).tolist() for each in section.collections]
    assert ends == [[0, 0.25], [0.25, 3.25]]
    assert section.patches[0].get_xy()[:, 1].min() == pytest.approx(3.25)
    named = [text.get_text() for text in section.get_legend().texts]
    assert {"pet, 0.25 mm", "ecoflex-00-30, 3 mm"} <= set(named)


@pytest.mark.slow
def test_files_without_pyvista_or_matplotlib_lack_their_pictures_and_name_the_extras(
    comparison, tmp_path, monkeypatch, caplog
):
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pyvista", None)
        files = write_press(comparison, tmp_path)
    assert files == ("press.json", "texels.csv", "contact.csv", "fields.npz", "press.png")
    assert (tmp_path / "press.png").read_bytes().startswith(b"\x89PNG")
    assert ".[view]" in caplog.text
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert write_picture(comparison, tmp_path) == ()
    assert ".[report]" in caplog.text


def test_pulled_texels_have_a_colour_that_the_legend_names(comparison, tmp_path, monkeypatch):
    saved = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: saved.append(figure))
    forces = comparison.fem.texel_forces.copy()
    forces[:2] = -0.02 * forces.max(), -0.005 * forces.max()
    fem = dataclasses.replace(comparison.fem, texel_forces=forces)
    write_picture(dataclasses.replace(comparison, fem=fem), tmp_path)
    above = saved[0].subfigs[0]
    (image,) = above.axes[0].images
    pulled, slightly, most = image.to_rgba(image.get_array()).reshape(84, 4)[[0, 1, 83]]
    assert pulled[0] > 2 * pulled[1]  # red
    np.testing.assert_allclose(slightly, image.cmap(0.0))
    np.testing.assert_allclose(most, image.cmap(1.0))
    labels = [axes.get_ylabel() for axes in above.axes]
    assert "force on the texel [mN]\nred: pulled, below zero" in labels
