"""Every planted change makes the check red and is named by it."""

import functools
from dataclasses import replace

import pytest

import fastmodel
from fastmodel import Butterworth
from fem_reference import point_spread
from meshes.relaxation import Relaxation
from tests.support.rubber import make_rubber
from tests.validation.regression.planted import (
    FRICTION,
    IN_TIME,
    NEIGHBOURS,
    REFERENCE,
    RELAXING,
    REQUIRED,
    WITH_ELEMENTS,
    measure_groups,
    take_every,
)
from validation.calibration import step_response
from validation.campaign import evaluation
from validation.campaign.bench import LayeredBench
from validation.campaign.case import Case
from validation.derivation import kernel as kernel_fit
from validation.derivation.kernel import cover_cells
from validation.regression.baseline import compare, make_baseline
from validation.regression.quantities import EXPERIMENTS, measure
from validation.regression.reading import Subject
from validation.sensor_file import load

# A warning of the sensors under test would reach the user of `softcover regress`, who can do nothing about it.
pytestmark = pytest.mark.filterwarnings("error::fastmodel.OptionWarning")

#: Groups that need no finite elements.
WITHOUT_ELEMENTS = [
    pytest.param(name, marks=[pytest.mark.slow] * (name in ("calibration", "in time", "touches")))
    for name in EXPERIMENTS
    if name not in WITH_ELEMENTS
]
BALL = Case.read("ball", "sphere:radius=5mm", "300 g", at="0.7mm,-1.1mm")


@pytest.fixture(scope="module", autouse=True)
def few_cases():
    """Take every fourth case of the default campaign."""
    with take_every(4):
        yield


def healthy_parameters():
    return replace(fastmodel.load("wts-0614-34"), filter=Butterworth(cutoff_hz=30.0, order=2))


def measured(parameters, groups):
    subject = Subject(parameters=parameters)
    return measure(subject, groups={group: EXPERIMENTS[group] for group in groups}, progress=lambda _: None)


@functools.cache
def healthy(group):
    return measure_groups(healthy_parameters(), [group])


def find_changes(parameters, *groups):
    changes = {}
    for group in groups:
        readings, failures = measured(parameters, [group])
        changes |= {
            each.quantity: each for each in compare(healthy(group), make_baseline("sensor", readings), failures)
        }
    return changes


@pytest.mark.parametrize(
    "name", [*REQUIRED, *(pytest.param(name, marks=pytest.mark.slow) for name in (*NEIGHBOURS, *IN_TIME))]
)
def test_the_check_is_red_and_names_the_quantity(name, monkeypatch):
    plant, title = (REQUIRED | NEIGHBOURS | IN_TIME)[name]
    group = title.split(":")[0]
    healthy(group)
    parameters = plant(monkeypatch, healthy_parameters())
    assert title in find_changes(parameters, group)


@pytest.mark.slow
def test_a_step_response_that_is_too_fast_changes_the_fitted_filter_alone(monkeypatch):
    healthy("in time")
    whole = step_response.respond
    monkeypatch.setattr(step_response, "respond", lambda order, phase, *rates: whole(order, 1.02 * phase, *rates))
    assert set(find_changes(healthy_parameters(), "in time")) == {"in time: filter of a step"}


@pytest.mark.parametrize("group", WITHOUT_ELEMENTS)
def test_unchanged_is_green(group):
    assert find_changes(healthy_parameters(), group) == {}


def measured_reference(derivation, groups):
    return measure_groups(derivation.parameters, groups, derivation)


@pytest.mark.parametrize(
    "factor", [pytest.param(1.03, marks=pytest.mark.slow), pytest.param(0.97, marks=pytest.mark.slow)]
)
def test_a_fit_that_gives_another_sigma_is_named(wts_derivation, factor, monkeypatch):
    before = measured_reference(wts_derivation, ["kernel"])
    healthy_fit = kernel_fit.fit_gaussian

    def fit_gaussian(*args, **options):
        fit = healthy_fit(*args, **options)
        gaussian = replace(fit.gaussian, sigma_x=factor * fit.gaussian.sigma_x, sigma_y=factor * fit.gaussian.sigma_y)
        return replace(fit, gaussian=gaussian)

    monkeypatch.setattr(kernel_fit, "fit_gaussian", fit_gaussian)
    fit = kernel_fit.fit_kernel(wts_derivation.influence, wts_derivation.sensor.array)
    after = measured_reference(replace(wts_derivation, fit=fit), ["kernel"])
    assert [each.quantity for each in compare(before, after, {})] == ["kernel: sigma"]


def test_shipped_parameters_that_are_not_those_derived_are_named(wts_derivation, monkeypatch):
    before = measured_reference(wts_derivation, ["shipped parameters"])
    shipped = fastmodel.load("wts-0614-34")
    other = replace(shipped, spread=replace(shipped.spread, sigma_x=1.03 * shipped.spread.sigma_x))
    monkeypatch.setattr(fastmodel, "load", lambda _: other)
    after = measured_reference(wts_derivation, ["shipped parameters"])
    (change,) = compare(before, after, {})
    assert (change.quantity, change.label) == ("shipped parameters: difference", "spread")


@pytest.mark.slow
def test_accuracy_is_that_of_the_derived_parameters_on_the_cover_of_the_sensor(wts_derivation, monkeypatch):
    cover, parameters = wts_derivation.sensor.cover, wts_derivation.parameters
    default = evaluation.read_plan(None, wts_derivation.sensor)
    monkeypatch.setattr(evaluation, "read_plan", lambda *_: replace(default, cases=(BALL,)))
    heard = []
    subject = Subject(parameters=parameters, derivation=wts_derivation, progress=lambda *words: heard.append(words))
    groups = {group: EXPERIMENTS[group] for group in ("reference", "accuracy")}
    readings, failures = measure(subject, groups=groups, progress=lambda _: None)
    assert not failures
    expected = LayeredBench(cover=cover, parameters=parameters).solve(BALL)
    assert readings["reference: load"].numbers == {"ball": pytest.approx((BALL.load,))}
    assert readings["reference: depth"].numbers == {"ball": pytest.approx((1e3 * expected.reference.depth,), rel=1e-5)}
    misplaced = expected.predictions["fast"].score.misplaced_force
    assert readings["accuracy: misplaced force"].numbers == {"ball": pytest.approx((100 * misplaced,), rel=1e-5)}
    assert heard[0][:2] == (0, 1)


@pytest.fixture(scope="module")
def campaign(wts_derivation):
    return measured_reference(wts_derivation, ["reference", "accuracy"])


@pytest.mark.slow
@pytest.mark.parametrize("name", REFERENCE)
def test_changes_of_the_reference_and_of_accuracy_are_named(name, wts_derivation, campaign, monkeypatch):
    plant, titles = REFERENCE[name]
    plant(monkeypatch, wts_derivation.parameters)
    after = measured_reference(wts_derivation, ["reference", "accuracy"])
    assert titles <= {each.quantity for each in compare(campaign, after, {})}


@pytest.mark.slow
def test_another_cover_moves_the_accuracy(wts_derivation, campaign):
    sensor = load("wts-0614-34", thickness="1.8mm")
    cells = cover_cells(sensor.cover, sensor.array, point_spread(sensor.cover))
    spoilt = replace(wts_derivation, parameters=replace(wts_derivation.parameters, surface=cells))
    changes = compare(campaign, measured_reference(spoilt, ["reference", "accuracy"]), {})
    assert "accuracy: misplaced force" in {each.quantity for each in changes}
    assert not any(each.quantity.startswith("reference") for each in changes)


@pytest.mark.slow
@pytest.mark.parametrize("name", FRICTION)
def test_changes_of_friction_are_named(name, wts_derivation, monkeypatch, tmp_path):
    before = measured_reference(wts_derivation, ["friction"])
    plant, titles = FRICTION[name]
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))  # The store tells codes apart by their files.
    plant(monkeypatch, wts_derivation.parameters)
    assert titles <= {each.quantity for each in compare(before, measured_reference(wts_derivation, ["friction"]), {})}


@pytest.mark.slow
def test_changes_of_relaxation_are_named(wts_derivation, monkeypatch):
    """A cover of two Prony terms; sensors that do not relax have no such quantities."""
    assert EXPERIMENTS["relaxing cover"](Subject(parameters=None, derivation=wts_derivation)) == {}
    (layer,) = wts_derivation.sensor.cover.layers
    material = replace(make_rubber(model="linear-elastic"), relaxation=Relaxation(g=(0.3, 0.2), tau=(0.5, 10.0)))
    cover = replace(wts_derivation.sensor.cover, layers=(replace(layer, material=material),))
    derivation = replace(wts_derivation, sensor=replace(wts_derivation.sensor, cover=cover))
    before = measured_reference(derivation, ["relaxing cover"])
    assert compare(before, measured_reference(derivation, ["relaxing cover"]), {}) == []
    for plant, titles in RELAXING.values():
        with monkeypatch.context() as patch:
            plant(patch, None)
            after = measured_reference(derivation, ["relaxing cover"])
        assert {each.quantity for each in compare(before, after, {})} == {f"relaxing cover: {each}" for each in titles}
