"""What a campaign costs is known before it starts, and finished cases survive an interruption."""

import pytest

from validation.campaign.bench import LayeredBench
from validation.campaign.case import Case
from validation.campaign.run import Plan, plan_cases, run_campaign

CASES = (
    Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
    Case.read("the same elsewhere", "sphere:radius=5mm", "500 g"),
    Case.read("box", "box:size=6mmx10mmx5mm", "100 g"),
)


def test_missing_solutions_are_counted_once_and_stored_ones_not(bonded, wts, tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    cover = bonded(0.49)
    plan = plan_cases(cover, wts, CASES)
    assert plan.missing == (True, False, True)
    assert "3 cases, 2 reference solutions missing" in plan.describe()
    from validation.campaign.reference_press import press_reference

    press_reference(cover, wts, CASES[0])
    after = plan_cases(cover, wts, CASES)
    assert after.missing == (False, False, True)
    assert after.total < plan.total


def test_time_left_follows_the_finished_cases():
    plan = Plan(missing=(True,) * 3, seconds=(10.0, 10.0, 20.0))
    assert plan.describe_left(0, 0.0, "a") == "a, about 40 s left"
    assert plan.describe_left(1, 30.0, "b") == "b, about 90 s left"  # three times as long as expected
    assert plan.describe_left(2, 60.0, "c") == "c, about 60 s left"
    assert plan.describe_left(2, 600.0, "c") == "c, about 10 min left"


def test_an_interrupted_run_keeps_the_finished_cases(bench, campaign, cases, monkeypatch):
    def solve(_, case):
        if case.name == "sphere":
            return campaign.cases[0]
        raise KeyboardInterrupt

    monkeypatch.setattr(LayeredBench, "solve", solve)
    result = run_campaign(bench, cases)
    assert result.interrupted
    assert [each.case.name for each in result.cases] == ["sphere"]
    assert [(each.name, each.reason) for each in result.skipped] == [("box", "interrupted"), ("edge", "interrupted")]
    with pytest.raises(KeyboardInterrupt):
        run_campaign(bench, cases[1:])
