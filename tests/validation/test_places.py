"""Places, directions and rotations by name or number, on flat and on solid covers."""

import dataclasses
import math
import re

import numpy as np
import pytest

from meshes.bounded_file import parse_toml
from meshes.solids import fingertip
from tests.support.rubber import make_cover
from validation.campaign.campaign_file import parse_campaign, read_campaign
from validation.campaign.case import describe_pose
from validation.cover_meshes import make_meshes
from validation.errors import InputError
from validation.moving.history import read_moving
from validation.places import FlatPlaces, SolidPlaces, find_middle, find_places
from validation.sensor_file import CURVED


@pytest.fixture(scope="module")
def solid_places(small_pad):
    return find_places(small_pad.cover, small_pad)


@pytest.fixture(scope="module")
def places():
    """Places on a fingertip, on a coarse mesh."""
    tip = CURVED["fingertip"]
    cover = dataclasses.replace(tip.cover, make=lambda *_: (fingertip().mesh(2e-3, layers=2),), _made={})
    return SolidPlaces(sensor=dataclasses.replace(tip, cover=cover))


def read(places, **texts):
    """Read a pose as a campaign file does."""
    return places.find(places.parse({"at": "centre", **texts}, "case[0]."))


def test_oblique_directions_have_30_degrees_to_the_normal_and_differ(places):
    straight, x, y = (read(places, direction=name).towards for name in ("normal", "oblique x", "oblique y"))
    for oblique in (x, y):
        assert math.degrees(math.acos(straight @ oblique)) == pytest.approx(30, abs=1e-9)
    assert math.degrees(math.acos(x @ y)) > 30


def test_named_places_lie_above_active_texels(places):
    named = places.named
    texels = places.sensor.array
    far = np.linalg.norm(texels.centres - named["middle"], axis=1)
    assert np.linalg.norm(named["edge"] - named["middle"]) > 0.6 * far.max()
    assert 0 < np.linalg.norm(named["off grid"] - named["middle"]) < texels.pitch[0] / 2
    side, middle = (read(places, at=name).towards for name in ("side", "middle"))
    assert side @ middle < 0.5


def test_named_places_lie_inside_the_border_of_the_top(places):
    corners = places.top.facets[:, [0, 2, 8, 6]]
    edges, count = np.unique(
        np.sort(np.stack([corners, np.roll(corners, 1, axis=1)], axis=2), axis=2).reshape(-1, 2),
        axis=0,
        return_counts=True,
    )
    border = places.top.nodes[np.unique(edges[count == 1])]
    for name in ("edge", "side"):
        assert np.linalg.norm(border - places.named[name], axis=1).min() > places.thickness


def test_tilt_turns_the_indenter_and_not_its_motion(places):
    upright, tilted = read(places), read(places, tilt="0deg,45deg")
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
    with pytest.raises(InputError) as caught:
        read(places, **table)
    (line,) = caught.value.faults
    assert line.startswith(f"case[0].{next(iter(table))}")
    assert re.search(said, line)


def test_places_on_a_planar_array_may_lack_the_height(solid_places):
    """Two values are the place of the middle texel, three a point."""
    two, three = (read(solid_places, at=text) for text in ("1mm,-2mm", "1mm,-2mm,2mm"))
    np.testing.assert_allclose(two.position, three.position, atol=1e-12)
    for text in ("1mm", "1mm,2mm,3mm,4mm"):
        with pytest.raises(InputError, match="is not 3 values"):
            read(solid_places, at=text)


def test_every_name_of_a_flat_cover_is_one_of_a_solid(small_pad, solid_places):
    flat = FlatPlaces(array=small_pad.array)
    assert flat.named.keys() < solid_places.named.keys()
    for name in ("centre", "middle", "off grid"):
        np.testing.assert_allclose(read(flat, at=name).at, read(solid_places, at=name).at, atol=1e-9)
    assert read(flat, direction="normal") == read(flat)


def test_without_a_place_the_indenter_stands_above_a_texel_with_a_surface_above_it(small_pad):
    def touch(sensor, **texts):
        places = find_places(sensor.cover, sensor)
        return places.find(places.parse(texts, "--"))

    mesh, texels = make_meshes(small_pad)[-1], small_pad.array
    middle = find_middle(texels)
    assert middle == 4
    np.testing.assert_allclose(touch(small_pad).point, [0, 0, 2e-3], atol=1e-9)
    turned = touch(small_pad, at="1mm,2mm", direction="0,3,-4")
    np.testing.assert_allclose(turned.point, [1e-3, 2e-3, 2e-3], atol=1e-9)
    np.testing.assert_allclose(turned.direction, [0, 0.6, -0.8])
    np.testing.assert_allclose(turned.rotation[:, 2], [0, -0.6, 0.8], atol=1e-12)
    with pytest.raises(InputError, match=r"--at: the place is .* mm from the cover"):
        touch(small_pad, at="0mm,0mm,9mm")
    # Without a surface along its normal the middle texel is left for its neighbours.
    alone = np.where(np.arange(texels.count) == middle, 1, 0)[:, None]
    away = np.where(alone, [0.0, 0.0, -1.0], texels.normals)
    beside = texels.centres + alone * np.array([3e-3, 0.0, 0.0])
    sensor = dataclasses.replace(small_pad, array=dataclasses.replace(texels, normals=away, centres=beside))
    places = SolidPlaces(sensor=sensor)
    places.__dict__["mesh"] = mesh
    found = places.find(places.parse({}, "--"))
    assert np.abs(found.point[:2] - texels.centres[middle, :2]).max() == pytest.approx(texels.pitch[0])
    away = np.tile([0.0, 0.0, -1.0], (texels.count, 1))
    far = dataclasses.replace(texels, normals=away, centres=texels.centres + np.array([3e-3, 0, 0]))
    high = dataclasses.replace(texels, centres=texels.centres - np.array([0, 0, 5e-3]))  # the top of another side
    for array in (far, high):
        places = SolidPlaces(sensor=dataclasses.replace(sensor, array=array))
        places.__dict__["mesh"] = mesh
        with pytest.raises(InputError, match="no texel has a surface of the cover above it"):
            places.find(places.parse({}, "--"))


def test_the_place_on_a_fingertip_is_pressed_along_its_normal(places):
    np.testing.assert_allclose(read(places, at="0mm,8mm,0mm").direction, [0, -1, 0], atol=0.05)


def test_the_default_campaign_presses_three_directions_and_scales_its_loads(small_pad, solid_places):
    campaign = read_campaign(None, solid_places)
    assert (len(campaign.cases), len(campaign.quick), campaign.left_out) == (18, 7, ())
    stiff = dataclasses.replace(small_pad.cover.layers[0].material, parameters={"youngs_modulus": 4e6})
    cover = dataclasses.replace(
        small_pad.cover, layers=(dataclasses.replace(small_pad.cover.layers[0], material=stiff),)
    )
    scaled = read_campaign(None, SolidPlaces(sensor=dataclasses.replace(small_pad, cover=cover)))
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
        (CASE + "direction = 'oblique x'\n", "direction: is for curved covers"),
    ):
        with pytest.raises(InputError, match=said):
            parse_campaign(parse_toml(text), FlatPlaces(array=small_pad.array), source="mine.toml")


BALL = {"name": "x", "indenter": "sphere:radius=3mm"}
SECOND = BALL | {"load": "1 N", "others": [{"indenter": "sphere:radius=3mm", "load": "1 N", "at": "edge"}]}
DROP = BALL | {"time": ["0 s", "0.5 s"], "load": "0.1 N"}


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"fall": "3 mm"}, "moving[0].fall: motions along a curved cover and falls on it"),
        ({"at": ["middle", "edge"]}, "moving[0].at: motions along a curved cover and falls on it"),
    ],
)
def test_motions_and_bodies_on_curved_covers_are_left_out_before_a_mesh_is_made(small_pad, table, said, monkeypatch):
    """Also on a top that faces upwards."""
    monkeypatch.setattr(SolidPlaces, "find", lambda *_: pytest.fail("located"))
    places = find_places(small_pad.cover, small_pad)
    (fault,) = read_moving([DROP | table], places)[1]
    assert fault.startswith(said)
    with pytest.raises(InputError, match=r"mine.toml: case\[0\].others: several bodies are computed only on wide flat"):
        parse_campaign({"case": [SECOND]}, places, source="mine.toml")


@pytest.mark.parametrize(("friction", "model"), [(0.3, "linear-elastic"), (0.0, "neo-hookean")])
def test_bodies_on_flat_covers_that_are_rubbed_or_not_linear_are_left_out_when_read(small_pad, friction, model):
    places = FlatPlaces(array=small_pad.array, cover=make_cover(model=model), friction=friction)
    with pytest.raises(InputError, match=r"case\[0\].others: several bodies"):
        parse_campaign({"case": [SECOND]}, places, source="mine.toml")


def test_loads_of_a_file_are_taken_as_they_are(solid_places):
    assert parse_campaign(parse_toml(CASE), solid_places, source="mine.toml").cases[0].load == 0.3
