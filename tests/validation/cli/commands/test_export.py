import dataclasses
import json
import shlex
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.plugin_block import read_block


def test_the_reports_plugin_block_is_written_and_reads_back(softcover):
    status, _, _ = softcover("export", "wts-0614-34", "--format", "gazebo", "--out", "out")
    assert status == 0
    block = read_block(Path("out/wts-0614-34.xml").read_text(), pitch=3.4e-3)
    assert block.spread == fastmodel.load("out").spread


@pytest.fixture
def exported(softcover):
    """Export a sensor: what was printed, the loaded model and the parameters."""

    def run(sensor, *words):
        status, out, _ = softcover("export", sensor, "--out", "out", *words, "--json")
        assert status == 0
        return json.loads(out), mujoco.MjModel.from_xml_path(f"out/{sensor}.xml"), fastmodel.load("out")

    return run


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
        "scores": {},
    }
    plate = printed["method"] in {"cover", "foundation"}
    assert model.ngeom == (1 if plate else 84)
    bound = {"array": parameters.array, "name": "wts-0614-34", "surface": parameters.surface}
    reading = fastmodel.METHODS[printed["method"]].bind(model, **bound).at_rest(np.zeros(84))
    assert reading.carried == 0.0
    with pytest.raises(fastmodel.errors.LifeCycleError):
        fastmodel.METHODS["boxes" if plate else "cover"].bind(model, **bound)


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


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("wts-0614-34 --format drake --load 5N", "--load: '5N' is no range"),
        ("wts-0614-34 --format drake --load 5N:1N", "the smaller load first"),
        ("wts-0614-34 --format drake --load 2N:2N", "the smaller load first"),
        ("wts-0614-34 --format drake --load -1N:5N", "must be positive"),
        ("wts-0614-34 --format drake --load 0N:5N", "must be positive"),
        ("wts-0614-34 --format drake --load 1:5", "'1' has no unit"),
        ("wts-0614-34 --format drake --load 1mm:5mm", "is not a unit of force"),
        ("wts-0614-34 --format drake --load 1N:nanN", "is not a force"),
        ("wts-0614-34 --format newton --method boxes", "--method: newton"),
        ("wts-0614-34 --format genesis --mass 20g", "--mass: genesis"),
        ("wts-0614-34 --format mjcf --load 1N:5N", "--load: mjcf holds no scored value"),
        ("wts-0614-34 --format gazbo", "gazebo"),
        ("fingertip --format drake", "curved cover"),
        ("fingertip --format drake", "`export --format mjcf`"),
        ("derived --format drake", "no description of the cover"),
    ],
)
def test_nothing_is_scored_or_written_for_what_a_value_cannot_hold(softcover, words, fault):
    fastmodel.load("wts-0614-34").save("derived")
    status, _, err = softcover("export", *words.split(), "--out", "out")
    assert status == 2
    assert fault in err
    assert len(err.strip().splitlines()) == 1
    assert not Path("out").exists()


@pytest.mark.slow
def test_a_scored_value_is_written_with_the_command_that_gives_it_again(softcover):
    words = ("export", "wts-0614-34", "--format", "drake", "--thickness", "1.5mm", "--load", "0.5N:2N")
    status, out, _ = softcover(*words, "--out", "out", "--json")
    assert status == 0
    printed = json.loads(out)
    assert printed["files"] == ["wts-0614-34.sdf", "scored.json", "parameters.toml", "cover.npz"]
    assert printed["scores"]["loads"] == [0.5, 2.0]
    rows = printed["scores"]["rows"]
    assert rows[0]["mean"] < 0.02
    assert rows[1]["mean"] > 0.08
    written = json.loads(Path("out/scored.json").read_text())
    command = written["command"].split()
    assert sorted(command) == sorted(["softcover", *words])
    assert written["cover"]["thickness_m"] == 1.5e-3
    status, out, _ = softcover(*command[1:], "--out", "again", "--json")
    assert json.loads(out)["scores"] == printed["scores"]


@pytest.mark.slow
def test_the_written_command_holds_a_path_with_blanks_as_one_word(softcover):
    assert softcover("init", "--out", "my sensor.toml")[0] == 0
    words = ("export", "my sensor.toml", "--format", "lerobot", "--load", "1N:2N")
    assert softcover(*words, "--out", "out")[0] == 0
    assert shlex.split(json.loads(Path("out/scored.json").read_text())["command"]) == ["softcover", *words]
