"""Single harmonics on curved layers, against a second derivation, limits and published special cases."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import closed_form
from fem_reference.closed_form.cylinder import transfer_cylinder
from meshes import Material
from tests.exact.sphere import transfer_sphere
from tests.exact.tractions import traction_compliance

RATIOS = [0.0, 0.3, 0.49, 0.5]
SHAPES = {"cylinder": transfer_cylinder, "sphere": transfer_sphere}


def rubber(nu, shear_modulus=1.0):
    modulus = {"youngs_modulus": 2 * shear_modulus * (1 + nu)}
    return Material(name="test", model="linear-elastic", parameters=modulus, poisson_ratio=nu)


def differentiate(nodes, at):
    """Values and two derivatives, at some points, of the polynomials that are 1 at one node and 0 at the others."""
    middle, half = (nodes[0] + nodes[-1]) / 2, (nodes[-1] - nodes[0]) / 2
    scaled = (at - middle) / half
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander((nodes - middle) / half, len(nodes) - 1))
    out = []
    for order in range(3):
        series = np.polynomial.chebyshev.chebder(np.eye(len(nodes)), order) if order else np.eye(len(nodes))
        out.append(np.polynomial.chebyshev.chebvander(scaled, len(series) - 1) @ series @ inverse / half**order)
    return out


def collocate(shape, order, thickness, nu, count=48):
    """Solve Navier's equations of displacement and pressure by Chebyshev collocation, core radius and modulus 1.

    mu lap u + mu grad div u - grad p = 0 and 2 mu nu div u + (1 - 2 nu) p = 0, in displacements u_r and u_t of degree
    `count` and pressure of degree `count` - 2.  No state-space form, no exponentials.

    Returns:
        Traction on the core and displacement of the top per (outward, tangential) traction, as of `harmonic`.
    """
    r = 1 + thickness * (1 - np.cos(np.pi * np.arange(count + 1) / count)) / 2
    inner = r[1:-1]
    value, first, second = differentiate(r, inner)
    ends, slopes, _ = differentiate(r, r[[0, -1]])
    p_value, p_first, _ = differentiate(inner, inner)
    p_ends = differentiate(inner, r[[0, -1]])[0]
    o, none = 1 / inner[:, None], np.zeros_like
    m = order
    if shape == "cylinder":
        k, turns = 1.0, 1.0
        lap_r = (second + o * first - (m**2 + 1) * o**2 * value, -2 * m * o**2 * value)
        lap_t = (-2 * m * o**2 * value, second + o * first - (m**2 + 1) * o**2 * value)
        div = (first + o * value, m * o * value)
        div_slope = (second + o * first - o**2 * value, m * (o * first - o**2 * value))
        grad, shear = -m, -m
    else:
        k, q, turns = m + 0.5, m * (m + 1), 2.0
        lap_r = (second + 2 * o * first - (q + 2) * o**2 * value, 2 * q * o**2 * value)
        lap_t = (2 * o**2 * value, second + 2 * o * first - q * o**2 * value)
        div = (first + turns * o * value, -q * o * value)
        div_slope = (second + 2 * o * first - 2 * o**2 * value, -q * (o * first - o**2 * value))
        grad, shear = 1.0, 1.0
    radial = np.hstack([lap_r[0] + div_slope[0], lap_r[1] + div_slope[1], -p_first])
    tangential = np.hstack([lap_t[0] + grad * o * div[0], lap_t[1] + grad * o * div[1], -grad * o * p_value])
    volume = np.hstack([2 * nu * div[0], 2 * nu * div[1], (1 - 2 * nu) * p_value])
    e, s, blank = ends, slopes, none(ends)
    normal_stress = np.hstack([2 * s, blank, -p_ends])
    over = 1 / r[[0, -1]][:, None]
    shear_stress = np.hstack([shear * over * e, s - over * e, none(p_ends)])
    u, v = np.hstack([e, blank, none(p_ends)]), np.hstack([blank, e, none(p_ends)])
    system = np.vstack([radial, tangential, volume, u[:1], v[:1], normal_stress[1:], shear_stress[1:]])
    right = np.zeros((len(system), 2))
    right[-2, 0], right[-1, 1] = 1.0, 1 / k
    size = np.abs(system).max(axis=1, keepdims=True)
    solved = np.linalg.solve(system / size, right / size)
    scale = np.array([[1.0], [k]])
    base = scale * np.vstack([normal_stress[:1], shear_stress[:1]]) @ solved
    return base, scale * np.vstack([u[1:], v[1:]]) @ solved


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("nu", "thickness"), [(0.5, 0.01), (0.0, 0.1), (0.3, 0.5), (0.5, 0.5), (0.49, 0.9)])
def test_each_harmonic_satisfies_the_field_equations(shape, nu, thickness):
    start = 0 if shape == "cylinder" else 1
    for order in [start, start + 1, 2, 3, 7, int(3 / thickness), int(10 / thickness)]:
        base, top = collocate(shape, order, thickness, nu)
        exact = SHAPES[shape](np.array([order]), 1.0, 1 + thickness, rubber(nu))
        assert exact.base[0] == pytest.approx(base, abs=1e-8 * max(1.0, np.abs(base).max()))
        # Without compression a uniform pressure moves nothing; displacements compare with thickness / mu.
        assert exact.compliance[0] == pytest.approx(top, abs=1e-8 * max(thickness, np.abs(top).max()))


@pytest.mark.parametrize("nu", RATIOS)
@pytest.mark.parametrize("thickness", [0.01, 0.5, 0.9])
def test_uniform_pressure_is_lames(nu, thickness):
    """Thick-walled cylinder and sphere with a fixed inner face (Lame 1852): u = A r + B / r and A r + B / r^2."""
    ratio = 1 / (1 + thickness)
    base = transfer_cylinder(np.zeros(1), 1.0, 1 + thickness, rubber(nu)).base[0, 0, 0]
    assert base == pytest.approx(2 * (1 - nu) / (1 + (1 - 2 * nu) * ratio**2), rel=1e-12)
    base = transfer_sphere(np.zeros(1), 1.0, 1 + thickness, rubber(nu)).base[0, 0, 0]
    assert base == pytest.approx(3 * (1 - nu) / (1 + nu + 2 * (1 - 2 * nu) * ratio**3), rel=1e-12)


def test_uniform_shear_turns_the_layer():
    """Torsion: the moment is the same at every radius, and u_t = t R^2 (1 / a^2 - 1 / R^2) R / (2 mu)."""
    found = transfer_cylinder(np.zeros(1), 1.0, 1.5, rubber(0.3, shear_modulus=2.0))
    assert found.base[0, 1, 1] == pytest.approx(1.5**2, rel=1e-12)
    assert found.compliance[0, 1, 1] == pytest.approx(1.5 * (1.5**2 - 1) / 4, rel=1e-12)


@pytest.mark.parametrize("nu", RATIOS)
def test_order_one_carries_the_net_force(nu):
    """The net force of (a cos, b sin) is pi r (a - b), of degree 1 on a sphere 4 pi r^2 / 3 (a + 4 b / 3)."""
    for thickness in (0.01, 0.9, 9.0):
        radius = 1 + thickness
        base = transfer_cylinder(np.ones(1), 1.0, radius, rubber(nu)).base[0]
        assert [1, -1] @ base == pytest.approx([radius, -radius], rel=1e-11)
        base = transfer_sphere(np.ones(1), 1.0, radius, rubber(nu)).base[0]
        assert [1, 4 / 3] @ base == pytest.approx([radius**2, radius**2 * 4 / 3], rel=1e-11)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("nu", RATIOS)
def test_large_radii_tend_to_the_flat_layer_at_first_order(bonded, shape, nu):
    cover = bonded(nu, thickness=1.0, youngs_modulus=2 * (1 + nu))
    k = np.array([0.3, 1.0, 3.0])
    flat, moved = closed_form.transfer(cover, k), traction_compliance(cover, k)
    errors = []
    for radius in (1e3, 1e4, 1e5):
        orders = k * radius - (0.5 if shape == "sphere" else 0.0)
        curved = SHAPES[shape](orders, radius, radius + 1, rubber(nu))
        errors.append(
            [
                *(curved.base[:, 0, 0] / flat.base - 1),
                *(curved.compliance[:, 0, 0] / flat.compliance - 1),
                *(curved.compliance[:, 1, 1] / moved[:, 1, 1] - 1),
            ]
        )
    first, second, third = np.array(errors)
    assert np.abs(third).max() < 5e-5
    assert first == pytest.approx(10 * second, rel=0.05)
    assert second == pytest.approx(10 * third, rel=0.05, abs=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("nu", RATIOS)
def test_short_waves_have_the_compliance_of_a_half_space(shape, nu):
    orders = np.array([5000.0, 50000.0])
    found = SHAPES[shape](orders, 1.0, 1.5, rubber(nu))
    assert np.isfinite(found.base).all()
    half_space = (1 - nu) / orders * 1.5
    assert found.compliance[:, 0, 0] == pytest.approx(half_space, rel=2e-4)
    assert found.compliance[1, 0, 0] == pytest.approx(half_space[1], rel=2e-5)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("nu", RATIOS)
@pytest.mark.parametrize("thickness", [0.01, 0.3, 0.9])
def test_the_compliance_is_reciprocal(shape, nu, thickness):
    """The work of one traction on the displacement of another is symmetric; tangential ones weigh n (n + 1) / k^2."""
    orders = np.array([1.0, 2.0, 10.0, 100.0, 1000.0])
    moved = SHAPES[shape](orders, 1.0, 1 + thickness, rubber(nu)).compliance
    weight = 1.0 if shape == "cylinder" else orders * (orders + 1) / (orders + 0.5) ** 2
    size = np.abs(moved).max(axis=(1, 2))
    assert moved[:, 0, 1] / size == pytest.approx(weight * moved[:, 1, 0] / size, abs=1e-9)
    assert (np.linalg.eigvalsh((moved + moved.transpose(0, 2, 1)) / 2) > 0).all()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("nu", RATIOS)
def test_both_ways_to_the_exponential_agree(monkeypatch, shape, nu):
    orders = np.arange(2.0, 400.0)
    for thickness in (0.01, 0.1, 0.9):
        found = []
        for limit in (0.5, 20.0):
            monkeypatch.setattr("fem_reference.closed_form.cylinder._LARGE", limit)
            found.append(SHAPES[shape](orders, 1.0, 1 + thickness, rubber(nu)))
        for name in ("base", "compliance"):
            one, other = (getattr(each, name) for each in found)
            size = np.linalg.norm(other, axis=(1, 2), keepdims=True)
            assert np.abs((one - other) / size).max() < 1e-11
