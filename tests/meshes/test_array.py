"""Texel arrays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes import TexelArray

COUNTS = st.integers(1, 12)
PITCHES = st.floats(1e-4, 1e-2)


def test_a_grid_is_centred_and_its_texels_go_along_x_first():
    array = TexelArray.grid(14, 6, 3.4e-3)
    assert array.count == 84
    assert np.allclose(array.centres.mean(axis=0), 0, atol=1e-15)
    assert array.centres[1, 0] - array.centres[0, 0] == pytest.approx(3.4e-3)
    assert array.centres[6, 1] - array.centres[0, 1] == pytest.approx(3.4e-3)
    assert array.image(np.arange(84)).shape == (14, 6)
    assert array.image(np.arange(84))[1, 0] == 6
    assert array.extent == pytest.approx((6 * 3.4e-3, 14 * 3.4e-3))
    assert array.middle == 7 * 6 + 3


@given(rows=COUNTS, columns=COUNTS, pitch=st.tuples(PITCHES, PITCHES))
def test_row_and_column_of_an_image_follow_from_the_position(rows, columns, pitch):
    array = TexelArray.grid(rows, columns, pitch)
    column, row = (np.rint(array.centres[:, i] / pitch[i] + (n - 1) / 2) for i, n in enumerate((columns, rows)))
    image = array.image(np.arange(array.count))
    assert np.array_equal(image[row.astype(int), column.astype(int)], np.arange(array.count))
    assert image[rows // 2, columns // 2] == array.middle
    assert array.extent == pytest.approx((columns * pitch[0], rows * pitch[1]))


def test_an_array_is_regular_wherever_it_lies_until_a_texel_moves():
    array = TexelArray.grid(3, 4, 1e-3)
    assert array.regular
    shifted = dataclasses.replace(array, centres=array.centres + np.array([0.1, -0.2, 0.0]))
    assert shifted.regular
    centres = shifted.centres.copy()
    centres[5, 0] += 1e-8
    assert not dataclasses.replace(array, centres=centres).regular


def test_an_array_is_planar_until_a_texel_is_raised_or_tilted():
    array = TexelArray.grid(2, 2, 1e-3)
    assert array.planar
    raised, tilted = array.centres.copy(), array.normals.copy()
    raised[0, 2] = 1e-4
    tilted[0] = (0.6, 0.0, 0.8)
    for change in ({"centres": raised}, {"normals": tilted}):
        other = dataclasses.replace(array, **change)
        assert not other.planar
        assert not other.regular


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rows": 0}, "at least 1"),
        ({"pitch": -1.0}, "positive"),
        ({"active": np.zeros(12)}, "masked"),
        ({"active": np.ones(5)}, "shape"),
        ({"texel_size": 0.0}, "positive"),
    ],
)
def test_bad_grids_are_refused(change, message):
    good = {"rows": 3, "columns": 4, "pitch": 1e-3}
    with pytest.raises(ValueError, match=message):
        TexelArray.grid(**{**good, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rows": 4}, "4 x 2 but there are 4 texel centres"),
        ({"centres": np.zeros((4, 2))}, "shape"),
        ({"normals": np.full((4, 3), 0.5)}, "unit vectors"),
    ],
)
def test_parts_of_an_array_that_do_not_fit_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(TexelArray.grid(2, 2, 1e-3), **change)


def test_arrays_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        TexelArray.grid(2, 2, 1e-3).centres[0, 0] = 1
