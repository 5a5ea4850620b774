import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import fastmodel
import fem_reference
import fem_reference.linear_response.axisymmetric
from validation.render.table import tabulate_facts


@pytest.fixture
def sensor(tmp_path, softcover):
    assert softcover("init")[0] == 0
    return tmp_path / "sensor.toml"


def test_derive_prints_one_json_object_and_writes_its_files(softcover, monkeypatch):
    monkeypatch.setattr("validation.cli.output.LINE_INTERVAL", -1.0)
    status, out, err = softcover("derive", "wts-0614-34", "--json", "--out", "derived")
    assert err.startswith("[  0.")
    assert err.endswith("wrote cover.npz, derive.json, parameters.toml, psf.png to derived\n")
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


def test_each_row_prints_its_own_number(wts_derivation):
    """The numbers are made up: every one differs from every other."""
    result = wts_derivation.result
    kernel = {
        "sigma_x": 0.51,
        "sigma_y": 0.62,
        "ksize_x": 3,
        "ksize_y": 5,
        "residual": 0.0412,
        "outside_kernel": 0.0523,
    }
    made = replace(
        result,
        psf=replace(result.psf, **kernel, estimator="b", estimates={"a": (0.1, 0.2), "b": (0.51, 0.62)}),
        error_estimate={"total_force": 0.001, "sigma": math.nan},
        resolution=1.81e-3,
        resolution_on_array=8.5e-3,
        sensitivity={"thickness": 63.0, "poisson_ratio": -1.5},
        depth={"foundation": {"modulus": 1.38e9}},
        validity={"load_2_percent": 1.5, "load_5_percent": 4.25},
    )
    rows = {name.text: value.text for name, value in tabulate_facts("made", "made up", made).rows}
    assert rows == {
        "sigma x [pitches]": "0.5100",
        "sigma y [pitches]": "0.6200",
        "ksize x [texels]": "3",
        "ksize y [texels]": "5",
        "load that the kernel puts on wrong texels [%]": "4.12",
        "load beyond the kernel [%]": "5.23",
        "estimator of sigma": "b",
        "sigma x, y by a [pitches]": "0.1000, 0.2000",
        "sigma x, y by b [pitches]": "0.5100, 0.6200",
        "two-point separation at the base [mm]": "1.81",
        "two-point separation with these texels [mm]": "8.50",
        "estimated error, total force [%]": "0.10",
        "estimated error, sigma [%]": "\u2013",
        "sigma by thickness [pitches per mm]": "0.0630",
        "sigma by Poisson ratio [pitches per 0.01]": "-0.0150",
        "foundation modulus [N/mm3]": "1.38",
        "fast model misplaces at most 2 % up to [N]": "1.50",
        "fast model misplaces at most 5 % up to [N]": "4.25",
    }
    unknown = replace(made, resolution=None, depth=None, sensitivity=None, validity="not stated")
    assert len(tabulate_facts("made", "made up", unknown).rows) == len(rows) - 6


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

    monkeypatch.setattr(sys.modules["fem_reference.linear_response.axisymmetric"], "point_spread", diverge)
    status, _, err = softcover("derive", "wts-0614-34")
    assert (status, err) == (4, "softcover: contact did not settle after 50 steps\n")
