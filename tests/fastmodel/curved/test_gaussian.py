"""The Gaussian in surface coordinates."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

from fastmodel.errors import FastModelError
from fastmodel.fitting.gaussian import fit_surface_gaussian, unroll_from
from meshes import TexelArray
from meshes.solids.texels import cylinder_texels

FLAT = TexelArray.grid(4, 5, (2e-3, 3e-3), texel_size=(1.8e-3, 2.5e-3))


def unroll(array):
    return unroll_from(array, array.centres, array.normals)


def respond(sigma):
    """Response of the flat array to point loads by a Gaussian, texel by texel."""
    apart = (FLAT.centres - FLAT.centres[:, None])[..., :2]
    half = np.array(FLAT.texel_size) / 2
    return (norm.cdf(apart + half, scale=sigma) - norm.cdf(apart - half, scale=sigma)).prod(axis=2)


def test_a_gaussian_is_recovered_and_puts_a_load_over_a_texel_where_its_fit_does():
    found = fit_surface_gaussian(FLAT, respond((1.1e-3, 1.7e-3)))
    assert found.sigma == pytest.approx((1.1e-3, 1.7e-3), rel=1e-5)
    assert found.residual < 1e-6
    spread = found.spread(FLAT, FLAT.centres + np.array([0, 0, 1e-3]), FLAT.normals)
    np.testing.assert_allclose(spread, respond((1.1e-3, 1.7e-3)), atol=1e-6)


def test_masked_texels_do_not_count():
    active = np.ones(20, dtype=bool)
    active[7] = False
    response = respond((1.1e-3, 1.7e-3))
    response[7], response[:, 7] = 5.0, 5.0
    found = fit_surface_gaussian(dataclasses.replace(FLAT, active=active), response)
    assert found.sigma == pytest.approx((1.1e-3, 1.7e-3), rel=1e-5)
    with pytest.raises(FastModelError, match="20 texels"):
        fit_surface_gaussian(FLAT, np.eye(3))


def test_a_cylinder_unrolls_to_arc_lengths():
    array = cylinder_texels(6e-3, rows=1, columns=5, pitch=(2e-3, 2e-3), size=(1.8e-3, 1.8e-3), name="row")
    along = unroll(array)[2, :, 0]
    assert np.diff(along) == pytest.approx(6e-3 * np.diff(np.arctan2(*array.centres[:, [0, 2]].T)), rel=1e-9)
    np.testing.assert_allclose(unroll(FLAT)[0, :, :], (FLAT.centres - FLAT.centres[0])[:, :2], atol=1e-12)


def test_unrolling_a_sphere_gives_arcs_in_every_direction():
    normals = np.array([[0, 0, 1.0], [0.6, 0, 0.8], [0, 0.6, 0.8], [0.48, 0.36, 0.8]])
    array = dataclasses.replace(
        FLAT, centres=5e-3 * normals, normals=normals, rows=1, columns=4, active=np.ones(4, dtype=bool)
    )
    arcs = np.linalg.norm(unroll(array)[0], axis=1)
    np.testing.assert_allclose(arcs, 5e-3 * np.arccos(normals[:, 2]), atol=1e-12)
