"""The built-in sensor against the baseline that this repository commits, far closer than its tolerances."""

from dataclasses import replace
from pathlib import Path

import pytest

import fastmodel
from tests.validation.regression.planted import WITH_ELEMENTS
from validation.regression.baseline import make_baseline, measure_changes, read_baseline
from validation.regression.quantities import EXPERIMENTS, measure
from validation.regression.reading import Subject, describe_sensor

ROOT = Path(__file__).parents[3]
#: Groups that take seconds.
SLOW = ("calibration", "in time", "recordings", "touches")
#: Groups that need no finite elements, and those that the shared derivation has the results for.
FAST, DERIVED = (
    [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in names]
    for names in (
        [name for name in EXPERIMENTS if name not in (*WITH_ELEMENTS, "data sheet")],
        ["kernel", "shipped parameters", "recordings", "data sheet"],
    )
)


@pytest.fixture(scope="module")
def committed():
    title = describe_sensor("wts-0614-34", fastmodel.load("wts-0614-34").array, derived=True)
    return read_baseline(ROOT / ".ci" / "wts-0614-34.json", title)


def find_changes(committed, subject, group):
    """The quantities that differ by a twentieth of their tolerance, have another tolerance, or are on one side only.

    A tolerance of 1 % of the largest number has two digits, whose last one may hang on rounding.
    """
    readings, failures = measure(subject, groups={group: EXPERIMENTS[group]}, progress=lambda _: None)
    assert not failures
    stored = {title: each for title, each in committed.readings.items() if title.startswith(f"{group}: ")}
    assert {title: each.tolerance for title, each in readings.items()} == {
        title: pytest.approx(each.tolerance, rel=0.03) for title, each in stored.items()
    }
    ratios = measure_changes(replace(committed, readings=stored), make_baseline(committed.sensor, readings))
    return {title: ratio for title, ratio in ratios.items() if ratio > 0.05}


@pytest.mark.parametrize("group", FAST)
def test_the_shipped_sensor_measures_what_is_committed(committed, group):
    assert find_changes(committed, Subject(parameters=fastmodel.load("wts-0614-34")), group) == {}


@pytest.mark.parametrize("group", DERIVED)
def test_its_derivation_measures_what_is_committed(committed, wts_derivation, group):
    subject = Subject(parameters=wts_derivation.parameters, derivation=wts_derivation)
    assert find_changes(committed, subject, group) == {}
