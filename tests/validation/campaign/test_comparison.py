"""One indentation by both models."""

import numpy as np
import pytest

from validation.campaign.case import Case
from validation.pressing import read_request

BALL, PLACE = "sphere:radius=5mm", "0.7mm,-1.1mm"
CASE = Case.read("sphere", BALL, "200 g", at=PLACE)


@pytest.fixture
def press(wts_derivation, monkeypatch):
    """Press the ball on the catalogue's sensor, whose fast model is derived only once for all tests."""

    def run(sensor=wts_derivation.sensor, *, derive=lambda *_: wts_derivation.parameters, **options):
        monkeypatch.setattr("validation.pressing.find_parameters", derive)
        progress = options.pop("progress", None)
        return read_request(lambda _: sensor, BALL, pose={"at": PLACE}, **options).run(progress=progress)

    return run


@pytest.fixture
def comparison(press):
    return press(load="200 g")


def test_a_comparison_scores_like_a_campaign(comparison, bench):
    assert comparison.score.as_json() == pytest.approx(bench.solve(CASE).predictions["fast"].score.as_json())


def test_json_shows_images_and_the_models_that_were_named(comparison, wts_derivation):
    shown = comparison.as_json()
    assert shown["models"].keys() == {"fem", "fast"}
    assert all(np.shape(model["texel_forces"]) == (14, 6) for model in shown["models"].values())
    assert shown["cover"] == wts_derivation.sensor.describe_cover()
    assert shown["load"] == pytest.approx(CASE.load, rel=1e-6)


def test_a_depth_sets_the_load_of_the_fast_model(comparison, press):
    told = []
    found = press(depth=f"{comparison.fem.depth} m", models="fast", progress=told.append)
    assert found.case.load == pytest.approx(CASE.load, rel=1e-3)
    assert found.fast.total_force == pytest.approx(CASE.load, rel=1e-3)
    assert found.as_json()["models"].keys() == {"fast"}
    assert told[0] == "indentation by finite elements"
    assert told[-1] == "indentation by the fast model"


def test_finite_elements_without_a_cover_are_refused(press, wts_derivation):
    with pytest.raises(ValueError, match="description of the cover"):
        press(wts_derivation.parameters, load="200 g", models="fem")


def test_fast_model_is_not_derived_for_a_score_below_the_reference_error(press, monkeypatch):
    monkeypatch.setattr("validation.pressing._NO_SCORE", 0.0)  # below the error of any finite elements

    def derive(*_):
        raise AssertionError

    found = press(load="200 g", derive=derive)
    assert found.fem is not None
    assert (found.fast, found.score, found.models) == (None, None, ("fem",))
    assert "not derived for a score; --model fast" in found.note
