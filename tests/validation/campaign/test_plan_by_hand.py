"""Expected times, shared solutions and the choice of cases within a budget, by hand."""

import dataclasses
import math
import time

import pytest

from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Sphere
from tests.support.rubber import make_cover, stack_layers
from validation.campaign.campaign_file import Campaign, Criterion, Inputs
from validation.campaign.case import Case
from validation.campaign.plan import (
    Budget,
    OutOfBudgetError,
    Plan,
    check_budget,
    estimate_cost,
    measure_pace,
    plan_cases,
    read_budget,
)
from validation.errors import InputError

BALL, BOX, DISK = "sphere:radius=5mm", "box:size=4mmx6mmx4mm", "cylinder:radius=4mm"
RUBBER, LINEAR = make_cover(0.49), make_cover(0.49, "linear-elastic")
SMALL = make_cover(0.49, "linear-elastic", size=(40e-3, 30e-3))
#: Load that presses each cover to three tenths of its thickness [N].
BORNE = 8.0


@pytest.fixture(autouse=True)
def _borne(monkeypatch):
    """Contacts, which take half a second each, are not solved: every cover bears the same load."""
    monkeypatch.setattr("validation.campaign.plan.bear", lambda _cover, _indenter: BORNE)


@pytest.mark.parametrize(
    ("cover", "shape", "friction", "kind", "seconds"),
    [
        (LINEAR, BALL, 0.0, "small strain", 1.5),
        (LINEAR, BALL, 0.3, "small strain", 6.0),
        (SMALL, BALL, 0.0, "small strain", 1.5 + 9.0),
        (SMALL, BOX, 0.7, "small strain", 6.0 + 9.0),
        (stack_layers((2e-3, 1e6, 0.49), (1e-3, 2e6, 0.45)), DISK, 0.0, "small strain", 1.5 + 25.0),
        (stack_layers((2e-3, 1e6, 0.49), (1e-3, 2e6, 0.45)), BALL, 0.0, "small strain", 1.5),
        # A stage of 1 s, and the share 0.7 of the time of a press that hardly goes down
        (RUBBER, BALL, 0.0, "round", 1.0 + 0.7 * 2.5),
        (RUBBER, DISK, 0.0, "round", 1.0 + 0.7 * 2.5),
        (RUBBER, BALL, 0.2, "round", 1.0 + 0.7 * 5.0 * 2.5),
        # A block of 4 mm by 6 mm on 2 mm: 2 + 4 by 3 + 4 thicknesses, over 8 by 8
        (RUBBER, BOX, 0.0, "block", 1.0 + 0.7 * (32.0 * (42 / 64) ** 2.5 + 14.0)),
        (RUBBER, BOX, math.inf, "block", 1.0 + 0.7 * 5.0 * (32.0 * (42 / 64) ** 2.5 + 14.0)),
        (make_cover(0.49, size=(40e-3, 30e-3)), BOX, 0.0, "block", 10.0 + 0.7 * (32.0 * (42 / 64) ** 2.5 + 14.0)),
    ],
)
def test_a_light_press_is_expected_to_take_the_measured_time_of_its_kind(cover, shape, friction, kind, seconds):
    found = estimate_cost(cover, Case.read("a", shape, "1 uN"), friction)
    assert (found.kind, found.seconds) == (kind, pytest.approx(seconds, rel=1e-3))


def test_each_further_layer_of_a_block_adds_half_of_its_elements():
    one = RUBBER.layers[0]
    for count in (2, 3):
        layers = tuple(dataclasses.replace(one, thickness=2e-3 / count) for _ in range(count))
        cover = dataclasses.replace(RUBBER, layers=layers)
        found = estimate_cost(cover, Case.read("a", BOX, "1 uN"), 0.0).seconds
        block = 32.0 * (42 / 64 * (1 + 0.5 * (count - 1))) ** 2.5 + 14.0
        assert found == pytest.approx(25.0 + 1.0 + 0.7 * block, rel=1e-3)


@pytest.mark.parametrize(
    ("shape", "full", "share"), [(BALL, 2.5, 1 / 4), (DISK, 2.5, 1 / 8), (BOX, 32.0 * (42 / 64) ** 2.5 + 14.0, 1 / 8)]
)
def test_a_press_to_three_tenths_of_the_thickness_takes_the_whole_time(shape, full, share):
    """An eighth of the load presses a ball to a quarter of the depth, and a flat face to an eighth."""
    found, less = (estimate_cost(RUBBER, Case.read("a", shape, load), 0.0) for load in ("8 N", "1 N"))
    assert (found.depth, found.seconds) == pytest.approx((0.3, 1.0 + full))
    assert (less.depth, less.seconds) == pytest.approx((0.3 * share, 1.0 + (0.7 + 0.3 * share) * full))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_contact_four_decay_lengths_from_a_side_does_not_feel_it(axis, sign):
    """A ball of 5 mm that sinks 0.6 mm meets the cover up to sqrt(2 R d - d^2), to a radius of 32 steps."""
    size = (60e-3, 50e-3)
    cover = make_cover(0.49, size=size)
    step = 5e-3 / 31
    reached = step * math.floor(math.sqrt(2 * 5e-3 * 0.6e-3 - 0.6e-3**2) / step)
    room = reached + 4.0 * decay_length(make_cover(0.49))
    for beyond, kind in ((1e-6, "round"), (-1e-6, "round near sides")):
        at = [0.0, 0.0]
        at[axis] = sign * (size[axis] / 2 - room - beyond)
        found = estimate_cost(cover, Case.read("a", BALL, "8 N", at=f"{at[0]} m,{at[1]} m"), 0.0)
        assert (found.kind, found.seconds) == (kind, pytest.approx(3.5 + 9.0 * (beyond < 0)))


@pytest.fixture
def empty_store(monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))


LIGHT, ELSEWHERE = Case.read("a", BALL, "1 uN"), Case.read("b", BALL, "1 uN", at="1mm,2mm", yaw="20deg")


@pytest.mark.usefixtures("empty_store")
@pytest.mark.parametrize(
    ("other", "shared"),
    [
        (ELSEWHERE, True),
        (dataclasses.replace(ELSEWHERE, load=2e-6), False),
        (dataclasses.replace(ELSEWHERE, path=(1e-6, 2e-6)), False),
        (dataclasses.replace(ELSEWHERE, pose=dataclasses.replace(ELSEWHERE.pose, tilt=(0.1, 0.0))), False),
        (dataclasses.replace(ELSEWHERE, indenter=Sphere(radius=4e-3)), False),
        (dataclasses.replace(ELSEWHERE, load=3e-6, others=(Case.read("c", BALL, "2 uN", at="20mm,0mm"),)), False),
    ],
)
def test_two_presses_share_a_solution_if_only_their_place_differs(wts, other, shared):
    plan = plan_cases(LINEAR, wts, (LIGHT, other))
    assert plan.shares == ((0, 0) if shared else (0, 1))
    assert plan.missing == (True, not shared)
    assert plan.kinds == ("small strain", "stored" if shared else "small strain")
    pace = measure_pace()
    assert plan.seconds[0] == pytest.approx(pace * (1.0 + 1.5))
    assert (plan.seconds[1] == pytest.approx(pace * 1.0)) == shared
    assert plan.rest == pytest.approx(20.0 * pace)


@pytest.mark.usefixtures("empty_store")
def test_on_a_cover_with_sides_each_place_has_its_own_solution_and_the_response_costs_by_the_area(wts):
    """40 mm by 30 mm are 300 squared thicknesses of 2 mm: 9 s; the time grows with the power 1.2 of the area."""
    pace = measure_pace()
    plan = plan_cases(SMALL, wts, (LIGHT, ELSEWHERE))
    assert (plan.shares, plan.missing) == ((0, 1), (True, True))
    assert plan.rest == pytest.approx(pace * (20.0 + 9.0))
    larger = make_cover(0.49, "linear-elastic", size=(80e-3, 30e-3))
    assert plan_cases(larger, wts, (LIGHT,)).rest == pytest.approx(pace * (20.0 + 9.0 * 2**1.2))
    assert plan.total == pytest.approx(plan.rest + 2 * pace * (1.0 + 1.5 + 9.0))


@pytest.mark.usefixtures("empty_store")
def test_the_comparison_models_are_fitted_at_finite_strain_with_two_presses_on_several_layers(wts):
    pace, one = measure_pace(), RUBBER.layers[0]
    plan = plan_cases(RUBBER, wts, (LIGHT,))
    assert plan.rest == pytest.approx(pace * (20.0 + 8.0))
    assert plan.depths == (estimate_cost(RUBBER, LIGHT, 0.0).depth,)
    two = dataclasses.replace(RUBBER, layers=(dataclasses.replace(one, thickness=1e-3),) * 2)
    assert plan_cases(two, wts, (LIGHT,)).rest == pytest.approx(pace * (20.0 + 8.0 + 50.0))
    rubbed = plan_cases(LINEAR, wts, (LIGHT,), friction=0.5)
    assert rubbed.seconds == (pytest.approx(pace * 7.0),)


@pytest.mark.usefixtures("empty_store")
def test_on_a_solid_cover_the_response_to_each_texel_may_be_missing(small_pad):
    pace = measure_pace()
    plan = plan_cases(small_pad.cover, small_pad.array, (LIGHT, ELSEWHERE))
    assert plan.rest == pytest.approx(pace * 80.0)
    assert plan.seconds[0] == pytest.approx(pace * (1.0 + 7.0))
    assert plan.kinds[0] == "solid cover"


def test_the_pace_is_a_power_of_five_quarters():
    steps = math.log(measure_pace()) / math.log(1.25)
    assert steps == pytest.approx(round(steps), abs=1e-9)
    assert 0.05 < measure_pace() < 50


def test_a_plan_says_what_is_missing_without_its_spare_cases():
    plan = Plan(missing=(True, False, True, True), seconds=(10.0, 20.0, 30.0, 40.0), rest=7.0)
    assert plan.total == 107.0
    assert plan.describe() == "4 cases, 3 reference solutions missing from the store; about 2 min"
    assert plan.describe(Budget(seconds=50.0), 1) == (
        "3 cases, 2 reference solutions missing from the store, and more while time is left; about 50 s"
    )
    stored = dataclasses.replace(plan, missing=(False, False, True, True))
    assert stored.describe(None, 2) == (
        "all reference solutions of 2 cases are in the store, and more while time is left; about 2 min"
    )
    assert Plan(missing=(), seconds=()).total == 20.0


def test_finished_cases_of_the_same_kind_then_the_missing_ones_correct_what_is_expected():
    plan = Plan(missing=(True, True, False, True), seconds=(10.0, 30.0, 5.0, 8.0), kinds=("a", "b", "stored", "a"))
    assert [plan.expect(case) for case in range(4)] == [10.0, 30.0, 5.0, 8.0]
    plan.spent[2] = 50.0  # a stored one says nothing about others
    assert plan.expect(3) == 8.0
    assert plan.expect(2) == 50.0
    plan.spent.update({0: 15.0, 1: 90.0})
    assert plan.expect(3) == pytest.approx(8.0 * 1.5)
    without = dataclasses.replace(plan, kinds=())
    assert without.expect(3) == pytest.approx(8.0 * 105 / 40)
    assert plan.describe_left([2, 3], "ball") == "ball, about 62 s left"


def make_campaign(*cases, quick=()):
    return Campaign(
        name="mine", source="file", intended_use="", criterion=Criterion(mean={}, each={}), inputs=Inputs(),
        cases=cases, quick=quick,
    )  # fmt: skip


def make_case(number, shape=BALL, load="1 N", at="0mm,0mm", yaw="0deg"):
    return Case.read(f"case {number}", shape, load, at=at, yaw=yaw)


def shorten(cases, seconds, budget, *, quick=(), rest=10.0, shares=None, depths=None, **options):
    """Numbers of the chosen cases and of the spare ones."""
    count = len(cases)
    plan = Plan(
        missing=(True,) * count, seconds=tuple(seconds), kinds=("a",) * count, depths=depths or (0.0,) * count,
        shares=shares or tuple(range(count)), rest=rest,
    )  # fmt: skip
    found = Budget(seconds=budget, **options).shorten(make_campaign(*cases, quick=quick), plan)
    return [[int(case.name.split()[-1]) for case in part] for part in (found.cases, found.spare)]


EQUAL = [make_case(number) for number in range(8)]


@pytest.mark.parametrize(("budget", "count"), [(60.0, 3), (59.9, 2), (80.0, 4), (79.9, 3), (18.0, 1), (20.0, 1)])
def test_seven_tenths_of_a_budget_are_planned_or_one_case(budget, count):
    """Preparations of 9 s and cases of 11, 11, 11 and 14 s: 0.7 of 60 s are three; one is taken from 18 s on."""
    seconds = [8.0, 11.0, 14.0, 14.0, 200.0]
    kept, _ = shorten(EQUAL[:5], seconds, budget, rest=9.0)
    assert kept == list(range(count))


def test_cases_beyond_the_budget_by_ten_minutes_are_spare():
    """Preparations of 10 s and one of 10 s are planned within 30 s; until 630 s there is room for six of 100 s."""
    seconds = [10.0, 101.0, 102.0, 103.0, 104.0, 105.0, 99.0, 98.0]
    kept, spare = shorten(EQUAL, seconds, 30.0)
    assert kept == [0]
    assert spare == [7, 6, 1, 2, 3, 4]  # 98 + 99 + 101 + 102 + 103 + 104 = 607 s, of 610 s
    assert shorten(EQUAL, [10.0, 610.0, *[9e3] * 6], 30.0) == [[0], [1]]
    assert shorten(EQUAL, [10.0, 610.1, *[9e3] * 6], 30.0) == [[0], []]


def test_a_budget_below_the_cheapest_case_says_what_five_cases_take_twice():
    """10 s and the cheapest five, 31 + 32 + 33 + 34 + 35 s: twice 175 s are 5.83 minutes."""
    seconds = [38.0, 37.0, 36.0, 35.0, 34.0, 33.0, 32.0, 31.0]
    with pytest.raises(InputError) as error:
        shorten(EQUAL, seconds, 40.9)
    assert str(error.value) == (
        "--budget: 41 s is less than one case, which takes about 41 s with all preparations; "
        "write for example --budget 6min"
    )
    assert shorten(EQUAL, seconds, 41.0)[0] == [7]
    plan = Plan(missing=(True,) * 8, seconds=tuple(seconds), depths=(0.0,) * 8, shares=tuple(range(8)), rest=10.0)
    with pytest.raises(InputError, match=r"^--quick: 40 s is less than one case"):
        Budget(seconds=40.0, quick=True).shorten(make_campaign(*EQUAL), plan)
    assert Budget(seconds=60.0, quick=True).shorten(make_campaign(*EQUAL), plan).name == "mine, quick"
    assert Budget(seconds=60.0).shorten(make_campaign(*EQUAL), plan).name == "mine"


@pytest.mark.parametrize(
    ("cases", "order"),
    [
        # another kind of body with a flat face has two new traits, another place or load has one
        ([make_case(0), make_case(1, at="1mm,0mm"), make_case(2, DISK)], [0, 2, 1]),
        ([make_case(0), make_case(1, load="1.04 N"), make_case(2, load="2 N")], [0, 2, 1]),
        ([make_case(0), make_case(1, at="0.04mm,0mm"), make_case(2, at="0.06mm,0mm")], [0, 2, 1]),
        ([make_case(0), make_case(1, load="3 N"), make_case(2, yaw="45deg", at="0mm,3mm")], [0, 2, 1]),
        ([make_case(0), make_case(1, "sphere:radius=3mm"), make_case(2, "tip:radius=1mm")], [0, 2, 1]),
        ([make_case(0, DISK), make_case(1, "cylinder:radius=5mm"), make_case(2, BOX)], [0, 2, 1]),
    ],
)
def test_the_next_case_has_most_that_no_chosen_one_has(cases, order):
    kept, spare = shorten(cases, [10.0] * 3, 29.0)
    assert [*kept, *spare] == order


@pytest.mark.parametrize(
    ("options", "order"),
    [
        ({"depths": (0.1, 0.1, 0.2, 0.15)}, [2, 0, 1, 3]),  # the deepest
        ({"quick": ("case 3",), "depths": (0.1, 0.1, 0.2, 0.15)}, [3, 2, 0, 1]),  # a marked one
        ({"seconds": [10.0, 10.0, 10.0, 9.0]}, [3, 0, 1, 2]),  # the cheapest of equal ones
    ],
)
def test_marked_cases_come_before_the_deepest_and_the_cheapest(options, order):
    seconds = options.pop("seconds", [10.0] * 4)
    kept, spare = shorten(EQUAL[:4], seconds, 29.0, **options)
    assert [*kept, *spare] == order


@pytest.mark.parametrize(("budget", "dear"), [(142.86, True), (142.85, False)])
def test_a_dear_case_is_chosen_if_five_others_still_fit(budget, dear):
    """Preparations of 10 s, seven equal cases of 10 s and a disk of 40 s: 0.7 of the budget holds 100 s or not."""
    cases = [*EQUAL[:7], make_case(7, DISK)]
    kept, _ = shorten(cases, [10.0] * 7 + [40.0], budget)
    assert (7 in kept) == dear
    assert len(kept) == (6 if dear else 7)


@pytest.mark.parametrize(("budget", "kept"), [(85.72, [0, 2]), (85.7, [0, 1])])
def test_a_dear_case_costs_one_of_the_few_that_fit_and_no_more(budget, kept):
    """Preparations of 10 s, two cases of 10 s and one of 40 s: 0.7 of the budget holds 60 s or not."""
    assert shorten([*EQUAL[:2], make_case(2, DISK)], [10.0, 10.0, 40.0], budget)[0] == kept


def test_a_case_that_shares_its_solution_costs_the_whole_once_and_then_its_own_part():
    pace = measure_pace()
    three, seconds, shares = EQUAL[:3], [30.0, 1.5, 30.0], (0, 0, 2)
    assert shorten(three, seconds, (40.0 + pace + 1e-6) / 0.7, shares=shares)[0] == [0, 1]
    assert shorten(three, seconds, (40.0 + pace - 1e-3) / 0.7, shares=shares)[0] == [0]
    with pytest.raises(InputError, match="takes about 40 s"):
        shorten(three, seconds, 39.9, shares=shares)


def test_a_budget_is_a_time_and_quick_is_five_minutes():
    assert read_budget(None) is None
    quick, given = read_budget(None, quick=True), read_budget("20min")
    assert (quick.seconds, quick.quick) == (300.0, True)
    assert (given.seconds, given.quick) == (1200.0, False)
    with pytest.raises(InputError, match="--quick is the budget 5 min; give one of the two"):
        read_budget("20min", quick=True)


def test_what_is_left_of_a_budget_is_counted_from_its_start():
    now = time.process_time()
    budget = Budget(seconds=50.0, started=now - 20.0)
    assert budget.left == pytest.approx(30.0, abs=1.0)
    check_budget(budget)
    check_budget(None)
    with pytest.raises(OutOfBudgetError):
        check_budget(Budget(seconds=19.0, started=now - 20.0))
