"""Widths, moduli and contact parameters of curves whose values are known in closed form."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from fastmodel import Plate
from fastmodel.errors import FastModelError
from fastmodel.fitting.contact_stiffness import fit_contact, fit_foundation
from fastmodel.fitting.gaussian import estimate_from_image, estimate_from_profile, fit_gaussian
from meshes import Box
from meshes.constants import STANDARD_GRAVITY

WIDTH = 2e-3
HALF = np.sqrt(2 * np.log(2))


@pytest.fixture(scope="module")
def widths():
    """Of the pressure exp(-r / a) / (2 pi a^2) around a unit force."""
    radius = np.linspace(0, 30 * WIDTH, 6001)
    return estimate_from_profile(radius, np.exp(-radius / WIDTH) / (2 * np.pi * WIDTH**2))


def misfit(width, power):
    """Squared difference between a Gaussian and the exponential, with weight r ** power."""

    def square(r):
        return r**power * (np.exp(-0.5 * (r / width) ** 2) / width**2 - np.exp(-r)) ** 2

    return quad(square, 0, 30, epsabs=1e-13, limit=200)[0]


def test_widths_of_an_exponential_profile(widths):
    inside = brentq(lambda x: 1 - (1 + x) * np.exp(-x) - 0.5, 0.1, 10)
    expected = {
        "radial-peak": 1.0,
        "radial-half-height": np.log(2) / HALF,
        "radial-half-force": inside / HALF,
        "radial-variance": np.sqrt(3),
        "radial-profile": minimize_scalar(lambda s: misfit(s, 0), bounds=(0.3, 5), method="bounded").x,
        "radial-profile-area": minimize_scalar(lambda s: misfit(s, 1), bounds=(0.3, 5), method="bounded").x,
    }
    assert widths.keys() == expected.keys()
    for name, value in expected.items():
        assert widths[name] / WIDTH == pytest.approx(value, rel=2e-3), name
    assert abs(expected["radial-profile"] - expected["radial-profile-area"]) > 0.1


def test_widths_that_a_profile_does_not_show_are_no_numbers():
    """Up to a radius within which neither half the force nor half the height is reached; and one that is negative."""
    radius = np.linspace(0, 0.5 * WIDTH, 50)
    found = estimate_from_profile(radius, np.exp(-radius / WIDTH) / (2 * np.pi * WIDTH**2))
    assert np.isnan([found["radial-half-height"], found["radial-half-force"]]).all()
    far = np.linspace(0, 10, 200)
    assert np.isnan(estimate_from_profile(far, np.where(far < 1, 1.0, -1.0))["radial-variance"])
    # a value of exactly half the peak at a sample is the crossing
    three = estimate_from_profile(np.array([0, 1.0, 2.0]), np.array([4.0, 2.0, 0.0]))
    assert three["radial-half-height"] == pytest.approx(1 / HALF)


def test_radial_widths_are_given_in_the_pitches_of_each_axis():
    radius = np.linspace(0, 30 * WIDTH, 3001)
    image = np.outer([0.1, 0.3, 0.1], [0.12, 0.3, 0.12])
    known = {"radius": radius, "pressure_per_force": np.exp(-radius / WIDTH) / (2 * np.pi * WIDTH**2)}
    found = fit_gaussian(image / image.sum(), (1, 1), **known, pitch=(1e-3, 4e-3)).estimates
    assert found["radial-peak"] == pytest.approx((2.0, 0.5))
    for change in ({"radius": radius[1:]}, {"radius": 0 * radius}):
        with pytest.raises(FastModelError, match="radius must rise and match"):
            fit_gaussian(image, (1, 1), **{**known, **change}, pitch=(1e-3, 4e-3))
    for values in (np.append(1.0, np.full(3000, np.nan)), 0 * radius):
        with pytest.raises(FastModelError, match="finite and positive at the first radius"):
            fit_gaussian(image, (1, 1), radius=radius, pressure_per_force=values, pitch=(1e-3, 4e-3))


def test_widths_of_an_image_are_those_of_its_sums_peak_and_neighbours():
    """Off the middle of an oblong image, whose corner has one neighbour along each axis."""
    image = np.array([[0.32, 0.08, 0.02, 0.01], [0.16, 0.05, 0.02, 0.0], [0.04, 0.01, 0.0, 0.01]])
    for row, column in ((0, 0), (1, 0), (0, 1)):
        found = estimate_from_image(image, (row, column), "point")
        square_x = (image * (np.arange(4) - column) ** 2).sum() / image.sum()
        square_y = (image * (np.arange(3)[:, None] - row) ** 2).sum() / image.sum()
        assert found["variance-point"] == pytest.approx((np.sqrt(square_x), np.sqrt(square_y)))
        peak = image[row, column]
        assert found["peak-point"] == pytest.approx((1 / np.sqrt(2 * np.pi * peak),) * 2)
        beside_x = [image[row, k] for k in (column - 1, column + 1) if k >= 0]
        beside_y = [image[k, column] for k in (row - 1, row + 1) if k >= 0]
        for side, beside in zip(found["neighbour-point"], (beside_x, beside_y), strict=True):
            mean = np.mean(beside)
            assert side == pytest.approx(1 / np.sqrt(2 * np.log(peak / mean)) if mean < peak else np.nan, nan_ok=True)
    lost = estimate_from_image(np.array([[0.0, 1.0]]), (0, 0), "uniform")
    assert np.isnan(lost["peak-uniform"]).all()
    assert np.isnan(lost["neighbour-uniform"]).all()
    assert lost["variance-uniform"] == (1.0, 0.0)
    assert np.isnan(estimate_from_image(np.array([[-1.0, 1.0]]), (0, 1), "uniform")["variance-uniform"]).all()


def test_estimates_of_a_foundation_are_those_of_least_squares():
    depth, force = np.array([0.1e-3, 0.2e-3, 0.4e-3]), np.array([1.0, 1.5, 3.2])
    found, volume = fit_foundation(Box(size=(2e-3, 5e-3, 3e-3)), force, depth), 10e-6 * depth
    slope = (force @ volume) / (volume @ volume)
    miss = force - slope * volume
    assert found.modulus == pytest.approx(slope)
    assert found.uncertainty == pytest.approx(np.sqrt((miss**2).sum() / 2 / (volume**2).sum()))
    assert found.residual == pytest.approx(np.sqrt((miss**2).mean() / (force**2).mean()))
    assert found.estimates["lightest"] == pytest.approx(force[0] / volume[0])
    assert found.estimates["heaviest"] == pytest.approx(force[-1] / volume[-1])


@pytest.mark.parametrize("timestep", [1e-3, 4e-3])
def test_contact_parameters_follow_from_the_depth_of_a_ball_at_rest(timestep):
    """A free ball on one contact sinks by (1 - d) g t^2; the time constant is at least 2.5 steps."""
    depth = np.array([0.02e-3, 0.03e-3, 0.05e-3, 0.06e-3])
    found = fit_contact([0.5, 1.0, 2.0, 4.0], depth, timestep=timestep)
    constant = max(2.5 * timestep, np.sqrt(0.05e-3 / (0.05 * STANDARD_GRAVITY)))
    impedance = 1 - 0.05e-3 / (STANDARD_GRAVITY * constant**2)
    assert found.solref == pytest.approx((constant, 1.0))
    assert found.solimp == pytest.approx((impedance, impedance, 1e-3, 0.5, 2.0))
    assert (found.load, found.depth) == (2.0, 0.05e-3)
    assert found.mass == pytest.approx(2.0 / STANDARD_GRAVITY)
    np.testing.assert_allclose(found.misses, found.sinks / depth - 1)
    plate = found.plate(Plate(height=3e-3, margin=1e-3))
    assert dataclasses.replace(plate, solref=None, solimp=None) == Plate(height=3e-3, margin=1e-3)
    assert (plate.solref, plate.solimp) == (found.solref, found.solimp)
    assert found.plate().height == Plate().height
