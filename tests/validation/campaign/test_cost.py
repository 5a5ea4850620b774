"""What a campaign costs is known before it starts, and finished cases survive an interruption."""

import dataclasses

import numpy as np
import pytest

import fem_reference
from meshes import Sphere
from tests.support.rubber import make_cover, stack_layers
from validation.campaign.bench import LayeredBench
from validation.campaign.campaign_file import read_campaign
from validation.campaign.case import Case
from validation.campaign.plan import COSTS, Budget, Plan, estimate_cost, plan_cases, read_budget
from validation.campaign.run import run_campaign
from validation.derivation.contact_range import bear
from validation.errors import InputError
from validation.places import FlatPlaces

CASES = (
    Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
    Case.read("the same elsewhere", "sphere:radius=5mm", "500 g"),
    Case.read("box", "box:size=6mmx10mmx5mm", "100 g"),
)


@pytest.mark.slow
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
    plan = Plan(missing=(True,) * 3, seconds=(10.0, 10.0, 20.0), kinds=("round", "block", "block"))
    assert plan.describe_left([0, 1, 2], "a") == "a, about 40 s left"
    plan.spent[0] = 30.0  # three times as long as expected
    assert plan.describe_left([1, 2], "b") == "b, about 90 s left"
    plan.spent[1] = 5.0  # problems of another kind are faster than expected
    assert plan.describe_left([2], "c") == "c, about 10 s left"
    plan.spent[1] = 300.0
    assert plan.describe_left([2], "c") == "c, about 10 min left"


def choose(campaign, seconds, *, depths=(), kinds=()):
    count = len(campaign.cases)
    plan = Plan(
        missing=(True,) * count, seconds=tuple(seconds), depths=depths or (0.0,) * count, shares=tuple(range(count)),
        kinds=kinds or ("round",) * count, rest=10.0,
    )  # fmt: skip
    return lambda budget: Budget(seconds=budget).shorten(campaign, plan)


@pytest.fixture
def built_in(wts):
    return read_campaign(None, FlatPlaces(array=wts))


def test_marked_cases_come_first_and_a_dear_one_is_replaced(built_in):
    quick = choose(built_in, [5.0] * 17)(60.0)  # 0.7 of it: preparations and six cases
    assert tuple(case.name for case in quick.cases) == built_in.quick
    dear = [1000.0 if "square" in case.name or "rectangle" in case.name else 5.0 for case in built_in.cases]
    names = [case.name for case in choose(built_in, dear)(60.0).cases]
    assert len(names) == 6
    assert not [name for name in names if "square" in name or "rectangle" in name]
    assert {"sphere, texel", "sphere, edge", "cylinder, off grid", "tip, off grid"} < set(names)


def test_a_small_budget_takes_what_tells_most_and_names_what_comes_next(built_in):
    unmarked = dataclasses.replace(built_in, quick=())
    depths = tuple(0.3 if case.name == "tip, texel" else 0.1 for case in unmarked.cases)
    few = choose(unmarked, [30.0] * 17, depths=depths)(230.0)  # 0.7 of it: preparations and five cases
    assert len(few.cases) == 5
    assert "tip, texel" in [case.name for case in few.cases]  # the deepest
    assert len({type(case.indenter) for case in few.cases}) >= 3
    assert len({case.pose.at for case in few.cases}) >= 3
    assert len(few.spare) == 12  # ten more minutes are enough for all of them
    assert len(choose(unmarked, [100.0] * 17)(170.0).spare) == 6


@pytest.mark.parametrize("text", ["0 s", "-3min", "5", "2 mm", "soon"])
def test_budgets_that_are_no_positive_time_are_refused(text):
    with pytest.raises(InputError, match=r"--budget: .*(time|unit|quantity|number)"):
        read_budget(text)
    with pytest.raises(InputError, match="give one of the two"):
        read_budget("20min", quick=True)


def test_budget_below_one_case_is_refused_with_what_is_enough(built_in):
    with pytest.raises(InputError, match=r"--budget: 20 s is less than one case, .* 40 s .*--budget 6min"):
        choose(built_in, [30.0] * 17)(20.0)


def test_an_exhausted_budget_stops_the_solver_and_keeps_the_other_cases(bench, campaign, cases, monkeypatch):
    budget = Budget(seconds=1000.0)

    def solve(_, case, progress):
        if case.name == "sphere":
            return campaign.cases[0]
        object.__setattr__(budget, "seconds", 0.0)
        progress("a step of Newton's method")
        raise AssertionError

    monkeypatch.setattr(LayeredBench, "solve", solve)
    plan = Plan(missing=(True,) * 3, seconds=(1.0, 2.0, 3.0))
    result = run_campaign(bench, cases, plan=plan, budget=budget)
    assert [each.case.name for each in result.cases] == ["sphere"]
    assert [each.reason for each in result.skipped] == ["the budget of time is used up"] * 2


@pytest.mark.slow
def test_loads_of_the_built_in_campaign_are_lowered_on_soft_covers(wts):
    stiff, soft = (
        read_campaign(None, FlatPlaces(array=wts, cover=stack_layers((2e-3, modulus, 0.49)))) for modulus in (1e6, 2e4)
    )
    assert {case.name: case.load for case in stiff.cases}["sphere, texel"] == pytest.approx(4.903325)
    loads = {case.name: case.load for case in soft.cases}
    assert soft.intended_use.endswith(f"lowered for this soft cover: 0.0049 N to {max(loads.values()):.2g} N.")
    assert stiff.intended_use.endswith("with 0.2 N to 5 N.")
    # A linear cover bears loads in proportion to its modulus; loads of one body keep their ratio.
    borne = bear(stack_layers((2e-3, 1e6, 0.49)), Sphere(radius=5e-3)) / 50
    assert loads["sphere, texel"] == pytest.approx(borne, rel=0.05)
    assert loads["sphere, centre"] == pytest.approx(borne / 5, rel=0.05)
    # Hertz (1882), on a cover that is thick beside the contact: F = 4/3 E / (1 - nu^2) sqrt(R d^3)
    thick = stack_layers((60e-3, 1e6, 0.49))
    hertz = 4 / 3 * 1e6 / (1 - 0.49**2) * (5e-3 * 0.6e-3**3) ** 0.5
    assert bear(thick, Sphere(radius=5e-3), 0.01) == pytest.approx(hertz, rel=0.03)


@pytest.mark.slow
def test_an_interrupted_run_keeps_the_finished_cases(bench, campaign, cases, monkeypatch):
    def solve(_, case, progress):
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


def estimate(cover, shape, load="1 mN", at="0mm,0mm", friction=0.0):
    return estimate_cost(cover, Case.read("case", shape, load, at=at), friction)


def test_expected_times_grow_as_the_problems():
    cover = make_cover(0.49)  # 2 mm thick
    small, big = (estimate(cover, f"box:size={edge}mmx{edge}mmx4mm") for edge in (4, 8))
    # Meshes reach two thicknesses beyond the box: 6 and 8 thicknesses.  At no depth 0.7 of the time remains.
    assert big.seconds - small.seconds == pytest.approx(0.7 * COSTS.block * (1 - (36 / 64) ** 2.5), rel=0.01)
    assert {small.kind, big.kind} == {"block"}
    rubbed = estimate(cover, "box:size=8mmx8mmx4mm", friction=0.4)
    assert rubbed.seconds - COSTS.stages == pytest.approx(COSTS.friction * (big.seconds - COSTS.stages))
    ball = estimate(cover, "sphere:radius=5mm")
    assert ball.kind == "round"
    assert ball.seconds == pytest.approx(COSTS.stages + 0.7 * COSTS.round, rel=0.05)
    assert estimate(cover, "sphere:radius=5mm", load="3 N").seconds > 1.1 * ball.seconds
    assert estimate(make_cover(0.49, "linear-elastic"), "sphere:radius=5mm").seconds == COSTS.small


def test_expected_depths_follow_the_load_as_those_of_faces_and_balls():
    for cover in (make_cover(0.49), make_cover(0.49, "linear-elastic")):
        for shape, power in (("sphere:radius=5mm", 2 / 3), ("cylinder:radius=4mm", 1)):
            light, heavy = (estimate(cover, shape, load).depth for load in ("0.1 N", "0.8 N"))
            assert heavy / light == pytest.approx(8**power)


def test_sides_cost_where_a_contact_is_near_them():
    cover = make_cover(0.49, size=(40e-3, 40e-3))
    middle, beside = (estimate(cover, "sphere:radius=5mm", at=at) for at in ("0mm,0mm", "18mm,0mm"))
    assert (middle.kind, beside.kind) == ("round", "round near sides")
    assert beside.seconds - middle.seconds == pytest.approx(COSTS.sides)


def test_spare_cases_take_the_time_that_is_left_and_no_more(bench, campaign, cases, monkeypatch):
    budget, solved = Budget(seconds=1000.0), []
    known = iter(campaign.cases)

    def solve(_, case, progress):
        solved.append(case.name)
        object.__setattr__(budget, "seconds", budget.seconds - 500.0)
        return next(known)

    monkeypatch.setattr(LayeredBench, "solve", solve)
    plan = Plan(missing=(True,) * 3, seconds=(1.0, 1.0, 1e6), rest=0.0)
    result = run_campaign(bench, cases, plan=plan, budget=budget, spare=2)
    assert solved == [case.name for case in cases[:2]]  # the third is expected to take too long
    assert len(result.cases) == 2
    assert not result.skipped
    assert plan.describe(budget, 2).startswith("1 cases, 1 reference solutions missing from the store, and more")
    assert run_campaign(bench, cases, plan=plan, spare=2).cases[0] is campaign.cases[2]
    assert len(solved) == 3


@pytest.mark.parametrize("spare", [0, 1])
def test_progress_counts_the_planned_cases_that_are_done(spare, bench, campaign, cases, monkeypatch):
    def solve(_, case, progress):
        progress("half-way")
        if case.name == cases[1].name:
            raise fem_reference.ConvergenceError("no")
        return campaign.cases[0]

    monkeypatch.setattr(LayeredBench, "solve", solve)
    told, number = [], 3 - spare
    plan = Plan(missing=(True,) * 3, seconds=(1.0, 2.0, 3.0))
    result = run_campaign(bench, cases, plan=plan, spare=spare, progress=lambda *each: told.append(each))
    assert len(result.cases) == number - 1
    assert [done for done, *_ in told] == [*np.repeat(range(number), 2), number]
    assert {planned for _, planned, _ in told} == {number}
    for case, (_, _, line) in zip(np.repeat(cases[:number], 2), told, strict=False):
        assert case.name in line


def test_a_plan_with_spare_cases_announces_no_more_than_the_budget():
    plan = Plan(missing=(True,) * 3, seconds=(10.0, 20.0, 500.0), rest=0.0)
    assert plan.describe().endswith("about 9 min")
    assert plan.describe(Budget(seconds=60.0), 1).endswith("about 60 s")
    assert plan.describe(Budget(seconds=6000.0), 1).endswith("about 9 min")
