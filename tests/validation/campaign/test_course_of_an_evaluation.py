"""What an evaluation and a campaign compute in which order, with parts that are made up: nothing is pressed."""

import dataclasses
from types import SimpleNamespace

import pytest

import fastmodel
from fem_reference import ConvergenceError
from tests.support.made_up_evaluation import PUBLISHED, make_case
from tests.support.rubber import make_cover
from validation.campaign import evaluation
from validation.campaign.campaign_file import Campaign, Criterion, Inputs
from validation.campaign.case import Case
from validation.campaign.evaluation import evaluate, evaluate_recordings
from validation.campaign.plan import Budget, OutOfBudgetError, Plan
from validation.campaign.results import MODELS, SKILL_METRICS, Prediction
from validation.campaign.run import run_campaign, summarise
from validation.errors import InputError
from validation.moving.run import Moved
from validation.sensor_file import load

SENSOR = load("wts-0614-34")
CASES = tuple(Case.read(f"case {k}", "sphere:radius=5mm", f"{k + 1} N", at=f"{k}mm,0mm") for k in range(4))
HEAVIEST = Case.read("heaviest", "sphere:radius=5mm", "9 N")


def solve(case):
    made = make_case(0, Case.read("sphere", "sphere:radius=5mm", "2 N"))
    return dataclasses.replace(made, case=case)


def make_campaign(**changes):
    values = {
        "name": "mine", "source": "file", "intended_use": "", "criterion": Criterion(mean={"peak_error": 9.0}, each={}),
        "inputs": Inputs(position=7e-4), "cases": CASES, "moving": (SimpleNamespace(heaviest=HEAVIEST),),
    }  # fmt: skip
    return Campaign(**(values | changes))


class Display:
    """A display of progress that keeps the stages."""

    def __init__(self):
        self.told = []

    def __call__(self, stage):
        self.told.append(stage)

    def step(self, done, total, name):
        self.told.append((done, total, name))


@pytest.fixture
def parts(monkeypatch):
    """The parts of an evaluation are made up; returns the list of what they were given, and settings of them."""
    told, settings = [], {"skipped": (), "interrupted": False, "moved": Moved(results=("moved",), skipped=("left",))}
    derivation = SimpleNamespace(sensor=SENSOR, verification={"radial_profile": 0.5}, parameters="derived")

    def derive(sensor, *, progress):
        told.append(("derive", sensor, progress))
        return derivation

    def plan_cases(cover, array, cases, *, friction):
        told.append(("plan", cover, array, tuple(each.name for each in cases), friction))
        count = len(cases)
        return Plan(
            missing=(True,) * count, seconds=(10.0,) * count, depths=(0.0,) * count, shares=tuple(range(count)),
            rest=10.0,
        )  # fmt: skip

    def prepare_bench(given, cases, progress):
        told.append(("bench", given is derivation, [each.name for each in cases], progress))
        return "bench"

    def run(bench, cases, *, plan, budget, spare, progress):
        told.append(("run", bench, [each.name for each in cases], len(plan.seconds), budget, spare, progress))
        left = settings["skipped"]
        done = [solve(each) for each in cases if each.name not in left]
        return summarise(done, (), None, interrupted=settings["interrupted"])

    def run_moving(bench, cases, progress, *, budget):
        told.append(("moving", bench, len(cases), progress, budget))
        return settings["moved"]

    def gather(bench, plan, result, progress, *, budget):
        told.append(("evidence", bench, plan, result.interrupted, progress, budget))
        return "evidence"

    def score(data_set, sensor, parameters, *, inputs, progress):
        told.append(("score", data_set, sensor, parameters, inputs, progress))
        return SimpleNamespace(rows=(), problems=(), name="set")

    for name, part in {
        "derive": derive, "plan_cases": plan_cases, "prepare_bench": prepare_bench, "run_campaign": run,
        "run_moving": run_moving, "gather_evidence": gather,
    }.items():  # fmt: skip
        monkeypatch.setattr(evaluation, name, part)
    monkeypatch.setattr("validation.data_sets.score.score_recordings", score)
    return told, settings


DATA = SimpleNamespace(splits=(SimpleNamespace(name="far"),), required={})
NAMES = [each.name for each in CASES]


def set_clock(monkeypatch, *times):
    """The clock shows these times [s], one after the other."""
    clock = iter(times)
    monkeypatch.setattr(evaluation, "time", SimpleNamespace(perf_counter=lambda: next(clock)))


def test_the_parts_of_an_evaluation_follow_one_another(parts, monkeypatch):
    told, _ = parts
    set_clock(monkeypatch, 5.0, 6.0, 16.0, 116.0)
    display, lines = Display(), []
    sensor = dataclasses.replace(SENSOR, friction=0.4)
    found = evaluate(sensor, campaign=make_campaign(), progress=display, announce=lines.append)
    assert [each[0] for each in told] == ["plan", "derive", "bench", "run", "moving", "evidence"]
    assert told[0] == ("plan", SENSOR.cover, SENSOR.array, tuple(NAMES), 0.4)
    assert told[1] == ("derive", sensor, display)
    assert told[2] == ("bench", True, [*NAMES, "heaviest"], display)
    assert told[3] == ("run", "bench", NAMES, 4, None, 0, display.step)
    assert told[4] == ("moving", "bench", 1, display.step, None)
    assert told[5][1:2] + told[5][3:] == ("bench", False, display, None)
    assert lines == ["4 cases, 4 reference solutions missing from the store; about 50 s"]
    assert display.told == ["moving cases"]
    assert (found.moving, found.not_moved, found.evidence) == (("moved",), ("left",), "evidence")
    assert (found.recordings, found.recorded, found.sensor) == (None, sensor, SENSOR)
    assert (found.plan.cases, found.plan.spare) == (CASES, ())
    assert list(found.verdict.compared) == ["finite elements"]
    assert found.verdict.cases == 4
    assert (found.verification, found.campaign.interrupted) == ({"radial_profile": 0.5}, False)
    assert found.seconds == {"recordings": 1.0, "derive": 10.0, "campaign": 100.0}


def test_cases_that_are_given_replace_those_of_the_campaign(parts):
    told, _ = parts
    found = evaluate(SENSOR, campaign=make_campaign(moving=()), cases=[CASES[2]])
    assert told[0][3] == ("case 2",)
    assert found.plan.cases == (CASES[2],)
    assert "moving" not in [each[0] for each in told]
    assert (found.moving, found.not_moved) == ((), ())


def test_within_a_budget_spare_cases_that_were_computed_join_the_others(parts):
    """Preparations and two cases are planned in 0.7 of 43 s; of the two spare ones one is computed."""
    told, settings = parts
    settings["skipped"] = ("case 3",)
    budget, lines = Budget(seconds=43.0), []
    found = evaluate(SENSOR, campaign=make_campaign(), budget=budget, announce=lines.append)
    kept = [each.name for each in found.plan.cases]
    plans, (run,) = [each[3] for each in told if each[0] == "plan"], [each for each in told if each[0] == "run"]
    assert plans[0] == tuple(NAMES)
    assert plans[1] == tuple(run[2])
    of_sensor = (SENSOR.cover, SENSOR.array, SENSOR.friction)
    assert [(each[1], each[2], each[4]) for each in told if each[0] == "plan"] == [of_sensor, of_sensor]
    assert run[4:6] == (budget, 2)
    assert len(kept) == 3
    assert [each.name for each in found.plan.spare] == ["case 3"]
    assert lines[0].startswith("2 cases, 2 reference solutions missing from the store, and more while time is left")
    assert [each[-1] for each in told if each[0] in ("moving", "evidence")] == [budget, budget]


def test_a_planned_case_without_scores_stays_in_the_plan(parts):
    _, settings = parts
    settings["skipped"] = ("case 1",)
    assert evaluate(SENSOR, campaign=make_campaign()).plan.cases == CASES


def test_after_an_interruption_nothing_moves(parts):
    told, settings = parts
    settings["interrupted"] = True
    found = evaluate(SENSOR, campaign=make_campaign())
    assert [each[0] for each in told] == ["plan", "derive", "bench", "run", "evidence"]
    assert told[-1][3]
    assert found.campaign.interrupted
    settings |= {"interrupted": False, "moved": Moved(interrupted=True)}
    assert evaluate(SENSOR, campaign=make_campaign()).campaign.interrupted


@pytest.mark.parametrize("own", [True, False])
def test_recordings_are_scored_first_and_count_if_they_are_of_the_sensor(parts, own):
    told, _ = parts
    other = load("sdh2-distal")
    found = evaluate(SENSOR, campaign=make_campaign(), recordings=DATA, recorded=None if own else other)
    kind, data, sensor, parameters, inputs, progress = told[0]
    assert (kind, data, sensor, progress) == ("score", DATA, SENSOR if own else other, None)
    assert parameters.array.name == sensor.array.name
    assert inputs.position == 7e-4
    assert found.recorded is sensor
    assert found.recordings.name == "set"
    assert list(found.verdict.compared) == (["finite elements", "recordings"] if own else ["finite elements"])
    mine = evaluate(SENSOR, campaign=make_campaign(), recordings=DATA, recorded=SENSOR)
    assert list(mine.verdict.compared) == ["finite elements", "recordings"]


def test_the_fast_model_of_a_sensor_of_a_file_is_derived_for_its_recordings(parts, monkeypatch):
    told, _ = parts
    set_clock(monkeypatch, 2.0, 5.5)
    sensor, display = dataclasses.replace(SENSOR, source="mine.toml"), Display()
    found = evaluate_recordings(sensor, DATA, campaign=make_campaign(), progress=display)
    assert [each[0] for each in told] == ["derive", "score"]
    assert told[1][3:] == ("derived", make_campaign().inputs, display)
    assert (found.sensor, found.recorded) == (sensor, sensor)
    assert list(found.verdict.compared) == ["recordings"]
    assert "no scores on the recordings of split 'far'" in found.verdict.reasons
    assert found.seconds == {"recordings": 3.5}
    assert found.versions["numpy"] == __import__("numpy").__version__
    assert found.versions.keys() == {"softcover", "numpy", "scipy", "mujoco", "scikit-fem", "python"}


class Bench(SimpleNamespace):
    """A bench whose cases take no time; those in `fails` raise an error."""

    def solve(self, case, report):
        self.solved.append(case.name)
        report("half")
        if case.name in self.fails:
            raise self.fails[case.name]
        return solve(case)


def make_bench(**fails):
    return Bench(
        cover=make_cover(0.45, "linear-elastic"), parameters=SimpleNamespace(array=SENSOR.array), friction=0.0,
        comparison=None, models=MODELS, solved=[], fails={f"case {name[1:]}": error for name, error in fails.items()},
    )  # fmt: skip


PLAN = Plan(missing=(True,) * 4, seconds=(30.0, 10.0, 1.0, 20.0), kinds=("a", "b", "c", "d"), shares=(0, 1, 0, 3))


@pytest.mark.parametrize(
    ("budget", "order"),
    [
        (None, [0, 1, 2, 3]),
        # the third shares the solution of the first, and follows the one that pays
        (Budget(seconds=1e6), [1, 3, 0, 2]),
    ],
)
def test_with_a_budget_the_cheapest_cases_come_first(budget, order):
    bench = make_bench()
    result = run_campaign(bench, CASES, plan=dataclasses.replace(PLAN, spent={}), budget=budget)
    assert bench.solved == [f"case {k}" for k in order]
    assert [each.case.name for each in result.cases] == NAMES
    assert (result.skipped, result.interrupted) == ((), False)


def test_cases_that_fail_are_named_in_their_order_with_the_reason():
    bench, told = make_bench(_0=ValueError("pierced"), _2=ConvergenceError("stopped"), _3=OutOfBudgetError()), []
    result = run_campaign(
        bench, CASES, plan=dataclasses.replace(PLAN, spent={}), progress=lambda *each: told.append(each)
    )
    assert [(each.name, each.reason, each.converged) for each in result.skipped] == [
        ("case 0", "pierced", True), ("case 2", "stopped", False), ("case 3", "the budget of time is used up", True),
    ]  # fmt: skip
    assert [each.case.name for each in result.cases] == ["case 1"]
    assert [done for done, *_ in told] == [0, 0, 1, 1, 2, 2, 3, 3, 4]
    assert {total for _, total, _ in told} == {4}
    assert told[0][2] == "case 0, about 61 s left"
    assert told[1][2] == "case 0, about 61 s left: half"
    assert told[-1] == (4, 4, "")
    with pytest.raises(InputError) as error:
        run_campaign(make_bench(_0=ValueError("pierced")), CASES[:1], plan=dataclasses.replace(PLAN, spent={}))
    assert str(error.value) == "case 0 (sphere:radius=5mm): pierced"


def test_an_interruption_keeps_what_is_finished():
    bench = make_bench(_1=KeyboardInterrupt())
    result = run_campaign(bench, CASES, plan=dataclasses.replace(PLAN, spent={}), spare=1)
    assert [each.case.name for each in result.cases] == ["case 0"]
    assert [(each.name, each.reason) for each in result.skipped] == [
        ("case 1", "interrupted"),
        ("case 2", "interrupted"),
    ]
    assert result.interrupted
    with pytest.raises(KeyboardInterrupt):
        run_campaign(make_bench(_0=KeyboardInterrupt()), CASES, plan=dataclasses.replace(PLAN, spent={}))


@pytest.mark.parametrize(("seconds", "spare"), [(30.0, ["case 2", "case 3"]), (15.0, ["case 2"]), (0.9, [])])
def test_spare_cases_are_computed_while_their_expected_time_is_left(seconds, spare):
    bench = make_bench()
    plan = Plan(missing=(False,) * 4, seconds=(1e-9, 1e-9, 1.0, 20.0), kinds=("a", "b", "c", "d"), shares=(0, 1, 2, 3))
    result = run_campaign(bench, CASES, plan=plan, budget=Budget(seconds=seconds), spare=2)
    assert bench.solved == ["case 0", "case 1", *spare]
    assert result.skipped == ()


def test_published_models_must_not_be_fitted_to_the_cases_and_are_pooled_by_their_rows():
    asked = []
    about = {
        name: getattr(PUBLISHED[0], name)
        for name in ("name", "title", "variant", "contact", "rule", "certainty", "total", "not_built", "parameters",
                     "units", "fitted", "fitted_on", "fit_misplaced_force")
    }  # fmt: skip
    row = SimpleNamespace(name="cone", as_json=lambda: about)
    comparison = SimpleNamespace(rows=(row,), check_unseen=lambda cases: asked.append(len(cases)))
    bench = make_bench()
    bench.comparison = comparison
    given = bench.solve

    def publish(case, report):
        made = given(case, report)
        fast = made.predictions["fast"]
        scores = dataclasses.replace(
            fast.score, **{name: 4 * getattr(fast.score, name) for name in SKILL_METRICS}
        )  # fmt: skip
        mine = Prediction(texel_forces=fast.texel_forces, outside=0.0, score=scores)
        return dataclasses.replace(made, published={"cone": mine})

    bench.solve = publish
    result = run_campaign(bench, CASES, plan=dataclasses.replace(PLAN, spent={}))
    assert asked == [4]
    (found,) = result.published
    assert (found.name, found.fitted_on) == ("cone", PUBLISHED[0].fitted_on)
    assert {name: each.mean for name, each in found.skill.items()} == pytest.approx(dict.fromkeys(SKILL_METRICS, 0.75))
    fast = result.cases[0].predictions["fast"].score
    assert found.pooled["misplaced_force"].mean == pytest.approx(4 * fast.misplaced_force)


def test_the_shipped_parameters_are_those_of_a_built_in_sensor(parts):
    told, _ = parts
    evaluate_recordings(SENSOR, DATA, campaign=make_campaign())
    assert [each[0] for each in told] == ["score"]
    assert told[0][3].spread == fastmodel.load("wts-0614-34").spread
