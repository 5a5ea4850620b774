"""What the fits accept and refuse at the edges, misfits by their definitions, and widths at the ends of the search."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

from fastmodel.errors import FastModelError
from fastmodel.fitting.contact_stiffness import fit_contact, fit_foundation
from fastmodel.fitting.gaussian import SurfaceGaussian, fit_gaussian, fit_surface_gaussian
from meshes import Box, Sphere, TexelArray

IMAGE = np.outer([0.1, 0.5, 0.2], [0.1, 0.2, 0.6, 0.1])
FLAT = TexelArray.grid(4, 5, (2e-3, 3e-3), texel_size=(1.8e-3, 2.5e-3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"response": np.ones(12)}, r"shape \(rows, columns\), not \(12,\)"),
        ({"active": np.ones((4, 3))}, r"active has shape \(4, 3\) but the response \(3, 4\)"),
        ({"loaded": (-1, 0)}, r"loaded texel \(-1, 0\) is not on an image of shape \(3, 4\)"),
        ({"loaded": (0, -1)}, "not on an image"),
        ({"loaded": (3, 0)}, "not on an image"),
        ({"loaded": (0, 4)}, "not on an image"),
        ({"response": np.where(IMAGE == 0.1 * 0.1, np.inf, IMAGE)}, "holds nan or inf"),
        ({"load": -2.0}, "load must be positive, not -2.0 N"),
        ({"load": np.inf}, "load must be positive, not inf N"),
        ({"load": np.nan}, "load must be positive, not nan N"),
        ({"point_response": IMAGE[:2]}, r"active has shape \(3, 4\) but the response \(2, 4\)"),
        ({"point_response": IMAGE[:2], "active": None}, r"point_response has shape \(2, 4\) but the response \(3, 4\)"),
        ({"pressure_per_force": [1.0, 0.5]}, "together"),
    ],
)
def test_bad_responses_are_refused(change, message):
    given = {"response": IMAGE, "loaded": (1, 2), "active": np.ones((3, 4), dtype=bool), **change}
    with pytest.raises(FastModelError, match=message):
        fit_gaussian(**given)


@pytest.mark.parametrize("loaded", [(0, 0), (0, 3), (2, 0), (2, 3)])
def test_a_texel_in_a_corner_may_be_loaded(loaded):
    """The fitted kernel lies around it; the misfit counts the active texels alone."""
    x, y = np.arange(4) - loaded[1], np.arange(3) - loaded[0]
    image = np.outer(np.exp(-0.5 * (y / 0.5) ** 2), np.exp(-0.5 * (x / 0.4) ** 2))
    image /= image.sum()
    active = np.ones((3, 4), dtype=bool)
    active[1, 1] = False
    found = fit_gaussian(7.0 * image, loaded, load=7.0, active=active)
    gaussian = found.gaussian
    along = [
        np.where(np.abs(each) <= (size - 1) // 2, np.exp(-0.5 * (each / sigma) ** 2), 0)
        / np.exp(-0.5 * ((np.arange(size) - (size - 1) // 2) / sigma) ** 2).sum()
        for each, sigma, size in (
            (y, gaussian.sigma_y, gaussian.ksize_y),
            (x, gaussian.sigma_x, gaussian.ksize_x),
        )
    ]
    kernel = np.outer(*along)
    assert found.residual == pytest.approx(0.5 * np.abs(image - kernel)[active].sum())
    assert found.outside_kernel == pytest.approx(1 - image[active & (kernel > 0)].sum())
    assert found.residual > 0.01
    assert found.estimator == "least-squares-uniform"
    assert found.estimates["least-squares-uniform"] == (gaussian.sigma_x, gaussian.sigma_y)


def test_point_responses_have_widths_of_their_own_per_unit_load():
    wide = np.outer([0.2, 0.6, 0.2], [0.1, 0.2, 0.4, 0.3])
    active = np.arange(12).reshape(3, 4) != 3
    found = fit_gaussian(3 * IMAGE, (1, 2), load=3.0, point_response=3 * wide, active=active).estimates
    alone = fit_gaussian(wide, (1, 2), active=active).estimates
    for name in ("variance", "peak", "neighbour"):
        assert found[f"{name}-point"] == pytest.approx(alone[f"{name}-uniform"])
        assert found[f"{name}-point"] != pytest.approx(found[f"{name}-uniform"])
    assert found["least-squares-point"] == pytest.approx(alone["least-squares-uniform-uncut"], rel=1e-6)
    assert found["peak-point"] == pytest.approx((1 / np.sqrt(2 * np.pi * 0.24),) * 2)


def respond(sigma):
    apart = (FLAT.centres - FLAT.centres[:, None])[..., :2]
    half = np.array(FLAT.texel_size) / 2
    return (norm.cdf(apart + half, scale=sigma) - norm.cdf(apart - half, scale=sigma)).prod(axis=2)


def test_the_misfit_of_a_surface_is_half_the_difference_per_unit_load():
    """Of the responses of the active texels, to active texels."""
    active = np.arange(20) % 7 != 3
    response = respond((1.1e-3, 1.7e-3)) + np.random.default_rng(0).uniform(0, 0.02, (20, 20))
    found = fit_surface_gaussian(dataclasses.replace(FLAT, active=active), response)
    apart = np.abs(respond(found.sigma) - response)[np.ix_(active, active)]
    assert found.residual == pytest.approx(apart.sum() / 2 / active.sum(), rel=1e-6)
    assert found.residual > 0.05
    spread = SurfaceGaussian(sigma=(0.9e-3, 1.2e-3), residual=0.0).spread(
        dataclasses.replace(FLAT, active=active), FLAT.centres[:3], FLAT.normals[:3]
    )
    np.testing.assert_allclose(spread, respond((0.9e-3, 1.2e-3))[:3] * active, atol=1e-12)


@pytest.mark.parametrize(("true", "found"), [(0.01, 0.05), (0.06, 0.06), (18.0, 18.0), (60.0, 20.0)])
def test_the_widths_of_a_surface_are_searched_between_a_twentieth_and_twenty_pitches(true, found):
    """Loads beside the middles of texels, so that narrow ones are seen."""
    narrow = dataclasses.replace(FLAT, texel_size=(0.1e-3, 0.15e-3)) if true < 1 else FLAT
    apart = (narrow.centres - narrow.centres[:, None])[..., :2]
    half, sigma = np.array(narrow.texel_size) / 2, true * np.array(FLAT.pitch)
    response = (norm.cdf(apart + half, scale=sigma) - norm.cdf(apart - half, scale=sigma)).prod(axis=2)
    fit = fit_surface_gaussian(narrow, response)
    np.testing.assert_allclose(fit.sigma, found * np.array(FLAT.pitch), rtol=2e-2)


CURVE = {"load": [1.0, 2.0, 3.0], "depth": [1e-5, 2e-5, 4e-5]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"load": [0.0, 2.0, 3.0]}, r"load must be positive and finite, not \[0.0, 2.0, 3.0\]"),
        ({"load": [1.0, 2.0, np.inf]}, "load must be positive and finite"),
        ({"depth": [1e-5, 0.0, 4e-5]}, "depth must be positive and finite"),
        ({"depth": [1e-5, 2e-5, -4e-5]}, "depth must be positive and finite"),
        ({"depth": [1e-5, np.inf, 4e-5]}, "depth must be positive and finite"),
        ({"load": [[1.0, 2.0]], "depth": [[1e-5, 2e-5]]}, r"one shape, not \(1, 2\) and \(1, 2\)"),
        ({"load": [1.0, 2.0]}, r"one shape, not \(2,\) and \(3,\)"),
        ({"load": [1.0], "depth": [1e-5]}, "two or more"),
    ],
)
def test_bad_curves_are_refused(change, message):
    given = {**CURVE, **change}
    with pytest.raises(FastModelError, match=message):
        fit_foundation(Sphere(radius=5e-3), given["load"], given["depth"])
    with pytest.raises(FastModelError, match=message):
        fit_contact(**given)


def test_two_points_suffice_and_the_estimators_are_named():
    found = fit_foundation(Box(size=(2e-3, 5e-3, 3e-3)), [2.0, 6.0], [1e-4, 2e-4])
    assert found.estimator == "least-squares-force"
    assert found.estimates == pytest.approx(
        {"least-squares-force": (2.0 * 1e-9 + 6.0 * 2e-9) / 5e-18, "lightest": 2.0 / 1e-9, "heaviest": 6.0 / 2e-9}
    )


@pytest.mark.parametrize("off", [0.9e-6, -0.9e-6])
def test_a_matched_load_may_be_rounded(off):
    found = fit_contact(**CURVE, matched=3.0 * (1 + off), timestep=5e-3)
    assert (found.load, found.depth) == (3.0, 4e-5)
    with pytest.raises(FastModelError, match=r"one of the loads \[1.0, 2.0, 3.0\] N, not"):
        fit_contact(**CURVE, matched=3.0 * (1 + 2 * off), timestep=5e-3)


@pytest.mark.parametrize("depth", [1e-6, 3e-5, 0.8e-3, 4e-3])
def test_the_volume_below_the_top_is_that_of_a_cap_at_any_depth(depth):
    """Also where it is a small part of the footprint, or almost all of the lower half."""
    found = fit_foundation(Sphere(radius=5e-3), [1.0, 2.0], [depth, depth])
    volume = np.pi * depth**2 * (5e-3 - depth / 3)
    assert found.estimates["lightest"] == pytest.approx(1 / volume, rel=3e-3)
    assert found.modulus == pytest.approx(1.5 / volume, rel=3e-3)


@pytest.mark.parametrize(("count", "middle"), [(2, 1), (3, 1), (4, 2)])
def test_the_middle_load_is_matched_at_steps_of_a_millisecond_unless_others_are_given(count, middle):
    """The depths are so small that the time constant is two and a half steps."""
    load, depth = np.arange(1.0, count + 1), 1e-6 * np.arange(1.0, count + 1)
    found = fit_contact(load, depth)
    assert (found.load, found.depth) == (load[middle], depth[middle])
    assert found.solref == pytest.approx((2.5e-3, 1.0))
    assert found.sinks[middle] == pytest.approx(depth[middle], rel=0.01)
    assert found.plate(None).solref == found.solref
