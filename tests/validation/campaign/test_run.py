"""Campaigns press, score and pool."""

import dataclasses

import numpy as np
import pytest

import fastmodel
import fem_reference
from validation.campaign.case import Case
from validation.campaign.run import run_campaign
from validation.errors import InputError

CASES = (
    Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
    Case.read("box", "box:size=6mmx10mmx5mm", "100 g", at="0.7mm,-1.1mm", yaw="45deg"),
    Case.read("edge", "cylinder:radius=4mm", "100 g", at="8.5mm,0mm"),
)


@pytest.fixture(scope="module")
def derivation(wts_derivation):
    return wts_derivation


@pytest.fixture(scope="module")
def campaign(derivation):
    return run_campaign(derivation.sensor.cover, derivation.parameters, CASES)


def test_forces_balance_in_both_models(campaign):
    for result in campaign.cases:
        for forces, outside in (
            (result.reference.texel_forces, result.reference.outside),
            (result.predictions["fast"].texel_forces, result.predictions["fast"].outside),
        ):
            assert forces.sum() + outside == pytest.approx(result.case.load, rel=1e-3)


def test_null_models_score_what_they_must(derivation, campaign):
    for result in campaign.cases:
        zeros = result.predictions["zeros"].score
        assert zeros.misplaced_force == pytest.approx(0.5, abs=0.01)
        assert zeros.relative_l2 == 1
        case = result.case
        boxes = fastmodel.indent(
            derivation.parameters, case.indenter, load=case.load, at=case.at, yaw=case.yaw, method="boxes"
        )
        np.testing.assert_allclose(result.predictions["no-spread"].texel_forces, boxes.contact_forces)
        np.testing.assert_allclose(result.predictions["boxes"].texel_forces, boxes.texel_forces)


def test_spread_helps_a_sphere_over_a_texel(campaign):
    scores = campaign.cases[0].predictions
    assert scores["fast"].score.misplaced_force < 0.5 * scores["no-spread"].score.misplaced_force


def test_wrong_kernel_scores_worse(derivation, campaign):
    blurred = dataclasses.replace(derivation.parameters, spread=fastmodel.Gaussian.from_sigma(2.0))
    worse = run_campaign(derivation.sensor.cover, blurred, CASES[:1])
    mine = campaign.cases[0].predictions["boxes"].score.misplaced_force
    assert worse.cases[0].predictions["boxes"].score.misplaced_force > 3 * mine


def test_pooled_mean_is_that_of_the_cases(campaign):
    errors = [result.predictions["fast"].score.misplaced_force for result in campaign.cases]
    pooled = campaign.pooled["fast"]["misplaced_force"]
    assert pooled.mean == pytest.approx(np.mean(errors))
    assert pooled.low <= pooled.mean <= pooled.high
    assert pooled.cases == len(CASES)


def test_progress_counts_every_case(derivation):
    seen = []
    run_campaign(derivation.sensor.cover, derivation.parameters, CASES[:1], progress=lambda *step: seen.append(step))
    assert seen == [(0, 1, "sphere"), (1, 1, "")]


@pytest.mark.slow
def test_case_that_no_model_can_press_is_named_and_the_others_scored(derivation, bonded):
    soft = bonded(0.49, thickness=1e-3, youngs_modulus=24e3)
    piercing = Case.read("tip", "tip:radius=1mm", "500 g")
    result = run_campaign(soft, derivation.parameters, [piercing, CASES[2]])
    assert [each.case.name for each in result.cases] == ["edge"]
    (skipped,) = result.skipped
    assert (skipped.case.name, skipped.converged) == ("tip", True)
    assert "pierce" in skipped.reason
    with pytest.raises(InputError, match=r"tip .*pierce"):
        run_campaign(soft, derivation.parameters, [piercing])


def test_solver_that_gives_up_is_told_apart_from_bad_input(derivation, monkeypatch):
    def give_up(*_, **__):
        raise fem_reference.ConvergenceError("no")

    good = run_campaign(derivation.sensor.cover, derivation.parameters, CASES[:1]).cases
    answers = iter([lambda: good[0], give_up])
    monkeypatch.setattr("validation.campaign.run.run_case", lambda *_, **__: next(answers)())
    result = run_campaign(derivation.sensor.cover, derivation.parameters, CASES[:2])
    assert [each.converged for each in result.skipped] == [False]
