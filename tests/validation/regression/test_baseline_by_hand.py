"""Baselines, changes and verdicts of the regression check against values that are computed by hand."""

import functools
import json
import math
from dataclasses import replace
from importlib.metadata import version
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import pytest

import fastmodel
from validation.errors import InputError
from validation.regression import baseline as module
from validation.regression.baseline import (
    PACKAGES,
    Baseline,
    Change,
    Regression,
    check_sensor,
    compare,
    make_baseline,
    measure_changes,
    merge,
    read_baseline,
    write_junit,
)
from validation.regression.quantities import EXPERIMENTS, measure
from validation.regression.reading import Reading, describe_sensor, read
from validation.sensor_file import BUILT_IN

PARAMETERS = fastmodel.load("wts-0614-34")
TITLE = describe_sensor("wts-0614-34", PARAMETERS.array, derived=False)


class Heard(SimpleNamespace):
    """Displays progress by a list."""

    def __call__(self, stage):
        self.stages.append(stage)

    def step(self, done, total, name):
        self.stages.append((done, total, name))


def make(readings, sensor="pad", versions=None):
    return Baseline(sensor=sensor, versions=versions or {}, readings=readings)


def number(value, tolerance=0.25, unit="N", *, relative=False):
    return Reading(unit=unit, tolerance=tolerance, relative=relative, numbers={"": (value,)})


@pytest.mark.parametrize(
    ("before", "now", "tolerance", "ratio"),
    [
        (3.0, 4.5, 0.5, 3.0), (4.5, 3.0, 0.5, 3.0), (0.0, 5e-9, 0.0, 5.0), (0.0, 5e-9, 2e-9, 2.5),
        (-1.0, 1.0, 4.0, 0.5), (None, 1.0, 1.0, math.inf), (1.0, None, 1.0, math.inf), (None, None, 1.0, math.inf),
    ],
)  # fmt: skip
def test_a_change_is_told_in_tolerances_of_at_least_a_billionth(before, now, tolerance, ratio):
    assert Change(quantity="a: b", before=before, now=now, tolerance=tolerance).ratio == pytest.approx(ratio)


def test_a_change_without_numbers_has_no_text_label_or_tolerance():
    change = Change(quantity="a: b")
    assert (change.text, change.label, change.before, change.now, change.unit, change.tolerance) == (
        "", "", None, None, "", 0.0,
    )  # fmt: skip


def test_a_baseline_is_written_with_the_versions_that_are_installed():
    found = make_baseline("pad", {"a: x": number(1.0)})
    assert PACKAGES == ("softcover", "mujoco", "numba", "numpy", "scipy")
    assert found.versions == {name: version(name) for name in PACKAGES}


def test_a_baseline_as_json_has_sorted_names_ten_digits_and_shares_in_percent():
    readings = {
        "b: rows": Reading(unit="mm", tolerance=0.0123, relative=True, numbers={"u": (1.0, 2.0), "v": (3.0,)}),
        "a: one": number(1 / 3, tolerance=0.125),
        "c: named": Reading(unit="N", tolerance=0.5, relative=False, numbers={"w": (7.0,)}),
    }
    found = make(readings, versions={"z": "2", "y": "1"}).as_json()
    assert list(found) == ["sensor", "versions", "quantities"]
    assert found["sensor"] == "pad"
    assert list(found["versions"].items()) == [("y", "1"), ("z", "2")]
    assert list(found["quantities"].items()) == [
        ("a: one", {"unit": "N", "tolerance": 0.125, "value": 0.3333333333}),
        ("b: rows", {"unit": "mm", "tolerance": "1.23 % of value", "value": {"u": [1.0, 2.0], "v": 3.0}}),
        ("c: named", {"unit": "N", "tolerance": 0.5, "value": {"w": 7.0}}),
    ]


def test_tolerances_of_a_file_are_numbers_or_percentages(tmp_path):
    entries = {
        "a: x": {"unit": "N", "tolerance": 0.75, "value": 4.0},
        "a: y": {"unit": "N", "tolerance": "2.5 % of value", "value": {"p": 4.0, "q": [1.0, 2.0]}},
    }
    path = tmp_path / "baseline.json"
    path.write_text(json.dumps({"format": 2, "sensor": "pad", "versions": {"numpy": "1"}, "quantities": entries}))
    found = read_baseline(path, "pad")
    assert (found.sensor, found.versions) == ("pad", {"numpy": "1"})
    x, y = found.readings["a: x"], found.readings["a: y"]
    assert (x.tolerance, x.relative, x.numbers, x.unit) == (0.75, False, {"": (4.0,)}, "N")
    assert (y.tolerance, y.relative) == (pytest.approx(0.025), True)
    assert {label: tuple(row) for label, row in y.numbers.items()} == {"p": (4.0,), "q": (1.0, 2.0)}


def test_the_advice_stands_behind_the_last_fault_of_a_file(tmp_path):
    path, entry = tmp_path / "b.json", {"unit": "N", "tolerance": 0, "value": "much"}
    path.write_text(json.dumps({"format": 2, "sensor": "pad", "versions": {}, "quantities": {"a: x": entry}}))
    with pytest.raises(InputError) as refused:
        read_baseline(path, "pad")
    first, last = refused.value.faults
    advice = f"remove it and write it anew: softcover regress SENSOR --baseline {path} --update"
    assert (first.count(advice), last.count(advice)) == (0, 1)
    assert first.startswith("--baseline: ")
    assert last.startswith("--baseline: ")


def test_all_quantities_that_are_not_finite_are_refused_at_once(tmp_path):
    rows = Reading(unit="N", tolerance=0.1, relative=False, numbers={"u": (1.0, 2.0), "v": (3.0, math.inf)})
    with pytest.raises(InputError) as refused:
        make({"a: x": number(math.nan), "a: y": number(1.0), "a: z": rows}).write(tmp_path / "b.json")
    assert [fault.split(": ", 2)[2] for fault in refused.value.faults] == [
        "a: x is not a finite number", "a: z is not a finite number",
    ]  # fmt: skip
    assert all(f"--baseline: {tmp_path / 'b.json'} is not written" in fault for fault in refused.value.faults)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("before", "now", "words"),
    [
        (number(2.0), number(2.25), None), (number(2.0), number(1.75), None),
        (number(2.0), number(2.5), "rose from 2 to 2.5 N (+25 %), tolerance 0.25 N"),
        (number(-2.0), number(-2.5), "fell from -2 to -2.5 N (-25 %), tolerance 0.25 N"),
        (number(-2.0), number(-1.0), "rose from -2 to -1 N (+50 %), tolerance 0.25 N"),
        (number(0.0), number(-3.0), "fell from 0 to -3 N, tolerance 0.25 N"),
        (number(8.0, 0.125, relative=True), number(9.0), None),
        (number(-8.0, 0.125, relative=True), number(-9.0), None),
        (number(8.0, 0.125, relative=True), number(9.5), "rose from 8 to 9.5 N (+18.8 %), tolerance 12.5 % of value"),
        (number(4.0, 0.5, "-"), number(5.0, 0.5, "-"), "rose from 4 to 5 (+25 %), tolerance 0.5"),
        (number(4.0, 0.5, "-"), number(math.inf, 0.5, "-"), "is not a finite number any more; it was 4"),
        (number(4.0), number(4.0, unit="mN"),
         "has another form: 1 x 1 numbers [N] in the baseline, now 1 x 1 numbers [mN]"),
    ],
)  # fmt: skip
def test_one_number_changes_beyond_its_tolerance_and_not_at_it(before, now, words):
    found = compare(make({"a: x": before}), make({"a: x": now}), {})
    assert [each.text for each in found] == ([] if words is None else [words])


def test_a_change_holds_the_number_that_changed_most_of_all():
    rows = {"row 0": (1.0, 10.0), "row 1": (2.0, 20.0), "one": (3.0,)}
    stored = Reading(unit="mN", tolerance=0.5, relative=False, numbers=rows)
    now = replace(stored, numbers={"row 0": (1.6, 10.0), "row 1": (2.0, 17.0), "one": (4.0,)})
    (change,) = compare(make({"a: x": stored}), make({"a: x": now}), {})
    assert change == Change(
        quantity="a: x", label="row 1, column 1", before=20.0, now=17.0, unit="mN", tolerance=0.5,
        text="3 of 5 numbers changed, most: row 1, column 1 fell from 20 to 17 mN (-15 %), tolerance 0.5 mN",
    )  # fmt: skip
    assert measure_changes(make({"a: x": stored}), make({"a: x": now})) == {"a: x": pytest.approx(6.0)}
    alone = replace(now, numbers={**rows, "one": (3.75,)})
    (change,) = compare(make({"a: x": stored}), make({"a: x": alone}), {})
    assert (change.label, change.before, change.now) == ("one", 3.0, 3.75)


def test_another_form_is_told_by_its_counts_lengths_unit_and_first_labels():
    stored = Reading(unit="N", tolerance=0.5, relative=False, numbers=dict.fromkeys("pqrs", (1.0, 2.0)))
    now = replace(stored, unit="mN", numbers={"p": (1.0,), "q": (1.0, 2.0, 3.0)})
    (change,) = compare(make({"a: x": stored}), make({"a: x": now}), {})
    assert change.text == (
        "has another form: 4 x 2 numbers [N] (p, q, r ...) in the baseline, now 2 x 1 to 3 numbers [mN] (p, q ...)"
    )
    assert (change.unit, change.ratio) == ("mN", math.inf)
    (change,) = compare(make({"a: x": stored}), make({"a: x": replace(stored, numbers={})}), {})
    assert change.text.endswith("now 0 x 0 numbers [N]")


def test_a_quantity_on_one_side_or_of_another_form_changes_without_end():
    stored = make({"a: x": number(1.0), "a: gone": number(2.0), "b: form": number(3.0)})
    empty = Reading(unit="N", tolerance=0.5, relative=False, numbers={})
    now = make({"a: x": number(1.5), "b: form": number(3.0, unit="mN"), "b: new": number(4.0)})
    assert measure_changes(stored, now) == {
        "a: x": pytest.approx(2.0), "a: gone": math.inf, "b: form": math.inf, "b: new": math.inf,
    }  # fmt: skip
    assert measure_changes(make({"a: x": empty}), make({"a: x": empty})) == {"a: x": 0.0}
    texts = {each.quantity: each.text for each in compare(stored, now, {"b": "no contact"})}
    assert texts["a: gone"] == "could not be measured: it does not apply to this sensor any more"
    assert texts["b: new"] == "is not in the baseline"
    assert compare(make({"b: y: z": number(1.0)}), make({}), {"b": "broken"})[0].text.endswith(": broken")


def test_an_update_takes_new_versions_and_the_whole_reading_where_the_unit_changed():
    stored = make({"a: x": number(1.0, 0.125), "a: y": number(1.0), "a: z": number(1.0, 0.1, relative=True)})
    now = make({"a: x": number(5.0, 0.5, "mN"), "a: y": number(1.1), "a: z": number(2.0, 0.5)}, versions={"numpy": "3"})
    merged = merge(stored, now, compare(stored, now, {}))
    assert merged.readings == {
        "a: x": number(5.0, 0.5, "mN"), "a: y": number(1.0), "a: z": number(2.0, 0.1, relative=True),
    }  # fmt: skip
    assert merged.versions == {"numpy": "3"}
    assert merge(None, now, ()) is now


def test_a_check_tells_changes_ratios_and_other_versions():
    stored = make({"a: x": number(1.0), "a: y": number(2.0)}, versions={"numpy": "1", "scipy": "4"})
    now = make({"a: x": number(1.75), "a: y": number(2.0)}, versions={"numpy": "1", "scipy": "5", "numba": "7"})
    found = Regression(now=now, stored=stored, failures={}, seconds=3.5)
    assert [each.quantity for each in found.changes] == ["a: x"]
    assert found.ratios == {"a: x": pytest.approx(3.0), "a: y": 0.0}
    assert found.other_versions == ["scipy 4 -> 5", "numba none -> 7"]
    written = found.as_json()
    assert (written["changed"], written["sensor"], set(written["quantities"])) == (1, "pad", {"a: x", "a: y"})
    (change,) = written["changes"]
    assert (change["quantity"], change["before"], change["now"], change["unit"]) == ("a: x", 1.0, 1.75, "N")
    assert found.to_csv().splitlines() == ["quantity,change_over_tolerance", "a: x,3", "a: y,0"]
    first = replace(found, stored=None)
    assert (first.changes, first.ratios, first.other_versions) == (
        (), {}, ["numpy none -> 1", "scipy none -> 5", "numba none -> 7"],
    )  # fmt: skip


def test_the_verdict_as_junit_has_a_case_for_each_quantity(tmp_path):
    changes = [
        Change(quantity="b: two: parts", text="rose\x00 far"), Change(quantity="gone: x", text="could not be measured"),
    ]  # fmt: skip
    path = tmp_path / "new" / "junit.xml"
    write_junit(path, "pad\x07", ["whole", "b: two: parts", "a: x"], changes, seconds=12.345)
    root = ET.parse(path).getroot()  # noqa: S314 -- ours
    (suite,) = root
    counts = {"tests": "4", "failures": "2", "errors": "0", "time": "12.3"}
    assert (root.tag, root.attrib, suite.tag) == ("testsuites", counts, "testsuite")
    assert suite.attrib == {"name": "softcover regress, pad?", **counts}
    assert [(each.get("classname"), each.get("name"), len(each)) for each in suite] == [
        ("a", "x", 0), ("b", "two: parts", 1), ("gone", "x", 1), ("whole", "whole", 0),
    ]  # fmt: skip
    first, second = root.iter("failure")
    assert first.attrib == {"type": "changed", "message": "b: two: parts: rose? far"}
    assert first.text == first.get("message")
    assert second.get("message") == "gone: x: could not be measured"


@pytest.fixture
def two_groups(monkeypatch):
    """Check two quick groups of quantities instead of all."""
    groups = {name: EXPERIMENTS[name] for name in ("spread", "pooling")}
    monkeypatch.setattr(module, "measure", functools.partial(measure, groups=groups))


def test_a_check_of_parameters_writes_compares_and_updates_a_baseline(two_groups, tmp_path):
    path, heard = tmp_path / "baseline.json", Heard(stages=[])
    with pytest.raises(InputError, match="no such file"):
        check_sensor(PARAMETERS, path, progress=heard)
    assert heard.stages == []  # before the computation
    first = check_sensor(PARAMETERS, path, update=True, progress=heard)
    assert heard.stages == ["spread", "pooling"]
    assert (first.stored, first.failures, first.changes) == (None, {}, ())
    assert 0 < first.seconds < 60
    assert first.now.sensor == TITLE
    written = path.read_bytes()
    moved = replace(PARAMETERS, spread=replace(PARAMETERS.spread, sigma_x=1.1 * PARAMETERS.spread.sigma_x))
    second = check_sensor(moved, path, progress=heard)
    assert path.read_bytes() == written
    assert [each.quantity for each in second.changes] == ["spread: share", "spread: share outside"]
    third = check_sensor(moved, path, update=True, progress=heard)
    assert third.changes == second.changes
    after = read_baseline(path, TITLE)
    assert compare(after, second.now, {}) == []
    assert after.readings["pooling: mean"] == first.now.readings["pooling: mean"]


def test_a_check_of_a_sensor_measures_its_derivation(monkeypatch, tmp_path):
    from validation.derivation import derive as derivation

    sensor, asked = BUILT_IN["wts-0614-34"], []
    derived = SimpleNamespace(parameters=PARAMETERS)
    monkeypatch.setattr(derivation, "derive", lambda *given, **options: asked.append((given, options)) or derived)

    def experiment(subject):
        asked.append((subject.parameters, subject.derivation, subject.seed))
        subject.progress(1, 2, "case")
        return {"rate": read(subject.parameters.electronics.rate_hz, "Hz", 0.5)}

    def refuse(_):
        raise ValueError("no contact")

    groups = {"made up": experiment, "refused": refuse}
    monkeypatch.setattr(module, "measure", functools.partial(measure, groups=groups))
    heard = Heard(stages=[])
    found = check_sensor(sensor, tmp_path / "b.json", update=True, seed=7, progress=heard)
    assert asked == [((sensor,), {"progress": heard}), (PARAMETERS, derived, 7)]
    assert heard.stages == ["made up", (1, 2, "case"), "refused"]
    assert found.now.sensor == describe_sensor("wts-0614-34", sensor.array, derived=True)
    assert found.now.readings["made up: rate"].numbers == {"": (PARAMETERS.electronics.rate_hz,)}
    assert found.failures == {"refused": "no contact"}
    assert check_sensor(sensor, tmp_path / "b.json", progress=heard).changes == ()
    assert asked[-1][2] == 0
