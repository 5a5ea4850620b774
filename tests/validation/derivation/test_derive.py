"""The derivation balances forces, fits the kernel and writes complete parameters."""

import dataclasses

import numpy as np
import pytest

import fastmodel
from meshes import Cylinder
from validation.derivation.derive import derive
from validation.errors import InputError
from validation.sensor_file import load


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


def test_kernel_of_the_sensor_file_goes_to_the_fast_model():
    own, sensor = fastmodel.Gaussian.from_sigma(1.0), load("wts-0614-34")
    electronics = dataclasses.replace(sensor.electronics, calibrated="texel force")
    found = derive(dataclasses.replace(sensor, spread=own, electronics=electronics))
    assert found.parameters.spread == own
    assert (found.tip, found.parameters.electronics.tip_share, found.parameters.surface) == (None, None, None)


def test_parameters_come_back_from_their_folder(derivation, tmp_path):
    derivation.parameters.save(tmp_path)
    again = fastmodel.load(tmp_path)
    assert again.spread == derivation.parameters.spread
    assert again.provenance["cover_assumed"] is True
    assert tuple(again.provenance["undetermined"]) == derivation.undetermined
    assert again.provenance["depth"]["foundation"]["modulus"] == derivation.depth.foundation.modulus


def test_curved_array_is_refused():
    sensor = load("wts-0614-34")
    centres = sensor.array.centres.copy()
    centres[0, 2] = 1e-3
    curved = dataclasses.replace(sensor, array=dataclasses.replace(sensor.array, centres=centres))
    with pytest.raises(InputError, match="array: a planar cover needs a planar array"):
        derive(curved)


def test_texels_in_no_grid_are_fitted_and_felt(derivation, tmp_path, monkeypatch):
    """A honeycomb: the kernel belongs to pitch and cover, whatever the order of texels; cells know where they are."""

    def fail(*_):
        raise ValueError("no range")

    monkeypatch.setattr("validation.derivation.layers.press_ball_on_array", fail)
    rows = [((c + r % 2 / 2) * 3.926, r * 3.4) for r in range(-2, 3) for c in range(-2, 3)]
    (tmp_path / "texels.csv").write_text("x,y,z\n" + "".join(f"{x}e-3,{y}e-3,0\n" for x, y in rows))
    (tmp_path / "s.toml").write_text(
        '[array]\npositions = "texels.csv"\n[[cover.layer]]\nthickness = "2 mm"\n'
        'material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49 }\n'
        '[electronics]\nrate = "271 Hz"\nsensitivity = "2665.7 1/N"\n'
    )
    # cover and pitch are those of `derivation`, whose stored solutions serve here too
    told = []
    comb = derive(
        dataclasses.replace(load(str(tmp_path / "s.toml")), cover=derivation.sensor.cover), progress=told.append
    )
    assert "the range of the fast model is not stated: no range" in told
    assert comb.parameters.validity is None
    assert comb.texel_response.shape == (1, 25)
    assert comb.fit.gaussian.sigma_x == pytest.approx(comb.fit.gaussian.sigma_y, rel=1e-6)
    pressed = fastmodel.indent(comb.parameters, Cylinder(radius=0.25e-3), load=1e-3, at=(1.963e-3, 3.4e-3))
    assert pressed.method == "cover"
    exact = comb.influence.texel_response(comb.sensor.array, load="point", texel=17)
    assert np.abs(pressed.texel_forces / 1e-3 - exact).sum() / 2 < 0.06  # a cell is not a point
    assert np.abs(comb.texel_response.ravel() - exact).sum() / 2 > 0.5
