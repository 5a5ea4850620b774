import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fastmodel.errors import FastModelError
from fastmodel.fitting.gaussian import fit_gaussian
from fastmodel.signal.point_spread import Gaussian
from meshes.catalogue import ARRAYS

WTS = ARRAYS["wts-0614-34"]
LOADED = (7, 3)


def image_of(gaussian):
    return WTS.image(gaussian.operator(WTS)[:, WTS.middle])


@settings(max_examples=25, deadline=None)
@given(st.floats(0.27, 5.0), st.floats(0.27, 5.0))
@example(1.1, 4.11328125)  # just over a jump of ksize, with a fit just under it that agrees with itself
def test_synthetic_gaussian_is_recovered_whatever_the_load(sigma_x, sigma_y):
    truth = Gaussian.from_sigma(sigma_x, sigma_y)
    fit = fit_gaussian(4.2 * image_of(truth), LOADED, load=4.2)
    assert fit.gaussian.sigma_x == pytest.approx(sigma_x, abs=1e-6)
    assert fit.gaussian.sigma_y == pytest.approx(sigma_y, abs=1e-6)
    assert (fit.gaussian.ksize_x, fit.gaussian.ksize_y) == (truth.ksize_x, truth.ksize_y)
    assert fit.residual < 1e-6


def test_residual_and_outside_kernel_follow_their_definitions():
    truth = Gaussian.from_sigma(0.5)
    image = 0.9 * image_of(truth)
    image[0, 0] += 0.06
    fit = fit_gaussian(image, LOADED)
    kernel = image_of(fit.gaussian)
    assert fit.residual == pytest.approx(0.5 * np.abs(image - kernel).sum(), rel=1e-12)
    assert fit.outside_kernel == pytest.approx(1 - image[kernel > 0].sum(), rel=1e-12)
    assert fit.outside_kernel == pytest.approx(0.1, abs=2e-3)


def test_it_is_the_least_squares_minimum_of_the_kernel():
    rng = np.random.default_rng(5)
    image = image_of(Gaussian.from_sigma(0.9, 0.7)) + 0.01 * rng.normal(size=(14, 6))
    fit = fit_gaussian(image, LOADED)
    least = np.sum((image - image_of(fit.gaussian)) ** 2)
    for name, step in itertools.product(("sigma_x", "sigma_y"), (1e-3, -1e-3)):
        other = dataclasses.replace(fit.gaussian, **{name: getattr(fit.gaussian, name) + step})
        assert np.sum((image - image_of(other)) ** 2) > least


def test_masked_texels_do_not_affect_the_fit():
    active = np.ones((14, 6), dtype=bool)
    active[7, 4] = False
    image = image_of(Gaussian.from_sigma(0.8, 0.6))
    measured = image[active].sum()
    image[7, 4] = 0.5
    fit = fit_gaussian(image, LOADED, active=active)
    assert fit.gaussian.sigma_x == pytest.approx(0.8, abs=1e-6)
    assert fit.outside_kernel == pytest.approx(1 - measured)
    assert abs(fit_gaussian(image, LOADED).gaussian.sigma_x - 0.8) > 1e-3


def test_extreme_responses_end_in_range():
    single = np.zeros((14, 6))
    single[LOADED] = 1
    assert fit_gaussian(single, LOADED).gaussian.ksize_x == 1
    assert np.isfinite(fit_gaussian(np.full((14, 6), 1 / 84), LOADED).gaussian.sigma_x)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"loaded": (14, 0)}, "not on an image"),
        ({"load": 0}, "load must be positive"),
        ({"response": np.full((14, 6), np.nan)}, "nan"),
        ({"radius": [0, 1.0]}, "together"),
    ],
)
def test_bad_input_raises_an_error_that_names_the_fault(change, message):
    with pytest.raises(FastModelError, match=message):
        fit_gaussian(**{"response": np.zeros((14, 6)), "loaded": LOADED, **change})
