import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fastmodel
from fastmodel import WTS_0614_34, FastModelError, Gaussian, Parameters
from fastmodel.attachment import refuse_overlaps
from meshes import TexelArray
from tests.support.bent_array import bent_array


def test_overlapping_texels_are_refused_when_a_sensor_is_attached_but_those_of_a_bent_sheet_may_touch():
    wide = TexelArray.grid(4, 4, 3e-3, texel_size=3.5e-3, name="wide")
    parameters = Parameters(array=wide, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34)
    with pytest.raises(FastModelError, match=r"'wide': texels 0 and \d overlap \(42 pairs"):
        fastmodel.attach(mujoco.MjSpec(), "world", parameters)
    refuse_overlaps(bent_array())


@given(st.integers(1, 6), st.integers(1, 6), st.floats(1e-4, 1e-2), st.floats(0.5, 2), st.floats(0.1, 1.019))
def test_a_grid_is_accepted_up_to_texels_as_wide_as_the_pitch(rows, columns, pitch, ratio, share):
    sizes = (share * pitch, share * ratio * pitch)
    refuse_overlaps(TexelArray.grid(rows, columns, (pitch, ratio * pitch), texel_size=sizes))


@given(st.integers(2, 6), st.floats(1.03, 1.5))
def test_a_row_of_wider_texels_is_refused(columns, share):
    with pytest.raises(FastModelError, match=f"{columns - 1} pairs"):
        refuse_overlaps(TexelArray.grid(1, columns, 3e-3, texel_size=share * 3e-3))


def test_texels_that_face_away_do_not_overlap():
    array = TexelArray.grid(1, 2, 3e-3)
    both = np.zeros((2, 3))
    with pytest.raises(FastModelError):
        refuse_overlaps(dataclasses.replace(array, centres=both))
    refuse_overlaps(dataclasses.replace(array, centres=both, normals=np.array([[0, 0, 1.0], [0, 0, -1.0]])))
