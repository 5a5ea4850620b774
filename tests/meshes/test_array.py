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


@given(rows=COUNTS, columns=COUNTS, pitch=st.tuples(PITCHES, PITCHES))
def test_a_grid_is_centred_and_row_and_column_of_an_image_follow_from_the_position(rows, columns, pitch):
    array = TexelArray.grid(rows, columns, pitch)
    column, row = (array.centres[:, i] / pitch[i] + (n - 1) / 2 for i, n in enumerate((columns, rows)))
    image = array.image(np.arange(array.count))
    assert image.shape == (rows, columns)
    assert np.allclose([row, column], np.indices(image.shape).reshape(2, -1))
    assert np.array_equal(image.ravel(), np.arange(array.count))
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


GRID = {"rows": 2, "columns": 2, "pitch": 1e-3}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TexelArray.grid(**GRID | {"rows": 0}), "at least 1"),
        (lambda: TexelArray.grid(**GRID | {"pitch": -1.0}), "positive"),
        (lambda: TexelArray.grid(**GRID, active=np.zeros(4)), "masked"),
        (lambda: TexelArray.grid(**GRID, active=np.ones(5)), "shape"),
        (lambda: TexelArray.grid(**GRID, texel_size=0.0), "positive"),
        (lambda: dataclasses.replace(TexelArray.grid(**GRID), rows=4), "4 x 2 but there are 4 texel centres"),
        (lambda: dataclasses.replace(TexelArray.grid(**GRID), centres=np.zeros((4, 2))), "shape"),
        (lambda: dataclasses.replace(TexelArray.grid(**GRID), normals=np.full((4, 3), 0.5)), "unit vectors"),
        (lambda: TexelArray.grid(**GRID).centres.fill(1.0), "read-only"),
    ],
)
def test_bad_arrays_and_changes_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
