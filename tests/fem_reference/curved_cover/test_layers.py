"""Solid covers of several layers on small meshes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fastmodel.contact.points import press_points
from fem_reference import press
from fem_reference.curved_cover import texel_responses
from fem_reference.errors import UnsupportedError
from meshes import Layer, Material, Sphere
from meshes.pose import Pose
from meshes.solids import phalanx, read_mesh, write_mesh
from meshes.solids.covers import make_swept_cover, take_meshes
from meshes.solids.solid_mesh import assign_layers
from validation.derivation.cover_points import derive_points
from validation.errors import InputError
from validation.sensor_file import load

COVER = phalanx(angle=1.6, length=8e-3, rows=3, columns=3)
BALL, ABOVE = Sphere(radius=5e-3), Pose.facing([0.2e-3, 0.3e-3, 14e-3], [0.1, 0, -1])


def elastic(modulus, ratio=0.49):
    return Material(
        name=f"{modulus:g} Pa", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
    )


def stack(*layers):
    return tuple(Layer(thickness=thickness, material=elastic(modulus)) for thickness, modulus in layers)


MESH = COVER.divide([1.7e-3, 0.3e-3]).mesh(1.6e-3, layers=3)


@pytest.mark.slow
def test_two_equal_layers_are_one():
    one, two = (
        texel_responses([MESH], COVER.texels, layers).finest.influence
        for layers in (elastic(1e6), stack((1.7e-3, 1e6), (0.3e-3, 1e6)))
    )
    np.testing.assert_allclose(one, two, atol=1e-12)
    presses = [
        press(take_meshes([MESH], layers), COVER.texels, BALL, ABOVE, load=0.3)
        for layers in (elastic(1e6), stack((1.7e-3, 1e6), (0.3e-3, 1e6)))
    ]
    assert presses[1].depth == pytest.approx(presses[0].depth, rel=1e-4)


@pytest.mark.slow
def test_a_stiff_skin_spreads_the_load():
    soft, skin = (
        press(take_meshes([MESH], stack((1.7e-3, 1e6), (0.3e-3, modulus))), COVER.texels, BALL, ABOVE, load=0.3)
        for modulus in (1e6, 20e6)
    )
    peaks = [each.texel_forces.max() / each.texel_forces.sum() for each in (soft, skin)]
    assert peaks[1] < 0.98 * peaks[0]
    assert skin.depth < 0.9 * soft.depth


@pytest.mark.slow
def test_friction_stiffens_a_layered_cover():
    cover = take_meshes([MESH], stack((1.7e-3, 1e6), (0.3e-3, 5e6)))
    smooth, rubbed = (
        press(cover, COVER.texels, BALL, ABOVE, depth=0.1e-3, friction=friction).total_force for friction in (0, 0.2)
    )
    assert smooth < rubbed < 1.1 * smooth


@pytest.mark.parametrize(
    "modulus", [pytest.param(0.2e6, marks=pytest.mark.slow), pytest.param(20e6, marks=pytest.mark.slow)]
)
def test_the_fast_model_is_the_reference_on_the_same_mesh(modulus):
    layers = stack((1.7e-3, 1e6), (0.3e-3, modulus))
    known = press(take_meshes([MESH], layers), COVER.texels, BALL, ABOVE, load=0.3)
    found = press_points(derive_points(MESH, COVER.texels, layers), BALL, ABOVE, load=0.3)
    assert np.abs(found.texel_forces - known.texel_forces).sum() < 2 * 0.015 * 0.3
    assert found.depth == pytest.approx(known.depth, rel=0.1)


def test_layers_without_edges_of_elements_between_them_are_refused(tmp_path):
    two = stack((1.7e-3, 1e6), (0.3e-3, 20e6))
    np.testing.assert_array_equal(np.bincount(assign_layers(MESH, two)), len(MESH.base) * np.array([3, 2]))
    tetrahedron = dataclasses.replace(
        MESH, cells=MESH.cells[:, :10], **{name: getattr(MESH, name)[:, :6] for name in ("base", "top", "left_out")}
    )
    for mesh, layers, fault in (
        (MESH, stack((1.5e-3, 1e6), (0.5e-3, 2e6)), "no edges of elements lie at 75 % of the thickness"),
        (tetrahedron, two, "it has one layer, not 2: several layers need a mesh of hexahedra"),
        (MESH, stack((1.97e-3, 1e6), (0.03e-3, 2e9)), "thinner than 2.4 % of the cover"),
    ):
        with pytest.raises(ValueError, match=fault):
            take_meshes([mesh], layers)
    foil = dataclasses.replace(make_swept_cover(COVER, elastic(1e6), "foil"), layers=stack((1.95e-3, 1e6), (5e-5, 1e9)))
    with pytest.raises(UnsupportedError, match=r"thinner than 4.5 % .* write --strain small"):
        press(foil, COVER.texels, BALL, ABOVE, load=0.3, strain="finite")
    write_mesh(tmp_path / "mesh.npz", MESH)
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,6\n", encoding="utf-8")
    text = (
        '[array]\npositions = "texels.csv"\nunit = "mm"\nproject = true\ntexel_size = "2 mm"\n'
        '[cover]\nmesh = "mesh.npz"\nlayer = [{thickness = "1.7 mm", material = "dragon-skin-30"}, '
        '{thickness = "0.3 mm", material = "pet"}]\n'
    )
    path = tmp_path / "sensor.toml"
    path.write_text(text, encoding="utf-8")
    cover = load(path).cover
    assert (cover.thicknesses, read_mesh(tmp_path / "mesh.npz").digest) == ((1.7e-3, 0.3e-3), cover.meshes()[0].digest)
    for old, new, fault in (
        ("1.7 mm", "1 mm", "cover: layer: the thicknesses do not sum to 2 mm"),
        (
            'mesh = "mesh.npz"',
            'surface = "a.stl"\nthickness = "2 mm"\nunit = "mm"',
            "layer: replaces material, and needs",
        ),
    ):
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError, match=fault):
            load(path)


def test_a_layer_is_added_on_top_of_a_built_in_cover():
    cover = load("fingertip", layers=["2:thickness=0.2mm,material=pet"]).cover
    assert [each.material.name for each in cover.layers][1] == "pet"
    assert cover.thickness == pytest.approx(2.2e-3)
    with pytest.raises(InputError, match="a new one on top needs thickness and material"):
        load("fingertip", layers=["2:thickness=0.2mm"])
