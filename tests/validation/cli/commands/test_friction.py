"""Friction reaches the finite elements from the command line and from sensor files."""

import dataclasses
import math
from pathlib import Path

import pytest

from fem_reference import ConvergenceError
from fem_reference.indentation import press
from validation.campaign import evaluation
from validation.campaign.case import Case
from validation.errors import InputError
from validation.sensor_file import load

BALL = ("--indenter", "sphere:radius=5mm", "--model", "fem")


@pytest.fixture
def coefficients(monkeypatch):
    """Coefficients of friction with which finite elements are asked for; none is computed."""
    asked = []

    def refuse(*_, friction=0.0, **__):
        asked.append(friction)
        raise ConvergenceError("not computed here")

    monkeypatch.setattr(press, "press", refuse)
    monkeypatch.setattr(press, "press_path", refuse)
    monkeypatch.setattr("fem_reference.press_path", refuse)
    return asked


@pytest.mark.parametrize(("text", "value"), [("0.3", 0.3), ("no-slip", math.inf), ("0", 0.0)])
@pytest.mark.parametrize(
    "target", [("--load", "2N"), ("--depth", "0.1mm"), ("--load", "2N", "--curve", "4", "--out", "x")]
)
def test_the_option_reaches_the_solver(softcover, coefficients, text, value, target):
    status, _, err = softcover("press", "wts-0614-34", *BALL, *target, "--friction", text)
    assert (status, set(coefficients)) == (4, {value}), err


def test_the_sensor_file_reaches_the_solver(softcover, coefficients):
    softcover("init")
    file = Path("sensor.toml")
    file.write_text(file.read_text() + "\n[contact]\nfriction = 0.4\n")
    softcover("press", file, *BALL, "--load", "2N")
    assert coefficients == [0.4]


def test_the_sensor_file_reaches_every_case_of_a_report(coefficients, wts_derivation, monkeypatch):
    """The comparison models are left out: they press before the cases do."""
    monkeypatch.setattr(evaluation, "derive", lambda *_, **__: wts_derivation)
    monkeypatch.setattr(evaluation, "prepare_models", lambda *_, **__: None)
    sensor = dataclasses.replace(load("wts-0614-34"), friction=0.6)
    with pytest.raises(InputError, match="not computed here"):
        evaluation.evaluate(sensor, cases=[Case.read(name, "sphere:radius=5mm", "2N") for name in ("one", "two")])
    assert len(coefficients) == 4  # what is stored is looked up for the plan, then each case is computed
    assert set(coefficients) == {0.6}
