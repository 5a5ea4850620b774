"""Sensors from files and by built-in name."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from tests.support.sensor_text import GOOD
from validation.errors import InputError
from validation.sensor_file import BUILT_IN, load, parse


def test_everything_is_si(sensor):
    description = load(sensor(GOOD + '[filter]\ncutoff = "40 Hz"\norder = 3\n'))
    assert description.array.pitch == pytest.approx((3.4e-3, 3.4e-3))
    assert description.cover.thickness == pytest.approx(2e-3)
    assert description.cover.layers[0].material.youngs_modulus == pytest.approx(1e6)
    assert description.electronics.sensitivity == 2665.7
    assert (description.filter.cutoff_hz, description.filter.order) == (40, 3)
    assert description.cover.assumed is False
    piezo = load(sensor(GOOD.replace("[electronics]", "[electronics]\nhigh_pass = '0.5 Hz'")))
    assert piezo.electronics.high_pass_hz == 0.5
    assert description.electronics.high_pass_hz is None


def test_cover_of_limited_size_holds_its_texels_and_keeps_its_size_under_another_material(sensor):
    path = sensor(GOOD.replace("[electronics]", "[cover]\nsize = ['6.8 mm', '10.2 mm']\n[electronics]"))
    assert load(path).cover.size == pytest.approx((6.8e-3, 10.2e-3))
    assert load(path, material="dragon-skin-30", thickness="1mm").cover.size == pytest.approx((6.8e-3, 10.2e-3))
    masked = GOOD.replace("rows = 3", "rows = 3\nmask = ['10', '10', '10']\ntexel_size = '3 mm'")
    with_mask = sensor(masked.replace("[electronics]", "[cover]\nsize = ['6.4 mm', '9.8 mm']\n[electronics]"))
    assert load(with_mask).cover.size == pytest.approx((6.4e-3, 9.8e-3))


def test_the_plate_is_as_wide_as_the_cover_that_the_file_states(sensor):
    """Two columns and three rows of 3.4 mm."""
    assert load(sensor(GOOD)).array.margin is None
    stated = load(sensor(GOOD.replace("rows = 3", "rows = 3\nmargin = ['1.2 mm', '0 mm']"))).array
    assert stated.margin == pytest.approx((1.2e-3, 0))
    sized = load(sensor(GOOD.replace("[electronics]", "[cover]\nsize = ['8 mm', '10.2 mm']\n[electronics]"))).array
    assert sized.margin == pytest.approx((0.6e-3, 0), abs=1e-12)
    with pytest.raises(InputError, match=r"array\.margin: must lie in 0"):
        load(sensor(GOOD.replace("rows = 3", "rows = 3\nmargin = '-1 mm'")))


def test_electronics_may_be_left_out_in_part_or_whole(sensor):
    without = load(sensor(GOOD.partition("[electronics]")[0]))
    assert (without.electronics.rate_hz, without.electronics.sensitivity) == (100.0, 1000.0)
    assert without.assumed_electronics == ("100 frames/s", "1000 counts per N on a texel")
    assert load(sensor(GOOD)).assumed_electronics == ()
    part = load(sensor(GOOD.replace('rate = "271 Hz"', "")))
    assert part.assumed_electronics == ("100 frames/s",)
    assert part.electronics.sensitivity == 2665.7


def test_bad_replacement_lists_both_faults(faults):
    with pytest.raises(InputError) as caught:
        load("wts-0614-34", material="dragon-skin-3", thickness="3")
    assert [fault.split(":")[0] for fault in caught.value.faults] == ["--material", "--thickness"]


@given(
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
    st.tuples(st.floats(0.5, 20), st.floats(0.5, 20)),
    st.lists(st.tuples(st.floats(0.1, 20), st.floats(1e-3, 1e3), st.floats(0, 0.5)), min_size=1, max_size=3),
    st.data(),
)
def test_any_valid_sensor_survives_its_file(size, pitch, layers, data):
    (rows, columns), share, output_max = size, data.draw(st.floats(0.1, 1)), data.draw(st.integers(1, 4095))
    mask = np.array(data.draw(st.lists(st.booleans(), min_size=rows * columns, max_size=rows * columns)))
    mask[0] = True
    tables = {
        "array": {
            "rows": rows,
            "columns": columns,
            "pitch": [f"{each!r} mm" for each in pitch],
            "texel_size": [f"{share * each!r} mm" for each in pitch],
            "mask": ["".join("01"[int(each)] for each in row) for row in mask.reshape(rows, columns)],
        },
        "cover": {
            "layer": [
                {
                    "thickness": f"{thickness!r} mm",
                    "material": {"model": "linear-elastic", "youngs_modulus": f"{e!r} MPa", "poisson_ratio": nu},
                }
                for thickness, e, nu in layers
            ]
        },
        "electronics": {"rate": "271 Hz", "sensitivity": "2665.7 1/N", "output_max": output_max},
    }
    found = parse(tomllib.loads(tomli_w.dumps(tables)), source=Path("sensor.toml"))
    assert (found.array.rows, found.array.columns, found.name) == (rows, columns, "sensor")
    assert found.array.pitch == pytest.approx((1e-3 * pitch[0], 1e-3 * pitch[1]))
    np.testing.assert_array_equal(found.array.active, mask)
    assert found.cover.thickness == pytest.approx(1e-3 * sum(thickness for thickness, *_ in layers))
    moduli = [(layer.material.youngs_modulus, layer.material.poisson_ratio) for layer in found.cover.layers]
    np.testing.assert_allclose(moduli, [(1e6 * e, nu) for _, e, nu in layers])
    assert found.electronics.output_max == output_max


@pytest.mark.parametrize(
    ("written", "kept"),
    [
        ("texel force", "texel force"),
        ("through the cover, tip 1 mm", "through the cover, tip 1 mm"),
        ("through the cover, tip 500 um", "through the cover, tip 0.5 mm"),
        ("through the cover, tip 0.1cm", "through the cover, tip 1 mm"),
    ],
)
def test_what_the_characteristic_was_calibrated_against_is_read(sensor, written, kept):
    path = sensor(GOOD + f'calibrated = "{written}"\n')
    assert load(path).electronics.calibrated == kept
    assert load(sensor(GOOD)).electronics.calibrated == "texel force"
    for built_in in BUILT_IN.values():
        assert built_in.electronics.calibrated == "through the cover, tip 1 mm"
