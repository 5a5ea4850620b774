import dataclasses
import json

import numpy as np
import pytest

import fastmodel
from fem_reference.closed_form import point_response
from validation.derive import derive
from validation.errors import InputError
from validation.plain import plain
from validation.resolution import two_point_separation
from validation.sensor_file import load


@pytest.fixture(scope="module")
def derivation():
    return derive(load("wts-0614-34"))


def test_forces_and_what_leaves_balance_the_load(derivation):
    for response, outside in zip(
        (derivation.texel_response, derivation.texel_response_uniform), derivation.outside, strict=True
    ):
        assert outside > 1e-3
        assert response.sum() + outside == pytest.approx(1, abs=1e-4)


def test_kernel_is_fitted_to_the_uniform_response(derivation):
    gaussian, uniform = derivation.fit.gaussian, derivation.texel_response_uniform

    def misfit(sigma):
        kernel = fastmodel.Gaussian(sigma_x=sigma, sigma_y=sigma, ksize_x=gaussian.ksize_x, ksize_y=gaussian.ksize_y)
        array = derivation.sensor.array
        return ((kernel.operator(array)[:, array.middle].reshape(uniform.shape) - uniform) ** 2).sum()

    best = misfit(gaussian.sigma_x)
    assert best < misfit(0.99 * gaussian.sigma_x)
    assert best < misfit(1.01 * gaussian.sigma_x)


def test_json_has_the_keys_that_others_rely_on(derivation):
    result = json.loads(json.dumps(plain(derivation.as_json()), allow_nan=False))
    assert result["psf"].keys() >= {
        "sigma_x",
        "sigma_y",
        "ksize_x",
        "ksize_y",
        "estimator",
        "estimates",
        "residual",
        "outside_kernel",
    }
    assert result["psf"]["estimates"][result["psf"]["estimator"]] == [
        result["psf"]["sigma_x"],
        result["psf"]["sigma_y"],
    ]
    assert np.shape(result["texel_response"]) == np.shape(result["texel_response_uniform"]) == (14, 6)
    assert result["point_response"].keys() == {"radius_m", "pressure_per_force"}
    assert result["error_estimate"].keys() == {"total_force", "peak_texel", "sigma"}
    assert result["sensitivity"].keys() == {"thickness", "poisson_ratio"}
    assert result["cover"]["assumed"] is True


def test_profile_is_that_of_the_exact_layer(derivation):
    radius = np.linspace(0, 8e-3, 60)
    exact = point_response(derivation.sensor.cover, radius)
    assert np.abs(derivation.point_spread.pressure(radius) - exact).max() < 5e-3 * exact.max()


@pytest.fixture(scope="module")
def thicker():
    return derive(load("wts-0614-34", thickness="2.1mm"))


def test_sensitivity_to_thickness_predicts_a_thicker_cover(derivation, thicker):
    name = "least-squares-uniform-uncut"
    change = thicker.fit.estimates[name][0] - derivation.fit.estimates[name][0]
    assert change == pytest.approx(derivation.sensitivity["thickness"] * 1e-4, rel=0.1)


def test_resolution_scales_with_the_cover(derivation, thicker):
    assert thicker.resolution == pytest.approx(1.05 * derivation.resolution, rel=0.01)
    assert derivation.resolution_on_array >= 2 * derivation.sensor.array.pitch[0] - 1e-9


def test_separation_of_a_gaussian_is_known():
    # For exp(-r2 / 2 s2) the midpoint dips below the loads from 2.35 s or so on (2 e^(-d2/8) = 1 + e^(-d2/2)).
    @dataclasses.dataclass
    class Profile:
        radius: np.ndarray
        pressure_per_force: np.ndarray

    radius = np.linspace(0, 20, 4000)
    found = two_point_separation(Profile(radius, np.exp(-(radius**2) / 2)))
    assert 2 * np.exp(-(found**2) / 8) == pytest.approx(1 + np.exp(-(found**2) / 2), abs=0.01)


def test_kernel_of_the_sensor_file_goes_to_the_fast_model():
    own = fastmodel.Gaussian.from_sigma(1.0)
    sensor = dataclasses.replace(load("wts-0614-34"), spread=own)
    assert derive(sensor).parameters.spread == own


def test_parameters_come_back_from_their_folder(derivation, tmp_path):
    derivation.parameters.save(tmp_path)
    again = fastmodel.load(tmp_path)
    assert again.spread == derivation.parameters.spread
    assert again.provenance["cover_assumed"] is True


def test_curved_array_is_refused():
    sensor = load("wts-0614-34")
    centres = sensor.array.centres.copy()
    centres[0, 2] = 1e-3
    curved = dataclasses.replace(sensor, array=dataclasses.replace(sensor.array, centres=centres))
    with pytest.raises(InputError, match="curved"):
        derive(curved)
