"""The scene of a press holds MuJoCo's contacts and the indenter's geometry."""

import numpy as np
import pytest

import fastmodel
from fem_reference.closed_form.layer import tabulate_texel_response
from meshes import TexelArray
from validation.campaign.case import Case
from validation.published import scene as module
from validation.published.scene import bin_on_texels, make_scene, sink, sink_springs


@pytest.fixture(scope="module")
def press(parameters, bonded):
    cover = bonded(0.45)
    response = tabulate_texel_response(cover, parameters.array.texel_size)
    return lambda case: make_scene(cover, parameters, case, response)


@pytest.mark.parametrize(
    "case",
    [
        Case.read("ball", "sphere:radius=5mm", "3 N", at="1.2mm,-0.8mm"),
        Case.read("box", "box:size=9mmx5mmx5mm", "2 N", at="0.4mm,1.1mm", yaw="30deg"),
    ],
    ids=lambda case: case.name,
)
def test_contacts_are_those_of_the_method_boxes(press, parameters, case):
    scene = press(case)
    boxes = fastmodel.indent(
        parameters, case.indenter, load=case.load, at=case.pose.at, yaw=case.pose.yaw, contact="boxes"
    )
    np.testing.assert_array_equal(scene.boxes.contact_forces, boxes.contact_forces)
    np.testing.assert_array_equal(scene.boxes.texel_forces, boxes.texel_forces)
    contacts = scene.contacts
    by_texel = np.bincount(contacts.texels, contacts.forces * contacts.normals[:, 2], parameters.array.count)
    np.testing.assert_allclose(by_texel, boxes.contact_forces, atol=1e-9)
    assert by_texel.sum() == pytest.approx(case.load, rel=1e-3)
    # each point lies on the texel that it belongs to, and the normals point out of the array
    apart = np.abs(contacts.points[:, :2] - parameters.array.centres[contacts.texels, :2])
    assert (apart <= 1.7e-3 + 2e-4).all()
    assert (contacts.normals[:, 2] > 0.9).all()
    assert (contacts.depths > 0).all()


def test_a_box_on_one_plate_stands_on_its_own_corners(press):
    """On box texels the points of a face lie on the borders of texels; on one plate they do not."""
    scene = press(Case.read("box", "box:size=9mmx5mmx5mm", "2 N", at="0.4mm,1.1mm"))
    corners = {(round(x, 5), round(y, 5)) for x in (-4.1e-3, 4.9e-3) for y in (-1.4e-3, 3.6e-3)}
    assert {(round(x, 5), round(y, 5)) for x, y, _ in scene.plate.points} == corners
    assert scene.plate.pushes.sum() == pytest.approx(2.0, rel=1e-3)


def test_contact_map_covers_the_indenter(press):
    scene = press(Case.read("box", "box:size=9mmx5mmx5mm", "2 N", at="0.4mm,1.1mm", yaw="30deg"))
    assert len(scene.map.gaps) * scene.map.area == pytest.approx(45e-6, rel=0.02)
    np.testing.assert_allclose(scene.map.points.mean(axis=0), [0.4e-3, 1.1e-3], atol=3e-5)
    assert not scene.map.gaps.any()
    turned = np.array([[np.cos(np.pi / 6), np.sin(np.pi / 6)], [-np.sin(np.pi / 6), np.cos(np.pi / 6)]])
    inside = np.abs((scene.array.centres[:, :2] - scene.case.pose.at) @ turned.T) < [4.5e-3, 2.5e-3]
    np.testing.assert_array_equal(np.isfinite(scene.texel_gaps), inside.all(axis=1))


def test_chattering_contacts_are_averaged_by_position(press, monkeypatch):
    method = module._RecordingBoxes()
    normal, depths = np.array([[0.0, 0, 1]]), np.array([1e-6])
    for x, force in ((1.0e-3, 3.0), (1.0e-3, 1.0), (2.0e-3, 2.0), (2.0e-3, 2.0)):
        point = np.array([[x, 0.0, 0.0]])
        method.recorded.append(module.Contacts(point, normal, np.array([force]), np.array([5]), depths))
    merged = method.contacts(chattering=True)
    np.testing.assert_allclose(merged.points[:, 0], [1e-3, 2e-3])
    np.testing.assert_allclose(merged.forces, [1.0, 1.0])
    assert method.contacts(chattering=False).forces == 2.0


@pytest.mark.parametrize("load", [0.05, 0.3, 5.0])
def test_springs_carry_the_load_at_the_depths_of_the_search(load):
    gaps = np.array([0.0, 0.1e-3, 0.25e-3, 0.7e-3, np.inf])
    depths = sink_springs(gaps, 1e3, load)
    assert 1e3 * depths.sum() == pytest.approx(load)
    touching = depths > 0
    np.testing.assert_allclose((depths + gaps)[touching], depths[0])
    np.testing.assert_allclose(sink(gaps, lambda depth: 1e3 * depth, load), depths, rtol=1e-6, atol=1e-15)
    for nothing in (sink_springs(gaps[4:], 1e3, load), sink(gaps[4:], lambda depth: depth, load)):
        assert nothing.tolist() == [0.0]


def test_forces_beside_the_array_are_in_no_bin():
    array = TexelArray.grid(2, 3, (2e-3, 1e-3))
    points = np.array([[-2.9e-3, -0.9e-3], [2.9e-3, 0.9e-3], [3.1e-3, 0.0], [0.0, -1.1e-3]])
    np.testing.assert_allclose(bin_on_texels(array, points, np.array([1.0, 2, 4, 8])), [1, 0, 0, 0, 0, 2])
