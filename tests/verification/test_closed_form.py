"""The closed forms, checked against limits, identities and a numerical solution they do not share code with."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp

from fem_reference import closed_form
from meshes import Cover, Layer
from tests.exact.hertz import hertz as press_half_space
from tests.exact.point_response import point_response_spline

RATIOS = [0.0, 0.3, 0.45, 0.49, 0.5]


def one_layer_compliance(layer, wave_number):
    """Compute the compliance of the top of one layer bonded to a rigid base, for wave numbers k > 0, shape (m,) [m/Pa].

    (1 - nu) / (mu k) * (2 q sinh 2x - 4x) / (2 q cosh 2x + 1 + q^2 + 4 x^2), q = 3 - 4 nu, x = k h
    (Vorovich, Aleksandrov and Babeshko 1974); written with decaying exponentials to avoid overflow.
    """
    q = 3 - 4 * layer.material.poisson_ratio
    x = wave_number * layer.thickness
    decay = np.exp(-2 * x)
    numerator = q * (1 - decay**2) - 4 * x * decay
    denominator = q * (1 + decay**2) + (1 + q**2 + 4 * x**2) * decay
    return closed_form.half_space_compliance(layer, wave_number) * numerator / denominator


@pytest.mark.parametrize("nu", RATIOS)
def test_recursion_equals_the_one_line_compliance(bonded, nu):
    cover = bonded(nu)
    k = np.geomspace(0.05, 50, 60) / cover.thickness
    assert closed_form.transfer(cover, k).compliance == pytest.approx(
        one_layer_compliance(cover.layers[0], k), rel=1e-7
    )


@pytest.mark.parametrize("nu", RATIOS)
def test_short_waves_have_the_compliance_of_a_half_space(bonded, nu):
    cover = bonded(nu)
    k = np.array([20.0, 40.0]) / cover.thickness
    assert closed_form.transfer(cover, k).compliance == pytest.approx(
        closed_form.half_space_compliance(cover.layers[0], k), rel=1e-9
    )


@pytest.mark.parametrize("nu", RATIOS)
def test_base_carries_the_load_with_the_known_variance(bonded, nu):
    cover = bonded(nu)
    k = np.array([1e-9, 0.01, 0.02]) / cover.thickness
    base = closed_form.transfer(cover, k).base
    assert base[0] == pytest.approx(1, abs=1e-12)
    second = 2 * (1 - base[1:]) / k[1:] ** 2
    exact = cover.thickness**2 * nu / (1 - nu)
    assert second == pytest.approx(exact, rel=1e-3, abs=1e-3 * cover.thickness**2)


def layer_by_differences(nu, mu, h, k):
    """Top displacement and base stress of one wave from the field equations, by a boundary-value solver.

    State: u, w, shear stress, normal stress, with nu < 0.5; equilibrium and Hooke's law written out.
    """
    lam = 2 * mu * nu / (1 - 2 * nu)

    def field(_, y):
        u, w, tau, sigma = y
        w_z = (sigma - lam * k * u) / (lam + 2 * mu)
        across = (lam + 2 * mu) * k * u + lam * w_z
        return np.array([tau / mu + k * w, w_z, k * across, -k * tau])

    def ends(a, b):
        return np.array([a[0], a[1], b[2], b[3] + 1])

    z = np.linspace(0, h, 60)
    solved = solve_bvp(field, ends, z, np.zeros((4, z.size)), tol=1e-9, max_nodes=20000)
    assert solved.success
    return -solved.sol(h)[1], -solved.sol(0)[3]


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
@pytest.mark.parametrize("kh", [0.3, 1.0, 3.0])
def test_each_wave_satisfies_the_field_equations(bonded, nu, kh):
    cover = bonded(nu, thickness=1.0, youngs_modulus=2 * (1 + nu))
    down, base = layer_by_differences(nu, 1.0, 1.0, kh)
    exact = closed_form.transfer(cover, [kh])
    assert exact.compliance[0] == pytest.approx(down, rel=1e-6)
    assert exact.base[0] == pytest.approx(base, abs=1e-6)


def test_a_layer_cut_in_two_stays_the_same(bonded):
    cover = bonded(0.47)
    material = cover.layers[0].material
    cut = Cover(layers=(Layer(thickness=0.7e-3, material=material), Layer(thickness=1.3e-3, material=material)))
    k = np.geomspace(0.01, 40, 50) / cover.thickness
    whole, parts = closed_form.transfer(cover, k), closed_form.transfer(cut, k)
    assert parts.compliance == pytest.approx(whole.compliance, rel=1e-8)
    assert parts.base == pytest.approx(whole.base, abs=1e-10)


def test_sliding_base_is_half_of_a_free_layer_twice_as_thick(bonded):
    """Mirror symmetry: a sliding base is the middle plane of a layer pressed from both sides."""
    cover = bonded(0.3, base="sliding")
    x = np.array([0.5, 1.0, 2.0])
    # Pressed from both faces, half thickness h: 2 sinh^2 x / (sinh 2x + 2x) (Sneddon 1951, section 46.2)
    exact = 2 * np.sinh(x) ** 2 / (np.sinh(2 * x) + 2 * x)
    k = x / cover.thickness
    relative = closed_form.transfer(cover, k).compliance / closed_form.half_space_compliance(cover.layers[0], k)
    assert relative == pytest.approx(exact, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("nu", RATIOS)
def test_point_response_holds_the_whole_load(bonded, nu):
    cover = bonded(nu)
    spline = point_response_spline(cover, 20 * cover.thickness)
    x, w = np.polynomial.legendre.leggauss(2000)
    r, w = (x + 1) * 10 * cover.thickness, w * 10 * cover.thickness
    assert w @ (2 * np.pi * r * spline(r)) == pytest.approx(1, abs=2e-6)


def test_thick_layers_follow_hertz(bonded):
    cover = bonded(0.3, thickness=1.0)
    contact = closed_form.sphere(cover, 5.0, 0.002)
    hertz = press_half_space(cover.layers[0], 5.0, contact.force)
    assert hertz.contact_radius == pytest.approx(contact.contact_radius, rel=1e-4)
    assert hertz.depth == pytest.approx(contact.depth, rel=3e-3)


def test_thick_layers_follow_boussinesq_punch(bonded):
    cover = bonded(0.3, thickness=1.0)
    exact = 2 * 1e6 / (1 - 0.3**2) * 1e-3 * 1e-4
    assert closed_form.punch(cover, 1e-3, 1e-4).force == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize(
    ("nu", "published"),
    [(0.3, [1.207, 1.472, 1.784, 2.124, 2.480]), (0.5, [1.281, 1.683, 2.211, 2.855, 3.609])],
)
def test_published_punch_factors(bonded, nu, published):
    """Hayes et al. 1972, table 1, a/h = 0.2..1: force = 4 mu a kappa depth / (1 - nu)."""
    cover = bonded(nu)
    shear = cover.layers[0].material.shear_modulus
    for ratio, kappa in zip([0.2, 0.4, 0.6, 0.8, 1.0], published, strict=True):
        radius = ratio * cover.thickness
        force = closed_form.punch(cover, radius, 1e-6).force
        assert force * (1 - nu) / (4 * shear * radius * 1e-6) == pytest.approx(kappa, rel=3.5e-3)


@pytest.mark.parametrize("ratio", [100, pytest.param(400, marks=pytest.mark.slow)])
def test_a_wide_punch_on_an_incompressible_layer_follows_lubrication(bonded, ratio):
    """p = 3 mu depth (b^2 - r^2) / (4 h^3), where b exceeds the radius by the layer's end correction.

    The equation of a half plane with the symbol L(k) gives the correction by the method of Wiener and Hopf:
    -(h / pi) int_0^inf log(3 L(k) / 2 (k h)^3) / (k h)^2 d(k h).  The force lacks terms of order (h / radius)^3.
    """
    cover = bonded(0.5)
    h, mu = cover.thickness, cover.layers[0].material.shear_modulus

    def integrand(k):
        ratio = 3 / (2 * k**3) * (np.sinh(2 * k) - 2 * k) / (1 + 2 * k**2 + np.cosh(2 * k))
        return -np.log(ratio) / k**2

    # Below 0.01 the integrand is constant to 1e-4 of itself, beyond 20 the fraction of exponentials is 1.
    beyond = -(np.log(1.5) - 3 * (np.log(20.0) + 1)) / 20.0
    extra = (0.01 * integrand(0.01) + quad(integrand, 0.01, 20.0, limit=200)[0] + beyond) / np.pi
    found = closed_form.punch(cover, ratio * h, 1e-3 * h)
    exact = 3 * np.pi / 8 * mu * (1e-3 * h) * (ratio + extra) ** 4 * h
    assert found.error < 2e-5
    assert found.force == pytest.approx(exact, rel=found.error + 6.5 / ratio**3)


@pytest.mark.parametrize(("nu", "ratio"), [(0.5, 30), (0.5, 0.5), (0.3, 10)])
def test_the_stated_error_of_a_contact_covers_that_of_few_points(bonded, nu, ratio):
    h = bonded(nu).thickness
    exact = closed_form.punch(bonded(nu), ratio * h, 1e-4 * h)
    for per_layer in (4.5, 5.0, 5.5):
        coarse = closed_form.punch(bonded(nu), ratio * h, 1e-4 * h, nodes=max(4, int(per_layer * ratio)))
        assert abs(coarse.force / exact.force - 1) <= coarse.error + exact.error
    with pytest.raises(ValueError, match="do not resolve a contact"):
        closed_form.punch(bonded(0.5), 60 * h, 1e-4 * h, nodes=60)
