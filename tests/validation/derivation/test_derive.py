import dataclasses
import json

import numpy as np
import pytest

import fastmodel
from fem_reference import point_spread, press
from fem_reference.closed_form import point_response
from meshes import Cover, Cylinder, Layer, Material, Sphere
from validation.derivation.derive import derive
from validation.derivation.kernel_fit import uncut_sigma
from validation.derivation.resolution import two_point_separation
from validation.derivation.sensitivity import sigma_sensitivities
from validation.derivation.undetermined import list_undetermined
from validation.errors import InputError
from validation.json_values import json_text
from validation.sensor_file import load


@pytest.fixture(scope="module")
def derivation(wts_derivation):
    return wts_derivation


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
    result = json.loads(json_text(derivation.as_json()))
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
    assert result["sensitivity"].keys() == {"thickness", "poisson_ratio", "youngs_modulus"}
    assert result["cover"]["assumed"] is True


def test_profile_is_that_of_the_exact_layer(derivation):
    radius = np.linspace(0, 8e-3, 60)
    exact = point_response(derivation.sensor.cover, radius)
    assert np.abs(derivation.point_spread.pressure(radius) - exact).max() < 5e-3 * exact.max()


@pytest.fixture(scope="module")
def thicker():
    return point_spread(load("wts-0614-34", thickness="2.1mm").cover)


def test_sensitivity_to_thickness_predicts_a_thicker_cover(derivation, thicker):
    own = derivation.fit.estimates["least-squares-uniform-uncut"][0]
    change = uncut_sigma(thicker, derivation.sensor.array) - own
    assert change == pytest.approx(derivation.sensitivity["thickness"] * 1e-4, rel=0.1)


def cover(*layers):
    """Layers from bottom to top: thickness [m], Young's modulus [Pa], Poisson ratio."""
    return Cover(
        layers=tuple(
            Layer(
                thickness=thickness,
                material=Material(
                    name="test", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
                ),
            )
            for thickness, modulus, ratio in layers
        )
    )


def sigma(layers):
    """Of a run of the elements."""
    return uncut_sigma(point_spread(cover(*layers)), load("wts-0614-34").array)


def sensitivity(layers):
    chosen = cover(*layers)
    return sigma_sensitivities(chosen, load("wts-0614-34").array, point_spread(chosen))


@pytest.mark.parametrize("ratio", [0.3, pytest.param(0.49, marks=pytest.mark.slow)])
def test_sensitivity_to_poisson_ratio_is_that_of_real_runs(ratio):
    low, high = (sigma([(2e-3, 1e6, ratio + step)]) for step in (-0.005, 0.005))
    assert sensitivity([(2e-3, 1e6, ratio)])["poisson_ratio"] == pytest.approx((high - low) / 0.01, rel=0.01)


def test_sensitivity_at_the_end_of_the_range_is_of_second_order():
    """A plain one-sided difference is 5 % off here."""
    end, near = sigma([(2e-3, 1e6, 0.5)]), sigma([(2e-3, 1e6, 0.4995)])
    assert sensitivity([(2e-3, 1e6, 0.5)])["poisson_ratio"] == pytest.approx((end - near) / 0.0005, rel=0.02)


@pytest.mark.slow
def test_sensitivities_of_two_layers_are_those_of_real_runs():
    """One layer at the end of its range and one far from it: neither may be measured by the other's step."""

    def layers(scale=1.0, step=0.0):
        return [(1.5e-3 * scale, 1e6, 0.3 - step), (0.5e-3 * scale, 1e7, 0.5 - step)]

    found = sensitivity(layers())
    thicker, thinner = sigma(layers(1.02)), sigma(layers(0.98))
    assert found["thickness"] == pytest.approx((thicker - thinner) / (0.04 * 2e-3), rel=1e-3)
    assert found["poisson_ratio"] == pytest.approx((sigma(layers()) - sigma(layers(step=0.002))) / 0.002, rel=0.02)


def test_youngs_modulus_drops_out_of_the_point_spread(derivation):
    assert derivation.sensitivity["youngs_modulus"] == 0
    stiff, soft = derivation.point_spread, point_spread(cover((2e-3, 1e4, 0.49)))
    assert derivation.sensor.cover.layers[0].material.youngs_modulus > 1e5
    np.testing.assert_allclose(soft.pressure_per_force, stiff.pressure_per_force, rtol=1e-6, atol=1e-6)
    two = [sigma([(1e-3, scale * 1e6, 0.49), (1e-3, scale * 1e7, 0.49)]) for scale in (1, 0.01)]
    assert two[0] == pytest.approx(two[1], rel=1e-6)


def test_of_several_layers_the_ratio_of_moduli_counts(derivation):
    """The test above can fail; two layers of one material are the derivation's single one."""
    alike = uncut_sigma(derivation.point_spread, derivation.sensor.array)
    assert abs(sigma([(1e-3, 1e6, 0.49), (1e-3, 1e7, 0.49)]) - alike) > 0.01


def test_resolution_is_that_of_two_touches_on_the_exact_layer(derivation):
    """Base pressure between two point loads, superposed from the exact solution: a dip beyond the resolution only."""
    for factor, dips in ((0.97, False), (1.03, True)):
        apart = factor * derivation.resolution
        place = np.linspace(0, apart, 201)
        pressure = point_response(derivation.sensor.cover, place)
        pressure = pressure + pressure[::-1]
        assert (pressure[100] < pressure[0] - 1e-3 * pressure.max()) == dips


def test_resolution_on_the_array_is_that_of_two_touches_on_real_texels(derivation):
    """Two touches on the array's own middle row, at every alignment: a texel between reads less than both sides."""
    array, spread = derivation.sensor.array, derivation.point_spread
    apart, row = derivation.resolution_on_array, array.centres[array.middle, 1]

    def dips(separation):
        found = []
        for shift in np.arange(8) / 8 * array.pitch[0]:
            touches = np.array([[shift - separation / 2, row], [shift + separation / 2, row]])
            image = array.image(spread.texel_influence(array, touches).sum(axis=0))[array.rows // 2]
            left, right = (round(float(x) / array.pitch[0] + 2.5) for x in touches[:, 0])
            between = image[left + 1 : right]
            found.append(between.size > 0 and between.min() < min(image[left], image[right]) - 1e-3 * image.max())
        return all(found)

    assert dips(apart)
    assert not dips(apart - array.pitch[0] / 4)


def test_resolution_scales_with_the_cover(derivation, thicker):
    assert two_point_separation(thicker) == pytest.approx(1.05 * derivation.resolution, rel=0.01)
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
    assert tuple(again.provenance["undetermined"]) == derivation.undetermined
    assert again.provenance["depth"]["foundation"]["modulus"] == derivation.depth.foundation.modulus


@pytest.mark.slow
def test_depths_are_those_of_the_elements_and_what_they_leave_open_is_said(derivation):
    depth = derivation.depth
    description, ball = derivation.sensor, Sphere(radius=depth.ball_radius)
    pressed = press(description.cover, description.array, ball, load=depth.load[2])
    assert depth.depth[2] == pytest.approx(pressed.depth, rel=3e-3)
    lightest, heaviest = (depth.foundation.estimates[name] for name in ("lightest", "heaviest"))
    assert lightest != pytest.approx(heaviest, rel=0.1)
    assert abs(depth.contact.misses[2]) < 1e-3 < abs(depth.contact.misses[[0, -1]]).min()
    told = " ".join(derivation.undetermined)
    for word in ("Young's modulus", "filter", "nobody measured", "foundation modulus", "g only", "friction"):
        assert word in told
    hard = dataclasses.replace(derivation.sensor.cover, assumed=False)
    assert "nobody measured" not in " ".join(list_undetermined(hard, derivation.fit, None))


def test_curved_array_is_refused():
    sensor = load("wts-0614-34")
    centres = sensor.array.centres.copy()
    centres[0, 2] = 1e-3
    curved = dataclasses.replace(sensor, array=dataclasses.replace(sensor.array, centres=centres))
    with pytest.raises(InputError, match="curved"):
        derive(curved)


def test_texels_in_no_grid_are_fitted_and_felt(tmp_path):
    """A honeycomb: the kernel belongs to pitch and cover, whatever the order of texels; cells know where they are."""
    rows = [((c + r % 2 / 2) * 3.4, r * 2.9445) for r in range(-2, 3) for c in range(-2, 3)]
    (tmp_path / "texels.csv").write_text("x,y,z\n" + "".join(f"{x}e-3,{y}e-3,0\n" for x, y in rows))
    (tmp_path / "s.toml").write_text(
        '[array]\npositions = "texels.csv"\n[[cover.layer]]\nthickness = "2 mm"\n'
        'material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49 }\n'
        '[electronics]\nrate = "271 Hz"\nsensitivity = "2665.7 1/N"\n'
    )
    comb = derive(load(str(tmp_path / "s.toml")))
    assert comb.texel_response.shape == (1, 25)
    assert comb.fit.gaussian.sigma_x == pytest.approx(comb.fit.gaussian.sigma_y, rel=1e-6)
    pressed = fastmodel.indent(comb.parameters, Cylinder(radius=0.25e-3), load=1e-3, at=(1.7e-3, 2.9445e-3))
    assert pressed.method == "cover"
    exact = comb.influence.texel_response(comb.sensor.array, load="point", texel=17)
    assert np.abs(pressed.texel_forces / 1e-3 - exact).sum() / 2 < 0.06  # a cell is not a point
    assert np.abs(comb.texel_response.ravel() - exact).sum() / 2 > 0.5
