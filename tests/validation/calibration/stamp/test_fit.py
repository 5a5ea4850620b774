"""Fits find the parameters that made the data."""

import numpy as np
import pytest

from tests.support.stamp import ARRAY, CURVE, OUTPUT_MAX, by_name, case_of, file_of, synthetic
from validation.calibration.stamp.fit import fit
from validation.calibration.stamp.forward_models import StampModel, uniform


def test_a_fit_finds_the_pose_the_width_and_the_curve_that_made_the_data():
    truth = (-0.5e-3, 11.3e-3, 0.1, np.log(0.7))
    plain, gained = fit(by_name("uniform pressure"), synthetic(truth), ARRAY, output_max=OUTPUT_MAX)
    found = plain.parameters()
    assert plain.rms < 3
    assert found["x_m"] == pytest.approx(-0.5e-3, abs=0.05e-3)
    assert found["y_m"] == pytest.approx(11.3e-3, abs=0.05e-3)
    assert found["sigma_pitches"] == pytest.approx(0.7, rel=0.05)
    assert found["sensitivity_per_N"] == pytest.approx(6000, rel=0.05)
    assert found["dead_force_N"] == pytest.approx(0.05, rel=0.2)
    assert plain.counts(file_of("H").load) == pytest.approx(synthetic(truth, "H")[0].counts, abs=30)
    assert gained.parameters()["gain_sd"] < 0.02


def test_gains_come_back_and_explain_what_one_curve_cannot():
    truth = (0.3e-3, 10.9e-3, 0.0, np.log(0.5))
    gains = np.exp(np.random.default_rng(4).normal(0, 0.15, 78))
    plain, gained = fit(by_name("uniform pressure"), synthetic(truth, gains=gains), ARRAY, output_max=OUTPUT_MAX)
    assert gained.rms < plain.rms / 3
    bright = uniform(ARRAY, (0.0, 0.0)).texel_forces(np.array(truth)) > 0.05
    assert np.corrcoef(np.log(gained.gains[bright]), np.log(gains[bright]))[0, 1] > 0.9


def test_thickness_comes_back_from_a_layers_own_data():
    model = by_name("reference")
    candidate = model.candidates((0.0, 0.0))[-1]
    forces = candidate.texel_forces(np.array([-0.5e-3, 11e-3, 0.0, np.log(3e-3)]))
    cases = [case_of(letter, CURVE.counts(file_of(letter).load * forces)) for letter in "ADH"]
    only = StampModel(name=model.name, about="", candidates=lambda guess: model.candidates(guess)[-1:])
    found, _ = fit(only, cases, ARRAY, output_max=OUTPUT_MAX)
    assert found.parameters()["thickness_m"] == pytest.approx(3e-3, rel=0.05)
