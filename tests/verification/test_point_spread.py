"""The point spread function against the exact bonded layer."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fem_reference import closed_form, point_spread
from fem_reference.linear_response.surface_compliance import solve_waves
from meshes import Cover, Layer, Material, TexelArray
from tests.exact.point_response import point_response_spline

RATIOS = [0.0, 0.3, 0.45, 0.49, 0.499, 0.5]


@cache
def exact_spline(cover):
    return point_response_spline(cover, 24 * cover.thickness)


def exact_texel_forces(cover, array, place, points=14):
    """Gauss quadrature of the exact response over every texel."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    half = np.array(array.texel_size) / 2
    x = array.centres[:, None, 0] + nodes * half[0] - place[0]
    y = array.centres[:, None, 1] + nodes * half[1] - place[1]
    radius = np.minimum(np.hypot(x[:, :, None], y[:, None, :]), 24 * cover.thickness)
    return np.einsum("nij,i,j->n", exact_spline(cover)(radius), weights, weights) * half[0] * half[1]


def places(array):
    """Over a texel's centre, edge and corner, off-grid, and over the array's own corner."""
    centre, pitch = array.centres[array.middle, :2], np.array(array.pitch)
    shifts = np.array([[0, 0], [pitch[0] / 2, 0], pitch / 2, [0.3e-3, 1.1e-3]])
    return [*(centre + shifts), array.centres[-1, :2] + pitch / 2]


@pytest.mark.parametrize(
    "nu",
    [
        pytest.param(0.0, marks=pytest.mark.slow),
        *(pytest.param(nu, marks=pytest.mark.slow) for nu in RATIOS[1:-2]),
        pytest.param(0.499, marks=pytest.mark.slow),
        0.5,
    ],
)
def test_radial_profile_equals_the_exact_layer(bonded, nu):
    cover = bonded(nu)
    spread = point_spread(cover)
    radius = np.linspace(0, spread.reach, 3000)
    exact = closed_form.point_response(cover, radius)
    assert np.abs(spread.pressure(radius) - exact).max() < 1e-3 * exact.max()


@pytest.mark.parametrize(
    "nu", [pytest.param(0.0, marks=pytest.mark.slow), pytest.param(0.499, marks=pytest.mark.slow), 0.5]
)
def test_texel_forces_equal_the_exact_layer(bonded, wts, nu):
    cover = bonded(nu)
    influence = point_spread(cover).texel_influence(wts, places(wts))
    for row, place in zip(influence, places(wts), strict=True):
        assert np.abs(row - exact_texel_forces(cover, wts, place)).max() < 5e-5


@pytest.mark.parametrize("nu", [*(pytest.param(nu, marks=pytest.mark.slow) for nu in (0.0, 0.3)), 0.5])
def test_uniform_pressure_equals_the_exact_layer(bonded, wts, nu):
    cover = bonded(nu)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    centre = wts.centres[wts.middle, :2]
    exact = np.zeros(wts.count)
    for x, a in zip(nodes, weights, strict=True):
        for y, b in zip(nodes, weights, strict=True):
            exact += a * b / 4 * exact_texel_forces(cover, wts, centre + np.array([x, y]) * wts.pitch / 2, points=10)
    found = point_spread(cover).texel_response(wts, "uniform")
    assert np.abs(found - exact).max() < 5e-5


@pytest.mark.parametrize(
    ("nu", "base"),
    [(0.0, "bonded"), (0.3, "sliding"), pytest.param(0.499, "sliding", marks=pytest.mark.slow), (0.5, "bonded")],
)
def test_texels_and_outside_add_up_to_the_load(bonded, wts, nu, base):
    spread = point_spread(bonded(nu, base=base))
    total = spread.texel_influence(wts, places(wts)).sum(axis=1) + spread.outside(wts, places(wts))
    assert total == pytest.approx(1, abs=3e-5)
    assert spread.reaction == pytest.approx(1, abs=1e-9 if base == "sliding" else 2e-5)


@pytest.mark.parametrize("size", [(2e-3, 0.2e-3), (0.1e-3, 0.9e-3), (0.1e-3, 0.1e-3)])
def test_texels_much_narrower_than_the_cover_is_thick_equal_the_exact_layer(bonded, size):
    cover, array = bonded(0.49), TexelArray.grid(1, 1, size)
    spread = point_spread(cover)
    for place in [(0.0, 0.0), (0.04e-3, 0.2e-3), (0.8e-3, 0.06e-3)]:
        exact = exact_texel_forces(cover, array, place)
        assert spread.texel_influence(array, [place])[0] == pytest.approx(exact, rel=5e-4)


def test_masked_texels_count_as_outside(bonded, wts):
    spread = point_spread(bonded(0.49))
    active = np.ones(84, dtype=bool)
    active[wts.middle] = False
    masked = TexelArray.grid(14, 6, 3.4e-3, active=active)
    centre = wts.centres[wts.middle, :2]
    assert spread.texel_influence(masked, centre)[0, wts.middle] == 0
    lost = spread.outside(masked, centre)[0] - spread.outside(wts, centre)[0]
    assert lost == pytest.approx(spread.texel_influence(wts, centre)[0, wts.middle], abs=1e-3)


@pytest.mark.slow
def test_shape_does_not_depend_on_the_modulus_and_scales_with_thickness(bonded):
    soft, stiff = point_spread(bonded(0.45)), point_spread(bonded(0.45, youngs_modulus=7e6))
    assert stiff.pressure_per_force == pytest.approx(soft.pressure_per_force, rel=1e-9, abs=1e-3)
    thick = point_spread(bonded(0.45, thickness=6e-3))
    radius = np.linspace(0, 20e-3, 50)
    assert thick.pressure(3 * radius) * 9 == pytest.approx(soft.pressure(radius), rel=1e-6, abs=1e-3)


@pytest.mark.parametrize(
    "base", [pytest.param("bonded", marks=pytest.mark.slow), pytest.param("sliding", marks=pytest.mark.slow)]
)
def test_layered_covers_equal_the_exact_recursion(base):
    """A foil a tenth as thick and a hundred times as stiff on a soft layer."""
    foil = Material(name="foil", model="linear-elastic", parameters={"youngs_modulus": 1e8}, poisson_ratio=0.35)
    soft = Material(name="soft", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.45)
    cover = Cover(layers=(Layer(thickness=1.8e-3, material=soft), Layer(thickness=0.2e-3, material=foil)), base=base)
    spread = point_spread(cover)
    radius = np.linspace(0, 0.9 * spread.reach, 500)
    exact = closed_form.point_response(cover, radius)
    assert np.abs(spread.pressure(radius) - exact).max() < 3e-3 * exact.max()


@pytest.mark.parametrize("nu", RATIOS)
def test_second_discretisation_agrees(bonded, nu):
    """Elements through the thickness, Fourier along it: the same transfer functions."""
    cover = bonded(nu)
    k = np.geomspace(0.05, 8, 30) / cover.thickness
    exact, found = closed_form.transfer(cover, k), solve_waves(cover, k)
    assert found.compliance == pytest.approx(exact.compliance, rel=5e-4)
    assert found.base == pytest.approx(exact.base, abs=5e-6)


@pytest.mark.slow
def test_error_estimates_cover_the_true_error(bonded, wts):
    for nu in (0.0, 0.499, 0.5):
        cover = bonded(nu)
        spread = point_spread(cover)
        patch = TexelArray.grid(1, 1, cover.thickness)
        exact = exact_texel_forces(cover, patch, (0, 0))[0]
        true = abs(spread.texel_response(patch)[0] / exact - 1)
        assert true <= spread.error_estimate["peak_texel"] + 2e-6
        assert spread.error_estimate["peak_texel"] < 1e-3


def test_free_side_edges_are_refused(bonded):
    with pytest.raises(ValueError, match="free side edges"):
        point_spread(bonded(0.4, size=(30e-3, 60e-3)))
