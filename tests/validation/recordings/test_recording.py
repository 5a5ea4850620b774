"""The common data types of recordings, their times and their hashes."""

import pytest

from meshes import TexelArray
from meshes.catalogue import ARRAYS
from validation.recordings import Setup
from validation.recordings.recording import (
    make_array,
)


@pytest.mark.parametrize("load", [-1.0, float("nan"), float("inf")])
def test_an_impossible_load_is_refused(load):
    with pytest.raises(ValueError, match="0 N or more"):
        Setup(load=load)


def test_layouts_are_compared_by_position_size_and_mask():
    array = make_array(13, 6)
    assert not array.has_layout_of(ARRAYS["sdh2-distal"])  # some of its texels are missing
    assert array.has_layout_of(TexelArray.grid(13, 6, 3.4e-3))
    assert not array.has_layout_of(TexelArray.grid(6, 13, 3.4e-3))
    assert not array.has_layout_of(TexelArray.grid(13, 6, 3.41e-3))
