"""The kernel is fitted on the array's own grid, or on a grid of its pitch."""

import dataclasses

import pytest

from meshes import TexelArray
from validation.derivation.kernel import fit_kernel, fitting_grid, uncut_sigma


def test_a_regular_grid_is_its_own_fitting_grid_and_another_layout_is_not(wts):
    assert fitting_grid(wts) is wts
    centres = wts.centres.copy()
    centres[0, 0] += 1e-4
    shifted = dataclasses.replace(wts, centres=centres)
    grid = fitting_grid(shifted)
    assert grid is not shifted
    assert (grid.pitch, grid.texel_size) == (shifted.pitch, shifted.texel_size)
    assert grid.rows == grid.columns > 10


def test_the_fit_hardly_depends_on_the_size_of_the_array(derivation):
    wide = fit_kernel(derivation.influence, TexelArray.grid(21, 21, derivation.sensor.array.pitch))
    assert wide.gaussian.sigma_x == pytest.approx(derivation.fit.gaussian.sigma_x, rel=2e-3)
    assert wide.estimates.keys() == derivation.fit.estimates.keys()


def test_uncut_sigma_is_an_estimate_of_the_fit_and_grows_on_a_finer_pitch(derivation):
    array = derivation.sensor.array
    assert uncut_sigma(derivation.influence, array) == pytest.approx(
        derivation.fit.estimates["least-squares-uniform-uncut"][0]
    )
    fine = TexelArray.grid(31, 31, tuple(edge / 2 for edge in array.pitch))
    assert uncut_sigma(derivation.influence, fine) > uncut_sigma(derivation.influence, array)
