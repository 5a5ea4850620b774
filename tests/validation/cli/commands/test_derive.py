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


def test_derive_prints_one_json_object_and_writes_its_files(softcover, monkeypatch, wts_derivation):
    def derive(_sensor, *, progress):
        progress("finite elements")
        return wts_derivation

    monkeypatch.setattr("validation.derivation.derive.derive", derive)
    monkeypatch.setattr("validation.cli.output.LINE_INTERVAL", -1.0)
    status, out, err = softcover("derive", "wts-0614-34", "--json", "--out", "derived")
    assert err.startswith("[  0.")
    assert err.endswith("wrote cover.npz, derive.json, parameters.toml, psf.png to derived\n")
    result = json.loads(out)
    assert status == 0
    assert result["psf"]["sigma_x"] == wts_derivation.fit.gaussian.sigma_x
    assert json.loads(Path("derived/derive.json").read_text()) == result
    assert fastmodel.load("derived").spread.sigma_x == result["psf"]["sigma_x"]
    assert Path("derived/psf.png").stat().st_size > 1000


@pytest.mark.slow
def test_derive_uses_the_material_and_thickness_of_the_options(softcover):
    _, out, _ = softcover("derive", "wts-0614-34", "--material", "dragon-skin-30", "--thickness", "3mm", "--json")
    cover = json.loads(out)["cover"]
    assert cover["assumed"] is False
    assert (cover["layers"][0]["material"], cover["thickness_m"]) == ("dragon-skin-30", 3e-3)


def test_each_row_prints_its_own_number(wts_derivation):
    made = replace(
        wts_derivation.result,
        error_estimate={"total_force": 0.001, "sigma": math.nan},
        resolution=1.81e-3,
        sensitivity={"thickness": 63.0, "poisson_ratio": -1.5},
        depth={"foundation": {"modulus": 1.38e9}},
        validity={"load_2_percent": 1.5, "load_5_percent": 4.25},
    )
    table = tabulate_facts("made", "made up", made)
    assert (table.name, table.caption, tuple(table.headings)) == ("made", "made up", ("quantity", "value"))
    rows = {name.text: value.text for name, value in table.rows}
    assert (
        rows.items()
        >= {
            "two-point separation at the base [mm]": "1.81",
            "estimated error, total force [%]": "0.10",
            "estimated error, sigma [%]": "\u2013",
            "sigma by thickness [pitches per mm]": "0.0630",
            "sigma by Poisson ratio [pitches per 0.01]": "-0.0150",
            "foundation modulus [N/mm3]": "1.38",
            "fast model misplaces at most 5 % up to [N]": "4.25",
        }.items()
    )
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
