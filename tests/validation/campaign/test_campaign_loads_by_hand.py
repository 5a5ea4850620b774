"""Loads that are scaled and lowered, twins at one place, defaults, and what a campaign states, by hand."""

import dataclasses
import math
from pathlib import Path

import pytest

from meshes import TexelArray
from meshes.bounded_file import parse_toml
from validation.campaign.campaign_file import RECORDING_LIMITS, Inputs, parse_campaign, read_campaign
from validation.campaign.case import Case
from validation.errors import InputError
from validation.places import FlatPlaces

BALL = {"name": "ball", "indenter": "sphere:radius=5mm", "load": "2 N"}
#: An odd number of rows and columns: the middle of the array is that of a texel.
ODD = TexelArray.grid(5, 7, 3e-3)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Places(FlatPlaces):
    """Places on a cover that bears given loads, by the indenter, and for which loads are scaled by a factor."""

    limits: dict = dataclasses.field(default_factory=dict)
    factor: float = 1.0

    def scale_loads(self, table, source):
        assert source == "mine.toml"
        return self.factor * table.modulus / 1e6

    def limit_load(self, case, share):
        return share / 0.2 * self.limits.get(case.shape, math.inf)


def read(*cases, places=None, source="mine.toml", **tables):
    return parse_campaign({"case": list(cases), **tables}, places or Places(array=ODD), source=source)


def test_loads_for_another_cover_are_scaled_to_two_digits():
    places = Places(array=ODD, factor=0.123)
    table = {"modulus": "2 MPa", "thickness": "3 mm"}
    found = read(BALL, BALL | {"name": "b", "load": "7 N"}, places=places, loads_for=table, intended_use=" a\n  b ")
    assert [case.load for case in found.cases] == [0.49, 1.7]
    assert found.intended_use == "a b"
    plain = read(BALL | {"load": "1.2345 N"}, places=dataclasses.replace(places, factor=0.5), loads_for=table)
    assert plain.cases[0].load == 1.2345


def test_loads_of_a_body_are_lowered_by_one_factor_where_the_largest_is_too_deep():
    """The ball bears 3 N at a fifth of the thickness, and 1.5 N at a tenth: 5 N and 2 N are lowered by 0.3."""
    places = Places(array=ODD, limits={"sphere:radius=5mm": 3.0, "cylinder:radius=4mm": 12.5})
    disk = {"name": "disk", "indenter": "cylinder:radius=4mm", "load": "6.25 N"}
    found = read(BALL, BALL | {"name": "b", "load": "5 N"}, disk, places=places, deepest="10 %", intended_use="use.")
    assert [case.load for case in found.cases] == [0.6, 1.5, 6.25]
    assert found.intended_use == "use. Loads are lowered for this soft cover: 0.6 N to 6.2 N."
    kept = read(BALL, BALL | {"name": "b", "load": "3 N"}, disk, places=places, deepest="20 %", intended_use="use.")
    assert [case.load for case in kept.cases] == [2.0, 3.0, 6.25]
    assert kept.intended_use == "use."


def test_several_bodies_are_lowered_by_the_smaller_factor():
    """The ball bears 1.5 N of 3 N, the disk 1 N of 5 N: all loads of the case are lowered by a fifth."""
    places = Places(array=ODD, limits={"sphere:radius=1mm": 1.5, "cylinder:radius=1mm": 1.0})
    ball = {"name": "two", "indenter": "sphere:radius=1mm", "load": "3 N", "at": "-4mm,0mm"}
    disk = {"indenter": "cylinder:radius=1mm", "load": "5 N", "at": "4mm,0mm"}
    (found,) = read(ball | {"others": [disk]}, places=places, deepest="20 %").cases
    assert found.load == 1.6
    assert [each.load for each in found.bodies] == pytest.approx([0.6, 1.0])


def test_a_press_at_a_place_with_two_names_is_kept_once_and_stays_marked():
    first, second = BALL | {"at": "centre"}, BALL | {"name": "again", "at": "texel", "quick": True}
    found = read(first, second)
    assert [case.name for case in found.cases] == ["ball"]
    assert (found.quick, found.left_out) == (("ball",), ())
    # by coordinates it is a repeated press, as it is under one name
    for at in ("0mm,0mm", "centre"):
        again = read(first, BALL | {"name": "again", "at": at})
        assert again.left_out == (
            "mine.toml: case[1]: 'again' is the same press as case[0], 'ball'; change one of them",
        )  # fmt: skip
    several = {key: value for key, value in second.items() if key != "load"} | {"loads": ["2 N", "3 N"]}
    loads = read(first | {"quick": True}, several)
    assert [case.name for case in loads.cases] == ["ball", "again, 3 N"]
    assert loads.quick == ("ball", "ball", "again, 3 N")


def test_what_a_file_does_not_state_is_built_in():
    inputs = Inputs()
    assert dataclasses.astuple(inputs) == (0.1, 0.005, 0.025, 1e-4, pytest.approx(math.radians(1)), math.inf, 0.0)
    assert dict(RECORDING_LIMITS) == {"image_changed_percent": 2.0, "relative_l2": 0.1, "behind_null_percent": 0.2}
    found = read(BALL)
    assert dataclasses.astuple(found.inputs) == pytest.approx(dataclasses.astuple(inputs))
    assert (dict(found.criterion.recordings), found.inherits) == (dict(RECORDING_LIMITS), True)
    required = {"mean": {"misplaced_force": "3 %"}, "recordings": {"relative_l2": "7 %"}}
    stated = read(BALL, required=required, inputs={"modulus": "30 %", "friction": 0.7}, name=" own ")
    assert dict(stated.criterion.recordings) == dict(RECORDING_LIMITS) | {"relative_l2": 0.07}
    assert (stated.inputs.modulus, stated.inputs.thickness, stated.inherits, stated.name) == (0.3, 0.025, False, "own")
    assert not parse_campaign({}, Places(array=ODD), source="built-in").inherits


def test_a_campaign_states_its_limits_inputs_and_cases():
    found = read(BALL, {"name": "lost"}, required={"each": {"peak_error": "4 %"}}, inputs={"friction": 0.7})
    shown = found.as_json()
    assert (shown["name"], shown["source"], shown["cases"]) == (found.name, "mine.toml", ["ball"])
    assert shown["required"]["each"] == {"peak_error": 0.04}
    assert shown["required"].keys() == {"mean", "each", "recordings"}
    assert (shown["inputs"]["friction"], shown["inputs"]["position"]) == (0.7, 1e-4)
    assert shown["left_out"] == list(found.left_out)
    assert shown["left_out"][0].startswith("mine.toml: case[1]")
    assert read(BALL).as_json()["inputs"]["friction"] == "no-slip"


def test_built_in_campaigns_are_read_by_name_unless_there_is_such_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    places = FlatPlaces(array=ODD)
    named, default = read_campaign(Path("report-2015"), places), read_campaign(None, places)
    assert (named.name, named.source, named.inherits) == ("report-2015", "built-in report-2015", False)
    assert (default.source, default.name) == ("built-in", "default")
    assert len(read_campaign(Path("moving"), places).moving) == 9
    Path("report-2015").write_text("[[case]]\nname = 'ball'\nindenter = 'sphere:radius=5mm'\nload = '2 N'\n")
    assert [case.name for case in read_campaign(Path("report-2015"), places).cases] == ["ball"]
    Path("empty.toml").write_text("# nothing\n")
    with pytest.raises(InputError, match=r"^empty.toml: is empty; write \[\[case\]\]"):
        read_campaign(Path("empty.toml"), places)
    with pytest.raises(InputError) as error:
        parse_campaign(parse_toml("[[case]]\nname = 'a'\n"), places, source="s")
    assert error.value.faults[-1] == "s: no usable case is left; add one, or mend one of these"


def test_a_tilted_case_is_turned_into_an_upright_one_of_another_shape():
    case = Case.read("a", "box:size=4mmx6mmx5mm", "2 N", at="1mm,2mm", yaw="30deg")
    tilted = dataclasses.replace(case, pose=dataclasses.replace(case.pose, tilt=(0.1, -0.07)), path=(1.0, 2.0))
    turned = tilted.turned
    assert (turned.pose.tilt, turned.pose.at, turned.pose.yaw) == ((0.0, 0.0), (1e-3, 2e-3), pytest.approx(math.pi / 6))
    assert (turned.load, turned.path, turned.name) == (2.0, (1.0, 2.0), "a")
    assert not turned.has_shape_of(tilted)
    assert case.turned.has_shape_of(case)
    assert not case.is_press_of(dataclasses.replace(case, indenter=turned.indenter))
    again = Case.from_json(tilted.as_json() | {"required": {"peak_error": 0.3}, "compared": ["peak_error"]})
    assert again.is_press_of(tilted)
    assert (again.required, again.compared, again.others) == ({"peak_error": 0.3}, ("peak_error",), ())
