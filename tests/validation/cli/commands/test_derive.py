import json
import sys
from pathlib import Path

import pytest

import fastmodel
import fem_reference
import fem_reference.linear_response.point_spread
from validation.cli.commands.derive import _list_results


@pytest.fixture
def sensor(tmp_path, softcover):
    assert softcover("init")[0] == 0
    return tmp_path / "sensor.toml"


def test_derive_prints_one_json_object_and_writes_its_files(softcover, monkeypatch):
    monkeypatch.setattr("validation.cli.output.LINE_INTERVAL", -1.0)
    status, out, err = softcover("derive", "wts-0614-34", "--json", "--out", "derived")
    assert err.startswith("[  0.")
    assert err.endswith("wrote parameters.toml, cover.npz, derive.json, psf.png to derived\n")
    result = json.loads(out)
    assert status == 0
    assert 0.3 < result["psf"]["sigma_x"] < 0.8
    assert json.loads(Path("derived/derive.json").read_text()) == result
    assert fastmodel.load("derived").spread.sigma_x == result["psf"]["sigma_x"]
    assert Path("derived/psf.png").stat().st_size > 1000


@pytest.mark.slow
def test_derive_takes_a_sensor_file(softcover, sensor):
    assert 0.3 < json.loads(softcover("derive", sensor, "--json")[1])["psf"]["sigma_x"] < 0.8


@pytest.mark.slow
def test_derive_uses_the_material_and_thickness_of_the_options(softcover):
    _, out, _ = softcover("derive", "wts-0614-34", "--material", "dragon-skin-30", "--thickness", "3mm", "--json")
    cover = json.loads(out)["cover"]
    assert cover["assumed"] is False
    assert (cover["layers"][0]["material"], cover["thickness_m"]) == ("dragon-skin-30", 3e-3)


def test_derive_labels_the_assumed_cover(wts_derivation):
    assert "ASSUMED" in dict(_list_results(wts_derivation))["cover"]


def test_bad_sensor_file_lists_all_faults_and_writes_nothing(softcover, sensor, tmp_path):
    text = sensor.read_text().replace('"2 mm"', '"-2 mm"').replace("0.49", "0.51").replace("rows = 6", "rowz = 6")
    sensor.write_text(text)
    status, out, err = softcover("derive", sensor, "--json", "--out", "derived")
    assert status == 2
    assert out == ""
    for place in ("array.rows", "array.rowz", "cover.layer[0].thickness", "cover.layer[0].material.poisson_ratio"):
        assert sum(f" {place}: " in line for line in err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["sensor.toml"]


def test_solver_that_does_not_converge_is_status_4(softcover, monkeypatch):
    def diverge(*_, **__):
        raise fem_reference.ConvergenceError("contact did not settle after 50 steps")

    monkeypatch.setattr(sys.modules["fem_reference.linear_response.point_spread"], "point_spread", diverge)
    status, _, err = softcover("derive", "wts-0614-34")
    assert (status, err) == (4, "softcover: contact did not settle after 50 steps\n")
