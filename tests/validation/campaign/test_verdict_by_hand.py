"""The verdict at the borders of its decisions, its sentences, and the intervals of its means."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from tests.support.made_up_evaluation import make_case, make_score
from validation.campaign.campaign_file import Criterion, read_campaign
from validation.campaign.case import Case
from validation.campaign.results import OUT_OF_BUDGET, SkippedCase, describe_reference_error
from validation.campaign.run import summarise
from validation.data_sets.results import CountScore, RecordingRow, RecordingScores
from validation.places import FlatPlaces
from validation.pooling import Pooled, pool, skill
from validation.verdict import Finding, Verdict, judge

MEAN = "mean over the cases"
VALUES = ([0.01, 0.02, 0.04, 0.03, 0.05], [3.0, 1.0, 1.5], [-2.0, 5.0, 0.5, 0.7, 9.0, 1.0, 1.1], [1.0, 1.0, 1.0, 2.0])


@pytest.mark.parametrize("level", [0.95, 0.9, 0.5])
@pytest.mark.parametrize("values", VALUES)
def test_an_interval_is_students_with_one_end_moved_by_the_skewness(values, level):
    """m -+ q s / sqrt(n), and the end on the side of the longer tail moves by |g| s (1 + 2 q^2) / (6 n): by scipy."""
    n, mean, deviation = len(values), np.mean(values), np.std(values, ddof=1)
    quantile = stats.t.ppf((1 + level) / 2, n - 1)
    # the skewness of Johnson's formula is that of scipy without bias
    moved = stats.skew(values, bias=False) * deviation * (1 + 2 * quantile**2) / (6 * n)
    half = quantile * stats.sem(values)
    found = pool([*values, math.nan], level=level)
    assert found.mean == pytest.approx(mean)
    assert found.low == pytest.approx(mean - half + min(moved, 0))
    assert found.high == pytest.approx(mean + half + max(moved, 0))
    assert (found.cases, found.level) == (n, level)


def test_the_interval_of_a_skill_is_that_of_the_ratio_of_means_to_first_order():
    """1 - r with r = mean e / mean c; a case changes it by -(e - r c) / mean c."""
    errors, others = np.array([1.0, 2.0, 1.5, 4.0]), np.array([3.0, 5.0, 2.0, 6.0])
    ratio = 8.5 / 16.0
    parts = (errors - ratio * others) / 4.0
    expected = pool((1 - ratio) - parts)
    found = skill([*errors, math.nan, 1.0], [*others, 1.0, math.nan])
    assert (found.mean, found.low, found.high) == pytest.approx((1 - ratio, expected.low, expected.high))
    assert found.cases == 4
    assert found.low < 1 - ratio < found.high
    for none in (skill([1.0, 2.0], [0.0, 0.0]), skill([1.0], [-1.0]), skill([], [])):
        assert math.isnan(none.mean)
        assert math.isnan(none.low)
    assert skill([1.0, 2.0], [0.0, 0.0]).cases == 2


@pytest.mark.parametrize(
    ("pooled", "options", "words"),
    [
        (Pooled(mean=0.5, low=0.25, high=0.75, level=0.95, cases=5), {}, "95 % interval 0.25 to 0.75"),
        (Pooled(mean=0.5, low=0.25, high=0.75, level=0.9, cases=5), {"factor": 100, "unit": "%"},
         "90 % interval 25 to 75 %"),
        (Pooled(mean=0.5, low=0.2, high=0.7, level=0.95, cases=5), {"form": "{:+.2f}"}, "95 % interval +0.20 to +0.70"),
        (pool([]), {}, "no case"), (pool([1.0]), {}, "1 case, no interval"),
        (pool([1.0, 2.0]), {}, "2 cases, no interval"),
        (pool([2.0, 2.0, 2.0]), {}, "the same in all 3 cases"),
    ],
)  # fmt: skip
def test_an_interval_is_described_in_the_printed_unit(pooled, options, words):
    assert pooled.describe(**options) == words


@pytest.mark.parametrize(("cases", "few"), [(4, True), (5, False)])
def test_four_values_are_few_and_five_are_not(cases, few):
    assert Pooled(mean=0.0, low=0.0, high=0.0, level=0.95, cases=cases).few == few


def make_campaign(values, metric="misplaced_force", **options):
    """A scored campaign of the values of one metric of the fast model."""
    cases = []
    for number, value in enumerate(values):
        made = make_case(number % 2, Case.read(("sphere", "box")[number % 2], "sphere:radius=5mm", "2 N"))
        named = dataclasses.replace(made.case, name=f"case {number}")
        scores = dataclasses.replace(make_score(0.01), **{metric: value})
        fast = dataclasses.replace(made.predictions["fast"], score=scores)
        reference = dataclasses.replace(made.reference, error_estimate=options.get("floor", {"peak_texel": 1e-4}))
        cases.append(
            dataclasses.replace(made, case=named, reference=reference, predictions={**made.predictions, "fast": fast})
        )
    return summarise(cases, options.get("skipped", ()), None, interrupted=options.get("interrupted", False))


@pytest.fixture(scope="module")
def plan(wts):
    return read_campaign(None, FlatPlaces(array=wts))


def limit(plan, mean=None, each=None, recordings=None):
    criterion = Criterion(mean=mean or {}, each=each or {}, recordings=recordings or {})
    return dataclasses.replace(plan, criterion=criterion)


FIVE = (0.01, 0.02, 0.04, 0.03, 0.05)


@pytest.mark.parametrize(
    ("border", "below", "status"),
    [("high", False, "met"), ("high", True, "open"), ("mean", False, "open"), ("mean", True, "missed")],
)
def test_a_mean_is_decided_at_the_ends_of_its_interval(plan, border, below, status):
    """The whole interval at or below the limit is met; a mean above the limit is missed; else it is open."""
    pooled = pool(FIVE)
    value = getattr(pooled, border) * ((1 - 1e-12) if below else 1.0)
    (finding,) = judge(limit(plan, {"misplaced_force": value}), make_campaign(FIVE)).findings
    assert finding.status == status
    assert (finding.value, finding.low, finding.high) == (pooled.mean, pooled.low, pooled.high)
    assert (finding.cases, finding.undefined, finding.over) == (5, 0, MEAN)
    assert finding.margin == pytest.approx(value - pooled.high)


@pytest.mark.parametrize(
    ("count", "border", "statuses"),
    [(5, 0.05, ["met"] * 5), (5, 0.0499, ["met"] * 4 + ["missed"]), (4, 0.01, ["open"] * 4)],
)
def test_a_single_case_meets_a_limit_that_it_equals(plan, count, border, statuses):
    found = judge(limit(plan, each={"misplaced_force": border}), make_campaign(FIVE[:count])).findings
    assert [each.status for each in found] == statuses
    assert [each.over for each in found] == [f"case {number}" for number in range(count)]
    assert [(each.value, each.low, each.high, each.cases) for each in found] == [(v, v, v, 1) for v in FIVE[:count]]


def test_an_undefined_value_of_a_single_case_is_open(plan):
    found = judge(limit(plan, each={"misplaced_force": 1.0}), make_campaign((*FIVE, math.nan))).findings
    assert [each.status for each in found] == ["met"] * 5 + ["open"]
    assert found[-1].text == "misplaced force, case 5: not defined in these cases, at most 100 % required"


@pytest.mark.parametrize(
    ("floor", "words"),
    [
        ({"peak_texel": 0.03}, None),  # a third of the limit is small enough
        ({"peak_texel": 0.0301}, "the reference's own error of the peak texel, 3 %, is too large for a limit of 9 %"),
        ({"misplaced_force": 0.045}, "the reference's own error in misplaced force, 4.5 %, is too large"),
        ({"peak_texel": math.nan}, "the reference's own error is not known, because there is one mesh only"),
    ],
)
def test_the_error_of_the_reference_is_at_most_a_third_of_the_limit(plan, floor, words):
    verdict = judge(limit(plan, {"misplaced_force": 0.09}), make_campaign((0.02,) * 5, floor=floor))
    assert verdict.word == ("accepted" if words is None else "not decided")
    if words:
        assert verdict.reasons[0].startswith(words)
    # without a limit on misplaced force the error of the reference raises no doubt
    assert judge(limit(plan, {"peak_error": 9.0}), make_campaign((0.02,) * 5, floor=floor)).word == "accepted"


def skip(name, reason):
    return SkippedCase(name=name, indenter="", load=1.0, reason=reason, converged=True)


@pytest.mark.parametrize(
    ("skipped", "words"),
    [
        ((skip("a", "interrupted"),), None), ((skip("a", OUT_OF_BUDGET),), None),
        ((skip("a", "pierced"), skip("b", OUT_OF_BUDGET), skip("c", "no")), "not scored: a, c"),
    ],
)  # fmt: skip
def test_cases_that_failed_leave_it_open_and_those_left_for_time_do_not(plan, skipped, words):
    verdict = judge(limit(plan, {"misplaced_force": 0.09}), make_campaign((0.02,) * 5, skipped=skipped))
    assert verdict.word == ("accepted" if words is None else "not decided")
    assert (verdict.scored, verdict.cases) == (5, 5 + len(skipped))
    assert verdict.compared == {"finite elements": f"5 of {5 + len(skipped)} cases"}
    if words:
        assert words in verdict.reasons


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_fewer_than_five_cases_decide_nothing_and_their_number_is_named(plan, count):
    verdict = judge(limit(plan, {"misplaced_force": 0.5}), make_campaign(FIVE[:count]))
    (finding,) = verdict.findings
    pooled = pool(FIVE[:count])
    known = not math.isnan(pooled.low)
    assert (finding.low, finding.high) == ((pooled.low, pooled.high) if known else (pooled.mean, pooled.mean))
    assert (finding.status, finding.cases, finding.against) == ("open", count, "finite elements")
    assert verdict.reasons[0] == f"{count} of the cases are scored, and fewer than 5 decide nothing"
    assert verdict.reasons[1] == finding.text
    assert ("too few to tell" in finding.text) == (count > 1)


def test_all_that_was_not_scored_counts_as_a_case_and_each_doubt_is_named(plan):
    faulty = dataclasses.replace(limit(plan, {"misplaced_force": 0.5}), left_out=("x", "y"))
    skipped = (skip("a", "pierced"), skip("b", OUT_OF_BUDGET), skip("c", "interrupted"))
    verdict = judge(faulty, make_campaign(FIVE, skipped=skipped, interrupted=True))
    assert (verdict.scored, verdict.cases, verdict.word) == (5, 10, "not decided")
    assert verdict.compared == {"finite elements": "5 of 10 cases"}
    assert verdict.reasons == (
        "the run was interrupted", "not scored: a", "2 faults in the campaign file cost their cases",
    )  # fmt: skip
    # a requirement that is missed is told alone
    missed = judge(dataclasses.replace(faulty, criterion=limit(plan, {"misplaced_force": 1e-3}).criterion),
                   make_campaign(FIVE, skipped=skipped))  # fmt: skip
    assert (missed.word, missed.reasons) == ("not accepted", (missed.findings[0].text,))


def describe(metric, status, value, limit, *, low=None, high=None, cases=6, undefined=0):
    low, high = (value if each is None else each for each in (low, high))
    return Finding(
        metric=metric, over=MEAN, value=value, low=low, high=high, limit=limit, status=status, cases=cases,
        undefined=undefined,
    )  # fmt: skip


TEXTS = [
    (describe("misplaced_force", "met", 0.041, 0.06, low=0.032, high=0.053),
     "misplaced force, mean over the cases: 4.1 % (95 % interval 3.2 to 5.3 %), at most 6 % required",
     "misplaced force 4.1 %, limit 6 %"),
    (describe("centre_of_pressure_m", "open", 1.234e-4, 1e-4, cases=3, undefined=2),
     "centre of pressure, mean over the cases: 0.123 mm, at most 0.1 mm required; too few to tell; defined in 3 of 5",
     "centre of pressure 0.123 mm, limit 0.1 mm"),
    (describe("image_changed_percent", "open", 1.25, 2.0, low=1.0, high=1.5, cases=5),
     "image changed, mean over the cases: 1.25 % (95 % interval 1 to 1.5 %), at most 2 % required",
     "image changed 1.25 %, limit 2 %"),
    (describe("behind_null_percent", "met", -0.5, 0.2, low=-0.75, high=-0.25, cases=4),
     ("image changed, behind the best null model, mean over the cases: -0.5 % (95 % interval -0.75 to -0.25 %), "
      "at most 0.2 % required"),
     "image changed, behind the best null model -0.5 %, limit 0.2 %"),
    (describe("pixels_changed", "open", 7.0, 8.0, cases=1),
     "pixels changed, mean over the cases: 7, at most 8 required", "pixels changed 7, limit 8"),
]  # fmt: skip


@pytest.mark.parametrize(("finding", "text", "short"), TEXTS)
def test_a_requirement_is_a_sentence_in_the_unit_of_its_metric(finding, text, short):
    assert (finding.text, finding.short) == (text, short)


def make_verdict(*statuses, word="not accepted"):
    findings = [
        Finding(metric="peak_error", over=str(k), value=0.1, low=0.1, high=0.1, limit=0.2, status=s, against=a)
        for k, (s, a) in enumerate(statuses)
    ]
    compared = {"finite elements": "6 of 7 cases", "recordings": "made up, 8 loads"}
    return Verdict(word=word, reasons=(), findings=tuple(findings), scored=6, cases=7, compared=compared)


def test_the_worst_requirement_decides_in_each_comparison():
    fem, recorded = "finite elements", "recordings"
    verdict = make_verdict(
        ("met", fem), ("open", fem), ("missed", fem), ("missed", fem), ("met", recorded), ("open", recorded)
    )
    assert [each.over for each in verdict.deciding] == ["2", "5"]
    assert verdict.sentence == (
        "The fast model is not accepted against finite elements (6 of 7 cases) and against recordings (made up, "
        "8 loads): 2 of 6 requirements are missed."
    )
    assert verdict.short == (
        "verdict: NOT ACCEPTED; fast model against finite elements, 6 of 7 cases: peak 10 %, limit 20 %; "
        "against recordings, made up, 8 loads: peak 10 %, limit 20 %"
    )
    assert not verdict.accepted
    accepted = make_verdict(("met", fem), ("met", fem), word="accepted")
    assert accepted.accepted
    assert [each.over for each in accepted.deciding] == ["0"]
    assert accepted.sentence.endswith("(made up, 8 loads): every requirement is met.")
    open_one = make_verdict(("met", fem), ("open", fem), word="not decided")
    assert [each.over for each in open_one.deciding] == ["1"]
    assert open_one.sentence.endswith("no requirement is missed, but it is not shown that all are met.")


def make_recordings(own, null, *, problems=(), splits=("near",)):
    def row(split, model, values, gains):
        names = [field.name for field in dataclasses.fields(CountScore)]
        per_case = {f"{split} {k} N": CountScore(**dict.fromkeys(names, value)) for k, value in enumerate(values)}
        return RecordingRow(
            split=split, model=model, kind="model" if gains else "null", texel_gains=gains, fitted=(), parameters={},
            per_case=per_case, pooled={name: pool(values) for name in names}, skill={}, electronics=None,
        )  # fmt: skip

    rows = [row(split, *each) for split in splits for each in (("mean", null, False), ("fast", own, True))]
    return RecordingScores(
        name="made up", rows=tuple(rows), examples=(), about={}, notes={}, files={}, noise=0.0, source="",
        problems=tuple(problems),
    )  # fmt: skip


OWN, NULL = (1.0, 1.2, 0.9, 1.1, 1.3), (1.1, 1.15, 1.0, 1.3, 1.2)


def test_requirements_on_recordings_hold_in_every_split_and_those_of_the_data_set_replace_others(plan):
    scores = make_recordings(OWN, NULL, splits=("near", "far"))
    given = limit(plan, recordings={"image_changed_percent": 9.0, "behind_null_percent": 0.5})
    verdict = judge(given, None, scores, required={"image_changed_percent": 0.5}, splits=["near", "far", "lost"])
    assert [(each.metric, each.over, each.status) for each in verdict.findings] == [
        ("image_changed_percent", "recordings, split near, 5 loads", "missed"),
        ("behind_null_percent", "recordings, split near, 5 loads (mean)", "met"),
        ("image_changed_percent", "recordings, split far, 5 loads", "missed"),
        ("behind_null_percent", "recordings, split far, 5 loads (mean)", "met"),
    ]
    assert {each.against for each in verdict.findings} == {"recordings"}
    # own minus null, load by load: -0.1, 0.05, -0.1, -0.2, 0.1
    behind = pool([-0.1, 0.05, -0.1, -0.2, 0.1])
    assert verdict.findings[1].value == pytest.approx(-0.05)
    assert (verdict.findings[1].low, verdict.findings[1].high) == pytest.approx((behind.low, behind.high))
    assert verdict.compared == {"recordings": "made up, 10 loads"}
    assert (verdict.scored, verdict.cases) == (0, 0)
    open_one = judge(limit(plan, recordings={"relative_l2": 9.0}), None, scores, splits=["near", "far", "lost"])
    assert open_one.word == "not decided"
    assert open_one.reasons == ("no scores on the recordings of split 'lost'",)
    alone = judge(limit(plan, recordings={"relative_l2": 9.0}), None, make_recordings((1.0,), (2.0,)))
    assert alone.findings[0].over == "recordings, split near, 1 load"
    assert alone.compared == {"recordings": "made up, 1 load"}


def test_faults_in_recordings_are_counted_and_the_first_is_named(plan):
    given = limit(plan, recordings={"relative_l2": 9.0})
    lines = ("a: empty; left out", "b: turned", "c: damaged; left out")
    verdict = judge(given, None, make_recordings(OWN, NULL, problems=lines))
    assert verdict.reasons == ("2 faults in the recordings, such as: a: empty; left out",)
    verdict = judge(given, None, make_recordings(OWN, NULL, problems=lines[:2]))
    assert verdict.reasons == ("1 fault in the recordings, such as: a: empty; left out",)


def test_both_comparisons_count_and_an_accepted_verdict_names_their_means(plan):
    given = limit(plan, {"misplaced_force": 0.5}, {"peak_error": 9.0}, {"relative_l2": 9.0})
    verdict = judge(given, make_campaign(FIVE), make_recordings(OWN, NULL))
    assert verdict.word == "accepted"
    assert len(verdict.findings) == 7
    assert [text.split(":")[0] for text in verdict.reasons] == [
        "misplaced force, mean over the cases", "relative L2, recordings, split near, 5 loads",
    ]  # fmt: skip
    alone = judge(limit(plan, each={"peak_error": 9.0}), make_campaign(FIVE))
    assert [text.split(":")[0] for text in alone.reasons] == ["peak, case 0"]


@pytest.mark.parametrize(
    ("floor", "words"),
    [
        ({"peak_texel": 0.0123}, "1.2 % of the peak texel"), ({"depth": 0.1}, "0 % of the peak texel"),
        ({"misplaced_force": 0.0456, "peak_texel": 0.2}, "4.6 % of the load, on wrong texels"),
        ({"peak_texel": math.nan}, "not known, there is one mesh only"),
    ],
)  # fmt: skip
def test_the_error_of_the_reference_is_described_with_what_it_is_relative_to(floor, words):
    assert describe_reference_error(make_campaign(FIVE, floor=floor)) == words
