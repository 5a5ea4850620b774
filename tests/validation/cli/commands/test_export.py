import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel.adapters.gazebo import read_block
from fastmodel.adapters.rigid_models import compute_inertia, list_boxes
from meshes import TexelArray
from tests.support.bent_array import bent_array


def test_the_reports_plugin_block_is_written_and_reads_back(softcover):
    status, _, _ = softcover("export", "wts-0614-34", "--format", "gazebo", "--out", "out")
    assert status == 0
    block = read_block(Path("out/wts-0614-34.xml").read_text(), pitch=3.4e-3)
    assert block.parameters.spread == fastmodel.load("out").spread


def test_an_array_that_no_plugin_block_can_hold_is_refused_before_the_work(softcover, without_reference):
    status, _, err = softcover("export", "sdh2-distal", "--format", "gazebo", "--thickness", "1mm", "--out", "masked")
    assert status == 2
    assert "no texel may be masked" in err
    assert not Path("masked").exists()


@pytest.fixture
def exported(softcover):
    """Export a sensor: what was printed, the loaded model and the parameters."""

    def run(sensor, *words):
        status, out, _ = softcover("export", sensor, "--out", "out", *words, "--json")
        assert status == 0
        return json.loads(out), mujoco.MjModel.from_xml_path(f"out/{sensor}.xml"), fastmodel.load("out")

    return run


def test_exported_texels_have_the_positions_of_the_array(exported):
    _, model, parameters = exported("sdh2-distal", "--method", "area")
    centres = parameters.array.centres
    assert model.ngeom == len(centres)
    places = np.array([model.geom(f"sdh2-distal/texel{i}").pos for i in range(len(centres))])
    np.testing.assert_allclose(places[:, :2], centres[:, :2], atol=1e-9)


@pytest.mark.parametrize("method", ["default", "boxes"])
def test_only_the_method_of_an_exported_model_can_read_it(exported, method):
    printed, model, parameters = exported("wts-0614-34", "--method", method)
    assert printed == {
        "sensor": "wts-0614-34",
        "format": "mjcf",
        "method": "cover" if method == "default" else method,
        "out": "out",
        "files": ["wts-0614-34.xml", "parameters.toml", "cover.npz"],
        "warnings": [],
    }
    plate = printed["method"] in {"cover", "foundation"}
    assert model.ngeom == (1 if plate else 84)
    bound = {"array": parameters.array, "name": "wts-0614-34", "surface": parameters.surface}
    reading = fastmodel.METHODS[printed["method"]].bind(model, **bound).at_rest(np.zeros(84))
    assert reading.carried == 0.0
    with pytest.raises(fastmodel.errors.LifeCycleError):
        fastmodel.METHODS["boxes" if plate else "cover"].bind(model, **bound)


def test_the_plugin_block_refuses_a_contact_method(softcover, tmp_path):
    status, out, err = softcover("export", "wts-0614-3", "--format", "gazebo", "--method", "boxes")
    assert (status, out) == (2, "")
    assert [line.split(": ")[1] for line in err.splitlines()] == ["--method", "wts-0614-3"]
    assert list(tmp_path.iterdir()) == []


def test_a_derived_folder_exports_what_it_holds(softcover, without_reference):
    fastmodel.load("sdh2-distal").save("derived")
    assert softcover("export", "derived", "--out", "out", "--method", "area")[0] == 0
    assert Path("out/cover.npz").read_bytes() == Path("derived/cover.npz").read_bytes()
    assert mujoco.MjModel.from_xml_path("out/sdh2-distal.xml").ngeom == 78


@pytest.mark.parametrize("form", ["sdf", "urdf"])
def test_models_for_other_simulators_are_beside_the_parameters(softcover, form):
    words = ("--format", form, "--mass", "20g", "--method", "boxes", "--out", "out")
    status, out, _ = softcover("export", "wts-0614-34", *words, "--json")
    assert status == 0
    assert json.loads(out)["files"] == [f"wts-0614-34.{form}", "parameters.toml", "cover.npz"]
    text = Path(f"out/wts-0614-34.{form}").read_text()
    assert text.count("<collision name=") == 84
    assert "0.02" in text


@pytest.mark.parametrize("sensor", ["wts-0614-34", "sdh2-distal", "bent"])
def test_an_array_converted_to_mjcf_and_back_keeps_every_texel(softcover, sensor):
    given = fastmodel.load("wts-0614-34" if sensor == "bent" else sensor)
    if sensor == "bent":
        given = dataclasses.replace(given, array=bent_array(), surface=None, tables={})
    given.save("derived")
    assert softcover("export", "derived", "--out", "out", "--method", "boxes")[0] == 0
    (path,) = Path("out").glob("*.xml")
    model, wanted = mujoco.MjModel.from_xml_path(str(path)), given.array
    axes = np.array([Rotation.from_quat(q, scalar_first=True).as_matrix() for q in model.geom_quat])
    found = TexelArray(
        centres=model.geom_pos + axes[:, :, 2] * model.geom_size[:, 2:],
        normals=axes[:, :, 2],
        texel_size=tuple(2 * model.geom_size[0, :2]),
        pitch=tuple(2 * model.geom_size[0, :2]),
        rows=wanted.rows,
        columns=wanted.columns,
        active=model.geom_rgba[:, 3] == 1,
    )
    assert [model.geom(i).name for i in range(model.ngeom)] == [f"{path.stem}/texel{i}" for i in range(wanted.count)]
    for name, digits in {"centres": 1e-8, "pitch": 1e-8, "normals": 2e-6, "active": 0}.items():  # MJCF has 6 digits
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=0, atol=digits)
    back = fastmodel.load("out").array
    for name in ("centres", "normals", "texel_size", "pitch", "active"):
        np.testing.assert_array_equal(getattr(back, name), getattr(wanted, name))


@pytest.mark.slow
def test_another_parser_reads_the_urdf(softcover, tmp_path):
    """The package yourdfpy, installed beside the test, finds the same poses, sizes and mass."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--target", "packages", "yourdfpy"]
    subprocess.run(pip, check=True)  # noqa: S603 -- ours
    assert softcover("export", "sdh2-distal", "--format", "urdf", "--mass", "20g", "--method", "boxes")[0] == 0
    code = (
        "import json, yourdfpy\n"
        "link = yourdfpy.URDF.load('softcover-out/sdh2-distal.urdf').link_map['sdh2-distal']\n"
        "boxes = [[*shape.origin.ravel(), *shape.geometry.box.size] for shape in link.collisions]\n"
        "print(json.dumps([boxes, link.inertial.mass, len(link.visuals), link.inertial.inertia.tolist()]))"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "packages")}
    done = subprocess.run(  # noqa: S603 -- ours
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    found, mass, visuals, inertia = json.loads(done.stdout)
    boxes = list_boxes(fastmodel.load("sdh2-distal"), method="boxes")
    assert (mass, visuals) == (0.02, len(boxes))
    np.testing.assert_allclose(inertia, compute_inertia(boxes, 0.02)[1], rtol=1e-9)
    for numbers, box in zip(found, boxes, strict=True):
        pose = np.reshape(numbers[:16], (4, 4))
        np.testing.assert_allclose(pose[:3, :3], box.orientation.as_matrix(), atol=1e-9)
        np.testing.assert_allclose(pose[:3, 3], box.position, atol=1e-9)
        np.testing.assert_allclose(numbers[16:], box.size, rtol=1e-9)
