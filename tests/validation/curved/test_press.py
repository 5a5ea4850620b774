"""Presses of curved covers from a sensor's description."""

import dataclasses
import json

import numpy as np
import pytest

from meshes import Box, Sphere
from validation.campaign.case import Case
from validation.curved.files import write_press
from validation.curved.places import CurvedPlaces, read_pose
from validation.curved.press import make_meshes, press_case, press_sensor
from validation.curved.touch import find_middle, find_touch_place
from validation.errors import InputError
from validation.json_values import json_text
from validation.sensor_file import CURVED


@pytest.fixture(scope="module")
def press(small_pad):
    return press_sensor(small_pad, Sphere(radius=4e-3), shape="sphere:radius=4mm", load=0.5)


def test_the_indenter_stands_above_the_middle_texel(press, small_pad):
    assert find_middle(small_pad.array) == 4
    np.testing.assert_allclose(press.touch.point, [0, 0, 2e-3], atol=1e-9)
    assert np.argmax(press.fem.texel_forces) == 4


def test_forces_balance_as_vectors(press):
    np.testing.assert_allclose(press.fem.force, [0, 0, -0.5], atol=1e-7)
    np.testing.assert_allclose(press.fem.base_force, press.fem.force, atol=1e-9)
    measured = press.fem.unmeasured - press.fem.texel_forces @ press.sensor.array.normals
    np.testing.assert_allclose(measured, press.fem.base_force, atol=1e-9)


def test_the_mesh_is_named_in_the_result(press, small_pad):
    described = json.loads(json_text(press.as_json()))["models"]["fem"]["mesh"]
    assert described["digest"] == make_meshes(small_pad)[-1].digest
    assert described["elements"] == len(press.fem.mesh.cells)


def test_files_hold_the_forces(press, tmp_path, monkeypatch):
    monkeypatch.setattr("validation.curved.files.write_scene", lambda *_: ())
    assert write_press(press, tmp_path) == ("press.json", "texels.csv", "contact.csv", "mesh.npz")
    texels = np.loadtxt(tmp_path / "texels.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(texels[:, -1], press.fem.texel_forces, rtol=1e-6, atol=1e-12)
    contact = np.loadtxt(tmp_path / "contact.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(contact[:, 3:].sum(axis=0), [0, 0, -0.5], atol=1e-6)


def test_the_friction_of_the_file_or_the_option_reaches_the_finite_elements(press, small_pad):
    sticky = dataclasses.replace(small_pad, friction=np.inf)
    ball = Sphere(radius=4e-3)
    found, smooth = (
        press_sensor(sticky, ball, shape="ball", load=0.5, friction=friction).fem for friction in (None, 0.0)
    )
    assert found.assumptions["friction"] == "no slip"
    np.testing.assert_array_equal(smooth.texel_forces, press.fem.texel_forces)
    assert np.abs(found.texel_forces - smooth.texel_forces).max() > 1e-4
    case = Case(name="ball", indenter=ball, shape="ball", load=0.5, pose=press.touch)
    kept = press_case(sticky, case)
    np.testing.assert_array_equal(kept.texel_forces, found.texel_forces)
    rough = dataclasses.replace(small_pad, friction=0.4)
    with pytest.raises(InputError, match=r"contact\.friction: 0\.4 is not computed on curved covers; accepted: 0 and"):
        press_sensor(rough, ball, shape="ball", load=0.5)
    assert np.abs(found.contact_forces[:, :2]).max() > 1e-4


def test_places_and_directions(small_pad):
    mesh, texels = make_meshes(small_pad)[-1], small_pad.array
    touch = find_touch_place(mesh, texels, at=(1e-3, 2e-3), direction=(0.0, 3.0, -4.0))
    np.testing.assert_allclose(touch.point, [1e-3, 2e-3, 2e-3], atol=1e-9)
    np.testing.assert_allclose(touch.direction, [0, 0.6, -0.8])
    np.testing.assert_allclose(touch.rotation[:, 2], [0, -0.6, 0.8], atol=1e-12)
    with pytest.raises(InputError, match="mm from the cover"):
        find_touch_place(mesh, texels, at=(0.0, 0.0, 9e-3))
    turned = np.tile([1.0, 0.0, 0.0], (texels.count, 1))
    away = dataclasses.replace(texels, normals=turned, centres=texels.centres + np.array([3e-3, 0, 0]))
    with pytest.raises(InputError, match="no texel has a surface of the cover above it"):
        find_touch_place(mesh, away)
    high = dataclasses.replace(texels, centres=texels.centres - np.array([0, 0, 5e-3]))  # the top of another side
    with pytest.raises(InputError, match="no texel has a surface of the cover above it"):
        find_touch_place(mesh, high)
    lone = np.where(np.arange(texels.count) == find_middle(texels), 1, 0)[:, None]
    some = dataclasses.replace(
        texels,
        normals=np.where(lone, away.normals, texels.normals),
        centres=np.where(lone, away.centres, texels.centres),
    )
    touch = find_touch_place(mesh, some)  # the nearest of the others
    assert np.abs(touch.point[:2] - texels.centres[find_middle(texels), :2]).max() == pytest.approx(texels.pitch[0])
    tip = CURVED["fingertip"]
    with pytest.raises(InputError, match="three lengths"):
        find_touch_place(tip.cover.meshes()[0], tip.array, at=(0.0, 0.0))


def test_a_pose_by_names_is_that_of_a_campaign_file(small_pad):
    """Also its tilt, and the pose stands in the JSON."""
    texts = {"at": "edge", "direction": "oblique y", "yaw": "20deg", "tilt": "0deg,5deg"}
    pose = read_pose(texts, "--", planar=True)
    press = press_sensor(small_pad, Box(size=(3e-3, 2e-3, 3e-3)), shape="box", load=0.1, pose=pose)
    places = CurvedPlaces(mesh=make_meshes(small_pad)[-1], texels=small_pad.array)
    assert press.touch.is_close_to(places.read(texts, "case", []))
    described = press.as_json()
    assert described["tilt"] == pytest.approx([0.0, np.radians(5)])
    assert described["yaw"] == pytest.approx(np.radians(20))
    np.testing.assert_allclose(described["at"], places.named["edge"], atol=1e-6)
    assert np.dot(described["direction"], [0, 0, -1]) == pytest.approx(np.cos(np.radians(30)))


def test_the_place_on_a_fingertip_is_pressed_along_its_normal():
    tip = CURVED["fingertip"]
    touch = find_touch_place(tip.cover.meshes()[0], tip.array, at=(0.0, 8e-3, 0.0))
    np.testing.assert_allclose(touch.direction, [0, -1, 0], atol=0.01)
