"""Layers on a cylinder and on a sphere under whole loads: balance, limits, symmetry, texel forces."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fem_reference import closed_form
from meshes import Material
from tests.exact.cylinder import ArcLoad, CylinderLayer, LineLoad
from tests.exact.sphere import CapLoad, PointLoad, SphereLayer
from tests.exact.sphere_patch import SpherePatch

RATIOS = [0.0, 0.3, 0.49, 0.5]
CORE = 6e-3
UP = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def cylinder():
    return lambda nu=0.49, thickness=2e-3, core=CORE: CylinderLayer(
        core_radius=core, thickness=thickness, material=rubber(nu)
    )


@pytest.fixture(scope="module")
def sphere():
    return lambda nu=0.49, thickness=2e-3, core=CORE: SphereLayer(
        core_radius=core, thickness=thickness, material=rubber(nu)
    )


def rubber(nu, youngs_modulus=1e6):
    return Material(
        name="test", model="linear-elastic", parameters={"youngs_modulus": youngs_modulus}, poisson_ratio=nu
    )


def hertzian(half_width):
    return lambda angle: 1e4 * np.sqrt(np.maximum(half_width**2 - angle**2, 0))


def gauss(start, end, count=60):
    x, w = np.polynomial.legendre.leggauss(count)
    return (start + end) / 2 + (end - start) / 2 * x, (end - start) / 2 * w


# Cylinder


@pytest.mark.parametrize(("nu", "thickness"), [(0.5, 0.06e-3), (0.0, 0.6e-3), (0.49, 5.4e-3), (0.5, 5.4e-3)])
def test_the_traction_on_a_cylinder_balances_the_load(cylinder, nu, thickness):
    response = cylinder(nu, thickness).respond(
        LineLoad(force=3.0, shear_force=-0.7, angle=0.4),
        ArcLoad(pressure=hertzian(0.2), shear=lambda x: 300 + 50 * x, half_width=0.2, angle=2.0),
    )
    assert response.base_force == pytest.approx(response.load_force, abs=1e-11)
    assert response.base_moment == pytest.approx(response.load_moment, abs=1e-13)
    radius = CORE + thickness
    # The loads themselves, written out: Hertz's pressure holds pi / 2 of peak times half width.
    carried = np.pi / 2 * 1e4 * 0.2**2 * radius
    toward, along = np.array([np.cos(2), np.sin(2)]), np.array([-np.sin(2), np.cos(2)])
    x, w = gauss(-0.2, 0.2)
    dragged = radius * (w @ ((300 + 50 * x) * np.cos(x)) * along - w @ ((300 + 50 * x) * np.sin(x)) * toward)
    line = -3 * np.array([np.cos(0.4), np.sin(0.4)]) - 0.7 * np.array([-np.sin(0.4), np.cos(0.4)])
    t = np.linspace(-np.pi / 2, np.pi / 2, 2001)
    narrowed = np.trapezoid(np.cos(t) ** 2 * np.cos(0.2 * np.sin(t)), t) / (np.pi / 2)
    assert response.load_force == pytest.approx(line + dragged - carried * narrowed * toward, abs=1e-9)
    assert response.load_moment == pytest.approx(radius * (-0.7 + radius * w @ (300 + 50 * x)), rel=1e-12)


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_resultants_are_the_integral_of_the_traction(cylinder, nu):
    response = cylinder(nu).respond(LineLoad(force=1.0, shear_force=0.3, angle=0.1))
    patches = np.array([[-0.2, 0.4], [0.4, 1.5], [3.0, 3.01], [-4.0, -1.0]])
    for patch, found in zip(patches, response.resultants(patches), strict=True):
        at, weight = gauss(*patch, 200)
        out, along = response.base_traction(at).T
        vector = np.stack([out * np.cos(at) - along * np.sin(at), out * np.sin(at) + along * np.cos(at)])
        assert found == pytest.approx(CORE * vector @ weight, abs=1e-11)
    normal = np.array([np.cos(0.95), np.sin(0.95)])
    assert response.texel_forces(patches)[1] == pytest.approx(-response.resultants(patches)[1] @ normal, rel=1e-12)
    assert response.texel_forces(patches, normals=patches[:, 0])[1] == pytest.approx(
        -response.resultants(patches)[1] @ [np.cos(0.4), np.sin(0.4)], rel=1e-12
    )


def test_a_harmonic_pressure_gives_its_own_term(cylinder):
    layer = cylinder(0.3)
    angles = np.linspace(0, 6, 9)
    response = layer.respond(
        ArcLoad(
            pressure=lambda x: 5e3 * np.cos(7 * x), shear=lambda x: 2e3 * np.sin(7 * x), half_width=np.pi, angle=0.5
        )
    )
    term = layer.transfer([7.0])
    waves = np.stack([np.cos(7 * (angles - 0.5)), np.sin(7 * (angles - 0.5))], axis=1)
    assert response.base_traction(angles) == pytest.approx(waves * (term.base[0] @ [-5e3, 2e3]), abs=1e-7)
    moved = response.top_displacement(angles)
    assert moved == pytest.approx(waves * (term.compliance[0] @ [-5e3, 2e3]), abs=1e-9 * np.abs(moved).max())


@pytest.mark.slow
@pytest.mark.parametrize("nu", RATIOS)
def test_wide_cylinders_tend_to_the_flat_layer(bonded, cylinder, nu):
    """A line load on a flat layer gives the base pressure (1 / pi) int base(k) cos(k x) dk."""
    thickness = 2e-3
    cover = bonded(nu)
    x = np.array([0.0, 1e-3, 3e-3, 6e-3])
    k, weight = gauss(0, 60 / thickness, 1200)
    exact = np.cos(np.outer(x, k)) @ (closed_form.transfer(cover, k).base * weight) / np.pi
    errors = []
    for core in (0.1, 0.2):
        response = cylinder(nu, core=core).respond(LineLoad(force=1.0))
        errors.append((-response.base_traction(x / core)[:, 0] - exact) / exact[0])
    assert np.abs(errors[1]).max() < 0.02
    assert errors[0] == pytest.approx(2 * errors[1], rel=0.03, abs=1e-4)


@pytest.mark.parametrize("nu", RATIOS)
def test_a_pressure_gives_the_texel_forces_of_the_whole_solution(cylinder, nu):
    layer, patches = cylinder(nu), [[-0.3, 0.1], [0.1, 0.5], [2.0, 4.0]]
    exact = layer.texel_forces(patches, ArcLoad(pressure=hertzian(0.2), half_width=0.2))
    assert layer.press(patches, hertzian(0.2), 0.2) == pytest.approx(exact, rel=1e-11, abs=1e-12)


def test_narrow_arcs_tend_to_a_line(cylinder):
    layer = cylinder()
    patches = [[-0.3, 0.3], [0.3, 0.9]]
    line = layer.texel_forces(patches, LineLoad(force=1.0, angle=0.1))
    errors = []
    for half_width in (0.02, 0.01):
        pressure = 1 / (2 * half_width * layer.outer_radius)
        arc = layer.texel_forces(patches, ArcLoad(pressure=pressure, half_width=half_width, angle=0.1))
        errors.append(arc - line)
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.01)
    assert np.abs(errors[1]).max() < 3e-4


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_two_loads_do_the_same_work_on_one_another(cylinder, nu):
    layer = cylinder(nu)
    loads = [
        ArcLoad(pressure=lambda x: 1e6 * (0.3**2 - x**2) ** 2, half_width=0.3),
        ArcLoad(
            pressure=lambda x: 3e6 * (0.2**2 - x**2) ** 2,
            shear=lambda x: 1e6 * x * (0.2**2 - x**2) ** 2,
            half_width=0.2,
            angle=0.4,
        ),
    ]
    work = []
    for acting, other in (loads, loads[::-1]):
        t, weight = gauss(-np.pi / 2, np.pi / 2, 80)
        at, weight = other.half_width * np.sin(t), weight * other.half_width * np.cos(t)
        moved = layer.respond(acting).top_displacement(other.angle + at)
        shear = other.shear(at) if callable(other.shear) else other.shear
        work.append(weight @ (moved[:, 1] * shear - moved[:, 0] * other.pressure(at)))
    assert work[0] == pytest.approx(work[1], rel=1e-5)


def test_displacements_beside_concentrated_loads_are_limits_of_small_ones(cylinder, sphere):
    at = np.array([0.3, 1.0, 3.0])
    points = np.stack([np.sin(at), 0 * at, np.cos(at)], axis=1)
    line = cylinder().respond(LineLoad(force=1.0)).top_displacement(at)
    point = sphere().respond(PointLoad(force=1.0)).top_displacement(points)
    size, errors = 0.1, []
    for half in (size, size / 2):
        small = ArcLoad(pressure=lambda x, w=half: 1 / (np.pi * 4e-3 * w**2) * np.sqrt(w**2 - x**2), half_width=half)
        arc = cylinder().respond(small).top_displacement(at)
        smooth = CapLoad(pressure=lambda x, w=half: w**2 - x**2, half_angle=half)
        carried = -sphere().respond(smooth).load_force[2]
        cap = sphere().respond(smooth).top_displacement(points) / carried
        errors.append([np.abs(arc - line).max() / np.abs(line).max(), np.abs(cap - point).max() / np.abs(point).max()])
    assert max(errors[1]) < 0.01
    assert errors[0] == pytest.approx(4 * np.array(errors[1]), rel=0.1)


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_the_normal_stress_alone_is_not_the_texel_force(cylinder, sphere, nu):
    """On a core of 6 mm under 1 to 3 mm of cover, texels of 3.4 mm: 5 to 9 % less, on a sphere 9 to 16 %."""
    width = 2 * np.pi / 11
    at, weight = gauss(-width / 2, width / 2)
    patch = SpherePatch.rectangle(UP, (0.0, 1.0, 0.0), width, width)
    points, area = patch.place_points(0.1)
    for thickness in (1e-3, 2e-3, 3e-3):
        response = cylinder(nu, thickness).respond(LineLoad(force=1.0))
        alone = -CORE * weight @ response.base_traction(at)[:, 0]
        assert 0.04 < 1 - alone / response.texel_forces([[-width / 2, width / 2]])[0] < 0.09
        response = sphere(nu, thickness).respond(PointLoad(force=1.0))
        alone = -(CORE**2) * area @ np.einsum("ni,ni->n", response.base_traction(points), points)
        assert 0.08 < 1 - alone / response.texel_forces([patch])[0] < 0.17


# Sphere


def ring(count, colatitudes, **options):
    turns = np.linspace(0, 2 * np.pi, count + 1)
    return [
        SpherePatch(
            pole=(1.0, 2.0, -1.0), meridian=(0.0, 0.0, 1.0), colatitudes=colatitudes, longitudes=(a, b), **options
        )
        for a, b in itertools.pairwise(turns)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "thickness"), [(0.3, 2e-3), (0.5, 5.4e-3)])
def test_the_traction_on_a_sphere_balances_the_load(sphere, nu, thickness):
    layer = sphere(nu, thickness)
    response = layer.respond(
        PointLoad(force=2.0, direction=(1.0, -2.0, 0.5)),
        CapLoad(pressure=3e3, shear=lambda x: 1e3 * np.sin(x), half_angle=0.3, direction=(0.0, 3.0, 0.0)),
    )
    axis = np.array([1.0, -2.0, 0.5]) / np.sqrt(5.25)
    # A uniform pressure on a cap carries pressure times the area of the cap's rim; the shear is integrated by hand.
    cap = 3e3 * np.sin(0.3) ** 2 + 1e3 * 2 * (2 / 3 - np.cos(0.3) + np.cos(0.3) ** 3 / 3)
    exact = -2 * axis - np.pi * layer.outer_radius**2 * cap * np.array([0.0, 1.0, 0.0])
    assert response.load_force == pytest.approx(exact, rel=1e-12)
    assert response.base_force == pytest.approx(exact, abs=1e-11)
    patches = [*ring(1, (0.0, 1.0), normal=UP), *ring(3, (1.0, 2.0)), *ring(2, (2.0, np.pi))]
    assert response.resultants(patches).sum(axis=0) == pytest.approx(exact, abs=1e-9)
    points, weights = map(np.concatenate, zip(*(patch.place_points(0.1) for patch in patches), strict=True))
    moment = weights @ np.cross(points, response.base_traction(points)) * CORE**3
    assert moment == pytest.approx(np.zeros(3), abs=1e-10)
    assert sum(patch.solid_angle for patch in patches) == pytest.approx(4 * np.pi, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("nu", RATIOS)
def test_wide_spheres_tend_to_the_flat_layer(bonded, sphere, nu):
    cover = bonded(nu)
    r = np.array([0.0, 1e-3, 3e-3, 6e-3])
    exact = closed_form.point_response(cover, r)
    errors = []
    for core in (0.1, 0.2):
        angle = r / core
        points = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
        traction = sphere(nu, core=core).respond(PointLoad(force=1.0)).base_traction(points)
        errors.append((-np.einsum("ni,ni->n", traction, points) - exact) / exact[0])
    assert np.abs(errors[1]).max() < 0.03
    assert errors[0] == pytest.approx(2 * errors[1], rel=0.05, abs=1e-4)


def test_a_legendre_pressure_gives_its_own_term(sphere):
    layer = sphere(0.3)
    angle = np.linspace(0.1, 3, 7)
    points = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    third = np.polynomial.legendre.Legendre.basis(3)
    response = layer.respond(CapLoad(pressure=lambda x: 5e3 * third(np.cos(x)), half_angle=np.pi))
    term = layer.transfer([3.0])
    along = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    slope = -np.sin(angle) * third.deriv()(np.cos(angle)) / 3.5
    for found, (out, tangential) in (
        (response.base_traction(points), term.base[0] @ [-5e3, 0]),
        (response.top_displacement(points), term.compliance[0] @ [-5e3, 0]),
    ):
        exact = out * third(np.cos(angle))[:, None] * points + tangential * slope[:, None] * along
        assert found == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("nu", RATIOS)
def test_loads_and_texels_turn_together(sphere, nu):
    """A texel force depends on the angle between load and texel only; caps are integrated about their own poles."""
    layer = sphere(nu)
    first = layer.texel_forces([SpherePatch.cap((1.0, 0.0, 0.0), 0.2)], PointLoad(force=1.0))
    direction = (-0.6, 0.0, 0.8)
    second = layer.texel_forces(
        [SpherePatch.cap((-0.6, 0.0, 0.8), 0.2)], PointLoad(force=1.0, direction=(0.64, 0.6, 0.48))
    )
    assert np.dot(direction, (0.64, 0.6, 0.48)) == pytest.approx(0, abs=1e-15)
    assert second == pytest.approx(first, abs=1e-11)


def test_narrow_caps_tend_to_a_point(sphere):
    layer = sphere()
    patches = [SpherePatch.rectangle((1.0, 2.0, 3.0), UP, 0.5, 0.4)]
    point = layer.texel_forces(patches, PointLoad(force=1.0, direction=(1.0, 2.0, 2.0)))
    errors = []
    for half_angle in (0.02, 0.01):
        pressure = 1 / (np.pi * (layer.outer_radius * np.sin(half_angle)) ** 2)
        cap = layer.texel_forces(patches, CapLoad(pressure=pressure, half_angle=half_angle, direction=(1.0, 2.0, 2.0)))
        errors.append(cap - point)
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.01)
    assert np.abs(errors[1]).max() < 3e-4


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_two_caps_do_the_same_work_on_one_another(sphere, nu):
    layer = sphere(nu)
    loads = [
        CapLoad(pressure=lambda x: 1e6 * (0.3**2 - x**2) ** 2, half_angle=0.3),
        CapLoad(
            pressure=lambda x: 3e6 * (0.2**2 - x**2) ** 2,
            shear=lambda x: 1e6 * np.sin(x) * (0.2**2 - x**2) ** 2,
            half_angle=0.2,
        ),
    ]
    work = []
    for acting, other in (loads, loads[::-1]):
        t, weight = gauss(0, np.pi / 2, 60)
        at, weight = other.half_angle * np.sin(t), weight * other.half_angle * np.cos(t)
        points = np.stack([np.sin(at), 0 * at, np.cos(at)], axis=1)
        moved = layer.respond(acting).top_displacement(points)
        out = np.einsum("ni,ni->n", moved, points)
        along = moved[:, 0] * np.cos(at) - moved[:, 2] * np.sin(at)
        shear = other.shear(at) if callable(other.shear) else other.shear
        work.append((weight * np.sin(at)) @ (along * shear - out * other.pressure(at)))
    assert work[0] == pytest.approx(work[1], rel=1e-5)


# Bad input


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda c, s: c(core=-1.0), "must be positive"),
        (lambda c, s: s(thickness=0.0), "must be positive"),
        (lambda c, s: c(thickness=1e-7).respond(LineLoad(force=1.0)), "too thin"),
        (lambda c, s: c().respond(LineLoad(force=1.0)).top_displacement([0.0]), "infinite at a concentrated"),
        (lambda c, s: s().respond(PointLoad(force=1.0)).top_displacement([UP]), "infinite at a concentrated"),
        (lambda c, s: c().texel_forces([[0, 1]], ArcLoad(pressure=1.0, half_width=4.0)), "0..pi"),
        (lambda c, s: s().respond(CapLoad(pressure=1.0, half_angle=0.0)).base_traction([UP]), "0..pi"),
        (lambda c, s: c().texel_forces([[0.2, 0.1]], LineLoad(force=1.0)), "larger angle"),
        (lambda c, s: c().texel_forces([0.2, 0.1], LineLoad(force=1.0)), "shape"),
        (
            lambda c, s: c().texel_forces([[0, 1]], ArcLoad(pressure=lambda x: 1.0 * (x > 0.111), half_width=0.3)),
            "not smooth",
        ),
        (lambda c, s: c().texel_forces([[0, 1]], ArcLoad(pressure=lambda x: x * np.nan, half_width=0.3)), "finite"),
        (lambda c, s: c().press([[0, 1]], lambda x: x * np.nan, 0.3), "not smooth"),
        (lambda c, s: c().press([[0, 1]], hertzian(0.3), 4.0), "0..pi"),
        (lambda c, s: s().texel_forces(ring(1, (0.0, 3.14159265)), PointLoad(force=1.0)), "mean normal"),
        (lambda c, s: SpherePatch.cap(UP, 4.0), "no patch"),
        (lambda c, s: SpherePatch.cap((0.0, 0.0, 0.0), 0.1), "direction"),
    ],
)
def test_bad_input_is_named(cylinder, sphere, fault, message):
    with pytest.raises(ValueError, match=message):
        fault(cylinder, sphere)
