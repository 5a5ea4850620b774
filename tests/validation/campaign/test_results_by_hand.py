"""Metrics of texel forces, scores of models, entries of skipped cases, and cases of a file, with numbers by hand."""

import dataclasses
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from fastmodel import WTS_0614_34, Electronics, Gaussian, Parameters
from meshes import TexelArray
from tests.support.made_up_evaluation import CASES, make_case
from validation.campaign import texel_metrics
from validation.campaign.campaign_file import parse_campaign
from validation.campaign.case import Case
from validation.campaign.results import (
    CampaignResult,
    CaseResult,
    Reference,
    SkippedCase,
    name_texel_error,
    predict,
    score_forces,
    texel_error,
)
from validation.places import FlatPlaces

ARRAY = TexelArray.grid(1, 3, 2e-3)
TRUE, FAST = np.array([0.6, 0.25, 0.05]), np.array([0.3, 0.4, 0.07])
PLACES = np.array([[0.0, 1.0, 5.0], [4.0, 1.0, 5.0], [0.0, 4.0, 7.0]])


def test_errors_of_forces_are_shares_of_the_load_or_the_peak():
    assert texel_metrics.total_force_error(TRUE, FAST, load=2.0) == pytest.approx(0.13 / 2)
    moved = texel_metrics.misplaced_force(TRUE, FAST, reference_outside=0.5, outside=0.1, load=2.0)
    assert moved == pytest.approx((0.3 + 0.15 + 0.02 + 0.4) / 4)
    assert texel_metrics.peak_error(TRUE, FAST) == pytest.approx(0.2 / 0.6)
    assert texel_metrics.peak_error(TRUE, 2 * TRUE) == pytest.approx(1.0)
    assert math.isnan(texel_metrics.peak_error(0 * TRUE, FAST))
    assert math.isnan(texel_metrics.peak_error(-TRUE, FAST))
    assert texel_metrics.AREA_THRESHOLD == 0.1


def test_moments_of_forces_are_weighted_by_them():
    """Weights 1, 1 and 2 at x = 0, 4, 0 and y = 1, 1, 4."""
    forces = np.array([1.0, 1.0, 2.0])
    assert texel_metrics.centre_of_pressure(forces, PLACES) == pytest.approx([1.0, 2.5, 6.0])
    assert texel_metrics.second_moments(forces, PLACES) == pytest.approx((math.sqrt(12 / 4), math.sqrt(9 / 4)))
    apart = texel_metrics.centre_of_pressure_error(forces, np.array([1.0, 0.0, 0.0]), PLACES)
    assert apart == pytest.approx(math.sqrt(1 + 1.5**2 + 1))
    assert texel_metrics.second_moments(np.array([3.0, -1.0, -1.0]), PLACES)[0] == 0.0
    for none in (np.zeros(3), np.array([1.0, -2.0, 0.5])):
        assert texel_metrics.centre_of_pressure(none, PLACES) == pytest.approx([math.nan] * 3, nan_ok=True)
        assert texel_metrics.second_moments(none, PLACES) == pytest.approx((math.nan, math.nan), nan_ok=True)
        assert math.isnan(texel_metrics.centre_of_pressure_error(forces, none, PLACES))


@pytest.mark.parametrize(
    ("reference", "forces", "overlap"),
    [
        ([2, 2, 0], [0, 2, 2], 1 / 3),
        ([2, 2, 2], [2, 2, 1], 2 / 3),
        ([1, 1, 0], [0, 1, 1], 1.0),
        ([2, 0, 0], [1] * 3, 0),
    ],
)
def test_areas_overlap_above_a_threshold(reference, forces, overlap):
    found = texel_metrics.active_area_iou(np.array(reference), np.array(forces), threshold=1.0)
    assert found == pytest.approx(overlap)


@pytest.mark.parametrize("load", [0.0, -1.5, math.inf, math.nan])
def test_a_load_is_positive_and_finite(load):
    assert texel_metrics.check_load(1e-9) == 1e-9
    for call in (
        lambda: texel_metrics.check_load(load),
        lambda: texel_metrics.total_force_error(TRUE, FAST, load=load),
        lambda: texel_metrics.misplaced_force(TRUE, FAST, reference_outside=0.0, outside=0.0, load=load),
    ):
        with pytest.raises(ValueError, match=f"^the load must be positive, not {load} N$"):
            call()


def make_parameters(**electronics):
    line = dataclasses.replace(WTS_0614_34, **electronics) if electronics else Electronics(rate_hz=1.0, sensitivity=9.0)
    return Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=line)


REFERENCE = Reference(
    texel_forces=TRUE, outside=0.5, total_force=2.0, depth=1e-3, contact_area=1e-6, error_estimate={}, assumptions={},
    warnings=(),
)  # fmt: skip


def test_a_model_is_scored_against_the_reference_and_the_load():
    found = score_forces(REFERENCE, FAST, 0.1, 2.0, make_parameters())
    assert found.misplaced_force == pytest.approx((0.3 + 0.15 + 0.02 + 0.4) / 4)
    assert found.total_force_error == pytest.approx(0.065)
    assert found.peak_error == pytest.approx(1 / 3)
    assert found.centre_of_pressure_m == pytest.approx(2e-3 * abs(-0.55 / 0.9 + 0.23 / 0.77))
    # a tenth of 0.6 N: texels 0 and 1 of the reference, and all of the model
    assert found.active_area_iou == pytest.approx(2 / 3)


def test_the_second_grey_scale_is_that_of_the_electronics():
    """The published line starts at 0.185 N through the cover: half of it on a texel if its share is one half."""
    lit = [
        score_forces(REFERENCE, FAST, 0.1, 2.0, each).pixels_lit_line
        for each in (make_parameters(), make_parameters(tip_share=0.5), make_parameters(tip_share=0.2))
    ]
    assert lit == [2, 2, 3]


def test_each_model_keeps_its_forces_and_its_score():
    given = {"a": (FAST, 0.1), "b": (2 * TRUE, 0.7)}
    found = predict(REFERENCE, given, 2.0, make_parameters())
    assert list(found) == ["a", "b"]
    for name, (forces, outside) in given.items():
        assert (found[name].texel_forces.tolist(), found[name].outside) == (forces.tolist(), outside)
        assert found[name].score == score_forces(REFERENCE, forces, outside, 2.0, make_parameters())
    assert found["b"].score.misplaced_force == pytest.approx((0.9 + 0.2) / 4)


def test_the_error_of_texel_forces_is_the_misplaced_force_or_that_of_the_peak():
    assert texel_error({"misplaced_force": 0.02, "peak_texel": 0.3}) == 0.02
    assert texel_error({"peak_texel": 0.3, "depth": 0.4}) == 0.3
    assert texel_error({"depth": 0.4}) == 0.0
    names = [name_texel_error({each: 0.1}) for each in ("misplaced_force", "peak_texel", "depth")]
    assert names == ["the load, on wrong texels", "the peak texel", "the peak texel"]


def test_a_skipped_case_names_its_bodies_and_its_whole_load():
    ball = Case.read("a", "sphere:radius=5mm", "3 N", at="1mm,-2mm")
    alone = SkippedCase.of(ball, "pierced")
    assert alone == SkippedCase(name="a", indenter="sphere:radius=5mm", load=3.0, reason="pierced", converged=True)
    other = Case.read("b", "sphere:radius=2mm", "1.5 N", at="4mm,5mm")
    both = SkippedCase.of(dataclasses.replace(ball, load=4.5, others=(other,)), "no", converged=False)
    assert (both.load, both.converged) == (4.5, False)
    assert both.indenter.endswith("sphere:radius=2mm, 1.5 N at (4, 5) mm, 0\u00b0, together")
    assert both.indenter.startswith("sphere:radius=5mm, 3 N at (1, -2) mm, 0\u00b0 and ")


def test_what_a_solver_does_not_tell_is_zero_or_unknown():
    told = {"texel_forces": TRUE, "total_force": 2.0, "depth": 1e-3, "contact_area": 1e-6, "error_estimate": {}}
    found = Reference.of(SimpleNamespace(**told, assumptions={}, warnings=()))
    assert (found.outside, found.total_force, found.balance, found.seconds) == (0.0, 2.0, None, None)
    assert found.found.texel_forces is TRUE
    empty = CampaignResult(cases=(), skipped=(), pooled={}, skill={}, noise_floor={"depth": 0.2})
    assert (empty.interrupted, empty.published, empty.reference_error) == (False, (), 0.0)
    assert list(empty.models) == ["fast", "foundation", "boxes", "no-spread", "zeros"]


@pytest.mark.parametrize("number", [0, 1])
def test_a_scored_case_is_read_back_from_its_values(number):
    """The complete result of the solver is not written."""
    made = dataclasses.replace(make_case(number, CASES[number]), warnings=("w",))
    fast = made.predictions["fast"]
    made = dataclasses.replace(made, published={"cone": fast})
    shown = json.loads(json.dumps(made.as_json()))
    assert (shown["name"], shown["load"]) == (made.case.name, made.case.load)
    assert shown["comparison_models"]["cone"]["scores"] == shown["models"]["fast"]["scores"]
    again = CaseResult.from_json(shown)
    assert (again.case, again.warnings, again.reference.found) == (made.case, ("w",), None)
    assert again.reference.error_estimate == made.reference.error_estimate
    assert again.reference.texel_forces.tolist() == made.reference.texel_forces.tolist()
    assert (again.predictions["fast"].score, again.published["cone"].outside) == (fast.score, 0.0)
    assert again.as_json() == made.as_json()


BALL = {"name": "ball", "indenter": "sphere:radius=5mm", "load": "2 N"}


@dataclasses.dataclass(frozen=True, kw_only=True)
class SoftPlaces(FlatPlaces):
    """Places on a cover that bears 0.5 N of every body, and for which loads are scaled by a tenth."""

    def scale_loads(self, table, source):
        del table, source
        return 0.1

    def limit_load(self, case, share):
        del case, share
        return 0.5


class ScaledPlaces(SoftPlaces):
    """The same with the built-in campaign whose loads are scaled."""

    default = "curved.toml"


GRID = TexelArray.grid(14, 6, 3.4e-3)


@pytest.mark.parametrize("kind", [SoftPlaces, ScaledPlaces])
def test_loads_of_a_file_are_neither_scaled_nor_lowered_unless_it_says_so(kind):
    places = kind(array=GRID)
    found = parse_campaign({"case": [BALL]}, places, source="mine.toml")
    assert [case.load for case in found.cases] == [2.0]
    assert "lowered" not in found.intended_use
    deep = parse_campaign({"case": [BALL], "deepest": "30 %"}, places, source="mine.toml")
    assert [case.load for case in deep.cases] == [0.5]


def test_loads_of_the_built_in_campaign_are_lowered_on_a_soft_cover():
    found = parse_campaign({}, SoftPlaces(array=GRID), source="built-in")
    assert max(case.load for case in found.cases) == 0.5
    assert found.intended_use.endswith("N to 0.5 N.")


def test_cases_of_several_loads_have_them_in_their_names_with_three_digits():
    table = {"name": "b", "indenter": "sphere:radius=5mm", "loads": ["1.2345 N", "250 mN"], "quick": True}
    found = parse_campaign({"case": [BALL, table]}, FlatPlaces(array=GRID), source="mine.toml")
    assert [(case.name, case.load) for case in found.cases] == [
        ("ball", 2.0), ("b, 1.23 N", 1.2345), ("b, 0.25 N", 0.25),
    ]  # fmt: skip
    assert found.quick == ("b, 1.23 N", "b, 0.25 N")
    assert {case.shape for case in found.cases} == {"sphere:radius=5mm"}


def test_spaces_around_a_place_make_no_other_place():
    """A repeated press is refused; under the other name of a place it is left out without a fault."""
    odd = FlatPlaces(array=TexelArray.grid(5, 7, 3e-3))
    first, again = BALL | {"at": "centre"}, BALL | {"name": "again"}
    spaced = parse_campaign({"case": [first, again | {"at": " centre "}]}, odd, source="mine.toml")
    other = parse_campaign({"case": [first, again | {"at": " texel "}]}, odd, source="mine.toml")
    assert [len(each.cases) for each in (spaced, other)] == [1, 1]
    assert [len(each.left_out) for each in (spaced, other)] == [1, 0]


def test_faults_of_moving_cases_follow_those_of_others():
    found = parse_campaign({"case": [BALL, {}], "moving": [{}]}, FlatPlaces(array=GRID), source="mine.toml")
    kinds = [line.removeprefix("mine.toml: ").split("[")[0] for line in found.left_out]
    assert kinds == ["case"] * kinds.count("case") + ["moving"] * kinds.count("moving")
    assert set(kinds) == {"case", "moving"}
    assert found.moving == ()
