"""Solid covers of several layers against flat covers, exact layers on a sphere, and the same cover as one layer."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fem_reference import press
from meshes import Box, Cover, Layer, Material, Sphere, TexelArray
from meshes.pose import Pose
from meshes.solids import flat_pad, sweep
from meshes.solids.covers import take_meshes
from meshes.solids.swept import join_grids
from tests.exact.sphere import SphereLayers
from tests.exact.sphere_contact import press_ball

SIZE = (10e-3, 10e-3)
PAD = flat_pad(size=SIZE, rows=2)
CORE, THICKNESS = 6e-3, 2e-3
BALL = Sphere(radius=4e-3)


def elastic(modulus, ratio):
    return Material(
        name=f"{modulus:g} Pa", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
    )


SOFT = elastic(1e6, 0.49)


def stack(*layers):
    return tuple(Layer(thickness=thickness, material=material) for thickness, material in layers)


def solid_pad(layers, pad=PAD):
    thicknesses = tuple(layer.thickness for layer in layers)
    return take_meshes(pad.divide(thicknesses).meshes(1.3), layers)


@pytest.mark.bench  # the slow tests have two layers on a sphere
@pytest.mark.slow
@pytest.mark.parametrize(
    ("layers", "indenter"),
    [
        (stack((1.5e-3, elastic(4e6, 0.45)), (0.5e-3, SOFT)), Box(size=(3e-3, 3e-3, 5e-3))),
        (stack((1.95e-3, SOFT), (0.05e-3, elastic(3e9, 0.38))), BALL),
    ],
)
def test_a_layered_pad_is_the_flat_cover_of_the_same_layers(layers, indenter):
    pose = Pose.facing([0.3e-3, 0.2e-3, 5e-3], [0, 0, -1])
    found = press(solid_pad(layers), PAD.texels, indenter, pose, load=0.5)
    known = press(Cover(layers=layers, size=SIZE), PAD.texels, indenter, pose, load=0.5)
    error = {name: found.error_estimate[name] + known.error_estimate[name] for name in ("depth", "peak_texel")}
    assert found.depth == pytest.approx(known.depth, rel=min(error["depth"], 0.003))
    peak = np.abs(known.texel_forces).max()
    np.testing.assert_allclose(found.texel_forces, known.texel_forces, atol=min(error["peak_texel"], 0.005) * peak)


def sphere_mesh(size, layers, interface):
    """Mesh a cube-like part of a spherical cover around the z axis, with an interface at a height over thickness."""
    turn = np.linspace(-1.0, 1.0, 2 * int(np.ceil(2 * CORE / (size * THICKNESS))) + 1)
    first, second = np.meshgrid(np.tan(turn), np.tan(turn))
    out = np.stack([first, second, np.ones_like(first)], axis=-1)
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    return sweep(join_grids([(CORE * out, out)], "sphere", {}), THICKNESS, layers=layers, interfaces=[interface])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("interface", "skin", "radius", "depth"),
    [(0.7, elastic(0.3e6, 0.49), 8e-3, 0.1e-3)],
)
def test_a_ball_on_two_layers_on_a_sphere_meets_the_exact_contact(interface, skin, radius, depth):
    known = press_ball(
        SphereLayers(
            core_radius=CORE, thickness=THICKNESS, material=skin, below=SOFT, interface=CORE + interface * THICKNESS
        ),
        radius,
        depth,
    )
    meshes = [sphere_mesh(size, layers, interface) for size, layers in ((0.48, 3), (0.38, 3), (0.3, 4))]
    cover = take_meshes(meshes, stack((interface, SOFT), (1 - interface, skin)))
    array = dataclasses.replace(TexelArray.grid(1, 1, 2e-3, name="pole"), centres=np.array([[0.0, 0.0, CORE]]))
    out = np.array([0.2, 0.1, 1.0]) / np.sqrt(1.05)
    found = press(cover, array, Sphere(radius=radius), Pose.facing(20e-3 * out, -out), depth=depth)
    for name, exact, limit in (("total_force", known.force, 0.01), ("contact_area", known.area, 0.015)):
        error = abs(getattr(found, name) / exact - 1)
        assert error < limit
        assert error < found.error_estimate[name] + 0.003  # of the rings
