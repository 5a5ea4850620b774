import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastmodel.errors import FastModelError
from fastmodel.fitting.gaussian import estimate_from_image, fit_gaussian
from fastmodel.signal.point_spread import Gaussian
from meshes.catalogue import ARRAYS

WTS = ARRAYS["wts-0614-34"]
LOADED = (7, 3)


def image_of(gaussian):
    return WTS.image(gaussian.operator(WTS)[:, WTS.middle])


def test_every_estimator_finds_a_gaussian_and_carries_its_name():
    """On a wide continuous Gaussian all of them must agree; on anything else they need not."""
    sigma, pitch = 1.0, 3.4e-3
    radius = np.linspace(0, 10 * pitch, 4001)
    pressure = np.exp(-0.5 * (radius / (sigma * pitch)) ** 2) / (2 * np.pi * (sigma * pitch) ** 2)
    big = np.exp(-0.5 * (np.arange(-12, 13) / sigma) ** 2)
    big = np.outer(big, big) / big.sum() ** 2
    fit = fit_gaussian(
        big, (12, 12), point_response=big, radius=radius, pressure_per_force=pressure, pitch=(pitch, pitch)
    )
    assert {name for name, _ in fit.estimates.items()} == {
        "least-squares-uniform",
        "least-squares-uniform-uncut",
        "least-squares-point",
        "variance-uniform",
        "peak-uniform",
        "neighbour-uniform",
        "variance-point",
        "peak-point",
        "neighbour-point",
        "radial-profile",
        "radial-profile-area",
        "radial-peak",
        "radial-half-height",
        "radial-half-force",
        "radial-variance",
    }
    for name, pair in fit.estimates.items():
        assert pair == pytest.approx((1.0, 1.0), rel=2e-3), name
    assert fit.estimates["least-squares-uniform-uncut"] == pytest.approx((1.0, 1.0), abs=1e-6)
    assert fit.estimates["radial-profile"] == pytest.approx((1.0, 1.0), abs=1e-6)


def test_negative_rings_give_nan_and_no_exception():
    image = image_of(Gaussian.from_sigma(0.4))
    image[7, 1] = image[7, 5] = image[5, 3] = image[9, 3] = -0.2
    estimates = fit_gaussian(image, LOADED).estimates
    assert np.isnan(estimates["variance-uniform"][0])


@settings(max_examples=30, deadline=None)
@given(st.floats(0.3, 2), st.floats(0.3, 2))
def test_transposing_the_image_swaps_both_widths(sigma_x, sigma_y):
    image = np.outer(*(np.exp(-0.5 * (np.arange(-9, 10) / sigma) ** 2) for sigma in (sigma_y, sigma_x)))
    image /= image.sum()
    widths, swapped = estimate_from_image(image, (9, 9), "uniform"), estimate_from_image(image.T, (9, 9), "uniform")
    for name, (x, y) in widths.items():
        assert swapped[name] == pytest.approx((y, x), rel=1e-9)


@pytest.mark.parametrize("missing", ["radius", "pressure_per_force", "pitch"])
def test_radial_estimators_name_what_they_need_together(missing):
    whole = {"radius": np.linspace(0, 1e-2, 50), "pressure_per_force": np.linspace(1e5, 0, 50), "pitch": (3e-3, 3e-3)}
    given = {name: value for name, value in whole.items() if name != missing}
    with pytest.raises(FastModelError, match="need radius, pressure_per_force and pitch together"):
        fit_gaussian(image_of(Gaussian.from_sigma(0.7)), LOADED, **given)
