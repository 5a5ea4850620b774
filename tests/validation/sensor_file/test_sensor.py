"""Sensors from files and by built-in name."""

import tomllib

import numpy as np
import pytest

from tests.support.sensor_text import GOOD
from validation.errors import InputError
from validation.sensor_file import BUILT_IN, load, read_template


def test_everything_is_si(sensor):
    description = load(sensor(GOOD + '[filter]\ncutoff = "40 Hz"\norder = 3\n'))
    assert description.array.pitch == pytest.approx((3.4e-3, 3.4e-3))
    assert description.cover.thickness == pytest.approx(2e-3)
    assert description.cover.layers[0].material.youngs_modulus == pytest.approx(1e6)
    assert description.electronics.sensitivity == 2665.7
    assert (description.filter.cutoff_hz, description.filter.order) == (40, 3)
    assert description.cover.assumed is False


def test_cover_of_limited_size_holds_its_texels_and_keeps_its_size_under_another_material(sensor):
    path = sensor(GOOD.replace("[electronics]", "[cover]\nsize = ['6.8 mm', '10.2 mm']\n[electronics]"))
    assert load(path).cover.size == pytest.approx((6.8e-3, 10.2e-3))
    assert load(path, material="dragon-skin-30", thickness="1mm").cover.size == pytest.approx((6.8e-3, 10.2e-3))
    masked = GOOD.replace("rows = 3", "rows = 3\nmask = ['10', '10', '10']\ntexel_size = '3 mm'")
    with_mask = sensor(masked.replace("[electronics]", "[cover]\nsize = ['6.4 mm', '9.8 mm']\n[electronics]"))
    assert load(with_mask).cover.size == pytest.approx((6.4e-3, 9.8e-3))


def test_template_describes_the_default_array(sensor):
    description = load(sensor(read_template()))
    assert tomllib.loads(read_template())["array"]["rows"] == 14
    np.testing.assert_allclose(description.array.centres, BUILT_IN["wts-0614-34"].array.centres)
    assert description.electronics == BUILT_IN["wts-0614-34"].electronics


def test_built_in_names():
    assert load("wts-0614-34").array.count == 84
    assert load("sdh2-distal").array.active.sum() == 68
    assert load("sdh2-distal").cover.assumed


def test_unknown_name_shows_the_nearest():
    with pytest.raises(InputError, match="did you mean 'sdh2-distal'"):
        load("sdh2")


def test_material_and_thickness_replace_the_cover():
    cover = load("wts-0614-34", material="dragon-skin-30", thickness="3mm").cover
    assert (cover.thickness, cover.layers[0].material.name, cover.assumed) == (3e-3, "dragon-skin-30", False)
    assert load("wts-0614-34", thickness="3mm").cover.assumed


def test_bad_replacement_lists_both_faults(faults):
    with pytest.raises(InputError) as caught:
        load("wts-0614-34", material="dragon-skin-3", thickness="3")
    assert [fault.split(":")[0] for fault in caught.value.faults] == ["--material", "--thickness"]
