"""Kernels between cells add up to what whole texels do."""

import numpy as np
import pytest

from meshes import TexelArray
from validation.derivation.cover_kernels import cover_cells


@pytest.fixture(scope="module")
def cells(derivation):
    return derivation.parameters.cells


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


def test_number_of_cells_follows_the_thickness_within_its_limits(derivation, bonded):
    spread, array = derivation.influence, TexelArray.grid(3, 3, 3.4e-3)
    assert cover_cells(bonded(0.49, thickness=5e-3), array, spread).per_texel == 4
    assert cover_cells(bonded(0.49, thickness=0.8e-3), array, spread).per_texel == 8
    assert cover_cells(bonded(0.49), array, spread, per_texel=5).cell == pytest.approx((0.68e-3, 0.68e-3))
