from __future__ import annotations

import numpy as np
import pytest

from meshes import TexelArray
from meshes.catalogue import ARRAYS


def test_grid_is_centred_row_major_and_x_fastest():
    array = TexelArray.grid(14, 6, 3.4e-3)
    assert array.count == 84
    assert np.allclose(array.centres.mean(axis=0), 0, atol=1e-15)
    assert array.centres[1, 0] - array.centres[0, 0] == pytest.approx(3.4e-3)
    assert array.centres[6, 1] - array.centres[0, 1] == pytest.approx(3.4e-3)
    assert array.image(np.arange(84)).shape == (14, 6)
    assert array.image(np.arange(84))[1, 0] == 6
    assert array.extent == pytest.approx((6 * 3.4e-3, 14 * 3.4e-3))
    assert array.middle == 7 * 6 + 3


def test_rectangular_pitch_and_smaller_texels():
    array = TexelArray.grid(2, 3, (1e-3, 2e-3), texel_size=0.8e-3)
    assert array.pitch == (1e-3, 2e-3)
    assert array.texel_size == (0.8e-3, 0.8e-3)
    assert array.extent == pytest.approx((2.8e-3, 2.8e-3))


def test_sdh2_distal_has_68_active_texels():
    array = ARRAYS["sdh2-distal"]
    assert array.active.sum() == 68
    assert not array.image(array.active)[:5, [0, 5]].any()
    assert array.image(array.active)[5:].all()


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


def test_arrays_are_frozen():
    with pytest.raises(ValueError, match="read-only"):
        TexelArray.grid(2, 2, 1e-3).centres[0, 0] = 1
