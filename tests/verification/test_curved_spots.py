"""The layer on a cylinder under forces anywhere: single waves against a second derivation, and whole loads."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import iv, ivp, kv, kvp

from fem_reference import closed_form
from fem_reference.closed_form.cylinder import transfer_cylinder
from meshes import Material
from tests.exact.cylinder import CylinderLayer, LineLoad
from tests.exact.cylinder_waves import _decay, _grow, transfer_cylinder_waves
from tests.exact.spots import SpotLoad, touch_cylinder

RATIOS = [0.0, 0.3, 0.49, 0.5]
CORE = 6e-3
THICK = 5.4e-3


def rubber(nu):
    modulus = {"youngs_modulus": 2 * (1 + nu)}
    return Material(name="test", model="linear-elastic", parameters=modulus, poisson_ratio=nu)


def cover(nu=0.49, thickness=THICK, core=CORE):
    return CylinderLayer(core_radius=core, thickness=thickness, material=rubber(nu))


def differentiate(nodes, at):
    """Values and two derivatives, at some points, of the polynomials that are 1 at one node and 0 at the others."""
    middle, half = (nodes[0] + nodes[-1]) / 2, (nodes[-1] - nodes[0]) / 2
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander((nodes - middle) / half, len(nodes) - 1))
    out = []
    for order in range(3):
        series = np.polynomial.chebyshev.chebder(np.eye(len(nodes)), order) if order else np.eye(len(nodes))
        vander = np.polynomial.chebyshev.chebvander((at - middle) / half, len(series) - 1)
        out.append(vander @ series @ inverse / half**order)
    return out


def collocate(m, k, thickness, nu, count=48):
    """Solve lap u + grad div u - grad p = 0, 2 nu div u + (1 - 2 nu) p = 0 by collocation; core radius and modulus 1.

    Returns:
        Tractions on the core and displacements of the top per (outward, tangential, axial) traction.
    """
    r = 1 + thickness * (1 - np.cos(np.pi * np.arange(count + 1) / count)) / 2
    inner, ends = r[1:-1], r[[0, -1]]
    value, first, second = differentiate(r, inner)
    at, slope, _ = differentiate(r, ends)
    p, p_first, _ = differentiate(inner, inner)
    p_at = differentiate(inner, ends)[0]
    o, over = 1 / inner[:, None], 1 / ends[:, None]
    none, nowhere = np.zeros_like(value), np.zeros_like(at)
    lap = second + o * first - (m**2 * o**2 + k**2) * value
    bent, coupled = lap - o**2 * value, -2 * m * o**2 * value
    div = np.hstack([first + o * value, m * o * value, k * value])
    div_slope = np.hstack([second + o * first - o**2 * value, m * (o * first - o**2 * value), k * first])
    system = np.vstack(
        [
            np.hstack([np.hstack([bent, coupled, none]) + div_slope, -p_first]),
            np.hstack([np.hstack([coupled, bent, none]) - m * o * div, m * o * p]),
            np.hstack([np.hstack([none, none, lap]) - k * div, k * p]),
            np.hstack([2 * nu * div, (1 - 2 * nu) * p]),
        ]
    )
    moved = [np.hstack([*(at if i == j else nowhere for j in range(3)), 0 * p_at]) for i in range(3)]
    stress = [
        np.hstack([2 * slope, nowhere, nowhere, -p_at]),
        np.hstack([-m * over * at, slope - over * at, nowhere, 0 * p_at]),
        np.hstack([-k * at, nowhere, slope, 0 * p_at]),
    ]
    system = np.vstack([system, *(each[:1] for each in moved), *(each[1:] for each in stress)])
    right = np.zeros((len(system), 3))
    right[-3:] = np.eye(3)
    size = np.abs(system).max(axis=1, keepdims=True)
    solved = np.linalg.solve(system / size, right / size)
    return np.vstack([each[:1] for each in stress]) @ solved, np.vstack([each[1:] for each in moved]) @ solved


@pytest.mark.parametrize(("nu", "thickness"), [(0.5, 0.01), (0.0, 0.1), (0.3, 0.5), (0.5, 0.5), (0.49, 0.9)])
def test_each_wave_satisfies_the_field_equations(nu, thickness):
    for m, k in [(0, 0.1), (0, 3.0), (1, 0.01), (1, 2.0), (2, 0.5), (3, 8 / thickness), (int(6 / thickness), 0.3)]:
        base, top = collocate(m, k, thickness, nu)
        exact = transfer_cylinder_waves(m + 1, np.array([k]), 1.0, 1 + thickness, rubber(nu))
        assert exact.base[m, 0] == pytest.approx(base, abs=1e-8 * max(1.0, np.abs(base).max()))
        assert exact.compliance[m, 0] == pytest.approx(top, abs=1e-8 * max(thickness, np.abs(top).max()))


@pytest.mark.parametrize("nu", RATIOS)
@pytest.mark.parametrize("thickness", [0.01, 0.9])
def test_long_waves_tend_to_plane_strain(nu, thickness):
    """The difference falls with the square of the wave number, down to rounding, also at large orders."""
    plane = transfer_cylinder(np.arange(200.0), 1.0, 1 + thickness, rubber(nu))
    errors = []
    for k in (1e-2, 1e-3, 1e-5):
        wave = transfer_cylinder_waves(200, np.array([k]), 1.0, 1 + thickness, rubber(nu))
        parts = ((wave.base[:, 0, :2, :2], plane.base), (wave.compliance[:, 0, :2, :2], plane.compliance))
        errors.append([np.linalg.norm(a - b, axis=(1, 2)) / np.linalg.norm(b, axis=(1, 2)) for a, b in parts])
    assert errors[0] == pytest.approx(100 * np.array(errors[1]), rel=0.01, abs=1e-7)
    assert np.max(errors[2]) < 1e-10


@pytest.mark.parametrize("nu", RATIOS)
def test_waves_in_any_direction_tend_to_the_flat_layer(bonded, nu):
    flat = bonded(nu, thickness=1.0, youngs_modulus=2 * (1 + nu))
    errors = []
    for radius in (100.0, 200.0):
        around, along = 0.6, 0.8
        wave = transfer_cylinder_waves(int(around * radius) + 1, np.array([along]), radius, radius + 1, rubber(nu))
        exact = closed_form.transfer(flat, [1.0])
        errors.append(
            [wave.base[-1, 0, 0, 0] / exact.base[0] - 1, wave.compliance[-1, 0, 0, 0] / exact.compliance[0] - 1]
        )
    assert np.abs(errors[1]).max() < 0.01
    assert errors[0] == pytest.approx(2 * np.array(errors[1]), rel=0.05, abs=2e-5)


@pytest.mark.parametrize("nu", RATIOS)
def test_the_compliance_is_reciprocal_and_positive(nu):
    moved = transfer_cylinder_waves(60, np.array([0.01, 1.0, 30.0]), 1.0, 1.3, rubber(nu)).compliance
    size = np.abs(moved).max(axis=(2, 3), keepdims=True)
    assert moved / size == pytest.approx(moved.swapaxes(2, 3) / size, abs=1e-10)
    assert (np.linalg.eigvalsh(moved / size) > -1e-10).all()


def test_the_ratios_of_bessel_functions():
    x, m = np.array([0.1, 1.0, 10.0, 40.0]), np.arange(20)[:, None]
    grown, decayed = _grow(20, x), _decay(20, x)
    assert grown.log == pytest.approx(np.log(iv(m, x)), abs=1e-12)
    assert decayed.log == pytest.approx(np.log(kv(m, x)), abs=1e-12)
    assert grown.slope == pytest.approx(ivp(m, x) / iv(m, x), rel=1e-12)
    assert decayed.slope == pytest.approx(kvp(m, x) / kv(m, x), rel=1e-12)
    far = _grow(3000, np.array([1e-3, 3000.0]))
    assert np.isfinite(far.log).all()
    assert far.slope[-1] == pytest.approx(np.hypot(2999, far.x) / far.x, rel=1e-3)


SPOTS = (
    SpotLoad(force=1.0, shear_force=0.3, axial_force=0.2, angle=0.4, height=1e-3),
    SpotLoad(force=2.0, angle=-2.0, half_angle=0.3, half_length=2e-3),
)


@pytest.mark.parametrize("nu", [0.3, *(pytest.param(nu, marks=pytest.mark.slow) for nu in (0.0, 0.49, 0.5))])
def test_long_strips_carry_the_load(nu):
    response = touch_cylinder(cover(nu), *SPOTS)
    strips = [[a, a + np.pi / 3, -18 * THICK, 18 * THICK] for a in np.arange(6) * np.pi / 3]
    assert response.resultants(strips).sum(axis=0) == pytest.approx(response.load_force, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("nu", RATIOS)
def test_the_traction_on_the_base_carries_force_and_moment(nu):
    layer = cover(nu)
    response = touch_cylinder(layer, *SPOTS)
    outward, along = np.array([np.cos(0.4), np.sin(0.4), 0]), np.array([-np.sin(0.4), np.cos(0.4), 0])
    first = -1 * outward + 0.3 * along + np.array([0, 0, 0.2])
    patch = -2 * np.sinc(0.3 / np.pi) * np.array([np.cos(2), -np.sin(2), 0])
    assert response.load_force == pytest.approx(first + patch, rel=1e-12)
    moment = np.cross(layer.outer_radius * outward + [0, 0, 1e-3], first)
    x, w = np.polynomial.legendre.leggauss(24)
    edges = THICK * np.array([-18, -4, -1, 1, 4, 18])
    half = np.diff(edges)[:, None] / 2
    theta, z = np.meshgrid(np.arange(48) * np.pi / 24, edges[:-1, None] + half * (x + 1), indexing="ij")
    theta, z, weight = theta.ravel(), z.ravel(), np.tile((half * w).ravel() * CORE * np.pi / 24, 48)
    out, turn, axial = response.base_traction(theta, z).T
    c, s = np.cos(theta), np.sin(theta)
    traction = np.stack([out * c - turn * s, out * s + turn * c, axial], axis=1)
    carried = weight @ np.cross(np.stack([CORE * c, CORE * s, z], axis=1), traction)
    assert weight @ traction == pytest.approx(response.load_force, abs=1e-6)
    assert carried == pytest.approx(moment, abs=1e-6 * layer.outer_radius)


@pytest.mark.parametrize("nu", [0.3, pytest.param(0.5, marks=pytest.mark.slow)])
def test_long_texels_feel_a_point_as_short_ones_a_line(nu):
    """The integral over z of the response to a point is the response to a line."""
    layer = cover(nu)
    spot = touch_cylinder(layer, SpotLoad(force=1.0, shear_force=0.3, angle=0.1))
    angles = np.array([[-0.2, 0.4], [0.4, 1.5], [2.0, 3.0]])
    long = np.hstack([angles, np.tile([[-18 * THICK, 18 * THICK]], (3, 1))])
    line = layer.respond(LineLoad(force=1.0, shear_force=0.3, angle=0.1))
    assert spot.resultants(long)[:, :2] == pytest.approx(line.resultants(angles), abs=1e-7)
    assert spot.texel_forces(long) == pytest.approx(line.texel_forces(angles), abs=1e-7)


def test_resultants_are_the_integral_of_the_traction():
    response = touch_cylinder(
        cover(0.3), SpotLoad(force=1.0, shear_force=0.4, axial_force=-0.3, angle=0.2, height=1e-3)
    )
    patch = [-0.1, 0.5, -2e-3, 5e-3]
    x, w = np.polynomial.legendre.leggauss(24)
    theta, z = (each.ravel() for each in np.meshgrid(0.2 + 0.3 * x, 1.5e-3 + 3.5e-3 * x, indexing="ij"))
    out, turn, axial = response.base_traction(theta, z).T
    across = (out + 1j * turn) * np.exp(1j * theta)
    total = np.stack([across.real, across.imag, axial]) @ np.outer(0.3 * w, 3.5e-3 * w).ravel() * CORE
    found = response.resultants([patch])[0]
    assert found == pytest.approx(total, abs=1e-10)
    normal = [np.cos(0.2), np.sin(0.2), 0]
    assert response.texel_forces([patch])[0] == pytest.approx(-found @ normal, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("height", [-80e-3, 80e-3])
def test_a_load_moves_along_the_axis_with_its_response(height):
    """Also past the place z = -height, and where load and places are far from z = 0."""
    z = np.array([1e-3, 6e-3, -2 * height])
    middle, moved = (
        touch_cylinder(cover(0.3), SpotLoad(force=1.0, axial_force=0.3, height=at)).base_traction([0.3] * 3, z + at)
        for at in (0.0, height)
    )
    assert moved == pytest.approx(middle, abs=1e-9 * np.abs(middle).max())
    (alone,) = touch_cylinder(cover(0.3), SpotLoad(force=1.0, height=height)).base_traction([0.3], [-height])
    assert np.abs(alone).max() < 1e-9 * np.abs(middle).max()


def test_a_patch_is_the_mean_of_points():
    layer = cover(0.3)
    patch = SpotLoad(force=1.0, axial_force=0.5, half_angle=0.2, half_length=3e-3)
    x, w = np.polynomial.legendre.leggauss(8)
    points = [
        SpotLoad(force=a * b / 4, axial_force=0.5 * a * b / 4, angle=0.2 * s, height=3e-3 * t)
        for s, a in zip(x, w, strict=True)
        for t, b in zip(x, w, strict=True)
    ]
    texels = [[0.0, 0.5, -1e-3, 2e-3], [1.0, 1.5, 2e-3, 6e-3]]
    even, many = (touch_cylinder(layer, *loads).texel_forces(texels) for loads in ((patch,), points))
    assert even == pytest.approx(many, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("nu", RATIOS)
def test_points_on_wide_cylinders_tend_to_the_flat_layer(bonded, nu):
    flat = bonded(nu)
    r = np.array([0.0, 1e-3, 3e-3])
    exact = closed_form.point_response(flat, r)
    for angle, height in ((r, 0 * r), (0 * r, r)):
        errors = []
        for core in (0.02, 0.04):
            response = touch_cylinder(cover(nu, thickness=2e-3, core=core), SpotLoad(force=1.0))
            traction = response.base_traction(angle / core, height)
            errors.append((-traction[:, 0] - exact) / exact[0])
        assert np.abs(errors[1]).max() < 0.06
        assert errors[0] == pytest.approx(2 * errors[1], rel=0.2, abs=3e-3)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda: SpotLoad(force=1.0, half_angle=4.0), "no patch"),
        (lambda: touch_cylinder(cover(), SpotLoad(force=1.0)).texel_forces([[0, 1, 1, 1]]), "first angle, last angle"),
        (lambda: touch_cylinder(cover(thickness=1e-5), SpotLoad(force=1.0)).base_traction([0], [0]), "too thin"),
    ],
)
def test_bad_input_is_named(fault, message):
    with pytest.raises(ValueError, match=message):
        fault()
