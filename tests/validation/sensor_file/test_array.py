"""Texels from rows and columns, from a mask and from a table of positions."""

import numpy as np
import pytest

from tests.support.sensor_text import GOOD
from validation.sensor_file import load


def test_texels_anywhere_from_a_table(sensor, tmp_path):
    (tmp_path / "texels.csv").write_text("x,y,z\n" + "".join(f"{i * 1e-2},{i * 2e-3},0\n" for i in range(6)))
    description = load(sensor(GOOD.replace("rows = 3", "rows = 3\npositions = 'texels.csv'")))
    np.testing.assert_allclose(description.array.centres[:, 1], np.arange(6) * 2e-3)
    np.testing.assert_allclose(description.array.normals, np.tile([0, 0, 1], (6, 1)))


def test_positions_alone_make_a_list_of_texels_as_large_as_they_may_be(sensor, tmp_path, faults):
    """Three texels of a honeycomb: their squares are as wide as rows stand apart."""
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,0\n4e-3,0,0\n2e-3,3.4641e-3,0\n")
    alone = (
        GOOD.replace("rows = 3", "positions = 'texels.csv'")
        .replace("columns = 2", "")
        .replace(GOOD.splitlines()[4], "")
    )
    array = load(sensor(alone)).array
    assert (array.rows, array.columns) == (1, 3)
    assert array.pitch == array.texel_size == pytest.approx((3.4641e-3, 3.4641e-3))
    for text, fault in (
        (
            alone.replace("positions = 'texels.csv'", "rows = 3\ncolumns = 2"),
            "array.pitch: is missing; write for example pitch",
        ),
        (alone.replace("[array]", "[array]\nrows = 3"), "array: give both rows and columns, or leave both out"),
        (alone.replace("[array]", "[array]\nmask = ['01']"), "array.mask: must have 1 rows of 3 entries"),
    ):
        assert faults(sensor(text))[0].startswith(fault)
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,0\n0,0,0\n")
    assert "same centre" in faults(sensor(alone))[0]


def test_mask_switches_texels_off(sensor):
    description = load(sensor(GOOD.replace("rows = 3", "rows = 3\nmask = ['01', '11', '11']")))
    assert description.array.active.tolist() == [False, True, True, True, True, True]


def test_a_table_of_positions_may_have_200_bytes_for_each_of_the_most_texels(sensor, tmp_path, faults):
    path = sensor(GOOD.replace("rows = 3", "rows = 3\npositions = 'texels.csv'"))
    text = "x,y,z\n" + "".join(f"{i * 1e-2},{i * 2e-3},0\n" for i in range(6))
    full = text[:-1] + " " * (200 * 10_000 - len(text)) + "\n"
    (tmp_path / "texels.csv").write_text(full)
    assert load(path).array.count == 6
    (tmp_path / "texels.csv").write_text(full + "\n")
    assert "has more than the 1.907 MiB accepted" in faults(path)[0]
