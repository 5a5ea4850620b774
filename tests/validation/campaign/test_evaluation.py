"""The whole evaluation: verification of the elements, and sensors that are refused."""

import dataclasses

import pytest

from validation.campaign import evaluation
from validation.campaign.case import Case
from validation.campaign.evaluation import evaluate
from validation.campaign.plan import Budget
from validation.sensor_file import load


def test_elements_agree_with_the_closed_form_layer(wts_derivation):
    differences = wts_derivation.verification
    assert 0 < differences["radial_profile"] < 5e-3
    assert 0 < differences["texel_response"] < 5e-3


def test_verification_notices_a_response_that_is_one_percent_off(wts_derivation):
    spread = wts_derivation.influence
    off = dataclasses.replace(spread, pressure_per_force=1.01 * spread.pressure_per_force)
    assert dataclasses.replace(wts_derivation, influence=off).verification["radial_profile"] > 5e-3


@pytest.mark.slow
def test_the_cost_is_announced_before_the_long_computations(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    told = []

    def derive(*_, **__):
        told.append("derived")
        raise KeyboardInterrupt

    monkeypatch.setattr("validation.campaign.evaluation.derive", derive)
    cases = [Case.read(name, "sphere:radius=5mm", load) for name, load in (("light", "50 g"), ("heavy", "500 g"))]
    with pytest.raises(KeyboardInterrupt):
        evaluate(load("wts-0614-34"), cases=cases, announce=told.append)
    assert len(told) == 2
    assert told[0].startswith("2 cases, 2 reference solutions missing from the store; about ")
    assert told[1] == "derived"


@pytest.mark.slow
def test_no_model_is_fitted_to_a_spare_case(monkeypatch):
    sensor, asked = load("wts-0614-34"), []

    def prepare(_derivation, cases, _progress):
        asked.extend(cases)
        raise InterruptedError

    monkeypatch.setattr(evaluation, "derive", lambda *_args, **_options: None)
    monkeypatch.setattr(evaluation, "prepare_bench", prepare)
    with pytest.raises(InterruptedError):
        evaluation.evaluate(sensor, budget=Budget(seconds=120.0))
    assert len(asked) == len(evaluation.read_plan(None, sensor).cases)  # all fit into ten more minutes
