"""The picture of one indentation: the images that it holds, and the depth profile."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest

import fastmodel
from fem_reference.fields.cover_fields import CoverFields
from meshes import Sphere
from tests.support.indentations import make_indentation
from validation.campaign.case import Case
from validation.campaign.comparison import Comparison
from validation.press_files import find_profile, list_images, write_picture, write_press
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
    panels = [axes for axes in figure.axes if axes.images]
    bars = [axes for axes in figure.axes if axes.get_xlabel() == "mN"]
    assert (len(panels), len(bars)) == (3, 3)
    for axes, (title, forces) in zip(panels, list_images(comparison), strict=True):
        (image,) = axes.images
        np.testing.assert_allclose(image.get_array(), 1e3 * forces.reshape(14, 6), atol=1e-12)
        assert image.origin == "lower"
        signed = title == "difference"
        top = 1e3 * (np.abs(forces).max() if signed else 83 / 840)
        assert image.get_clim() == pytest.approx((-top if signed else 0, top))
        assert axes.get_title() == ("fast - finite elements" if signed else title)
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("column", "row")
        assert axes.get_aspect() == 1
    first, force = figure.get_suptitle().splitlines()
    assert first == "sphere:radius=5mm on wts-0614-34"
    assert force.startswith("4.1500 N: 4.1500 N on the texels")
    profile = figure.axes[3]
    surface, depth, rest = profile.lines
    x, z = surface.get_data()
    extent = 4 * np.sqrt(8 / np.pi)  # four radii of contact [mm]
    assert extent - 1 < x[-1] <= extent
    assert x[0] == -x[-1]
    np.testing.assert_allclose(z, -0.3 * np.exp(-(x**2) / 4), atol=1e-9)
    assert (set(depth.get_ydata()), set(rest.get_ydata())) == ({-0.3}, {0.0})
    legend = [text.get_text() for text in profile.get_legend().texts]
    assert legend == ["surface of the cover", "depth 0.3 mm"]
    labels = ["along the indenter's x axis [mm]", "height above rest [mm]", "depth profile"]
    assert [profile.get_xlabel(), profile.get_ylabel(), profile.get_title()] == labels


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
