"""The scene of a press holds MuJoCo's contacts and the indenter's geometry."""

import numpy as np
import pytest

import fastmodel
from fem_reference.closed_form.layer import tabulate_texel_response
from meshes import TexelArray
from validation.campaign.case import Case
from validation.published import scene as module
from validation.published.scene import bin_on_texels, convolve, make_scene, scale_to_load, sink, sink_springs


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
    np.testing.assert_allclose(scene.plate.normals, np.tile([0.0, 0.0, 1.0], (len(scene.plate.points), 1)), atol=1e-6)
    assert not scene.plate.texels.any()
    assert scene.load == 2.0


def test_a_law_that_is_not_linear_sinks_until_it_carries_the_load():
    """Forces 1e7 d^2 at three points: (x^2 + (x - 1e-4)^2) 1e7 = 2.6 at x = 4.1e-4, where the third is not touched."""
    gaps = np.array([0.3e-3, 0.2e-3, 0.7e-3, np.inf])
    low, high = 4.1e-4, 3.1e-4
    depths = sink(gaps, lambda depth: 1e7 * depth**2, 1e7 * (low**2 + high**2))
    np.testing.assert_allclose(depths, [high, low, 0.0, 0.0], rtol=1e-7)


@pytest.mark.parametrize(
    ("forces", "load", "found", "outside"),
    [
        ([1.0, 3.0, 0.0], 2.0, [0.5, 1.5, 0.0], 0.0),
        ([0.0, 0.0, 0.0], 2.0, [0.0, 0.0, 0.0], 2.0),
    ],
)
def test_forces_are_scaled_to_the_load_or_all_of_it_is_outside(forces, load, found, outside):
    scaled = scale_to_load(np.array(forces), load)
    assert (scaled.texels.tolist(), scaled.outside) == (found, outside)


def test_an_image_is_convolved_row_by_row_with_zeros_beside_the_array():
    array, kernel = TexelArray.grid(2, 3, 1e-3), np.arange(1.0, 10.0).reshape(3, 3)
    found = convolve(array, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 2.0]), kernel)
    # kernel about texel (0, 0), and twice about (1, 2)
    np.testing.assert_allclose(found, [5, 6 + 2 * 1, 2 * 2, 8, 9 + 2 * 4, 2 * 5])


def test_the_map_has_twelve_cells_per_pitch_around_the_axis(press):
    scene = press(Case.read("ball", "sphere:radius=2mm", "1 N", at="1.2mm,-0.8mm"))
    spacing = 3.4e-3 / 12
    assert scene.map.area == pytest.approx(spacing**2)
    index = scene.map.points / spacing - 0.5
    np.testing.assert_allclose(index, np.rint(index), atol=1e-6)
    away = np.hypot(*(scene.map.points - [1.2e-3, -0.8e-3]).T)
    assert away.max() < 2e-3
    assert len(away) == pytest.approx(np.pi * (2e-3 / spacing) ** 2, rel=0.05)
    np.testing.assert_allclose(scene.map.gaps, 2e-3 - np.sqrt(4e-6 - away**2), atol=1e-12)


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
    method = module._RecordingBoxes()
    for x, texel, force in ((1.0e-3, 5, 3.0), (1.004e-3, 5, 4.0), (1.0e-3, 6, 5.0), (1.02e-3, 5, 6.0)):
        point = np.array([[x, 0.0, 0.0]])
        method.recorded.append(module.Contacts(point, normal, np.array([force]), np.array([texel]), depths))
    merged = method.contacts(chattering=True)  # within 10 um and on one texel
    assert merged.texels.tolist() == [5, 6, 5]
    np.testing.assert_allclose(merged.forces, [7 / 4, 5 / 4, 6 / 4])


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


def test_the_plate_is_as_wide_and_high_as_the_array(press):
    """84 texels of 3.4 mm in 6 columns and 14 rows: a ball stands 1 mm from the corner of 10.2 mm x 23.8 mm."""
    scene = press(Case.read("ball", "sphere:radius=5mm", "1.5 N", at="9.2mm,22.8mm"))
    assert scene.plate.pushes.sum() == pytest.approx(1.5, rel=1e-3)
    np.testing.assert_allclose(scene.plate.points[:, :2], np.tile([9.2e-3, 22.8e-3], (len(scene.plate.points), 1)))
