"""Solid elements of curved covers against the closed forms of layers on a cylinder and on a sphere."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.closed_form.cylinder import CylinderLayer
from fem_reference.curved_cover import texel_responses
from fem_reference.curved_cover.responses import build_solid
from meshes import Material, TexelArray
from meshes.solids import sweep
from meshes.solids.swept import join_grids
from tests.exact.sphere import CapLoad, SphereLayer

THICKNESS = 2e-3
PRESSURE = 1e4


@pytest.fixture(autouse=True)
def forget_solids():
    """Release the factorisations of large meshes, of which three would otherwise take 10 GB."""
    yield
    build_solid.cache_clear()


def rubber(poisson_ratio):
    return Material(
        name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=poisson_ratio
    )


def texels_of(centres, normals, size):
    return TexelArray(
        centres=centres,
        normals=normals,
        texel_size=size,
        pitch=size,
        rows=1,
        columns=len(centres),
        active=np.ones(len(centres), dtype=bool),
    )


def mesh_tube(radius, *, elements, layers, length=24e-3):
    """A long piece of a layer on a cylinder about y, closed where its circumference is less than 52 mm."""
    angle = min(2 * np.pi, 40e-3 / radius)
    turn = np.linspace(-angle / 2, angle / 2, 2 * int(np.ceil(angle * radius / elements)) + 1)
    y = np.linspace(-length / 2, length / 2, 25)
    around, along = np.meshgrid(turn, y)
    normals = np.stack([np.sin(around), 0 * around, np.cos(around)], axis=-1)
    points = radius * normals + along[..., None] * np.array([0, 1.0, 0])
    return sweep(join_grids([(points, normals)], "tube"), THICKNESS, layers=layers)


def solve_tube(ratio, poisson_ratio, *, elements=0.8e-3, layers=5):
    """Texel forces by elements and by the closed form, and the load, per length of tube [N/m]."""
    radius = THICKNESS / ratio
    half_width = 2.5e-3 / (radius + THICKNESS)
    pitch = 2e-3 / radius
    at = np.arange(-3, 4) * pitch
    at = at[np.abs(at) < np.pi - pitch]
    normals = np.stack([np.sin(at), 0 * at, np.cos(at)], axis=1)
    size = (2 * radius * np.sin(0.4 * pitch), 2e-3)
    mesh = mesh_tube(radius, elements=elements, layers=layers)
    response = texel_responses([mesh], texels_of(radius * normals, normals, size), rubber(poisson_ratio))

    def profile(angle):
        return PRESSURE * np.cos(np.pi / 2 * np.minimum(np.abs(angle) / half_width, 1)) ** 2

    top = response.finest.top.nodes
    found = response.under_pressure(profile(np.arctan2(top[:, 0], top[:, 2]))) / size[1]
    layer = CylinderLayer(core_radius=radius, thickness=THICKNESS, material=rubber(poisson_ratio))
    expected = layer.press(np.stack([at - 0.4 * pitch, at + 0.4 * pitch], axis=1), profile, half_width)
    return found, expected, PRESSURE * half_width * (radius + THICKNESS)


def mesh_sphere(radius, *, elements=0.8e-3, layers=5, half_angle=np.pi / 4):
    """A layer on a whole sphere, whose faces are those of a cube, or on a smaller upper face only (a cap)."""
    cap = half_angle < np.pi / 4
    count = 2 * int(np.ceil(2 * half_angle * radius / elements / 2)) * 2 + 1
    u, v = np.meshgrid(*[np.tan(np.linspace(-half_angle, half_angle, count))] * 2)
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            if cap and (axis, sign) != (2, 1.0):
                continue
            out = np.empty((*u.shape, 3))
            out[..., axis], out[..., (axis + 1) % 3], out[..., (axis + 2) % 3] = sign, u, v
            out /= np.linalg.norm(out, axis=-1, keepdims=True)
            faces.append((radius * out, out))
    return sweep(join_grids(faces, "sphere"), THICKNESS, layers=layers)


def solve_sphere(ratio, poisson_ratio):
    """Texel forces by elements and by the closed form, and the load [N].

    The thinnest layer is meshed on a cap only, whose edge is five thicknesses away from the load.
    """
    radius = THICKNESS / ratio
    mesh = mesh_sphere(radius, half_angle=np.pi / 5, layers=4) if ratio < 0.2 else mesh_sphere(radius)
    half_angle = 2.5e-3 / (radius + THICKNESS)
    at = np.array([0.0, 1.0, 2.0, 3.5]) * 2e-3 / radius
    normals = np.stack([np.sin(at), 0 * at, np.cos(at)], axis=1)
    size = (1.8e-3, 1.8e-3)
    response = texel_responses(
        [mesh],
        texels_of(radius * normals, normals, size),
        rubber(poisson_ratio),
    )

    def profile(angle):
        return PRESSURE * np.cos(np.pi / 2 * np.minimum(np.abs(angle) / half_angle, 1)) ** 2

    top = response.finest.top
    found = response.under_pressure(profile(np.arccos(np.clip(top.nodes[:, 2] / (radius + THICKNESS), -1, 1))))
    layer = SphereLayer(core_radius=radius, thickness=THICKNESS, material=rubber(poisson_ratio))
    solved = layer.respond(CapLoad(pressure=profile, half_angle=half_angle))
    points, weights = np.polynomial.legendre.leggauss(12)
    x, y = (each.ravel() * size[0] / 2 for each in np.meshgrid(points, points))
    z = np.sqrt(radius**2 - x**2 - y**2)
    expected = []
    for normal in normals:
        across = np.array([normal[2], 0, -normal[0]])
        place = (np.outer(x, across) + np.outer(y, [0, 1.0, 0]) + np.outer(z, normal)) / radius
        area = np.outer(weights, weights).ravel() * size[0] * size[1] / 4 * radius / z
        expected.append(-area @ solved.base_traction(place) @ normal)
    return found, np.array(expected), np.linalg.norm(solved.load_force)


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "poisson_ratio"), [(0.1, 0.5), (0.5, 0.3)])
def test_texels_on_a_cylinder_agree_with_the_closed_form(ratio, poisson_ratio):
    found, expected, load = solve_tube(ratio, poisson_ratio)
    assert np.abs(found - expected).max() < 0.005 * load
    assert expected.max() > 0.2 * load


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "poisson_ratio"), [pytest.param(0.1, 0.3, marks=pytest.mark.bench), (0.5, 0.5)])
def test_texels_on_a_sphere_agree_with_the_closed_form(ratio, poisson_ratio):
    found, expected, load = solve_sphere(ratio, poisson_ratio)
    assert np.abs(found - expected).max() < 0.005 * load
    assert expected.max() > 0.05 * load
