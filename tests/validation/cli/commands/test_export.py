import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel.adapters.gazebo import read_block


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
    }
    plate = printed["method"] in {"cover", "foundation"}
    assert model.ngeom == (1 if plate else 84)
    bound = {"array": parameters.array, "name": "wts-0614-34", "cells": parameters.cells}
    reading = fastmodel.METHODS[printed["method"]].bind(model, **bound).at_rest(np.zeros(84))
    assert reading.carried == 0.0
    with pytest.raises(fastmodel.LifeCycleError):
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
