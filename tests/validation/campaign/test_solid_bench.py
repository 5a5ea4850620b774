"""Campaigns on a curved cover: the stored reference, the scored models, interruption, and the evidence."""

import dataclasses

import numpy as np
import pytest

from fem_reference.curved_cover.press import press_small
from fem_reference.indentation.result import PressProblem
from fem_reference.result_store import NotStoredError, stored_only
from meshes import Material
from meshes.bounded_file import parse_toml
from tests.support.coarse_cells import coarse_cells
from validation.campaign.bench import prepare_bench
from validation.campaign.campaign_file import Criterion, Inputs, parse_campaign
from validation.campaign.plan import plan_cases
from validation.campaign.reference_press import press_reference
from validation.campaign.run import run_campaign
from validation.campaign.solid_bench import CURVED_MODELS, SolidBench
from validation.credibility import verification as evidence
from validation.credibility.evidence import gather_evidence
from validation.credibility.verification import check_shell
from validation.derivation.derive import derive
from validation.places import find_places
from validation.render.image import find_outline
from validation.verdict import judge

TEXT = """
[[case]]
name = "ball"
indenter = "sphere:radius=4mm"
load = "0.3 N"

[[case]]
name = "edge"
indenter = "box:size=3mmx3mmx4mm"
load = "0.2 N"
at = "off grid"
direction = "oblique x"
tilt = "0deg,45deg"
"""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _cells():
    with coarse_cells():
        yield


@pytest.fixture(scope="module")
def plan(small_pad):
    return parse_campaign(parse_toml(TEXT), find_places(small_pad.cover, small_pad), source="mine.toml")


@pytest.fixture(scope="module")
def bench(small_pad):
    return prepare_bench(derive(small_pad), ())


@pytest.fixture(scope="module")
def cost(small_pad, plan):
    return plan_cases(small_pad.cover, small_pad.array, plan.cases)


@pytest.fixture(scope="module")
def result(bench, plan, cost):
    return run_campaign(bench, plan.cases, plan=cost)


def test_a_stored_press_is_the_press(small_pad, plan, result):
    case = plan.cases[1]
    with stored_only():
        found = press_reference(small_pad.cover, small_pad.array, case)
    material = small_pad.cover.layers[0].material
    problem = PressProblem(
        array=small_pad.array, indenter=case.indenter, pose=case.pose, targets=(0.2,), control="load"
    )
    known = press_small(small_pad.cover.meshes(), material, problem, 0.2)
    for field in dataclasses.fields(known):
        mine, other = getattr(found, field.name), getattr(known, field.name)
        if isinstance(other, np.ndarray | float) and field.name != "seconds":
            np.testing.assert_array_equal(mine, other, err_msg=field.name)
    assert found.error_estimate.keys() == known.error_estimate.keys()
    assert np.isnan(found.error_estimate["peak_texel"])
    assert (found.warnings, dict(found.assumptions)) == (known.warnings, dict(known.assumptions))


def test_a_press_with_another_pose_is_another_entry(small_pad, plan):
    moved = dataclasses.replace(plan.cases[1], pose=dataclasses.replace(plan.cases[1].pose, yaw=0.2))
    with stored_only(), pytest.raises(NotStoredError):
        press_reference(small_pad.cover, small_pad.array, moved)


def test_presses_are_missing_once(small_pad, plan, cost, result):
    again = plan_cases(small_pad.cover, small_pad.array, plan.cases)
    assert again.missing == (False, False)
    assert again.total < cost.total or cost.missing == (False, False)


def test_fast_model_and_reference_agree_on_one_coarse_mesh(result):
    ball, edge = (
        {name: each.score.misplaced_force for name, each in case.predictions.items()} for case in result.cases
    )
    assert ball["fast"] < 0.02  # pressure between the nodes of one coarse mesh
    assert 0.03 < ball["gaussian"] < ball["no-spread"]
    assert edge["fast"] < 0.2 < edge["no-spread"]
    assert result.pooled.keys() == CURVED_MODELS.keys()


def test_the_null_model_puts_the_whole_load_on_texels(result):
    ball, edge = (each.predictions["no-spread"].texel_forces for each in result.cases)
    assert ball.sum() == pytest.approx(0.3)
    # frictionless and oblique: the normal force is larger than the load along the motion
    assert edge.sum() == pytest.approx(0.2 / np.cos(np.radians(30)))
    assert result.pooled["no-spread"]["misplaced_force"].mean > 3 * result.pooled["gaussian"]["misplaced_force"].mean


def test_force_on_the_wrong_texel_is_noticed(bench, plan, cost, result, monkeypatch):
    cover = bench.require_fast_model()
    shifted = dataclasses.replace(cover, influence=np.roll(cover.influence, 1, axis=0))
    monkeypatch.setattr(SolidBench, "require_fast_model", lambda _: shifted)
    right, wrong = (judge(plan, each) for each in (result, run_campaign(bench, plan.cases, plan=cost)))
    over = [sum(each.value > each.limit for each in verdict.findings) for verdict in (right, wrong)]
    assert over[0] < over[1]
    assert wrong.word == "not decided"  # two cases decide nothing


def test_one_mesh_decides_nothing(plan, result):
    loose = Criterion(mean={"misplaced_force": 0.5}, each={})
    verdict = judge(dataclasses.replace(plan, criterion=loose), result)
    assert verdict.word == "not decided"
    assert any("one mesh only" in reason for reason in verdict.reasons)


def test_a_case_that_never_touches_costs_itself(bench, plan, cost):
    ball = plan.cases[0]
    away = dataclasses.replace(ball, name="away", pose=dataclasses.replace(ball.pose, direction=(0.0, 0.0, 1.0)))
    found = run_campaign(bench, (ball, away), plan=cost)
    assert [each.name for each in found.skipped] == ["away"]


def test_groups_and_range_are_those_of_the_cases(bench, plan, result):
    stopped = dataclasses.replace(result, interrupted=True)
    found = gather_evidence(bench, plan, stopped)
    assert set(found.groups["shape"]) == {"sphere", "box"}
    assert set(found.groups["direction"]) == {"along the normal", "oblique"}
    assert found.domain["load_N"] == (0.2, 0.3)
    assert np.degrees(found.domain["obliquity_rad"]) == pytest.approx((0, 30), abs=1e-6)
    assert found.failed == ("interrupted: codes are not verified, inputs not propagated, stages not scored",)


def test_coarse_meshes_of_the_shell_converge_to_its_closed_form_alike_at_every_thickness(monkeypatch):
    monkeypatch.setattr(evidence, "_SHELL_MESHES", ((1.5, 2), (1.2, 2)))
    rubber = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49)
    thin, thick = check_shell(rubber, 0.5e-3), check_shell(rubber, 8e-3)
    assert thin.errors == pytest.approx(thick.errors, rel=1e-6)
    assert 0.002 < thin.errors[1] < thin.errors[0] < 0.07
    assert thin.result == thin.errors[1]
    assert thin.sizes == pytest.approx((1.0, 0.8))


def test_the_shell_agrees_with_its_closed_form_and_a_stiffer_one_does_not(small_pad, monkeypatch):
    material = small_pad.cover.layers[0].material
    check = check_shell(material, 2e-3)
    assert check.passed
    wrong = dataclasses.replace(material, poisson_ratio=0.45)
    solve = evidence.texel_responses
    monkeypatch.setattr(evidence, "texel_responses", lambda mesh, texels, _: solve(mesh, texels, wrong))
    assert not check_shell(material, 2e-3).passed


def test_uncertain_inputs_change_the_image_as_they_should(bench, plan):
    """A moved indenter moves the centre of pressure; a stiffer cover under the same load concentrates the force."""
    ball = plan.cases[0]
    one = dict.fromkeys(("modulus", "poisson_ratio", "thickness", "position", "yaw", "friction"), 0.0)
    found = bench.propagate(ball, Inputs(**one | {"position": 1e-4}))
    assert list(found.uncertainties) == ["position x [m]", "position y [m]"]
    assert 1e-3 < found.misplaced_total < 0.2
    assert bench.propagate(ball, Inputs(**one | {"yaw": 0.1})).misplaced_total < 1e-2
    stiff = bench.propagate(ball, Inputs(**one | {"modulus": 0.1}))
    assert stiff.effects["modulus [relative]"][np.argmax(stiff.image)] > 0


def test_the_outline_of_a_contact_is_that_of_the_points_that_bear_force(small_pad, result):
    """The ball of 4 mm touches a small part of the pad of 9 mm."""
    outline = find_outline(small_pad.array, result.cases[0].reference.found)
    reach = np.linalg.norm(outline, axis=1).max()
    area = result.cases[0].reference.contact_area
    assert reach < 2.5 * np.sqrt(area / np.pi)
