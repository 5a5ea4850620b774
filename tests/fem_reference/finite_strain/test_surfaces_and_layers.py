"""Closed forms of indenter surfaces, layers of different rubber, and contact points with friction."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import skfem

from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain.contact import collect_points
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import STEEPEST, IndenterSurface
from fem_reference.finite_strain.loading_path import Units
from meshes import Box, Cover, Layer, Material, Roller, Sphere
from meshes.pose import Pose

POSE = Pose.planar(at=(0.6e-3, -0.4e-3), yaw=0.7)
UNIT = 2e-3


def turn(pose):
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    return np.array([[c, -s], [s, c]])


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_a_ball_has_the_height_slope_and_curvature_of_its_circle(scale):
    """z = R - sqrt(R^2 - r^2) around the place of the ball, in units of the thickness."""
    surface = IndenterSurface(indenter=Sphere(radius=3e-3), fillet=0.2, unit=UNIT, load_scale=scale, pose=POSE)
    points = np.random.default_rng(2).uniform(-0.6, 0.6, (2, 5))
    away, radius = points - np.array(POSE.at)[:, None] / UNIT, 1.5
    root = np.sqrt(radius**2 - (away**2).sum(axis=0))
    found = surface.evaluate(*points)
    assert found.height == pytest.approx(scale * (radius - root))
    assert found.slope == pytest.approx(scale * (away / root).T, rel=1e-4, abs=scale * 1e-5)
    bend = np.eye(2) / root[:, None, None] + np.einsum("in,jn->nij", away, away) / root[:, None, None] ** 3
    np.testing.assert_allclose(found.curvature, scale * bend, rtol=1e-3, atol=scale * 1e-4)


def test_beyond_its_rim_a_ball_goes_on_as_a_cone():
    surface = IndenterSurface(indenter=Sphere(radius=UNIT), fillet=0.2, unit=UNIT)
    rim = np.sin(np.arctan(STEEPEST))
    r = np.array([0.5 * rim, rim, rim + 0.3, 3.0])
    angle = np.array([0.0, 1.0, 2.0, -2.5])
    exact = np.where(
        r > rim, 1 - np.cos(np.arctan(STEEPEST)) + STEEPEST * (r - rim), 1 - np.sqrt(1 - np.minimum(r, rim) ** 2)
    )
    assert surface.height(r * np.cos(angle), r * np.sin(angle)) == pytest.approx(exact)


def edge_height(beyond, radius):
    """The curvature grows evenly to 1 / radius over half a radius, up to the steepest slope."""
    x = np.linspace(0, beyond, 20001)
    slope = np.minimum(np.where(x < radius / 2, x**2 / radius**2, 0.25 + (x - radius / 2) / radius), STEEPEST)
    return np.trapezoid(slope, x)


@pytest.mark.parametrize("beyond", [-0.1, 0.02, 0.1, 0.25, 0.5, 0.9])
def test_the_edge_of_a_face_is_rounded_by_its_fillet(beyond):
    """Across an edge and across a corner, in the frame of a box that is turned and moved."""
    fillet, half = 0.2, np.array([0.9, 0.6])
    box = Box(size=(2 * half[0] * UNIT, 2 * half[1] * UNIT, 1e-3))
    surface = IndenterSurface(indenter=box, fillet=fillet, unit=UNIT, pose=POSE)
    inner = half - fillet
    local = np.array(
        [[inner[0] + beyond, 0.1], [-0.2, -inner[1] - beyond], -(inner + max(beyond, 0.0) * np.array([0.6, 0.8]))]
    )
    places = local @ turn(POSE).T + np.array(POSE.at) / UNIT
    expected = edge_height(max(beyond, 0.0), fillet)
    assert surface.height(*places.T) == pytest.approx(expected, abs=1e-6)
    if beyond == 0.5:
        # Around the corner the height depends on the distance d alone: curvature h'' along it and h' / d across.
        found = surface.evaluate(*places[2:].T)
        along, across = turn(POSE) @ [-0.6, -0.8], turn(POSE) @ [0.8, -0.6]
        slope = 0.25 + (beyond - fillet / 2) / fillet
        assert found.slope[0] == pytest.approx(slope * along, rel=1e-3)
        bend = np.outer(along, along) / fillet + slope / beyond * np.outer(across, across)
        assert found.curvature[0] == pytest.approx(bend, abs=2e-3)


def test_a_roller_is_a_smoothed_circle_along_a_line():
    surface = IndenterSurface(indenter=Roller(radius=2 * UNIT, length=4 * UNIT), fillet=0.05, unit=UNIT)
    for x, y in ((0.0, 0.0), (0.5, 0.3), (-0.4, 1.0), (1.2, -0.8)):
        heights = [surface.height(np.array([a]), np.array([b]))[0] for a, b in ((x, y), (y, x))]
        exact = 2 - np.sqrt(4 - np.array([x, y]) ** 2)
        assert min(np.abs(np.array(heights) - exact).max(), np.abs(np.array(heights) - exact[::-1]).max()) < 2e-3


RUBBERS = (
    Material(name="a", model="neo-hookean", parameters={"shear_modulus": 0.4e6}, poisson_ratio=0.45),
    Material(name="b", model="linear-elastic", parameters={"youngs_modulus": 2e6}, poisson_ratio=0.3),
    Material(name="c", model="mooney-rivlin", parameters={"c10": 0.3e6, "c01": 0.2e6}, poisson_ratio=0.49),
)


@pytest.fixture(scope="module")
def layers():
    """Three layers of one element each, with a part of the bulk modulus on the displacements."""
    heights = np.array([0.0, 0.3, 0.6, 1.0])
    mesh = skfem.MeshHex.init_tensor(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0]), heights)
    region = np.searchsorted(heights, mesh.p[2][mesh.t].mean(axis=0)) - 1
    cover = Cover(
        layers=tuple(
            Layer(thickness=each * UNIT, material=rubber)
            for each, rubber in zip(np.diff(heights), RUBBERS, strict=True)
        )
    )
    elements = prepare_elements(mesh, region=region)
    return [Solid.from_cover(elements, cover, Units.of(cover), direct=direct) for direct in (0.0, 3.0)], cover


@pytest.mark.parametrize("which", [0, 1])
def test_force_and_tangent_of_layers_are_derivatives_of_their_energy(layers, which):
    solid = layers[0][which]
    rng, size = np.random.default_rng(1), solid.elements.displacements + solid.elements.pressures
    state, way, step = 0.02 * rng.standard_normal(size), rng.standard_normal(size), 1e-6
    force, tangent = solid.linearise(state)
    ahead, behind = state + step * way, state - step * way
    assert (solid.energy(ahead) - solid.energy(behind)) / (2 * step) == pytest.approx(force @ way, rel=1e-6)
    change = (solid.linearise(ahead)[0] - solid.linearise(behind)[0]) / (2 * step)
    np.testing.assert_allclose(tangent @ way, change, atol=1e-6 * np.abs(change).max())


def test_layers_store_the_energy_of_their_own_rubber_under_an_even_stretch(layers):
    """W of each layer by its invariants; pressures in equilibrium with the volume change."""
    (plain, direct), cover = layers
    e = plain.elements
    stretch = np.array([1.1, 0.95, 0.97])
    volume, unit = stretch.prod(), Units.of(cover).stress
    first = (stretch**2).sum() * volume ** (-2 / 3)
    second = (stretch**-2).sum() * volume ** (2 / 3)
    exact, stresses = 0.0, []
    for height, rubber in zip((0.3, 0.3, 0.4), RUBBERS, strict=True):
        shear, bulk = rubber.shear_modulus / unit, rubber.bulk_modulus / unit
        c10, c01 = (0.3e6 / unit, 0.2e6 / unit) if rubber.name == "c" else (shear / 2, 0.0)
        exact += height * (c10 * (first - 3) + c01 * (second - 3) + bulk / 2 * (volume - 1) ** 2)
        left = stretch**2 * volume ** (-2 / 3)
        along = 2 * c10 * (left - left.mean()) - 2 * c01 * (1 / left - (1 / left).mean())
        stresses.append(along / volume + bulk * (volume - 1))
    for solid, share in ((plain, 0.0), (direct, 3.0)):
        state = np.zeros(e.displacements + e.pressures)
        state[: e.displacements] = (e.nodes * (stretch - 1)).ravel()
        for index, rubber in enumerate(RUBBERS):
            part = min(share * rubber.shear_modulus, rubber.bulk_modulus / 2)
            rows = np.unique(e.pressure_cells[e.region == index]) + e.displacements
            state[rows] = -(rubber.bulk_modulus - part) / unit * (volume - 1)
        assert solid.energy(state) == pytest.approx(exact, rel=1e-9)
        assert np.abs(solid.linearise(state)[0][e.displacements :]).max() < 1e-12
        found = solid.cauchy_stress(state)
        for index, stress in enumerate(stresses):
            np.testing.assert_allclose(
                found[e.region == index], np.broadcast_to(np.diag(stress), found[e.region == index].shape), atol=1e-9
            )


@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
def test_contact_points_bear_the_forces_of_their_facets_with_the_friction_in_proportion(rubs, dimension):
    """Friction acts on the cover against the traction on the indenter; each facet divides it by the pressing forces."""
    rng = np.random.default_rng(dimension)
    pressure = rng.uniform(0.5, 2, (3, 4)) * (np.arange(4) != 1)
    pressure[2] = 0.0
    weight, position = rng.uniform(0.1, 0.3, (3, 4)), rng.uniform(0, 1, (3, 4, dimension))
    traction = rng.uniform(-0.3, 0.3, (3, 4, dimension)) * (pressure > 0)[..., None] if rubs else None
    contact = SimpleNamespace(pressure=pressure, weight=weight, position=position, traction=traction)
    found = collect_points(contact)
    rows = []
    for facet in range(2):
        own = pressure[facet] * weight[facet]
        whole = (traction[facet] * weight[facet][:, None]).sum(axis=0) if rubs else np.zeros(dimension)
        for point in (0, 2, 3):
            drag = whole * own[point] / own.sum()
            rows.append([*position[facet, point, :-1], own[point] + drag[-1], *-drag[:-1]])
    np.testing.assert_allclose(found, rows, atol=1e-12)
    assert found.shape == (6, 2 * dimension - 1)
