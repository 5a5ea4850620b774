"""Campaign files: what is read, and one line for each fault."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from meshes import TexelArray
from meshes.bounded_file import parse_toml
from meshes.catalogue import ARRAYS
from validation.campaign.campaign_file import Inputs, parse_campaign, read_campaign
from validation.errors import InputError
from validation.places import FlatPlaces
from validation.schema.campaign import METRICS, CampaignTables, CaseTable, RequiredTable

GOOD = """
[[case]]
name = "ball"
indenter = "sphere:radius=5mm"
load = "100 g"
"""


def read(text, array):
    return parse_campaign(parse_toml(text), FlatPlaces(array=array), source="mine.toml")


def test_a_full_file_is_read_in_si_units(wts):
    campaign = read(
        """
        name = "mine"
        intended_use = "show that it works"
        [required.mean]
        misplaced_force = "3 %"
        centre_of_pressure_m = "0.2 mm"
        image_changed_percent = "1.5 %"
        pixels_changed = 12
        [required.each]
        peak_error = "10 %"
        [inputs]
        modulus = "20 %"
        poisson_ratio = 0.01
        position = "50 um"
        yaw = "2 deg"
        friction = 0.5
        [[case]]
        name = "ball"
        indenter = "sphere:radius=5mm"
        load = "100 g"
        at = "1mm,-2mm"
        yaw = "30deg"
        tilt = "2deg,0deg"
        compared = ["misplaced_force", "peak_error"]
        required = { peak_error = "5 %" }
        """,
        wts,
    )
    assert (campaign.name, campaign.intended_use) == ("mine", "show that it works")
    assert campaign.criterion.mean == {
        "misplaced_force": 0.03,
        "centre_of_pressure_m": pytest.approx(2e-4),
        "image_changed_percent": pytest.approx(1.5),
        "pixels_changed": 12,
    }
    assert campaign.criterion.each == {"peak_error": 0.1}
    inputs = campaign.inputs
    assert (inputs.modulus, inputs.poisson_ratio, inputs.thickness, inputs.friction) == (0.2, 0.01, 0.025, 0.5)
    assert (inputs.position, inputs.yaw) == (pytest.approx(5e-5), pytest.approx(math.radians(2)))
    (case,) = campaign.cases
    assert case.load == pytest.approx(0.980665)
    assert (case.pose.at, case.pose.yaw) == ((1e-3, -2e-3), pytest.approx(math.radians(30)))
    assert case.pose.tilt == (pytest.approx(math.radians(2)), 0)
    assert (case.compared, case.required) == (("misplaced_force", "peak_error"), {"peak_error": 0.05})


def test_what_is_left_out_is_that_of_the_default_campaign(wts):
    default = read_campaign(None, FlatPlaces(array=wts))
    campaign = read(GOOD, wts)
    assert (campaign.criterion, campaign.inputs) == (default.criterion, default.inputs)
    assert len(campaign.cases) == 1


def test_loads_and_paths_make_one_case_each(wts):
    campaign = read(GOOD.replace("load =", "loads =").replace('"100 g"', '["1 N", "2 N"]'), wts)
    assert [(case.name, case.load, case.path) for case in campaign.cases] == [
        ("ball, 1 N", 1.0, ()),
        ("ball, 2 N", 2.0, ()),
    ]
    campaign = read(GOOD.replace("load =", "path =").replace('"100 g"', '["1 N", "2 N"]'), wts)
    assert [(case.load, case.path) for case in campaign.cases] == [(1.0, (1.0, 2.0)), (2.0, (1.0, 2.0))]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ("indenter = 'spere:radius=5mm'", "case[1].indenter: unknown indenter 'spere'; did you mean 'sphere'?"),
        ("indenter = 'sphere:radius=-5mm'", "case[1].indenter: "),
        ("indenter = 5", "case[1].indenter: must be a text"),
        ("load = 5", "case[1].load: must be a text, not 5; write for example '4.9 N'"),
        ("load = '5'", "case[1].load: "),
        ("load = '-5 N'", "case[1].load: must be positive"),
        ("load = 'nan N'", "case[1].load: "),
        ("loads = ['1 N', '1 N']\nload = ''", "case[1].load: give one of"),
        ("at = 'center'", "case[1].at: unknown place 'center'; did you mean 'centre'?"),
        ("at = '1mm'", "case[1].at: "),
        ("yaw = '45'", "case[1].yaw: "),
        ("tilt = '45deg,0deg'", "case[1].tilt: "),
        ("compared = ['misplaced']", "case[1].compared[0]: 'misplaced' is unknown; did you mean"),
        ("required = { misplaced_force = 3 }", "case[1].required.misplaced_force: 3 is no percentage"),
        ("required = { misplace = '3 %' }", "case[1].required.misplace: unknown key; did you mean"),
        ("quick = 1", "case[1].quick: input should be a valid boolean"),
        ("name = ''", "case[1].name: "),
        ("name = 'ball'", "case[1].name: 'ball' is the name of case[0] already"),
        ("indenter = 'sphere:radius=0.5cm'\nload='100 g'", "case[1]: 'other' is the same press as case[0], 'ball'"),
        ("colour = 'red'", "case[1].colour: unknown key"),
    ],
)
def test_a_faulty_case_costs_one_line_and_the_others_stay(wts, change, line):
    keys = {"name": "'other'", "indenter": "'sphere:radius=5mm'", "load": "'2 N'"}
    for part in change.split("\n"):
        key, _, value = part.partition("=")
        keys[key.strip()] = value.strip()
    if keys["load"] == "''":
        keys["load"] = "'1 N'"
    other = "[[case]]\n" + "\n".join(f"{key} = {value}" for key, value in keys.items())
    campaign = read(GOOD + other, wts)
    assert [case.name for case in campaign.cases] == ["ball"]
    assert len(campaign.left_out) == 1
    assert campaign.left_out[0].startswith(f"mine.toml: {line}")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("case = []", "mine.toml: case: must be a list of at least one table"),
        ("case = 3", "mine.toml: case: must be a list of at least one table"),
        ("casse = 3", "mine.toml: casse: unknown key; did you mean 'case'?"),
        (f"[required]\n{GOOD}", "mine.toml: required: states no limit"),
        (f"[required.mean]\nmisplaced_forces = '3 %'\n{GOOD}", "mine.toml: required.mean.misplaced_forces: unknown"),
        (f"[required.means]\n{GOOD}", "mine.toml: required.means: unknown key"),
        (f"[required.mean]\nactive_area_iou = 1\n{GOOD}", "mine.toml: required.mean.active_area_iou: unknown key"),
        (f"[inputs]\nthickness = '5 mm'\n{GOOD}", "mine.toml: inputs.thickness: '5 mm' is no percentage"),
        (f"[inputs]\nfriction = -1\n{GOOD}", "mine.toml: inputs.friction: "),
        (f"[inputs]\nmass = 1\n{GOOD}", "mine.toml: inputs.mass: unknown key"),
        (f"name = 3\n{GOOD}", "mine.toml: name: must be a text"),
        (GOOD.replace("sphere", "spere"), "mine.toml: case[0].indenter: unknown indenter"),
    ],
)
def test_a_fault_outside_the_cases_is_an_error(wts, text, line):
    with pytest.raises(InputError) as error:
        read(text, wts)
    assert error.value.faults[0].startswith(line)


def test_the_largest_file_and_the_most_cases_are_read_and_one_more_is_refused(wts, tmp_path):
    path = tmp_path / "large.toml"
    for size in (2**20, 2**20 + 1):
        path.write_text(GOOD + "#" * (size - len(GOOD)))
        if size == 2**20:
            assert len(read_campaign(path, FlatPlaces(array=wts)).cases) == 1
    with pytest.raises(InputError, match="has more than the 1 MiB accepted"):
        read_campaign(path, FlatPlaces(array=wts))
    tables = parse_toml(GOOD)
    campaign = parse_campaign({"case": tables["case"] + 999 * [{}]}, FlatPlaces(array=wts), source="mine.toml")
    assert len(campaign.cases) == 1
    assert campaign.left_out[-1].startswith("mine.toml: case[999].")
    with pytest.raises(InputError, match="1001 tables; at most 1000 are accepted"):
        parse_campaign({"case": tables["case"] + 1000 * [{}]}, FlatPlaces(array=wts), source="mine.toml")


def test_places_with_two_names_on_an_array_give_one_case():
    """The middle of an odd number of rows and columns is a texel."""
    campaign = read_campaign(None, FlatPlaces(array=TexelArray.grid(7, 7, 3.4e-3)))
    assert len(campaign.cases) == 16
    assert not campaign.left_out
    assert "sphere, centre, heavy" in campaign.quick  # "sphere, texel" is marked


@pytest.mark.parametrize("name", ["wts-0614-34", "sdh2-distal"])
def test_the_default_campaign_covers_shapes_loads_turns_and_all_named_places(name):
    places = FlatPlaces(array=ARRAYS[name])
    cases = read_campaign(None, places).cases
    assert len({case.name for case in cases}) == len(cases) >= 12
    assert {case.shape.split(":")[0] for case in cases} == {"sphere", "cylinder", "box", "tip"}
    assert {round(math.degrees(case.pose.yaw)) for case in cases} == {0, 45, 90}
    assert {round(case.load / 9.80665e-3) for case in cases} >= {100, 500}
    assert {case.pose.at for case in cases} == set(places.named.values())
    assert all((np.abs(case.pose.at) < np.array(places.array.extent) / 2).all() for case in cases)


def test_the_documentation_names_every_key_position_and_metric(wts):
    text = (Path(__file__).parents[3] / "docs" / "validation.md").read_text()
    shown = set(re.findall(r"[a-z_0-9]+", text.split("## How the verdict is made")[0]))
    keys = {key for table in (CampaignTables, RequiredTable, CaseTable) for key in table.model_fields} | set(METRICS)
    assert keys | {field.name for field in dataclasses.fields(Inputs)} <= shown
    assert all(f"`{name}`" in text for name in FlatPlaces(array=wts).named)
