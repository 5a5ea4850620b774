"""The whole evaluation: verification of the elements, and sensors that are refused."""

import dataclasses

import pytest

from validation.campaign.evaluation import evaluate, verify
from validation.errors import InputError
from validation.sensor_file import load


def test_elements_agree_with_the_closed_form_layer(wts_derivation):
    differences = verify(wts_derivation)
    assert 0 < differences["radial_profile"] < 5e-3
    assert 0 < differences["texel_response"] < 5e-3


def test_verification_notices_a_response_that_is_one_percent_off(wts_derivation):
    spread = wts_derivation.influence
    off = dataclasses.replace(spread, pressure_per_force=1.01 * spread.pressure_per_force)
    assert verify(dataclasses.replace(wts_derivation, influence=off))["radial_profile"] > 5e-3


def test_cover_of_limited_size_is_refused_before_any_work():
    sensor = load("wts-0614-34")
    small = dataclasses.replace(sensor, cover=dataclasses.replace(sensor.cover, size=(30e-3, 60e-3)))
    with pytest.raises(InputError, match=r"cover\.size: a report takes laterally wide covers only"):
        evaluate(small)
