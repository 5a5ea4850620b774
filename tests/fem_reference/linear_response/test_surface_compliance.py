"""Surface compliance of a wide cover: scaling, superposition, and the decay length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.elements.line import gauss_points
from fem_reference.linear_response.surface_compliance import (
    choose_friction_reach,
    choose_linear_reach,
    choose_reach,
    choose_solid_reach,
    decay_length,
    membrane_length,
    solve_waves,
    spread_of_top,
    surface_compliance,
    warn_of_boundary,
)
from tests.support.rubber import stack_layers


@settings(max_examples=25, deadline=None)
@given(modulus=st.floats(1e3, 1e9), thickness=st.floats(1e-4, 1e-1), nu=st.sampled_from([0.0, 0.3, 0.49, 0.5]))
def test_compliance_scales_with_thickness_over_modulus(bonded, modulus, thickness, nu):
    k = np.array([0.3, 1.0, 4.0])
    unit = solve_waves(bonded(nu, thickness=1.0, youngs_modulus=1.0), k, elements_per_layer=4)
    found = solve_waves(bonded(nu, thickness=thickness, youngs_modulus=modulus), k / thickness, elements_per_layer=4)
    assert found.compliance == pytest.approx(unit.compliance * thickness / modulus, rel=1e-5)
    assert found.base == pytest.approx(unit.base, rel=1e-5, abs=1e-7)


def test_a_long_wave_compresses_the_layers_without_lateral_strain(bonded):
    cover = bonded(0.3)
    constrained_modulus = 1e6 * (1 - 0.3) / ((1 + 0.3) * (1 - 2 * 0.3))
    found = solve_waves(cover, np.array([1e-3 / cover.thickness]))
    assert found.compliance == pytest.approx([cover.thickness / constrained_modulus], rel=1e-4)
    assert found.base == pytest.approx([1], rel=1e-4)


def test_the_decay_length_is_the_thickness_or_the_bending_length_of_a_foil(bonded):
    assert decay_length(bonded(0.45)) == 2e-3
    cover = stack_layers((2e-3, 1e5, 0.3), (0.2e-3, 1e11, 0.3))
    plate, springs = 1e11 * 0.2e-3**3 / (12 * (1 - 0.3**2)), 1e5 / 2e-3
    assert decay_length(cover) == pytest.approx((plate / springs) ** 0.25)
    assert decay_length(cover) > cover.thickness


def test_a_stiff_top_spreads_a_load_over_its_bending_length(bonded):
    assert spread_of_top(bonded(0.45)) == 2e-3
    assert spread_of_top(stack_layers((2e-3, 1e6, 0.3), (0.2e-3, 2e6, 0.3))) == 0.2e-3
    plate = 1e9 * 0.1e-3**3 / (12 * (1 - 0.4**2))
    thick, thin = (spread_of_top(stack_layers((each, 1e5, 0.3), (0.1e-3, 1e9, 0.4))) for each in (20e-3, 0.2e-3))
    assert thick == pytest.approx((2 * plate * (1 - 0.3**2) / 1e5) ** (1 / 3))
    assert thin == pytest.approx((plate * 0.2e-3 / 1e5) ** 0.25)


@pytest.mark.parametrize(
    "layers",
    [((0.44, 3e5), (0.56, 2e6)), pytest.param(((0.38, 1e4), (0.34, 8e7), (0.28, 3e4)), marks=pytest.mark.slow)],
)
def test_a_wide_even_pressure_compresses_a_cover_with_a_stiff_layer_like_a_long_wave(layers):
    cover = stack_layers(*((*layer, 0.45) for layer in layers))
    surface = surface_compliance(cover, 1e9)
    # The displacement under even pressure on a circle that ends where the table does: the volume below a point load.
    radius, weight = gauss_points(np.linspace(0, surface.reach, 20001), 3)
    pressed = 2 * np.pi * weight @ (radius * surface.regular(radius) + surface.half_space)
    exact = solve_waves(cover, np.array([1e-3 / surface.reach])).compliance
    assert pressed == pytest.approx(exact, rel=2e-4)


@pytest.mark.parametrize(
    ("nu", "ratio"),
    [
        *((0.0, 0.2), (0.0, 3.0), (0.499, 0.2), (0.499, 3.0)),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in ((0.0, 30.0), (0.499, 30.0), (0.45, 0.2), (0.45, 3.0), (0.45, 30.0))
        ),
    ],
)
def test_the_compliance_of_a_cell_is_that_of_the_same_cell_cut_into_parts(bonded, nu, ratio):
    """Cells from a fifth of the thickness to thirty times the thickness, wide and narrow ones."""
    width, height, parts = 3e-3, 1e-3, 5
    surface = surface_compliance(bonded(nu, thickness=width / ratio), 12e-3)
    offset = np.arange(1 - parts, parts)
    share = (parts - np.abs(offset)) / parts
    for place in ([0.0, 0.0], [width, 0.0], [2 * width, -3 * height]):
        x, y = np.meshgrid(place[0] + offset * width / parts, place[1] + offset * height / parts, indexing="ij")
        cut = np.sum(surface.average_over_cells(x, y, width / parts, height / parts) * np.outer(share, share))
        whole = surface.average_over_cells(np.array(place[:1]), np.array(place[1:]), width, height)[0]
        own = surface.average_over_cells(np.zeros(1), np.zeros(1), width, height)[0]
        assert whole == pytest.approx(cut, rel=1e-3, abs=3e-4 * own)


@pytest.mark.parametrize(("width", "height"), [(0.2e-3, 0.2e-3), (0.3e-3, 0.1e-3), (0.1e-3, 0.3e-3)])
def test_the_mean_over_a_cell_is_that_of_its_points_near_and_far_along_both_axes(bonded, width, height):
    """Gauss quadrature of the displacement under one cell; the half-space part of distant cells is expanded."""
    response = surface_compliance(bonded(0.3), 20e-3)
    away = np.array([0.0, 0.5e-3, 1.6e-3, 3.3e-3, 6.6e-3, 9.8e-3])
    x, y = (each.ravel() for each in np.meshgrid(away, -away))
    points, weights = np.polynomial.legendre.leggauss(6)
    mean = sum(
        one * other / 4 * response.of_rectangle(x + width / 2 * u, y + height / 2 * v, width, height)
        for u, one in zip(points, weights, strict=True)
        for v, other in zip(points, weights, strict=True)
    )
    found = response.average_over_cells(x, y, width, height)
    half_space = response.half_space * width * height / np.maximum(np.hypot(x, y), min(width, height) / 4)
    distant = np.hypot(x, y) > max(width, height)  # nearer ones are not smooth over the points
    assert (np.abs(found - mean) / half_space)[distant].max() < 1e-5
    assert (np.abs(found - mean) / half_space).max() < 1e-3


def test_cells_of_a_wide_contact_on_an_incompressible_cover_add_up_to_the_slope_of_its_long_waves(bonded):
    cover, wave = bonded(0.5), 0.05  # wave number times thickness: the compliance is a thousandth of the half space's
    surface = surface_compliance(cover, 1e9)
    size = 0.25 * cover.thickness
    far = int(surface.reach / size) + 1
    x, y = np.meshgrid(np.arange(-far, far + 1) * size, np.arange(-far, far + 1) * size, indexing="ij")
    pressed = (surface.average_over_cells(x, y, size, size) * np.cos(wave * x / cover.thickness)).sum()
    exact = solve_waves(cover, np.array([wave / cover.thickness])).compliance[0]
    assert pressed == pytest.approx(exact, rel=1e-3)


THREE = ((1e-3, 2e5, 0.45), (0.5e-3, 5e6, 0.3), (0.1e-3, 3e9, 0.4))


def test_lengths_of_three_layers_are_the_largest_of_both_interfaces():
    """Layers above an interface as a plate or a membrane, those below as springs in series."""
    bend, stretch = [sum(h for h, _, _ in THREE)], [0.0]
    for split in (1, 2):
        below, above = THREE[:split], THREE[split:]
        springs = 1 / sum(h / young for h, young, _ in below)
        shear = 1 / sum(2 * h * (1 + nu) / young for h, young, nu in below)
        bend.append((sum(young * h**3 / 12 / (1 - nu**2) for h, young, nu in above) / springs) ** 0.25)
        stretch.append((sum(young * h / (1 - nu**2) for h, young, nu in above) / shear) ** 0.5)
    cover = stack_layers(*THREE)
    assert decay_length(cover) == pytest.approx(max(bend))
    assert membrane_length(cover) == pytest.approx(max(stretch))
    assert membrane_length(stack_layers(THREE[0])) == 0.0


@pytest.mark.parametrize("layers", [THREE[:1], THREE[:2], THREE])
@pytest.mark.parametrize("contact", [0.3e-3, 9e-3])
def test_meshes_end_beyond_the_response_and_beyond_the_stretch_of_a_stiff_top(layers, contact):
    """The outer radius in decay lengths, contact radii and membrane lengths."""
    bonded_cover, sliding = (stack_layers(*layers, base=base) for base in ("bonded", "sliding"))
    decay, stretch = decay_length(bonded_cover), membrane_length(bonded_cover)
    linear = 12 * decay + 1.5 * contact
    assert choose_linear_reach(bonded_cover, contact) == pytest.approx(linear)
    assert choose_linear_reach(sliding, contact) == pytest.approx(40 * (decay + contact))
    assert choose_friction_reach(bonded_cover, contact) == pytest.approx(max(linear, 4 * stretch + 1.5 * contact))
    limit = min(0.3 * stretch, 40 * bonded_cover.thickness)
    assert choose_reach(bonded_cover, contact) == pytest.approx(max(linear, limit))
    assert choose_solid_reach(bonded_cover) == pytest.approx(7 * decay)
    assert choose_solid_reach(sliding) == pytest.approx(40 * decay)
    assert warn_of_boundary(bonded_cover) == ()


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_top_that_is_stretched_beyond_the_mesh_is_warned_of(share):
    """The mesh ends at 40 thicknesses; 0.3 membrane lengths of a foil of 0.01 mm on 2 mm of foam."""
    wanted = share * 40 * 2.01e-3 / 0.3
    foam = 1e4
    young = wanted**2 * (1 - 0.3**2) * foam / (2 * 1.45 * 2e-3 * 0.01e-3)
    cover = stack_layers((2e-3, foam, 0.45), (0.01e-3, young, 0.3))
    assert membrane_length(cover) == pytest.approx(wanted)
    assert 12 * decay_length(cover) < 40 * cover.thickness
    told = warn_of_boundary(cover)
    assert len(told) == (share > 1)
    if told:
        assert told[0].startswith(f"the stiff top reaches {0.3e3 * wanted:.3g} mm in its plane")
