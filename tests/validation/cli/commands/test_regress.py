"""The command `softcover regress`, on folders of parameters and on sensors that are derived."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

import fastmodel
from fastmodel import Butterworth, Electronics, Gaussian, Parameters
from meshes import TexelArray
from tests.support.compute_once import compute_once
from validation.cli.commands.regress import explain_verdict

ROOT = Path(__file__).parents[4]


@pytest.fixture
def parameters():
    """Parameters of a small array without a cover."""
    return Parameters(
        array=TexelArray.grid(8, 5, 3e-3, name="small"),
        spread=Gaussian.from_sigma(0.5),
        electronics=Electronics(rate_hz=100.0, sensitivity=1000.0),
        filter=Butterworth(cutoff_hz=30.0),
    )


@pytest.fixture
def regress(softcover, parameters, tmp_path):
    """Run the command on a folder of these parameters or of changed ones."""

    def run(*words, changed=parameters):
        changed.save(tmp_path / "folder")
        return softcover("regress", tmp_path / "folder", *words)

    return run


@pytest.fixture
def stored(regress, tmp_path):
    """The baseline of these parameters."""

    def measure():
        regress("--update")
        return (tmp_path / "baseline.json").read_bytes()

    (tmp_path / "baseline.json").write_bytes(compute_once("small-baseline", measure))


@pytest.mark.slow
def test_verdict_on_a_folder_of_parameters(regress, parameters, tmp_path):
    status, out, err = regress()
    assert (status, out) == (2, "")
    assert "no such file; write one with --update" in err
    status, out, err = regress("--update")
    assert (status, out) == (0, "")
    assert "all changed or new" in err
    stored = (tmp_path / "baseline.json").read_text()
    status, out, err = regress("--junit", "report/junit.xml")
    assert (status, out) == (0, "")
    assert "none changed" in err
    suite = ET.parse(tmp_path / "report" / "junit.xml").getroot()[0]  # noqa: S314 -- ours
    assert suite.get("failures") == "0"
    assert int(suite.get("tests")) == len(json.loads(stored)["quantities"]) == len(suite)
    assert not any(title.startswith("accuracy") for title in json.loads(stored)["quantities"])
    assert "cover" not in {
        title.split(":")[1].split(",")[0].strip()
        for title in json.loads(stored)["quantities"]
        if title.startswith("H:")
    }


@pytest.mark.slow
def test_a_change_is_told_and_stored(stored, regress, parameters, tmp_path):
    before = (tmp_path / "baseline.json").read_text().splitlines()
    other = replace(parameters, electronics=replace(parameters.electronics, sensitivity=1050.0))
    status, out, err = regress("--junit", "junit.xml", "--out", "verdict", changed=other)
    assert status == 1
    assert "quantities left their tolerances, in: characteristic, data sheet." in err, err
    header, *rows = (tmp_path / "verdict" / "regress.csv").read_text().splitlines()
    ratios = {title.strip('"'): float(value) for title, value in (line.rsplit(",", 1) for line in rows)}
    assert header == "quantity,change_over_tolerance"
    assert ratios["characteristic: sensitivity"] == pytest.approx(10, rel=0.01)  # 5 % at a tolerance of 0.5 %
    assert {title.split(":")[0] for title, value in ratios.items() if value > 1} == {
        "characteristic",
        "data sheet",
    }
    assert "characteristic: sensitivity: rose from 999.76 to 1049.7 counts/N (+5 %), tolerance 0.5 % of value" in out
    assert {line.split(":")[0] for line in out.splitlines()} == {"characteristic", "data sheet"}
    assert "if the changes are meant: softcover regress" in err
    failures = ET.parse(tmp_path / "junit.xml").getroot().findall(".//failure")  # noqa: S314 -- ours
    assert [each.get("message") for each in failures] == out.splitlines()
    status, out, err = regress("--update", changed=other)
    assert status == 0
    assert "characteristic: sensitivity: rose from 999.76 to 1049.7 counts/N" in out
    after = (tmp_path / "baseline.json").read_text().splitlines()
    changed = [line for line in after if line not in before]
    assert any("1049.7" in line for line in changed)
    assert len(changed) < 14


@pytest.mark.slow
def test_json_holds_changes_and_all_values(stored, regress, parameters):
    other = replace(parameters, filter=Butterworth(cutoff_hz=31.5))
    status, out, _ = regress("--json", changed=other)
    found = json.loads(out)
    assert status == 1
    assert found["changed"] == len(found["changes"]) == 2
    changes = {each["quantity"]: each for each in found["changes"]}
    assert set(changes) == {"data sheet: of the sensor", "filter: rise time"}
    assert changes["filter: rise time"]["now"] < changes["filter: rise time"]["before"]
    assert found["quantities"]["filter: rise time"]["unit"] == "ms"


@pytest.mark.slow
def test_what_cannot_be_measured_any_more_is_red_and_says_why(stored, regress, parameters):
    dead = replace(parameters, electronics=replace(parameters.electronics, gains=(0.0,) * 40))
    status, out, err = regress(changed=dead)
    assert status == 1
    assert "characteristic: sensitivity: could not be measured: no force gives a count" in out
    assert "not measured: characteristic: " in err


@pytest.mark.slow
def test_a_baseline_of_another_sensor_is_neither_compared_nor_replaced(stored, regress, parameters, tmp_path):
    path = tmp_path / "baseline.json"
    before = path.read_bytes()
    other = replace(parameters, array=TexelArray.grid(5, 8, 3e-3, name="small"))
    for words in ((), ("--update",)):
        status, out, err = regress(*words, changed=other)
        assert (status, out) == (2, "")
        assert "belongs to 'small: 8 rows x 5 columns" in err
    path.write_text('{"name": "of another program"}')
    assert regress("--update")[0] == 2
    assert path.read_text() == '{"name": "of another program"}'
    path.write_bytes(before)


@pytest.mark.bench  # `.ci/run` runs the check of this sensor
@pytest.mark.slow
def test_a_built_in_sensor_is_derived_and_scored(softcover, tmp_path):
    data = json.loads((ROOT / ".ci" / "wts-0614-34.json").read_text())
    data["quantities"]["accuracy: misplaced force"]["value"]["sphere, texel"] -= 1.0
    (tmp_path / "baseline.json").write_text(json.dumps(data))
    status, out, _ = softcover("regress", "wts-0614-34", "--seed", "3")
    assert (status, len(out.splitlines())) == (1, 1)
    assert out.startswith("accuracy: misplaced force: 1 of 17 numbers changed, most: sphere, texel rose from")
    fastmodel.load("wts-0614-34").save(tmp_path / "folder")
    status, _, err = softcover("regress", tmp_path / "folder")
    assert status == 2
    assert "without finite elements" in err


def test_a_verdict_names_the_largest_change_or_the_groups_that_moved():
    assert explain_verdict({}) == "All 0 quantities are within their tolerances."
    assert explain_verdict({"a: x": 1e-3, "b: y": 0.0}) == (
        "All 2 quantities are within their tolerances; none changed by more than 0.01 of its tolerance."
    )
    assert explain_verdict({"a: x": 0.25, "b: y": 1.0, "b: z": 0.5}) == (
        "All 3 quantities are within their tolerances; the largest change is 1 of its tolerance (b: y)."
    )
    moved = explain_verdict({"b: y": 1.5, "a: x": 0.5, "c: z": float("nan"), "b: w": float("inf")})
    assert moved.startswith("3 of 4 quantities left their tolerances, in: b, c. ")
