"""One indentation by both models."""

import numpy as np
import pytest

from validation.campaign.case import Case
from validation.campaign.comparison import compare_models

CASE = Case.read("sphere", "sphere:radius=5mm", "200 g", at="0.7mm,-1.1mm")


@pytest.fixture(scope="module")
def comparison(wts_derivation):
    return compare_models(wts_derivation.sensor, CASE, parameters=wts_derivation.parameters)


def test_a_comparison_scores_like_a_campaign(comparison, bench):
    assert comparison.score.as_json() == pytest.approx(bench.solve(CASE).predictions["fast"].score.as_json())


def test_json_shows_images_and_the_models_that_were_named(comparison, wts_derivation):
    shown = comparison.as_json()
    assert shown["models"].keys() == {"fem", "fast"}
    assert all(np.shape(model["texel_forces"]) == (14, 6) for model in shown["models"].values())
    assert shown["cover"] == wts_derivation.sensor.describe_cover()
    assert shown["load"] == pytest.approx(CASE.load, rel=1e-6)


def test_a_depth_sets_the_load_of_the_fast_model(comparison, wts_derivation):
    told = []
    found = compare_models(
        wts_derivation.sensor,
        CASE,
        parameters=wts_derivation.parameters,
        depth=comparison.fem.depth,
        models=("fast",),
        progress=told.append,
    )
    assert found.case.load == pytest.approx(CASE.load, rel=1e-3)
    assert found.fast.total_force == pytest.approx(CASE.load, rel=1e-3)
    assert found.as_json()["models"].keys() == {"fast"}
    assert told[0] == "indentation by finite elements"
    assert told[-1] == "indentation by the fast model"


def test_a_model_without_its_data_is_refused(wts_derivation):
    with pytest.raises(ValueError, match="description of the cover"):
        compare_models(wts_derivation.parameters, CASE, models=("fem",))
    with pytest.raises(ValueError, match="needs its parameters"):
        compare_models(wts_derivation.sensor, CASE, models=("fast",))


def test_fast_model_is_not_derived_for_a_score_below_the_reference_error(wts_derivation, monkeypatch):
    monkeypatch.setattr("validation.campaign.comparison._NO_SCORE", 0.0)  # below the error of any finite elements

    def derive():
        raise AssertionError

    found = compare_models(wts_derivation.sensor, CASE, parameters=derive)
    assert found.fem is not None
    assert (found.fast, found.score, found.models) == (None, None, ("fem",))
    assert "not derived for a score; --model fast" in found.note
