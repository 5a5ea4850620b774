"""The order of the evidence, its failures, and what a budget leaves out, on a bench that is made up."""

import time
from types import SimpleNamespace

import pytest

from fem_reference import ConvergenceError
from tests.support.made_up_evaluation import CASES, CHECKS, make_case, make_evidence
from validation.campaign.bench import Verification
from validation.campaign.campaign_file import Inputs
from validation.campaign.plan import Budget
from validation.campaign.run import summarise
from validation.credibility.evidence import gather_evidence
from validation.sensor_file import load

SENSOR = load("wts-0614-34")
MADE = make_evidence(SENSOR)
CAMPAIGN = SimpleNamespace(inputs=Inputs(data=0.07))


def fail(error):
    raise error


def make_bench(told, *, failing=()):
    def propagate(case, inputs):
        told.append((case.name, inputs.data))
        return fail(ConvergenceError("too coarse")) if case.name in failing else MADE.inputs[case.name]

    return SimpleNamespace(
        verify=lambda results: [
            Verification("one", lambda: [CHECKS[0]], 10.0), Verification("two", lambda: fail(ValueError("no mesh"))),
            Verification("three", lambda: [CHECKS[1]], 100.0),
        ],
        propagate=propagate, score_stages=lambda results: MADE.stages if len(results) == 2 else None,
        classify=lambda result: {"load": "light"}, measure=lambda result: {"load_N": result.case.load},
        parameters=SimpleNamespace(array=SENSOR.array), left_out=("nothing",), notes={"cases": "a note"},
    )  # fmt: skip


def gather(*, failing=(), interrupted=False, **options):
    told = []
    result = summarise(
        [make_case(number, case) for number, case in enumerate(CASES)], (), None, interrupted=interrupted
    )
    found = gather_evidence(make_bench(told, failing=failing), CAMPAIGN, result, **options)
    return found, told


def test_all_parts_are_kept_besides_one_that_fails():
    stages = []
    found, told = gather(progress=stages.append)
    assert stages == [
        "one", "two", "three", "input uncertainty, case 1 of 2", "input uncertainty, case 2 of 2", "score by stage",
    ]  # fmt: skip
    assert told == [("sphere", 0.07), ("box", 0.07)]
    assert found.checks == CHECKS
    assert found.failed == ("two: no mesh",)
    assert list(found.inputs) == ["sphere", "box"]
    assert found.stages is MADE.stages
    assert (found.left_out, dict(found.notes)) == (("nothing",), {"cases": "a note"})
    assert found.domain == {"load_N": (CASES[1].load, CASES[0].load)}
    assert found.groups["load"]["light"]["misplaced_force"].cases == 2
    assert {each.case for each in found.errors} == {"sphere", "box"}
    peak = next(each for each in found.errors if each.quantity == "largest texel [mN]")
    assert (peak.fast, peak.reference, peak.u_data) == pytest.approx((1.9, 2.1, 0.07 * 2.1))
    assert all(found.inputs[name] is MADE.inputs[name] for name in ("sphere", "box"))


def test_a_case_whose_inputs_fail_has_no_comparison_errors():
    found, _ = gather(failing=("sphere",))
    assert found.failed == ("two: no mesh", "input uncertainty of sphere: too coarse")
    assert {each.case for each in found.errors} == set(found.inputs) == {"box"}


def test_after_an_interruption_nothing_is_computed():
    found, told = gather(interrupted=True)
    assert (found.checks, dict(found.inputs), found.errors, found.stages, told) == ((), {}, (), None, [])
    assert found.failed == ("interrupted: codes are not verified, inputs not propagated, stages not scored",)
    assert found.domain


@pytest.mark.parametrize(
    ("left", "checks", "failed"),
    [
        (1000.0, CHECKS, ["two: no mesh"]),
        (50.0, CHECKS[:1], ["two: no mesh", "three: the budget of time leaves no room for it"]),
        (5.0, (), ["one: the budget of time leaves no room for it", "two: no mesh",
                   "three: the budget of time leaves no room for it"]),
    ],
)  # fmt: skip
def test_a_check_needs_its_expected_time(left, checks, failed):
    found, told = gather(budget=Budget(seconds=left))
    assert (found.checks, list(found.failed), len(told)) == (checks, failed, 2)


def test_without_time_every_part_is_left_out():
    found, told = gather(budget=Budget(seconds=1.0, started=time.process_time() - 5.0))
    names = ("one", "two", "three", "input uncertainty of sphere", "input uncertainty of box", "stages")
    assert found.failed == tuple(f"{name}: the budget of time is used up" for name in names)
    assert (found.checks, told, found.stages) == ((), [], None)
