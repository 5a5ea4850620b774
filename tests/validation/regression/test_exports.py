"""Readings of exported values: what is collected of which scores, and of which sensors there are none."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
from meshes import Cover
from tests.validation.published.test_simulator_values import SENSOR, make_scores
from validation.regression.exports import measure_values
from validation.regression.reading import Subject
from validation.simulator_values import scoring, targets

PARAMETERS = fastmodel.load("wts-0614-34")


@pytest.fixture
def asked(monkeypatch):
    """Made-up scores of each form, whose numbers depend on the form; returns what was asked."""
    asked = {"presses": [], "forms": []}

    def make_presses(cover, parameters, loads, progress):
        progress("unheard")
        asked["presses"].append((cover, parameters, loads))
        return "the presses"

    def score_target(form, sensor, parameters, *, loads, command, progress, presses):
        progress("unheard")
        asked["forms"].append((form, sensor, parameters, loads, command, presses))
        scores = make_scores(form, parameters)
        (row,) = scores.rows
        press = replace(row.presses[0], depth_ratio=0.5)
        first = replace(row, mean=0.01 * len(asked["forms"]), presses=(press, replace(press, depth_ratio=2.0)))
        second = replace(row, name="textbook", parameters={"modulus": 7.0})
        share = np.array([[0.5, 0.25, 0.125], [9.0, 9.0, 9.0]])
        return replace(scores, rows=(first, second), spread={"share": share})

    monkeypatch.setattr(scoring, "make_presses", make_presses)
    monkeypatch.setattr(targets, "score_target", score_target)
    return asked


def make_subject(**changes):
    sensor = replace(SENSOR, **changes)
    return Subject(parameters=PARAMETERS, derivation=SimpleNamespace(sensor=sensor))


def test_values_errors_depths_and_spread_of_four_forms_are_read_from_the_same_presses(asked):
    subject = make_subject()
    found = measure_values(subject)
    assert asked["presses"] == [(SENSOR.cover, PARAMETERS, None)]
    assert [each[0] for each in asked["forms"]] == ["drake", "genesis", "isaac", "lerobot"]
    assert {each[3:] for each in asked["forms"]} == {(None, "", "the presses")}
    assert all(each[1] is subject.derivation.sensor and each[2] is PARAMETERS for each in asked["forms"])
    assert set(found) == {"values", "misplaced force", "depth", "spread", "file for Drake"}
    values = found["values"].numbers
    assert values["drake, fitted, modulus"] == (3.2e6,)
    assert values["genesis, fitted, exponent"] == (1.25,)
    assert values["isaac, textbook, modulus"] == (7.0,)
    misplaced = found["misplaced force"].numbers
    assert misplaced["lerobot, fitted"] == pytest.approx((4.0, 4.56))  # percent
    assert misplaced["drake, textbook"] == pytest.approx((1.23, 4.56))
    assert found["depth"].numbers["drake, fitted"] == (0.5, 2.0)
    assert found["spread"].numbers == {"": (0.5, 0.25, 0.125)}
    assert any(1.6e6 in numbers for numbers in found["file for Drake"].numbers.values())
    assert (found["misplaced force"].unit, found["misplaced force"].tolerance) == ("%", 0.1)


@pytest.mark.parametrize("kind", ["parameters alone", "a curved cover", "side edges", "an irregular array"])
def test_sensors_whose_values_are_not_scored_have_no_readings(asked, kind):
    subject = make_subject()
    if kind == "parameters alone":
        subject = Subject(parameters=PARAMETERS)
    elif kind == "a curved cover":
        subject = make_subject(cover=SimpleNamespace(size=None))
    elif kind == "side edges":
        subject = make_subject(cover=Cover(layers=SENSOR.cover.layers, size=(0.03, 0.06)))
    else:
        centres = PARAMETERS.array.centres.copy()
        centres[0, 0] += 1e-3
        array = replace(PARAMETERS.array, centres=centres)
        subject = replace(subject, parameters=replace(PARAMETERS, array=array, surface=None, tables={}))
    assert measure_values(subject) == {}
    assert asked == {"presses": [], "forms": []}
