"""Baselines: their file, what is refused, comparison and update."""

import json
from dataclasses import replace

import pytest

from validation.errors import InputError
from validation.regression.baseline import Baseline, compare, make_baseline, measure_changes, merge, read_baseline
from validation.regression.reading import list_numbers, read

SENSOR = "some sensor"


def reading(value, tolerance=0.5, unit="N"):
    return read(value, unit, tolerance)


READINGS = {
    "a: number": reading(3.25),
    "a: each": reading({"light": 1.0, "heavy": 100.0}, "1 % of each"),
    "a: image": reading({"row 0": [0.0, 1.0], "row 1": [2.0, 4.0]}, "1 % of largest"),
    "a: zero": reading(0.0, "1 % of largest"),
}
STORED = make_baseline(SENSOR, READINGS)


def with_reading(title, value):
    return replace(STORED, readings={**READINGS, title: value})


def test_a_baseline_survives_its_file(tmp_path):
    STORED.write(tmp_path / "new" / "baseline.json")
    assert read_baseline(tmp_path / "new" / "baseline.json", SENSOR) == STORED


def test_the_file_has_a_line_for_each_number_and_row_in_order_of_titles(tmp_path):
    STORED.write(tmp_path / "baseline.json")
    lines = [line.strip(" ,") for line in (tmp_path / "baseline.json").read_text().splitlines()]
    titles = [line for line in lines if line.startswith('"a: ')]
    assert titles == [f'"a: {name}": {{' for name in ("each", "image", "number", "zero")]
    assert {'"light": 1.0', '"heavy": 100.0', '"row 0": [0.0, 1.0]', '"row 1": [2.0, 4.0]', '"value": 3.25'} <= set(
        lines
    )


@pytest.mark.parametrize(
    ("title", "within", "beyond", "words"),
    [
        ("a: number", reading(3.74), reading(3.76), "rose from 3.25 to 3.76 N (+15.7 %), tolerance 0.5 N"),
        (
            "a: each",
            reading({"light": 1.0099, "heavy": 99.01}, "1 % of each"),
            reading({"light": 1.0, "heavy": 98.9}, "1 % of each"),
            "1 of 2 numbers changed, most: heavy fell from 100 to 98.9 N (-1.1 %), tolerance 1 % of value",
        ),
        (
            "a: image",
            reading({"row 0": [0.039, 1.0], "row 1": [2.0, 3.97]}),
            reading({"row 0": [0.05, 1.0], "row 1": [2.1, 4.0]}),
            "2 of 4 numbers changed, most: row 1, column 0 rose from 2 to 2.1 N (+5 %), tolerance 0.04 N",
        ),
        ("a: zero", reading(0.0), reading(-1e-6, 1e-9), "fell from 0 to -1e-06 N, tolerance 1e-09 N"),
        ("a: number", reading(3.25), reading(float("nan")), "is not a finite number any more; it was 3.25 N"),
        ("a: number", reading(3.25), reading(3.25, unit="-"), "has another form"),
        ("a: image", READINGS["a: image"], reading({"row 0": [0.0, 1.0]}), "has another form"),
        ("a: each", READINGS["a: each"], reading({"light": 1.0}), "has another form"),
    ],
)
def test_changes_beyond_the_tolerance_are_told_in_words(title, within, beyond, words):
    assert compare(STORED, with_reading(title, within), {}) == []
    (change,) = compare(STORED, with_reading(title, beyond), {})
    assert change.quantity == title
    assert words in change.text


def test_what_only_one_side_has_is_a_change():
    fewer = replace(STORED, readings={title: each for title, each in READINGS.items() if title != "a: zero"})
    (gone,) = compare(STORED, fewer, {"a": "no contact"})
    assert gone.text == "could not be measured: no contact"
    (new,) = compare(fewer, STORED, {})
    assert new.text == "is not in the baseline"


def test_an_update_keeps_what_is_within_tolerance_and_every_tolerance_of_the_file():
    stored = replace(STORED, readings={**READINGS, "a: gone": reading(1.0), "a: wide": reading(1.0, 2.0)})
    now = replace(
        STORED, readings={**READINGS, "a: number": reading(3.3), "a: wide": reading(4.0), "a: new": reading(5.0)}
    )
    merged = merge(stored, now, compare(stored, now, {}))
    assert merged.readings == {**READINGS, "a: wide": reading(4.0, 2.0), "a: new": reading(5.0)}
    assert compare(merged, now, {}) == []


def test_a_number_that_is_not_finite_is_never_written(tmp_path):
    path = tmp_path / "baseline.json"
    STORED.write(path)
    before = path.read_bytes()
    with pytest.raises(InputError, match="a: number is not a finite number"):
        with_reading("a: number", reading(float("nan"))).write(path)
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["baseline.json"]


def spoil(change):
    data = {"format": 2, "versions": {}, **STORED.as_json()}
    change(data)
    return json.dumps(data)


ENTRY = {"unit": "N", "tolerance": 1, "value": 1}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not readable as JSON"),
        ("{}", "format: is missing; write for example format = 2"),
        ('{"format": 1}', "its format is 1"),
        (spoil(lambda data: data.pop("sensor")), "sensor: is missing"),
        (spoil(lambda data: data.update(quantities=[])), "quantities: must be a table"),
        (spoil(lambda data: data["quantities"].update(x={**ENTRY, "value": "much"})), "'much' is not a finite"),
        (spoil(lambda data: data["quantities"].update(x={**ENTRY, "value": {"row": [True]}})), "True is not a"),
        (spoil(lambda data: data["quantities"].update(x={**ENTRY, "tolerance": "nan % of value"})), "not a finite"),
        (spoil(lambda data: data["quantities"].update(x={**ENTRY, "tolerance": 0})), "tolerance: must be positive"),
        (spoil(lambda data: data["quantities"].update(x={**ENTRY, "value": 1 << 70})), "64 bits"),
        (spoil(lambda data: data.update(sensor="another")), "belongs to 'another', not to 'some sensor'"),
    ],
)
def test_a_bad_file_is_bad_input(tmp_path, text, words):
    path = tmp_path / "baseline.json"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_baseline(path, SENSOR)
    assert words in str(refused.value)
    assert all(fault.startswith("--baseline: ") for fault in refused.value.faults)
    assert "remove it and write it anew" in refused.value.faults[-1]


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="no such file; write one with --update"):
        read_baseline(tmp_path / "baseline.json", SENSOR)


def test_the_healthy_spoiled_file_is_read(tmp_path):
    path = tmp_path / "baseline.json"
    path.write_text(spoil(lambda data: data["quantities"].update(x=ENTRY)))
    assert isinstance(read_baseline(path, SENSOR), Baseline)


def test_one_number_that_is_not_finite_hides_no_other():
    tree = {"a": [1.0, float("nan"), 3.0], "b": {"c": 4, "name": "text"}, "d": float("inf"), "e": [[5.0, 6.0], [7.0]]}
    assert list_numbers(tree) == {"a, 0": [1.0], "a, 2": [3.0], "b, c": [4.0], "e, 0": [5.0, 6.0], "e, 1": [7.0]}


def test_changes_stand_in_the_order_in_which_they_follow_from_each_other():
    """The spread changes images, which change the data sheet; by name the cause would stand last."""
    titles = ["H: image", "data sheet: width", "kernel: sigma", "spread: share", "a new group: x"]
    before = make_baseline(SENSOR, {title: reading(1.0) for title in titles})
    after = make_baseline(SENSOR, {title: reading(2.0) for title in titles[:2] + titles[3:]})
    expected = ["kernel: sigma", "spread: share", "H: image", "data sheet: width", "a new group: x"]
    assert [each.quantity for each in compare(before, after, {"kernel": "refused"})] == expected
    assert list(measure_changes(before, after)) == expected
