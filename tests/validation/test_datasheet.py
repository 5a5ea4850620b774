"""The data sheet of a sensor, against closed forms."""

from __future__ import annotations

import dataclasses
import re
import sys
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import fastmodel
import validation
from fastmodel import Butterworth, Electronics
from validation.data_sheet import find_nonlinearity, make_datasheet
from validation.sensor_file import BUILT_IN

#: What the data sheet of any sensor must name.
NAMES = {"size", "sensitivity", "range", "spatial_resolution", "bandwidth", "accuracy", "hysteresis", "linearity"}


def change(**electronics):
    parameters = fastmodel.load("wts-0614-34")
    return dataclasses.replace(parameters, electronics=dataclasses.replace(parameters.electronics, **electronics))


def test_what_a_sensor_can_tell_is_that_of_its_limits():
    found = sheet(fastmodel.load("wts-0614-34"), BUILT_IN["wts-0614-34"])
    limits = {each.name: each.value for each in validation.limits("wts-0614-34").counted}
    over, aside = found["least_force"]["least_force_N"]
    assert over == pytest.approx(limits["least force, over the texel"], rel=1e-6)
    assert aside == pytest.approx(limits["least force, worst place"], rel=1e-6)
    assert found["error_of_place"]["place_error_m"] == pytest.approx(limits["place x, force known"], rel=0.1)


def test_what_needs_finite_elements_or_a_cover_is_not_computed():
    parameters = fastmodel.load("wts-0614-34")
    for sensor, words in ((None, "the cover is not known"), (validation.load("fingertip"), "by finite elements")):
        found = sheet(parameters, sensor)
        assert words in found["least_force"]["text"]
        assert found["error_of_place"]["text"].startswith("not stated")


def test_electronics_that_have_no_limits_keep_the_data_sheet():
    found = sheet(change(bits=24, output_max=2**24 - 1), BUILT_IN["wts-0614-34"])
    assert "limits are computed for up to 65535 counts" in found["least_force"]["text"]
    assert found["least_force"]["least_force_N"] is None


def sheet(parameters, sensor=None):
    return make_datasheet(parameters, sensor).as_json()["entries"]


@pytest.mark.parametrize("name", ["wts-0614-34", "sdh2-distal"])
def test_every_entry_has_a_definition_and_a_source_and_is_stated_or_not(name):
    entries = sheet(fastmodel.load(name), BUILT_IN[name])
    assert set(entries) >= NAMES
    for entry in entries.values():
        assert len(entry["definition"]) > 20
        assert entry["source"]
        assert entry["stated"] == (not entry["text"].startswith("not stated"))


def test_the_line_of_the_report_comes_back():
    """Counts leave zero at 0.185 N and saturate at 1.646 N of force applied with the calibration tip."""
    entries = sheet(fastmodel.load("wts-0614-34"))
    share = fastmodel.load("wts-0614-34").electronics.tip_share
    assert entries["sensitivity"]["sensitivity_applied_per_N"] == pytest.approx(2665.7)
    assert entries["sensitivity"]["sensitivity_per_N"] == pytest.approx(2665.7 / share)
    ends = [493.87 / 2665.7 * share, (3895 + 493.87) / 2665.7 * share]
    assert entries["range"]["range_N"] == pytest.approx(ends, rel=2e-3)  # a count is rounded
    assert entries["force_resolution"]["force_resolution_N"] == pytest.approx(share / 2665.7)
    assert not entries["linearity"]["stated"]
    assert entries["size"]["size_m"] == pytest.approx((6 * 3.4e-3, 14 * 3.4e-3))


def test_nothing_is_stated_that_nobody_gave():
    entries = sheet(fastmodel.load("wts-0614-34"))
    for name in ("bandwidth", "accuracy", "hysteresis", "linearity", "temperature"):
        assert not entries[name]["stated"], name
    assert not sheet(dataclasses.replace(fastmodel.load("wts-0614-34"), validity=None))["accuracy_of_the_fast_model"][
        "stated"
    ]
    assert not entries["cover"]["stated"]


def test_parameters_state_the_cover_of_which_they_were_derived():
    cover = {"cover": "1 mm tpu + 0.1 mm pet", "cover_thickness": 1.1e-3, "cover_assumed": False}
    entry = sheet(dataclasses.replace(fastmodel.load("wts-0614-34"), provenance=cover))["cover"]
    assert entry["text"] == "1 mm tpu + 0.1 mm pet"
    assert (entry["cover_thickness_m"], entry["cover_assumed"]) == (1.1e-3, False)
    described = sheet(fastmodel.load("wts-0614-34"), BUILT_IN["wts-0614-34"])["cover"]
    assert (described["text"], described["cover_thickness_m"]) == ("2 mm assumed elastomer", 2e-3)


@pytest.mark.parametrize(
    ("loads", "said"),
    [
        ((1.5, 4), "2 % up to 1.5 N, 5 % up to 4 N"),
        ((0, 4), "at most 5 % up to 4 N"),
        ((0, 0), "above 5 % at every load"),
    ],
)
def test_no_range_ends_at_no_load(loads, said):
    parameters = fastmodel.load("wts-0614-34")
    validity = dataclasses.replace(parameters.validity, load_2_percent=loads[0], load_5_percent=loads[1])
    text = sheet(dataclasses.replace(parameters, validity=validity))["accuracy_of_the_fast_model"]["text"]
    assert text.endswith(said)
    assert "up to 0 N" not in text


def test_filter_noise_hysteresis_and_temperature_are_stated_if_given():
    given = change(noise=2e-3, hysteresis_share=0.3, hysteresis_width=0.05, temperature_coefficient=0.002)
    given = dataclasses.replace(given, electronics=dataclasses.replace(given.electronics, high_pass_hz=0.5))
    entries = sheet(dataclasses.replace(given, filter=Butterworth(cutoff_hz=40.0, order=2)))
    assert entries["high-pass"]["high_pass_hz"] == 0.5
    assert entries["bandwidth"]["bandwidth_hz"] == 40.0
    assert entries["accuracy"]["noise_N"] == 2e-3
    assert not entries["accuracy"]["stated"]
    assert entries["hysteresis"]["hysteresis_N"] == pytest.approx(0.03)
    assert entries["temperature"]["temperature_per_K"] == 0.002


def test_hysteresis_is_what_the_electronics_do():
    electronics = Electronics(rate_hz=100.0, sensitivity=1.0, hysteresis_share=0.3, hysteresis_width=0.05)
    play, seen = np.zeros(1), {}
    for force in [*np.linspace(0, 2, 201), *np.linspace(2, 0, 201)[1:]]:
        out, play = electronics.apply_hysteresis(np.array([force]), play)
        seen.setdefault(round(force, 6), []).append(float(out[0]))
    loop = max(max(both) - min(both) for both in seen.values())
    parameters = change(hysteresis_share=0.3, hysteresis_width=0.05)
    assert sheet(parameters)["hysteresis"]["hysteresis_N"] == pytest.approx(loop, rel=1e-6)


def test_linearity_of_a_parabola():
    """Counts a F + b F^2 over 0..1 deviate from their least-squares line by b/6 at the ends."""
    bent = Electronics(
        rate_hz=100.0, sensitivity=1.0, characteristic=(0.0, 3000.0, 1000.0, 0.0, 0.0, 0.0), output_max=4000
    )
    assert find_nonlinearity(bent) == pytest.approx(1000 / 6 / 4000, rel=5e-3)
    assert find_nonlinearity(Electronics(rate_hz=100.0, sensitivity=1000.0)) is None


def test_a_characteristic_without_an_end_says_so():
    falling = change(characteristic=(0.0, 10.0, 0.0, 0.0, 0.0, -1e-30), tip_share=None, calibrated="texel force")
    flat = change(characteristic=(5.0, 0.0, 0.0, 0.0, 0.0, 0.0), tip_share=None, calibrated="texel force")
    assert sheet(falling)["range"]["range_N"][1] == pytest.approx(3895 / 10, rel=1e-3)
    assert sheet(flat)["range"]["range_N"][1] is None


def test_resolution_agrees_with_the_derivation_and_needs_finite_elements(monkeypatch):
    parameters = fastmodel.load("wts-0614-34")
    found = sheet(parameters)["spatial_resolution"]
    assert found["spatial_resolution_m"] == pytest.approx(4.11e-3, rel=2e-3)
    monkeypatch.setitem(sys.modules, "fem_reference.linear_response.point_spread", None)
    without = sheet(parameters)["spatial_resolution"]
    assert without["spatial_resolution_m"] is None
    assert ".[fem]" in without["text"]


def test_files_hold_every_entry(softcover, tmp_path):
    sheet = make_datasheet(fastmodel.load("sdh2-distal"), BUILT_IN["sdh2-distal"])
    assert softcover("datasheet", "sdh2-distal", "--out", "sheet.md")[0] == 0
    assert (tmp_path / "sheet.md").read_text() == sheet.markdown()
    rows = re.findall(r"^\| (.*?) \|", (tmp_path / "sheet.md").read_text(), flags=re.MULTILINE)
    assert rows[2:] == [entry.name for entry in sheet.entries]
    shares = [float(each) for each in re.findall(r"\] ([\d.e-]+) %</title>", sheet.html())]
    assert len(shares) == 68  # active texels
    assert sum(shares) == pytest.approx(100, abs=1)  # a load on the middle texel, far from the edges
    table = re.search("<table>.*</table>", dataclasses.replace(sheet, sensor="<x>").html(), flags=re.DOTALL)[0]
    cells = [row.findtext("th") for row in ET.fromstring(table).iter("tr")]  # noqa: S314 -- ours
    assert cells[1:] == [entry.name for entry in sheet.entries]
    assert softcover("datasheet", "sdh2-distal", "--out", "sheet.md")[0] == 2
