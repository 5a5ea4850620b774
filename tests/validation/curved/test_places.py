"""Places and directions on a curved cover that a campaign file names."""

import dataclasses
import math
import re

import numpy as np
import pytest

from meshes.bounded_file import parse_toml
from meshes.solids import fingertip
from validation.campaign.campaign_file import FlatPlaces, find_places, parse_campaign, read_campaign
from validation.campaign.case import describe_pose
from validation.curved.places import CurvedPlaces
from validation.errors import InputError


@pytest.fixture(scope="module")
def solid_places(small_pad):
    return find_places(small_pad.cover, small_pad)


@pytest.fixture(scope="module")
def places():
    cover = fingertip()
    return CurvedPlaces(mesh=cover.mesh(2e-3, layers=2), texels=cover.texels)


@pytest.fixture(scope="module")
def pad_places(small_pad):
    return CurvedPlaces(mesh=small_pad.cover.meshes()[-1], texels=small_pad.array)


def read(places, **table):
    faults = []
    return places.read(table, "case[0]", faults), faults


def test_oblique_directions_have_30_degrees_to_the_normal_and_differ(places):
    straight, x, y = (read(places, direction=name)[0].towards for name in ("normal", "oblique x", "oblique y"))
    for oblique in (x, y):
        assert math.degrees(math.acos(straight @ oblique)) == pytest.approx(30, abs=1e-9)
    assert math.degrees(math.acos(x @ y)) > 30


def test_named_places_lie_above_active_texels(places):
    named = places.named
    far = np.linalg.norm(places.texels.centres - named["middle"], axis=1)
    assert np.linalg.norm(named["edge"] - named["middle"]) > 0.8 * far.max()
    assert 0 < np.linalg.norm(named["off grid"] - named["middle"]) < places.texels.pitch[0] / 2
    side, middle = (read(places, at=name)[0].towards for name in ("side", "middle"))
    assert side @ middle < 0.5


def test_tilt_turns_the_indenter_and_not_its_motion(places):
    upright, tilted = read(places)[0], read(places, tilt="0deg,45deg")[0]
    assert tilted.direction == upright.direction
    axes = upright.rotation.T @ tilted.rotation
    np.testing.assert_allclose(axes[:, 1], [0, 1, 0], atol=1e-12)
    assert axes[2, 2] == pytest.approx(math.cos(math.pi / 4))
    assert "tilted 0°, 45°" in describe_pose(tilted)
    assert not tilted.is_close_to(upright)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"at": "top"}, "unknown place 'top'.*middle"),
        ({"at": "1mm,2mm"}, "is not 3 values"),
        ({"at": "0mm,0mm,90mm"}, "the nearest point is"),
        ({"at": 3}, "must be a text"),
        ({"direction": "down"}, "three numbers"),
        ({"direction": "0,0,0"}, "not zero"),
        ({"direction": "0,nan,1"}, "three numbers"),
        ({"direction": "1e400,0,1"}, "finite"),
        ({"tilt": "45deg"}, "two angles"),
        ({"tilt": "0deg,95deg"}, "at most 80 deg"),
        ({"yaw": "3"}, "yaw"),
    ],
)
def test_each_fault_is_one_line_with_its_place(places, table, said):
    found, faults = read(places, **table)
    assert found is None
    (line,) = faults
    assert line.startswith(f"case[0].{next(iter(table))}")
    assert re.search(said, line)


def test_places_on_a_planar_array_may_lack_the_height(pad_places):
    """Two values are the place of the middle texel, three a point."""
    two, three = (read(pad_places, at=text)[0] for text in ("1mm,-2mm", "1mm,-2mm,2mm"))
    np.testing.assert_allclose(two.position, three.position, atol=1e-12)
    for text in ("1mm", "1mm,2mm,3mm,4mm"):
        found, faults = read(pad_places, at=text)
        assert found is None
        assert re.search("is not 3 values", faults[0])


def test_the_default_campaign_presses_three_directions_and_scales_its_loads(small_pad, solid_places):
    campaign = read_campaign(None, solid_places)
    assert (len(campaign.cases), len(campaign.quick), campaign.left_out) == (16, 6, ())
    stiff = dataclasses.replace(small_pad.cover.material, parameters={"youngs_modulus": 4e6})
    cover = dataclasses.replace(
        small_pad.cover, layers=(dataclasses.replace(small_pad.cover.layers[0], material=stiff),)
    )
    scaled = read_campaign(None, dataclasses.replace(solid_places, cover=cover))
    for first, second in zip(campaign.cases, scaled.cases, strict=True):
        assert second.load == pytest.approx(4 * first.load, rel=0.02)


CASE = """
[[case]]
name = "a"
indenter = "sphere:radius=4mm"
load = "0.3 N"
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CASE.replace("load =", "path =").replace('"0.3 N"', '["0.3 N"]'), "earlier loads do not matter"),
        (CASE + CASE.replace('"a"', '"b"'), "is the same press as"),
        ("loads_for = 3\n" + CASE, "loads_for: must be"),
        ("loads_for = { modulus = '0 MPa', thickness = '2 mm' }\n" + CASE, "must be positive"),
        ("loads_for = { modulus = '1 mm', thickness = '2 mm' }\n" + CASE, "loads_for.modulus"),
    ],
)
def test_faults_of_a_campaign_on_a_curved_cover(solid_places, text, said):
    try:
        lines = parse_campaign(parse_toml(text), solid_places, source="mine.toml").left_out
    except InputError as error:
        lines = error.faults
    assert any(said in line and line.startswith("mine.toml: ") for line in lines)


def test_keys_of_curved_covers_are_refused_on_flat_ones(small_pad):
    for text, said in (
        ("loads_for = { modulus = '1 MPa', thickness = '2 mm' }\n" + CASE, "loads_for: is for curved covers"),
        (CASE + "direction = 'normal'\n", "direction: is for curved covers"),
    ):
        with pytest.raises(InputError, match=said):
            parse_campaign(parse_toml(text), FlatPlaces(array=small_pad.array), source="mine.toml")


def test_loads_of_a_file_are_taken_as_they_are(solid_places):
    assert parse_campaign(parse_toml(CASE), solid_places, source="mine.toml").cases[0].load == 0.3
