"""Every line of a data sheet of a small oblong array against values worked out by hand."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from fastmodel import Butterworth, Electronics, Gaussian, Parameters
from fastmodel.validity import Validity
from meshes import TexelArray
from validation.data_sheet import make_datasheet

ACTIVE = np.arange(15) != 13
ARRAY = TexelArray.grid(5, 3, (2e-3, 3e-3), texel_size=(1.5e-3, 2.6e-3), active=ACTIVE)
ELECTRONICS = Electronics(
    rate_hz=120.0, sensitivity=800.0, offset=-100.0, output_max=3100, noise=2.5e-3, hysteresis_share=0.2,
    hysteresis_width=0.04, temperature_coefficient=0.004, temperature_excess=30.0, creep=0.03, high_pass_hz=0.25,
    gains=tuple(np.linspace(0.5, 1.5, 15).tolist()),
)  # fmt: skip
SPREAD = Gaussian(sigma_x=0.5, sigma_y=0.8, ksize_x=3, ksize_y=5)
RANGE = Validity(
    ball_radius=2e-3, load_2_percent=1.25, load_5_percent=3.75, depth_2_percent=1e-4, depth_5_percent=2e-4,
    largest_load=5.0, strain="small",
)  # fmt: skip
GIVEN = Parameters(
    array=ARRAY, spread=SPREAD, electronics=ELECTRONICS, filter=Butterworth(cutoff_hz=35.0, order=3), validity=RANGE,
    provenance={"estimator": "by hand", "electronics_assumed": ("noise", "creep")},
)  # fmt: skip
#: 3000 counts are reached where 2000 a + 500 a^2 = 3000; half of the applied force a acts on the texel.
BENT = Electronics(
    rate_hz=90.0, sensitivity=1.0, characteristic=(0.0, 2000.0, 500.0, 0.0, 0.0, 0.0), output_max=3000,
    calibrated="through the cover, tip 1.5 mm", tip_share=0.5,
)  # fmt: skip
END = (-2000 + math.sqrt(4e6 + 6e6)) / 1000


def list_lines(**changes):
    return make_datasheet(dataclasses.replace(GIVEN, **changes), None).as_json()["entries"]


LINES = {
    "size": ("5.5 x 14.6 mm, 3 columns x 5 rows (14 texels measure)",
             {"size_m": [5.5e-3, 14.6e-3], "columns": 3, "rows": 5, "active_texels": 14}),
    "cover": ("not stated: parameters do not describe the cover", {"cover_thickness_m": None, "cover_assumed": None}),
    "sensitivity": ("800 counts per N on a texel",
                    {"sensitivity_per_N": 800.0, "sensitivity_applied_per_N": 800.0}),
    # half a count more than the offset gives one count, and half a count less than the largest the largest
    "range": ("0.1256 N to 3.999 N on a texel; counts up to 3100",
              {"range_N": [100.5 / 800, 3199.5 / 800], "largest_count": 3100}),
    "force_resolution": ("1.25 mN per count, without noise", {"force_resolution_N": 1.25e-3}),
    "spatial_resolution": ("not stated: the parameters hold no point response; pitch 2 x 3 mm",
                           {"spatial_resolution_m": None, "pitch_m": [2e-3, 3e-3]}),
    # 2.3548 times 0.5 of 2 mm, and 0.8 of 3 mm
    "width_of_the_point_spread": ("2.35 x 5.65 mm (sigma 0.5 x 0.8 pitches)",
                                  {"spread_width_m": [2.35482e-3, 5.651568e-3], "spread_sigma_pitches": [0.5, 0.8]}),
    "error_of_place": ("not stated: the cover is not known", {"place_error_m": None}),
    "least_force": ("not stated: the cover is not known", {"least_force_N": None}),
    "high-pass": ("0.25 Hz (first order)", {"high_pass_hz": 0.25}),
    "bandwidth": ("35 Hz (Butterworth, order 3); 120 frames/s hold up to 60 Hz",
                  {"bandwidth_hz": 35.0, "rate_hz": 120.0}),
    "accuracy": ("not stated; noise 2.5 mN on each texel force", {"accuracy_N": None, "noise_N": 2.5e-3}),
    "accuracy_of_the_fast_model": ("force on wrong texels: at most 2 % up to 1.25 N, 5 % up to 3.75 N",
                                   {"model_load_2_percent_N": 1.25, "model_load_5_percent_N": 3.75}),
    "hysteresis": ("16 mN", {"hysteresis_N": 0.016}),
    "creep": ("3 % in a factor e of time", {"creep_per_ln_time": 0.03}),
    "linearity": ("not stated: a straight line is given", {"nonlinearity": None}),
    "temperature": ("0.4 % per kelvin", {"temperature_per_K": 0.004}),
}  # fmt: skip


@pytest.fixture(scope="module")
def lines():
    return list_lines()


def test_the_lines_are_those_of_the_table(lines):
    assert list(lines) == list(LINES)


@pytest.mark.parametrize("name", LINES)
def test_a_line_has_the_text_and_the_values_that_are_worked_out_by_hand(lines, name):
    text, values = LINES[name]
    line = lines[name]
    assert line["text"] == text
    assert line["stated"] == (not text.startswith("not stated"))
    for key, value in values.items():
        assert line[key] == (value if value is None else pytest.approx(value, rel=2e-4)), key
    assert set(line) == {"text", "stated", "definition", "source", *values}


def test_a_bent_characteristic_has_the_slope_of_its_line_and_its_distance_from_it():
    """The line through a parabola c a^2 has the slope c END, and is c END^2 / 6 from it at both ends."""
    lines = list_lines(electronics=BENT)
    slope = 2000 + 500 * END
    assert lines["sensitivity"]["sensitivity_applied_per_N"] == pytest.approx(slope, rel=1e-3)
    assert lines["sensitivity"]["sensitivity_per_N"] == pytest.approx(2 * slope, rel=1e-3)
    assert lines["sensitivity"]["text"].endswith(" counts per N on a texel (2581 per N under the calibration tip)")
    assert lines["range"]["range_N"][1] == pytest.approx(END / 2, rel=1e-3)
    assert lines["linearity"]["nonlinearity"] == pytest.approx(500 * END**2 / 6 / 3000, rel=5e-3)
    assert lines["linearity"]["text"] == "3.8 % of full scale"
    assert lines["force_resolution"]["force_resolution_N"] == pytest.approx(0.5 / slope, rel=1e-3)


def test_counts_that_bend_into_saturation_are_not_linear():
    """Up to the knee of 900 counts the line is straight; then 900 + 100 (1 - exp(-(s - 900) / 100)) follows."""
    bent = Electronics(rate_hz=90.0, sensitivity=1000.0, output_max=1000, saturation_band=100.0)
    force = np.linspace(0.0005, 0.9 - 0.1 * math.log(0.5 / 100), 50_001)
    counts = np.where(force > 0.9, 1000 - 100 * np.exp(-(1000 * force - 900) / 100), 1000 * force)
    line = np.polyval(np.polyfit(force, counts, 1), force)
    lines = list_lines(electronics=bent)
    assert lines["linearity"]["nonlinearity"] == pytest.approx(np.abs(counts - line).max() / 1000, rel=0.02)
    assert lines["range"]["range_N"] == pytest.approx([0.0005, 0.9 - 0.1 * math.log(0.005)], rel=5e-3, abs=1e-5)


@pytest.mark.parametrize(
    ("changes", "name", "source"),
    [
        ({}, "sensitivity", "partly assumed (noise, creep), else the folder of parameters, [electronics]"),
        ({"provenance": {}}, "sensitivity", "the folder of parameters, [electronics]"),
        ({"provenance": {}}, "range", "the folder of parameters, [electronics]"),
        ({"provenance": {}}, "width_of_the_point_spread", "not stated"),
        ({}, "width_of_the_point_spread", "by hand"),
        ({}, "bandwidth", "[filter]"),
        ({"filter": None}, "bandwidth", "no [filter] is given"),
        ({"provenance": {}}, "temperature", "the folder of parameters, [electronics]"),
        ({"electronics": Electronics(rate_hz=1.0, sensitivity=1.0)}, "temperature", "not stated"),
        ({"provenance": {}}, "hysteresis", "the folder of parameters, [electronics]"),
    ],
)
def test_a_line_names_its_origin(changes, name, source):
    assert list_lines(**changes)[name]["source"] == source


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("accuracy", "not stated"), ("hysteresis", "not stated"), ("creep", "not stated"),
        ("temperature", "not stated"), ("bandwidth", "not stated; 1 frames/s hold up to 0.5 Hz"),
        ("accuracy_of_the_fast_model", "not stated"), ("range", "0.5003 N to 4094 N on a texel; counts up to 4095"),
    ],
)  # fmt: skip
def test_what_is_not_given_is_not_stated(name, text):
    bare = {"electronics": Electronics(rate_hz=1.0, sensitivity=1.0), "filter": None, "validity": None}
    line = list_lines(**bare)[name]
    found = re.sub(r"^0\.50\d+ N to 409\d\S* N", "0.5003 N to 4094 N", line["text"])
    assert found == text
    assert "high-pass" not in list_lines(**bare)


def test_the_picture_shows_the_spread_of_a_load_on_the_middle_texel():
    """Sums of the Gaussian over whole texels: texel [2, 1] has the most, its neighbours along y more than along x."""
    sheet = make_datasheet(GIVEN, None)
    shown = dict(re.findall(r"<title>(\[\d, \d\]) ([\d.e+-]+) %</title>", sheet.picture))
    values = {place: float(value) for place, value in shown.items()}
    matrix = np.asarray(SPREAD.operator(ARRAY))
    assert max(values, key=values.get) == "[2, 1]"
    assert values["[2, 1]"] == pytest.approx(100 * matrix[7, 7], rel=1e-3)
    assert values["[3, 1]"] == pytest.approx(values["[1, 1]"])
    assert values["[3, 1]"] == pytest.approx(100 * matrix[10, 7], rel=1e-3)
    assert values["[2, 0]"] == pytest.approx(100 * matrix[6, 7], rel=1e-3)
    assert values["[3, 1]"] > values["[2, 0]"]
    assert "[1, 1]" in shown
    assert "[4, 1] no texel" in sheet.picture
    assert sheet.title == f"Data sheet: {ARRAY.name}"


def test_the_page_of_a_sheet_shows_commands_as_code_and_bars_in_tables_are_no_cells():
    sheet = make_datasheet(GIVEN, None)
    entry = dataclasses.replace(sheet.entries[0], text="a|b <c>", definition="see `softcover derive`")
    changed = dataclasses.replace(sheet, entries=(entry,))
    assert changed.markdown().splitlines()[-1] == "| size | a\\|b <c> | see `softcover derive` | the array |"
    assert "<td>a|b &lt;c&gt;</td><td>see <code>softcover derive</code></td><td>the array</td>" in changed.html()
