"""The friction of a sensor file reaches the finite elements of `press` and of a campaign."""

import json

import pytest

from tests.support.sensor_text import GOOD
from validation.campaign.case import Case
from validation.campaign.evaluation import evaluate
from validation.sensor_file import load

#: A flat face of revolution without slip is one linear system in the r-z plane.
PRESS = ("press", "s.toml", "--indenter", "cylinder:radius=2mm", "--depth", "0.1mm", "--json")


@pytest.fixture
def sticky(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(GOOD + '[contact]\nfriction = "no-slip"\n')
    return path


def test_press_takes_the_friction_of_the_file_unless_the_option_replaces_it(softcover, sticky):
    def press(*options):
        status, out, _ = softcover(*PRESS, "--model", "fem", *options)
        assert status == 0
        return json.loads(out)["models"]["fem"]

    file, option, none = press(), press("--friction", "no-slip"), press("--friction", "0")
    assert file["assumptions"]["friction"] == "no slip"
    assert file["total_force"] == option["total_force"]
    assert file["total_force"] > 1.02 * none["total_force"]
    assert none["assumptions"]["friction"] == "frictionless"
    sticky.write_text(GOOD)
    assert press()["total_force"] == none["total_force"]


@pytest.mark.slow
def test_a_campaign_presses_with_the_friction_of_the_file_and_derive_states_that_it_does_not(sticky):
    found = evaluate(load(sticky), cases=[Case.read("face", "cylinder:radius=2mm", "100 g")])
    assert found.campaign.cases[0].reference.assumptions["friction"] == "no slip"
    assert found.report.friction == "no-slip"
    lines = found.derivation.undetermined
    assert any(line.startswith("friction no-slip of the sensor file: not used") for line in lines)
