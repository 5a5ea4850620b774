"""Readings of the regression check: units, tolerances, rounding and labels, against values computed by hand."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
from meshes import TexelArray
from validation.campaign import bench, evaluation, run
from validation.regression.quantities import measure
from validation.regression.reading import (
    Reading,
    Subject,
    describe_sensor,
    find_unit,
    list_numbers,
    list_rows,
    read,
)

PARAMETERS = fastmodel.load("wts-0614-34")


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("ms", 1e3), ("mm", 1e3), ("mN", 1e3), ("N mm", 1e3), ("mm2", 1e6), ("%", 100), ("% of load", 100),
        ("N/mm3", 1e-9), ("N", 1), ("counts", 1), ("-", 1), ("% of white", 1),
    ],
)  # fmt: skip
def test_a_value_in_si_units_is_read_in_the_unit_of_the_baseline(unit, factor):
    assert read(3.0, unit, 0.01 * factor).numbers == {"": (pytest.approx(3.0 * factor),)}
    assert read({"a": [1.0, 2.0], "b": 4}, unit, 1e-9 * factor).numbers == {
        "a": (pytest.approx(factor), pytest.approx(2 * factor)), "b": (pytest.approx(4 * factor),),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("value", "tolerance", "allowed", "relative"),
    [
        (3.0, 0.25, 0.25, False), (3.0, 2, 2, False), (3.0, "0.5 % of each", 0.005, True),
        ({"a": -0.3, "b": 0.2}, "1 % of largest", 3.0, False),
        ({"a": [0.1, -0.2], "b": 0.0}, "3 % of largest", 6.0, False),
        ({"a": math.nan, "b": 0.5, "c": math.inf}, "2 % of largest", 10.0, False),
        (0.12345, "1 % of largest", 1.2, False), (0.0, "1 % of largest", 1e-9, False),
        ({}, "1 % of largest", 1e-9, False), (1e-10, "4 % of largest", 4e-9, False),
        (2e-11, "4 % of largest", 1e-9, False),
    ],
)  # fmt: skip
def test_a_tolerance_is_a_number_a_share_of_each_or_two_digits_of_a_share_of_the_largest(
    value, tolerance, allowed, relative
):
    found = read(value, "mN", tolerance)
    assert (found.unit, found.relative) == ("mN", relative)
    assert found.tolerance == pytest.approx(allowed, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "tolerance", "found"),
    [
        (math.pi, 1.0, 3.142), (math.pi, 9.9, 3.142), (math.pi, 10.0, 3.14), (math.pi, 0.1, 3.1416),
        (math.pi, 0.05, 3.14159),
        (-math.pi, 0.1, -3.1416), (1234.5678, "1 % of each", 1234.57), (0.0012345678, "1 % of each", 0.00123457),
        (-1234.5678, "1 % of each", -1234.57), (0.0, "1 % of each", 0.0), (math.pi, 0, math.pi),
        (math.inf, 1.0, math.inf),
    ],
)  # fmt: skip
def test_a_number_is_rounded_to_a_thousandth_of_its_tolerance(value, tolerance, found):
    assert read(value, "N", tolerance).numbers == {"": (found,)}


def test_zero_has_no_sign_and_what_is_no_number_stays():
    (zero,) = read(-1e-9, "N", 1.0).numbers[""]
    assert math.copysign(1.0, zero) == 1.0
    assert math.isnan(read(math.nan, "N", "1 % of each").numbers[""][0])
    assert read(None, "N", 1.0) is None


def test_a_form_is_the_unit_and_the_lengths_of_the_rows():
    found = Reading(unit="mN", tolerance=1.0, relative=False, numbers={"a": (1.0,), "b": (1.0, 2.0, 3.0)})
    assert found.form == ("mN", {"a": 1, "b": 3})


@dataclass
class Part:
    """Numbers and words of a result."""

    x: float
    name: str
    rows: list


@pytest.mark.parametrize(
    ("tree", "found"),
    [
        (2, {"": [2.0]}), (2.5, {"": [2.5]}), ([1, 2.5], {"": [1.0, 2.5]}), ((3.0,), {"": [3.0]}), ("text", {}),
        (None, {}),
        (math.nan, {}), ([math.inf], {}), ([], {"": []}), (np.array(4.0), {"": [4.0]}),
        (np.array([[1.0, 2.0], [3.0, 4.0]]), {"0": [1.0, 2.0], "1": [3.0, 4.0]}),
        ({"a": {"b": [1.0]}, "c": "word"}, {"a, b": [1.0]}), ([1.0, "word", 3.0], {"0": [1.0], "2": [3.0]}),
        ([1.0, math.inf, 3.0], {"0": [1.0], "2": [3.0]}), ({"a": [2.0, None]}, {"a, 0": [2.0]}),
        (Part(1.5, "word", [[1.0], [2.0, 3.0]]), {"x": [1.5], "rows, 0": [1.0], "rows, 1": [2.0, 3.0]}),
        ({"p": Part(1.5, "word", [7])}, {"p, x": [1.5], "p, rows": [7.0]}), (Part, {}),
    ],
)  # fmt: skip
def test_numbers_of_a_tree_stand_under_their_places(tree, found):
    assert list_numbers(tree) == found


@pytest.mark.parametrize(
    ("metric", "unit"),
    [
        ("centre_of_pressure_m", "mm"), ("image_changed_percent", "% of white"), ("pixels_changed", "texels"),
        ("misplaced_force", "%"), ("m_share", "%"), ("total_image", "% of white"),
    ],
)  # fmt: skip
def test_the_unit_of_a_metric_follows_from_its_name(metric, unit):
    assert find_unit(metric) == unit


@pytest.mark.parametrize(
    ("count", "first", "last"), [(1, "row 0", "row 0"), (10, "row 0", "row 9"), (11, "row 00", "row 10")]
)
def test_rows_of_an_image_are_sorted_by_their_labels(count, first, last):
    rows = list_rows(np.arange(2 * count).reshape(count, 2))
    assert (next(iter(rows)), list(rows)[-1]) == (first, last)
    assert list(rows) == sorted(rows)
    assert rows[last] == [2 * count - 2, 2 * count - 1]


@pytest.mark.parametrize(("derived", "end"), [(True, "with finite elements"), (False, "without finite elements")])
def test_a_sensor_in_one_line_has_rows_columns_pitch_and_origin(derived, end):
    array = TexelArray.grid(7, 4, (2.5e-3, 3.125e-3))
    assert describe_sensor("pad", array, derived=derived) == f"pad: 7 rows x 4 columns, pitch 2.5 x 3.125 mm, {end}"


def test_parameters_alone_have_no_bench_comparison_or_campaign():
    subject = Subject(parameters=PARAMETERS)
    assert (subject.bench, subject.comparison, subject.campaign) == (None, None, None)
    assert (subject.seed, subject.progress) == (0, None)


@dataclass
class Derived:
    """A derivation: its sensor and the parameters."""

    sensor: SimpleNamespace
    parameters: object = PARAMETERS


@dataclass
class Pad:
    """A sensor with friction."""

    name: str
    friction: float


def test_bench_and_campaign_are_without_friction_and_the_comparison_has_the_derived_parameters(monkeypatch):
    asked, planned, ran = [], [], []
    monkeypatch.setattr(bench, "prepare_bench", lambda *given, **options: asked.append((given, options)) or len(asked))
    monkeypatch.setattr(
        evaluation, "read_plan", lambda *given: planned.append(given) or SimpleNamespace(cases=("one", "two"))
    )
    monkeypatch.setattr(run, "run_campaign", lambda *given, **options: ran.append((given, options)) or "scores")
    pad = Pad("pad", 0.7)
    subject = Subject(parameters=replace(PARAMETERS), derivation=Derived(pad), progress=print)
    assert (subject.bench, subject.comparison, subject.campaign) == (1, 2, "scores")
    without = Derived(Pad("pad", 0.0))
    assert asked == [((without, ()), {"parameters": subject.parameters}), ((without, ()), {"parameters": None})]
    assert asked[0][1]["parameters"] is subject.parameters
    assert planned == [(None, pad)]
    assert ran == [((1, ("one", "two")), {"progress": print})]
    assert subject.campaign == "scores"
    assert len(ran) == 1


def test_experiments_run_in_their_order_and_a_refusal_stops_none():
    heard, subject = [], Subject(parameters=PARAMETERS)

    def first(given):
        assert given is subject
        return {"depth_of_it_m": read(1.0, "mm", 0.5), "image_changed_percent": read(2.0, "%", 0.5), "none": None}

    def refuse(_):
        raise ValueError("no  contact\n at all")

    def last(_):
        return {"rate": read(3.0, "Hz", 0.5)}

    groups = {"b": first, "a": refuse, "c": last}
    readings, failures = measure(subject, groups=groups, progress=heard.append)
    assert heard == ["b", "a", "c"]
    assert failures == {"a": "no contact at all"}
    assert {title: each.numbers[""] for title, each in readings.items()} == {
        "b: depth of it": (1000.0,), "b: image changed": (200.0,), "c: rate": (3.0,),
    }  # fmt: skip
