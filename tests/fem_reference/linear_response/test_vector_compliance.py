"""Displacement vectors of wide covers under pressure and shear: direct integration of exact kernels over cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j0

from fem_reference.linear_response.surface_compliance import decay_length, membrane_length, solve_waves
from fem_reference.linear_response.vector_compliance import VectorCompliance, spread_shear
from tests.exact.shear_response import average_pairs, half_space_kernel, layers_kernel, twist_compliance
from tests.exact.tractions import traction_compliance, transfer_to_base
from tests.support.rubber import stack_layers

#: Middles of the displaced cells over the size of a cell: on the cell, beside it on all sides, and farther away.
PLACES = [(0, 0), (1, 0), (-1, 0), (0, -1), (1, 1), (-1, 1), (1, -1), (-2, -1), (3, 2), (-2.5, 0.5), (0.4, -5), (9, -7)]
ONE = stack_layers((2e-3, 1e6, 0.3))
TWO = stack_layers((1.2e-3, 3e5, 0.45), (0.5e-3, 4e6, 0.2))
THREE = stack_layers((0.6e-3, 2e6, 0.1), (0.7e-3, 3e5, 0.5), (1.1e-3, 1e6, 0.4))


def integrate(kernels, places, width, height, points=24):
    """Displacements by direct integration, shape (3, 3, places)."""
    at = np.array(places) * [width, height]
    values = [sum(average_pairs(each, place, width, height, points) for each in kernels) for place in at]
    return np.moveaxis(np.array(values), 0, -1)


def tabulated(cover, places, width, height, reach):
    x, y = (np.array(places) * [width, height]).T
    return VectorCompliance.tabulate(cover, reach).average_over_cells(x, y, width, height)


@pytest.mark.parametrize(
    ("ratio", "width", "height"), [(0.0, 1e-3, 1e-3), (0.2, 0.7e-3, 1.9e-3), (0.3, 3e-3, 0.8e-3), (0.5, 1e-3, 2e-3)]
)
def test_cells_of_a_half_space_move_as_cerruti_says(ratio, width, height):
    cover = stack_layers((4.0, 1e6, ratio))
    exact = integrate([half_space_kernel(1e6 / (2 * (1 + ratio)), ratio)], PLACES, width, height)
    found = tabulated(cover, PLACES, width, height, 0.1)
    # The thick cover is still less compliant than a half space, by the size of a cell over the thickness.
    np.testing.assert_allclose(found, exact, atol=1e-3 * exact.max(), rtol=0)


@pytest.mark.parametrize(
    ("cover", "width", "height"),
    [
        (ONE, 0.5e-3, 0.8e-3),
        pytest.param(stack_layers((1e-3, 2e6, 0.5)), 1.3e-3, 0.15e-3, marks=pytest.mark.slow),
        pytest.param(stack_layers((1e-3, 2e6, 0.0)), 0.3e-3, 0.1e-3, marks=pytest.mark.slow),
        pytest.param(TWO, 0.6e-3, 0.25e-3, marks=pytest.mark.slow),
        pytest.param(replace(TWO, base="sliding"), 0.3e-3, 0.7e-3, marks=pytest.mark.slow),
        pytest.param(stack_layers((2e-3, 1e6, 0.5), base="sliding"), 0.9e-3, 0.5e-3, marks=pytest.mark.slow),
    ],
    ids=["one layer", "incompressible", "no transverse strain", "two", "two that slide", "one that slides"],
)
def test_cells_of_layers_move_as_the_exact_waves_say(cover, width, height):
    top, slides = cover.layers[-1].material, cover.base == "sliding"
    layers = layers_kernel(cover, 15e-3, 1e-3 / 15e-3 if slides else 0.0)
    exact = integrate([half_space_kernel(top.shear_modulus, top.poisson_ratio), layers], PLACES, width, height, 12)
    found = tabulated(cover, PLACES, width, height, 12e-3)
    if slides:
        # Shear moves the cover as a whole, by an arbitrary distance; what forces in balance leave is exact.
        assert (found[[1, 2], [1, 2]] > 0).all()
        for each in (found, exact):
            each[[1, 2], [1, 2]] -= each[[1, 2], [1, 2]].mean()
    for row, column in np.ndindex(3, 3):
        scale = max(np.abs(exact[row, column]).max(), 0.1 * exact.max())
        np.testing.assert_allclose(found[row, column], exact[row, column], atol=3e-4 * scale, rtol=0)


@pytest.mark.parametrize(
    "cover", [ONE, pytest.param(replace(ONE, base="sliding"), marks=pytest.mark.slow)], ids=["bonded", "sliding"]
)
def test_displacements_far_away_have_decayed_unless_the_cover_slides(cover):
    layer, size = VectorCompliance.tabulate(cover, 0.5), 0.4e-3
    own, near, *far = np.moveaxis(
        layer.average_over_cells(np.array([0, 55e-3, 0.3, -0.2]), np.array([0, 0, 0.3, 0.4]), size, size), -1, 0
    )
    assert layer.floats == (cover.base == "sliding")
    assert layer.reach == pytest.approx(0.5 if layer.floats else 28 * max(decay_length(cover), membrane_length(cover)))
    if layer.floats:
        assert (np.diag(far[0])[1:] > 0).all()
        # At a distance the cover is a sheet in plane stress (Love 1927, section 148): ln r, turned by 1 + nu.
        mu, ratio, turn = cover.layers[0].material.shear_modulus, 0.3, np.array([0.0, -0.6])
        angle = (1 + ratio) / (8 * np.pi * mu * cover.thickness) * size**2
        assert [each[1, 1] - each[2, 2] for each in far] == pytest.approx(list(angle * turn), abs=1e-2 * angle)
    else:
        assert np.abs(near).max() < 1e-5 * own.max()
        assert not np.array(far).any()


def test_a_table_ends_where_it_is_asked_to():
    layer = VectorCompliance.tabulate(ONE, 7e-3)
    assert (layer.reach, layer.normal.reach, layer.normal.decayed) == (7e-3, 7e-3, False)


@pytest.mark.parametrize(
    "cover",
    [
        ONE,
        pytest.param(THREE, marks=pytest.mark.slow),
        pytest.param(stack_layers((1e-3, 2e5, 0.45), (0.5e-3, 8e6, 0.45)), marks=pytest.mark.slow),
        pytest.param(replace(TWO, base="sliding"), marks=pytest.mark.slow),
    ],
    ids=["one layer", "three", "skin", "sliding"],
)
def test_shear_presses_on_the_base_as_the_exact_waves_say(cover):
    found = spread_shear(cover)
    reach = 16 * max(decay_length(cover), membrane_length(cover))
    assert (found.radius[0], found.radius[-1]) == (0.0, pytest.approx(reach))
    assert (found.reaction, found.thickness) == (0.0, cover.thickness)
    kept = np.flatnonzero(found.radius < reach / 2)[::7]
    edges = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 12) * 0.5 / reach])
    edges = np.append(edges, np.arange(2 * edges[-1], 15 / cover.layers[-1].thickness, min(1 / reach, edges[-1] * 4)))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(edges)[:, None] / 2
    k, weight = (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
    exact = j0(np.outer(found.radius[kept], k)) @ (transfer_to_base(cover, k)[1] * weight) / (2 * np.pi)
    np.testing.assert_allclose(found.pressure_per_force[kept], exact, atol=3e-4 * np.abs(exact).max(), rtol=0)


@pytest.mark.parametrize("cover", [THREE, replace(TWO, base="sliding")], ids=["bonded", "sliding"])
def test_waves_of_shear_move_the_top_as_the_transfer_matrices_say(cover):
    k = np.geomspace(0.05, 9, 12) / cover.thickness
    found, exact = solve_waves(cover, k), traction_compliance(cover, k)
    np.testing.assert_allclose(found.along, exact[:, 1, 1], rtol=2e-4)
    np.testing.assert_allclose(found.coupling, exact[:, 1, 0], atol=2e-4 * np.abs(exact[:, 1, 0]).max())
    np.testing.assert_allclose(found.across, twist_compliance(cover, k), rtol=2e-4)
