"""Kernels between cells add up to what whole texels do."""

import dataclasses

import numpy as np
import pytest

from fem_reference.linear_response.axisymmetric import point_spread
from fem_reference.linear_response.surface_compliance import surface_compliance
from meshes import Cover, Layer, TexelArray
from validation.derivation.derive import derive
from validation.derivation.kernel import cover_cells, fit_kernel


@pytest.fixture(scope="module")
def cells(derivation):
    return derivation.parameters.surface


def test_cells_of_a_texel_together_act_like_uniform_pressure(cells, derivation):
    """The mean of the influence over the loaded texel's own cells is the middle entry of the uniform response."""
    own = cells.influence[cells.reach : cells.reach + cells.per_texel, cells.reach : cells.reach + cells.per_texel]
    array = derivation.sensor.array
    assert own.mean() == pytest.approx(derivation.texel_response_uniform[array.rows // 2, array.columns // 2], abs=2e-4)


def test_kernels_are_symmetric_and_fall_from_the_loaded_cell(cells):
    np.testing.assert_allclose(cells.influence, cells.influence[::-1, ::-1], atol=1e-9)
    np.testing.assert_allclose(cells.influence, cells.influence.T, atol=1e-9)
    assert cells.compliance[0, 0] == cells.compliance.max()
    assert cells.influence.sum() / cells.per_texel**2 == pytest.approx(1, abs=5e-3)


@pytest.mark.slow
def test_number_of_cells_follows_the_thickness_within_its_limits(derivation, bonded):
    spread, array = derivation.influence, TexelArray.grid(3, 3, 3.4e-3)
    assert cover_cells(bonded(0.49, thickness=5e-3), array, spread).per_texel == 4
    assert cover_cells(bonded(0.49, thickness=0.8e-3), array, spread).per_texel == 10
    assert cover_cells(bonded(0.49, thickness=0.2e-3), array, spread).per_texel == 12
    assert cover_cells(bonded(0.49), array, spread, per_texel=5).cell == pytest.approx((0.68e-3, 0.68e-3))


def test_kernels_of_texels_that_are_not_square_spread_alike_along_both_axes(derivation, bonded):
    """Without the widths of texel and cell, the influence has the same variance along x and y."""
    array = TexelArray.grid(9, 9, (2.5e-3, 5e-3))
    cells = cover_cells(bonded(0.49), array, derivation.influence, per_texel=4)
    assert cells.cell == pytest.approx((0.625e-3, 1.25e-3))
    count = len(cells.influence)
    places = np.arange(count) - (count - 1) / 2
    shares = [cells.influence.sum(axis=axis) / cells.influence.sum() for axis in (0, 1)]
    edges = zip(shares, cells.cell, array.pitch, strict=True)
    spread = [share @ (places * cell) ** 2 - (pitch**2 + cell**2) / 12 for share, cell, pitch in edges]
    assert spread[0] == pytest.approx(spread[1], rel=0.05)


@pytest.mark.parametrize(
    ("poisson_ratio", "pitch_by_thickness"),
    [
        (0.3, 0.2),
        pytest.param(0.0, 3.0, marks=pytest.mark.slow),
        pytest.param(0.49, 10.0, marks=pytest.mark.slow),
        pytest.param(0.0, 30.0, marks=pytest.mark.slow),
        pytest.param(0.499, 30.0, marks=pytest.mark.slow),
    ],
)
def test_a_cell_yields_under_its_own_pressure_as_its_parts_together(
    derivation, bonded, poisson_ratio, pitch_by_thickness
):
    array = TexelArray.grid(3, 3, (3.4e-3, 5e-3))
    cover = bonded(poisson_ratio, thickness=3.4e-3 / pitch_by_thickness)
    cells = cover_cells(cover, array, derivation.influence)
    parts, surface = 21, surface_compliance(cover, 4 * max(cells.cell))
    along, across = ((np.arange(parts) - parts // 2) * edge / parts for edge in cells.cell)
    x, y = np.meshgrid(along, across)
    cut = surface.of_rectangle(x, y, cells.cell[0] / parts, cells.cell[1] / parts).sum()
    assert cells.compliance[0, 0] == pytest.approx(cut, rel=5e-3)


@pytest.fixture(scope="module")
def soft_between_stiff(bonded):
    """The base pressure falls to half only at four thicknesses from the load."""
    stack = ((3.5e-3, 5.8e9), (5.1e-3, 3e3), (1.9e-3, 1e9))
    layers = tuple(Layer(thickness=h, material=bonded(0.3, youngs_modulus=e).layers[0].material) for h, e in stack)
    return Cover(layers=layers)


@pytest.mark.slow
def test_kernels_of_a_very_soft_layer_between_stiff_ones_are_wide(soft_between_stiff):
    array, spread = TexelArray.grid(4, 4, 2.5e-3), point_spread(soft_between_stiff)
    assert spread.half_width > 3 * soft_between_stiff.thickness
    assert spread.error_estimate["sigma"] < 1e-3
    assert fit_kernel(spread, array).gaussian.sigma_x > array.texel_size[0]
    cells = cover_cells(soft_between_stiff, array, spread)
    assert np.isfinite(cells.influence).all()
    assert 0 < cells.compliance[-1, -1] < cells.compliance[0, 0]


@pytest.mark.slow
def test_a_very_soft_layer_between_stiff_ones_is_derived(derivation, soft_between_stiff):
    sensor = dataclasses.replace(derivation.sensor, cover=soft_between_stiff, array=TexelArray.grid(4, 4, 2.5e-3))
    assert derive(sensor).error_estimate["sigma"] < 1e-3
