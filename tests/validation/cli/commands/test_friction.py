"""Friction reaches the finite elements from the command line and from sensor files; the fast model says it has none."""

import json
import math
from types import SimpleNamespace

import pytest

from fem_reference import ConvergenceError
from fem_reference.indentation import press
from validation.campaign.case import Case
from validation.sensor_file import load

BALL = ("--indenter", "sphere:radius=5mm", "--model", "fem")


@pytest.fixture
def coefficients(monkeypatch):
    """Coefficients of friction with which finite elements are asked for; none is computed."""
    asked = []

    def refuse(*_, friction=0.0, **__):
        asked.append(friction)
        raise ConvergenceError("not computed here")

    monkeypatch.setattr("fem_reference.press_path", refuse)
    monkeypatch.setattr(press, "press", refuse)
    monkeypatch.setattr(press, "press_path", refuse)
    return asked


@pytest.mark.parametrize(("text", "value"), [("0.3", 0.3), ("no-slip", math.inf), ("0", 0.0)])
@pytest.mark.parametrize(
    "target", [("--load", "2N"), ("--depth", "0.1mm"), ("--load", "2N", "--curve", "4", "--out", "x")]
)
def test_the_option_reaches_the_solver(softcover, coefficients, text, value, target):
    status, _, err = softcover("press", "wts-0614-34", *BALL, *target, "--friction", text)
    assert (status, set(coefficients)) == (4, {value}), err


@pytest.fixture
def rubbing(tmp_path, monkeypatch):
    """A sensor file with friction, whose fast model is that of the built-in sensor."""
    from fastmodel import load as load_parameters

    found = SimpleNamespace(parameters=load_parameters("wts-0614-34"))
    monkeypatch.setattr("validation.derivation.derive.derive", lambda *_, **__: found)
    file = tmp_path / "rubbing.toml"
    text = "[contact]\nfriction = 0.4\n[array]\nrows = 14\ncolumns = 6\npitch = '3.4 mm'\n"
    file.write_text(text + "[cover]\nlayer = [{ thickness = '2 mm', material = 'dragon-skin-30' }]\n")
    return file.name


PRESS = ("press", "--indenter", "sphere:radius=5mm", "--load", "2N", "--model", "fast")
VIEW = ("view", "--indenter", "sphere:radius=5mm", "--load", "2N", "--seconds", "0")


@pytest.mark.parametrize("command", [PRESS, VIEW, ("export",)], ids=lambda words: words[0])
def test_the_fast_model_says_in_words_that_it_has_no_friction(softcover, rubbing, command):
    status, out, err = softcover(command[0], rubbing, *command[1:], "--json")
    printed = json.loads(out)
    sentences = (printed["models"]["fast"] if command[0] == "press" else printed)["warnings"]
    found = [sentence for sentence in sentences if "friction" in sentence]
    assert status == 0
    assert len(found) == 1
    assert "0.4" in found[0]
    assert "not used" in found[0]
    assert f"softcover: warning: {found[0]}" in err.splitlines()


@pytest.mark.parametrize("command", [PRESS, VIEW, ("export",)], ids=lambda words: words[0])
def test_without_friction_nothing_is_said_of_it(softcover, command):
    _, out, err = softcover(command[0], "wts-0614-34", *command[1:], "--json")
    assert "friction" not in out + err


def test_beside_the_finite_elements_the_fast_model_says_that_they_alone_use_friction(monkeypatch):
    from fastmodel import load as load_parameters
    from validation.campaign import comparison

    sensor = load("wts-0614-34")
    case, parameters = Case.read("one", "sphere:radius=5mm", "2N"), load_parameters("wts-0614-34")
    plain = press.press(sensor.cover, sensor.array, case.indenter, load=case.load)
    monkeypatch.setattr(comparison, "_press_as_far", lambda *_, **__: (plain, ""))
    for friction, text in ((math.inf, "no-slip is used by the finite elements alone"), (0.0, "")):
        found = comparison.compare_models(sensor, case, parameters=parameters, friction=friction)
        assert [sentence for sentence in found.fast.warnings if "friction" in sentence] == (
            [f"the fast model has no friction; {text}"] if text else []
        )
