"""SDF and URDF models of arrays, against a parser of their own kind, and closed forms."""

from __future__ import annotations

import dataclasses
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel.adapters.rigid_models import compute_inertia, list_boxes, write_sdf, write_urdf
from tests.support.bent_array import bent_array


@pytest.fixture(scope="module", params=["wts-0614-34", "sdh2-distal", "bent"])
def parameters(request):
    if request.param != "bent":
        return fastmodel.load(request.param)
    flat = fastmodel.load("wts-0614-34")
    return dataclasses.replace(flat, array=bent_array(), surface=None, tables={})


@pytest.fixture(scope="module", params=["plate", "boxes"])
def boxes(parameters, request):
    method = "boxes" if request.param == "boxes" or parameters.surface is None else "cover"
    return list_boxes(parameters, method=method)


def parse(text):
    return ET.fromstring(text)  # noqa: S314 -- ours


def read_pose(text):
    numbers = [float(word) for word in text.split()]
    return np.array(numbers[:3]), Rotation.from_euler("xyz", numbers[3:])


def read_shapes(model, *, kind):
    """Position, orientation and size of each shape of one kind, in SDF or URDF."""
    for shape in model.iter(kind):
        box = shape.find("geometry/box")
        if box is None:
            continue
        origin = shape.find("origin")
        text = shape.findtext("pose") if origin is None else f"{origin.get('xyz')} {origin.get('rpy')}"
        size = box.get("size") or box.findtext("size")
        yield *read_pose(text), np.array([float(word) for word in size.split()])


def test_boxes_are_texels_with_their_outer_faces_in_place(parameters):
    array, found = parameters.array, list_boxes(parameters, method="boxes")
    assert [box.name for box in found] == [f"texel{i}" for i in range(array.count)]
    outer = [box.position + box.orientation.as_matrix()[:, 2] * box.size[2] / 2 for box in found]
    np.testing.assert_allclose(outer, array.centres, atol=1e-12)
    np.testing.assert_allclose([box.orientation.as_matrix()[:, 2] for box in found], array.normals, atol=1e-12)
    np.testing.assert_allclose([box.size[:2] for box in found], [array.pitch] * array.count, atol=1e-12)
    if array.planar:  # the plate extends one pitch beyond the texels
        (plate,) = list_boxes(parameters)
        np.testing.assert_allclose(plate.size[:2], array.extent + 2 * np.array(array.pitch), atol=1e-12)
        assert plate.position[2] == pytest.approx(-plate.size[2] / 2)


def test_sdf_names_are_unique_and_every_box_is_watched(boxes):
    for mass in (None, 0.02):
        root = parse(write_sdf(boxes, name="array", rate_hz=271.0, mass=mass))
        for parent in ("model", "model/link"):
            names = [child.get("name") for child in root.find(parent) if child.get("name")]
            assert len(set(names)) == len(names)
        assert root.get("version") == "1.9"
        assert root.findtext("model/static") == ("true" if mass is None else "false")
        watched = {sensor.findtext("contact/collision") for sensor in root.iter("sensor")}
        assert watched == {shape.get("name") for shape in root.iterfind("model/link/collision")}


@pytest.mark.parametrize("write", [lambda boxes: write_sdf(boxes, name="a", rate_hz=271.0), None], ids=["sdf", "urdf"])
def test_poses_and_sizes_are_those_of_the_boxes(boxes, write):
    root = parse(write(boxes) if write else write_urdf(boxes, name="a"))
    for kind in ("collision", "visual"):
        shapes = list(read_shapes(root, kind=kind))
        assert len(shapes) == len(boxes)
        for (position, turn, size), box in zip(shapes, boxes, strict=True):
            np.testing.assert_allclose(position, box.position, atol=1e-12)
            np.testing.assert_allclose(turn.as_matrix(), box.orientation.as_matrix(), atol=1e-10)
            np.testing.assert_allclose(size, box.size, rtol=1e-11)


def test_mujoco_reads_the_urdf_back(boxes):
    """MuJoCo has a URDF reader of its own; poses, sizes, mass and inertia come back."""
    keep = '<mujoco><compiler fusestatic="false" inertiafromgeom="false"/></mujoco><link'
    model = mujoco.MjModel.from_xml_string(write_urdf(boxes, name="array", mass=0.02).replace("<link", keep, 1))
    assert model.ngeom == len(boxes)
    np.testing.assert_allclose(2 * model.geom_size, [box.size for box in boxes], rtol=1e-9)
    np.testing.assert_allclose(model.geom_pos, [box.position for box in boxes], atol=1e-9)
    for quaternion, box in zip(model.geom_quat, boxes, strict=True):
        turn = Rotation.from_quat(quaternion, scalar_first=True)
        assert (turn.inv() * box.orientation).magnitude() < 1e-7
    centre, inertia = compute_inertia(boxes, 0.02)
    body = model.body("array")
    assert body.mass[0] == pytest.approx(0.02)
    np.testing.assert_allclose(body.ipos, centre, atol=1e-9)
    axes = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
    np.testing.assert_allclose(axes @ np.diag(body.inertia) @ axes.T, inertia, rtol=1e-6, atol=1e-6 * inertia.max())


def test_inertia_agrees_with_mujoco(boxes):
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="array")
    volume = sum(box.size.prod() for box in boxes)
    for box in boxes:
        turn = box.orientation.as_quat(scalar_first=True)
        mass = 0.02 * box.size.prod() / volume
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=box.size / 2, pos=box.position, quat=turn, mass=mass)
    compiled = spec.compile().body("array")
    centre, inertia = compute_inertia(boxes, 0.02)
    np.testing.assert_allclose(compiled.ipos, centre, atol=1e-12)
    np.testing.assert_allclose(np.sort(compiled.inertia), np.linalg.eigvalsh(inertia), rtol=1e-6)


def test_sdf_holds_mass_inertia_rates_and_colours(boxes):
    centre, inertia = compute_inertia(boxes, 0.02)
    root = parse(write_sdf(boxes, name="pad", rate_hz=271.0, mass=0.02))
    inertial = root.find("model/link/inertial")
    pose = [float(word) for word in inertial.findtext("pose").split()]
    np.testing.assert_allclose(pose, [*centre, 0, 0, 0], atol=1e-12)
    assert float(inertial.findtext("mass")) == 0.02
    rows = {"x": 0, "y": 1, "z": 2}
    for entry in inertial.find("inertia"):
        expected = inertia[rows[entry.tag[1]], rows[entry.tag[2]]]
        assert float(entry.text) == pytest.approx(expected, abs=1e-9 * inertia.max())
    link = root.find("model/link")
    for box, sensor, visual in zip(boxes, link.iterfind("sensor"), link.iterfind("visual"), strict=True):
        assert (sensor.get("name"), sensor.get("type")) == (f"{box.name}_contact", "contact")
        assert float(sensor.findtext("update_rate")) == 271.0
        assert sensor.findtext("contact/topic") == f"pad/{box.name}"
        for light in ("ambient", "diffuse"):
            colour = [float(word) for word in visual.findtext(f"material/{light}").split()]
            np.testing.assert_allclose(colour, box.colour)


def test_urdf_names_a_colour_once_and_uses_it_after(boxes):
    root, colours = parse(write_urdf(boxes, name="pad", mass=0.02)), {}
    assert root.find("link/inertial/origin").get("rpy") == "0 0 0"
    for box, visual in zip(boxes, root.iterfind("link/visual"), strict=True):
        material = visual.find("material")
        if (colour := material.find("color")) is not None:
            assert material.get("name") == f"colour{len(colours)}"
            colours[material.get("name")] = [float(word) for word in colour.get("rgba").split()]
        np.testing.assert_allclose(colours[material.get("name")], box.colour)
    assert len(colours) == len({tuple(box.colour) for box in boxes})
