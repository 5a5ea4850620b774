"""The common data types of recordings, their times and their hashes."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from meshes import TexelArray
from meshes.catalogue import ARRAYS
from validation.recordings import Recording, Setup
from validation.recordings.recording import (
    find_pressed_array,
    make_array,
)


def _make_recording(times):
    return Recording(
        path=Path("a"), sha256="", started=datetime(2026, 1, 1, tzinfo=UTC), times=np.array(times), arrays=()
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


def test_the_array_that_changes_most_is_the_pressed_one():
    """Changes count over time and over the full scale; a load that rests counts by its height over the median."""
    steep = np.tile(1000 * np.arange(4), (3, 1))  # differs from texel to texel, not in time
    rising = np.array([[5, 5, 5, 5], [5, 60, 5, 5], [5, 130, 5, 5]])
    small = make_array(1, 4, counts=rising, full_scale=4095)
    fine = make_array(1, 4, counts=10 * rising, full_scale=65535)  # a smaller change over its scale

    def find(*arrays):
        return find_pressed_array(replace(_make_recording([0.0, 1.0, 2.0]), arrays=arrays))

    still = make_array(1, 4, counts=steep, full_scale=4095)
    assert find(still, small, fine) == 1
    assert find(fine, small) == 1
    assert find(still, make_array(1, 4, counts=rising[:1].repeat(3, axis=0))) == 0
    assert find(make_array(1, 4), still) == 1
    # a change of exactly the limit is none yet: the texel that stands out decides
    edge = make_array(1, 2, counts=np.array([[0, 0], [0, 2]]), full_scale=100)
    over = make_array(1, 2, counts=np.array([[0, 0], [0, 3]]), full_scale=100)
    resting = make_array(1, 2, counts=np.array([[0, 90], [0, 90]]), full_scale=100)
    assert find(edge, resting) == 1
    assert find(over, resting) == 0
