"""Campaigns press, score and pool."""

import dataclasses
from functools import partial

import numpy as np
import pytest

import fastmodel
import fem_reference
from validation.campaign.bench import LayeredBench
from validation.campaign.case import Case
from validation.campaign.results import MODELS
from validation.campaign.run import run_campaign
from validation.errors import InputError


def test_forces_balance_in_both_models(campaign):
    for result in campaign.cases:
        for forces, outside in (
            (result.reference.texel_forces, result.reference.outside),
            (result.predictions["fast"].texel_forces, result.predictions["fast"].outside),
        ):
            assert forces.sum() + outside == pytest.approx(result.case.load, rel=1e-3)


def predict(parameters, case):
    """Texel forces and force outside of every model in a case, each simulated anew."""
    methods = {"fast": "default", "foundation": "foundation", "boxes": "boxes"}
    press = partial(fastmodel.indent, parameters, case.indenter, load=case.load, at=case.pose.at, yaw=case.pose.yaw)
    found = {name: press(contact=method) for name, method in methods.items()}
    forces = {name: (each.texel_forces, each.outside) for name, each in found.items()}
    bare = found["boxes"].contact_forces
    return forces | {"no-spread": (bare, case.load - bare.sum()), "zeros": (np.zeros(84), 0.0)}


def test_each_model_is_scored_with_its_own_forces(bench, campaign):
    """Scores are computed anew from the forces of each model by numpy."""
    errors = {name: [] for name in MODELS}
    for result in campaign.cases:
        truth, scale = result.reference.texel_forces, result.reference.texel_forces.max() / 255
        for name, (forces, outside) in predict(bench.parameters, result.case).items():
            found = result.predictions[name]
            np.testing.assert_allclose(found.texel_forces, forces, rtol=1e-6, atol=1e-9)
            assert found.outside == pytest.approx(outside, abs=1e-6)
            moved = np.abs(forces - truth).sum() + abs(outside - result.reference.outside)
            grey = np.abs(np.rint(np.clip(forces / scale, 0, 255)) - np.rint(np.clip(truth / scale, 0, 255)))
            errors[name].append(moved / (2 * result.case.load))
            assert found.score.misplaced_force == pytest.approx(errors[name][-1], rel=1e-5)
            assert found.score.relative_l2 == pytest.approx(
                np.linalg.norm(forces - truth) / np.linalg.norm(truth), rel=1e-5
            )
            assert found.score.image_changed_percent == pytest.approx(100 * grey.mean() / 255, rel=1e-2)
    assert set(campaign.pooled) == set(MODELS)
    for name, values in errors.items():
        pooled = campaign.pooled[name]["misplaced_force"]
        assert (pooled.mean, pooled.cases) == (pytest.approx(np.mean(values), rel=1e-5), 3)
        assert pooled.low <= pooled.mean <= pooled.high
    assert len({round(np.mean(values), 6) for values in errors.values()}) == len(MODELS)  # no two models agree


def test_pooled_means_skill_and_noise_floor_are_those_of_the_cases(campaign):
    for name, metrics in campaign.pooled.items():
        for metric, pooled in metrics.items():
            values = [getattr(result.predictions[name].score, metric) for result in campaign.cases]
            assert pooled.mean == pytest.approx(
                np.nanmean(values) if not np.isnan(values).all() else np.nan, nan_ok=True
            )
    for key, value in campaign.noise_floor.items():
        assert value == np.mean([result.reference.error_estimate[key] for result in campaign.cases])
    assert campaign.noise_floor["peak_texel"] > 0
    assert (campaign.published, campaign.as_json()["comparison_models"]) == ((), [])


def test_wrong_kernel_scores_worse(bench, campaign, cases):
    blurred = dataclasses.replace(bench.parameters, spread=fastmodel.Gaussian.from_sigma(2.0))
    worse = run_campaign(dataclasses.replace(bench, parameters=blurred), cases[:1])
    mine = campaign.cases[0].predictions["boxes"].score.misplaced_force
    assert worse.cases[0].predictions["boxes"].score.misplaced_force > 3 * mine


@pytest.mark.slow
def test_case_that_no_model_can_press_is_named_and_the_others_scored(bench, cases, bonded):
    soft = dataclasses.replace(bench, cover=bonded(0.49, thickness=1e-3, youngs_modulus=24e3))
    piercing = Case.read("tip", "tip:radius=1mm", "500 g")
    result = run_campaign(soft, [piercing, cases[2]])
    assert [each.case.name for each in result.cases] == ["edge"]
    (skipped,) = result.skipped
    assert (skipped.name, skipped.converged) == ("tip", True)
    assert "pierce" in skipped.reason
    with pytest.raises(InputError, match=r"tip .*pierce"):
        run_campaign(soft, [piercing])


def test_solver_that_gives_up_is_told_apart_from_bad_input(bench, campaign, cases, monkeypatch):
    def solve(_, case, progress):
        if case.name == "sphere":
            return campaign.cases[0]
        raise fem_reference.ConvergenceError("no")

    monkeypatch.setattr(LayeredBench, "solve", solve)
    result = run_campaign(bench, cases[:2])
    assert [each.converged for each in result.skipped] == [False]
