"""The fit of published models: its start, scan, limits and ties, and which presses it takes, with made-up scores."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fem_reference.indentation.press as pressing
from fem_reference import ConvergenceError
from meshes import TexelArray
from validation.campaign.case import Case
from validation.published import models
from validation.published.model import Model, Parameter, foundation_stiffness
from validation.published.models import Row, fit_model, list_errors, make_rows, measure_error, place_on, prepare_models
from validation.published.rules import PUBLISHED
from validation.published.scene import Forces


def make_model(**parameters):
    return Model(
        name="made-up", title="Made up 1999", contact="points", rule="a cone", certainty="code",
        predict=lambda scene, **values: scene.answer(**values), parameters=parameters,
    )  # fmt: skip


ONE = make_model(a=Parameter(shipped=2.0, unit="m", fitted=True), b=Parameter(shipped=7.0))
TWO = make_model(a=Parameter(shipped=2.0, fitted=True), c=Parameter(shipped=0.5, start=4.0, fitted=True))


def record(monkeypatch, score):
    """Replace the score of parameters by a function of them; returns what was asked."""
    asked = []

    def measure(model, values, presses):
        asked.append(dict(values))
        return score(**values)

    monkeypatch.setattr(models, "measure_error", measure)
    return asked


@pytest.mark.parametrize(("model", "count", "start"), [(ONE, 16, {"a": 2.0}), (TWO, 32, {"a": 2.0, "c": 4.0})])
def test_a_fit_scans_three_in_the_logarithm_around_its_start_by_a_power_of_two_of_points(
    monkeypatch, model, count, start
):
    asked = record(monkeypatch, lambda **values: 1 + sum(abs(math.log(value / 1e3)) for value in values.values()))
    fit_model(model, None, [])
    first, scan = asked[0], asked[1 : count + 1]
    assert {name: first[name] for name in start} == {name: pytest.approx(value) for name, value in start.items()}
    for name, value in start.items():
        logs = sorted(math.log(each[name] / value) for each in scan)
        # Points of Sobol, one in each equal part of the range.
        assert -3 <= logs[0] < -3 + 6 / count
        assert 3 - 6 / count <= logs[-1] < 3
        assert np.diff(logs).max() <= 12 / count
    best = min([first, *scan], key=lambda values: sum(abs(math.log(value / 1e3)) for value in values.values()))
    simplex = asked[count + 1 : count + 2 + len(start)]
    assert simplex[0] == pytest.approx(best)
    for number, name in enumerate(start):
        expected = {**best, name: best[name] * math.exp(0.1)}
        assert simplex[1 + number] == pytest.approx(expected)
    assert all(each.get("b", 7.0) == 7.0 for each in asked)


@pytest.mark.parametrize(("model", "count"), [(ONE, 17), (TWO, 33)])
def test_a_fit_that_does_not_settle_ends_after_fifty_scores_per_parameter(monkeypatch, model, count):
    random = np.random.default_rng(0)
    asked = record(monkeypatch, lambda **_: 1 + random.random())
    fit_model(model, None, [])
    parameters = len(model.fitted)
    # Behind scan and search come the score of the result, those of ties, and those of fitted and shipped values.
    assert count + 50 * parameters <= len(asked) <= count + 50 * parameters + 3 + 12 * parameters


def test_a_fit_finds_the_least_score_to_a_ten_thousandth(monkeypatch):
    record(monkeypatch, lambda a, b: 0.1 + math.log(a / 5.3) ** 2 + 0 * b)
    values, error = fit_model(ONE, None, [])
    assert values == {"a": pytest.approx(5.3, rel=2e-3), "b": 7.0}
    assert error == pytest.approx(0.1, abs=1e-5)
    record(monkeypatch, lambda a, c: 0.1 + math.log(a / 11) ** 2 + math.log(c / 0.4) ** 2 / 4)
    values, error = fit_model(TWO, None, [])
    assert values == {"a": pytest.approx(11, rel=3e-3), "c": pytest.approx(0.4, rel=5e-3)}


@pytest.mark.parametrize(("excess", "shipped"), [(0.0, True), (0.9e-6, True), (1.2e-6, False)])
def test_values_as_shipped_are_kept_where_a_fit_is_no_better(monkeypatch, excess, shipped):
    record(monkeypatch, lambda a, b: (1 + excess if a == 2.0 else 1.0) + 0 * b)
    values, error = fit_model(ONE, None, [])
    assert (values == {"a": 2.0, "b": 7.0}) == shipped
    assert error == (1 + excess if shipped else 1.0)


@pytest.mark.parametrize(("rise", "moved"), [(0.9e-6, True), (1.1e-6, False)])
def test_scores_within_a_millionth_are_equal(monkeypatch, rise, moved):
    """The score falls by one step at 5 times the start, and below 10 times it rises by a small one."""
    record(monkeypatch, lambda a, b: (1.0 if a > 10 else 2.0) + (rise if a < 20 else 0.0) + 0 * b)
    values, _ = fit_model(ONE, None, [])
    assert values["a"] == pytest.approx(10 if moved else 20, rel=0.011)


def test_the_smallest_of_a_range_of_equal_scores_is_no_farther_than_the_scan(monkeypatch):
    record(monkeypatch, lambda a, b: 1.0 if a != 2.0 else 3.0 + 0 * b)
    values, _ = fit_model(ONE, None, [])
    assert math.log(values["a"] / 2.0) == pytest.approx(-3, abs=0.011)
    assert math.log(values["a"] / 2.0) >= -3


@pytest.mark.parametrize(("ratio", "start"), [(0.5, 1e9), (0.3, None)])
def test_a_stiffness_starts_at_that_of_the_cover_or_at_one_of_rubber(monkeypatch, bonded, ratio, start):
    cover = bonded(ratio, thickness=3e-3)
    asked = record(monkeypatch, lambda **_: 1.0)
    model = make_model(stiffness=Parameter(unit="Pa/m", fitted=True))
    fit_model(model, cover, [])
    assert asked[0] == {"stiffness": pytest.approx(start or foundation_stiffness(cover))}
    own = make_model(stiffness=Parameter(shipped=55.0, fitted=True))
    asked.clear()
    fit_model(own, cover, [])
    assert asked[0] == {"stiffness": pytest.approx(55.0)}


def make_press(load, texels, outside, active=(True, True, True)):
    """A press whose model answers `a` times 1, 2 and 3 N on three texels, and 0.5 N outside."""
    scene = SimpleNamespace(
        load=load, case=SimpleNamespace(load=load), array=SimpleNamespace(active=np.array(active)),
        answer=lambda a, **_: Forces(a * np.array([1.0, 2.0, 3.0]), 0.5),
    )  # fmt: skip
    return SimpleNamespace(scene=scene, reference=SimpleNamespace(texel_forces=np.array(texels), outside=outside))


def test_the_error_of_a_press_is_half_of_all_differences_over_the_load():
    presses = [make_press(4.0, [2.0, 4.5, 5.0], 1.0), make_press(8.0, [3.0, 4.0, 6.0], 0.5)]
    assert list_errors(ONE, {"a": 2.0}, presses) == pytest.approx([(0.5 + 1 + 0.5) / 2 / 4, 1 / 2 / 8])
    assert measure_error(ONE, {"a": 2.0}, presses) == pytest.approx((0.25 + 0.0625) / 2)
    masked = make_press(4.0, [2.0, 0.0, 6.0], 4.5, active=(True, False, True))
    assert list_errors(ONE, {"a": 2.0}, [masked]) == [0.0]
    row = Row(model=ONE, parameters={"a": 2.0})
    assert row.predict(masked.scene).texels.tolist() == [2.0, 0.0, 6.0]
    assert row.predict(masked.scene).outside == 4.5


def test_rows_are_made_of_shipped_values_and_of_a_fit_to_at_least_two_presses(monkeypatch):
    presses = [make_press(4.0, [2.0, 4.0, 6.0], 0.5), make_press(8.0, [4.0, 8.0, 12.0], 0.5)]
    monkeypatch.setattr(models, "fit_model", lambda *given: ({"a": 9.0, "b": 7.0}, 0.25))
    shipped, fitted = make_rows(ONE, None, presses)
    assert (shipped.parameters, shipped.fitted, shipped.cases) == ({"a": 2.0, "b": 7.0}, (), ())
    assert shipped.error == pytest.approx(12 / 2 / 8 / 2)
    assert (fitted.parameters, fitted.error, fitted.fitted) == ({"a": 9.0, "b": 7.0}, 0.25, ("a",))
    assert fitted.cases == tuple(press.scene.case for press in presses)
    assert (shipped.name, fitted.name) == ("made-up, as shipped", "made-up, as fitted")
    assert [row.variant for row in make_rows(ONE, None, presses[:1])] == ["as shipped"]
    unknown = make_model(a=Parameter(start=1.0, fitted=True))
    assert make_rows(unknown, None, presses[:1]) == []
    assert [row.variant for row in make_rows(unknown, None, presses)] == ["as fitted"]
    fixed = make_model(a=Parameter(shipped=1.0))
    assert [row.variant for row in make_rows(fixed, None, presses)] == ["as shipped"]
    assert math.isnan(make_rows(fixed, None, [])[0].error)


def test_a_row_as_json_states_model_values_units_and_presses():
    cases = (Case.read("x", "sphere:radius=6mm", "2.5 N", at="1mm,2mm"),)
    row = Row(model=ONE, parameters={"a": 3.0, "b": 7.0}, fitted=("a",), cases=cases, error=0.125)
    assert row.as_json() == {
        "name": "made-up, as fitted", "title": "Made up 1999", "variant": "as fitted", "contact": "points",
        "rule": "a cone", "certainty": "code", "total": "the load", "not_built": "", "parameters": {"a": 3.0, "b": 7.0},
        "units": {"a": "m"}, "fitted": ["a"], "fitted_on": [f"sphere:radius=6mm, 2.5 N at {cases[0].place}"],
        "fit_misplaced_force": 0.125,
    }  # fmt: skip
    partly = replace(ONE, total="less", in_time="a filter")
    assert (Row(model=partly, parameters={}).as_json()["total"], partly.in_time) == ("less", "a filter")
    assert math.isnan(Row(model=ONE, parameters={}).error)


def test_starts_and_units_are_listed_where_they_are_stated():
    model = make_model(a=Parameter(shipped=1.0, unit="N"), c=Parameter(start=0.0, fitted=True), d=Parameter())
    assert (model.units, model.fitted, model.start) == ({"a": "N"}, ("c",), {"c": 0.0})
    assert (model.total, model.in_time, dict(model.terms)) == ("", "", {})
    assert model.find_shipped(None) is None
    assert make_model().find_shipped(None) == {}


def test_totals_that_are_not_the_load_are_said_in_words():
    assert {name: model.total for name, model in PUBLISHED.items() if model.total} == {
        "schunk": "less where texels saturate", "skinsim-2014": "amplitude times the sum of the kernel",
        "robworksim-later": "scaled to the load; the code divides by the number of loaded texels once more",
        "mujoco-tactile": "scaled to the load",
    }  # fmt: skip


def test_a_place_counts_in_pitches_from_the_middle_to_a_billionth():
    array = TexelArray.grid(3, 4, (2e-3, 5e-3))
    moved = replace(array, centres=np.add(array.centres, [1e-3 + 2e-10, -3e-3, 9.0]))
    assert place_on(moved, (0.5, -2.0)) == (pytest.approx(2e-3, abs=1e-14), pytest.approx(-13e-3, abs=1e-14))


@pytest.fixture
def prepare(monkeypatch, bonded, parameters):
    """Prepare models with made-up presses, bearing 1.5 N, whose costs, failures and rows are given; returns calls."""
    calls = SimpleNamespace(presses=[], lines=[], rows=[], cover=bonded(0.49))

    def run(costs, *, scenes=(), fails=(), **options):
        costs, fails = iter(costs), iter(fails)

        def press(cover, array, indenter, *, load, pose, friction, progress):
            calls.presses.append((load, pose.at, friction, progress))
            if error := next(fails, None):
                raise error
            return "reference"

        def rows(model, cover, presses):
            calls.rows.append((model.name, [each.scene for each in presses]))
            return [model.name]

        monkeypatch.setattr(models, "bear", lambda cover, indenter: 1.5)
        monkeypatch.setattr(models, "estimate_cost", lambda cover, case, friction: SimpleNamespace(seconds=next(costs)))
        monkeypatch.setattr(pressing, "press", press)
        monkeypatch.setattr(models, "make_scene", lambda cover, given, case, response: (case.shape, case.load))
        monkeypatch.setattr(models, "make_rows", rows)
        return prepare_models(calls.cover, parameters, scenes, **options)

    return calls, run


def test_presses_that_take_long_or_fail_are_left_out_and_loads_are_those_that_the_cover_bears(prepare):
    calls, run = prepare
    found = run([30.0, 30.01, 1.0], friction=0.4, progress=calls.lines.append)
    assert [each[0] for each in calls.presses] == [1.5, 1.0]
    assert {each[2] for each in calls.presses} == {0.4}
    assert all(each[3] == calls.lines.append for each in calls.presses)
    kept = [("sphere:radius=6mm", 1.5), ("sphere:radius=10mm", 1.0)]
    assert calls.rows == [(name, kept) for name in PUBLISHED]
    assert found.rows == tuple(PUBLISHED)
    assert calls.lines == [
        *(f"calibration, {body}, for the comparison models" for body in ("ball", "flat punch", "large ball")),
        *(f"fit of the comparison model {model.title}" for model in PUBLISHED.values()),
    ]


def test_presses_that_cannot_be_computed_are_left_out(prepare):
    calls, run = prepare
    run([1.0] * 3, fails=[ValueError("too deep"), ConvergenceError("no solution"), None])
    assert [each[2:] for each in calls.presses] == [(0.0, None)] * 3
    assert {tuple(scenes) for _, scenes in calls.rows} == {(("sphere:radius=10mm", 1.0),)}


def test_every_row_predicts_the_same_scene(monkeypatch):
    scene, asked = make_press(4.0, [2.0, 4.0, 6.0], 0.5).scene, []
    monkeypatch.setattr(models, "make_scene", lambda *given: asked.append(given) or scene)
    rows = [Row(model=ONE, parameters={"a": 2.0}), Row(model=ONE, parameters={"a": 3.0}, fitted=("a",))]
    found = models.ComparisonModels(rows=rows, response="response").predict("cover", "parameters", "case")
    assert asked == [("cover", "parameters", "case", "response")]
    assert found[0] is scene
    assert {name: forces.texels.tolist() for name, forces in found[1].items()} == {
        "made-up, as shipped": [2.0, 4.0, 6.0], "made-up, as fitted": [3.0, 6.0, 9.0],
    }  # fmt: skip
