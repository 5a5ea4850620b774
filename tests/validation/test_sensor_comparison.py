"""Published sensors, their sources, and sensors side by side."""

from __future__ import annotations

import json
import re

import pytest

import fastmodel
from validation.data_sheet import make_datasheet
from validation.errors import InputError
from validation.sensor_comparison import put_side_by_side
from validation.sensor_file import PUBLISHED, load

#: A year, a DOI or an address, by which a source can be found again.
FINDABLE = re.compile(r"\d{4}\)|@\w{8}|doi:|\.com|\.org|data sheet|manual|page|the same|that package", re.IGNORECASE)
GOOD = """
[array]
rows = 2
columns = 3
pitch = ["4 mm", "5 mm"]
[cover]
layer = [{ thickness = "1 mm", material = "tpu" }]
[electronics]
"""


@pytest.fixture
def sensor(tmp_path):
    def write(more):
        path = tmp_path / "own.toml"
        path.write_text(GOOD + more)
        return path

    return write


def test_each_published_number_names_where_it_is_stated():
    assert len(PUBLISHED) >= 8
    for each in put_side_by_side(PUBLISHED):
        assert {"texels", "pitch"} <= set(each.sources) <= set(each.values), each.name
        assert all(FINDABLE.search(source) for source in each.sources.values()), each.sources


@pytest.mark.parametrize("name", PUBLISHED)
def test_what_no_source_states_is_assumed_and_said(name):
    description = load(name)
    (row,) = put_side_by_side([name])
    assert description.source == f"built-in {name}"
    assert (description.electronics.rate_hz == 100.0) <= ("rate" not in row.sources or name == "takkstrip")
    assert ("rate" in row.sources) or any("frames/s" in each for each in description.assumed_electronics)
    assert description.cover.assumed
    assert ("cover" in row.sources) == (row.cells[5] != "not stated") == (name == "takkstrip")


def test_the_phalanx_of_the_hand_saturates_at_the_pressure_of_its_data_sheet():
    electronics = load("sdh2-proximal").electronics
    force = 250e3 * 3.4e-3**2
    assert electronics.sensitivity == pytest.approx(4095 / force)
    assert electronics.counts([0.5 * force]) == pytest.approx([2048], abs=1)
    assert put_side_by_side(["sdh2-proximal"])[0].values["range"] == "2.89 N on a texel"


def test_a_data_sheet_tells_a_published_thickness_from_an_assumed_modulus():
    cover = make_datasheet(fastmodel.load("wts-0614-34"), load("takkstrip")).as_json()["entries"]["cover"]
    assert cover["text"] == "6 mm linear-elastic (assumed)"
    assert cover["source"].startswith("partly assumed, thickness alone: element14.com")


def test_a_file_of_ones_own_is_its_own_source(sensor):
    path = sensor('range = "2 N"\nbits = 10\n')
    (row,) = put_side_by_side([path])
    assert row.values["range"] == "2 N on a texel"
    assert load(path).electronics.sensitivity == pytest.approx(1023 / 2)
    assert row.cells == ["3 columns x 2 rows", "4 x 5 mm", "not stated", "2 N on a texel", "10", "1 mm tpu"]
    assert row.origins.endswith("rate 100 Hz: assumed")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('range = "2 N"\nsensitivity = "7 1/N"\n', "electronics.range: stands in place of sensitivity"),
        ('range = "2 N"\ncharacteristic = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]\n', "electronics.range: stands in place"),
        ('high_pass = "50 Hz"\n', "electronics.high_pass: 50 Hz must lie below half of 100 frames/s"),
        ('rate = "30 Hz"\nhigh_pass = "15 Hz"\n', "electronics.high_pass: 15 Hz must lie below half of 30 frames/s"),
    ],
)
def test_keys_that_contradict_each_other_are_refused(sensor, keys, words):
    with pytest.raises(InputError, match=words):
        load(sensor(keys))


@pytest.mark.parametrize("value", ["5", '"5"', '"5 Hz"', '"-5 N"', '"0 kPa"'])
def test_a_range_that_is_neither_force_nor_pressure_is_refused(sensor, value):
    with pytest.raises(InputError, match=r"electronics.range: .*(for example '250 kPa' or '5 N'|must be positive)"):
        load(sensor(f"range = {value}\n"))


def test_the_command_prints_sensors_side_by_side(softcover):
    status, out, _ = softcover("datasheet", "wts-0614-34", "--compare", "pr2-fingertip", "myrmex")
    assert status == 0
    assert all(text in " ".join(out.split()) for text in ("5.6 x 6", "1900 Hz", "doi:10.1109/WHC.2011.5945515"))
    status, out, _ = softcover("datasheet", "wts-0614-34", "--compare", "myrmex", "--json")
    assert status == 0
    assert [each["values"]["pitch"] for each in json.loads(out)["sensors"]] == ["3.4 mm", "5 mm"]
    status, _, err = softcover("datasheet", "wts-0614-34", "--compare", "myrmex", "--out", "a.md")
    assert status == 2
    assert "--out: has no effect with --compare" in err
    status, _, err = softcover("datasheet", "wts-0614-34", "--compare", "nothing")
    assert status == 2
    assert "nothing: no such file or built-in sensor" in err
