"""The verdict follows the acceptance criterion."""

import dataclasses

import numpy as np
import pytest

from validation.campaign.campaign_file import Criterion, read_campaign
from validation.campaign.results import SkippedCase, score_forces
from validation.campaign.run import summarise
from validation.data_sets.results import CountScore, RecordingRow, RecordingScores
from validation.places import FlatPlaces
from validation.pooling import pool
from validation.verdict import judge


@pytest.fixture(scope="module")
def result(campaign):
    """The three computed cases twice under other names, because fewer than five cases decide nothing."""
    again = [
        dataclasses.replace(each, case=dataclasses.replace(each.case, name=f"{each.case.name} again"))
        for each in campaign.cases
    ]
    return summarise([*campaign.cases, *again], (), None)


@pytest.fixture(scope="module")
def plan(wts, result):
    cases = tuple(each.case for each in result.cases)
    return dataclasses.replace(read_campaign(None, FlatPlaces(array=wts)), cases=cases)


def move_to_right(image, share):
    """Move a share of each texel's force to its right neighbour, from the last column to the left one."""
    moved = (1 - share) * image
    moved[:, 1:] += share * image[:, :-1]
    moved[:, -2] += share * image[:, -1]
    return moved


def move_to_all(image, share):
    """Move a share of each texel's force to its four neighbours; what would leave the array stays."""
    padded = np.pad(image, 1)
    moved = (1 - share) * image
    for axis in (0, 1):
        for step in (-1, 1):
            moved += share / 4 * np.roll(padded, step, axis)[1:-1, 1:-1]
    moved[[0, -1]] += share / 4 * image[[0, -1]]
    moved[:, [0, -1]] += share / 4 * image[:, [0, -1]]
    return moved


def plant(result, parameters, move, share):
    """Score the campaign anew with moved forces of the fast model."""
    cases = []
    for each in result.cases:
        fast = each.predictions["fast"]
        forces = move(fast.texel_forces.reshape(14, 6), share).ravel()
        assert forces.sum() == pytest.approx(fast.texel_forces.sum())
        score = score_forces(each.reference, forces, fast.outside, each.case.load, parameters)
        moved = dataclasses.replace(fast, texel_forces=forces, score=score)
        cases.append(dataclasses.replace(each, predictions={**each.predictions, "fast": moved}))
    return summarise(cases, (), None)


def test_the_fast_model_is_accepted_by_default(result, plan):
    verdict = judge(plan, result)
    assert verdict.word == "accepted"
    assert verdict.accepted
    assert len(verdict.findings) == len(plan.criterion.mean) + 6
    assert {each.status for each in verdict.findings} == {"met"}
    assert verdict.short.startswith(
        "verdict: ACCEPTED; fast model against finite elements, 6 of 6 cases: misplaced force "
    )
    assert "against finite elements (6 of 6 cases)" in verdict.sentence
    for each in verdict.findings:
        assert each.margin == pytest.approx(each.limit - each.high)


@pytest.mark.parametrize("move", [move_to_right, pytest.param(move_to_all, marks=pytest.mark.slow)])
def test_the_verdict_flips_if_five_percent_of_each_load_sit_on_neighbouring_texels(result, plan, wts_derivation, move):
    verdict = judge(plan, plant(result, wts_derivation.parameters, move, 0.05))
    assert verdict.word == "not accepted"
    assert verdict.short.startswith("verdict: NOT ACCEPTED; fast model against finite elements, 6 of 6 cases: ")
    assert judge(plan, plant(result, wts_derivation.parameters, move, 0.0)).word == "accepted"


def limit(plan, **limits):
    return dataclasses.replace(plan, criterion=Criterion(mean=limits.get("mean", {}), each=limits.get("each", {})))


def test_a_mean_is_met_missed_or_open_by_its_interval(result, plan):
    pooled = result.pooled["fast"]["misplaced_force"]
    for value, word in (
        (pooled.high, "accepted"),
        ((pooled.mean + pooled.high) / 2, "not decided"),
        (0.99 * pooled.mean, "not accepted"),
    ):
        verdict = judge(limit(plan, mean={"misplaced_force": value}), result)
        assert verdict.word == word
        assert (verdict.findings[0].value, verdict.findings[0].high) == (pooled.mean, pooled.high)


def test_a_limit_of_a_case_replaces_the_common_one(result, plan):
    value = result.cases[1].predictions["fast"].score.peak_error
    strict = dataclasses.replace(result.cases[1].case, required={"peak_error": 0.9 * value})
    cases = [dataclasses.replace(each, case=strict) if each.case.name == "box" else each for each in result.cases]
    verdict = judge(limit(plan, each={"peak_error": 0.5}), dataclasses.replace(result, cases=cases))
    assert verdict.word == "not accepted"
    assert [each.over for each in verdict.findings if each.status == "missed"] == ["box"]


def test_metrics_that_a_case_does_not_compare_do_not_count(result, plan):
    case = dataclasses.replace(result.cases[0].case, compared=("misplaced_force",))
    cases = [dataclasses.replace(result.cases[0], case=case), *result.cases[1:]]
    found = summarise(cases, (), None)
    assert found.pooled["fast"]["peak_error"].cases == 5
    assert found.pooled["fast"]["misplaced_force"].cases == 6
    verdict = judge(limit(plan, mean={"peak_error": 1.0}, each={"peak_error": 1.0}), found)
    assert [each.over for each in verdict.findings] == ["mean over the cases", *(each.case.name for each in cases[1:])]
    assert verdict.findings[0].value == found.pooled["fast"]["peak_error"].mean


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"interrupted": True}, "the run was interrupted"),
        ({"skipped": (SkippedCase(name="a", indenter="", load=1.0, reason="no", converged=False),)}, "not scored: a"),
        ({"noise_floor": {"peak_texel": 0.01}}, "the reference's own error of the peak texel, 1 %, is too large"),
    ],
)
def test_what_is_missing_leaves_it_open(result, plan, change, reason):
    verdict = judge(plan, dataclasses.replace(result, **change))
    assert verdict.word == "not decided"
    assert verdict.reasons[0].startswith(reason)


def test_faults_in_the_file_leave_it_open(result, plan):
    verdict = judge(dataclasses.replace(plan, left_out=("case[0]: no",)), result)
    assert (verdict.word, verdict.scored, verdict.cases) == ("not decided", 6, 7)


def test_a_run_without_scored_cases_and_limits_on_means_has_a_short_verdict(plan, result):
    campaign = dataclasses.replace(plan, criterion=Criterion(mean={}, each={"misplaced_force": 0.1}))
    short = judge(campaign, dataclasses.replace(result, cases=(), interrupted=True)).short
    assert short == "verdict: NOT DECIDED; fast model against finite elements, 0 of 0 cases"


def test_fewer_than_five_cases_never_decide(result, plan):
    loose = limit(plan, mean={"misplaced_force": 1.0}, each={"misplaced_force": 1.0})
    for count, word in ((1, "not decided"), (2, "not decided"), (4, "not decided"), (5, "accepted")):
        verdict = judge(loose, summarise(result.cases[:count], (), None))
        assert verdict.word == word, count
    strict = limit(plan, mean={"misplaced_force": 1e-6}, each={})
    assert judge(strict, summarise(result.cases[:4], (), None)).word == "not decided"
    assert judge(strict, summarise(result.cases[:5], (), None)).word == "not accepted"


def test_a_metric_that_some_cases_do_not_define_is_undecided(result, plan):
    def lose(each):
        fast = each.predictions["fast"]
        score = dataclasses.replace(fast.score, misplaced_force=float("nan"))
        return dataclasses.replace(
            each, predictions={**each.predictions, "fast": dataclasses.replace(fast, score=score)}
        )

    found = summarise([lose(result.cases[0]), *result.cases[1:]], (), None)
    verdict = judge(limit(plan, mean={"misplaced_force": 1.0}), found)
    assert verdict.word == "not decided"
    assert "defined in 5 of 6" in verdict.reasons[0]


def test_a_verdict_without_any_requirement_is_undecided(result, plan):
    verdict = judge(limit(plan), result)
    assert verdict.word == "not decided"
    assert "no requirement" in verdict.reasons[0]


def score_recordings(problems=(), undefined=0):
    """Scores of a right model on eight loads; the first ones have no centre of counts."""
    names = [field.name for field in dataclasses.fields(CountScore)]

    def make_row(kind, value):
        per_case = {
            f"{number} N": CountScore(
                **{**dict.fromkeys(names, value), "centre_of_pressure_m": np.nan if number < undefined else value}
            )
            for number in range(8)
        }
        pooled = {name: pool([getattr(score, name) for score in per_case.values()]) for name in names}
        return RecordingRow(
            split="loads", model=kind, kind=kind, texel_gains=kind == "model", fitted=(), parameters={},
            per_case=per_case, pooled=pooled, skill={}, electronics=None,
        )  # fmt: skip

    return RecordingScores(
        name="made up", rows=(make_row("null", 0.02), make_row("model", 0.01)), examples=(), about={}, notes={},
        files={}, noise=0.0, source="", problems=tuple(problems),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("a.csv: holds no frames; left out", "not decided"),
        ("set.toml: split 'b': unknown series 'c'; it is left out", "not decided"),
        ("the same content is read once; left out: b.csv (as a.csv)", "accepted"),
        ("the counts fall under load in every recording; they are turned", "accepted"),
    ],
)
def test_recordings_that_were_left_out_leave_it_open(plan, line, word):
    verdict = judge(plan, None, score_recordings([line]), splits=["loads"])
    assert verdict.word == word
    assert any(line in reason for reason in verdict.reasons) == (word == "not decided")


def test_a_metric_that_some_loads_do_not_define_is_undecided(plan):
    required = {"centre_of_pressure_m": 0.1}
    assert judge(plan, None, score_recordings(), required=required).word == "accepted"
    verdict = judge(plan, None, score_recordings(undefined=2), required=required)
    assert verdict.word == "not decided"
    assert "defined in 6 of 8" in verdict.reasons[0]


@pytest.mark.parametrize(
    ("stated", "words"), [("", ", limits of the built-in campaign"), ("misplaced_force = '9 %'", "")]
)
def test_a_file_without_limits_is_judged_by_the_built_in_ones_and_the_verdict_says_so(
    tmp_path, wts, result, stated, words
):
    path = tmp_path / "mine.toml"
    case = "[[case]]\nname = 'ball'\nindenter = 'sphere:radius=5mm'\nload = '1N'\n"
    path.write_text((f"[required.mean]\n{stated}\n" if stated else "") + case)
    verdict = judge(read_campaign(path, FlatPlaces(array=wts)), result)
    assert f"(6 of 6 cases{words})" in verdict.sentence
    assert f"6 of 6 cases{words}:" in verdict.short
