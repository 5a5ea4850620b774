"""Cases with several bodies: read, pressed by the reference and by the models, and refused."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import fastmodel
from fem_reference.errors import PiercedError
from fem_reference.indentation.press import press
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Sphere
from meshes.catalogue import ARRAYS, ASSUMED_COVER
from tests.support.rubber import stack_layers
from validation.campaign.bench import LayeredBench
from validation.campaign.campaign_file import parse_campaign, read_campaign
from validation.campaign.case import Case
from validation.campaign.reference_press import press_reference
from validation.campaign.results import SkippedCase
from validation.errors import InputError
from validation.places import find_places
from validation.sensor_file import BUILT_IN

ARRAY = ARRAYS["wts-0614-34"]
PLACES = find_places(ASSUMED_COVER, BUILT_IN["wts-0614-34"], None)
BIG = {"name": "two", "indenter": "box:size=12mmx12mmx8mm", "load": "1 N", "at": "0mm,-12mm"}
SMALL = {"indenter": "box:size=6mmx6mmx8mm", "load": "0.5 N", "at": "0mm,12mm", "yaw": "10deg"}


def read(**changed):
    return parse_campaign({"case": [BIG | {"others": [SMALL]} | changed]}, PLACES, source="file")


@pytest.fixture(scope="module")
def case():
    return read().cases[0]


def test_the_load_of_a_case_is_that_of_all_bodies_which_can_be_stored_and_scaled(case):
    assert case.load == pytest.approx(1.5)
    assert [each.load for each in case.bodies] == pytest.approx([1.0, 0.5])
    assert [each.load for each in case.with_load(3.0).bodies] == pytest.approx([2.0, 1.0])
    again = Case.from_json(case.as_json())
    assert again.is_press_of(case)
    assert not again.is_press_of(case.bodies[0])
    assert not again.is_press_of(read(others=[SMALL | {"load": "1 N"}], load="0.5 N").cases[0])


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"load": None, "loads": ["1 N", "2 N"]}, "others: several bodies have one load each"),
        ({"tilt": "1deg,0deg"}, "others: several bodies have one load each"),
        ({"others": [SMALL | {"load": "-1 N"}]}, r"others\[0\].load: "),
        ({"others": [SMALL | {"at": "nowhere"}]}, r"others\[0\].at: "),
        ({"others": [{"indenter": "sphere:radius=5mm"}]}, r"others\[0\]"),
    ],
)
def test_faults_name_their_place(changed, fault):
    kept = {key: value for key, value in (BIG | {"others": [SMALL]} | changed).items() if value is not None}
    with pytest.raises(InputError, match=fault):
        parse_campaign({"case": [kept]}, PLACES, source="file")


@pytest.mark.slow
def test_bodies_far_apart_press_as_each_alone(case):
    """24 mm apart on 2 mm the bodies do not feel each other."""
    found = press_reference(ASSUMED_COVER, ARRAY, case)
    alone = [press(ASSUMED_COVER, ARRAY, each.indenter, each.pose, load=each.load).texel_forces for each in case.bodies]
    assert found.texel_forces == pytest.approx(sum(alone), abs=3e-3 * sum(alone).max())
    assert found.balance == pytest.approx(0, abs=1e-3)
    assert found.contact_area == pytest.approx(180e-6, rel=0.03)
    assert found.unmeasured[2] == pytest.approx(-found.outside, abs=2e-3)
    bench = LayeredBench(cover=ASSUMED_COVER, parameters=fastmodel.load("wts-0614-34"))
    scored = bench.solve(case)
    assert scored.predictions["fast"].score.misplaced_force < 0.015
    assert scored.predictions["zeros"].score.misplaced_force == pytest.approx(0.5, abs=0.01)
    boxes = scored.predictions["boxes"]
    assert boxes.texel_forces.sum() + boxes.outside == pytest.approx(1.5, rel=1e-3)


@pytest.mark.parametrize(
    ("at", "fault"),
    [
        ("0mm,-9mm", r"case\[0\].others\[1\].at: the body overlaps the first body; move one"),
        ("0mm,15mm", r"case\[0\].others\[1\].at: the body overlaps others\[0\]; move one"),
        ("0mm,900mm", r"case\[0\].others\[1\].at: .* is not on the array"),
    ],
)
def test_bodies_that_overlap_or_lie_beside_the_array_are_refused_when_the_file_is_read(at, fault):
    with pytest.raises(InputError, match=fault):
        read(others=[SMALL, SMALL | {"at": at}])
    ball = {"indenter": "sphere:radius=3mm", "load": "1 N"}
    for apart, name in ((4.3, None), (4.2, "a")):  # 3 mm + 3 mm along a diagonal
        others = [ball | {"at": f"{apart}mm,{apart}mm"}]
        table = ball | {"name": "a", "others": others}
        found = parse_campaign({"case": [table, BIG]}, PLACES, source="file")
        assert (found.cases[0].name == "a") is (name is None)


@pytest.mark.slow
def test_bodies_too_deep_are_refused_or_marked_as_in_a_press_of_one():
    """The range and the refusal of a press of one ball on a cover of 2 mm, and a small body beside a heavy one."""

    def make(shape, load, at):
        other = Case.read("b", shape, "1 N", at=at)
        first = Case.read("a", shape, load, at="0mm,0mm")
        return dataclasses.replace(first, load=first.load + 1.0, others=(other,))

    ball, box = "sphere:radius=3mm", "box:size=6mmx6mmx8mm"
    with pytest.raises(PiercedError, match=r"the body of 200 N at \(0, 0\) mm, 0° would pierce the cover"):
        press_reference(ASSUMED_COVER, ARRAY, make(ball, "200 N", "0mm,9mm"))
    with pytest.raises(ValueError, match=r"the body of 1 N at \(0, 9\) mm, 0° is lifted"):
        press_reference(ASSUMED_COVER, ARRAY, make(box, "50 N", "0mm,9mm"))
    deep = press_reference(ASSUMED_COVER, ARRAY, make(ball, "12 N", "0mm,9mm"))
    alone = press(ASSUMED_COVER, ARRAY, Sphere(radius=3e-3), load=12.0)
    assert deep.assumptions["range"] == alone.assumptions["range"]


def test_bodies_too_far_apart_for_one_grid_are_refused_before_memory_is_taken():
    bodies = [Body(indenter=Sphere(radius=3e-3), load=1.0, at=(x, x)) for x in (0.0, 0.9)]
    with pytest.raises(ValueError, match="too far apart"):
        press_together(ASSUMED_COVER, ARRAY, bodies)


def test_deepest_lowers_all_bodies_by_the_factor_of_the_one_that_needs_it():
    """The loads of a case of two bodies keep their ratio, and the factor is that of the small one alone."""
    places = dataclasses.replace(PLACES, cover=stack_layers((2e-3, 1e5, 0.49)))
    small = {"name": "one", "indenter": "box:size=6mmx6mmx8mm", "load": "5 N"}

    def lower(table):
        return parse_campaign({"case": [table], "deepest": "10 %"}, places, source="file").cases[0]

    (alone,), two = lower(small).bodies, lower(BIG | {"others": [SMALL | {"load": "5 N"}]})
    assert 0 < alone.load < 3
    assert [each.load for each in two.bodies] == pytest.approx([alone.load / 5, alone.load], rel=0.05)


def test_a_skipped_case_names_every_body_with_its_load(case):
    assert SkippedCase.of(case, "why").indenter == (
        "box:size=12mmx12mmx8mm, 1 N at (0, -12) mm, 0° and box:size=6mmx6mmx8mm, 0.5 N at (0, 12) mm, 10°, together"
    )
    assert SkippedCase.of(case.bodies[0], "why").indenter == "box:size=12mmx12mmx8mm"


def test_friction_is_refused(case):
    with pytest.raises(ValueError, match="without friction; split them"):
        press_reference(ASSUMED_COVER, ARRAY, case, friction=0.3)


def test_the_campaign_of_the_report_has_its_two_squares():
    cases = read_campaign(Path("report-2015"), PLACES).cases
    assert len(cases) == 34
    assert [round(each.load / 9.80665, 6) for each in cases[-1].bodies] == [0.1, 0.1]
    assert np.abs(np.subtract(*(each.pose.at for each in cases[-1].bodies))).tolist() == pytest.approx([0, 0.018])
