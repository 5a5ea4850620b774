"""Friction reaches the finite elements from the command line and from sensor files; the fast model says it has none."""

import json
from types import SimpleNamespace

import pytest

import fastmodel
from tests.support.sensor_text import GOOD
from validation.campaign.case import Case
from validation.campaign.evaluation import evaluate
from validation.sensor_file import load

#: A sensor file with the array of the built-in sensor.
SENSOR = GOOD.replace("rows = 3", "rows = 14").replace("columns = 2", "columns = 6")
#: A flat face of revolution without slip is one linear system in the r-z plane.
FACE = ("--indenter", "cylinder:radius=2mm", "--depth", "0.1mm", "--json")
BALL = ("--indenter", "sphere:radius=5mm", "--load", "2N")
FAST = (("press", *BALL, "--model", "fast"), ("view", *BALL, "--seconds", "0"), ("export",))


@pytest.fixture
def sticky(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SENSOR + '[contact]\nfriction = "no-slip"\n')
    return path


@pytest.mark.slow
def test_press_takes_the_friction_of_the_file_unless_the_option_replaces_it(softcover, sticky):
    def press(*options):
        status, out, _ = softcover("press", "s.toml", *FACE, "--model", "fem", *options)
        assert status == 0
        return json.loads(out)["models"]["fem"]

    file, option, none = press(), press("--friction", "no-slip"), press("--friction", "0")
    assert file["assumptions"]["friction"] == "no slip"
    assert file["total_force"] == option["total_force"]
    assert file["total_force"] > 1.02 * none["total_force"]
    assert none["assumptions"]["friction"] == "frictionless"
    sticky.write_text(SENSOR)
    assert press()["total_force"] == none["total_force"]


@pytest.mark.slow
def test_a_campaign_presses_with_the_friction_of_the_file_and_derive_states_that_it_does_not(sticky):
    found = evaluate(load(sticky), cases=[Case.read("face", "cylinder:radius=2mm", "100 g")])
    assert found.campaign.cases[0].reference.assumptions["friction"] == "no slip"
    assert found.report.friction == "no-slip"
    lines = found.derivation.undetermined
    assert any(line.startswith("friction no-slip of the sensor file: not used") for line in lines)


@pytest.mark.parametrize("command", FAST, ids=lambda words: words[0])
def test_the_fast_model_says_in_words_that_it_has_no_friction(softcover, sticky, monkeypatch, command):
    stored = SimpleNamespace(parameters=fastmodel.load("wts-0614-34"))
    monkeypatch.setattr("validation.derivation.derive.derive", lambda *_, **__: stored)
    status, out, err = softcover(command[0], sticky, *command[1:], "--json")
    printed = json.loads(out)
    sentences = (printed["models"]["fast"] if command[0] == "press" else printed)["warnings"]
    (found,) = [sentence for sentence in sentences if "friction" in sentence]
    assert status == 0
    assert "no-slip" in found
    assert "not used" in found
    assert f"softcover: warning: {found}" in err.splitlines()


@pytest.mark.parametrize("command", FAST, ids=lambda words: words[0])
def test_without_friction_nothing_is_said_of_it(softcover, command):
    _, out, err = softcover(command[0], "wts-0614-34", *command[1:], "--json")
    assert "friction" not in out + err


@pytest.mark.slow
def test_beside_the_finite_elements_the_fast_model_says_that_they_alone_use_friction(softcover):
    status, _, err = softcover("press", "wts-0614-34", *FACE, "--friction", "no-slip")
    assert status == 0
    assert "warning: the fast model has no friction; no-slip is used by the finite elements alone" in err
